// Run time of a cut into two sealed halves, and of CGAL's clip of both sides with caps in the same process.
// sphere/50k is a ball of some 50,000 triangles cut through its middle, with points inside the cap; sphere/50k/plain
// without; cgal_clip/sphere/50k is CGAL's, without copying the mesh for it. A row fails where the volumes do not add
// up. Counters: `triangles` of the mesh, `pieces`, `cap_triangles` of both sides. The process keeps the memory that it
// once had, for all rows: to get it from the system page by page can take as long as the cut. Of the repetitions, the
// median counts.
#include <malloc.h>

#include <cmath>
#include <functional>
#include <memory>
#include <string>

#include <benchmark/benchmark.h>

#include "cut_rows.h"
#include "meshless_surgery/geometry/cut.h"
#include "meshless_surgery/geometry/measures.h"
#include "meshless_surgery/geometry/primitives.h"
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
  CutOptions options;
  options.cap_patch = kCap;
  options.cap_points = interior ? kUsualCapPoints : 0;
  std::size_t pieces = 0, cap = 0;
  double volume = 0.0;
  for (auto _ : state) {
    Result<CutSurface> cut = cutByPlane(mesh, plane, options);
    benchmark::DoNotOptimize(cut.ok());
    state.PauseTiming();
    if (!cut) {
      state.SkipWithError(cut.error().detail.c_str());
      return;
    }
    pieces = cut->pieces.size();
    cap = 0;
    volume = 0.0;
    for (const CutPiece& piece : cut->pieces) {
      volume += signedVolume(piece.mesh);
      for (const std::uint32_t patch : piece.mesh.patches) cap += patch == kCap;
    }
    cut = CutSurface();
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

// From the command until the pieces have made their first step; the body is put there anew for each.
void wholeRow(benchmark::State& state, bool elastic, ContactMethod contact) {
  BodyDef def;
  def.name = "ball";
  def.mesh = ball(1.15e4);
  def.spacing = 0.0155;
  if (elastic) def.material.youngs_modulus = 5e3;
  const auto body = std::make_shared<const PreparedBody>(*prepareBody(std::move(def)));
  WorldSettings settings;
  settings.ground.reset();
  settings.contact = contact;
  World world(settings);
  if (!world.addSceneBody(body).ok()) return state.SkipWithError("the body was refused");
  CutCommand cut;
  cut.blades.origin = Vec3(-10.0, 0.01, 0.02);
  cut.blades.x_axis = Vec3::UnitX();
  cut.blades.y_axis = Vec3(0.0, 0.6, 0.8);
  CutReply reply;
  double step = 0.0;
  for (auto _ : state) {
    state.PauseTiming();
    world.reset();
    for (int k = 0; k < 3; ++k) world.step();
    step = world.snapshot({}).report.total;
    state.ResumeTiming();
    const Result<Reply> answer = world.apply(cut);
    world.step();
    state.PauseTiming();
    if (!answer.ok()) return state.SkipWithError(answer.error().detail.c_str());
    reply = std::get<CutReply>(*answer);
    state.ResumeTiming();
  }
  state.counters["triangles"] = static_cast<double>(body->model->surface.triangles.size());
  state.counters["particles"] = static_cast<double>(body->model->rest.size());
  state.counters["pieces"] = static_cast<double>(reply.new_bodies.size());
  state.counters["step_before_ms"] = 1e3 * step;
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
  struct Whole {
    const char* name;
    bool elastic;
    ContactMethod contact;
  };
  // Without contact it is the cut and the step alone; with the textbook contact the pieces get tetrahedra at once.
  for (const Whole& whole :
       {Whole{"whole/10k", true, ContactMethod::kNone}, Whole{"whole/10k/looks", false, ContactMethod::kNone},
        Whole{"whole/10k/textbook", true, ContactMethod::kTextbook}})
    benchmark::RegisterBenchmark(whole.name,
                                 [whole](benchmark::State& state) { wholeRow(state, whole.elastic, whole.contact); })
        ->Unit(benchmark::kMillisecond)
        ->UseRealTime()
        ->Repetitions(9)
        ->ReportAggregatesOnly();
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
