#include <cmath>
#include <sstream>

#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/io/scene.h"

namespace meshless {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kWantedTriangles = 600.0;
constexpr double kMaxTriangles = 200000.0;

}  // namespace

Result<TriangleMesh> primitiveMesh(const std::string& kind, const std::vector<double>& sizes, double edge) {
  std::vector<const char*> names;
  if (kind == "box") names = {"x", "y", "z"};
  if (kind == "sphere") names = {"radius"};
  if (kind == "cylinder") names = {"height", "radius"};
  if (names.empty())
    return Error{ErrorCode::kInvalidArgument,
                 "primitive is '" + kind.substr(0, 60) + "'; accepted: box, sphere, cylinder"};
  std::ostringstream text;
  if (sizes.size() != names.size()) {
    text << kind << " has " << sizes.size() << " sizes; accepted: " << names.size();
    return Error{ErrorCode::kInvalidArgument, text.str()};
  }
  for (std::size_t k = 0; k < sizes.size(); ++k)
    if (!(sizes[k] >= 1e-4 && sizes[k] <= 1e3)) {
      text << kind << "'s " << names[k] << " is " << sizes[k] << "; accepted: 0.0001 to 1000 m";
      return Error{ErrorCode::kInvalidArgument, text.str()};
    }
  if (!(edge >= 0.0 && edge <= 1e3)) {
    text << "edge is " << edge << "; accepted: 0 to 1000 m";
    return Error{ErrorCode::kInvalidArgument, text.str()};
  }

  double area = 0.0;
  if (kind == "box") area = 2.0 * (sizes[0] * sizes[1] + sizes[1] * sizes[2] + sizes[2] * sizes[0]);
  if (kind == "sphere") area = 4.0 * kPi * sizes[0] * sizes[0];
  if (kind == "cylinder") area = 2.0 * kPi * sizes[1] * (sizes[0] + sizes[1]);
  const double equilateral = 0.25 * std::sqrt(3.0);
  if (edge == 0.0) edge = std::sqrt(area / (equilateral * kWantedTriangles));
  const double least = std::sqrt(area / (equilateral * kMaxTriangles));
  if (edge < least) {
    text << "edge is " << edge << ", too short for a " << kind << " of this size; accepted: from " << least << " m";
    return Error{ErrorCode::kInvalidArgument, text.str()};
  }
  TriangleMesh mesh;
  if (kind == "box") mesh = boxMesh(Vec3(sizes[0], sizes[1], sizes[2]), edge);
  if (kind == "sphere") mesh = sphereMesh(sizes[0], edge);
  if (kind == "cylinder") mesh = cylinderMesh(sizes[0], sizes[1], edge);
  if (mesh.empty()) return Error{ErrorCode::kUnsuitableShape, "the " + kind + " has no surface"};
  return mesh;
}

}  // namespace meshless
