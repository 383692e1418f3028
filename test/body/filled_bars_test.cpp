// Bending of bars that a blade has shaved, against the theory of beams: pieces are as stiff as what is left of them.
#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/body/cut_body.h"
#include "support/bodies.h"
#include "support/statics.h"

namespace meshless {
namespace filled_bars_test {

constexpr double kCell = 0.01, kLength = 24 * kCell, kWidth = 2 * kCell, kHeight = 8 * kCell;
constexpr double kYoungs = 1e4, kDensity = 1000.0;

// The work of a field of accelerations across the bar, held at its low end, on what it moves, over the theory's:
// bending and shear of a cantilever under its own weight (Timoshenko), Poisson's ratio 0. The work is that of the mean
// deflection, and what holds the end is a plane of corners.
double softness(const BodyModel& model, double height) {
  const double work = test::workOf(model, elasticParameters(kYoungs, 0.0, kDensity), Vec3::UnitZ(),
                                   [](const Vec3& rest) { return rest.x() < -0.5 * kLength + 1e-9; });
  // q^2 L^5 / (20 E I) + q^2 L^3 / (3 k G A)
  const double area = kWidth * height, q = kDensity * area, inertia = area * height * height / 12.0;
  const double theory = q * q * std::pow(kLength, 5) / (20.0 * kYoungs * inertia) +
                        q * q * std::pow(kLength, 3) / (3.0 * 5.0 / 6.0 * 0.5 * kYoungs * area);
  return work / theory;
}

BodyDef bar() {
  BodyDef def = test::defOf(boxMesh(Vec3(kLength, kWidth, kHeight), 24, 2, 8));
  def.spacing = kCell;
  def.material.youngs_modulus = kYoungs;
  def.material.poissons_ratio = 0.0;
  def.material.density = kDensity;
  return def;
}

// Of what is left of the bar below a cut at `layers` cells of height.
double shaved(double layers) {
  const PreparedBody body = test::prepared(bar());
  const Result<CutBody> cut =
      cutBody(*body.model, body.state, Blade::through(Plane{Vec3::UnitZ(), Vec3(0, 0, (layers - 4.0) * kCell)}));
  EXPECT_TRUE(cut.ok());
  for (const BodyPiece& piece : cut->pieces) {
    double low = 1.0;
    for (const Vec3& v : piece.model->surface.vertices) low = std::min(low, v.z());
    if (low < -0.49 * kHeight) return softness(*piece.model, layers * kCell);
  }
  ADD_FAILURE() << "no piece has the lower end";
  return 0.0;
}

TEST(FilledBars, ShavedOnesBendAsWhatIsLeftOfThem) {
  const double whole = softness(*test::prepared(bar()).model, kHeight);
  EXPECT_NEAR(whole, 1.0, 0.01);
  for (const double layers : {7.75, 7.5, 7.25, 6.75, 4.5, 3.25, 2.5})
    EXPECT_NEAR(shaved(layers) / whole, 1.0, layers > 3.0 ? 0.01 : 0.02) << layers;
}

// A single layer, and one of a cell and a part of the next, bend as thick plates do.
TEST(FilledBars, ThinOnesBendAsBeamsDo) {
  for (const double layers : {0.5, 0.75, 1.0, 1.5}) EXPECT_NEAR(shaved(layers), 1.0, 0.005) << layers;
}

}  // namespace filled_bars_test
}  // namespace meshless
