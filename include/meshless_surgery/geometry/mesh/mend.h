// Dirty surfaces made into what a body needs: how far that goes is the user's choice.
#pragma once

#include <string>
#include <vector>

#include "meshless_surgery/geometry/mesh/mesh_check.h"

namespace meshless {

enum class MeshRepair { kNone, kMend, kWrap };

/// What repairMesh gives, where that is closed; notes say what was done, and how the volume changed where it did. All
/// refuse what repairMesh refuses, but for the surface that is not manifold.
///
/// kNone: vertices at one place become one and triangles are turned to one side, as an STL file needs it; a surface
/// that is not closed and manifold is refused. kMend: holes are filled whose patches have less than a quarter of their
/// component's area; then the triangles are cut along each other, and what they bound together is the solid
/// (uniteParts). What bounds nothing is dropped where it has less than a quarter of all area. What is open then is a
/// shell, as with repairMesh; what is not manifold then is refused. kWrap: of a surface that crosses itself, too, holes
/// are filled as by kMend, and another surface is wrapped around all of it (Portaneri et al. 2022): closed and free of
/// crossings, a twentieth of its edge length outside, concave edges rounded.
Result<RepairedMesh> repairMesh(const TriangleMesh& mesh, MeshRepair how);

/// For messages and files: none, mend, wrap.
const std::vector<std::string>& meshRepairNames();

}  // namespace meshless
