#include "shapes/instruments.h"

#include <algorithm>
#include <cmath>

namespace meshless {
namespace {

constexpr int kSides = 12;  // of what is round

/// A convex section in the plane x, counter-clockwise seen from +x.
struct InstrumentSection {
  double x = 0.0;                          // [m]
  std::vector<std::array<double, 2>> rim;  // [m] y, z
};

/// The hull of sections that have equally many corners, from the first to the last.
TriangleMesh loft(const std::vector<InstrumentSection>& sections) {
  TriangleMesh mesh;
  const Index corners = sections.front().rim.size();
  for (const InstrumentSection& section : sections)
    for (const auto& [y, z] : section.rim) mesh.vertices.emplace_back(section.x, y, z);
  for (Index s = 0; s + 1 < sections.size(); ++s)
    for (Index k = 0; k < corners; ++k) {
      const Index a = s * corners + k, b = s * corners + (k + 1) % corners;
      mesh.triangles.push_back({a, b, b + corners});
      mesh.triangles.push_back({a, b + corners, a + corners});
    }
  const Index last = (sections.size() - 1) * corners;
  for (Index k = 1; k + 1 < corners; ++k) {
    mesh.triangles.push_back({0, k + 1, k});
    mesh.triangles.push_back({last, last + k, last + k + 1});
  }
  return mesh;
}

InstrumentSection disc(double x, double radius) {
  InstrumentSection section{x, {}};
  for (int k = 0; k < kSides; ++k) {
    const double angle = 2.0 * M_PI * k / kSides;
    section.rim.push_back({radius * std::cos(angle), radius * std::sin(angle)});
  }
  return section;
}

/// Flat at y = low, round towards +y.
InstrumentSection dome(double x, double low, double height, double half_width) {
  InstrumentSection section{x, {}};
  for (int k = 0; k <= kSides / 2; ++k) {
    const double angle = M_PI * (2.0 * k / kSides - 0.5);
    section.rim.push_back({low + height * std::cos(angle), half_width * std::sin(angle)});
  }
  return section;
}

/// From a thin edge at y = low to a back at y = high.
InstrumentSection wedge(double x, double low, double high, double edge, double back) {
  return {x, {{low, -0.5 * edge}, {high, -0.5 * back}, {high, 0.5 * back}, {low, 0.5 * edge}}};
}

}  // namespace

TriangleMesh shaftMesh() {
  return loft(
      {disc(-0.300, 0.0025), disc(-0.009, 0.0025), disc(-0.006, 0.0021), disc(-0.001, 0.0019), disc(0.001, 0.0012)});
}

TriangleMesh graspingJawMesh() {
  constexpr double kBack = -0.002, kLength = 0.018, kTooth = 0.0004;
  constexpr int kSections = 15;
  std::vector<InstrumentSection> sections;
  for (int k = 0; k < kSections; ++k) {
    const double share = static_cast<double>(k) / (kSections - 1);
    const bool gap = k % 2 == 1;                          // between two teeth
    const double round = k + 1 == kSections ? 0.5 : 1.0;  // of its nose
    const double low = gap ? kTooth : 0.0;
    sections.push_back(dome(kBack + share * (kLength - kBack), low, round * (0.0019 - 0.0008 * share) - low,
                            round * (0.0020 - 0.0007 * share)));
  }
  return loft(sections);
}

TriangleMesh scissorsBladeMesh() {
  return loft({wedge(-0.0072, 0.0, 0.0036, 0.0008, 0.0010), wedge(0.0, 0.0, 0.0056, 0.0004, 0.0014),
               wedge(0.012, 0.0, 0.0072, 0.0001, 0.0014), wedge(0.039, 0.0, 0.0045, 0.0001, 0.0012),
               wedge(0.054, 0.0, 0.0018, 0.0001, 0.0008), wedge(0.060, 0.0, 0.0002, 0.0001, 0.0002)});
}

TriangleMesh scalpelMesh() {
  return loft({wedge(-0.150, -0.0035, 0.0035, 0.0016, 0.0016), wedge(-0.145, -0.0045, 0.0045, 0.0028, 0.0028),
               wedge(-0.060, -0.0045, 0.0045, 0.0028, 0.0028), wedge(-0.040, -0.0025, 0.0030, 0.0020, 0.0020),
               wedge(-0.032, -0.0025, 0.0030, 0.0006, 0.0006), wedge(-0.026, -0.0035, 0.0030, 0.0001, 0.0005),
               wedge(-0.008, -0.0030, 0.0028, 0.0001, 0.0005), wedge(-0.002, -0.0012, 0.0014, 0.0001, 0.0004),
               wedge(0.0, -0.0001, 0.0001, 0.0001, 0.0001)});
}

}  // namespace meshless
