#include "cases.h"

#include <cmath>
#include <cstdio>

namespace meshless::truth {
namespace {

const Vec3 kGravity(0.0, 0.0, -9.81);     // [m/s^2]
constexpr double kBarLength = 0.2;        // [m]
constexpr double kBarHalf = 0.025;        // [m] half the side of its section
constexpr double kBlockHalf = 0.05;       // [m] half the side of its base
constexpr double kBlockHeight = 0.05;     // [m]
constexpr double kPullTraction = 1850.0;  // [Pa] a stretch of about 1.2
constexpr double kSampleSpacing = 0.0125;
constexpr double kContactAccuracy = 5e-4;  // largest violation, of the depth

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

std::string vector(const Vec3& v) { return number(v.x()) + " " + number(v.y()) + " " + number(v.z()); }

std::vector<SamplePoint> gridSamples(const Vec3& low, const std::array<int, 3>& counts) {
  std::vector<SamplePoint> samples;
  for (int i = 0; i < counts[0]; ++i) {
    for (int j = 0; j < counts[1]; ++j) {
      for (int k = 0; k < counts[2]; ++k) {
        const Vec3 at = low + kSampleSpacing * Vec3(i, j, k);
        samples.push_back({at, at});
      }
    }
  }
  return samples;
}

TruthCase barCase(const std::string& name, const std::string& load, const Material& material) {
  TruthCase c;
  c.name = "bar_" + name;
  c.body = "bar";
  c.load = load;
  c.material = material;
  c.parameters = {
      {"box_min", "0 -0.025 -0.025"}, {"box_max", "0.2 0.025 0.025"}, {"fixed_axis", "x"}, {"fixed_below", "0"}};
  c.samples = gridSamples({0.0, -kBarHalf, -kBarHalf}, {17, 5, 5});
  c.prescribed = [](const Vec3&, double) { return Vec3(Vec3::Zero()); };
  return c;
}

/// Elements are narrower next to clamped faces, whose edges are singular.
void meshBar(TruthCase& c, bool half_y, bool half_z, bool end_clamped) {
  c.mirrored = {false, half_y, half_z};
  const int whole = half_y ? 3 : 2;
  for (int level = 0; level < kLevels; ++level) {
    const int across = whole << level;
    c.elements[level] = {(half_y ? 12 : 8) << level, half_y ? (across + 1) / 2 : across,
                         half_z ? (across + 1) / 2 : across};
  }
  c.lines = [=](const std::array<int, 3>& n) {
    const double outside = 0.3;
    return Mesh::Lines{gradedLines(0.0, kBarLength, n[0], 0.5, end_clamped ? 0.5 : 0.0),
                       half_y ? gradedLines(0.0, kBarHalf, n[1], 0.0, outside)
                              : gradedLines(-kBarHalf, kBarHalf, n[1], outside, outside),
                       half_z ? gradedLines(0.0, kBarHalf, n[2], 0.0, outside)
                              : gradedLines(-kBarHalf, kBarHalf, n[2], outside, outside)};
  };
}

TruthCase cantilever(const std::string& name, double youngs_modulus, double nu, int steps) {
  TruthCase c = barCase(name, "gravity", {youngs_modulus, nu});
  c.gravity = kGravity;
  meshBar(c, true, false, false);
  c.load_steps = steps;
  return c;
}

TruthCase pull(double nu) {
  TruthCase c = barCase("pull", "end_traction", {1e4, nu});
  c.parameters.push_back({"traction", vector({kPullTraction, 0.0, 0.0})});
  c.parameters.push_back({"traction_face", "x = 0.2"});
  c.traction = [](const Vec3&) { return Vec3(kPullTraction, 0.0, 0.0); };
  meshBar(c, true, true, false);
  c.load_steps = 2;
  return c;
}

TruthCase torsion(double nu) {
  TruthCase c = barCase("torsion", "end_torsion", {1e4, nu});
  // About 45 degrees: slope = kTwist G / m, rounded.
  constexpr double kTwist = 4.35;
  const double slope = std::round(kTwist * c.material.mu() / 100.0) * 100.0;
  c.parameters.push_back({"torsion_traction_slope", number(slope)});
  c.parameters.push_back(
      {"torsion_traction", "dead, slope * (e_x cross (r - r_c)) in Pa, r rest position, r_c = (0.2 0 0)"});
  c.parameters.push_back({"torsion_rest_moment", number(slope * std::pow(2.0 * kBarHalf, 4) / 6.0)});
  c.parameters.push_back({"traction_face", "x = 0.2"});
  c.traction = [=](const Vec3& r) { return Vec3(0.0, -slope * r.z(), slope * r.y()); };
  meshBar(c, false, false, false);
  c.load_steps = 6;
  return c;
}

TruthCase twist(double degrees, double nu) {
  TruthCase c = barCase("twist_" + number(degrees), "end_rotation", {1e4, nu});
  c.parameters.push_back({"moved_axis", "x"});
  c.parameters.push_back({"moved_above", "0.2"});
  c.parameters.push_back({"moved_rotation_degrees", number(degrees)});
  c.parameters.push_back({"moved_rotation", "about the x axis, right-handed; the face stays plane and keeps its x"});
  const double angle = degrees * std::acos(-1.0) / 180.0;
  c.prescribed = [=](const Vec3& r, double t) {
    const double here = t * angle * r.x() / kBarLength;
    return Vec3(Eigen::AngleAxisd(here, Vec3::UnitX()) * r - r);
  };
  c.end_fixed = true;
  meshBar(c, false, false, true);
  c.load_steps = static_cast<int>(degrees / 22.5);
  return c;
}

TruthCase stretch(double factor, double nu) {
  TruthCase c = barCase("stretch_" + number(100.0 * factor), "end_stretch", {1e4, nu});
  c.parameters.push_back({"moved_axis", "x"});
  c.parameters.push_back({"moved_above", "0.2"});
  c.parameters.push_back({"moved_translation", vector({(factor - 1.0) * kBarLength, 0.0, 0.0})});
  c.prescribed = [=](const Vec3& r, double t) { return Vec3(t * (factor - 1.0) * r.x(), 0.0, 0.0); };
  c.end_fixed = true;
  meshBar(c, true, true, true);
  c.load_steps = 4;
  return c;
}

/// `inner` is how much narrower elements are under the sphere.
TruthCase pressed(const std::string& name, const Material& material, double radius, double depth, double inner,
                  const std::array<std::array<int, 3>, kLevels>& elements) {
  TruthCase c;
  c.name = name;
  c.body = "block";
  c.load = "sphere";
  c.material = material;
  c.parameters = {{"box_min", "-0.05 -0.05 0"},
                  {"box_max", "0.05 0.05 0.05"},
                  {"fixed_axis", "z"},
                  {"fixed_below", "0"},
                  {"sphere_radius", number(radius)},
                  {"sphere_depth", number(depth)},
                  {"sphere_center", vector({0.0, 0.0, kBlockHeight + radius - depth})},
                  {"sphere_contact", "rigid, frictionless, on the face z = 0.05"}};
  c.fixed_axis = 2;
  c.mirrored = {true, true, false};
  c.elements = elements;
  c.lines = [inner](const std::array<int, 3>& n) {
    // Narrow under the sphere and at the clamped base's outer edge.
    return Mesh::Lines{gradedLines(0.0, kBlockHalf, n[0], inner, 0.1), gradedLines(0.0, kBlockHalf, n[1], inner, 0.1),
                       gradedLines(0.0, kBlockHeight, n[2], 0.2, inner)};
  };
  c.prescribed = [](const Vec3&, double) { return Vec3(Vec3::Zero()); };
  c.sphere.radius = radius;
  c.sphere.center = {0.0, 0.0, kBlockHeight + radius};
  c.sphere_depth = depth;
  c.load_steps = 8;
  c.samples = gridSamples({-kBlockHalf, -kBlockHalf, 0.0}, {9, 9, 5});
  return c;
}

TruthCase indentation(double nu) {
  return pressed("block_indent", {1e4, nu}, 0.025, 0.0125, 0.4, {{{4, 4, 4}, {8, 8, 8}, {12, 12, 12}}});
}

/// As soft as tissue, and not as deep.
TruthCase press(double nu, int millimetres) {
  return pressed("block_press_" + std::to_string(millimetres), {5e3, nu}, 0.025, 0.001 * millimetres, 0.8,
                 {{{4, 4, 4}, {6, 6, 6}, {10, 10, 10}}});
}

/// The unit square onto the unit disc; the axes stay.
Vec3 discPoint(const Vec3& p) {
  return {kBlockHalf * p.x() * std::sqrt(1.0 - 0.5 * p.y() * p.y()),
          kBlockHalf * p.y() * std::sqrt(1.0 - 0.5 * p.x() * p.x()), p.z()};
}

/// A cylinder as wide and as high as the block, under the push sphere of a scene that says nothing of it.
TruthCase pressCylinder(double nu, int millimetres) {
  TruthCase c = pressed("cylinder_press_" + std::to_string(millimetres), {5e3, nu}, 0.02, 0.001 * millimetres, 0.8,
                        {{{4, 4, 4}, {6, 6, 6}, {10, 10, 10}}});
  c.body = "cylinder";
  c.lines = [](const std::array<int, 3>& n) {
    return Mesh::Lines{gradedLines(0.0, 1.0, n[0], 0.8, 0.1), gradedLines(0.0, 1.0, n[1], 0.8, 0.1),
                       gradedLines(0.0, kBlockHeight, n[2], 0.2, 0.8)};
  };
  c.map = discPoint;
  c.samples.clear();
  for (int i = -4; i <= 4; ++i)
    for (int j = -4; j <= 4; ++j)
      for (int k = 0; k <= 4; ++k) {
        const Vec3 at(0.25 * i, 0.25 * j, kSampleSpacing * k);
        c.samples.push_back({discPoint(at), at});
      }
  return c;
}

TruthCase organ(double nu) {
  TruthCase c;
  c.name = "organ_hang";
  c.body = "organ";
  c.load = "gravity";
  c.material = {3e4, nu};
  c.parameters = {{"surface", "organ.obj"},
                  {"fixed_axis", "x"},
                  {"fixed_below", number(kOrganFixedBelow)},
                  {"fixed_note", "every material point with rest x at or below this; the samples begin on that plane"}};
  c.gravity = kGravity;
  c.elements = {{{6, 4, 3}, {12, 8, 6}, {24, 16, 11}}};
  c.lines = [](const std::array<int, 3>& n) {
    return Mesh::Lines{gradedLines(kOrganFixedParameter, 1.0, n[0], 0.8, 0.0), gradedLines(-1.0, 1.0, n[1], 0.4, 0.4),
                       gradedLines(-1.0, 1.0, n[2], 0.4, 0.4)};
  };
  c.map = organPoint;
  c.prescribed = [](const Vec3&, double) { return Vec3(Vec3::Zero()); };
  c.load_steps = 6;
  // 11 x 6 x 5 points of the cube, those of its faces included.
  for (int i = 0; i <= 10; ++i) {
    for (int j = 0; j <= 5; ++j) {
      for (int k = 0; k <= 4; ++k) {
        const Vec3 at(kOrganFixedParameter + (1.0 - kOrganFixedParameter) * i / 10.0, -1.0 + 0.4 * j, -1.0 + 0.5 * k);
        c.samples.push_back({organPoint(at), at});
      }
    }
  }
  return c;
}

}  // namespace

std::vector<TruthCase> allCases() {
  std::vector<TruthCase> cases;
  for (double nu : {0.3, 0.45}) {
    std::vector<TruthCase> of_nu{cantilever("cantilever_small", 2e6, nu, 1),
                                 cantilever("cantilever_large", 1e5, nu, 4),
                                 pull(nu),
                                 torsion(nu),
                                 twist(90.0, nu),
                                 twist(180.0, nu),
                                 stretch(1.5, nu),
                                 indentation(nu),
                                 press(nu, 1),
                                 press(nu, 3),
                                 press(nu, 8),
                                 pressCylinder(nu, 1),
                                 pressCylinder(nu, 4),
                                 organ(nu)};
    for (TruthCase& c : of_nu) {
      c.name += nu == 0.3 ? "_nu30" : "_nu45";
      cases.push_back(std::move(c));
    }
  }
  return cases;
}

Solution solveCase(const TruthCase& c, const std::array<int, 3>& elements, const Solution* coarser) {
  Solution solution;
  solution.mesh = std::make_unique<Mesh>(c.lines(elements), c.map);
  const Mesh& mesh = *solution.mesh;
  Statics statics(mesh, c.material);

  const std::vector<int> fixed_face = mesh.faceNodes(c.fixed_axis, 0);
  const std::vector<int> end_face = c.end_fixed ? mesh.faceNodes(c.fixed_axis, 1) : std::vector<int>();
  std::vector<char> prescribed(statics.size(), 0);
  const auto fix = [&](int node, int axis) {
    statics.fix(node, axis);
    prescribed[3 * node + axis] = 1;
  };
  for (const std::vector<int>* face : {&fixed_face, &end_face}) {
    for (int node : *face) {
      fix(node, 0), fix(node, 1), fix(node, 2);
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (c.mirrored[axis]) {
      for (int node : mesh.faceNodes(axis, 0)) {
        fix(node, axis);
      }
    }
  }
  statics.addBodyForce(c.density * c.gravity);
  if (c.traction) {
    statics.addTraction(0, 1, c.traction);
  }

  const auto guess = [&](double t) {
    Eigen::VectorXd field(statics.size());
    for (int node = 0; node < mesh.nodeCount(); ++node) {
      field.segment<3>(3 * node) = c.prescribed(mesh.rest(node), t);
    }
    return field;
  };
  const double penalty = c.sphere.radius > 0.0 ? 1000.0 * c.material.youngs_modulus / c.sphere.radius : 0.0;
  const auto pressSphere = [&](double t) {
    if (c.sphere.radius > 0.0) {
      Sphere sphere = c.sphere;
      sphere.center.z() -= t * c.sphere_depth;
      statics.setSphere(sphere, penalty);
    }
  };

  Statics::Report report;
  Eigen::VectorXd& u = solution.displacement;
  if (coarser == nullptr) {
    u = guess(0.0);
    for (int step = 1; step <= c.load_steps; ++step) {
      const double t = static_cast<double>(step) / c.load_steps;
      u += guess(t) - guess(static_cast<double>(step - 1) / c.load_steps);
      statics.setLoadFactor(t);
      pressSphere(t);
      report = statics.solve(u);
      solution.iterations += report.iterations;
    }
  } else {
    u.resize(statics.size());
    const Eigen::VectorXd at_boundary = guess(1.0);
    for (int node = 0; node < mesh.nodeCount(); ++node) {
      u.segment<3>(3 * node) = coarser->mesh->interpolate(coarser->displacement, mesh.parameter(node));
    }
    for (int row = 0; row < statics.size(); ++row) {
      u[row] = prescribed[row] ? at_boundary[row] : u[row];
    }
    pressSphere(1.0);
    report = statics.solve(u);
    solution.iterations += report.iterations;
  }
  if (c.sphere.radius > 0.0) {
    for (int round = 0; round < 12 && statics.contactGap(u) > kContactAccuracy * c.sphere_depth; ++round) {
      statics.updatePressures(u);
      report = statics.solve(u);
      solution.iterations += report.iterations;
    }
  }
  solution.converged = report.converged;
  solution.residual = report.residual;

  // What is mirrored doubles the forces along the planes of symmetry and cancels those across.
  Vec3 copies = Vec3::Ones();
  double all_copies = 1.0;
  for (int axis = 0; axis < 3; ++axis) {
    if (c.mirrored[axis]) {
      copies *= 2.0;
      all_copies *= 2.0;
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    copies[axis] = c.mirrored[axis] ? 0.0 : copies[axis];
  }
  const Eigen::VectorXd forces = statics.residual(u);
  for (int node : fixed_face) {
    solution.fixed_force += copies.cwiseProduct(forces.segment<3>(3 * node));
  }
  for (int node : end_face) {
    const Vec3 force = forces.segment<3>(3 * node);
    const Vec3 at = mesh.rest(node) + u.segment<3>(3 * node);
    solution.end_force += copies.cwiseProduct(force);
    solution.end_moment += at.y() * force.z() - at.z() * force.y();
  }
  if (c.mirrored[1] || c.mirrored[2]) {
    solution.end_moment = 0.0;
  }
  if (c.sphere.radius > 0.0) {
    solution.sphere_force = -all_copies * statics.sphereForce(u).z();
    solution.sphere_gap = statics.contactGap(u);
  }
  return solution;
}

std::vector<Vec3> sampledDisplacements(const TruthCase& c, const Solution& solution) {
  std::vector<Vec3> displacements;
  for (const SamplePoint& sample : c.samples) {
    Vec3 parameter = sample.parameter;
    Vec3 sign = Vec3::Ones();
    for (int axis = 0; axis < 3; ++axis) {
      if (c.mirrored[axis] && parameter[axis] < 0.0) {
        parameter[axis] = -parameter[axis];
        sign[axis] = -1.0;
      }
    }
    displacements.push_back(sign.cwiseProduct(solution.mesh->interpolate(solution.displacement, parameter)));
  }
  return displacements;
}

}  // namespace meshless::truth
