// What contact knows of a model, made once: the topology of its surface and which particles carry each vertex; and of a
// surface in a frame.
#pragma once

#include "meshless_surgery/contact/box_tree.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

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
  std::vector<ContactEdge> edges;             // the longest first
  std::vector<Index> face_offsets, faces;     // around each vertex, compressed rows
  std::vector<char> cut_faces, cut_vertices;  // 1: of a patch that a cut has made
  VertexSupports supports;
  BoxTree tree, vertex_tree;  // tree: over faces
  bool closed = true;
  double edge_length = 0.0;  // [m] mean

  Index vertices() const { return static_cast<Index>(face_offsets.size() - 1); }
  std::size_t bytes() const;
};

/// Where a surface is at the start of a frame, how it moves, and the boxes of what it sweeps.
struct SurfaceFrame {
  Points vertices;                    // [m]
  Points velocities;                  // [m/s] of the vertices
  Points face_normals;                // unit; zero where a face has no area
  Points vertex_normals;              // unit, of the areas around; zero without
  TreeBoxes points, faces;            // swept by their velocities in the frame; points: vertices
  TreeBoxes point_turns, face_turns;  // boxes of their normals; see placeNormalBoxes()
  Box bounds;                         // swept

  std::size_t bytes() const {
    return bytesOf(vertices, velocities, face_normals, vertex_normals) + points.bytes() + faces.bytes() +
           point_turns.bytes() + face_turns.bytes();
  }
};

/// Whether faces are convex about an edge by more than kRidgeCosine, or it is a border.
bool isRidge(const ContactSurface& surface, const SurfaceFrame& frame, const ContactEdge& edge);

/// vertices [m], velocities [m/s; null: it does not move]: one a vertex. h [s]: of the frame.
void placeFrame(const ContactSurface& surface, const Vec3* vertices, const Vec3* velocities, double h,
                SurfaceFrame& frame);

/// For a search of a surface in itself: what faces the same way everywhere cannot meet (Volino and Magnenat-Thalmann
/// 1994).
void placeNormalBoxes(const ContactSurface& surface, SurfaceFrame& frame);

}  // namespace meshless
