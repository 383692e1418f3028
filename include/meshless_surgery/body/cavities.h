// Cavities of a solid body, closed surfaces within it that are oriented inwards, and what fills them: a pressure, or a
// volume that gives way by its compliance. It acts on the walls as p times the gradient of the enclosed volume, taken
// to the particles by the transposed embedding of the walls. So it moves and turns no body as a whole.
#pragma once

#include "meshless_surgery/body/deform.h"

namespace meshless {

/// Triangles of each cavity of a closed surface, in the order of their first.
std::vector<std::vector<Index>> cavitiesOf(const TriangleMesh& mesh);

/// Gives the faces of the cavities of a solid patches of their own, kCavityPatch and up. Returns their volumes [m^3].
std::vector<double> markCavities(TriangleMesh& mesh);
/// The same of what contact takes for that surface; false, and nothing is marked, where it has other cavities.
bool markCavities(const TriangleMesh& visual, TriangleMesh& collision);

/// model.cavities, from the patches of its surfaces and their binding; null where there are none.
void makeCavities(BodyModel& model);

/// Of a filled cavity; null where the model has none of that patch.
const Cavities::Shell* shellOf(const BodyModel& model, std::uint32_t patch);

/// What fills the cavities of a model at rest. Refuses (kInvalidArgument) a volume that is less than a tenth of what
/// they hold at rest, or more than ten times that.
Result<std::vector<FilledCavity>> filledCavities(const BodyModel& model, const CavityFill& fill);

/// Of a piece of a body with its particles at `positions` [m]. What the blade has opened leaks from now on.
std::vector<FilledCavity> inheritedCavities(const std::vector<FilledCavity>& parent, const BodyModel& piece,
                                            const Points& positions);

/// The part of matchAndMove() for filled cavities: moves particles from where they are without it. The walls at the
/// start of the substep, scratch.previous, say which way, so that angular momentum stays to the bit. A volume with
/// compliance is solved with the way that the walls go by themselves (one constraint, implicit): stable at any h. A
/// pressure that is held widens no cavity to more than ten times its volume at rest, and an open one no more than it
/// was. factor: of stiffnessFactor().
void pressCavities(const BodyModel& model, double factor, double h, BodyState& state, StepScratch& scratch);

/// Of all shells, those that have leaked out too, which have no pressure. Volumes at `positions` [m] of the particles.
std::vector<BodyMeasures::Cavity> measureCavities(const BodyModel& model, const std::vector<FilledCavity>& filled,
                                                  const Points& positions);

}  // namespace meshless
