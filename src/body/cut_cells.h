// Pieces of a body of filled cells (BodyModel::lattice): a blade makes copies of the cells that it parts.
#pragma once

#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/geometry/query/blade.h"
#include "met_body.h"

namespace meshless {

/// Of a cell: what a sample stands for, and what tissue gets that none sees.
constexpr double kCrumb = 1.0 / 64.0;
/// [spacing] A blade that close to a wound that runs along it goes into it.
constexpr double kFollow = 0.05;

/// The sources are what the blade made of `met`. Surfaces and tissue that hang together are one piece: cells that links
/// join, and cells that a source's vertices follow. So what no sample parts stays one, and what less than a sample joins
/// too. One piece for each such part, largest volume first. A source that no tissue is in gets cells of its own, copies
/// of those that its vertices followed, with a share of what they weigh.
///
/// Particles of the parent go on in one piece each, where their tissue is, and come first, in their order; copies
/// follow (BodyPiece::parent_particles has kNoIndex for them). Positions and velocities of copies are those of what
/// they are copies of, and masses add up corner by corner: mass and momentum stay. Refuses (kUnsuitableShape) where a
/// point that the blade made lies in none of the cells.
///
/// collision: what the same blade made of the body's surface for contact, in any order. Each goes where its first
/// vertex is. A piece that gets none, or one that is not all in its cells, meets others by what is seen.
///
/// places: each goes on in the copy of its cell with the nearest tissue that the blade does not part it from; where
/// there is none, in the nearest cell with such tissue.
Result<std::vector<BodyPiece>> cutCells(const BodyModel& model, const BodyState& state, const MetBody& met,
                                        const Blade& blade, std::vector<IncisedPiece> sources,
                                        std::vector<IncisedPiece> collision, const std::vector<TissuePlace>& places,
                                        std::uint32_t new_patch, CutWork& work);

}  // namespace meshless
