// What the contact methods see of a body: no more than this, so that they know neither materials nor tools.
#pragma once

#include "meshless_surgery/base/types.h"

namespace meshless {

/// Tetrahedra between a body's particles, with what contact derives from them once.
struct ContactMesh {
  std::vector<Tetrahedron> tetrahedra;        // particle indices, positively oriented at rest
  std::vector<Triangle> faces;                // of the boundary, counter-clockwise from outside
  std::vector<std::array<Index, 2>> edges;    // of the tetrahedra, lower index first, sorted
};

/// Views; whoever fills it keeps the arrays alive. positions are read and corrected.
struct ContactBody {
  const ContactMesh* mesh = nullptr;
  Points* positions = nullptr;                        // [m]
  const Points* previous = nullptr;                   // [m] at the start of the substep, for friction
  const std::vector<double>* inverse_masses = nullptr;  // [1/kg]; 0: held
  double friction = 0.5;
  Box bounds;  // of positions, swept over the substep
};

struct ContactCounters {
  std::size_t pairs = 0;        // pairs of bodies with overlapping bounds
  std::size_t hashed = 0;       // particles put into the spatial hash
  std::size_t tested = 0;       // particle-in-tetrahedron tests
  std::size_t penetrating = 0;  // particles found inside
  std::size_t corrected = 0;    // contacts that moved something
};

}  // namespace meshless
