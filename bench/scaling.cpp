// How run time grows: with particles, triangles, bodies, pieces and threads, and how far the elastic substep is from
// what the machine can do. Wall time of a simulated second of World::step at the world's defaults, medians of three
// runs, on one and on two threads:
//   particles            an uncut elastic organ of 0.2 m on the ground, by its spacing
//   substep_per_cell     of it, by cells: a substep of the world over its cells
//   triangles            the organ at the spacing that the package chooses, by triangles of its surface
//   triangles_seen       of it, with the surface read 60 times a second, as a viewer does
//   bodies               cubes of 27 particles on the ground that do not touch, of one cluster
//   bodies_elastic       the same of elastic tissue
//   pieces_early         the organ cut by random planes, by its pieces: the first half second after the cuts, twice
//   pieces_late          of them, the third second
//   threads_pieces       the first half second after six cuts, by threads
//   threads_organ        the uncut organ of 20,000 particles, by threads
//   roofline             the elastic forces of a substep on one thread, by cells (elastic_cost.h)
// Sleep is switched off, but for the pieces: there, what sleeps as a whole is in the table and not in the plot. Large
// worlds settle for less long and make fewer steps; runs of pieces that take longer than 8 s are made once. --only
// takes particles, triangles, bodies, pieces, threads or roofline. --out FOLDER: scaling.csv, roofline.csv and plots.
// In the plots, "ideal" has exponent 1 through the largest point of one thread (a cell's substep 0; threads -1 through
// the first).
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "clock.h"
#include "contact_pieces.h"
#include "elastic_cost.h"
#include "machine_limits.h"
#include "plot.h"
#include "scaling_scenes.h"

namespace meshless::bench {
namespace {

constexpr double kRunBudget = 0.3, kSettleBudget = 4.0;    // [s] of wall time
constexpr double kLongRun = 8.0;                           // [s] of pieces
constexpr int kFewest = 2, kMost = 1200, kSettling = 120;  // steps
constexpr std::uint64_t kSeed = 1;                         // of the planes

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n == 0 ? 0.0 : 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

using Curve = std::vector<std::pair<double, double>>;  // x, seconds

// Least squares of log seconds over log x in the upper half of the points.
double exponentOf(Curve points, std::size_t& used) {
  std::sort(points.begin(), points.end());
  used = std::max<std::size_t>((points.size() + 1) / 2, 2);
  double x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
  const double n = static_cast<double>(used);
  for (std::size_t k = points.size() - used; k < points.size(); ++k) {
    const double a = std::log(points[k].first), b = std::log(points[k].second);
    x += a;
    y += b;
    xx += a * a;
    xy += a * b;
  }
  const double spread = n * xx - x * x;
  return spread > 1e-12 ? (n * xy - x * y) / spread : 0.0;
}

constexpr int kByThreads = 0;
std::string threadsOf(int threads) {
  if (threads == kByThreads) return "";
  return threads == 1 ? ", 1 thread" : ", " + std::to_string(threads) + " threads";
}

class Table {
 public:
  Table(const std::string& folder) : file_(folder + "/scaling.csv") {
    file_ << "series,x,threads,seconds,particles,bytes_per_particle\n";
  }
  bool good() const { return file_.good(); }

  // What is asleep as a whole costs nothing: it is in the table alone.
  void add(const std::string& series, double x, int threads, double seconds, const MemoryUse& memory = {},
           bool asleep = false) {
    if (!asleep) curves[series][series.rfind("threads_", 0) == 0 ? kByThreads : threads].emplace_back(x, seconds);
    char line[200];
    std::snprintf(line, sizeof line, "%s,%.0f,%d,%.4g,", series.c_str(), x, threads, seconds);
    std::string row = line;
    if (memory.particles > 0)
      row += std::to_string(memory.particles) + "," + std::to_string(std::lround(memory.perParticle()));
    else
      row += ",";
    file_ << row << std::endl;
    std::printf("%s\n", row.c_str());
    std::fflush(stdout);
  }

  void printExponents() const {
    for (const auto& [series, of_series] : curves)
      for (const auto& [threads, points] : of_series) {
        if (points.size() < 2) continue;
        std::size_t used = 0;
        const double exponent = exponentOf(points, used);
        std::printf("# %s%s: exponent %.2f of the upper %zu of %zu points\n", series.c_str(),
                    threadsOf(threads).c_str(), exponent, used, points.size());
      }
  }

  // By series, and by threads or kByThreads.
  std::map<std::string, std::map<int, Curve>> curves;

 private:
  std::ofstream file_;
};

struct Run {
  bool quick = false;
  int runs = 3;
  std::vector<int> threads{1, 2};
  std::string folder;
  Table& table;
  double memory_bandwidth = 0.0;  // [bytes/s] once it was measured
  Curve bound;                    // of the particles, by memory_bandwidth

  double bandwidth() {
    if (!(memory_bandwidth > 0.0)) memory_bandwidth = triadBandwidth(beyondCaches());
    return memory_bandwidth;
  }
};

void settle(World& world) {
  const double end = now() + kSettleBudget;
  for (int n = 0; n < kSettling && now() < end; ++n) world.step();
}

int stepsWithin(World& world) {
  (void)secondsOf(world, 1);  // what the first one prepares is not its time
  return std::clamp(static_cast<int>(kRunBudget / secondsOf(world, 1)), kFewest, kMost);
}

struct Pace {
  double second = 0.0;   // [s] for a simulated one
  double substep = 0.0;  // [s] of a body that is alone
};

// Medians of runs one after another. `seen`: the surfaces are read after every second step.
Pace paceOf(World& world, int runs, bool seen = false) {
  const int steps = stepsWithin(world);
  std::vector<double> seconds, substeps;
  for (int run = 0; run < runs; ++run) {
    double time = 0.0, parts = 0.0;
    const bool alone = world.bodyCount() == 1;
    for (int n = 0; n < steps; ++n) {
      const double start = now();
      world.step();
      if (seen && n % 2 == 1) (void)world.snapshot({true, false, false});
      time += now() - start;
      if (alone) parts += static_cast<double>(world.snapshot({}).report.substeps);
    }
    seconds.push_back(time / steps * world.settings().step_rate);
    substeps.push_back(alone ? time / parts : 0.0);
  }
  return {median(seconds), median(substeps)};
}

// A world that settled once, on so many threads.
class Settled {
 public:
  explicit Settled(World&& world) {
    settle(world);
    saved_ = world.capture();
  }
  World on(int threads) const {
    World world = makeWorld(threads, true);  // sleep is that of the state
    world.restore(*saved_);
    return world;
  }

 private:
  std::shared_ptr<const SavedWorld> saved_;
};

void runParticles(Run& run) {
  std::vector<std::size_t> sizes{500, 1000, 2000, 5000};
  if (!run.quick) sizes.insert(sizes.end(), {10000, 20000, 50000, 100000});
  for (const std::size_t size : sizes) {
    const BodyPtr organ = makeOrganOf(size, particlesOf);
    if (!organ) continue;
    const double particles = static_cast<double>(particlesOf(*organ->model));
    const double cells = static_cast<double>(cellsOf(*organ->model));
    const Settled settled(worldWith(organ, 1, false));
    for (const int threads : run.threads) {
      World world = settled.on(threads);
      const Pace pace = paceOf(world, run.runs);
      run.table.add("particles", particles, threads, pace.second, world.memory());
      run.table.add("substep_per_cell", cells, threads, pace.substep / cells);
      if (threads != run.threads.front()) continue;
      const double substeps = pace.second / pace.substep;
      std::printf("# %.0f cells, %.1f substeps a step, %.1f ns a cell and substep\n", cells,
                  substeps / world.settings().step_rate, 1e9 * pace.substep / cells);
      run.bound.emplace_back(particles, elasticWork(*organ->model).bytes * substeps / run.bandwidth());
    }
  }
}

void runTriangles(Run& run) {
  std::vector<std::size_t> sizes{4000, 20000, 60000};
  if (!run.quick) sizes = {4000, 10000, 20000, 50000, 100000, 200000};
  for (const std::size_t size : sizes) {
    const BodyPtr organ = makeOrgan(size, 0.0);
    if (!organ) continue;
    const double triangles = static_cast<double>(organ->model->surface.triangles.size());
    const Settled settled(worldWith(organ, 1, false));
    for (const int threads : run.threads)
      for (const bool seen : {false, true}) {
        World world = settled.on(threads);
        const Pace pace = paceOf(world, run.runs, seen);
        run.table.add(seen ? "triangles_seen" : "triangles", triangles, threads, pace.second, world.memory());
      }
  }
}

void runBodies(Run& run) {
  std::vector<int> counts{1, 3, 10, 30, 100, 300};
  const int most_elastic = run.quick ? 100 : 300;
  if (!run.quick) counts.insert(counts.end(), {1000, 3000});
  for (const bool elastic : {false, true})
    for (const int count : counts) {
      if (elastic && count > most_elastic) break;
      for (const int threads : run.threads) {
        World world = worldOfCubes(count, elastic, threads);
        settle(world);
        const Pace pace = paceOf(world, run.runs);
        run.table.add(elastic ? "bodies_elastic" : "bodies", count, threads, pace.second, world.memory());
      }
    }
}

struct PiecesPace {
  double early = 0.0, late = 0.0;  // [s] for a simulated one
  std::size_t pieces = 0;
  bool asleep = false;  // all of them, at the end
  MemoryUse memory;
};

// Each run from the same state; without `late` it ends after the half second. A long one is made once.
std::optional<PiecesPace> paceOfPieces(const Settled& settled, int cuts, int threads, int runs, bool late) {
  std::vector<double> early, later;
  PiecesPace pace;
  const double start = now();
  for (int n = 0; n < runs && !(n == 1 && now() - start > kLongRun); ++n) {
    World world = settled.on(threads);
    (void)secondsOf(world, 1);
    std::mt19937_64 random(kSeed);
    for (int cut = 0; cut < cuts; ++cut)
      if (!cutAll(world, random)) return std::nullopt;
    const int half = static_cast<int>(world.settings().step_rate) / 2;
    early.push_back(2.0 * secondsOf(world, half));
    pace.pieces = world.bodyCount();
    pace.memory = world.memory();
    if (!late) continue;
    (void)secondsOf(world, 3 * half);
    later.push_back(secondsOf(world, 2 * half));
    pace.asleep = world.snapshot({}).report.asleep == world.bodyCount();
  }
  pace.early = median(early);
  pace.late = median(later);
  return pace;
}

void runPieces(Run& run) {
  const BodyPtr organ = makeOrgan(4120, 0.0);
  if (!organ) return;
  const Settled settled(worldWith(organ, 1, true));
  std::vector<int> cuts{0, 2, 4};
  if (!run.quick) cuts = {0, 1, 2, 3, 4, 5, 6, 8, 10};
  for (const int count : cuts)
    for (const int threads : run.threads) {
      const std::optional<PiecesPace> pace = paceOfPieces(settled, count, threads, run.runs, true);
      if (!pace) {
        std::printf("# %d cuts were refused\n", count);
        continue;
      }
      const double pieces = static_cast<double>(pace->pieces);
      run.table.add("pieces_early", pieces, threads, pace->early, pace->memory);
      run.table.add("pieces_late", pieces, threads, pace->late, pace->memory, pace->asleep);
    }
}

void runThreads(Run& run) {
  const BodyPtr organ = makeOrgan(4120, 0.0);
  const BodyPtr large = makeOrganOf(run.quick ? 5000 : 20000, particlesOf);
  if (!organ || !large) return;
  const Settled to_cut(worldWith(organ, 1, true)), whole(worldWith(large, 1, false));
  for (const int threads : {1, 2, 4, 8}) {
    if (threads > 1 && threads > static_cast<int>(std::thread::hardware_concurrency())) break;
    if (const auto pace = paceOfPieces(to_cut, run.quick ? 4 : 6, threads, run.runs, false))
      run.table.add("threads_pieces", threads, threads, pace->early, pace->memory);
    World world = whole.on(threads);
    const double seconds = paceOf(world, run.runs).second;
    run.table.add("threads_organ", threads, threads, seconds, world.memory());
  }
}

void runRoofline(Run& run) {
  const double peak = peakOperations(), near = triadBandwidth(1u << 20), far = run.bandwidth();
  std::printf("# limits of one thread: 1 MB %.1f GB/s, memory (%.0f MB) %.1f GB/s, %.1f GFLOP/s\n", 1e-9 * near,
              1e-6 * static_cast<double>(beyondCaches()), 1e-9 * far, 1e-9 * peak);
  std::ofstream file(run.folder + "/roofline.csv");
  file << "cells,particles,boxes,megabytes,bytes_per_cell,flops_per_cell,ns_per_cell,gb_s,gflop_s,gb_s_1mb,gb_s_same,"
          "gb_s_memory,gflop_s_peak,ns_per_cell_of_world\n";
  for (const std::size_t size : {std::size_t{2000}, std::size_t{20000}}) {
    const BodyPtr organ = makeOrganOf(run.quick ? size / 4 : size, cellsOf);
    if (!organ) continue;
    const BodyModel& model = *organ->model;
    const double cells = static_cast<double>(cellsOf(model));
    const ElasticWork work = elasticWork(model);
    const ElasticTime time = timeElastic(model, organ->def.material);
    const double same = triadBandwidth(static_cast<std::size_t>(work.bytes));
    World world = worldWith(organ, 1, false);
    settle(world);
    const double in_world = paceOf(world, run.runs).substep;
    run.table.add("roofline", cells, 1, time.seconds, world.memory());
    std::printf(
        "# %.0f cells (%u whole), %zu particles, %.1f MB: %.0f bytes and %.0f operations a cell in %.1f ns: %.1f GB/s "
        "(as many bytes at best: %.1f, in memory: %.1f), %.1f GFLOP/s (at best: %.1f); a substep of the world: %.1f "
        "ns\n",
        cells, model.elastic_batch->whole(), particlesOf(model), 1e-6 * work.bytes, work.bytes / cells,
        work.operations / cells, 1e9 * time.seconds / cells, 1e-9 * work.bytes / time.seconds, 1e-9 * same, 1e-9 * far,
        1e-9 * work.operations / time.seconds, 1e-9 * peak, 1e9 * in_world / cells);
    if (time.cold > 0) std::printf("# %zu rotations were cold\n", time.cold);
    char line[300];
    std::snprintf(line, sizeof line, "%.0f,%zu,%u,%.2f,%.0f,%.0f,%.2f,%.2f,%.2f,%.2f,%.2f,%.2f,%.2f,%.2f", cells,
                  particlesOf(model), model.elastic_batch->whole(), 1e-6 * work.bytes, work.bytes / cells,
                  work.operations / cells, 1e9 * time.seconds / cells, 1e-9 * work.bytes / time.seconds,
                  1e-9 * work.operations / time.seconds, 1e-9 * near, 1e-9 * same, 1e-9 * far, 1e-9 * peak,
                  1e9 * in_world / cells);
    file << line << std::endl;
  }
}

// A straight line of that exponent through a point, as wide as the points.
Curve ideal(const Curve& points, const std::pair<double, double>& through, double exponent) {
  const auto [first, last] = std::minmax_element(points.begin(), points.end());
  Curve line;
  for (const double x : {first->first, last->first})
    line.emplace_back(x, through.second * std::pow(x / through.first, exponent));
  return line;
}

struct Drawing {
  const char *file, *title, *x, *y;
  std::vector<std::string> series;
  double exponent;
};

bool drawAll(const Run& run) {
  const std::vector<Drawing> drawings = {{"scaling_particles.png",
                                          "an uncut elastic organ on the ground",
                                          "particles",
                                          "time of a simulated second [s]",
                                          {"particles"},
                                          1.0},
                                         {"scaling_substep.png",
                                          "an uncut elastic organ on the ground",
                                          "cells",
                                          "time of a substep, a cell [s]",
                                          {"substep_per_cell"},
                                          0.0},
                                         {"scaling_triangles.png",
                                          "an elastic organ at its default spacing",
                                          "triangles",
                                          "time of a simulated second [s]",
                                          {"triangles", "triangles_seen"},
                                          1.0},
                                         {"scaling_bodies.png",
                                          "cubes of 27 particles that do not touch",
                                          "bodies",
                                          "time of a simulated second [s]",
                                          {"bodies", "bodies_elastic"},
                                          1.0},
                                         {"scaling_pieces.png",
                                          "an organ that was cut",
                                          "pieces",
                                          "time of a simulated second [s]",
                                          {"pieces_early", "pieces_late"},
                                          1.0},
                                         {"scaling_threads.png",
                                          "by threads",
                                          "threads",
                                          "time of a simulated second [s]",
                                          {"threads_pieces", "threads_organ"},
                                          -1.0}};
  bool drawn = true;
  for (const Drawing& drawing : drawings) {
    Plot plot;
    plot.title = drawing.title;
    plot.x = drawing.x;
    plot.y = drawing.y;
    for (const std::string& series : drawing.series) {
      const auto found = run.table.curves.find(series);
      if (found == run.table.curves.end()) continue;
      Curve all;
      for (const auto& [threads, points] : found->second) {
        plot.series[series + threadsOf(threads)] = points;
        all.insert(all.end(), points.begin(), points.end());
      }
      const Curve& one = found->second.begin()->second;
      const auto [first, last] = std::minmax_element(one.begin(), one.end());
      plot.series["ideal for " + series] = ideal(all, drawing.exponent < 0.0 ? *first : *last, drawing.exponent);
      if (series == "particles" && !run.bound.empty()) plot.series["bound by memory bandwidth"] = run.bound;
    }
    if (!plot.series.empty()) drawn = draw(plot, run.folder + "/" + drawing.file) && drawn;
  }
  return drawn;
}

}  // namespace
}  // namespace meshless::bench

int main(int argc, char** argv) {
  using namespace meshless::bench;
  const std::vector<std::pair<std::string, void (*)(Run&)>> all = {
      {"particles", runParticles}, {"triangles", runTriangles}, {"bodies", runBodies},
      {"pieces", runPieces},       {"threads", runThreads},     {"roofline", runRoofline}};
  std::vector<std::string> names;
  for (const auto& [name, run_series] : all) names.push_back(name);
  CLI::App app{"How run time grows with the size of a scene: scaling.csv and its plots"};
  std::string out = ".";
  std::vector<std::string> only;
  bool quick = false;
  app.add_option("--out", out, "folder for scaling.csv, roofline.csv and the plots")->check(CLI::ExistingDirectory);
  app.add_option("--only", only, "series")->check(CLI::IsMember(names));
  app.add_flag("--quick", quick, "small scenes, each once: minutes become seconds");
  CLI11_PARSE(app, argc, argv);
  Table table(out);
  if (!table.good()) {
    std::fprintf(stderr, "cannot write %s/scaling.csv\n", out.c_str());
    return 1;
  }
  Run run{quick, quick ? 1 : 3, {1, 2}, out, table, 0.0, {}};
  for (const auto& [name, run_series] : all) {
    if (!only.empty() && std::find(only.begin(), only.end(), name) == only.end()) continue;
    const double start = now();
    run_series(run);
    std::printf("# %s took %.0f s\n", name.c_str(), now() - start);
  }
  table.printExponents();
  if (!drawAll(run))
    std::fprintf(stderr, "gnuplot did not make the plots; the table is in %s/scaling.csv\n", out.c_str());
  return 0;
}
