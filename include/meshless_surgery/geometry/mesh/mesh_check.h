// What is wrong with a surface, and what can be mended.
#pragma once

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

struct MeshReport {
  std::size_t non_finite_vertices = 0;
  std::size_t bad_indices = 0;           // triangles that name a vertex that is not there
  std::size_t degenerate_triangles = 0;  // two equal corners, or zero area
  std::size_t duplicate_triangles = 0;
  std::size_t boundary_edges = 0;      // used by one triangle
  std::size_t non_manifold_edges = 0;  // used by more than two, or by two that cannot be turned to the same side
  std::size_t components = 0;          // joined by edges
  std::size_t self_intersections = 0;  // pairs of triangles that meet elsewhere than in a shared edge or corner
  double signed_volume = 0.0;          // [m^3] of the triangles as they are turned now

  bool closed() const { return boundary_edges == 0 && non_manifold_edges == 0; }
};

/// Looks only, and merges nothing: the triangles of an STL file all stand alone. Triangles that are not finite, have
/// bad indices or two equal corners are counted as such and left out of the rest. Self-intersections are searched for
/// if check_intersections is set, exactly, in about 15 ms for 4,000 triangles.
MeshReport inspectMesh(const TriangleMesh& mesh, bool check_intersections = true);

/// A surface made fit for use, with a sentence for each thing that was done or noticed.
struct RepairedMesh {
  TriangleMesh mesh;
  bool solid = true;               // closed and oriented: can be filled, cut, given a volume
  bool self_intersecting = false;  // loaded all the same
  std::size_t open_edges = 0;      // with a triangle on one side only
  std::size_t components = 0;      // joined by edges
  std::vector<std::string> notes;
  std::vector<std::string> warnings;  // of what is most often not meant
};

/// Merges vertices nearer to each other than 1e-9 of the bounds' diagonal (STL has no shared ones), drops degenerate
/// and duplicate triangles and unused vertices, doubles vertices where the surface only touches itself in a point,
/// turns triangles to one side, closes small holes (the sum of a hole's rim below 25 % of the bounding box's diagonal)
/// and orients each closed component outwards (inside an odd number of others it is a cavity and points inwards).
/// Patches of the input are not kept.
/// Refuses with kUnsuitableShape and a message of its own each: empty, non-finite, indices out of range, no triangle
/// with an area, non-manifold, one-sided.
/// A surface that stays open is not refused: solid is false and a note says how many edges are open. One that crosses
/// itself is not refused either: self_intersecting is set and a note gives the number of crossing pairs.
struct RepairRules {
  bool merge_vertices = true;
  bool close_holes = true;
  bool turn_outwards = true;  // false: components stay turned as they are, and crossings are not looked for
};
Result<RepairedMesh> repairMesh(const TriangleMesh& mesh, const RepairRules& rules = {});

/// Its triangles' corners at the first of the vertices that are at one place, as repairMesh merges them. Vertices are
/// finite, and those that triangles name are there.
TriangleMesh withMergedVertices(const TriangleMesh& mesh);

}  // namespace meshless
