#include "meshless_surgery/contact/contact_surface.h"

#include <algorithm>
#include <cmath>

namespace meshless {
namespace {

struct HalfEdge {
  std::array<Index, 2> ends;  // ascending
  Index face;

  bool operator<(const HalfEdge& o) const { return ends != o.ends ? ends < o.ends : face < o.face; }
};

std::vector<HalfEdge> halfEdgesOf(const std::vector<Triangle>& triangles) {
  std::vector<HalfEdge> half;
  half.reserve(3 * triangles.size());
  for (Index f = 0; f < triangles.size(); ++f)
    for (int k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax(triangles[f][k], triangles[f][(k + 1) % 3]);
      half.push_back({{a, b}, f});
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
  for (Index v = 0; v < count; ++v) {
    double sum = 0.0;
    for (Index k = supports.offsets[v]; k < supports.offsets[v + 1]; ++k) sum += std::abs(supports.weights[k]);
    supports.most_weight = std::max(supports.most_weight, sum);
  }
  for (const HalfEdge& half : halfEdgesOf(triangles)) {
    if (edges.empty() || edges.back().vertices != half.ends) {
      const double length = (rest[half.ends[0]] - rest[half.ends[1]]).norm();
      edges.push_back({half.ends, {half.face, kNoIndex}, length});
      edge_length += length;
    } else if (edges.back().faces[1] == kNoIndex) {
      edges.back().faces[1] = half.face;
    }
  }
  if (!edges.empty()) edge_length /= static_cast<double>(edges.size());
  for (const ContactEdge& edge : edges) closed = closed && edge.faces[1] != kNoIndex;

  face_offsets.assign(count + 1, 0);
  for (const Triangle& t : triangles)
    for (Index v : t) ++face_offsets[v + 1];
  for (Index v = 0; v < count; ++v) face_offsets[v + 1] += face_offsets[v];
  faces.resize(face_offsets[count]);
  std::vector<Index> next(face_offsets.begin(), face_offsets.end() - 1);
  for (Index f = 0; f < triangles.size(); ++f)
    for (Index v : triangles[f]) faces[next[v]++] = f;

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
