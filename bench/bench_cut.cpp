// Run time of a cut into two sealed halves, and of CGAL's clip of both sides with caps in the same process.
// sphere/50k is a ball of some 50,000 triangles cut through its middle, with points inside the cap; sphere/50k/plain
// without; cgal_clip/sphere/50k is CGAL's, without copying the mesh for it. A row fails where the volumes do not add
// up. whole/10k is the command until the pieces have made a step, incision/10k half an incision through the same ball
// until it is answered; whole/60k and incision/60k are of a finer one. successive/100: cuts without others before them,
// and the last ten of a hundred, of equal work; `grown` is how many particles more there are than at the start.
// Counters: `triangles` of the mesh, `pieces`, `cap_triangles` of both sides. The process keeps the memory that it once
// had, for all rows: to get it from the system page by page can take as long as the cut. Of the repetitions, the median
// counts.
#include <malloc.h>

#include <cmath>
#include <functional>
#include <memory>
#include <string>

#include <benchmark/benchmark.h>

#include "cut_rows.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/geometry/surgery/incise.h"
#include "meshless_surgery/world/world.h"

namespace meshless::bench {
namespace {

constexpr double kAgreement = 1e-9;  // of the volume
constexpr std::uint32_t kCap = 7;

TriangleMesh ball(double triangles) {
  // An icosahedron's faces in n * n parts each: 20 n^2; `edge` is what gives that n.
  return sphereMesh(0.1, 0.1 * std::sqrt(4.0 * M_PI / triangles * 4.0 / std::sqrt(3.0)));
}

TriangleMesh ring(double triangles) {
  const double area = 4.0 * M_PI * M_PI * 0.1 * 0.04;
  return torusMesh(0.1, 0.04, std::sqrt(2.0 * area / triangles));
}

// Askew, so that no vertex lies on it.
Plane planeThrough(const TriangleMesh& mesh) {
  return {Vec3(0.31, 0.52, 0.79).normalized(), solidCentroid(mesh) + Vec3(0.0011, 0.0007, 0.0013)};
}

void cutRow(benchmark::State& state, const TriangleMesh& mesh, bool interior) {
  const Plane plane = planeThrough(mesh);
  InciseOptions options;
  options.patch = kCap;
  if (!interior) options.max_points = 0;
  std::size_t pieces = 0, cap = 0;
  double volume = 0.0;
  for (auto _ : state) {
    Result<Incision> cut = incise(mesh, Blade::through(plane), options);
    benchmark::DoNotOptimize(cut.ok());
    state.PauseTiming();
    if (!cut) {
      state.SkipWithError(cut.error().detail.c_str());
      return;
    }
    pieces = cut->pieces.size();
    cap = 0;
    volume = 0.0;
    for (const IncisedPiece& piece : cut->pieces) {
      volume += signedVolume(piece.mesh);
      for (const std::uint32_t patch : piece.mesh.patches) cap += patch == kCap;
    }
    cut = Incision();
    state.ResumeTiming();
  }
  const double whole = signedVolume(mesh);
  if (!(std::abs(volume - whole) <= kAgreement * whole)) state.SkipWithError("the volumes do not add up");
  state.counters["triangles"] = static_cast<double>(mesh.triangles.size());
  state.counters["pieces"] = static_cast<double>(pieces);
  state.counters["cap_triangles"] = static_cast<double>(cap);
}

void clipRow(benchmark::State& state, const TriangleMesh& mesh) {
  const Plane plane = planeThrough(mesh);
  CgalClip clip(mesh);
  for (auto _ : state) {
    state.PauseTiming();
    clip.copy();
    state.ResumeTiming();
    if (!clip.run(plane)) {
      state.SkipWithError("CGAL's clip failed");
      return;
    }
  }
  const double whole = signedVolume(mesh);
  if (!(std::abs(clip.volume() - whole) <= kAgreement * whole)) state.SkipWithError("the volumes do not add up");
  state.counters["triangles"] = static_cast<double>(mesh.triangles.size());
  state.counters["pieces"] = 2.0;
  state.counters["cap_triangles"] = static_cast<double>(clip.capTriangles(plane));
}

// From the command until it is answered, or until the pieces have made their first step; the body is put there anew for
// each.
struct Whole {
  const char* name;
  bool elastic;
  ContactMethod contact;
  bool incise;
  double triangles = 1.15e4;
};

Command commandOf(const Whole& whole) {
  const Vec3 on_plane(0.0, 0.01, 0.02), x = Vec3::UnitX(), y(0.0, 0.6, 0.8);
  if (whole.incise) {
    InciseCommand incise;  // down to the middle
    incise.blade.origin = on_plane - 0.2 * x + 0.2 * y;
    incise.blade.x_axis = x;
    incise.blade.y_axis = y;
    incise.blade.length = 0.4;
    incise.blade.depth = 0.2;
    return incise;
  }
  CutCommand cut;
  cut.blades.origin = on_plane - 10.0 * x;
  cut.blades.x_axis = x;
  cut.blades.y_axis = y;
  return cut;
}

void wholeRow(benchmark::State& state, const Whole& whole) {
  BodyDef def;
  def.name = "ball";
  def.mesh = ball(whole.triangles);
  def.spacing = 0.0155;
  if (whole.elastic) def.material.youngs_modulus = 5e3;
  const auto body = std::make_shared<const PreparedBody>(*prepareBody(std::move(def)));
  WorldSettings settings;
  settings.ground.reset();
  settings.contact = whole.contact;
  World world(settings);
  if (!world.addSceneBody(body).ok()) return state.SkipWithError("the body was refused");
  const Command command = commandOf(whole);
  std::size_t pieces = 0;
  double step = 0.0;
  for (auto _ : state) {
    state.PauseTiming();
    world.reset();
    for (int k = 0; k < 3; ++k) world.step();
    step = world.snapshot({}).report.total;
    state.ResumeTiming();
    const Result<Reply> answer = world.apply(command);
    if (!whole.incise) world.step();
    state.PauseTiming();
    if (!answer.ok()) return state.SkipWithError(answer.error().detail.c_str());
    pieces = world.snapshot({}).bodies.size();
    state.ResumeTiming();
  }
  state.counters["triangles"] = static_cast<double>(body->model->surface.triangles.size());
  state.counters["particles"] = static_cast<double>(body->model->rest.size());
  state.counters["pieces"] = static_cast<double>(pieces);
  state.counters["step_before_ms"] = 1e3 * step;
}

// The mean of ten cuts that take slices off a bar's end, after so many others. Without history the bar is as long as
// the other is by then, so that the ten do the same work; the world of the others holds their slices too.
constexpr double kSlice = 0.03;  // [m]
constexpr int kTimedCuts = 10;

std::shared_ptr<const PreparedBody> barOf(int slices) {
  BodyDef def;
  def.name = "bar";
  def.mesh = boxMesh(Vec3(slices * kSlice, 0.03, 0.03), 2 * slices, 2, 2);
  def.spacing = 0.01;
  def.material.youngs_modulus = 5e3;
  return std::make_shared<const PreparedBody>(*prepareBody(std::move(def)));
}

void successiveRow(benchmark::State& state, const std::shared_ptr<const PreparedBody>& body, int slices, int history) {
  WorldSettings settings;
  settings.gravity.setZero();
  settings.ground.reset();
  settings.contact = ContactMethod::kNone;
  World world(settings);
  if (!world.addSceneBody(body).ok()) return state.SkipWithError("the bar was refused");
  const auto cutSlice = [&](int number) {
    CutCommand cut;
    const Vec3 normal = Vec3(1.0, 0.05, 0.03).normalized();
    cut.blades.origin = Vec3(0.5 * slices * kSlice - (number + 1.07) * kSlice, 0.0, 0.0);
    cut.blades.x_axis = normal.unitOrthogonal();
    cut.blades.y_axis = normal.cross(cut.blades.x_axis);
    const Result<Reply> answer = world.apply(cut);
    if (!answer.ok()) state.SkipWithError(answer.error().detail.c_str());
    return answer.ok() ? std::get<CutReply>(*answer) : CutReply();
  };
  CutWork work;
  for (auto _ : state) {
    world.reset();
    for (int k = 0; k < history; ++k) cutSlice(k);
    double seconds = 0.0;
    work = {};
    for (int k = 0; k < kTimedCuts; ++k) {
      const CutReply reply = cutSlice(history + k);
      seconds += reply.duration;
      work += reply.work;
    }
    state.SetIterationTime(seconds / kTimedCuts);
  }
  std::size_t particles = 0;
  for (const BodySnapshot& b : world.snapshot({}).bodies) particles += b.model->rest.size();
  state.counters["bodies"] = static_cast<double>(world.snapshot({}).bodies.size());
  state.counters["grown"] = static_cast<double>(particles) - static_cast<double>(body->model->rest.size());
  state.counters["cap_triangles"] = static_cast<double>(work.new_triangles) / kTimedCuts;
  state.counters["rebuilt"] = static_cast<double>(work.rebuilt_clusters) / kTimedCuts;
}

void registerRows() {
  struct Solid {
    const char* name;
    TriangleMesh (*make)(double);
  };
  struct Size {
    const char* name;
    double triangles;
  };
  // Without contact it is the cut and the step alone; with the textbook contact the pieces get tetrahedra at once.
  for (const Whole& whole : {Whole{"whole/10k", true, ContactMethod::kNone, false},
                             Whole{"whole/10k/looks", false, ContactMethod::kNone, false},
                             Whole{"whole/10k/textbook", true, ContactMethod::kTextbook, false},
                             Whole{"incision/10k", true, ContactMethod::kNone, true},
                             Whole{"whole/60k", true, ContactMethod::kNone, false, 6.5e4},
                             Whole{"incision/60k", true, ContactMethod::kNone, true, 6.5e4}})
    benchmark::RegisterBenchmark(whole.name, [whole](benchmark::State& state) { wholeRow(state, whole); })
        ->Unit(benchmark::kMillisecond)
        ->UseRealTime()
        ->Repetitions(9)
        ->ReportAggregatesOnly();
  for (const auto& [name, history] : {std::pair("successive/100/first_ten", 0), {"successive/100/last_ten", 90}}) {
    const int slices = history + 2 * kTimedCuts;
    const auto bar = barOf(slices);
    benchmark::RegisterBenchmark(
        name, [=, history = history](benchmark::State& state) { successiveRow(state, bar, slices, history); })
        ->Unit(benchmark::kMillisecond)
        ->UseManualTime()
        ->Iterations(5)
        ->Repetitions(9)
        ->ReportAggregatesOnly();
  }
  for (const Solid& solid : {Solid{"sphere", &ball}, Solid{"torus", &ring}}) {
    for (const Size& size : {Size{"5k", 5e3}, Size{"50k", 5e4}, Size{"200k", 2e5}}) {
      const auto mesh = std::make_shared<TriangleMesh>(solid.make(size.triangles));
      const std::string name = std::string(solid.name) + "/" + size.name;
      const auto add = [&](const std::string& row, const std::function<void(benchmark::State&)>& body) {
        benchmark::RegisterBenchmark(row.c_str(), body)
            ->Unit(benchmark::kMillisecond)
            ->Repetitions(9)
            ->ReportAggregatesOnly();
      };
      add(name, [mesh](benchmark::State& state) { cutRow(state, *mesh, true); });
      add(name + "/plain", [mesh](benchmark::State& state) { cutRow(state, *mesh, false); });
      add("cgal_clip/" + name, [mesh](benchmark::State& state) { clipRow(state, *mesh); });
    }
  }
}

}  // namespace
}  // namespace meshless::bench

int main(int argc, char** argv) {
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  meshless::bench::registerRows();
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
