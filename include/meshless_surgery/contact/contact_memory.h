// All that contact keeps from frame to frame: how hard each row pressed, and on which side of others vertices are.
#pragma once

#include <functional>

#include "meshless_surgery/base/archive.h"
#include "meshless_surgery/contact/contact_rows.h"

namespace meshless {

struct ContactMemory {
  struct Force {
    RowKey key;
    Vec3 force = Vec3::Zero();  // [N] on a
  };
  struct Side {
    std::uint64_t a = 0, b = 0;  // keys of the bodies
    RememberedSide side;
  };
  std::vector<Force> forces;  // ascending by key
  std::vector<Side> sides;    // ascending by a, b and vertex

  /// 0 where there is none.
  Vec3 forceOf(const RowKey& key) const;
  /// Those of vertices of a and b: first and end of sides.
  std::array<std::size_t, 2> sidesOf(std::uint64_t a, std::uint64_t b) const;
  void sort();
  /// Leaves what `keep(a, b)` says.
  void filter(const std::function<bool(std::uint64_t, std::uint64_t)>& keep);
  /// Why it cannot be; empty where it can. Of memory that was read from a file.
  std::string fault() const;
};

template <class A>
void serialize(A& archive, RowKey& v) {
  auto& [a, b, features, kind] = v;
  archive(a, b, features, kind);
}
template <class A>
void serialize(A& archive, RememberedSide& v) {
  auto& [vertex, depth, normal] = v;
  archive(vertex, depth, normal);
}
template <class A>
void serialize(A& archive, ContactMemory::Force& v) {
  auto& [key, force] = v;
  archive(key, force);
}
template <class A>
void serialize(A& archive, ContactMemory::Side& v) {
  auto& [a, b, side] = v;
  archive(a, b, side);
}
template <class A>
void serialize(A& archive, ContactMemory& v) {
  auto& [forces, sides] = v;
  archive(forces, sides);
}

}  // namespace meshless
