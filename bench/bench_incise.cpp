// Run time of an incision's geometry: half through, into surfaces of about 10,000 triangles.
// <shape>/half opens a fresh surface; <shape>/cross opens one across an incision that it has already; <shape>/full goes
// through. real_time is one incision; `triangles` are those of the surface, `lip_points` the new inner points of the
// wound faces, `area` [m^2] what was opened.
#include <algorithm>
#include <cmath>
#include <string>

#include <benchmark/benchmark.h>

#include "meshless_surgery/geometry/surgery/incise.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/organs.h"
#include "meshless_surgery/geometry/mesh/primitives.h"

namespace meshless {
namespace {

/// From above into the middle of the shape; `turn` [rad] about the vertical.
Blade bladeInto(const TriangleMesh& mesh, double turn, double length, double depth) {
  const Box box = boundsOf(mesh.vertices);
  const Vec3 middle = solidCentroid(mesh), size = box.max - box.min;
  Blade blade;
  blade.x_axis = Vec3(std::cos(turn), std::sin(turn), 0.0);
  blade.y_axis = Vec3::UnitZ();
  blade.length = length * size.maxCoeff();
  blade.depth = (0.05 + depth) * size.z();
  blade.origin = Vec3(middle.x(), middle.y(), box.max.z() + 0.05 * size.z()) - 0.5 * blade.length * blade.x_axis;
  return blade;
}

/// Each triangle in four, as the liver comes with some 4,000.
TriangleMesh refined(const TriangleMesh& mesh) {
  TriangleMesh fine;
  fine.vertices = mesh.vertices;
  struct Edge {
    Index low, high, triangle, corner;
  };
  std::vector<Edge> edges;
  for (Index t = 0; t < mesh.triangles.size(); ++t)
    for (Index k = 0; k < 3; ++k) {
      const Index a = mesh.triangles[t][k], b = mesh.triangles[t][(k + 1) % 3];
      edges.push_back({std::min(a, b), std::max(a, b), t, k});
    }
  std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
    return a.low != b.low ? a.low < b.low : a.high != b.high ? a.high < b.high : a.triangle < b.triangle;
  });
  std::vector<std::array<Index, 3>> middles(mesh.triangles.size());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (i == 0 || edges[i].low != edges[i - 1].low || edges[i].high != edges[i - 1].high)
      fine.vertices.push_back(0.5 * (mesh.vertices[edges[i].low] + mesh.vertices[edges[i].high]));
    middles[edges[i].triangle][edges[i].corner] = static_cast<Index>(fine.vertices.size() - 1);
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& v = mesh.triangles[t];
    const auto& m = middles[t];
    for (int k = 0; k < 3; ++k) fine.triangles.push_back({v[k], m[k], m[(k + 2) % 3]});
    fine.triangles.push_back({m[0], m[1], m[2]});
  }
  return fine;
}

/// A cube of n x n quads a side, blown up.
TriangleMesh cubeSphere(int n) {
  TriangleMesh mesh = boxMesh(Vec3(1.0, 1.0, 1.0), n, n, n);
  for (Vec3& p : mesh.vertices) p = 0.1 * p.normalized();
  return mesh;
}

void runIncision(benchmark::State& state, const TriangleMesh& mesh, const Blade& blade) {
  std::size_t points = 0;
  double area = 0.0;
  for (auto _ : state) {
    const Result<Incision> cut = incise(mesh, blade);
    if (!cut) {
      state.SkipWithError(cut.error().detail.c_str());
      return;
    }
    points = 0;
    for (const IncisedPiece& piece : cut->pieces)
      for (std::size_t v = 0; v < piece.origins.size(); ++v) points += piece.origins.insideCap(v);
    area = cut->opened_area;
    benchmark::DoNotOptimize(cut->pieces.data());
  }
  state.counters["triangles"] = static_cast<double>(mesh.triangles.size());
  state.counters["lip_points"] = static_cast<double>(points);
  state.counters["area"] = area;
}

void addRows(const std::string& name, const TriangleMesh& mesh) {
  const Blade half = bladeInto(mesh, 0.3, 0.7, 0.5), across = bladeInto(mesh, 1.7, 0.7, 0.4),
              full = bladeInto(mesh, 0.3, 3.0, 3.0);
  const auto row = [](const std::string& label, const TriangleMesh& m, const Blade& blade) {
    benchmark::RegisterBenchmark(label.c_str(), [m, blade](benchmark::State& state) {
      runIncision(state, m, blade);
    })->Unit(benchmark::kMillisecond);
  };
  row(name + "/half", mesh, half);
  const Result<Incision> opened = incise(mesh, half);
  if (opened) row(name + "/cross", opened->pieces[0].mesh, across);
  row(name + "/full", mesh, full);
}

}  // namespace
}  // namespace meshless

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  meshless::addRows("sphere/5k", meshless::sphereMesh(0.1, 0.007));
  meshless::addRows("sphere/10k", meshless::cubeSphere(29));
  meshless::addRows("sphere/20k", meshless::sphereMesh(0.1, 0.0035));
  meshless::addRows("liver", meshless::liverMesh());
  meshless::addRows("liver_fine", meshless::refined(meshless::liverMesh()));
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
