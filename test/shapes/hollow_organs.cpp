#include "shapes/hollow_organs.h"

#include <cmath>

#include "shapes/implicit_shapes.h"
#include "meshless_surgery/geometry/mesh/isosurface.h"
#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace {

TriangleMesh centred(TriangleMesh mesh) {
  const Box box = boundsOf(mesh.vertices);
  for (Vec3& p : mesh.vertices) p -= 0.5 * (box.min + box.max);
  return mesh;
}

void addQuadrangle(TriangleMesh& mesh, Index a, Index b, Index c, Index d) {
  mesh.triangles.push_back({a, b, c});
  mesh.triangles.push_back({a, c, d});
}

}  // namespace

TriangleMesh gallbladderMesh() {
  const auto field = [](const Vec3& p) {
    const double fundus = ellipsoid(p - Vec3(-0.014, 0.0, 0.0), Vec3(0.022, 0.016, 0.015));
    const double body = ellipsoid(p - Vec3(0.006, 0.0, 0.0), Vec3(0.022, 0.012, 0.0115));
    const double neck = ellipsoid(p - Vec3(0.024, 0.0, 0.0), Vec3(0.012, 0.0065, 0.0065));
    return blend(blend(fundus, body, 0.01), neck, 0.01);
  };
  return centred(isosurface(field, {Vec3(-0.045, -0.025, -0.025), Vec3(0.045, 0.025, 0.025)}, Vec3::Constant(0.0027)));
}

TriangleMesh stomachMesh() {
  const auto field = [](const Vec3& p) {
    const double fundus = ellipsoid(p - Vec3(-0.032, 0.008, 0.0), Vec3(0.036, 0.031, 0.026));
    const double body = ellipsoid(p - Vec3(0.006, -0.004, 0.0), Vec3(0.044, 0.025, 0.022));
    const double antrum = ellipsoid(p - Vec3(0.046, 0.012, 0.0), Vec3(0.026, 0.017, 0.016));
    return blend(blend(fundus, body, 0.02), antrum, 0.02);
  };
  return centred(isosurface(field, {Vec3(-0.09, -0.05, -0.04), Vec3(0.09, 0.06, 0.04)}, Vec3::Constant(0.0055)));
}

TriangleMesh vesselMesh() {
  constexpr double kTurn = 2.0 * 3.14159265358979323846;
  constexpr double kOuter = 0.003, kInner = 0.0018, kLength = 0.05;
  constexpr Index kRound = 18, kRings = 48;
  TriangleMesh mesh;
  for (const double radius : {kOuter, kInner})
    for (Index i = 0; i <= kRings; ++i)
      for (Index k = 0; k < kRound; ++k) {
        const double angle = kTurn * k / kRound;
        mesh.vertices.push_back(
            Vec3(kLength * (double(i) / kRings - 0.5), radius * std::cos(angle), radius * std::sin(angle)));
      }
  const Index inner = (kRings + 1) * kRound, last = kRings * kRound;
  for (Index k = 0; k < kRound; ++k) {
    const Index n = (k + 1) % kRound;
    for (Index i = 0; i < kRings; ++i) {
      const Index a = i * kRound, b = a + kRound;
      addQuadrangle(mesh, a + k, a + n, b + n, b + k);
      addQuadrangle(mesh, inner + a + k, inner + b + k, inner + b + n, inner + a + n);
    }
    addQuadrangle(mesh, k, inner + k, inner + n, n);
    addQuadrangle(mesh, last + k, last + n, inner + last + n, inner + last + k);
  }
  return mesh;
}

TriangleMesh omentumMesh() {
  constexpr Index kLong = 22, kWide = 18;
  constexpr double kEdge = 0.005;
  TriangleMesh mesh;
  for (Index i = 0; i <= kLong; ++i)
    for (Index j = 0; j <= kWide; ++j) {
      const double x = kEdge * (i - 0.5 * kLong), y = kEdge * (j - 0.5 * kWide);
      mesh.vertices.push_back(Vec3(x, y, 0.0015 * std::sin(90.0 * x + 0.5) * std::cos(110.0 * y)));
    }
  const auto at = [](Index i, Index j) { return i * (kWide + 1) + j; };
  for (Index i = 0; i < kLong; ++i)
    for (Index j = 0; j < kWide; ++j) addQuadrangle(mesh, at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
  return mesh;
}

}  // namespace meshless
