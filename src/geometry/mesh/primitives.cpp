#include "meshless_surgery/geometry/mesh/primitives.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace meshless {
namespace {

constexpr int kMaxDivisions = 1000;
constexpr double kPi = 3.14159265358979323846;

bool positive(double x) { return x > 0.0 && std::isfinite(x); }

int divisions(double length, double edge, int least = 1) {
  const double n = std::round(length / edge);
  return static_cast<int>(std::clamp(n, static_cast<double>(least), static_cast<double>(kMaxDivisions)));
}

void addQuad(TriangleMesh& mesh, Index a, Index b, Index c, Index d) {
  mesh.triangles.push_back({a, b, c});
  mesh.triangles.push_back({a, c, d});
}

/// The vertices of a lattice's surface, numbered as they are first asked for.
class LatticeVertices {
 public:
  LatticeVertices(TriangleMesh& mesh, const Vec3& size, std::array<int, 3> cells)
      : mesh_(mesh), size_(size), cells_(cells) {}

  Index at(const std::array<int, 3>& ijk) {
    const auto found = numbers_.emplace(ijk, static_cast<Index>(mesh_.vertices.size()));
    if (found.second) {
      Vec3 p;
      // i - (n - i) is odd about the middle: opposite vertices mirror each other to the last bit.
      for (int d = 0; d < 3; ++d) p[d] = size_[d] * (2 * ijk[d] - cells_[d]) / (2.0 * cells_[d]);
      mesh_.vertices.push_back(p);
    }
    return found.first->second;
  }

 private:
  TriangleMesh& mesh_;
  Vec3 size_;
  std::array<int, 3> cells_;
  std::map<std::array<int, 3>, Index> numbers_;
};

/// A vertex of a geodesic triangulation: its lattice weights on the icosahedron's corners, which name it uniquely.
using GeodesicKey = std::array<std::pair<int, int>, 3>;

}  // namespace

TriangleMesh boxMesh(const Vec3& size, double edge) {
  if (!positive(size.x()) || !positive(size.y()) || !positive(size.z()) || !positive(edge)) return {};
  return boxMesh(size, divisions(size.x(), edge), divisions(size.y(), edge), divisions(size.z(), edge));
}

TriangleMesh boxMesh(const Vec3& size, int nx, int ny, int nz) {
  TriangleMesh mesh;
  if (!positive(size.x()) || !positive(size.y()) || !positive(size.z()) || nx < 1 || ny < 1 || nz < 1) return mesh;
  const std::array<int, 3> cells = {nx, ny, nz};
  LatticeVertices vertices(mesh, size, cells);
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;  // u x v = axis
    for (int side = 0; side < 2; ++side)
      for (int j = 0; j < cells[v]; ++j)
        for (int i = 0; i < cells[u]; ++i) {
          std::array<int, 3> corner;
          const auto vertex = [&](int du, int dv) {
            corner[axis] = side * cells[axis];
            corner[u] = i + du;
            corner[v] = j + dv;
            return vertices.at(corner);
          };
          const Index a = vertex(0, 0), b = vertex(1, 0), c = vertex(1, 1), d = vertex(0, 1);
          if (side == 1)
            addQuad(mesh, a, b, c, d);
          else
            addQuad(mesh, a, d, c, b);
        }
  }
  return mesh;
}

TriangleMesh sphereMesh(double radius, double edge) {
  TriangleMesh mesh;
  if (!positive(radius) || !positive(edge)) return mesh;
  const double golden = (1.0 + std::sqrt(5.0)) / 2.0;
  const std::array<Vec3, 12> corners = {Vec3(-1, golden, 0),  Vec3(1, golden, 0),   Vec3(-1, -golden, 0),
                                        Vec3(1, -golden, 0),  Vec3(0, -1, golden),  Vec3(0, 1, golden),
                                        Vec3(0, -1, -golden), Vec3(0, 1, -golden),  Vec3(golden, 0, -1),
                                        Vec3(golden, 0, 1),   Vec3(-golden, 0, -1), Vec3(-golden, 0, 1)};
  const int faces[20][3] = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                            {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                            {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  const double corner_angle = std::acos(1.0 / std::sqrt(5.0));  // between neighbouring corners
  const int n = std::min(divisions(corner_angle * radius, edge), 400);

  std::map<GeodesicKey, Index> numbers;
  const auto vertex = [&](const int* face, int i, int j) {
    GeodesicKey key = {{{face[0], n - i - j}, {face[1], i}, {face[2], j}}};
    for (auto& part : key)
      if (part.second == 0) part.first = -1;
    std::sort(key.begin(), key.end());
    const auto found = numbers.emplace(key, static_cast<Index>(mesh.vertices.size()));
    if (found.second) {
      Vec3 p = Vec3::Zero();
      for (const auto& part : key)
        if (part.second > 0) p += static_cast<double>(part.second) * corners[part.first];
      mesh.vertices.push_back(radius * p.normalized());
    }
    return found.first->second;
  };
  for (const auto& face : faces)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i + j < n; ++i) {
        mesh.triangles.push_back({vertex(face, i, j), vertex(face, i + 1, j), vertex(face, i, j + 1)});
        if (i + j + 1 < n)
          mesh.triangles.push_back({vertex(face, i + 1, j), vertex(face, i + 1, j + 1), vertex(face, i, j + 1)});
      }
  return mesh;
}

TriangleMesh cylinderMesh(double height, double radius, double edge) {
  TriangleMesh mesh;
  if (!positive(height) || !positive(radius) || !positive(edge)) return mesh;
  const int rings = std::min(divisions(radius, edge), kMaxDivisions / 6);
  const int rows = divisions(height, edge);
  const int around = 6 * rings;

  const auto addRing = [&](int ring, double z) {
    const Index first = static_cast<Index>(mesh.vertices.size());
    const double r = radius * ring / rings;
    for (int k = 0; k < std::max(1, 6 * ring); ++k) {
      const double angle = ring == 0 ? 0.0 : 2.0 * kPi * k / (6 * ring);
      mesh.vertices.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
    }
    return first;
  };
  // The wall, bottom to top; its first and last ring bound the discs.
  std::vector<Index> wall;
  for (int row = 0; row <= rows; ++row) wall.push_back(addRing(rings, height * (2 * row - rows) / (2.0 * rows)));
  for (int row = 0; row < rows; ++row)
    for (int k = 0; k < around; ++k) {
      const int next = (k + 1) % around;
      addQuad(mesh, wall[row] + k, wall[row] + next, wall[row + 1] + next, wall[row + 1] + k);
    }
  for (int top = 0; top < 2; ++top) {
    const double z = top ? height / 2.0 : -height / 2.0;
    Index inner = addRing(0, z);
    for (int ring = 1; ring <= rings; ++ring) {
      const Index outer = ring == rings ? wall[top ? rows : 0] : addRing(ring, z);
      const auto add = [&](Index a, Index b, Index c) {
        if (top)
          mesh.triangles.push_back({a, b, c});
        else
          mesh.triangles.push_back({a, c, b});
      };
      const auto innerAt = [&](int k) { return ring == 1 ? inner : inner + k % (6 * (ring - 1)); };
      const auto outerAt = [&](int k) { return outer + k % (6 * ring); };
      for (int sector = 0; sector < 6; ++sector)
        for (int k = 0; k < ring; ++k) {
          add(innerAt(sector * (ring - 1) + k), outerAt(sector * ring + k), outerAt(sector * ring + k + 1));
          if (k + 1 < ring)
            add(innerAt(sector * (ring - 1) + k), outerAt(sector * ring + k + 1), innerAt(sector * (ring - 1) + k + 1));
        }
      inner = outer;
    }
  }
  return mesh;
}

TriangleMesh torusMesh(double ring_radius, double tube_radius, double edge) {
  TriangleMesh mesh;
  if (!positive(ring_radius) || !positive(tube_radius) || !positive(edge) || !(tube_radius < ring_radius)) return mesh;
  const int around = divisions(2.0 * kPi * ring_radius, edge, 3);
  const int across = divisions(2.0 * kPi * tube_radius, edge, 3);
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < across; ++j) {
      const double u = 2.0 * kPi * i / around, v = 2.0 * kPi * j / across;
      const double r = ring_radius + tube_radius * std::cos(v);
      mesh.vertices.emplace_back(r * std::cos(u), r * std::sin(u), tube_radius * std::sin(v));
    }
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < across; ++j) {
      const auto at = [&](int di, int dj) {
        return static_cast<Index>(((i + di) % around) * across + (j + dj) % across);
      };
      addQuad(mesh, at(0, 0), at(1, 0), at(1, 1), at(0, 1));
    }
  return mesh;
}

}  // namespace meshless
