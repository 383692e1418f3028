// Layers that a thickness makes of open surfaces, at their default cells, against the theory of plates.
#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/bodies.h"
#include "support/statics.h"

namespace meshless {
namespace layers_test {

constexpr double kLength = 0.12, kWidth = 0.1, kYoungs = 5e3, kDensity = 1000.0;

PreparedBody sheet(double thickness, double poisson, Resolution resolution) {
  BodyDef def;
  def.name = "sheet";
  def.solid = false;
  constexpr int kEdges = 8;
  for (int i = 0; i <= kEdges; ++i)
    for (int j = 0; j <= kEdges; ++j) def.mesh.vertices.emplace_back(kLength * i / kEdges, kWidth * j / kEdges, 0.0);
  for (Index i = 0; i < kEdges; ++i)
    for (Index j = 0; j < kEdges; ++j) {
      const Index a = (kEdges + 1) * i + j, b = a + kEdges + 1;
      def.mesh.triangles.push_back({a, b, b + 1});
      def.mesh.triangles.push_back({a, b + 1, a + 1});
    }
  def.thickness = thickness;
  def.resolution = resolution;
  def.material.youngs_modulus = kYoungs;
  def.material.poissons_ratio = poisson;
  def.material.density = kDensity;
  return test::prepared(def);
}

// Held at the last plane of corners in the first cell; the work over that of a strip of the rest.
struct Ratios {
  double bending = 0.0, tension = 0.0;
};
Ratios ratiosOf(double thickness, double poisson, Resolution resolution) {
  const PreparedBody body = sheet(thickness, poisson, resolution);
  const BodyModel& model = *body.model;
  const Box bounds = boundsOf(model.surface.vertices);
  // The longer edge, whatever axis of the lattice that is.
  const Vec3 size = bounds.max - bounds.min;
  Eigen::Index along = 0, across = 0;
  size.maxCoeff(&along);
  size.minCoeff(&across);
  double plane = bounds.min[along] - model.spacing;
  for (const Vec3& p : model.rest)
    if (p[along] < bounds.min[along] + model.spacing - 1e-9) plane = std::max(plane, p[along]);
  const auto held = [&](const Vec3& rest) { return rest[along] < plane + 1e-9; };
  const double length = bounds.max[along] - plane, area = kWidth * thickness, q = kDensity * area;
  const double inertia = area * thickness * thickness / 12.0;
  const ElasticParameters material = elasticParameters(kYoungs, poisson, kDensity);
  Ratios ratios;
  ratios.bending = test::workOf(model, material, Vec3::Unit(across), held) /
                   (q * q * std::pow(length, 5) / (20.0 * kYoungs * inertia) +
                    q * q * std::pow(length, 3) / (3.0 * 5.0 / 6.0 * 0.5 * kYoungs * area));
  ratios.tension =
      test::workOf(model, material, Vec3::Unit(along), held) / (q * q * std::pow(length, 3) / (3.0 * kYoungs * area));
  return ratios;
}

TEST(Layers, BendAndStretchAsPlatesOfTheirThickness) {
  for (const double thickness : {0.001, 0.002, 0.004, 0.01})
    for (const Resolution resolution : {Resolution::kCoarse, Resolution::kMedium, Resolution::kFine}) {
      const Ratios ratios = ratiosOf(thickness, 0.0, resolution);
      EXPECT_NEAR(ratios.bending, 1.0, 0.015) << thickness << " " << static_cast<int>(resolution);
      EXPECT_NEAR(ratios.tension, 1.0, 0.01) << thickness << " " << static_cast<int>(resolution);
    }
}

}  // namespace layers_test
}  // namespace meshless
