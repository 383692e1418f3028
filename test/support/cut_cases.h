// Solids and planes that are hard to cut, and cases kept in files.
#pragma once

#include <cstdio>
#include <functional>
#include <iomanip>
#include <map>
#include <random>

#include "support/plane_cut.h"
#include "support/shapes.h"

namespace meshless::shapes {

/// The surface of the unit cells for which `solid` holds, vertices shared. Cells that touch along an edge alone give
/// edges with four triangles.
inline TriangleMesh voxelMesh(int nx, int ny, int nz, const std::function<bool(int, int, int)>& solid) {
  TriangleMesh mesh;
  std::map<std::array<int, 3>, Index> made;
  const auto vertex = [&](const std::array<int, 3>& p) {
    const auto [entry, fresh] = made.try_emplace(p, static_cast<Index>(mesh.vertices.size()));
    if (fresh) mesh.vertices.emplace_back(p[0], p[1], p[2]);
    return entry->second;
  };
  const auto filled = [&](std::array<int, 3> c) {
    return c[0] >= 0 && c[1] >= 0 && c[2] >= 0 && c[0] < nx && c[1] < ny && c[2] < nz && solid(c[0], c[1], c[2]);
  };
  for (int x = 0; x < nx; ++x) {
    for (int y = 0; y < ny; ++y) {
      for (int z = 0; z < nz; ++z) {
        if (!filled({x, y, z})) continue;
        for (int axis = 0; axis < 3; ++axis) {
          for (int end = 0; end < 2; ++end) {
            std::array<int, 3> beside{x, y, z};
            beside[axis] += end ? 1 : -1;
            if (filled(beside)) continue;
            std::array<int, 3> corner{x, y, z};
            corner[axis] += end;
            const int u = (axis + 1) % 3, v = (axis + 2) % 3;
            std::array<Index, 4> quad;
            for (int k = 0; k < 4; ++k) {
              std::array<int, 3> p = corner;
              p[u] += k == 1 || k == 2;
              p[v] += k >= 2;
              quad[k] = vertex(p);
            }
            if (end == 0) std::swap(quad[1], quad[3]);
            mesh.triangles.push_back({quad[0], quad[1], quad[2]});
            mesh.triangles.push_back({quad[0], quad[2], quad[3]});
          }
        }
      }
    }
  }
  return mesh;
}

/// Random cells, filled up until none touch along an edge or at a corner alone: cavities, tunnels and islands.
inline TriangleMesh randomVoxels(int n, double density, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<char> cells(static_cast<std::size_t>(n * n * n));
  for (char& c : cells) c = random() < density * 4294967296.0;
  const auto at = [&](int x, int y, int z) -> char& { return cells[static_cast<std::size_t>((x * n + y) * n + z)]; };
  for (bool changed = true; changed;) {
    changed = false;
    for (int x = 0; x + 1 < n; ++x)
      for (int y = 0; y + 1 < n; ++y)
        for (int z = 0; z + 1 < n; ++z) {
          // A block of eight is fine where neither its solid nor its empty cells fall apart.
          int bits = 0;
          for (int k = 0; k < 8; ++k) bits |= at(x + (k & 1), y + (k >> 1 & 1), z + (k >> 2)) << k;
          const auto connected = [](int set) {
            if (set == 0) return true;
            int reached = set & -set, before = 0;
            while (reached != before) {
              before = reached;
              for (int k = 0; k < 8; ++k)
                if (reached >> k & 1) reached |= ((1 << (k ^ 1)) | (1 << (k ^ 2)) | (1 << (k ^ 4))) & set;
            }
            return reached == set;
          };
          if (connected(bits) && connected(~bits & 255)) continue;
          for (int k = 0; k < 8; ++k) at(x + (k & 1), y + (k >> 1 & 1), z + (k >> 2)) = 1;
          changed = true;
        }
  }
  return voxelMesh(n, n, n, [&](int x, int y, int z) { return at(x, y, z) != 0; });
}

/// Embedded solids that are not simple, each a closed surface with two triangles at every edge.
inline std::vector<Shape> hardShapes() {
  std::vector<Shape> all;
  all.push_back({"L", voxelMesh(3, 3, 2, [](int x, int y, int) { return x == 0 || y == 0; })});
  all.push_back({"comb", voxelMesh(9, 4, 2, [](int x, int y, int) { return y == 0 || x % 2 == 0; })});
  all.push_back({"plate with holes", voxelMesh(7, 5, 1, [](int x, int y, int) { return x % 2 == 0 || y % 2 == 0; })});
  all.push_back({"stairs", voxelMesh(4, 2, 4, [](int x, int, int z) { return x >= z; })});
  all.push_back(
      {"box with a cavity", voxelMesh(3, 3, 3, [](int x, int y, int z) { return x != 1 || y != 1 || z != 1; })});
  TriangleMesh nested = sphereMesh(1.0, 0.4);
  append(nested, turnedInsideOut(sphereMesh(0.8, 0.4)));
  append(nested, sphereMesh(0.5, 0.25));
  append(nested, turnedInsideOut(sphereMesh(0.2, 0.1)), Vec3(0.1, 0, 0));
  append(nested, turnedInsideOut(sphereMesh(0.05, 0.03)), Vec3(-0.2, 0, 0.1));
  all.push_back({"nested shells", nested});
  for (std::uint32_t seed = 1; seed <= 6; ++seed)
    all.push_back({"voxels " + std::to_string(seed), randomVoxels(5, 0.15 + 0.05 * seed, seed)});
  return all;
}

/// Solids that touch: the same points twice, faces, edges and corners on each other.
inline std::vector<Shape> touchingShapes() {
  std::vector<Shape> all;
  const TriangleMesh cube = boxMesh(Vec3(1, 1, 1), 1, 1, 1), fine = boxMesh(Vec3(1, 1, 1), 3, 3, 3);
  const auto pair = [&](const std::string& name, const TriangleMesh& other, const Vec3& shift) {
    TriangleMesh mesh = cube;
    append(mesh, other, shift);
    all.push_back({name, mesh});
  };
  pair("cubes face to face", cube, Vec3(1, 0, 0));
  pair("coarse face on fine", fine, Vec3(1, 0, 0));
  pair("faces that overlap", cube, Vec3(1, 0.5, 0.25));
  pair("cubes edge to edge", cube, Vec3(1, 1, 0));
  pair("edges that overlap", cube, Vec3(1, 1, 0.5));
  pair("cubes corner to corner", cube, Vec3(1, 1, 1));
  return all;
}

/// A plane of one of the kinds that are hard for a cut, or a plain one.
inline Plane hardPlane(const TriangleMesh& mesh, std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const auto direction = [&] { return Vec3(normal(random), normal(random), normal(random)).normalized(); };
  const auto triangle = [&] { return mesh.triangles[random() % mesh.triangles.size()]; };
  const auto vertex = [&] { return mesh.vertices[triangle()[random() % 3]]; };
  const auto axis = [&] { return Vec3(Vec3::Unit(static_cast<int>(random() % 3)) * (random() % 2 ? 1.0 : -1.0)); };
  Vec3 low = mesh.vertices[0], high = low;
  for (const Vec3& p : mesh.vertices) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const double size = (high - low).norm();
  const auto somewhere = [&] {
    return Vec3(low + (high - low).cwiseProduct(Vec3(unit(random), unit(random), unit(random))));
  };
  const auto facing = [&](const Vec3& a, const Vec3& b) {
    const Vec3 n = a.cross(b);
    return n.norm() > 1e-12 * a.norm() * b.norm() ? Vec3(n.normalized()) : direction();
  };
  switch (random() % 11) {
    case 0:
      return {direction(), somewhere()};
    case 1:
      return {axis(), somewhere()};
    case 2:
      return {direction(), vertex()};
    case 3:
      return {axis(), vertex()};
    case 4: {  // along an edge
      const Triangle t = triangle();
      return {facing(mesh.vertices[t[1]] - mesh.vertices[t[0]], direction()), mesh.vertices[t[0]]};
    }
    case 5: {  // in a face
      const Triangle t = triangle();
      const Vec3& a = mesh.vertices[t[0]];
      return {facing(mesh.vertices[t[1]] - a, mesh.vertices[t[2]] - a), a};
    }
    case 6: {  // through any three vertices
      const Vec3 a = vertex();
      return {facing(vertex() - a, vertex() - a), a};
    }
    case 7: {  // about as far from a vertex as the band is wide
      const Plane plane = {random() % 2 ? direction() : axis(), vertex()};
      return {plane.normal, plane.point + plane.normal * (size * 1e-7 * std::pow(10.0, 2.0 * unit(random) - 1.0))};
    }
    case 8: {  // takes off the outermost corner, or just not
      const Vec3 n = random() % 2 ? direction() : axis();
      double top = -1e300;
      for (const Vec3& p : mesh.vertices) top = std::max(top, n.dot(p));
      return {n, (top - size * std::pow(10.0, -9.0 + 8.0 * unit(random))) * n};
    }
    case 9: {  // a sliver beside a face
      const Triangle t = triangle();
      const Vec3& a = mesh.vertices[t[0]];
      const Vec3 n = facing(mesh.vertices[t[1]] - a, mesh.vertices[t[2]] - a);
      const Vec3 tilted = (n + std::pow(10.0, -9.0 + 8.0 * unit(random)) * direction()).normalized();
      return {tilted, a - size * std::pow(10.0, -9.0 + 8.0 * unit(random)) * n};
    }
    default: {  // all but through two vertices
      const Vec3 a = vertex();
      const Vec3 n = facing(vertex() - a, direction());
      return {(n + 1e-7 * std::pow(10.0, 2.0 * unit(random)) * direction()).normalized(), a};
    }
  }
}

/// A mesh with the plane that it was cut by: an OBJ file with comments for the rest.
struct CutCase {
  TriangleMesh mesh;
  Plane plane;
  bool embedded = true;
  bool worn = false;  // see laws::cutObeysLaws
};

inline void writeCutCase(const std::string& path, const CutCase& c) {
  std::ofstream out(path);
  out << std::setprecision(17) << "# plane " << c.plane.normal.transpose() << " " << c.plane.point.transpose() << "\n";
  out << "# embedded " << c.embedded << "\n# worn " << c.worn << "\n";
  for (const Vec3& p : c.mesh.vertices) out << "v " << p.transpose() << "\n";
  for (const Triangle& t : c.mesh.triangles) out << "f " << t[0] + 1 << " " << t[1] + 1 << " " << t[2] + 1 << "\n";
}

inline CutCase readCutCase(const std::string& path) {
  CutCase c;
  std::ifstream in(path);
  std::string line;
  while (std::getline(in, line)) {
    std::istringstream words(line);
    std::string kind;
    words >> kind;
    if (kind == "#") {
      words >> kind;
      if (kind == "plane")
        for (double* x : {&c.plane.normal.x(), &c.plane.normal.y(), &c.plane.normal.z(), &c.plane.point.x(),
                          &c.plane.point.y(), &c.plane.point.z()})
          words >> *x;
      if (kind == "embedded") words >> c.embedded;
      if (kind == "worn") words >> c.worn;
    } else if (kind == "v") {
      Vec3 p;
      words >> p.x() >> p.y() >> p.z();
      c.mesh.vertices.push_back(p);
    } else if (kind == "f") {
      Triangle t;
      for (Index& v : t) {
        words >> v;
        --v;
      }
      c.mesh.triangles.push_back(t);
    }
  }
  return c;
}

}  // namespace meshless::shapes
