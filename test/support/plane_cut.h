// A plane through a solid, as what the tests of cuts ask for: pieces with their sides.
#pragma once

#include <cmath>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/surgery/incise.h"

namespace meshless {

/// One connected piece of the solid, on one side of the plane.
struct CutPiece {
  TriangleMesh mesh;
  VertexOrigins origins;
  std::vector<Index> cap_interior;  // its vertices inside the cap; without parents
  int side = 0;                     // +1: where the normal points; -1: the other
};

struct CutSurface {
  std::vector<CutPiece> pieces;  // largest volume first; at least two
  double cap_area = 0.0;         // [m^2] of one side
};

struct CutOptions {
  double band = 1e-7;
  std::uint32_t cap_patch = 1;
  std::size_t cap_points = 0;
  double roughness = 0.0;
  std::uint32_t seed = 0;
  const Points* rest = nullptr;
  double apart = 0.0;
};

constexpr std::size_t kUsualCapPoints = 4000;

inline Result<CutSurface> cutByPlane(const TriangleMesh& mesh, const Plane& plane, const CutOptions& asked = {}) {
  InciseOptions options;
  options.band = asked.band;
  options.patch = asked.cap_patch;
  options.max_points = asked.cap_points;
  options.roughness = asked.roughness;
  options.seed = asked.seed;
  options.rest = asked.rest;
  options.apart = asked.apart;
  Result<Incision> incision = incise(mesh, Blade::through(plane), options);
  if (!incision) return incision.error();
  CutSurface cut;
  cut.cap_area = incision->opened_area;
  for (IncisedPiece& from : incision->pieces) {
    CutPiece piece{std::move(from.mesh), std::move(from.origins), {}, 0};
    double farthest = 0.0;
    for (Index v = 0; v < piece.mesh.vertices.size(); ++v) {
      if (piece.origins.insideCap(v)) {
        piece.cap_interior.push_back(v);
        continue;
      }
      const double height = plane.height(piece.mesh.vertices[v]);
      if (!(std::abs(height) > std::abs(farthest))) continue;
      farthest = height;
      piece.side = height > 0.0 ? 1 : -1;
    }
    cut.pieces.push_back(std::move(piece));
  }
  return cut;
}

}  // namespace meshless
