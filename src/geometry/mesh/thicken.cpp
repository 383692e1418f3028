#include "meshless_surgery/geometry/mesh/thicken.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>

#include "meshless_surgery/geometry/mesh/isosurface.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mend.h"

namespace meshless {
namespace {

constexpr double kMostCells = 128.0;  // along the longest side, to find the inside of a wall

Vec3 faceNormal(const Points& vertices, const Triangle& t) {  // twice the area long
  return (vertices[t[1]] - vertices[t[0]]).cross(vertices[t[2]] - vertices[t[0]]);
}

/// Whether a triangle or one of its edges points the other way after a move: moved through a point, all edges do.
bool turnsOver(const Points& from, const Triangle& t, const Points& to, const Triangle& moved) {
  if (!(faceNormal(from, t).dot(faceNormal(to, moved)) > 0.0)) return true;
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3;
    if (!((from[t[next]] - from[t[k]]).dot(to[moved[next]] - to[moved[k]]) > 0.0)) return true;
  }
  return false;
}

/// By how much vertices move for 1 m between faces: their normals, longer where faces meet at an angle.
Points offsetsOf(const TriangleMesh& mesh) {
  const Points normals = vertexNormals(mesh);
  std::vector<double> along(normals.size(), 0.0), angles(normals.size(), 0.0);
  for (const Triangle& t : mesh.triangles) {
    const Vec3 face = faceNormal(mesh.vertices, t).stableNormalized();
    for (int k = 0; k < 3; ++k) {
      const Vec3& at = mesh.vertices[t[k]];
      const Vec3 u = mesh.vertices[t[(k + 1) % 3]] - at, v = mesh.vertices[t[(k + 2) % 3]] - at;
      const double angle = std::atan2(u.cross(v).norm(), u.dot(v));
      along[t[k]] += angle * face.dot(normals[t[k]]);
      angles[t[k]] += angle;
    }
  }
  Points offsets(normals.size(), Vec3::Zero());
  for (std::size_t v = 0; v < offsets.size(); ++v)
    if (along[v] > 0.0) offsets[v] = angles[v] / along[v] * normals[v];
  return offsets;
}

Error tooTight(const Vec3& place, double thickness) {
  std::ostringstream text;
  text << "the surface is curved too tightly at " << place.transpose() << " m for a layer of " << thickness
       << " m; accepted: a smaller thickness, or a smoother surface";
  return {ErrorCode::kUnsuitableShape, text.str()};
}

/// How deep places are in a solid [m], between the nodes of a lattice.
class Depths {
 public:
  Depths(const SolidQuery& solid, const Box& bounds, double cell) : lower_(bounds.min), cell_(cell) {
    for (int k = 0; k < 3; ++k) nodes_[k] = static_cast<int>(std::ceil((bounds.max[k] - bounds.min[k]) / cell)) + 1;
    for (int z = 0; z < nodes_[2]; ++z)
      for (int y = 0; y < nodes_[1]; ++y)
        for (int x = 0; x < nodes_[0]; ++x) {
          const Vec3 p = lower_ + cell * Vec3(x, y, z);
          values_.push_back(solid.contains(p) ? solid.distance(p) : -solid.distance(p));
        }
  }

  double deepest() const { return *std::max_element(values_.begin(), values_.end()); }
  double at(const Vec3& p) const {
    Vec3 within = (p - lower_) / cell_;
    int node[3];
    for (int k = 0; k < 3; ++k) {
      node[k] = std::clamp(static_cast<int>(std::floor(within[k])), 0, std::max(nodes_[k] - 2, 0));
      within[k] -= node[k];
    }
    double sum = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
      std::array<int, 3> of{};
      double weight = 1.0;
      for (int k = 0; k < 3; ++k) {
        const int up = corner >> k & 1;
        of[k] = std::min(node[k] + up, nodes_[k] - 1);
        weight *= up ? within[k] : 1.0 - within[k];
      }
      sum += weight * values_[static_cast<std::size_t>((of[2] * nodes_[1] + of[1]) * nodes_[0] + of[0])];
    }
    return sum;
  }

 private:
  Vec3 lower_;
  double cell_;
  int nodes_[3];
  std::vector<double> values_;
};

/// With the surface within it that is `thickness` from it, by a lattice about as fine as its triangles.
Result<TriangleMesh> walled(const TriangleMesh& mesh, double thickness) {
  const Box bounds = boundsOf(mesh.vertices);
  const double size = (bounds.max - bounds.min).maxCoeff();
  const double cell = std::max(size / kMostCells, std::min(thickness, meanEdgeLength(mesh)));
  const Depths depths(SolidQuery(mesh), bounds, cell);
  TriangleMesh inner =
      isosurface([&](const Vec3& p) { return thickness - depths.at(p); }, bounds, Vec3::Constant(cell));
  if (inner.triangles.empty()) {
    std::ostringstream text;
    text << "a wall of " << thickness << " m leaves no cavity; accepted: below " << depths.deepest() << " m";
    return Error{ErrorCode::kUnsuitableShape, text.str()};
  }
  Result<RepairedMesh> mended = repairMesh(inner, MeshRepair::kMend);  // folds that are narrower than the lattice
  if (!mended) return Error{mended.error().code, "inside of the wall: " + mended.error().detail};
  inner = std::move(mended->mesh);
  TriangleMesh wall = mesh;
  const Index count = static_cast<Index>(mesh.vertices.size());
  wall.vertices.insert(wall.vertices.end(), inner.vertices.begin(), inner.vertices.end());
  for (const Triangle& t : inner.triangles) wall.triangles.push_back({t[0] + count, t[2] + count, t[1] + count});
  if (!mesh.patches.empty()) wall.patches.insert(wall.patches.end(), inner.triangles.size(), kOuterPatch);
  return wall;
}

}  // namespace

Result<TriangleMesh> thickened(const TriangleMesh& mesh, double thickness) {
  if (!(thickness > 0.0 && std::isfinite(thickness))) {
    std::ostringstream text;
    text << "thickness is " << thickness << " m; accepted: above 0";
    return Error{ErrorCode::kInvalidArgument, text.str()};
  }
  std::map<std::array<Index, 2>, bool> border;  // edges as their triangle sees them; false once another has it
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) {
      const std::array<Index, 2> edge{t[k], t[(k + 1) % 3]};
      if (!border.emplace(edge, true).second) {
        std::ostringstream text;
        text << "two triangles see the edge at " << mesh.vertices[edge[0]].transpose()
             << " m the same way; accepted: a surface of one side, with at most two triangles at an edge";
        return Error{ErrorCode::kUnsuitableShape, text.str()};
      }
      const auto other = border.find({edge[1], edge[0]});
      if (other != border.end()) border[edge] = other->second = false;
    }
  if (std::none_of(border.begin(), border.end(), [](const auto& edge) { return edge.second; }))
    return walled(mesh, thickness);

  const Points offsets = offsetsOf(mesh);
  const Index count = static_cast<Index>(mesh.vertices.size());
  TriangleMesh layer = mesh;
  for (Index v = 0; v < count; ++v) {
    layer.vertices[v] = mesh.vertices[v] + 0.5 * thickness * offsets[v];
    layer.vertices.push_back(mesh.vertices[v] - 0.5 * thickness * offsets[v]);
  }
  for (const Triangle& t : mesh.triangles) {
    const Vec3 before = faceNormal(mesh.vertices, t);
    const Triangle lower{t[0] + count, t[1] + count, t[2] + count};
    for (const Triangle& moved : {t, lower})
      if (turnsOver(mesh.vertices, t, layer.vertices, moved))
        return tooTight((mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3.0, thickness);
    layer.triangles.push_back({lower[0], lower[2], lower[1]});
  }
  if (!mesh.patches.empty()) layer.patches.insert(layer.patches.end(), mesh.patches.begin(), mesh.patches.end());
  for (const auto& [edge, alone] : border) {
    if (!alone) continue;
    const auto [a, b] = edge;
    layer.triangles.push_back({b, a, a + count});
    layer.triangles.push_back({b, a + count, b + count});
    if (!mesh.patches.empty()) layer.patches.insert(layer.patches.end(), 2, 0);
  }
  return layer;
}

}  // namespace meshless
