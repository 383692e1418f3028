// Run time of a frame of 1/60 s with contact: piles of unit cubes of 27 particles (contact_pile.h) that have fallen for
// 180 frames, the median of the next 120, with four substeps. pile27/N is this package on one and on two threads,
// bullet_vf/N and bullet_cl/N are Bullet's soft bodies from the same places in the same process (contact_bullet.h),
// textbook/N the paper's method, asleep/1000 the pile after it fell asleep and awake/1000 the same pile kept awake,
// sweep/N and sweep_bullet_*/N the growth with the number of bodies. Counters: `deepest` and `p99` penetration relative
// to the cubes' size, `height` relative to ideal stacks, `contacts` and `queries` a frame, `contact_ms` and `match_ms`
// of the frame, `ns_a_contact` the time of all of a frame's contact over its contacts and substeps, `exponent` of a
// sweep (least squares of log time over log N, on its last row). after_cut/*: by how much the first step after the cut
// of a ball on a bed takes longer than those before, the median of five; `before_ms`, `first_ms` and `next_ms`
// (contact_after_cut.h). pieces/organ/MATERIAL/CUTS: an organ on the ground, cut through its middle (contact_pieces.h);
// the time is that of the third simulated second, `uncut_s` of one before the cuts, `early_s` twice that of the first
// half second, `first_ms` of the first step; at the end volumes of pieces over rest, `mm_s` the root mean square of the
// speed, and how many are `asleep`.
// --out=DIR writes bench_contact.csv and bench_contact.png there.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <map>
#include <string>
#include <tuple>

#include <benchmark/benchmark.h>

#include "contact_after_cut.h"
#include "contact_pieces.h"
#include "contact_pile.h"
#include "plot.h"

#ifdef HAVE_BULLET
#include "contact_bullet.h"
#endif

namespace meshless::bench {
namespace {

constexpr int kSettling = 180, kMeasured = 120;  // frames
constexpr int kLongestFall = 1200;               // frames in which a pile has to be asleep

struct Row {
  int bodies = 0;
  double ms = 0.0;
  PileMeasures measures;
  double contacts = 0.0;
};
std::map<std::string, std::vector<Row>> series;  // what rows measured, for the exponent, the table and the plot
double awake_ms = 0.0;

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n == 0 ? 0.0 : 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

/// [ms] median of the measured frames.
double medianFrame(const std::function<void()>& step, int frames) {
  std::vector<double> times;
  for (int n = 0; n < frames; ++n) {
    const auto start = std::chrono::steady_clock::now();
    step();
    times.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }
  return median(times);
}

double exponentOf(const std::vector<Row>& rows) {
  double x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
  const double n = static_cast<double>(rows.size());
  for (const Row& row : rows) {
    const double a = std::log(row.bodies), b = std::log(row.ms);
    x += a;
    y += b;
    xx += a * a;
    xy += a * b;
  }
  return (n * xy - x * y) / (n * xx - x * x);
}

void report(benchmark::State& state, const std::string& name, const Row& row, bool last_of_sweep) {
  series[name].push_back(row);
  state.counters["deepest"] = row.measures.deepest;
  state.counters["p99"] = row.measures.p99;
  state.counters["height"] = row.measures.height;
  state.counters["contacts"] = row.contacts;
  if (last_of_sweep && series[name].size() > 1) state.counters["exponent"] = exponentOf(series[name]);
  if (!row.measures.finite) state.SkipWithError("a position is not finite");
}

void runPile(benchmark::State& state, const std::string& name, const PileOptions& options, bool last_of_sweep) {
  for (auto _ : state) {
    World world = makePile(options);
    for (int n = 0; n < kSettling; ++n) world.step();
    std::vector<double> contact, match;
    double contacts = 0.0, queries = 0.0, contact_work = 0.0;
    Row row;
    row.bodies = options.bodies;
    std::vector<double> totals;
    for (int n = 0; n < kMeasured; ++n) {
      totals.push_back(medianFrame([&] { world.step(); }, 1));
      const StepReport report = world.snapshot({}).report;
      contact.push_back(1e3 * report.contact);
      match.push_back(1e3 * report.match);
      const ContactCounters& c = report.contact_counters;
      contacts +=
          static_cast<double>(options.contact == ContactMethod::kTextbook ? c.penetrating : c.contacts) / kMeasured;
      queries += static_cast<double>(c.queries) / kMeasured;
      contact_work += static_cast<double>(c.contacts) * static_cast<double>(report.substeps) / kMeasured;
    }
    row.ms = median(totals);
    row.contacts = contacts;
    row.measures = measurePile(options, world);
    state.SetIterationTime(1e-3 * row.ms);
    state.counters["lookups"] = queries;
    state.counters["contact_ms"] = median(contact);
    state.counters["match_ms"] = median(match);
    if (contact_work > 0.0) state.counters["ns_a_contact"] = 1e6 * median(contact) / contact_work;
    report(state, name, row, last_of_sweep);
  }
}

#ifdef HAVE_BULLET
void runBullet(benchmark::State& state, const std::string& name, const PileOptions& options, BulletWay way,
               bool last_of_sweep) {
  for (auto _ : state) {
    BulletPile pile(options, way);
    for (int n = 0; n < kSettling; ++n) pile.step();
    Row row;
    row.bodies = options.bodies;
    row.ms = medianFrame([&] { pile.step(); }, kMeasured);
    row.contacts = static_cast<double>(pile.contacts());
    row.measures = measurePile(options, pile.positions());
    state.SetIterationTime(1e-3 * row.ms);
    report(state, name, row, last_of_sweep);
  }
}
#endif

/// The pile after it fell asleep, or as long after its fall kept awake.
void runRest(benchmark::State& state, bool sleeping) {
  for (auto _ : state) {
    PileOptions options;
    options.sleeping = sleeping;
    World world = makePile(options);
    int frames = 0;
    std::size_t asleep = 0;
    while (frames < (sleeping ? kLongestFall : kSettling) && asleep < static_cast<std::size_t>(options.bodies)) {
      world.step();
      ++frames;
      asleep = world.snapshot({}).report.asleep;
    }
    const double ms = medianFrame([&] { world.step(); }, kMeasured);
    state.SetIterationTime(1e-3 * ms);
    state.counters["asleep"] = static_cast<double>(asleep);
    if (sleeping) {
      state.counters["seconds_until_asleep"] = frames / 60.0;
      if (awake_ms > 0.0) state.counters["ratio"] = ms / awake_ms;
    } else {
      awake_ms = ms;
    }
  }
}

void runAfterCut(benchmark::State& state, const AfterCut& of) {
  std::vector<double> before, first, next, more;
  for (auto _ : state) {
    for (int run = 0; run < 5; ++run) {
      const AfterCutTimes times = timeAfterCut(of);
      if (times.before < 0.0) return state.SkipWithError("refused");
      before.push_back(times.before);
      first.push_back(times.first);
      next.push_back(times.next);
      more.push_back(times.first - times.before);
    }
    state.SetIterationTime(1e-3 * std::max(median(more), 0.0));
  }
  state.counters["before_ms"] = median(before);
  state.counters["first_ms"] = median(first);
  state.counters["next_ms"] = median(next);
}

void runPieces(benchmark::State& state, const Pieces& of) {
  for (auto _ : state) {
    const PiecesTimes times = timePieces(of);
    if (times.late < 0.0) return state.SkipWithError("refused");
    state.SetIterationTime(times.late);
    state.counters["uncut_s"] = times.uncut;
    state.counters["early_s"] = times.early;
    state.counters["first_ms"] = times.first;
    state.counters["least_volume"] = times.least_volume;
    state.counters["most_volume"] = times.most_volume;
    state.counters["mm_s"] = 1e3 * times.speed;
    state.counters["pieces"] = static_cast<double>(times.pieces);
    state.counters["asleep"] = static_cast<double>(times.asleep);
  }
}

void runOrgans(benchmark::State& state, bool cut, int threads) {
  for (auto _ : state) {
    std::vector<double> times;
    for (int run = 0; run < 3; ++run) times.push_back(timeOrgans(cut, threads));
    if (median(times) < 0.0) return state.SkipWithError("refused");
    state.SetIterationTime(median(times));
  }
}

void add(const std::string& name, const std::function<void(benchmark::State&)>& run) {
  benchmark::RegisterBenchmark(name.c_str(), run)->Unit(benchmark::kMillisecond)->UseManualTime()->Iterations(1);
}

void registerRows() {
  const auto of = [](int bodies) {
    PileOptions options;
    options.bodies = bodies;
    return options;
  };
  const auto addPile = [&](const std::string& name, const std::string& of_series, PileOptions options, bool last) {
    add(name, [=](benchmark::State& s) { runPile(s, of_series, options, last); });
  };
  for (const int bodies : {100, 1000})
    for (const int threads : {1, 2}) {
      PileOptions options = of(bodies);
      options.threads = threads;
      addPile("pile27/" + std::to_string(bodies) + "/" + std::to_string(threads) + "threads",
              threads == 1 ? "pile27" : "pile27, 2 threads", options, false);
    }
#ifdef HAVE_BULLET
  const std::pair<const char*, BulletWay> ways[] = {{"bullet_vf", BulletWay::kLinks},
                                                    {"bullet_cl", BulletWay::kCluster}};
  const auto addBullet = [&](const std::string& name, const std::string& of_series, BulletWay way, int bodies,
                             bool last) {
    add(name + "/" + std::to_string(bodies),
        [=](benchmark::State& s) { runBullet(s, of_series, of(bodies), way, last); });
  };
  for (const auto& [name, way] : ways)
    for (const int bodies : {100, 1000}) addBullet(name, name, way, bodies, false);
#endif
  PileOptions textbook = of(100);
  textbook.contact = ContactMethod::kTextbook;
  addPile("textbook/100", "textbook", textbook, false);
  add("awake/1000", [](benchmark::State& s) { runRest(s, false); });
  add("asleep/1000", [](benchmark::State& s) { runRest(s, true); });
  for (const bool elastic : {false, true})
    for (const bool upright : {false, true})
      for (const int threads : {1, 2})
        add(std::string("after_cut/") + (elastic ? "elastic/" : "looks/") + (upright ? "upright/" : "level/") +
                std::to_string(threads) + "threads",
            [=](benchmark::State& s) {
              runAfterCut(s, {elastic, upright, threads});
            });
  const auto material = [](double youngs_modulus, double friction) {
    Material of_organ;
    of_organ.youngs_modulus = youngs_modulus;
    of_organ.poissons_ratio = 0.45;
    of_organ.density = 1060.0;
    of_organ.damping = 10.0;
    of_organ.friction = friction;
    return of_organ;
  };
  const Material liver = material(4500.0, 0.3);  // as shipped
  std::vector<std::pair<std::string, Pieces>> organs;
  for (const auto& [name, triangles] : {std::pair("", 4120), std::pair("/20k", 20000), std::pair("/60k", 60000)})
    for (const unsigned seed : {1, 2, 3, 4, 5})
      organs.push_back(
          {std::string("elastic_liver/4") + name + "/seed" + std::to_string(seed), {seed, 0, 4, liver, 1, triangles}});
  organs.push_back({"elastic_liver/8", {1, 0, 8, liver, 1}});
  organs.push_back({"elastic_kidney/3", {3, 2, 3, material(5000.0, 0.3), 1}});
  organs.push_back({"elastic_muscle/1", {4, 0, 1, material(11100.0, 0.4), 1}});
  organs.push_back({"default/6", {5, 0, 6, Material(), 1}});
  for (const auto& [name, pieces] : organs)
    for (const int threads : {1, 2}) {
      Pieces on_threads = pieces;
      on_threads.threads = threads;
      add(std::string("pieces/organ/") + name + "/" + std::to_string(threads) + "threads",
          [=](benchmark::State& s) { runPieces(s, on_threads); });
    }
  for (const bool cut : {false, true})
    for (const int threads : {1, 2})
      add(std::string("organs5/") + (cut ? "cut/" : "uncut/") + std::to_string(threads) + "threads",
          [=](benchmark::State& s) { runOrgans(s, cut, threads); });
  for (const int bodies : {10, 30, 100, 300, 1000, 3000, 10000})
    addPile("sweep/" + std::to_string(bodies), "sweep", of(bodies), bodies == 10000);
#ifdef HAVE_BULLET
  for (const auto& [name, way] : ways)
    for (const int bodies : {10, 30, 100, 300, 1000, 3000})
      addBullet(std::string("sweep_") + name, std::string("sweep_") + name, way, bodies, bodies == 3000);
#endif
}

bool write(const std::string& folder) {
  std::ofstream table(folder + "/bench_contact.csv");
  table << "row,bodies,ms,deepest,p99,height,contacts\n";
  for (const auto& [name, rows] : series)
    for (const Row& row : rows)
      table << name << ',' << row.bodies << ',' << row.ms << ',' << row.measures.deepest << ',' << row.measures.p99
            << ',' << row.measures.height << ',' << row.contacts << '\n';
  Plot plot;
  plot.title = "a frame of 1/60 s of piles of cubes, four substeps";
  plot.x = "bodies";
  plot.y = "time [ms]";
  const std::pair<const char*, const char*> drawn[] = {{"sweep", "meshless surgery"},
                                                       {"sweep_bullet_vf", "Bullet, vertices and faces"},
                                                       {"sweep_bullet_cl", "Bullet, clusters"}};
  for (const auto& [name, title] : drawn)
    for (const Row& row : series[name]) plot.series[title].emplace_back(row.bodies, row.ms);
  return table.good() && (plot.series.empty() || draw(plot, folder + "/bench_contact.png"));
}

}  // namespace
}  // namespace meshless::bench

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  std::string folder;
  for (int k = 1; k < argc; ++k)
    if (const std::string word = argv[k]; word.rfind("--out=", 0) == 0) {
      folder = word.substr(6);
      std::rotate(argv + k, argv + k + 1, argv + argc);
      --argc;
      --k;
    }
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  meshless::bench::registerRows();
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  if (!folder.empty() && !meshless::bench::write(folder)) {
    std::fprintf(stderr, "could not write bench_contact.csv and bench_contact.png into %s\n", folder.c_str());
    return 1;
  }
  return 0;
}
