// What contact knows of a model: the topology of its surface and which particles carry each vertex. Made once.
#pragma once

#include "meshless_surgery/contact/box_tree.h"
#include "meshless_surgery/geometry/triangle_mesh.h"

namespace meshless {

/// Vertex v is at the sum of weights[k] x[particles[k]], k = offsets[v] .. offsets[v + 1] - 1, but for what does not
/// change within a frame. Weights of a vertex add up to 1.
struct VertexSupports {
  std::vector<Index> offsets, particles;
  std::vector<double> weights;

  Vec3 sum(Index v, const Vec3* values) const {
    Vec3 sum = Vec3::Zero();
    for (Index k = offsets[v]; k < offsets[v + 1]; ++k) sum += weights[k] * values[particles[k]];
    return sum;
  }
};
/// Every vertex is the particle of the same number.
VertexSupports ownSupports(Index vertices);

struct ContactEdge {
  std::array<Index, 2> vertices{};
  std::array<Index, 2> faces{};  // the second is kNoIndex at a border
  double length = 0.0;           // [m] at rest
};

struct ContactSurface {
  ContactSurface(const TriangleMesh& mesh, VertexSupports vertex_supports);

  Points rest;  // [m] vertices
  std::vector<Triangle> triangles;
  std::vector<ContactEdge> edges;
  std::vector<Index> face_offsets, faces;     // around each vertex, compressed rows
  std::vector<char> cut_faces, cut_vertices;  // 1: of a patch that a cut has made
  VertexSupports supports;
  BoxTree tree;  // over faces
  bool closed = true;
  double edge_length = 0.0;  // [m] mean

  Index vertices() const { return static_cast<Index>(face_offsets.size() - 1); }
  std::size_t bytes() const;
};

}  // namespace meshless
