// Rows: what a pair of features asks of the particles that carry them, linear within a frame.
#pragma once

#include <tuple>

#include "meshless_surgery/contact/feature_pairs.h"

namespace meshless {

/// What stays the same about a contact from frame to frame.
struct RowKey {
  std::uint64_t a = 0, b = 0;  // of the bodies
  std::array<Index, 2> features{};
  std::uint32_t kind = 0;  // of the pair, and its order

  bool operator<(const RowKey& o) const {
    return std::tie(a, b, features, kind) < std::tie(o.a, o.b, o.features, o.kind);
  }
};

struct RowEntry {
  Index particle = 0;
  double coefficient = 0.0;
  double response = 0.0;  // [1/kg] coefficient times the inverse mass that answers by itself
};

/// gap(x) = normal . sum coefficient x + constant [m] >= 0. Entries begin .. middle - 1 are of body a, the others of b.
struct ContactRow {
  Vec3 normal = Vec3::UnitZ();  // unit, from b to a
  double constant = 0.0;        // [m]
  double gap = 0.0;             // [m] at the start of the frame
  double skin = 0.0;            // [m] that is taken off it: negative beyond that, it is old overlap
  double friction = 0.0;        // Coulomb
  double bounce = 0.0;          // [m/s] with which they are to part; 0: they need not
  Vec3 impulse = Vec3::Zero();  // [kg m] mass times displacement on a, in a substep
  Index begin = 0, middle = 0, end = 0;
  Index a = 0, b = kNoIndex;  // kNoIndex: what has no particles
  FeaturePair::Kind kind = FeaturePair::Kind::kVertexFace;
  RowKey key;
};

struct RowSet {
  std::vector<ContactRow> rows;
  std::vector<RowEntry> entries;

  void clear() {
    rows.clear();
    entries.clear();
  }
  void append(const RowSet& other);
};

/// A body for makeRow().
struct RowBody {
  Index number = kNoIndex;  // in the frame
  const ContactSurface* surface = nullptr;
  const double* inverse_masses = nullptr;  // [1/kg] 0: held
  const Vec3* positions = nullptr;         // [m] particles now
  double own_share = 1.0;                  // of the response that is the particles' own
  bool moves = true;                       // false: nothing answers
};

/// [m] at which surfaces rest above each other.
double skinOf(double edge_length);

/// Appends the row of a pair; nothing where no particle answers. b may be the same body as a, or have no surface.
/// skin [m] is taken off the gap. Returns the row, valid until the next.
ContactRow* makeRow(const FeaturePair& pair, const RowBody& a, const RowBody& b, double skin, RowSet& set);

}  // namespace meshless
