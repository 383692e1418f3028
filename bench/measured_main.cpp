// What the elastic law gives beside what was measured: each point, with one number of a material and with three.
#include <cstdio>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "measured.h"
#include "meshless_surgery/base/share_folder.h"
#include "meshless_surgery/io/scene.h"
#include "truth_cube.h"

namespace {

using namespace meshless;
using namespace meshless::bench;

// Nothing was measured at a Poisson's ratio; 0.49 is as near to incompressible as a material may be.
constexpr double kPoisson = 0.49;

void print(const MeasuredTissue& tissue, const Material* shipped) {
  const Fit one = fitYoungs(tissue, kPoisson), all = fitAll(tissue, kPoisson);
  std::printf("\n%s (%s)\n", tissue.name.c_str(), tissue.source.c_str());
  std::printf("  one number:    youngs_modulus %.4g\n", one.material.youngs);
  std::printf("  three numbers: youngs_modulus %.4g, asymmetry %.2f, stiffening %.2f\n", all.material.youngs,
              all.material.asymmetry, all.material.stiffening);
  std::vector<Fit> fits = {one, all};
  if (shipped) {
    ElasticParameters material = elasticParameters(shipped->youngs_modulus, shipped->poissons_ratio, shipped->density);
    material.stiffening = shipped->stiffening;
    material.asymmetry = shipped->asymmetry;
    fits.push_back(fitOf(tissue, material));
    std::printf("  shipped:       %s, poissons_ratio %.2f\n", shipped->name.c_str(), shipped->poissons_ratio);
  }
  std::printf("  %-13s %6s %12s %12s %6s %12s %6s%s\n", "loading", "at", "measured Pa", "one", "error", "three",
              "error", shipped ? "      shipped  error" : "");
  for (std::size_t k = 0; k < tissue.points.size(); ++k) {
    const MeasuredPoint& point = tissue.points[k];
    std::printf("  %-13s %6.3f %12.4g", toString(point.loading), point.at, point.stress);
    for (const Fit& fit : fits)
      std::printf(" %12.4g %+4.0f %%", fit.stresses[k], 100.0 * (fit.stresses[k] / point.stress - 1.0));
    std::printf("\n");
  }
  std::printf("  root mean square of errors");
  for (const Fit& fit : fits) std::printf("   %.1f %% (worst %.0f %%)", 100.0 * fit.error, 100.0 * fit.worst);
  std::printf("\n");
}

bool printCube(const std::string& file) {
  const auto beads = readTruthCube(file);
  if (!beads) {
    std::fprintf(stderr, "%s\n", beads.error().detail.c_str());
    return false;
  }
  std::printf("\nTruth Cube, 245 beads between two layers that are led as measured\n");
  std::printf("  %-9s %5s %6s %6s %10s %8s %8s %8s %8s %9s   lateral stretch of layers 1 to 7: measured, ours\n",
              "nominal", "nu", "cell mm", "cells", "largest mm", "led mm", "rms mm", "worst mm", "rms %", "evenly %");
  for (int k = 0; k < kCompressions; ++k)
    for (const double nu : {0.3, 0.45, 0.49})
      for (const double spacing : {0.01, 0.005}) {
        const auto row = pressCube(*beads, k, nu, spacing);
        if (!row) {
          std::fprintf(stderr, "%s\n", row.error().detail.c_str());
          return false;
        }
        std::printf("  %7.2f %% %5.2f %6.1f %6zu %10.2f %8.3f %8.3f %8.3f %8.2f %9.2f  ", 100.0 * kNominal[k], nu,
                    1e3 * spacing, row->cells, 1e3 * row->largest, 1e3 * row->led, 1e3 * row->rms, 1e3 * row->worst,
                    100.0 * row->rms / row->largest, 100.0 * row->uniform / row->largest);
        for (int layer = 0; layer < kBeadsASide; ++layer)
          std::printf(" %.3f %.3f", row->measured[layer], row->ours[layer]);
        std::printf("\n");
      }
  return true;
}

#ifdef OF_CHECKOUT  // a build without ROS has no share folder
const std::string kMaterials = MATERIALS_FOLDER, kMeasured = MEASURED_FOLDER;
#else
const std::string kMaterials = shareFolder() + "/config/materials", kMeasured = shareFolder() + "/bench/measured";
#endif

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Tissue and rubber as measured, beside the elastic law.");
  std::string materials = kMaterials;
  app.add_option("--materials", materials, "folder of the materials that ship");
  std::string beads = kMeasured + "/truth_cube.csv";
  app.add_option("--beads", beads, "of the Truth Cube");
  CLI11_PARSE(app, argc, argv);
  const auto shipped = readMaterials(materials);
  if (!shipped) {
    std::fprintf(stderr, "%s\n", shipped.error().detail.c_str());
    return 2;
  }
  const std::vector<std::pair<std::string, std::string>> names = {{"brain cortex", "elastic_brain_cortex"},
                                                                  {"corona radiata", "elastic_brain_white"}};
  for (const MeasuredTissue& tissue : measuredTissues()) {
    const Material* material = nullptr;
    for (const auto& [of, name] : names)
      if (of == tissue.name) material = &shipped->at(name);
    print(tissue, material);
  }
  return printCube(beads) ? 0 : 2;
}
