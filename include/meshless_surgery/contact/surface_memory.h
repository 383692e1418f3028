// All that contact in present space keeps from frame to frame.
#pragma once

#include <map>

#include "meshless_surgery/base/archive.h"
#include "meshless_surgery/contact/contact_rows.h"

namespace meshless {

/// [m] Least and most, along each axis, of what the vertices of a collider have gone.
struct WayBox {
  Vec3 least = Vec3::Zero(), most = Vec3::Zero();
};

/// What is between two colliders: points of the first against faces of the second.
struct KeptPair {
  enum class Kind : std::uint8_t { kVertexFace, kGround, kSphere, kGiven };
  Kind kind = Kind::kVertexFace;
  std::uint64_t key_a = 0, key_b = 0;  // of the colliders; key_b beyond all of theirs: of the ground or the sphere
  bool found = false;                  // once at least
  WayBox way_a, way_b;                 // that they had gone when it was found
  RowSet set;
  std::vector<RememberedSide> sides;  // ascending by vertex
};

/// How far a collider has gone since it was first near something.
struct KeptWay {
  std::uint64_t key = 0;
  Points last;  // [m] sums of the supports of vertices
  WayBox gone;  // sum of those of the frames
};

struct SurfaceMemory {
  std::vector<KeptPair> pairs;
  std::vector<KeptWay> ways;

  struct Known {
    std::size_t particles = 0, vertices = 0;
  };
  /// Why it cannot be, for colliders by their keys; empty where it can. Of memory that was read from a file.
  std::string fault(const std::map<std::uint64_t, Known>& colliders) const;
};

MESHLESS_ARCHIVE(RowEntry, coefficient, particle)
MESHLESS_ARCHIVE(ContactRow, normal, constant, rise, friction, restitution, impulse, begin, middle, end, kind, order,
                 features)
MESHLESS_ARCHIVE(RowSet, rows, entries)
MESHLESS_ARCHIVE(RememberedSide, vertex, depth, normal)
template <class A>
void serialize(A& archive, WayBox& v) {
  archive(v.least, v.most);
}
MESHLESS_ARCHIVE(KeptPair, kind, key_a, key_b, found, way_a, way_b, set, sides)
MESHLESS_ARCHIVE(KeptWay, key, last, gone)
MESHLESS_ARCHIVE(SurfaceMemory, pairs, ways)

}  // namespace meshless
