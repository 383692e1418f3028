#include "measured.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>

#include "meshless_surgery/dynamics/elastic_batch.h"

namespace meshless::bench {
namespace {

constexpr double kEdge = 0.01;  // [m] of the cube, which is one cell
constexpr double kDensity = 1000.0;

// First Piola-Kirchhoff stress of the cube that is deformed by F.
class Cube {
 public:
  Cube() {
    cells_.half_edge = 0.5 * kEdge;
    ElasticCell cell;
    cell.mass = kDensity * kEdge * kEdge * kEdge;
    for (Index k = 0; k < 8; ++k) {
      cell.corners[k] = k;
      rest_.push_back(0.5 * kEdge * Vec3(k & 1 ? 1.0 : -1.0, k & 2 ? 1.0 : -1.0, k & 4 ? 1.0 : -1.0));
    }
    cells_.cells.push_back(cell);
    cells_.masses.assign(8, cell.mass / 8.0);
    batch_ = std::make_unique<ElasticBatch>(cells_);
  }

  Mat3 stress(const ElasticParameters& material, const Mat3& f) const {
    Points y, accelerations;
    for (const Vec3& p : rest_) y.push_back(f * p);
    ElasticBatchState state;
    MatchCounters counters;
    batch_->setRotations(std::vector<ClusterPose>(1), state);
    batch_->accelerate({rest_, cells_.masses, {}, {}}, material, y, state, accelerations, counters);
    Mat3 sum = Mat3::Zero();
    for (std::size_t k = 0; k < rest_.size(); ++k) sum -= cells_.masses[k] * accelerations[k] * rest_[k].transpose();
    return sum / (kEdge * kEdge * kEdge);
  }

 private:
  Points rest_;
  ElasticCells cells_;
  std::unique_ptr<ElasticBatch> batch_;
};

// Where what rises with t is 0, by halving.
double rootOf(const std::function<double(double)>& rising, double low, double high) {
  for (int n = 0; n < 60; ++n) {
    const double middle = 0.5 * (low + high);
    (rising(middle) < 0.0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double relativeError(double stress, const MeasuredPoint& point) { return stress / point.stress - 1.0; }

using Numbers = std::array<double, 3>;  // log of Young's modulus, asymmetry, log of stiffening

ElasticParameters parametersOf(const Numbers& n, std::size_t count, double poissons_ratio) {
  ElasticParameters material = elasticParameters(std::exp(n[0]), poissons_ratio, kDensity);
  if (count == 3) {
    material.asymmetry = n[1];
    material.stiffening = std::exp(n[2]);
  }
  return material;
}

// Gauss-Newton with Levenberg's damping, derivatives by differences.
Fit fit(const MeasuredTissue& tissue, std::size_t count, double poissons_ratio, Numbers start) {
  Fit best = fitOf(tissue, parametersOf(start, count, poissons_ratio));
  const Eigen::Index rows = static_cast<Eigen::Index>(tissue.points.size()), columns = static_cast<Eigen::Index>(count);
  const auto missesOf = [&](const Fit& f) {
    Eigen::VectorXd misses(rows);
    for (Eigen::Index k = 0; k < rows; ++k) misses[k] = relativeError(f.stresses[k], tissue.points[k]);
    return misses;
  };
  double damping = 1e-2;
  for (int iteration = 0; iteration < 60 && damping < 1e8; ++iteration) {
    const Eigen::VectorXd misses = missesOf(best);
    Eigen::MatrixXd slopes(rows, columns);
    for (std::size_t c = 0; c < count; ++c) {
      Numbers beside = start;
      const double step = 1e-4;
      beside[c] += step;
      slopes.col(static_cast<Eigen::Index>(c)) =
          (missesOf(fitOf(tissue, parametersOf(beside, count, poissons_ratio))) - misses) / step;
    }
    const Eigen::MatrixXd normal = slopes.transpose() * slopes + damping * Eigen::MatrixXd::Identity(columns, columns);
    const Eigen::VectorXd step = -normal.ldlt().solve(slopes.transpose() * misses);
    Numbers next = start;
    for (std::size_t c = 0; c < count; ++c) next[c] += step[static_cast<Eigen::Index>(c)];
    next[1] = std::clamp(next[1], -30.0, 30.0);
    next[2] = std::clamp(next[2], -9.0, 6.9);
    Fit tried = fitOf(tissue, parametersOf(next, count, poissons_ratio));
    if (tried.error < best.error) {
      start = next;
      best = std::move(tried);
      damping *= 0.3;
    } else {
      damping *= 5.0;
    }
  }
  return best;
}

}  // namespace

const char* toString(Loading loading) {
  switch (loading) {
    case Loading::kUniaxial:
      return "uniaxial";
    case Loading::kEquibiaxial:
      return "equibiaxial";
    case Loading::kPureShear:
      return "pure shear";
    case Loading::kSimpleShear:
      return "simple shear";
  }
  return "unknown";
}

double nominalStress(const ElasticParameters& material, Loading loading, double at) {
  static const Cube cube;
  Mat3 f = Mat3::Identity();
  if (loading == Loading::kSimpleShear) {
    f(0, 1) = at;
    return cube.stress(material, f)(0, 1);
  }
  f(0, 0) = at;
  if (loading == Loading::kEquibiaxial) f(1, 1) = at;
  f(2, 2) = rootOf(
      [&](double t) {
        f(2, 2) = t;
        if (loading == Loading::kUniaxial) f(1, 1) = t;
        return cube.stress(material, f)(2, 2);
      },
      0.1, 3.0);
  if (loading == Loading::kUniaxial) f(1, 1) = f(2, 2);
  return cube.stress(material, f)(0, 0);
}

Fit fitOf(const MeasuredTissue& tissue, const ElasticParameters& material) {
  Fit result;
  result.material = material;
  double squares = 0.0;
  for (const MeasuredPoint& point : tissue.points) {
    result.stresses.push_back(nominalStress(material, point.loading, point.at));
    const double miss = relativeError(result.stresses.back(), point);
    squares += miss * miss;
    result.worst = std::max(result.worst, std::abs(miss));
  }
  result.error = std::sqrt(squares / static_cast<double>(tissue.points.size()));
  return result;
}

Fit fitYoungs(const MeasuredTissue& tissue, double poissons_ratio) {
  const MeasuredPoint& point = tissue.points.front();
  const double strain = point.loading == Loading::kSimpleShear ? point.at : point.at - 1.0;
  return fit(tissue, 1, poissons_ratio, {std::log(point.stress / strain), 0.0, 0.0});
}

Fit fitAll(const MeasuredTissue& tissue, double poissons_ratio) {
  const double youngs = std::log(fitYoungs(tissue, poissons_ratio).material.youngs);
  Fit best;
  best.error = 1e300;
  for (const double asymmetry : {-5.0, 0.3, 8.0})
    for (const double stiffening : {0.1, 10.0}) {
      Fit tried = fit(tissue, 3, poissons_ratio, {youngs - 0.2, asymmetry, std::log(stiffening)});
      if (tried.error < best.error) best = std::move(tried);
    }
  return best;
}

const std::vector<MeasuredTissue>& measuredTissues() {
  constexpr Loading kPull = Loading::kUniaxial, kBoth = Loading::kEquibiaxial, kPure = Loading::kPureShear,
                    kShear = Loading::kSimpleShear;
  static const std::vector<MeasuredTissue> tissues = {
      {"brain cortex",
       "human, ex vivo, averages; labelled Budday17 in LivingMatterLab/CANN",
       {{kPull, 1.05, 149},
        {kPull, 1.10, 415},
        {kPull, 0.95, -350},
        {kPull, 0.90, -1148},
        {kShear, 0.1, 141},
        {kShear, 0.2, 544}}},
      {"corona radiata",
       "human, ex vivo, averages; likewise",
       {{kPull, 1.05, 72},
        {kPull, 1.10, 158},
        {kPull, 0.95, -202},
        {kPull, 0.90, -759},
        {kShear, 0.1, 68},
        {kShear, 0.2, 261}}},
      {"blood clot",
       "whole blood, a strip pulled between long grips; raw data of elejeune11/fitting-one-term-ogden-model (MIT)",
       {{kPure, 1.05046, 316.6},
        {kPure, 1.10013, 695.1},
        {kPure, 1.20005, 1547.5},
        {kPure, 1.30001, 2404.8},
        {kPure, 1.40024, 3228.6},
        {kPure, 1.50025, 3972.0}}},
      {"isoprene rubber",
       "Kawabata et al. 1981, Macromolecules 14:154, digitised (Chongran-Zhao/Hyperelastic-fitting, MIT)",
       {{kPull, 1.10, 106400},
        {kPull, 1.20, 195800},
        {kPull, 1.30, 270000},
        {kPull, 1.60, 433100},
        {kPull, 1.90, 553200},
        {kBoth, 1.10, 198200},
        {kBoth, 1.20, 330000},
        {kBoth, 1.30, 420800},
        {kBoth, 1.60, 610000},
        {kBoth, 1.90, 744200},
        {kPure, 1.10, 138200},
        {kPure, 1.20, 245000},
        {kPure, 1.30, 333800},
        {kPure, 1.60, 511900},
        {kPure, 1.90, 627900}}},
      {"silicone",
       "Meunier et al. 2008, Polymer Testing 27:765, digitised (likewise)",
       {{kPull, 0.55, -1018200},
        {kPull, 0.67, -552200},
        {kPull, 0.80, -275000},
        {kPull, 0.93, -86000},
        {kPull, 1.11, 99100},
        {kPull, 1.46, 301400},
        {kPull, 1.85, 491900},
        {kBoth, 1.05, 95200},
        {kBoth, 1.34, 403000},
        {kBoth, 1.77, 740100},
        {kPure, 1.10, 154500},
        {kPure, 1.38, 347800},
        {kPure, 1.75, 548600}}},
  };
  return tissues;
}

}  // namespace meshless::bench
