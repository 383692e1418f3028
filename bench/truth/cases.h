// The bodies and loads of the accuracy benchmark.
#pragma once

#include <memory>
#include <string>
#include <utility>

#include "organ_shape.h"
#include "statics.h"

namespace meshless::truth {

constexpr int kLevels = 3;  // resolutions of each case

struct SamplePoint {
  Vec3 rest;       // [m]
  Vec3 parameter;  // of the mesh; outside of it on the mirrored side
};

struct TruthCase {
  std::string name;
  std::string body;  // bar, block, cylinder or organ
  std::string load;  // for readers
  Material material;
  double density = 1000.0;  // [kg/m^3]
  Vec3 gravity = Vec3::Zero();
  std::vector<std::pair<std::string, std::string>> parameters;  // the header's keys that are this case's own

  std::array<std::array<int, 3>, kLevels> elements{};
  std::function<Mesh::Lines(const std::array<int, 3>& elements)> lines;
  Mesh::Map map;                                        // none for blocks
  std::array<bool, 3> mirrored{};                       // only the half with coordinates >= 0 is meshed
  int fixed_axis = 0;                                   // all components are prescribed on this face's side 0 ...
  bool end_fixed = false;                               // ... and on side 1
  std::function<Vec3(const Vec3&, double)> prescribed;  // by rest position and load factor; also the first guess
  std::function<Vec3(const Vec3&)> traction;            // dead, on side 1 of axis 0
  Sphere sphere;              // radius 0: none. At factor t its centre is t * depth below the touch
  double sphere_depth = 0.0;  // [m]
  int load_steps = 1;         // on the coarsest mesh; finer ones start from its solution
  std::vector<SamplePoint> samples;
};

std::vector<TruthCase> allCases();

struct Solution {
  std::unique_ptr<Mesh> mesh;
  Eigen::VectorXd displacement;
  bool converged = false;
  double residual = 0.0;
  int iterations = 0;
  Vec3 fixed_force = Vec3::Zero();  // [N] of the support on the whole body
  Vec3 end_force = Vec3::Zero();    // [N] at the moved end
  double end_moment = 0.0;          // [N m] about the x axis, in the deformed position
  double sphere_force = 0.0;        // [N] downwards on the whole body
  double sphere_gap = 0.0;          // [m] largest violation of the contact
};

/// `coarser` may be null: then the load is raised in steps.
Solution solveCase(const TruthCase& truth_case, const std::array<int, 3>& elements, const Solution* coarser);

/// Displacements at the case's sample points, those of the mirrored sides included.
std::vector<Vec3> sampledDisplacements(const TruthCase& truth_case, const Solution& solution);

}  // namespace meshless::truth
