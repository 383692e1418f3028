// Pieces of a body of filled cells (BodyModel::lattice): a blade makes copies of the cells that it parts.
#pragma once

#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/geometry/blade_gate.h"

namespace meshless {

/// [spacing] What is farther apart at rest and meets now are different parts of tissue that lies in itself: edges are
/// shorter.
constexpr double kOneTissue = 4.0;

struct CellPieceSource {
  const TriangleMesh& mesh;      // present shape; patches filled
  const VertexOrigins& origins;  // of its vertices
  std::vector<int> side;         // one a vertex: of the blade, +1 or -1; 0 where both sides have it (a buried front)
};

/// One piece a source, in their order. Particles of the parent go on in one piece each, where their tissue is, and come
/// first, in their order; copies follow (BodyPiece::parent_particles has kNoIndex for them). Positions and velocities
/// of copies are those of what they are copies of, and masses add up corner by corner: mass and momentum stay. Refuses
/// (kUnsuitableShape) where a point that the blade made lies in none of the cells.
Result<std::vector<BodyPiece>> cutCells(const BodyModel& model, const BodyState& state, const BladeGate& gate,
                                        const std::vector<CellPieceSource>& sources, std::uint32_t new_patch,
                                        CutWork& work);

}  // namespace meshless
