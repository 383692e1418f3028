// What Contacts keeps; shared by the files that implement it.
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <tuple>

#include "collider_points.h"
#include "contact_set.h"
#include "map_finder.h"

namespace meshless {

inline constexpr double kMargin = 1e-3;  // of the smaller body's size: contacts are kept while so near
// Of the thickness: a pair that moves farther in a frame is fast. It is queried in the substeps, and points are traced.
inline constexpr double kFast = 0.25;
inline constexpr double kMostPasses = 4.0;  // beyond it substeps do more

struct Pair {
  Index a, b;
  double reach;              // [m] how far outside a point is taken as a contact to come
  bool fast;                 // moves farther than kFast in a frame: continuous collision detection
  double way;                // [m/s] at which its bodies move, at most
  bool expelled = false;     // one is inside the other, and is moved out as a whole
  bool by_vertices = false;  // points on edges are left out
};

// Usual queries of all fast pairs in one round. If they make more, and more than there are vertices, they are a heap.
inline constexpr std::size_t kMostInHeap = 12500;

// Points that have passed through. If there are more, and more than one for so many vertices, it is a heap too.
inline constexpr std::size_t kManyCaught = 500, kManyCaughtOf = 4;

inline constexpr int kAnySubsteps = 1000000;

/// How many of a shape's points are queried in the other shape of the pair: its vertices come first.
Index samplesFor(const Pair& pair, const ContactShape& shape);

inline Box intersection(const Box& a, const Box& b) { return {a.min.cwiseMax(b.min), a.max.cwiseMin(b.max)}; }

inline Box grown(Box box, double by) {
  box.min.array() -= by;
  box.max.array() += by;
  return box;
}

/// The order in which contacts are made.
inline std::tuple<bool, Index, Index, bool, Index> keyOf(const Contact& c) {
  return {c.b != kNoIndex, std::min(c.a, c.b), c.b == kNoIndex ? 0 : std::max(c.a, c.b), c.b != kNoIndex && c.a > c.b,
          c.sample};
}

using PairKey = std::pair<std::uint64_t, std::uint64_t>;

/// A point of collider a that passed through the surface of b and is still on the wrong side.
struct CaughtKey {
  std::uint64_t a, b;
  Index sample;
  bool operator<(const CaughtKey& o) const { return std::tie(a, b, sample) < std::tie(o.a, o.b, o.sample); }
};

struct Exit {
  Vec3 direction;  // of a out of b
  double speed;    // [m/s]
};

/// A body's own faces, where they are now, by cells of a grid.
class SelfGrid {
 public:
  /// reach [m]: how far from a face its box goes; what is in none is near none. Keeps the address of the collider's
  /// faces.
  void make(const ShapeCollider& collider, double reach);
  /// Faces that may be within reach of p, each once, in their order.
  template <class Visit>
  void forNear(const Vec3& p, const Visit& visit) const;
  std::size_t bytes() const { return bytesOf(boxes_, offsets_, items_, next_); }

 private:
  template <class Visit>
  void forCells(const Box& box, const Visit& visit) const;
  int at(double coordinate, int axis) const;

  const std::vector<Index>* triangles_ = nullptr;
  std::vector<Box> boxes_;                     // of the triangles
  std::vector<Index> offsets_, items_, next_;  // items: places in both
  std::array<int, 3> cells_{{1, 1, 1}};
  Vec3 origin_ = Vec3::Zero();
  double edge_ = 1.0;
};

/// A ridge of a body that meets itself, where it is now.
struct RidgeNow {
  Box box;
  Vec3 outward;  // unit
  Index ridge;
};

/// Vertices of a surface where they are now, for the points of another.
struct SurfaceNow {
  PointFinder finder;
  std::vector<Index> vertices;  // as the finder numbers them
  double deviation = -1.0;      // [m] how far the surface may be from where its maps have it; negative: not known yet
  bool loose = false;           // by so much that the nearest vertex tells more
  double around = 0.0;          // [m] all vertices that are so near to a point in question are among them
  double gap = 0.0;             // [m] no point of the surface is farther from all vertices
};

/// What a task finds; tasks are joined in their order.
struct Findings {
  std::vector<Contact> contacts;
  std::vector<ContactEntry> entries;
  std::vector<double> depths;
  ContactCounters counters;
  SelfGrid self_grid;
  Points self_areas;
  std::vector<RidgeNow> ridges;
  const std::vector<Contact>* known = nullptr;  // found before, in the order of keyOf
  std::size_t cursor = 0, known_end = 0;        // in them
  SurfaceNow surface;

  void clear() {
    contacts.clear();
    entries.clear();
    depths.clear();
    counters = ContactCounters();
    cursor = 0;
  }
};

/// From where to where something goes in a substep.
struct Path {
  Vec3 from, to;
};

/// The points and faces of a collider in a substep, swept, for all pairs that it is in.
struct SweptCollider {
  std::vector<Path> samples, corners;  // of the surface
  Box box;                             // of the samples' ways
  std::vector<Box> triangles;          // likewise

  /// The first `count` of its samples.
  void make(const ShapeCollider& collider, Index count);
};

/// Points of one collider that have passed through a triangle of another, and which triangle.
struct Traced {
  std::size_t paths = 0;  // that were followed
  std::vector<std::pair<CaughtKey, Index>> caught;
};

/// How many points of one collider lie in the other.
struct Inside {
  std::size_t points = 0, asked = 0, inside = 0, near = 0;  // asked: not caught, and where both bodies are
  double deepest = 0.0;

  void add(const Inside& other);
};

/// Some points of one collider of a pair that are queried in the other; where their task has what was found.
struct QueryPart {
  Index pair;
  bool second;       // of its b in its a
  Index first, end;  // samples; of a body with itself there is one part, and it is empty
  Inside inside;
  std::size_t contacts = 0, entries = 0, depths = 0;  // ends
};

/// In the order of pairs, colliders and samples. Large bodies make several parts, so that threads share them. Where a
/// part ends depends on the samples alone, so that what is found does not depend on the threads. Some consecutive parts
/// make a task.
class QueryParts {
 public:
  void clear() { parts_.clear(); }
  void add(const std::vector<ShapeCollider>& colliders, const Pair& pair, Index number);
  std::size_t tasks() const { return (parts_.size() + perTask() - 1) / perTask(); }
  std::size_t firstOf(std::size_t task) const { return task * perTask(); }
  std::size_t endOf(std::size_t task) const { return std::min(parts_.size(), (task + 1) * perTask()); }
  QueryPart& operator[](std::size_t n) { return parts_[n]; }
  std::vector<QueryPart>::const_iterator begin() const { return parts_.begin(); }
  std::vector<QueryPart>::const_iterator end() const { return parts_.end(); }
  std::size_t bytes() const { return bytesOf(parts_); }

 private:
  std::size_t perTask() const;

  std::vector<QueryPart> parts_;
};

/// Appends a part of what a task has found; its entries are then numbered from where they come to lie.
void append(std::vector<Contact>& contacts, std::vector<ContactEntry>& entries, const Findings& from,
            std::size_t contacts_from, std::size_t contacts_to, std::size_t entries_from, std::size_t entries_to);

/// Sweeps in a frame of h [s] for an island.
double stackWork(const ContactScene& scene, const std::vector<ShapeCollider>& colliders, const IslandPlan& plan,
                 Index island, double h);

/// What was found ahead of a frame: the points of the pair's a in b, and of its b in a.
struct Foreseen {
  Pair pair;
  std::array<Findings, 2> halves;
  std::array<Inside, 2> inside;
};

/// What is taken over for a pair; swapped: it was found with a and b the other way round.
struct TakenOver {
  const Foreseen* found = nullptr;
  bool swapped = false;
};

/// What was found of a fast pair when it was last queried, and how far its bodies may have gone since.
struct FastFindings {
  Findings found;
  double moved = 0.0;     // [m]
  std::size_t first = 0;  // its place among the contacts
};

struct Contacts::Impl {
  ContactScene scene;
  BroadPhase broad;
  std::vector<Box> boxes;
  std::vector<char> active, needed;
  std::vector<Pair> pairs;
  std::vector<Index> grounded;  // colliders that can meet the ground
  std::vector<MapFinder> finders;
  std::vector<std::vector<ContactMap>> maps_now;  // of those in fast pairs
  std::vector<Box> bounds_now;                    // likewise, of their surfaces
  std::vector<Contact> contacts, last;            // of this frame and of the one before
  std::vector<Contact> fast_known;                // of fast pairs, at the start of this frame
  std::vector<ContactEntry> entries;
  std::size_t steady_contacts = 0, steady_entries = 0;  // those found once a frame; those of fast pairs follow
  std::map<CaughtKey, Index> caught;                    // triangle
  std::map<PairKey, Exit> exits;
  std::vector<double> depths;
  std::vector<Index> reached;
  int needed_substeps = 1, standing_substeps = 1, affordable_substeps = kAnySubsteps;  // standing: for stacks
  double impulse_substep = 0.0;  // [s] of which the contacts' impulses are; 0: of none
  double frame = 0.0;            // [s]
  ContactSolver solver;
  IslandPlan plan;
  std::size_t frames = 0, last_sorted = 0;   // of `last`, before what was found out of turn
  std::vector<std::uint64_t> keys;           // of the colliders of the last frame
  int substep_number = 0, query_every = 1;   // in the frame; substeps from one query of fast pairs to the next
  int query_gap = 1;                         // likewise, from now on
  std::size_t many_caught = kManyCaught;     // of this frame
  double queries = 0.0, most_queries = 0.0;  // usual queries that fast pairs have made in this frame, and may make
  double asked = 0.0;                        // usual queries of all fast pairs once, as near as they were at the start
  std::size_t asked_points = 0;              // likewise, in points
  std::size_t samples = 0;                   // of all colliders
  bool heap = false;                         // of fast pairs only vertices are queried; see findHeaps()
  bool fresh = true;                         // nothing has been solved since the contacts were made
  bool plan_steady = true;                   // the plan is that of the steady contacts alone
  std::vector<Findings> tasks;
  QueryParts parts;                  // of this round of queries
  std::vector<Inside> inside;        // two a pair
  std::vector<FastFindings> fast;    // one a pair; of those that are fast
  std::vector<Traced> traced;        // two a pair that goes far in a substep
  std::vector<SweptCollider> swept;  // one a collider; of those in such pairs
  std::vector<ShapeCollider> seen;   // by queryAhead(), which found `foreseen`
  std::vector<Foreseen> foreseen;
  std::vector<std::shared_ptr<const Contacts>> ahead;  // whose findings this frame may take over
  std::vector<TakenOver> taken;                        // one a pair, or none at all
  bool was_steady = true;                              // the last solve had no others than the steady contacts
  bool settled = false;                                // no pair is fast and no point caught in this frame

  bool locate(const ShapeCollider& b, const SurfaceNow& surface, const MapFinder& finder, const ContactMap* maps,
              const Vec3& p, const std::function<Vec3()>& inwardAt, double reach, Index& hint,
              ContactShape::Nearest& found, bool& flipped, ContactCounters& counters) const;
  void addContact(Findings& to, const std::vector<ShapeCollider>& colliders, Index a, Index number,
                  const ContactSample& s, Index b, Index triangle, const std::array<double, 3>& weights,
                  bool was_caught, bool flipped);
  std::size_t firstKnown(const std::vector<Contact>& known, std::size_t end, const Pair& pair, bool second) const;
  void startAt(Findings& to, const std::vector<Contact>& known, std::size_t end, const Pair& pair, bool second) const;
  bool stillOver(Findings& to, const ShapeCollider& with, Index a, Index b, Index sample, const Vec3& p, Index& hint,
                 ContactShape::Nearest& found, bool& flipped) const;
  void queryPart(Findings& to, const std::vector<ShapeCollider>& colliders, const Pair& pair, const ContactMap* maps,
                 bool every_point, QueryPart& part);
  bool isForeseen(Index pair) const { return !taken.empty() && taken[pair].found; }
  template <class Query>
  void queryParts(std::size_t task, Findings& to, const std::vector<Contact>& known, std::size_t known_end,
                  const Query& query);
  void querySelf(Findings& to, const std::vector<ShapeCollider>& colliders, const Pair& pair);
  void crossRidges(Findings& to, const std::vector<ShapeCollider>& colliders, const Pair& pair);
  void queryFast(const std::vector<ShapeCollider>& colliders, double substep, const RefitMaps& refit,
                 ContactCounters& counters, const ForEach& for_each);
  void trace(const std::vector<ShapeCollider>& colliders, const Pair& pair, bool second,
             const std::vector<Contact>* found, Traced& traced) const;
  void addCaught(const std::vector<ShapeCollider>& colliders);
  void releaseShallow(const std::vector<ShapeCollider>& colliders);
  bool isShallow(const std::vector<ShapeCollider>& colliders, Index a, Index b, Index sample, Index triangle) const;
  void addGround(Findings& to, const std::vector<ShapeCollider>& colliders, Index a, double reach);
  void join(const Findings& from, std::size_t contacts_from, std::size_t contacts_to, std::size_t entries_from,
            std::size_t entries_to);
  void findHeaps(const std::vector<ShapeCollider>& colliders, const ForEach& for_each);
  void prepareQueries(const std::vector<ShapeCollider>& colliders, double h);
  bool isUnknown(const std::vector<ShapeCollider>& colliders, const Pair& pair) const;
  void findForeseen(const std::vector<ShapeCollider>& colliders);
  void takeForeseen(Findings& to, QueryPart& part) const;
  void followColliders(const std::vector<ShapeCollider>& colliders);
  void takeOver();
  double mostQueries() const;
  void chooseSubsteps(double torn, double standing);
  bool anyCaught(Index island) const;
  void choosePasses(const std::vector<ShapeCollider>& colliders, double substep);
  bool depenetrateWhole(const std::vector<ShapeCollider>& colliders, const Pair& pair, const Inside& of_a,
                        const Inside& of_b, double h, ContactCounters& counters);
};

// Does `query` for the parts of a task, with what is known of them from before.
template <class Query>
void Contacts::Impl::queryParts(std::size_t task, Findings& to, const std::vector<Contact>& known,
                                std::size_t known_end, const Query& query) {
  for (std::size_t k = parts.firstOf(task); k < parts.endOf(task); ++k) {
    QueryPart& part = parts[k];
    if (k == parts.firstOf(task)) startAt(to, known, known_end, pairs[part.pair], part.second);
    query(part);
    part.contacts = to.contacts.size();
    part.entries = to.entries.size();
    part.depths = to.depths.size();
  }
}

}  // namespace meshless
