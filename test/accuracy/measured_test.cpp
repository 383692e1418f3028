// What was measured of tissue, and the numbers that docs/accuracy.md and docs/reference/materials.md promise for it.
#include "measured.h"

#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/io/scene.h"

namespace meshless::bench {
namespace {

const MeasuredTissue& tissue(const std::string& name) {
  for (const MeasuredTissue& one : measuredTissues())
    if (one.name == name) return one;
  ADD_FAILURE() << name;
  return measuredTissues().front();
}

TEST(Measured, YoungsModulusIsThatOfSmallStrainWhateverStiffens) {
  for (const double asymmetry : {-30.0, 0.0, 12.0, 30.0})
    for (const double stiffening : {0.0, 10.0, 1000.0}) {
      ElasticParameters material = elasticParameters(4000.0, 0.45, 1000.0);
      material.asymmetry = asymmetry;
      material.stiffening = stiffening;
      for (const double strain : {1e-5, -1e-5})
        EXPECT_NEAR(nominalStress(material, Loading::kUniaxial, 1.0 + strain) / strain, 4000.0, 5.0)
            << asymmetry << " " << stiffening;
      EXPECT_NEAR(nominalStress(material, Loading::kSimpleShear, 1e-4) / 1e-4, material.mu, 1e-3 * material.mu);
    }
}

TEST(Measured, MoreStrainCostsMoreForce) {
  for (const double asymmetry : {-30.0, -8.0, 0.0, 12.0, 30.0})
    for (const double stiffening : {0.0, 10.0, 1000.0}) {
      ElasticParameters material = elasticParameters(4000.0, 0.45, 1000.0);
      material.asymmetry = asymmetry;
      material.stiffening = stiffening;
      double before = -1e300;
      for (double stretch = 0.5; stretch < 2.0; stretch += 0.01) {
        const double stress = nominalStress(material, Loading::kUniaxial, stretch);
        EXPECT_GT(stress, before) << stretch << " " << asymmetry << " " << stiffening;
        before = stress;
      }
    }
}

TEST(Measured, ThreeNumbersMeetWhatOneMisses) {
  const struct {
    const char* name;
    double one, three;
  } rows[] = {{"brain cortex", 0.37, 0.08},
              {"corona radiata", 0.41, 0.165},
              {"blood clot", 0.17, 0.12},
              {"isoprene rubber", 0.12, 0.11},
              {"silicone", 0.15, 0.14}};
  for (const auto& row : rows) {
    EXPECT_GT(fitYoungs(tissue(row.name), 0.49).error, row.one) << row.name;
    EXPECT_LT(fitAll(tissue(row.name), 0.49).error, row.three) << row.name;
  }
}

TEST(Measured, BrainAsItShipsMeetsItsTissue) {
  const auto materials = readMaterials(MATERIALS_FOLDER);
  ASSERT_TRUE(materials);
  const auto errorOf = [&](const std::string& material, const std::string& of) {
    const Material& m = materials->at(material);
    ElasticParameters parameters = elasticParameters(m.youngs_modulus, m.poissons_ratio, m.density);
    parameters.stiffening = m.stiffening;
    parameters.asymmetry = m.asymmetry;
    return fitOf(tissue(of), parameters).error;
  };
  EXPECT_LT(errorOf("elastic_brain_cortex", "brain cortex"), 0.12);
  EXPECT_LT(errorOf("elastic_brain_white", "corona radiata"), 0.21);
}

}  // namespace
}  // namespace meshless::bench
