// The surfaces that laws are tried on: every one closed, oriented outwards and embedded.
#pragma once

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "shapes/organs.h"
#include "meshless_surgery/geometry/mesh/primitives.h"

namespace meshless::shapes {

struct Shape {
  std::string name;
  TriangleMesh mesh;
};

/// Adds b's vertices and triangles to a, moved by `shift`.
inline void append(TriangleMesh& a, const TriangleMesh& b, const Vec3& shift = Vec3::Zero()) {
  const Index first = static_cast<Index>(a.vertices.size());
  for (const Vec3& p : b.vertices) a.vertices.push_back(p + shift);
  for (const Triangle& t : b.triangles) a.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

inline TriangleMesh moved(TriangleMesh mesh, const Pose& pose, double scale = 1.0) {
  for (Vec3& p : mesh.vertices) p = pose * (scale * p);
  return mesh;
}

inline TriangleMesh turnedInsideOut(TriangleMesh mesh) {
  for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

/// A turn and a shift that line up with nothing.
inline Pose anyPose() {
  return {Quat(Eigen::AngleAxisd(0.83, Vec3(0.3, -0.7, 0.5).normalized())), Vec3(0.31, -0.17, 0.23)};
}

inline TriangleMesh tetrahedron() {
  TriangleMesh mesh;
  mesh.vertices = {Vec3(0, 0, 0), Vec3(0.1, 0, 0), Vec3(0, 0.1, 0), Vec3(0, 0, 0.1)};
  mesh.triangles = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
  return mesh;
}

/// A sphere with a spherical hole in it: the inner surface points into the cavity.
inline TriangleMesh hollowSphere() {
  TriangleMesh mesh = sphereMesh(0.1, 0.02);
  append(mesh, turnedInsideOut(sphereMesh(0.05, 0.02)));
  return mesh;
}

/// A box with an arch cut out of it below, its cross section extruded along y: deep and not convex.
inline TriangleMesh arch() {
  const std::vector<Vec2> outline = {{-0.1, 0.0}, {-0.05, 0.0}, {-0.05, 0.08}, {0.05, 0.08},
                                     {0.05, 0.0}, {0.1, 0.0},   {0.1, 0.12},   {-0.1, 0.12}};
  const std::vector<Triangle> section = {{0, 1, 2}, {0, 2, 7}, {2, 3, 7}, {3, 6, 7}, {3, 5, 6}, {3, 4, 5}};
  TriangleMesh mesh;
  const Index n = static_cast<Index>(outline.size());
  for (const double y : {-0.03, 0.03})
    for (const Vec2& p : outline) mesh.vertices.emplace_back(p.x(), y, p.y());
  for (const Triangle& t : section) {
    mesh.triangles.push_back(t);
    mesh.triangles.push_back({t[0] + n, t[2] + n, t[1] + n});
  }
  for (Index k = 0; k < n; ++k) {
    const Index next = (k + 1) % n;
    mesh.triangles.push_back({k, k + n, next + n});
    mesh.triangles.push_back({k, next + n, next});
  }
  return mesh;
}

/// Small ones, made from formulas.
inline std::vector<Shape> simpleShapes() {
  std::vector<Shape> all;
  all.push_back({"tetrahedron", tetrahedron()});
  all.push_back({"cube of 12 triangles", boxMesh(Vec3(0.1, 0.1, 0.1), 1, 1, 1)});
  all.push_back({"box", boxMesh(Vec3(0.2, 0.1, 0.05), 0.02)});
  all.push_back({"thin slab", boxMesh(Vec3(0.2, 0.2, 0.002), 0.02)});
  all.push_back({"block of 32", block32Mesh()});
  all.push_back({"sphere", sphereMesh(0.1, 0.02)});
  all.push_back({"icosahedron", sphereMesh(0.1, 1.0)});
  all.push_back({"cylinder", cylinderMesh(0.3, 0.05, 0.02)});
  all.push_back({"disc", cylinderMesh(0.01, 0.1, 0.02)});
  all.push_back({"torus", torusMesh(0.1, 0.03, 0.015)});
  all.push_back({"turned torus", moved(torusMesh(0.1, 0.03, 0.015), anyPose())});
  all.push_back({"hollow sphere", hollowSphere()});
  all.push_back({"arch", arch()});
  TriangleMesh pair = sphereMesh(0.05, 0.02);
  append(pair, boxMesh(Vec3(0.05, 0.05, 0.05), 0.02), Vec3(0.2, 0.01, 0.02));
  all.push_back({"two pieces", pair});
  return all;
}

/// Those and the organs; made once, for the organs take a second.
inline const std::vector<Shape>& allShapes() {
  static const std::vector<Shape> all = [] {
    std::vector<Shape> shapes = simpleShapes();
    shapes.push_back({"liver", liverMesh()});
    shapes.push_back({"kidney", kidneyMesh()});
    shapes.push_back({"fish", fishMesh()});
    shapes.push_back({"skin slab", skinSlabMesh()});
    return shapes;
  }();
  return all;
}

/// One of the real meshes beside the checkout (vertices and triangles of an OBJ file); empty where it is missing.
inline TriangleMesh realMesh(const std::string& file) {
  TriangleMesh mesh;
  std::ifstream in(std::string(SOURCE_DIR) + "/../shared/data/" + file);
  std::string line;
  while (std::getline(in, line)) {
    std::istringstream words(line);
    std::string kind;
    words >> kind;
    if (kind == "v") {
      Vec3 p;
      words >> p.x() >> p.y() >> p.z();
      mesh.vertices.push_back(p);
    } else if (kind == "f") {
      Triangle t;
      for (Index& corner : t) {
        std::string word;
        words >> word;
        corner = static_cast<Index>(std::stoul(word)) - 1;
      }
      mesh.triangles.push_back(t);
    }
  }
  return mesh;
}

}  // namespace meshless::shapes
