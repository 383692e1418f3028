// The fuzzer of cuts and incisions; see targets.h.
#pragma once

#include "fuzz/demand.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/plane_cut.h"
#include "support/shapes.h"

namespace meshless::fuzz {

/// The first byte chooses a shape. Then thirteen bytes a cut: what it is, and six numbers of its plane or blade.
inline void cutPlane(const std::uint8_t* data, std::size_t size) {
  static const std::vector<shapes::Shape> all = shapes::simpleShapes();
  if (size < 1) return;
  TriangleMesh mesh = all[data[0] % all.size()].mesh;
  for (std::size_t at = 1, cuts = 0; at + 13 <= size && cuts < 8; at += 13, ++cuts) {
    double number[6];
    for (int k = 0; k < 6; ++k)
      number[k] = static_cast<std::int16_t>(data[at + 1 + 2 * k] | data[at + 2 + 2 * k] << 8) / 32768.0;
    Vec3 normal(number[0], number[1], number[2]);
    // Few bits: planes along axes, through vertices, almost in faces.
    if (data[at] & 1)
      for (int k = 0; k < 3; ++k) normal[k] = std::round(normal[k]);
    if (!(normal.norm() > 1e-9)) continue;
    normal.normalize();
    const double volume = signedVolume(mesh);
    Vec3 point = 0.12 * Vec3(number[3], number[4], number[5]);
    if (data[at] & 2) point = mesh.vertices[static_cast<std::size_t>(data[at + 7]) % mesh.vertices.size()];
    std::vector<TriangleMesh> pieces;
    if (data[at] & 4) {
      Blade blade;
      blade.y_axis = normal;
      blade.x_axis = normal.unitOrthogonal();
      blade.origin = point;
      blade.length = 0.02 + 0.3 * std::abs(number[4]);
      blade.depth = 0.01 + 0.2 * std::abs(number[5]);
      Result<Incision> opened = incise(mesh, blade);
      if (!opened) {
        demand(!opened.error().detail.empty(), "a refusal says why");
        continue;
      }
      for (IncisedPiece& piece : opened->pieces) pieces.push_back(std::move(piece.mesh));
    } else {
      CutOptions options;
      Result<CutSurface> cut = cutByPlane(mesh, {normal, point}, options);
      if (!cut) {
        demand(!cut.error().detail.empty(), "a refusal says why");
        continue;
      }
      for (CutPiece& piece : cut->pieces) pieces.push_back(std::move(piece.mesh));
    }
    double sum = 0.0;
    for (const TriangleMesh& piece : pieces) {
      for (const Vec3& p : piece.vertices) demand(p.allFinite(), "a piece is finite");
      sum += signedVolume(piece);
    }
    demand(std::abs(sum - volume) <= 1e-8 * std::pow(boundsOf(mesh.vertices).diagonal(), 3.0), "volumes add up");
    mesh = std::move(pieces[data[at] % pieces.size()]);
    if (mesh.triangles.size() > 5000) return;
  }
}

}  // namespace meshless::fuzz
