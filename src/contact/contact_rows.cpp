#include "meshless_surgery/contact/contact_rows.h"

#include <algorithm>
#include <cmath>

namespace meshless {
namespace {

// Of one body, merged: vertices share particles.
void addEntries(const FeaturePair& pair, int from, int to, const ContactSurface& surface,
                std::vector<RowEntry>& entries) {
  static thread_local std::vector<Index> places;  // in entries, one a particle; of others where it is not there yet
  const std::size_t begin = entries.size();
  const VertexSupports& supports = surface.supports;
  for (int n = from; n < to; ++n) {
    if (pair.shares[n] == 0.0) continue;
    for (Index k = supports.offsets[pair.vertices[n]]; k < supports.offsets[pair.vertices[n] + 1]; ++k) {
      const double coefficient = pair.shares[n] * supports.weights[k];
      const Index particle = supports.particles[k];
      if (places.size() <= particle) places.resize(particle + 1, 0);
      Index& at = places[particle];
      if (at < begin || at >= entries.size() || entries[at].particle != particle) {
        at = static_cast<Index>(entries.size());
        entries.push_back({0.0, particle});
      }
      entries[at].coefficient += coefficient;
    }
  }
}

/// What a row of these entries answers [1/kg], and the farthest that it moves one of their particles.
struct Answer {
  double sum = 0.0, farthest = 0.0;

  void add(const std::vector<RowEntry>& entries, Index begin, Index end, const RowBody& body) {
    for (Index k = begin; k < end; ++k) {
      const double way = entries[k].coefficient * body.inverse_masses[entries[k].particle];
      sum += entries[k].coefficient * way;
      farthest = std::max(farthest, std::abs(way));
    }
  }
};

}  // namespace

ContactRow* makeRow(const FeaturePair& pair, const RowBody& a, const RowBody& b, double skin, RowSet& set) {
  const bool with_itself = a.positions == b.positions;
  ContactRow row;
  row.begin = static_cast<Index>(set.entries.size());
  addEntries(pair, 0, with_itself ? pair.of_a + pair.of_b : pair.of_a, *a.surface, set.entries);
  row.middle = static_cast<Index>(set.entries.size());
  if (pair.of_b > 0 && !with_itself) addEntries(pair, pair.of_a, pair.of_a + pair.of_b, *b.surface, set.entries);
  row.end = static_cast<Index>(set.entries.size());
  // Not where both are held, but for a rounding: who sleeps there would be woken by who does not, for ever.
  Answer answer;
  answer.add(set.entries, row.begin, row.middle, a);
  answer.add(set.entries, row.middle, row.end, b);
  if (!canAnswer(answer.sum, answer.farthest)) {
    set.entries.resize(row.begin);
    return nullptr;
  }
  Vec3 sum = Vec3::Zero();
  for (Index k = row.begin; k < row.end; ++k)
    sum += set.entries[k].coefficient * (k < row.middle ? a : b).positions[set.entries[k].particle];
  row.normal = pair.normal;
  row.rise = -skin - pair.normal.dot(sum);
  for (int n = 0; n < pair.of_a; ++n) row.rise += pair.shares[n] * pair.normal.dot(a.vertices[pair.vertices[n]]);
  row.constant = pair.gap - skin - pair.normal.dot(sum);
  row.kind = pair.kind;
  row.order = pair.order;
  row.features = pair.features;
  set.rows.push_back(row);
  return &set.rows.back();
}

}  // namespace meshless
