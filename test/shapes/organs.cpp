#include "shapes/organs.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/geometry/mesh/isosurface.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "shapes/implicit_shapes.h"

namespace meshless {
namespace {

double carve(double solid, double tool, double k) { return -blend(-solid, tool, k); }

Vec3 turnedZ(const Vec3& p, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {c * p.x() + s * p.y(), c * p.y() - s * p.x(), p.z()};
}

/// One closed embedded surface about the origin. Where a fold falls so between the lattice's nodes that its two sides
/// share an edge, a slightly finer lattice parts them.
TriangleMesh organ(const ScalarField& field, const Box& bounds, Vec3 cell) {
  TriangleMesh mesh;
  for (int attempt = 0; attempt < 10; ++attempt, cell *= 0.97) {
    mesh = isosurface(field, bounds, cell);
    const MeshReport report = inspectMesh(mesh);
    if (report.closed() && report.components == 1 && report.self_intersections == 0) break;
  }
  const Box box = boundsOf(mesh.vertices);
  const Vec3 middle = 0.5 * (box.min + box.max);
  for (Vec3& p : mesh.vertices) p -= middle;
  return mesh;
}

}  // namespace

TriangleMesh liverMesh(unsigned seed) {
  const Unevenness unevenness(seed, 0.09);
  // Seen from the front: x to the patient's left, y up, z towards the viewer. The visceral face lies below.
  const auto field = [&](const Vec3& p) {
    const double right = ellipsoid(turnedZ(p - Vec3(-0.045, 0.0, 0.0), 0.25), Vec3(0.060, 0.072, 0.066));
    const double tip = ellipsoid(turnedZ(p - Vec3(-0.066, -0.040, 0.0), 0.3), Vec3(0.034, 0.042, 0.042));
    const double left = ellipsoid(turnedZ(p - Vec3(0.026, 0.021, -0.004), 0.10), Vec3(0.058, 0.050, 0.042));
    const double end = ellipsoid(turnedZ(p - Vec3(0.070, 0.032, -0.006), 0.20), Vec3(0.040, 0.026, 0.024));
    double d = blend(blend(right, tip, 0.03), blend(left, end, 0.03), 0.03);
    // The notch of the round ligament, from the lower margin up between the lobes, and its groove over the front.
    const Vec3 notch = turnedZ(p - Vec3(0.022, -0.056, 0.0), 0.2);
    d = carve(d, ellipsoid(notch, Vec3(0.010, 0.044, 0.2)), 0.012);
    const Vec3 groove = turnedZ(p - Vec3(0.014, 0.02, 0.068), 0.15);
    d = carve(d, ellipsoid(groove, Vec3(0.006, 0.09, 0.030)), 0.02);
    // The visceral face: hollow, rising towards the left lobe and the lower margin.
    const double floor = -0.022 + 0.09 * (p.x() + 0.04) - 0.10 * p.y() + 0.012 * std::exp(-p.squaredNorm() / 0.0018);
    d = carve(d, p.z() - floor, 0.016);
    return d + 0.0016 * unevenness.at(p);
  };
  return organ(field, {Vec3(-0.15, -0.13, -0.09), Vec3(0.15, 0.13, 0.1)}, Vec3::Constant(0.0058));
}

TriangleMesh kidneyMesh(unsigned seed) {
  const Unevenness unevenness(seed, 0.05);
  // Long along x, the hilum at -y.
  const auto field = [&](const Vec3& p) {
    const Vec3 bent = p + Vec3(0.0, 5.0 * p.x() * p.x() - 0.006, 0.0);
    double d = ellipsoid(bent, Vec3(0.055, 0.028, 0.024 - 0.03 * p.x()));
    d = carve(d, ellipsoid(p - Vec3(0.0, -0.032, 0.0), Vec3(0.014, 0.022, 0.008)), 0.012);
    return d + 0.0006 * unevenness.at(p);
  };
  return organ(field, {Vec3(-0.075, -0.06, -0.05), Vec3(0.075, 0.06, 0.05)}, Vec3::Constant(0.0031));
}

TriangleMesh fishMesh(unsigned seed) {
  const Unevenness unevenness(seed, 0.08);
  // Seen from its side: x towards the head, y up the back, z through the thickness.
  const auto field = [&](const Vec3& p) {
    const double trunk = ellipsoid(p - Vec3(0.045, 0.0, 0.0), Vec3(0.105, 0.044, 0.021));
    const double stalk = ellipsoid(p - Vec3(-0.055, 0.003, 0.0), Vec3(0.075, 0.017, 0.013));
    double d = blend(trunk, stalk, 0.04);
    const Vec3 tail = p - Vec3(-0.118, 0.003, 0.0);
    const double upper = ellipsoid(turnedZ(tail - Vec3(-0.018, 0.028, 0.0), -0.95), Vec3(0.050, 0.019, 0.0095));
    const double lower = ellipsoid(turnedZ(tail - Vec3(-0.018, -0.028, 0.0), 0.95), Vec3(0.050, 0.019, 0.0095));
    d = blend(d, blend(upper, lower, 0.01), 0.012);
    const double dorsal = ellipsoid(turnedZ(p - Vec3(0.026, 0.046, 0.0), 0.30), Vec3(0.050, 0.025, 0.010));
    const double anal = ellipsoid(turnedZ(p - Vec3(-0.020, -0.031, 0.0), 0.7), Vec3(0.030, 0.015, 0.0105));
    const double pelvic = ellipsoid(turnedZ(p - Vec3(0.052, -0.045, 0.0), 0.7), Vec3(0.028, 0.013, 0.010));
    d = blend(d, blend(dorsal, blend(anal, pelvic, 0.005), 0.005), 0.01);
    return d + 0.0004 * unevenness.at(p);
  };
  return organ(field, {Vec3(-0.19, -0.09, -0.04), Vec3(0.18, 0.09, 0.04)}, Vec3(0.0088, 0.0088, 0.0068));
}

TriangleMesh bladderMesh() {
  constexpr double kWall = 0.003;
  const Vec3 half(0.03, 0.025, 0.022);
  const TriangleMesh ball = sphereMesh(1.0, 0.11);
  TriangleMesh mesh = ball;
  const Index first = static_cast<Index>(ball.vertices.size());
  for (Vec3& p : mesh.vertices) p = half.cwiseProduct(p);
  for (const Vec3& p : ball.vertices) mesh.vertices.push_back((half - Vec3::Constant(kWall)).cwiseProduct(p));
  for (const Triangle& t : ball.triangles) mesh.triangles.push_back({t[0] + first, t[2] + first, t[1] + first});
  return mesh;
}

TriangleMesh skinSlabMesh() { return boxMesh(Vec3(0.2, 0.2, 0.01), 40, 40, 2); }

TriangleMesh pegTriangleMesh() {
  constexpr double kOuter = 0.00725, kInner = 0.00475;        // [m] of the circles within
  constexpr double kOuterRound = 0.003, kInnerRound = 0.001;  // [m] of the corners
  constexpr double kHeight = 0.009, kTurn = 2.0 * 3.14159265358979323846;
  constexpr int kAlong = 6, kCorner = 3, kUp = 4;
  // The same number of places on both outlines, so that each has its partner.
  const auto outline = [&](double within, double round) {
    Points places;
    for (int corner = 0; corner < 3; ++corner) {
      const auto at = [&](int of, double turn) -> Vec3 {
        const double angle = 0.25 * kTurn + of * kTurn / 3.0;
        return 2.0 * (within - round) * Vec3(std::cos(angle), std::sin(angle), 0.0) +
               round * Vec3(std::cos(angle + turn), std::sin(angle + turn), 0.0);
      };
      for (int k = 0; k <= kCorner; ++k) places.push_back(at(corner, kTurn / 3.0 * (double(k) / kCorner - 0.5)));
      const Vec3 from = places.back(), way = at(corner + 1, -kTurn / 6.0) - from;
      for (int k = 1; k < kAlong; ++k) places.push_back(from + double(k) / kAlong * way);
    }
    return places;
  };
  const Points walls[] = {outline(kInner, kInnerRound), outline(kOuter, kOuterRound)};
  const auto count = static_cast<Index>(walls[0].size());
  TriangleMesh mesh;
  for (const Points& wall : walls)
    for (int level = 0; level <= kUp; ++level)
      for (const Vec3& p : wall) mesh.vertices.push_back(p + kHeight * (double(level) / kUp - 0.5) * Vec3::UnitZ());
  const auto at = [&](Index wall, Index level, Index k) { return (wall * (kUp + 1) + level) * count + k % count; };
  const auto add = [&](Index a, Index b, Index c, Index d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  for (Index k = 0; k < count; ++k) {
    for (Index level = 0; level < kUp; ++level) {
      add(at(1, level, k), at(1, level, k + 1), at(1, level + 1, k + 1), at(1, level + 1, k));
      add(at(0, level, k + 1), at(0, level, k), at(0, level + 1, k), at(0, level + 1, k + 1));
    }
    add(at(0, kUp, k), at(1, kUp, k), at(1, kUp, k + 1), at(0, kUp, k + 1));
    add(at(1, 0, k), at(0, 0, k), at(0, 0, k + 1), at(1, 0, k + 1));
  }
  return mesh;
}

TriangleMesh cupMesh() {
  constexpr double kOuter = 0.010, kInner = 0.008, kFloor = 0.003, kHeight = 0.046, kPi = 3.14159265358979323846;
  constexpr Index kSides = 32;
  // Its outline from the axis below to the axis within: radius, z.
  const std::array<double, 2> outline[] = {{kOuter, 0.0}, {kOuter, kHeight}, {kInner, kHeight}, {kInner, kFloor}};
  TriangleMesh mesh;
  mesh.vertices = {{0.0, 0.0, 0.0}, {0.0, 0.0, kFloor}};
  for (const auto& [radius, z] : outline)
    for (Index s = 0; s < kSides; ++s)
      mesh.vertices.push_back(
          {radius * std::cos(2.0 * kPi * s / kSides), radius * std::sin(2.0 * kPi * s / kSides), z});
  const auto at = [](Index ring, Index side) { return 2 + ring * kSides + side % kSides; };
  for (Index s = 0; s < kSides; ++s) {
    mesh.triangles.push_back({0, at(0, s + 1), at(0, s)});
    mesh.triangles.push_back({1, at(3, s), at(3, s + 1)});
    for (Index ring = 0; ring < 3; ++ring) {
      mesh.triangles.push_back({at(ring, s), at(ring, s + 1), at(ring + 1, s + 1)});
      mesh.triangles.push_back({at(ring, s), at(ring + 1, s + 1), at(ring + 1, s)});
    }
  }
  return mesh;
}

TriangleMesh block32Mesh() { return boxMesh(Vec3(0.1, 0.1, 0.05), 2, 2, 1); }

}  // namespace meshless
