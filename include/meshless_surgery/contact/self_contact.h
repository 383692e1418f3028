// Where a body can meet itself: folded over, or the wound faces of an incision against each other.
#pragma once

#include "meshless_surgery/contact/contact_shape.h"

namespace meshless {

/// Of a shape: vertices and faces that may touch each other.
struct SelfContactSet {
  std::vector<Index> vertices;   // of its surface, ascending
  std::vector<Index> triangles;  // of its surface
  double depth = 0.0;            // [m] how far behind a face a point still counts as behind it
  /// Edges at which the surface turns outwards at rest, and rims of cuts, with the faces beside them (the second is
  /// kNoIndex where it is not one of `triangles`): they can cross without a vertex over a face.
  struct Ridge {
    std::array<Index, 2> vertices{}, faces{};
  };
  std::vector<Ridge> ridges;
};

/// The faces of cuts alone (patches beyond kOuterPatch), or everything. spacing [m]: of the body's particles.
SelfContactSet selfContactSet(const ContactShape& shape, bool cuts_alone, double spacing);

}  // namespace meshless
