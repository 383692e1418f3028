#include "meshless_surgery/contact/contact_rows.h"

#include <algorithm>

namespace meshless {
namespace {

constexpr double kSkin = 0.03;  // of the mean edge

// Of one body, merged: vertices share particles.
void addEntries(const FeaturePair& pair, int from, int to, const RowBody& body, std::vector<RowEntry>& entries) {
  const std::size_t begin = entries.size();
  const VertexSupports& supports = body.surface->supports;
  for (int n = from; n < to; ++n)
    for (Index k = supports.offsets[pair.vertices[n]]; k < supports.offsets[pair.vertices[n] + 1]; ++k)
      entries.push_back({supports.particles[k], pair.shares[n] * supports.weights[k], 0.0});
  std::sort(entries.begin() + static_cast<std::ptrdiff_t>(begin), entries.end(),
            [](const RowEntry& x, const RowEntry& y) { return x.particle < y.particle; });
  std::size_t last = begin;
  for (std::size_t k = begin + 1; k < entries.size(); ++k) {
    if (entries[k].particle == entries[last].particle)
      entries[last].coefficient += entries[k].coefficient;
    else
      entries[++last] = entries[k];
  }
  entries.resize(std::min(entries.size(), last + 1));
  for (std::size_t k = begin; k < entries.size(); ++k)
    if (body.moves)
      entries[k].response = body.own_share * entries[k].coefficient * body.inverse_masses[entries[k].particle];
}

}  // namespace

void RowSet::append(const RowSet& other) {
  const Index shift = static_cast<Index>(entries.size());
  entries.insert(entries.end(), other.entries.begin(), other.entries.end());
  for (ContactRow row : other.rows) {
    row.begin += shift;
    row.middle += shift;
    row.end += shift;
    rows.push_back(row);
  }
}

double skinOf(double edge_length) { return kSkin * edge_length; }

ContactRow* makeRow(const FeaturePair& pair, const RowBody& a, const RowBody& b, double skin, RowSet& set) {
  ContactRow row;
  const bool with_itself = pair.of_b > 0 && a.number == b.number;
  row.begin = static_cast<Index>(set.entries.size());
  addEntries(pair, 0, with_itself ? pair.of_a + pair.of_b : pair.of_a, a, set.entries);
  row.middle = static_cast<Index>(set.entries.size());
  if (pair.of_b > 0 && !with_itself) addEntries(pair, pair.of_a, pair.of_a + pair.of_b, b, set.entries);
  row.end = static_cast<Index>(set.entries.size());
  double answer = 0.0;
  Vec3 sum = Vec3::Zero();
  for (Index k = row.begin; k < row.end; ++k) {
    const RowEntry& entry = set.entries[k];
    answer += entry.coefficient * entry.response;
    sum += entry.coefficient * (k < row.middle ? a : b).positions[entry.particle];
  }
  if (!(answer > 0.0) && a.own_share > 0.0 && (!b.surface || b.own_share > 0.0)) {
    set.entries.resize(row.begin);
    return nullptr;
  }
  row.normal = pair.normal;
  row.skin = skin;
  row.gap = pair.gap - skin;
  row.constant = row.gap - pair.normal.dot(sum);
  row.a = a.number;
  row.b = pair.of_b > 0 ? b.number : kNoIndex;
  row.kind = pair.kind;
  row.key.features = pair.features;
  row.key.kind = 16u * pair.order + static_cast<std::uint32_t>(pair.kind);
  set.rows.push_back(row);
  return &set.rows.back();
}

}  // namespace meshless
