// From the closed surface of one side of the plane to its connected pieces. Private to geometry's cut_*.cpp.
#pragma once

#include <string>

#include "cut_cap.h"
#include "cut_parts.h"

namespace meshless {
namespace cutting {

/// A connected surface.
struct Shell {
  CutPiece piece;
  double volume = 0.0;        // [m^3] signed
  bool flat = false;          // every vertex lies on the plane
  std::size_t untouched = 0;  // so many of its first triangles are the mesh's own
};

/// Pairs triangles at their edges, splits the vertices on the plane by umbrella and takes the surface apart where it
/// does not hang together; both sides. `merged`: for each vertex on the plane the one that it counts as while pairing
/// (vertices of the rim that coincide count as one); which position an umbrella gets is its lowest vertex's own. Where
/// a shell would have an edge between the same two vertices twice, one of the two gets a vertex inside. Off the plane
/// the surface is taken as it is: what shares a vertex there stays together, and an open edge there goes unnoticed.
/// Fails with kUnsuitableShape where an edge at the plane is open. The core's points are the work's vertices from
/// first_inner on.
Result<std::vector<Shell>> shellsOf(Workpiece& work, const CapCore& core, const std::vector<Index>& merged,
                                    std::uint32_t cap_patch);

/// Puts cavities into the solids that hold them; what is left are pieces, largest first.
std::vector<CutPiece> piecesOf(const Workpiece& work, std::vector<Shell> shells);

}  // namespace cutting
}  // namespace meshless
