// Rows: what a pair of features asks of the particles that carry them, linear for as long as the row is kept.
#pragma once

#include <algorithm>

#include "meshless_surgery/contact/feature_pairs.h"

namespace meshless {

struct RowEntry {
  double coefficient = 0.0;
  Index particle = 0;
};

/// gap(x) = normal . sum coefficient x + constant [m] >= 0. Entries begin .. middle - 1 are of body a, the others of b.
struct ContactRow {
  Vec3 normal = Vec3::UnitZ();  // unit, from b to a
  double constant = 0.0;        // [m]
  double rise = 0.0;            // [m] of it, by which the point of a is over the sum of its particles
  double friction = 0.0;        // Coulomb
  double restitution = 0.0;     // 0..1
  Vec3 impulse = Vec3::Zero();  // [kg m] mass times displacement on a in a substep; between frames the force [N]
  Index begin = 0, middle = 0, end = 0;
  FeaturePair::Kind kind = FeaturePair::Kind::kVertexFace;
  std::uint8_t order = 0;           // among those of one vertex
  std::array<Index, 2> features{};  // with kind and order, its name among the rows of two bodies

  auto name() const { return std::make_tuple(features[0], features[1], order); }
};

/// Rows between two bodies.
struct RowSet {
  std::vector<ContactRow> rows;
  std::vector<RowEntry> entries;

  void clear() {
    rows.clear();
    entries.clear();
  }
};

/// How rows of a set give way where particles are too far apart to show it: row n by the sum of coefficient [m/N] times
/// what the row `particle` presses with, of entries offsets[n] .. offsets[n + 1] - 1, the first of them its own, and by
/// no more than `most`. Without offsets: by nothing.
struct FineAnswer {
  std::vector<RowEntry> entries;
  std::vector<Index> offsets;
  double most = 0.0;  // [m]

  /// [m] worth: [1/s^2] force over impulse.
  double of(Index row, const std::vector<ContactRow>& rows, double worth) const {
    double sum = 0.0;
    for (Index k = offsets[row]; k < offsets[row + 1]; ++k) {
      const ContactRow& by = rows[entries[k].particle];
      sum += entries[k].coefficient * std::max(0.0, by.normal.dot(by.impulse));
    }
    return std::min(worth * sum, most);
  }
};

/// Whether particles can close a gap: none of them then moves by more than 20 times of it. Two points can hang on the
/// same particles but for a share of 1e-8; such gaps are left as they are.
/// answer: sum of coefficient^2 w, farthest: the largest |coefficient| w [1/kg].
inline bool canAnswer(double answer, double farthest) { return 20.0 * answer > farthest; }

/// A body for makeRow().
struct RowBody {
  const ContactSurface* surface = nullptr;
  const Vec3* positions = nullptr;         // [m] particles now
  const Vec3* vertices = nullptr;          // [m] as contact sees them
  const double* inverse_masses = nullptr;  // [1/kg] of particles, 0 where they are held
};

/// Appends the row of a pair, or none (null) where both of its points hang mostly on particles that are held: the few
/// others would go many times as far. skin [m] is taken off the gap.
ContactRow* makeRow(const FeaturePair& pair, const RowBody& a, const RowBody& b, double skin, RowSet& set);

}  // namespace meshless
