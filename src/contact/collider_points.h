// Points of a collider's surface, by its particles and embedded vertices.
#pragma once

#include "contact_set.h"

namespace meshless {

inline const Vec3& vertexAt(const ShapeCollider& collider, Index vertex) {
  return collider.surface ? collider.surface[vertex] : collider.positions[(*collider.shape->rows().particle)[vertex]];
}
Vec3 sampleAt(const ShapeCollider& collider, const ContactSample& sample);
/// How far a point of the surface has moved in the substep [m], by its particles.
Vec3 vertexMotion(const ShapeCollider& collider, Index vertex);
/// Appends the carriers of a vertex; returns its offset from where they have it [m].
Vec3 addRow(const ShapeCollider& collider, Index vertex, double weight, std::vector<ContactEntry>& entries);
/// Entries of the same particle become one, ascending.
void tidy(std::vector<ContactEntry>& entries, std::size_t first);

}  // namespace meshless
