#include "meshless_surgery/contact/contact_surface.h"

#include <algorithm>

#include "meshless_surgery/base/compressed_rows.h"

namespace meshless {
namespace {

/// The ends of each face's edges, ascending, and the face; sorted.
std::vector<std::array<Index, 3>> halfEdgesOf(const std::vector<Triangle>& triangles) {
  std::vector<std::array<Index, 3>> half;
  half.reserve(3 * triangles.size());
  for (Index f = 0; f < triangles.size(); ++f)
    for (int k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax(triangles[f][k], triangles[f][(k + 1) % 3]);
      half.push_back({a, b, f});
    }
  std::sort(half.begin(), half.end());
  return half;
}

}  // namespace

VertexSupports ownSupports(Index vertices) {
  VertexSupports supports;
  for (Index v = 0; v <= vertices; ++v) supports.offsets.push_back(v);
  for (Index v = 0; v < vertices; ++v) supports.particles.push_back(v);
  supports.weights.assign(vertices, 1.0);
  return supports;
}

ContactSurface::ContactSurface(const TriangleMesh& mesh, VertexSupports vertex_supports)
    : rest(mesh.vertices), triangles(mesh.triangles), supports(std::move(vertex_supports)) {
  const Index count = static_cast<Index>(supports.offsets.size() - 1);
  for (const auto& [a, b, face] : halfEdgesOf(triangles)) {
    if (edges.empty() || edges.back().vertices != std::array<Index, 2>{a, b}) {
      const double length = (rest[a] - rest[b]).norm();
      edges.push_back({{a, b}, {face, kNoIndex}, length});
      edge_length += length;
    } else if (edges.back().faces[1] == kNoIndex) {
      edges.back().faces[1] = face;
    }
  }
  if (!edges.empty()) edge_length /= static_cast<double>(edges.size());
  for (const ContactEdge& edge : edges) closed = closed && edge.faces[1] != kNoIndex;

  const auto each = [this](const auto& visit) {
    for (Index f = 0; f < triangles.size(); ++f)
      for (const Index v : triangles[f]) visit(v, f);
  };
  compressRows(count, each, face_offsets, faces);

  cut_faces.resize(triangles.size());
  cut_vertices.assign(count, 0);
  Points centres;
  for (Index f = 0; f < triangles.size(); ++f) {
    const Triangle& t = triangles[f];
    cut_faces[f] = mesh.patchOf(f) != kOuterPatch;
    if (cut_faces[f])
      for (Index v : t) cut_vertices[v] = 1;
    centres.push_back((rest[t[0]] + rest[t[1]] + rest[t[2]]) / 3.0);
  }
  tree = BoxTree(centres);
}

std::size_t ContactSurface::bytes() const {
  return sizeof *this +
         bytesOf(rest, triangles, edges, face_offsets, faces, cut_faces, cut_vertices, supports.offsets,
                 supports.particles, supports.weights) +
         tree.bytes();
}

}  // namespace meshless
