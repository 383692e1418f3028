// A lattice of 20^3 particles with a cluster around each: pairs summed one by one, and summed neighbourhoods.
#include <algorithm>

#include "meshless_surgery/dynamics/summed_batch.h"
#include "step_rows.h"

namespace meshless::bench {
namespace {

std::shared_ptr<const Plain> makeLattice(int width) {
  constexpr int n = 20;
  auto body = std::make_shared<Plain>();
  addLattice(n, body->model);
  ClusterSet& set = body->model.clusters;
  std::vector<double> total(body->model.rest.size(), 0.0);
  set.offsets = {0};
  const auto from = [&](int i) { return std::max(0, i - width); };
  const auto to = [&](int i) { return std::min(n - 1, i + width); };
  for (int z = 0; z < n; ++z)
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x) {
        for (int c = from(z); c <= to(z); ++c)
          for (int b = from(y); b <= to(y); ++b)
            for (int a = from(x); a <= to(x); ++a) {
              set.members.push_back(static_cast<Index>((c * n + b) * n + a));
              total[set.members.back()] += 1.0;
            }
        set.offsets.push_back(static_cast<Index>(set.members.size()));
      }
  for (Index i : set.members) set.weights.push_back(1.0 / total[i]);
  body->finish();
  Engine engine(2);
  throwIn(*body, engine, 0.5, 2.0);
  return body;
}

template <class Batch>
void putBack(Batch& batch, const Plain& body) {
  std::vector<Quat> rotations;
  for (const ClusterPose& pose : body.state.poses) rotations.push_back(pose.rotation);
  batch.setState(body.state.positions, body.state.velocities, rotations);
}

template <class Batch>
Points positionsOf(const Batch& batch) {
  Points positions, velocities;
  std::vector<Quat> rotations;
  batch.getState(positions, velocities, rotations);
  return positions;
}

template <class Batch>
void runLattice(benchmark::State& state, const Plain& body, InstructionSet set, bool two_threads) {
  const Material material = appearanceOf(MatchMode::kLinear);
  BatchStep step = stepOf(material);
  step.set = set;
  Batch batch(matchInput(body.model));
  putBack(batch, body);
  MatchCounters counters;
  const Loop loop(two_threads);
  int steps = 0;
  for (auto _ : state) {
    batch.step(step, counters, loop.forEach());
    if (++steps % kRestart == 0) {
      state.PauseTiming();
      putBack(batch, body);
      state.ResumeTiming();
    }
  }
  if (two_threads) {
    Points ends[2];
    for (int way : {0, 1}) {
      putBack(batch, body);
      for (int n = 0; n < kRestart / 2; ++n) batch.step(step, counters, way ? loop.forEach() : oneAfterAnother);
      ends[way] = positionsOf(batch);
    }
    state.counters["same"] = ends[0] == ends[1];
  }
  putBack(batch, body);
  batch.step(step, counters);
  Plain expected = body;
  expected.step(material, step);
  state.counters["error"] = farthest(positionsOf(batch), expected.state.positions) / (19.0 * kSpacing);
  state.counters["pairs"] = static_cast<double>(body.model.clusters.members.size());
}

void runPlainLattice(benchmark::State& state, const Plain& from) {
  const Material material = appearanceOf(MatchMode::kLinear);
  const BatchStep step = stepOf(material);
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

}  // namespace

void registerLattice() {
  const char* const set_names[] = {"baseline", "avx2", "avx512"};
  for (int width : {1, 2, 3}) {
    const auto body = makeLattice(width);
    const std::string w = "w" + std::to_string(width), row = "lattice20/general/" + w, summed = "lattice20/summed/" + w;
    const InstructionSet widest = widestInstructionSet();
    const auto add = [](const std::string& name, const auto& run) {
      settle(benchmark::RegisterBenchmark(name.c_str(), run));
    };
    add(row, [=](benchmark::State& s) { runLattice<OverlapBatch>(s, *body, widest, false); });
    add(row + "/2threads", [=](benchmark::State& s) { runLattice<OverlapBatch>(s, *body, widest, true); });
    add(summed, [=](benchmark::State& s) { runLattice<SummedBatch>(s, *body, widest, false); });
    add(summed + "/2threads", [=](benchmark::State& s) { runLattice<SummedBatch>(s, *body, widest, true); });
    add("reference/" + row, [=](benchmark::State& s) { runPlainLattice(s, *body); });
    for (InstructionSet set : {InstructionSet::kBaseline, InstructionSet::kAvx2}) {
      if (!instructionSetAvailable(set)) continue;
      const std::string name = set_names[static_cast<int>(set)];
      add("sets/" + row + "/" + name, [=](benchmark::State& s) { runLattice<OverlapBatch>(s, *body, set, false); });
      add("sets/" + summed + "/" + name, [=](benchmark::State& s) { runLattice<SummedBatch>(s, *body, set, false); });
    }
  }
}

}  // namespace meshless::bench
