// Where a surface is at the start of a frame, how it moves, and the boxes of what it sweeps.
#pragma once

#include "meshless_surgery/contact/contact_surface.h"

namespace meshless {

struct SurfaceFrame {
  Points vertices;              // [m]
  Points velocities;            // [m/s] of the vertices
  Points face_normals;          // unit; zero where a face has no area
  Points vertex_normals;        // unit, of the areas around; zero without
  TreeBoxes boxes;              // of faces, swept by their velocities in the frame
  TreeBoxes normals;            // boxes of the normals of faces and of their corners; see placeNormalBoxes()
  std::vector<Index> ridges;    // edges that are convex by more than kRidgeCosine, and borders
  Box bounds;                   // swept
  std::vector<FloatBox> swept;  // of vertices

  std::size_t bytes() const {
    return bytesOf(vertices, velocities, face_normals, vertex_normals, ridges, swept) + boxes.bytes() + normals.bytes();
  }
};

/// vertices [m]: one a vertex. velocities [m/s]: one a particle; null: it does not move. h [s]: of the frame.
void placeFrame(const ContactSurface& surface, const Vec3* vertices, const Vec3* velocities, double h,
                SurfaceFrame& frame);

/// For a search of a surface in itself: what faces the same way everywhere cannot meet (Volino and Magnenat-Thalmann
/// 1994).
void placeNormalBoxes(const ContactSurface& surface, SurfaceFrame& frame);

}  // namespace meshless
