// A lattice of 20^3 particles in its 19^3 cells with Young's modulus and Poisson's ratio: the batch in double, spread
// over threads, and the plain path. A substep as matchAndMove() (body/deform.h) makes it.
#include <algorithm>
#include <array>
#include <cmath>

#include "step_rows.h"

namespace meshless::bench {
namespace {

constexpr int kSize = 20;
constexpr std::size_t kChunk = 256;  // particles a task

Material softTissue() {
  Material material;
  material.youngs_modulus = 5000.0;
  material.poissons_ratio = 0.45;
  material.density = 1060.0;
  material.damping = 4.0;
  return material;
}
ElasticParameters parametersOf(const Material& m, double factor) {
  return elasticParameters(factor * m.youngs_modulus, m.poissons_ratio, m.density);
}

std::shared_ptr<const Plain> makeCells() {
  auto body = std::make_shared<Plain>();
  BodyModel& model = body->model;
  const Material material = softTissue();
  addLattice(kSize, model);
  std::vector<std::array<Index, 8>> cells;
  const auto at = [](int x, int y, int z) { return static_cast<Index>((z * kSize + y) * kSize + x); };
  const double mass = material.density * kSpacing * kSpacing * kSpacing;
  model.masses.assign(model.rest.size(), 0.0);
  for (int z = 0; z + 1 < kSize; ++z)
    for (int y = 0; y + 1 < kSize; ++y)
      for (int x = 0; x + 1 < kSize; ++x) {
        cells.emplace_back();
        for (int k = 0; k < 8; ++k) {
          cells.back()[k] = at(x + (k & 1), y + (k >> 1 & 1), z + (k >> 2));
          model.masses[cells.back()[k]] += mass / 8.0;
        }
      }
  model.clusters = clustersOfCells(cells, std::vector<double>(cells.size(), mass), model.masses);
  body->finish();
  makeTissue(model, material);
  Engine engine(2);
  throwIn(*body, engine, 0.5, 2.0);
  return body;
}

BatchStep elasticStep(const Plain& body) {
  BatchStep step = stepOf(softTissue());
  step.h = 0.9 * longestSubstep(body.model, body.state);
  return step;
}

Mat3 inverseInertia(double mass, const Vec3& centre, Mat3 moment) {
  moment -= mass * centre * centre.transpose();
  return (moment.trace() * Mat3::Identity() - moment).inverse();
}

// The laws of matchAndMove(), with every pass over the particles in chunks for threads.
class CellsLoop {
 public:
  explicit CellsLoop(const Plain& body) : body_(body) { putBack(body); }

  void putBack(const Plain& body) {
    body_.state = body.state;
    body_.model.elastic_batch->setRotations(body_.state.poses, scratch_);
  }
  const BodyState& state() const { return body_.state; }

  void step(const BatchStep& s, const ForEach& for_each) {
    const BodyModel& model = body_.model;
    Points &x = body_.state.positions, &v = body_.state.velocities;
    const double factor = stiffnessFactor(model, body_.state, s.h);
    const double ahead = viscosityTime(model, body_.state, s.h);
    predicted_.resize(x.size());
    sums_.resize((x.size() + kChunk - 1) / kChunk);
    const Vec3 origin = x[0];
    std::fill(sums_.begin(), sums_.end(), Sums());
    forChunks(for_each, [&](std::size_t chunk, std::size_t i) {
      Sums& sum = sums_[chunk];
      const double m = model.masses[i];
      const Vec3 r = x[i] - origin;
      sum.centre += m * r;
      sum.moment += m * r * r.transpose();
      sum.velocity += m * v[i];
      sum.spin += m * r.cross(v[i]);
    });
    Sums all;
    for (const Sums& sum : sums_) all.add(sum);
    const Vec3 centre = all.centre / model.mass, velocity = all.velocity / model.mass;
    const Mat3 inverse = inverseInertia(model.mass, centre, all.moment);
    const Vec3 spin = inverse * (all.spin - centre.cross(all.velocity));
    const double kept = std::exp(-s.damping * s.h);
    forChunks(for_each, [&](std::size_t, std::size_t i) {
      const Vec3 together = velocity + spin.cross(x[i] - origin - centre), deforming = kept * (v[i] - together);
      v[i] = together + deforming;
      predicted_[i] = x[i] + ahead * v[i];
    });
    body_.state.stretch =
        model.elastic_batch->accelerate(matchInput(model), parametersOf(softTissue(), factor), predicted_, scratch_,
                                        accelerations_, counters_, 1.0, s.set, for_each);
    forChunks(for_each, [&](std::size_t chunk, std::size_t i) {
      sums_[chunk].leaked += model.masses[i] * (x[i] - origin - centre).cross(s.h * accelerations_[i]);
    });
    Vec3 leaked = Vec3::Zero();
    for (const Sums& sum : sums_) leaked += sum.leaked;
    const Vec3 restore = inverse * leaked;
    forChunks(for_each, [&](std::size_t, std::size_t i) {
      v[i] += s.h * (accelerations_[i] + s.gravity) - restore.cross(x[i] - origin - centre);
      x[i] += s.h * v[i];
    });
  }

 private:
  struct alignas(64) Sums {
    Vec3 centre = Vec3::Zero(), velocity = Vec3::Zero(), spin = Vec3::Zero(), leaked = Vec3::Zero();
    Mat3 moment = Mat3::Zero();

    void add(const Sums& s) { centre += s.centre, velocity += s.velocity, spin += s.spin, moment += s.moment; }
  };

  template <class Work>
  void forChunks(const ForEach& for_each, const Work& work) const {
    const std::size_t size = body_.state.positions.size();
    for_each((size + kChunk - 1) / kChunk, [&](std::size_t chunk) {
      for (std::size_t i = chunk * kChunk; i < std::min(size, (chunk + 1) * kChunk); ++i) work(chunk, i);
    });
  }

  Plain body_;
  ElasticBatchState scratch_;
  Points predicted_, accelerations_;
  std::vector<Sums> sums_;
  MatchCounters counters_;
};

void runCells(benchmark::State& state, const Plain& body, InstructionSet set, bool two_threads) {
  BatchStep step = elasticStep(body);
  step.set = set;
  CellsLoop cells(body);
  const Loop loop(two_threads);
  int steps = 0;
  for (auto _ : state) {
    cells.step(step, loop.forEach());
    if (++steps % kRestart == 0) {
      state.PauseTiming();
      cells.putBack(body);
      state.ResumeTiming();
    }
  }
  if (two_threads) {
    Points ends[2];
    for (int way : {0, 1}) {
      cells.putBack(body);
      for (int n = 0; n < kRestart / 2; ++n) cells.step(step, way ? loop.forEach() : ForEach(oneAfterAnother));
      ends[way] = cells.state().positions;
    }
    state.counters["same"] = ends[0] == ends[1];
  }
  cells.putBack(body);
  cells.step(step, oneAfterAnother);
  Plain expected = body;
  plainElasticStep(expected, softTissue(), step);
  state.counters["error"] = farthest(cells.state().positions, expected.state.positions) / (19.0 * kSpacing);
  state.counters["cells"] = static_cast<double>(body.model.clusters.size());
}

// What the world runs: matchAndMove() itself, on one thread.
void runWorldCells(benchmark::State& state, const Plain& from, const Material& material) {
  const BatchStep step = elasticStep(from);
  Plain body = from;
  int steps = 0;
  for (auto _ : state) {
    body.step(material, step);
    if (++steps % kRestart == 0) {
      state.PauseTiming();
      body.state = from.state;
      state.ResumeTiming();
    }
  }
}

void runPlainCells(benchmark::State& state, const Plain& from) {
  const BatchStep step = elasticStep(from);
  Plain body = from;
  int steps = 0;
  for (auto _ : state) {
    plainElasticStep(body, softTissue(), step);
    if (++steps % kRestart == 0) {
      state.PauseTiming();
      body.state = from.state;
      state.ResumeTiming();
    }
  }
}

}  // namespace

void plainElasticStep(Plain& body, const Material& material, const BatchStep& s) {
  const BodyModel& model = body.model;
  Points &x = body.state.positions, &v = body.state.velocities;
  body.scratch.previous = x;
  Points& y = body.scratch.predicted;
  y = x;
  const double kept = std::exp(-s.damping * s.h);
  const double factor = stiffnessFactor(model, body.state, s.h);
  const double ahead = viscosityTime(model, body.state, s.h);
  RigidMotion rigid;  // none of its own where the body is held
  if (!model.any_fixed) rigid = rigidMotionOf(model, x, v);
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Vec3 together = rigid.velocity + rigid.spin.cross(x[i] - rigid.centre);
    const Vec3 deforming = kept * (v[i] - together);
    v[i] = together + deforming;
    if (!model.fixed[i]) y[i] += ahead * v[i];
  }
  Points& accelerations = body.scratch.goals;
  body.state.stretch = elasticAccelerations(matchInput(model), model.elastic, parametersOf(material, factor), y,
                                            body.state.poses, accelerations, body.counters);
  Points dv(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) dv[i] = s.h * accelerations[i];
  RigidMotion leak;
  if (!model.any_fixed) leak = rigidMotionOf(model, x, dv);
  for (std::size_t i = 0; i < x.size(); ++i) v[i] += dv[i] - leak.spin.cross(x[i] - leak.centre);
  for (std::size_t i = 0; i < x.size(); ++i) {
    v[i] = model.fixed[i] ? Vec3(Vec3::Zero()) : Vec3(v[i] + s.h * s.gravity);
    x[i] += s.h * v[i];
  }
  velocitiesFromPositions(s.h, body.state, body.scratch);
}

void registerCells() {
  const char* const set_names[] = {"baseline", "avx2", "avx512"};
  const auto body = makeCells();
  const InstructionSet widest = widestInstructionSet();
  const std::string row = "lattice20/cells";
  const auto add = [](const std::string& name, const auto& run) {
    settle(benchmark::RegisterBenchmark(name.c_str(), run));
  };
  add(row, [=](benchmark::State& s) { runCells(s, *body, widest, false); });
  add(row + "/2threads", [=](benchmark::State& s) { runCells(s, *body, widest, true); });
  add(row + "/world", [=](benchmark::State& s) { runWorldCells(s, *body, softTissue()); });
  Material stiffening = softTissue();
  stiffening.asymmetry = 10.0;
  stiffening.stiffening = 5.0;
  add(row + "/world/stiffening", [=](benchmark::State& s) { runWorldCells(s, *body, stiffening); });
  add("reference/" + row, [=](benchmark::State& s) { runPlainCells(s, *body); });
  for (InstructionSet set : {InstructionSet::kBaseline, InstructionSet::kAvx2})
    if (instructionSetAvailable(set))
      add("sets/" + row + "/" + set_names[static_cast<int>(set)],
          [=](benchmark::State& s) { runCells(s, *body, set, false); });
}

}  // namespace meshless::bench
