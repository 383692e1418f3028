// Writes the truth of the accuracy benchmark:  make_truth <directory> [part of a case's name] [--coarse]
// --coarse stops one resolution early, to try a change.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "cases.h"

namespace meshless::truth {
namespace {

constexpr int kSurfaceCells = 17;  // along each edge of the organ's cube

double largest(const std::vector<Vec3>& vectors) {
  double size = 0.0;
  for (const Vec3& v : vectors) {
    size = std::max(size, v.norm());
  }
  return size;
}

double rmsDistance(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum += (a[i] - b[i]).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(a.size()));
}

std::string sizes(const std::array<int, 3>& n) {
  return std::to_string(n[0]) + "x" + std::to_string(n[1]) + "x" + std::to_string(n[2]);
}

bool makeCase(const TruthCase& c, const std::string& directory, int levels) {
  const auto start = std::chrono::steady_clock::now();
  std::vector<Solution> solutions;
  std::vector<std::vector<Vec3>> samples;
  for (int level = 0; level < levels; ++level) {
    solutions.push_back(solveCase(c, c.elements[level], level == 0 ? nullptr : &solutions.back()));
    if (!solutions.back().converged) {
      std::fprintf(stderr, "%s: no equilibrium on %s, residual %.2e\n", c.name.c_str(),
                   sizes(c.elements[level]).c_str(), solutions.back().residual);
      return false;
    }
    samples.push_back(sampledDisplacements(c, solutions.back()));
  }
  const Solution& finest = solutions.back();
  const double largest_displacement = largest(samples.back());
  const double convergence = rmsDistance(samples[levels - 1], samples[levels - 2]) / largest_displacement;
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  const std::string path = directory + "/" + c.name + ".csv";
  std::FILE* file = std::fopen(path.c_str(), "w");
  if (file == nullptr) {
    std::fprintf(stderr, "cannot write %s\n", path.c_str());
    return false;
  }
  std::fprintf(file, "# case: %s\n# body: %s\n# load: %s\n", c.name.c_str(), c.body.c_str(), c.load.c_str());
  std::fprintf(file, "# law: psi = mu |F-R|^2 + lambda/2 (J-1)^2\n# units: SI\n");
  std::fprintf(file, "# youngs_modulus: %.9g\n# poissons_ratio: %.9g\n# density: %.9g\n", c.material.youngs_modulus,
               c.material.poissons_ratio, c.density);
  std::fprintf(file, "# gravity: %.9g %.9g %.9g\n", c.gravity.x(), c.gravity.y(), c.gravity.z());
  for (const auto& [key, value] : c.parameters) {
    std::fprintf(file, "# %s: %s\n", key.c_str(), value.c_str());
  }
  std::fprintf(file, "# support_force: %.6e %.6e %.6e\n", finest.fixed_force.x(), finest.fixed_force.y(),
               finest.fixed_force.z());
  if (c.end_fixed) {
    std::fprintf(file, "# end_force: %.6e %.6e %.6e\n# end_moment_x: %.6e\n", finest.end_force.x(),
                 finest.end_force.y(), finest.end_force.z(), finest.end_moment);
  }
  if (c.sphere.radius > 0.0) {
    std::fprintf(file, "# indentation_force: %.6e\n", finest.sphere_force);
    std::fprintf(file, "# indentation_force_coarser:");
    for (int level = levels - 2; level >= 0; --level) {
      std::fprintf(file, " %.6e", solutions[level].sphere_force);
    }
    std::fprintf(file, "\n# contact_gap: %.2e\n", finest.sphere_gap);
  }
  const std::string mirrored =
      std::string(c.mirrored[0] ? "x" : "") + (c.mirrored[1] ? "y" : "") + (c.mirrored[2] ? "z" : "");
  std::fprintf(file, "# elements: 27-node hexahedra, 3x3x3 Gauss points\n# mesh:");
  for (int level = levels - 1; level >= 0; --level) {
    std::fprintf(file, " %s", sizes(c.elements[level]).c_str());
  }
  std::fprintf(file, "\n# mirrored: %s\n# unknowns: %ld\n", mirrored.empty() ? "none" : mirrored.c_str(),
               static_cast<long>(finest.displacement.size()));
  std::fprintf(file, "# newton_residual: %.1e\n# largest_displacement: %.9g\n# convergence: %.3e\n", finest.residual,
               largest_displacement, convergence);
  if (levels > 2) {
    std::fprintf(file, "# convergence_coarser: %.3e\n", rmsDistance(samples[1], samples[0]) / largest_displacement);
  }
  std::fprintf(file, "# columns: rest position x y z, displacement x y z\nx,y,z,ux,uy,uz\n");
  for (std::size_t i = 0; i < c.samples.size(); ++i) {
    const Vec3& at = c.samples[i].rest;
    // No minus before a zero.
    const Vec3 u = (samples.back()[i].array().abs() < 0.5e-9).select(Vec3::Zero(), samples.back()[i]);
    std::fprintf(file, "%.7g,%.7g,%.7g,%.9f,%.9f,%.9f\n", at.x(), at.y(), at.z(), u.x(), u.y(), u.z());
  }
  if (std::fclose(file) != 0) {
    return false;
  }

  const Vec3 last = samples.back()[c.samples.size() - 1];
  std::printf(
      "%-28s E %-7g nu %-4g max %.5f m  convergence %.3f %% (before %.3f %%)  support %.4g %.4g %.4g N  "
      "end %.4g N %.4g Nm  sphere %.5g N gap %.1e  corner %.4f %.4f %.4f  %d its  %.0f s\n",
      c.name.c_str(), c.material.youngs_modulus, c.material.poissons_ratio, largest_displacement, 100.0 * convergence,
      levels > 2 ? 100.0 * rmsDistance(samples[1], samples[0]) / largest_displacement : 0.0, finest.fixed_force.x(),
      finest.fixed_force.y(), finest.fixed_force.z(), finest.end_force.x(), finest.end_moment, finest.sphere_force,
      finest.sphere_gap, last.x(), last.y(), last.z(), finest.iterations, seconds);
  std::fflush(stdout);
  return true;
}

int run(int argc, char** argv) {
  std::string directory, part;
  int levels = kLevels;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--coarse") == 0) {
      levels = kLevels - 1;
    } else {
      (directory.empty() ? directory : part) = argv[i];
    }
  }
  if (directory.empty()) {
    std::fprintf(stderr, "usage: make_truth <directory> [part of a case's name] [--coarse]\n");
    return 2;
  }
  bool good = writeObj(organSurface(kSurfaceCells), "the organ of organ_hang_*.csv, in metres; made by make_truth",
                       directory + "/organ.obj");
  for (const TruthCase& c : allCases()) {
    if (c.name.find(part) != std::string::npos) {
      good = makeCase(c, directory, levels) && good;
    }
  }
  return good ? 0 : 1;
}

}  // namespace
}  // namespace meshless::truth

int main(int argc, char** argv) { return meshless::truth::run(argc, argv); }
