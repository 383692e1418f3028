// What the elastic law gives beside what was measured: each point, with one number of a material and with three.
#include <cstdio>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "measured.h"
#include "meshless_surgery/io/scene.h"

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

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Tissue and rubber as measured, beside the elastic law.");
  std::string materials = MATERIALS_FOLDER;
  app.add_option("--materials", materials, "folder of the materials that ship");
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
  return 0;
}
