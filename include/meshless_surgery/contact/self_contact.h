// Where a body can meet itself: folded over, or the lips of an incision against each other.
#pragma once

#include "meshless_surgery/contact/contact_shape.h"

namespace meshless {

/// Of a shape: vertices and faces that may touch each other.
struct SelfContactSet {
  std::vector<Index> vertices;   // of its surface, ascending
  std::vector<Index> triangles;  // of its surface
  double depth = 0.0;            // [m] how far behind a face a point still counts as behind it
};

/// The faces of cuts alone (patches beyond kOuterPatch), or everything. spacing [m]: of the body's particles.
SelfContactSet selfContactSet(const ContactShape& shape, bool cuts_alone, double spacing);

}  // namespace meshless
