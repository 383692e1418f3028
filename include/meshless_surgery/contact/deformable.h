// What the contact methods see of a body: no more than this, so that they know neither materials nor tools.
#pragma once

#include "meshless_surgery/base/types.h"

namespace meshless {

/// Tetrahedra between a body's particles, with what contact derives from them once.
struct ContactMesh {
  std::vector<Tetrahedron> tetrahedra;      // particle indices, positively oriented at rest
  std::vector<Triangle> faces;              // of the boundary, counter-clockwise from outside
  std::vector<std::array<Index, 2>> edges;  // of the tetrahedra, lower index first, sorted
};

/// Views; whoever fills it keeps the arrays alive.
struct ContactBody {
  const ContactMesh* mesh = nullptr;
  const Points* positions = nullptr;  // [m]
  Box bounds;                         // of positions
};

/// Work counted, so that tests can hold what a scene does not need at zero.
struct ContactCounters {
  std::size_t pairs = 0;          // pairs of bodies with overlapping bounds
  std::size_t tested = 0;         // particle-in-tetrahedron tests
  std::size_t penetrating = 0;    // particles found inside
  std::size_t corrected = 0;      // contacts that moved something
  std::size_t bounds_tested = 0;  // boxes compared by the broad phase
  std::size_t queries = 0;        // of the narrow phase: points near surfaces
  std::size_t contacts = 0;       // made
  std::size_t self_points = 0;    // queried for contact of a body with itself
};

}  // namespace meshless
