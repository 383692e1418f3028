// Severing a body along a plane: a new model and state for each piece.
#pragma once

#include "meshless_surgery/body/body.h"
#include "meshless_surgery/geometry/cut.h"

namespace meshless {

struct BodyPiece {
  BodyModelPtr model;
  BodyState state;
  std::vector<Index> parent_particles;  // one a particle of the piece: its index in the parent, or kNoIndex if new
};

struct CutBody {
  std::vector<BodyPiece> pieces;  // largest volume first, at least two
  double cap_area = 0.0;          // [m^2] of one side, present shape
  Index kept_clusters = 0;
  Index rebuilt_clusters = 0;
};

struct CutBodyOptions {
  double roughness = 0.0;  // [m] amplitude of the fractal displacement of the cut; 0: clean
  std::uint32_t seed = 0;  // of it
};

/// The plane is in the world frame and meets the present shape. Rest positions, positions and velocities of new
/// vertices are interpolated with the same weights; mass and momentum are kept. Refuses kMissed, or kUnsuitableShape
/// where the body is no solid or no closed pieces can be made. state.surface must be up to date.
Result<CutBody> cutBody(const BodyModel& model, const BodyState& state, const Plane& plane,
                        const CutBodyOptions& options = {});

}  // namespace meshless
