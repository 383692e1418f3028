// Checks the finite-element solver against closed forms, textbooks and itself. Exits non-zero where one fails.
#include <cmath>
#include <cstdio>
#include <map>
#include <random>

#include "cases.h"

namespace meshless::truth {
namespace {

const double kPi = std::acos(-1.0);
int failures = 0;

/// NaN fails too.
void expectBelow(const char* what, double value, double bound) {
  const bool good = value < bound;
  failures += good ? 0 : 1;
  std::printf("%-6s %-66s %10.3e < %.1e\n", good ? "ok" : "FAILED", what, value, bound);
  std::fflush(stdout);
}

double relative(double value, double expected) { return std::abs(value / expected - 1.0); }

class Random {
 public:
  double operator()() { return distribution_(engine_); }
  Mat3 matrix() {
    return Mat3::NullaryExpr([this] { return (*this)(); });
  }
  Vec3 vector() {
    return Vec3::NullaryExpr([this] { return (*this)(); });
  }

 private:
  std::mt19937 engine_{7};
  std::uniform_real_distribution<double> distribution_{-1.0, 1.0};
};

void checkLaw() {
  Random random;
  const Material material{1.0, 0.45};
  double stress_error = 0.0, tangent_error = 0.0, turn_error = 0.0, symmetry_error = 0.0;
  for (int sample = 0; sample < 50; ++sample) {
    const Mat3 f = Mat3::Identity() + 0.4 * random.matrix();
    const Response response = fixedCorotated(material, f, true);
    constexpr double kStep = 1e-6;
    for (int i = 0; i < 9; ++i) {
      Mat3 df = Mat3::Zero();
      df(i % 3, i / 3) = kStep;
      const Response ahead = fixedCorotated(material, f + df, false), behind = fixedCorotated(material, f - df, false);
      stress_error = std::max(stress_error,
                              std::abs((ahead.energy - behind.energy) / (2.0 * kStep) - response.stress(i % 3, i / 3)));
      const Mat3 slope = (ahead.stress - behind.stress) / (2.0 * kStep);
      tangent_error =
          std::max(tangent_error,
                   (Eigen::Map<const Eigen::Matrix<double, 9, 1>>(slope.data()) - response.tangent.col(i)).norm());
    }
    symmetry_error = std::max(symmetry_error, (response.tangent - response.tangent.transpose()).norm());
    const Mat3 turn = Eigen::Quaterniond(random(), random(), random(), random()).normalized().toRotationMatrix();
    turn_error =
        std::max(turn_error, (fixedCorotated(material, turn * f, false).stress - turn * response.stress).norm());
  }
  expectBelow("law: stress is the energy's derivative", stress_error, 1e-8);
  expectBelow("law: tangent is the stress's derivative", tangent_error, 1e-7);
  expectBelow("law: tangent is symmetric", symmetry_error, 1e-12);
  expectBelow("law: a turned body has the turned stress", turn_error, 1e-12);
  const Response inverted = fixedCorotated(material, Vec3(1.2, 1.0, -0.5).asDiagonal(), false);
  const double expected = material.mu() * (0.04 + 2.25) + 0.5 * material.lambda() * 1.6 * 1.6;
  expectBelow("law: an inverted state is measured from a rotation", relative(inverted.energy, expected), 1e-12);
}

void checkFactorisation() {
  constexpr int kLayers = 7, kLayerSize = 4, kSize = kLayers * kLayerSize;
  Random random;
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(kSize, kSize);
  for (int slab = 0; slab < (kLayers - 1) / 2; ++slab) {
    const Eigen::MatrixXd part = Eigen::MatrixXd::NullaryExpr(3 * kLayerSize, 3 * kLayerSize, [&] { return random(); });
    dense.block(2 * slab * kLayerSize, 2 * slab * kLayerSize, 3 * kLayerSize, 3 * kLayerSize) +=
        part * part.transpose();
  }
  BlockTridiagonal matrix(kLayers, kLayerSize);
  matrix.setZero();
  for (int row = 0; row < kSize; ++row) {
    for (int column = 0; column < kSize; ++column) {
      if (dense(row, column) != 0.0) {
        matrix.add(row, column, dense(row, column));
      }
    }
  }
  const Eigen::VectorXd expected = Eigen::VectorXd::NullaryExpr(kSize, [&] { return random(); });
  const bool definite = matrix.factor();
  const double error = definite ? (matrix.solve(dense * expected) - expected).norm() / expected.norm() : 1.0;
  expectBelow("factorisation: solves a random system", error, 1e-8);
}

Mesh boxMesh(const Vec3& size, const std::array<int, 3>& n) {
  return Mesh({gradedLines(0.0, size.x(), n[0]), gradedLines(0.0, size.y(), n[1]), gradedLines(0.0, size.z(), n[2])});
}

bool onBoundary(const Vec3& p, const Vec3& size) { return ((p.array() <= 0.0) || (p.array() >= size.array())).any(); }

void checkPatch() {
  Random random;
  const Vec3 size(1.0, 0.8, 0.6);
  Mesh mesh = boxMesh(size, {3, 3, 3});
  for (int node = 0; node < mesh.nodeCount(); ++node) {
    if (!onBoundary(mesh.rest(node), size)) {
      mesh.moveNode(node, mesh.rest(node) + 0.02 * random.vector());
    }
  }
  for (const Material& material : {Material{1e4, 0.3}, Material{1e4, 0.45}}) {
    Statics statics(mesh, material);
    const Mat3 gradient = 0.25 * random.matrix();
    Eigen::VectorXd expected(statics.size()), u(statics.size());
    for (int node = 0; node < mesh.nodeCount(); ++node) {
      expected.segment<3>(3 * node) = gradient * mesh.rest(node);
      if (onBoundary(mesh.rest(node), size)) {
        statics.fix(node);
        u.segment<3>(3 * node) = expected.segment<3>(3 * node);
      } else {
        u.segment<3>(3 * node) = expected.segment<3>(3 * node) + 0.01 * random.vector();
      }
    }
    const Statics::Report report = statics.solve(u, 1e-13);
    expectBelow("patch: a large affine field on crooked elements", (u - expected).lpNorm<Eigen::Infinity>(), 1e-10);
    (void)report;
  }
}

void checkTangent() {
  Random random;
  const Vec3 size(1.0, 0.8, 0.6);
  const Mesh mesh = boxMesh(size, {2, 2, 2});
  Statics statics(mesh, {1.0, 0.4});
  Sphere sphere;
  sphere.radius = 0.5;
  sphere.center = {0.5, 0.4, 0.9};
  statics.setSphere(sphere, 7.0);
  const Eigen::VectorXd u = Eigen::VectorXd::NullaryExpr(statics.size(), [&] { return 0.03 * random(); });
  const Eigen::VectorXd direction = Eigen::VectorXd::NullaryExpr(statics.size(), [&] { return random(); });
  constexpr double kStep = 1e-6;
  const Eigen::VectorXd exact = statics.tangentTimes(u, direction);
  const Eigen::VectorXd differences =
      (statics.residual(u + kStep * direction) - statics.residual(u - kStep * direction)) / (2.0 * kStep);
  expectBelow("tangent: derivative of the forces, contact included", (differences - exact).norm() / exact.norm(), 1e-6);
  const double slope = (statics.energy(u + kStep * direction) - statics.energy(u - kStep * direction)) / (2.0 * kStep);
  expectBelow("forces: derivative of the energy, contact included", relative(slope, statics.residual(u).dot(direction)),
              1e-6);
}

void checkUniaxial() {
  for (double nu : {0.3, 0.45}) {
    const Material material{1e4, nu};
    static constexpr double kTraction = 3000.0;  // [Pa]
    const Mesh mesh = boxMesh({0.2, 0.05, 0.05}, {2, 1, 1});
    Statics statics(mesh, material);
    for (int axis = 0; axis < 3; ++axis) {
      for (int node : mesh.faceNodes(axis, 0)) {
        statics.fix(node, axis);
      }
    }
    statics.addTraction(0, 1, [](const Vec3&) { return Vec3(kTraction, 0.0, 0.0); });
    Eigen::VectorXd u = Eigen::VectorXd::Zero(statics.size());
    statics.solve(u, 1e-12);
    const double stretch = 1.0 + u[3 * (mesh.nodeCount() - 1)] / 0.2;
    expectBelow("uniaxial: stretch under a dead traction, closed form",
                relative(stretch, uniaxialStretch(material, kTraction)), 1e-10);
  }
}

void checkBeam(double nu, double bound) {
  constexpr double kLength = 1.0, kSide = 0.05, kYoungs = 1e6;
  constexpr double kForce = 1.0;  // [N/m^3], so small that the beam stays straight
  const Material material{kYoungs, nu};
  const Mesh mesh({gradedLines(0.0, kLength, 24, 0.5), gradedLines(0.0, kSide, 2), gradedLines(0.0, kSide, 2)});
  Statics statics(mesh, material);
  for (int node : mesh.faceNodes(0, 0)) {
    statics.fix(node);
  }
  statics.addBodyForce({0.0, 0.0, -kForce});
  Eigen::VectorXd u = Eigen::VectorXd::Zero(statics.size());
  statics.solve(u);
  const double tip = -mesh.interpolate(u, {kLength, 0.5 * kSide, 0.5 * kSide}).z();
  // Timoshenko's beam with Cowper's shear coefficient.
  const double second_moment = std::pow(kSide, 4) / 12.0, area = kSide * kSide, load = kForce * area;
  const double coefficient = 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu);
  const double expected = load * std::pow(kLength, 4) / (8.0 * kYoungs * second_moment) +
                          load * kLength * kLength / (2.0 * coefficient * material.mu() * area);
  expectBelow("cantilever: tip of a slender beam, Timoshenko", relative(tip, expected), bound);
}

void checkTorsion() {
  constexpr double kLength = 0.1, kSide = 0.05, kAngle = 1e-3;
  const Material material{1e4, 0.3};
  const Mesh mesh({gradedLines(0.0, kLength, 4), gradedLines(-0.5 * kSide, 0.5 * kSide, 8),
                   gradedLines(-0.5 * kSide, 0.5 * kSide, 8)});
  Statics statics(mesh, material);
  Eigen::VectorXd u = Eigen::VectorXd::Zero(statics.size());
  // The ends turn in their planes and may warp: Saint-Venant's torsion everywhere.
  for (int side = 0; side < 2; ++side) {
    for (int node : mesh.faceNodes(0, side)) {
      statics.fix(node, 1);
      statics.fix(node, 2);
      const Vec3& at = mesh.rest(node);
      u.segment<3>(3 * node) = side * kAngle * Vec3(0.0, -at.z(), at.y());
      if (side == 0 && at.tail<2>().norm() < 1e-12) {
        statics.fix(node, 0);
      }
    }
  }
  statics.solve(u);
  const Eigen::VectorXd forces = statics.residual(u);
  double moment = 0.0;
  for (int node : mesh.faceNodes(0, 1)) {
    moment += mesh.rest(node).y() * forces[3 * node + 2] - mesh.rest(node).z() * forces[3 * node + 1];
  }
  // The series of Saint-Venant's square: J = a^4 (1/3 - 64/pi^5 sum tanh(n pi/2) / n^5), 0.1406 a^4.
  double sum = 0.0;
  for (int n = 1; n < 40; n += 2) {
    sum += std::tanh(0.5 * n * kPi) / std::pow(n, 5);
  }
  const double constant = std::pow(kSide, 4) * (1.0 / 3.0 - 64.0 / std::pow(kPi, 5) * sum);
  expectBelow("torsion: Saint-Venant's square is 0.1406 a^4", std::abs(constant / std::pow(kSide, 4) - 0.1406), 5e-5);
  expectBelow("torsion: moment of a square bar at a small angle",
              relative(moment, material.mu() * constant * kAngle / kLength), 1e-3);
}

void checkHertz() {
  constexpr double kRadius = 0.2, kDepth = 1e-4, kHeight = 0.2, kNu = 0.3, kYoungs = 1e4;
  // Four elements across the contact's radius of 4.5 mm, then wider and wider: nearly a half space.
  const std::vector<double> lines{0.0, 0.0012, 0.0024, 0.0036, 0.0048, 0.007, 0.015, 0.05, kHeight};
  std::vector<double> downwards;
  for (auto line = lines.rbegin(); line != lines.rend(); ++line) {
    downwards.push_back(kHeight - *line);
  }
  const Mesh mesh({lines, lines, downwards});
  Statics statics(mesh, {kYoungs, kNu});
  for (int node : mesh.faceNodes(2, 0)) {
    statics.fix(node);
  }
  for (int axis = 0; axis < 2; ++axis) {
    for (int node : mesh.faceNodes(axis, 0)) {
      statics.fix(node, axis);
    }
  }
  Sphere sphere;
  sphere.radius = kRadius;
  sphere.center = {0.0, 0.0, kHeight + kRadius - kDepth};
  statics.setSphere(sphere, 2e4 * kYoungs / kRadius);
  Eigen::VectorXd u = Eigen::VectorXd::Zero(statics.size());
  statics.solve(u);
  for (int round = 0; round < 4; ++round) {
    statics.updatePressures(u);
    statics.solve(u);
  }
  const double force = -4.0 * statics.sphereForce(u).z();
  // Hertz on a layer bonded to a rigid base, to the second order (Dimitriadis et al. 2002).
  const double alpha = -(1.2876 - 1.4678 * kNu + 1.3442 * kNu * kNu) / (1.0 - kNu);
  const double chi = std::sqrt(kRadius * kDepth) / kHeight;
  const double layer = 1.0 - 2.0 * alpha / kPi * chi + 4.0 * alpha * alpha / (kPi * kPi) * chi * chi;
  const double hertz = 4.0 / 3.0 * kYoungs / (1.0 - kNu * kNu) * std::sqrt(kRadius) * std::pow(kDepth, 1.5);
  expectBelow("contact: force of a shallow sphere, Hertz on a bonded layer", relative(force, hertz * layer), 2e-2);
  Eigen::VectorXd forces = statics.residual(u);
  double support = 0.0;
  for (int node : mesh.faceNodes(2, 0)) {
    support += 4.0 * forces[3 * node + 2];
  }
  expectBelow("contact: the support carries the sphere's force", relative(support, force), 1e-6);
}

const TruthCase& findCase(const std::vector<TruthCase>& cases, const std::string& name) {
  for (const TruthCase& c : cases) {
    if (c.name == name) {
      return c;
    }
  }
  std::fprintf(stderr, "no case %s\n", name.c_str());
  std::exit(2);
}

double rms(const TruthCase& c, const Solution& a, const Solution& b) {
  const std::vector<Vec3> at_a = sampledDisplacements(c, a), at_b = sampledDisplacements(c, b);
  double sum = 0.0, largest = 0.0;
  for (std::size_t i = 0; i < at_a.size(); ++i) {
    sum += (at_a[i] - at_b[i]).squaredNorm();
    largest = std::max(largest, at_b[i].norm());
  }
  return std::sqrt(sum / static_cast<double>(at_a.size())) / largest;
}

void checkCases() {
  const std::vector<TruthCase> cases = allCases();

  const TruthCase& cantilever = findCase(cases, "bar_cantilever_large_nu45");
  std::vector<Solution> solutions;
  for (const std::array<int, 3>& n : {std::array<int, 3>{6, 1, 2}, {12, 2, 4}, {24, 4, 8}}) {
    solutions.push_back(solveCase(cantilever, n, solutions.empty() ? nullptr : &solutions.back()));
  }
  const double coarse = rms(cantilever, solutions[0], solutions[1]), fine = rms(cantilever, solutions[1], solutions[2]);
  expectBelow("cantilever: change at the second doubling of the mesh", fine, 5e-3);
  expectBelow("cantilever: ratio of that change to the first", fine / coarse, 0.5);
  const double weight = 1000.0 * 9.81 * 0.2 * 0.05 * 0.05;
  expectBelow("cantilever: the support carries the weight", relative(solutions[2].fixed_force.z(), weight), 1e-6);
  const Solution in_steps = solveCase(cantilever, {12, 2, 4}, nullptr);
  expectBelow("cantilever: equilibrium does not depend on the way to it", rms(cantilever, in_steps, solutions[1]),
              1e-7);

  // Whole bodies against their mirrored parts, on the same elements.
  for (const char* name : {"bar_cantilever_large_nu30", "bar_pull_nu45", "bar_stretch_150_nu45"}) {
    const TruthCase& part = findCase(cases, name);
    TruthCase whole = part;
    whole.mirrored = {false, false, false};
    whole.lines = [&part](const std::array<int, 3>& n) {
      Mesh::Lines lines = part.lines(n);
      for (int axis = 0; axis < 3; ++axis) {
        if (part.mirrored[axis]) {
          std::vector<double> both;
          for (std::size_t i = lines[axis].size() - 1; i > 0; --i) {
            both.push_back(-lines[axis][i]);
          }
          both.insert(both.end(), lines[axis].begin(), lines[axis].end());
          lines[axis] = both;
        }
      }
      return lines;
    };
    const Solution of_part = solveCase(part, {6, 1, 1}, nullptr), of_whole = solveCase(whole, {6, 1, 1}, nullptr);
    expectBelow((std::string("mirrored part equals the whole: ") + name).c_str(), rms(part, of_part, of_whole), 1e-7);
    expectBelow((std::string("  and so does its support force: ") + name).c_str(),
                (of_part.fixed_force - of_whole.fixed_force).norm() / of_whole.fixed_force.norm(), 1e-6);
  }

  const TruthCase& twist = findCase(cases, "bar_twist_90_nu30");
  const Solution turned = solveCase(twist, {8, 4, 4}, nullptr);
  double off_symmetry = 0.0;
  for (const SamplePoint& sample : twist.samples) {
    const Mat3 quarter = Eigen::AngleAxisd(0.5 * kPi, Vec3::UnitX()).toRotationMatrix();
    const Vec3 here = turned.mesh->interpolate(turned.displacement, sample.parameter);
    const Vec3 there = turned.mesh->interpolate(turned.displacement, quarter * sample.parameter);
    off_symmetry = std::max(off_symmetry, (quarter * here - there).norm());
  }
  expectBelow("twist: a quarter turn of the bar maps the field to itself", off_symmetry, 1e-9);
  expectBelow("twist: axial forces of both ends cancel", std::abs(turned.fixed_force.x() + turned.end_force.x()), 1e-6);
}

void checkOrgan() {
  const Surface surface = organSurface(17);
  std::map<std::pair<int, int>, int> edges;
  for (const auto& t : surface.triangles) {
    for (int i = 0; i < 3; ++i) {
      ++edges[{t[i], t[(i + 1) % 3]}];
    }
  }
  int open = 0;
  for (const auto& [edge, count] : edges) {
    const auto opposite = edges.find({edge.second, edge.first});
    open += count != 1 || opposite == edges.end() || opposite->second != 1;
  }
  expectBelow("organ: edges of the surface without one partner", open, 0.5);
  const Mesh mesh({gradedLines(-1.0, 1.0, 24), gradedLines(-1.0, 1.0, 20), gradedLines(-1.0, 1.0, 16)}, organPoint);
  const Statics statics(mesh, {1.0, 0.3});
  expectBelow("organ: volume of the surface against that of the elements",
              relative(enclosedVolume(surface), statics.volume()), 1e-2);
  expectBelow("organ: the same, with a fine surface", relative(enclosedVolume(organSurface(200)), statics.volume()),
              2e-4);
  double off_plane = 0.0;
  for (double y = -1.0; y <= 1.0; y += 0.25) {
    for (double z = -1.0; z <= 1.0; z += 0.25) {
      off_plane = std::max(off_plane, std::abs(organPoint({kOrganFixedParameter, y, z}).x() - kOrganFixedBelow));
    }
  }
  expectBelow("organ: the mesh ends on the plane that holds it", off_plane, 1e-15);
}

}  // namespace

int runChecks() {
  checkLaw();
  checkFactorisation();
  checkPatch();
  checkTangent();
  checkUniaxial();
  checkBeam(0.0, 1e-3);
  checkBeam(0.3, 1e-2);  // the clamp holds the section's sides too, which no beam theory knows
  checkTorsion();
  checkHertz();
  checkCases();
  checkOrgan();
  std::printf(failures == 0 ? "all checks passed\n" : "%d checks FAILED\n", failures);
  return failures == 0 ? 0 : 1;
}

}  // namespace meshless::truth

int main() { return meshless::truth::runChecks(); }
