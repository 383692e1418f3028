#include "collider_points.h"

#include <algorithm>

namespace meshless {

Vec3 sampleAt(const ShapeCollider& collider, const ContactSample& sample) {
  const Vec3 p = vertexAt(collider, sample.vertices[0]);
  return sample.share > 0.0 ? Vec3(p + sample.share * (vertexAt(collider, sample.vertices[1]) - p)) : p;
}

Vec3 vertexMotion(const ShapeCollider& collider, Index vertex) {
  const SurfaceRows& rows = collider.shape->rows();
  const Index particle = (*rows.particle)[vertex];
  if (particle != kNoIndex) return collider.positions[particle] - collider.previous[particle];
  const Index r = collider.shape->embeddedOf(vertex);
  Vec3 sum = Vec3::Zero();
  for (Index k = (*rows.offsets)[r]; k < (*rows.offsets)[r + 1]; ++k) {
    const Index i = (*rows.carriers)[k];
    sum += (*rows.weights)[k] * (collider.positions[i] - collider.previous[i]);
  }
  return sum;
}

Vec3 addRow(const ShapeCollider& collider, Index vertex, double weight, std::vector<ContactEntry>& entries) {
  const SurfaceRows& rows = collider.shape->rows();
  const Index particle = (*rows.particle)[vertex];
  if (particle != kNoIndex) {
    entries.push_back({particle, weight});
    return Vec3::Zero();
  }
  const Index r = collider.shape->embeddedOf(vertex);
  Vec3 rest = collider.surface[vertex];
  for (Index k = (*rows.offsets)[r]; k < (*rows.offsets)[r + 1]; ++k) {
    const Index i = (*rows.carriers)[k];
    rest -= (*rows.weights)[k] * collider.positions[i];
    entries.push_back({i, weight * (*rows.weights)[k]});
  }
  return weight * rest;
}

void tidy(std::vector<ContactEntry>& entries, std::size_t first) {
  std::sort(entries.begin() + static_cast<std::ptrdiff_t>(first), entries.end(),
            [](const ContactEntry& p, const ContactEntry& q) { return p.particle < q.particle; });
  std::size_t out = first;
  for (std::size_t k = first; k < entries.size(); ++k) {
    if (out > first && entries[out - 1].particle == entries[k].particle)
      entries[out - 1].weight += entries[k].weight;
    else
      entries[out++] = entries[k];
  }
  entries.resize(out);
}

}  // namespace meshless
