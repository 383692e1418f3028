// Run time and largest error of the nearest rotation.
// cold, warm (guesses 0.05 rad off) and jacobisvd (Eigen's, with the sign fix) run over a mix of all kinds of matrices
// and scales; real_time is one matrix, `max_error` [rad] is over those whose rotation is unique, `bad` counts results
// that are no rotation (not unit or orthonormal to 1e-5, or NaN).
// kinds/... are the same in float for each kind and scale, with each instruction set and the plain double reference:
// `each` is the time of one rotation, `error_rad` the largest angle to the exact method in double on the same float
// matrices, `unique` the share whose rotation is unique, `warm` the share solved from the guess.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include <Eigen/SVD>

#include "dynamics/rotation.h"
#include "meshless_surgery/dynamics/rotation_batch.h"

namespace meshless {
namespace {

constexpr int kCount = 4096;
constexpr double kGuessTurn = 0.05;  // [rad]

enum class Kind {
  kRandom,
  kWellConditioned,
  kStretched,
  kNearSingular,
  kPlanar,
  kLine,
  kInverted,
  kInvertedAny,
  kMirror
};
struct NamedKind {
  Kind kind;
  const char* name;
};
const NamedKind kKinds[] = {{Kind::kRandom, "random"},
                            {Kind::kWellConditioned, "well_conditioned"},
                            {Kind::kStretched, "stretched"},
                            {Kind::kNearSingular, "near_singular"},
                            {Kind::kPlanar, "planar"},
                            {Kind::kLine, "rank1"},
                            {Kind::kInverted, "inverted"},
                            {Kind::kInvertedAny, "inverted_any"},
                            {Kind::kMirror, "symmetric_inversion"}};
const double kScales[] = {1e-12, 1.0, 1e12};

using Engine = std::mt19937;

double uniform(Engine& engine, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(engine);
}

Quat randomRotation(Engine& engine) {
  std::normal_distribution<double> normal;
  const double x = normal(engine), y = normal(engine), z = normal(engine), w = normal(engine);
  return Quat(w, x, y, z).normalized();
}

Vec3 randomUnit(Engine& engine) { return randomRotation(engine) * Vec3::UnitX(); }

Mat3 randomMatrix(Kind kind, Engine& engine) {
  const auto between = [&](double low, double high) { return uniform(engine, low, high); };
  Vec3 s = Vec3::Ones();
  switch (kind) {
    case Kind::kRandom: {
      Mat3 a;
      for (int k = 0; k < 9; ++k) a(k / 3, k % 3) = between(-1, 1);
      return a;
    }
    case Kind::kWellConditioned:
      s = Vec3(between(0.5, 2), between(0.5, 2), between(0.5, 2));
      break;
    case Kind::kStretched:
      s = Vec3(std::pow(10, between(0, 3)), std::pow(10, between(0, 3)), 1);
      break;
    case Kind::kNearSingular:
      s = Vec3(1, between(0.1, 1), std::pow(10, between(-8, -3)));
      break;
    case Kind::kPlanar:
      s = Vec3(1, between(0.1, 1), 0);
      break;
    case Kind::kLine:
      s = Vec3(1, 0, 0);
      break;
    case Kind::kInverted:
      s = Vec3(1, between(0.5, 1), -between(0.01, 0.45));
      break;
    case Kind::kInvertedAny:
      s = Vec3(between(0.1, 1), between(0.1, 1), -between(0.1, 1));
      break;
    case Kind::kMirror:
      s = Vec3(1, 1, -1);
      break;
  }
  return randomRotation(engine).toRotationMatrix() * s.asDiagonal() * randomRotation(engine).toRotationMatrix();
}

struct Input {
  std::vector<float> matrices = std::vector<float>(9 * kCount);
  std::vector<float> guesses = std::vector<float>(4 * kCount);
  std::vector<Eigen::Matrix3f> plain;
  std::vector<Mat3> plain_double;
  std::vector<Quat> guess, exact;
  std::vector<bool> unique;
};

Input makeInput(Kind kind, double scale) {
  Engine engine(static_cast<unsigned>(kind) + 1);
  Input input;
  for (int i = 0; i < kCount; ++i) {
    const Eigen::Matrix3f a = (scale * randomMatrix(kind, engine)).cast<float>();
    input.plain.push_back(a);
    input.plain_double.push_back(a.cast<double>());
    for (int k = 0; k < 9; ++k) input.matrices[k * kCount + i] = a(k / 3, k % 3);
    const Vec3 s = Eigen::JacobiSVD<Mat3>(a.cast<double>()).singularValues();
    const double third = a.cast<double>().determinant() < 0.0 ? -s[2] : s[2];
    input.unique.push_back(2.0 * (s[1] + third) > 1.01 * kRotationUniqueGap<float> * s.norm());
    input.exact.push_back(nearestRotationExact(a.cast<double>(), Quat::Identity()).rotation);
    input.guess.push_back(input.exact.back() * Quat(Eigen::AngleAxisd(kGuessTurn, randomUnit(engine))));
    for (int k = 0; k < 4; ++k) input.guesses[k * kCount + i] = static_cast<float>(input.guess.back().coeffs()[k]);
  }
  return input;
}

// NaN counts as the largest error there is.
void report(benchmark::State& state, const Input& input, const std::vector<Quat>& found) {
  double largest = 0.0;
  int unique = 0;
  for (int i = 0; i < kCount; ++i) {
    if (!input.unique[i]) continue;
    ++unique;
    const Quat& q = found[i];
    const double angle =
        2.0 * std::min((q.coeffs() - input.exact[i].coeffs()).norm(), (q.coeffs() + input.exact[i].coeffs()).norm());
    if (!(angle <= largest)) largest = angle;
  }
  state.counters["error_rad"] = largest;
  state.counters["unique"] = static_cast<double>(unique) / kCount;
  state.counters["each"] =
      benchmark::Counter(kCount, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void runBatch(benchmark::State& state, const Input& input, bool warm, InstructionSet set) {
  std::vector<float> quaternions(4 * kCount);
  std::vector<std::uint8_t> flags(kCount);
  RotationBatch<float> batch;
  batch.count = kCount;
  batch.matrices = input.matrices.data();
  batch.matrix_stride = kCount;
  batch.quaternions = quaternions.data();
  batch.quaternion_stride = kCount;
  batch.flags = flags.data();
  for (auto _ : state) {
    if (warm) {
      std::copy(input.guesses.begin(), input.guesses.end(), quaternions.begin());
      nearestRotationsWarm(batch, set);
    } else {
      nearestRotationsCold(batch, set);
    }
    benchmark::DoNotOptimize(quaternions.data());
    benchmark::ClobberMemory();
  }
  std::vector<Quat> found;
  int from_guess = 0;
  for (int i = 0; i < kCount; ++i) {
    found.emplace_back(quaternions[3 * kCount + i], quaternions[i], quaternions[kCount + i],
                       quaternions[2 * kCount + i]);
    from_guess += flags[i] & kRotationWarm ? 1 : 0;
  }
  report(state, input, found);
  if (warm) state.counters["warm"] = static_cast<double>(from_guess) / kCount;
}

void runReference(benchmark::State& state, const Input& input, bool warm) {
  std::vector<Quat> found(kCount);
  for (auto _ : state) {
    for (int i = 0; i < kCount; ++i)
      found[i] = nearestRotation(input.plain_double[i], warm ? input.guess[i] : Quat::Identity()).rotation;
    benchmark::DoNotOptimize(found.data());
  }
  report(state, input, found);
}

void runSvd(benchmark::State& state, const Input& input) {
  std::vector<Eigen::Matrix3f> rotations(kCount);
  for (auto _ : state) {
    for (int i = 0; i < kCount; ++i) {
      const Eigen::JacobiSVD<Eigen::Matrix3f> svd(input.plain[i], Eigen::ComputeFullU | Eigen::ComputeFullV);
      Eigen::Matrix3f u = svd.matrixU();
      if ((u * svd.matrixV().transpose()).determinant() < 0.0f) u.col(2) = -u.col(2);
      rotations[i].noalias() = u * svd.matrixV().transpose();
    }
    benchmark::DoNotOptimize(rotations.data());
  }
  std::vector<Quat> found;
  for (const Eigen::Matrix3f& r : rotations) found.emplace_back(Mat3(r.cast<double>()));
  report(state, input, found);
}

// --- all kinds and scales mixed, in either precision

constexpr int kMixed = 4104;  // matrices, alternately of each kind and scale

template <class Scalar>
struct Mixed {
  std::vector<Scalar> matrices = std::vector<Scalar>(9 * kMixed), guesses = std::vector<Scalar>(4 * kMixed);
  std::vector<Eigen::Matrix<Scalar, 3, 3>> plain;
  std::vector<Quat> exact;
  std::vector<bool> unique;
};

template <class Scalar>
Mixed<Scalar> makeMixed() {
  Engine engine(99);
  Mixed<Scalar> input;
  for (int i = 0; i < kMixed; ++i) {
    const Kind kind = kKinds[i % std::size(kKinds)].kind;
    const double scale = kScales[i / std::size(kKinds) % std::size(kScales)];
    const Eigen::Matrix<Scalar, 3, 3> a = (scale * randomMatrix(kind, engine)).template cast<Scalar>();
    const Mat3 wide = a.template cast<double>();
    input.plain.push_back(a);
    for (int k = 0; k < 9; ++k) input.matrices[k * kMixed + i] = a(k / 3, k % 3);
    const Vec3 s = Eigen::JacobiSVD<Mat3>(wide).singularValues();
    const double third = wide.determinant() < 0.0 ? -s[2] : s[2];
    // Of the gap, what float distinguishes counts for double too, so that both rows measure the same matrices.
    input.unique.push_back(2.0 * (s[1] + third) > 1.01 * kRotationUniqueGap<float> * s.norm());
    input.exact.push_back(nearestRotationExact(wide, Quat::Identity()).rotation);
    const Quat guess = input.exact.back() * Quat(Eigen::AngleAxisd(kGuessTurn, randomUnit(engine)));
    for (int k = 0; k < 4; ++k) input.guesses[k * kMixed + i] = static_cast<Scalar>(guess.coeffs()[k]);
  }
  return input;
}

template <class Scalar>
void reportMixed(benchmark::State& state, const Mixed<Scalar>& input, const std::vector<Quat>& found,
                 const std::vector<double>& fault) {
  double largest = 0.0;
  int bad = 0;
  for (int i = 0; i < kMixed; ++i) {
    if (!(fault[i] <= 1e-5)) ++bad;
    if (!input.unique[i]) continue;
    const Eigen::Vector4d q = found[i].coeffs(), e = input.exact[i].coeffs();
    const double angle = 2.0 * std::min((q - e).norm(), (q + e).norm());
    if (!(angle <= largest)) largest = angle;
  }
  state.counters["max_error"] = largest;
  state.counters["bad"] = bad;
}

template <class Scalar>
void runMixed(benchmark::State& state, const Mixed<Scalar>& input, bool warm) {
  std::vector<Scalar> quaternions(4 * kMixed);
  RotationBatch<Scalar> batch;
  batch.count = kMixed;
  batch.matrices = input.matrices.data();
  batch.matrix_stride = kMixed;
  batch.quaternions = quaternions.data();
  batch.quaternion_stride = kMixed;
  while (state.KeepRunningBatch(kMixed)) {
    if (warm) {
      std::copy(input.guesses.begin(), input.guesses.end(), quaternions.begin());
      nearestRotationsWarm(batch);
    } else {
      nearestRotationsCold(batch);
    }
    benchmark::DoNotOptimize(quaternions.data());
    benchmark::ClobberMemory();
  }
  std::vector<Quat> found;
  std::vector<double> fault;
  for (int i = 0; i < kMixed; ++i) {
    found.emplace_back(quaternions[3 * kMixed + i], quaternions[i], quaternions[kMixed + i],
                       quaternions[2 * kMixed + i]);
    fault.push_back(std::abs(found.back().norm() - 1.0));
  }
  reportMixed(state, input, found, fault);
}

template <class Scalar>
void runMixedSvd(benchmark::State& state, const Mixed<Scalar>& input) {
  using Matrix = Eigen::Matrix<Scalar, 3, 3>;
  std::vector<Matrix> rotations(kMixed);
  while (state.KeepRunningBatch(kMixed)) {
    for (int i = 0; i < kMixed; ++i) {
      const Eigen::JacobiSVD<Matrix> svd(input.plain[i], Eigen::ComputeFullU | Eigen::ComputeFullV);
      Matrix u = svd.matrixU();
      if ((u * svd.matrixV().transpose()).determinant() < Scalar(0)) u.col(2) = -u.col(2);
      rotations[i].noalias() = u * svd.matrixV().transpose();
    }
    benchmark::DoNotOptimize(rotations.data());
  }
  std::vector<Quat> found;
  std::vector<double> fault;
  for (const Matrix& r : rotations) {
    const Mat3 wide = r.template cast<double>();
    found.push_back(Quat(wide).normalized());
    fault.push_back(wide.determinant() > 0.0 ? (wide.transpose() * wide - Mat3::Identity()).cwiseAbs().maxCoeff()
                                             : std::numeric_limits<double>::infinity());
  }
  reportMixed(state, input, found, fault);
}

template <class Scalar>
void registerMixed(const std::string& precision) {
  const auto input = std::make_shared<const Mixed<Scalar>>(makeMixed<Scalar>());
  const auto settle = [](benchmark::internal::Benchmark* b) {
    b->MinTime(0.05)->Repetitions(9)->ReportAggregatesOnly()->Unit(benchmark::kNanosecond);
  };
  settle(benchmark::RegisterBenchmark(("cold/" + precision).c_str(),
                                      [=](benchmark::State& s) { runMixed(s, *input, false); }));
  settle(benchmark::RegisterBenchmark(("warm/" + precision).c_str(),
                                      [=](benchmark::State& s) { runMixed(s, *input, true); }));
  settle(benchmark::RegisterBenchmark(("jacobisvd/" + precision).c_str(),
                                      [=](benchmark::State& s) { runMixedSvd(s, *input); }));
}

void registerAll() {
  registerMixed<float>("float");
  registerMixed<double>("double");
  const char* const set_names[] = {"baseline", "avx2", "avx512"};
  const auto settle = [](benchmark::internal::Benchmark* b) {
    b->MinTime(0.02)->Repetitions(7)->ReportAggregatesOnly()->Unit(benchmark::kMicrosecond);
  };
  for (const NamedKind& kind : kKinds)
    for (double scale : kScales) {
      const auto input = std::make_shared<const Input>(makeInput(kind.kind, scale));
      const std::string row = std::string("kinds/") + kind.name + "/scale:" +
                              (scale < 1   ? "1e-12"
                               : scale > 1 ? "1e12"
                                           : "1") +
                              "/";
      for (InstructionSet set : {InstructionSet::kAvx512, InstructionSet::kAvx2, InstructionSet::kBaseline}) {
        if (!instructionSetAvailable(set) || (scale != 1.0 && set != widestInstructionSet())) continue;
        const std::string suffix = std::string("_") + set_names[static_cast<int>(set)];
        for (bool warm : {false, true})
          settle(benchmark::RegisterBenchmark((row + (warm ? "batch_warm" : "batch_cold") + suffix).c_str(),
                                              [=](benchmark::State& s) { runBatch(s, *input, warm, set); }));
      }
      for (bool warm : {false, true})
        settle(benchmark::RegisterBenchmark((row + (warm ? "reference_warm" : "reference_cold")).c_str(),
                                            [=](benchmark::State& s) { runReference(s, *input, warm); }));
      settle(benchmark::RegisterBenchmark((row + "jacobi_svd_float").c_str(),
                                          [=](benchmark::State& s) { runSvd(s, *input); }));
    }
}

}  // namespace
}  // namespace meshless

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  meshless::registerAll();
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
