// Points of a party's surface, by its particles and riders.
#pragma once

#include "contact_set.h"

namespace meshless {

inline const Vec3& vertexAt(const ContactParty& party, Index vertex) {
  return party.surface ? party.surface[vertex] : party.positions[(*party.shape->rows().particle)[vertex]];
}
Vec3 sampleAt(const ContactParty& party, const ContactSample& sample);
/// How far a point of the surface has moved in the substep [m], by its particles.
Vec3 vertexMotion(const ContactParty& party, Index vertex);
/// Appends who carries a vertex; returns what it has beyond its particles [m].
Vec3 addRow(const ContactParty& party, Index vertex, double weight, std::vector<ContactEntry>& entries);
/// Entries of the same particle become one, ascending.
void tidy(std::vector<ContactEntry>& entries, std::size_t first);

}  // namespace meshless
