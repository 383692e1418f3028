// A blade through a body, or into it: a new model and state for each piece.
#pragma once

#include <optional>

#include "meshless_surgery/body/body.h"
#include "meshless_surgery/body/tissue_place.h"
#include "meshless_surgery/geometry/surgery/incise.h"

namespace meshless {

struct BodyPiece {
  BodyModelPtr model;
  BodyState state;
  std::vector<Index> parent_particles;  // one a particle of the piece: its index in the parent, or kNoIndex if new
  // Of a body of cells:
  std::vector<Index> copied_from;   // one a particle of the piece: the parent's of which it is a copy, or that it is
  std::vector<TissuePlace> places;  // one a place that was asked for: where it is now; nowhere if in another piece
};

/// What a blade had to make of a body, over all pieces: its work, in counts that no clock blurs.
struct CutWork {
  std::size_t new_vertices = 0;      // of the surface
  std::size_t new_triangles = 0;     // of caps or wound faces
  std::size_t bound_embedded = 0;    // embedded vertices whose carriers were searched for
  std::size_t kept_embedded = 0;     // embedded vertices that kept theirs
  std::size_t kept_clusters = 0;     // taken over unchanged
  std::size_t rebuilt_clusters = 0;  // grown again

  CutWork& operator+=(const CutWork& other);
};

struct CutBody {
  /// One where the body holds together: its particles are the parent's, in their order. Else largest volume first. What
  /// a surface or tissue joins is one piece (cut_cells.h). What is less than a sample of a cell comes apart from no
  /// piece by a blade with bounds: it stays with the largest.
  std::vector<BodyPiece> pieces;
  double opened_area = 0.0;  // [m^2] of one wound face, as the blade met it: now, or at rest
  CutWork work;
};

struct CutBodyOptions {
  double roughness = 0.0;           // [m] amplitude of the fractal displacement of the wound faces; 0: clean
  std::uint32_t seed = 0;           // of it
  std::vector<TissuePlace> places;  // to be followed
  bool at_rest = false;             // the blade is in the frame of the rest shape, and meets that
};

/// The blade is in the world frame and meets the present shape. Links between samples that pass through it are cut.
/// Rest positions, positions and velocities of new vertices are interpolated with the same weights; vertices of a wound
/// face follow only tissue on its side. Mass and momentum are kept. Refuses as incise() does, and a body that is no
/// solid. state.surface must be up to date.
Result<CutBody> cutBody(const BodyModel& model, const BodyState& state, const Blade& blade,
                        const CutBodyOptions& options = {});

/// Where a blade is at rest that meets the present shape: by the affine map that fits the tissue around it best. None
/// where too little is around it.
std::optional<Blade> bladeAtRest(const BodyModel& model, const BodyState& state, const Blade& blade);

}  // namespace meshless
