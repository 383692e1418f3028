#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {

double surfaceArea(const Points& vertices, const std::vector<Triangle>& triangles) {
  double twice = 0.0;
  for (const Triangle& t : triangles)
    twice += (vertices[t[1]] - vertices[t[0]]).cross(vertices[t[2]] - vertices[t[0]]).norm();
  return 0.5 * twice;
}

double signedVolume(const Points& vertices, const std::vector<Triangle>& triangles) {
  if (triangles.empty()) return 0.0;
  const Vec3 origin = vertices[triangles[0][0]];
  double six_fold = 0.0;
  for (const Triangle& t : triangles)
    six_fold += (vertices[t[0]] - origin).dot((vertices[t[1]] - origin).cross(vertices[t[2]] - origin));
  return six_fold / 6.0;
}

Points volumeGradient(const Points& x, const std::vector<Triangle>& triangles) {
  Points gradient(x.size(), Vec3::Zero());
  for (const Triangle& t : triangles) {
    const Vec3 third = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]) / 6.0;
    for (const Index v : t) gradient[v] += third;
  }
  return gradient;
}

Vec3 solidCentroid(const Points& vertices, const std::vector<Triangle>& triangles) {
  if (vertices.empty()) return Vec3::Zero();
  const Vec3 origin = triangles.empty() ? vertices[0] : vertices[triangles[0][0]];
  double six_fold = 0.0;
  double magnitude = 0.0;
  Vec3 moment = Vec3::Zero();
  for (const Triangle& t : triangles) {
    const Vec3 a = vertices[t[0]] - origin, b = vertices[t[1]] - origin, c = vertices[t[2]] - origin;
    const double part = a.dot(b.cross(c));
    six_fold += part;
    magnitude += std::abs(part);
    moment += part * (a + b + c) / 4.0;
  }
  if (std::abs(six_fold) > 1e-12 * magnitude) return origin + moment / six_fold;
  Vec3 mean = Vec3::Zero();
  for (const Vec3& v : vertices) mean += v - origin;
  return origin + mean / static_cast<double>(vertices.size());
}

Box boundsOf(const Points& points) {
  Box box;
  for (const Vec3& p : points) box.extend(p);
  return box;
}

double meanEdgeLength(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) return 0.0;
  double sum = 0.0;
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) sum += (mesh.vertices[t[(k + 1) % 3]] - mesh.vertices[t[k]]).norm();
  return sum / (3.0 * static_cast<double>(mesh.triangles.size()));
}

Points vertexNormals(const TriangleMesh& mesh) {
  Points normals(mesh.vertices.size(), Vec3::Zero());
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) {
      const Vec3& at = mesh.vertices[t[k]];
      const Vec3 u = mesh.vertices[t[(k + 1) % 3]] - at, v = mesh.vertices[t[(k + 2) % 3]] - at, across = u.cross(v);
      normals[t[k]] += std::atan2(across.norm(), u.dot(v)) * across.stableNormalized();
    }
  for (Vec3& normal : normals) normal.stableNormalize();
  return normals;
}

}  // namespace meshless
