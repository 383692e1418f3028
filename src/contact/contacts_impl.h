// What Contacts keeps; shared by the files that implement it.
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <tuple>

#include "contact_set.h"
#include "map_finder.h"
#include "party_points.h"

namespace meshless {

inline constexpr double kMargin = 1e-3;  // of the smaller body's size: contacts are kept while so near
inline constexpr double kQuick = 0.25;   // of the thickness: who goes farther is looked up in every substep, or traced
inline constexpr double kMostPasses = 4.0;  // beyond it substeps do more

struct Pair {
  Index a, b;
  double reach;              // [m] how far outside a point is taken as a contact to come
  bool quick;                // looked up anew in every substep
  double way;                // [m/s] at which its bodies move, at most
  bool expelled = false;     // one is inside the other, and let out as a whole
  bool by_vertices = false;  // points on edges are left out
};

// Usual lookups that quick pairs ask for at once, if that is more than all vertices there are: beyond it they are a
// heap.
inline constexpr std::size_t kMostInHeap = 12500;

// Points that have passed through, and the share of all vertices that they are: more are a heap, too.
inline constexpr std::size_t kManyCaught = 500, kManyCaughtOf = 4;

inline constexpr int kAnySubsteps = 1000000;

/// How many of a shape's points are asked about in the pair's other: its vertices come first.
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

/// What passed through and is still on the wrong side.
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
  /// reach [m]: how far from a face its box goes; what is in none is near none. Keeps the address of the party's faces.
  void make(const ContactParty& party, double reach);
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

/// What of a party is followed in a substep, for all pairs that it is in.
struct SweptParty {
  std::vector<Path> samples, corners;  // of the surface
  Box box;                             // of the samples' ways
  std::vector<Box> triangles;          // likewise

  /// The first `count` of its samples.
  void make(const ContactParty& party, Index count);
};

/// Who of one party has passed through a triangle of another, and through which.
struct Traced {
  std::size_t paths = 0;  // that were followed
  std::vector<std::pair<CaughtKey, Index>> caught;
};

/// How many points of one party lie in the other.
struct Inside {
  std::size_t points = 0, asked = 0, inside = 0, near = 0;  // asked: not caught, in the region where both are
  double deepest = 0.0;

  void add(const Inside& other);
};

/// Points of one party of a pair that are looked up in the other, what was found, and where their task has it.
struct LookupPart {
  Index pair;
  bool second;       // of its b in its a
  Index first, end;  // samples; of a body with itself there is one part, and it is empty
  Inside inside;
  std::size_t contacts = 0, entries = 0, depths = 0;  // ends
};

/// In the order of pairs, parties and samples. Large bodies make several, so that threads share them; where one ends
/// goes by the samples alone, so that what is found does not depend on the threads. Some that follow make a task.
class LookupParts {
 public:
  void clear() { parts_.clear(); }
  void add(const std::vector<ContactParty>& parties, const Pair& pair, Index number);
  std::size_t tasks() const { return (parts_.size() + perTask() - 1) / perTask(); }
  std::size_t firstOf(std::size_t task) const { return task * perTask(); }
  std::size_t endOf(std::size_t task) const { return std::min(parts_.size(), (task + 1) * perTask()); }
  LookupPart& operator[](std::size_t n) { return parts_[n]; }
  std::vector<LookupPart>::const_iterator begin() const { return parts_.begin(); }
  std::vector<LookupPart>::const_iterator end() const { return parts_.end(); }
  std::size_t bytes() const { return bytesOf(parts_); }

 private:
  std::size_t perTask() const;

  std::vector<LookupPart> parts_;
};

/// Appends a part of what a task has found; its entries are then numbered from where they come to lie.
void append(std::vector<Contact>& contacts, std::vector<ContactEntry>& entries, const Findings& from,
            std::size_t contacts_from, std::size_t contacts_to, std::size_t entries_from, std::size_t entries_to);

/// Sweeps in a frame of h [s] for an island.
double stackWork(const ContactScene& scene, const std::vector<ContactParty>& parties, const IslandPlan& plan,
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

/// What was last found of a quick pair, and how far its bodies may have gone since.
struct QuickFindings {
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
  std::vector<Index> grounded;  // parties that can meet the ground
  std::vector<MapFinder> finders;
  std::vector<std::vector<ContactMap>> maps_now;  // of those in quick pairs
  std::vector<Box> bounds_now;                    // likewise, of their surfaces
  std::vector<Contact> contacts, last;            // of this frame and of the one before
  std::vector<Contact> quick_known;               // of quick pairs, at the start of this frame
  std::vector<ContactEntry> entries;
  std::size_t steady_contacts = 0, steady_entries = 0;  // those found once a frame; quick ones follow
  std::map<CaughtKey, Index> caught;                    // triangle
  std::map<PairKey, Exit> exits;
  std::vector<double> depths;
  std::vector<Index> reached;
  int needed_substeps = 1, standing_substeps = 1, affordable_substeps = kAnySubsteps;  // standing: for stacks
  double impulse_substep = 0.0;  // [s] of which the contacts' impulses are; 0: of none
  double frame = 0.0;            // [s]
  ContactSolver solver;
  IslandPlan plan;
  std::size_t frames = 0, last_sorted = 0;  // of `last`, before what was found out of turn
  std::vector<std::uint64_t> keys;          // of the parties of the last frame
  int substep_number = 0, look_every = 1;   // in the frame; substeps between looks at quick pairs
  int look_gap = 1;                         // likewise, from now on
  std::size_t many_caught = kManyCaught;    // of this frame
  double looked = 0.0, most_looked = 0.0;   // usual lookups that looks have asked for in this frame, and may
  double asked = 0.0;                       // as those, of quick pairs where they are near when the frame began
  std::size_t asked_points = 0;             // likewise, in points
  std::size_t samples = 0;                  // of all parties
  bool heap = false;                        // quick pairs are looked at by their vertices; see findHeaps()
  bool fresh = true;                        // nothing has been solved since the contacts were made
  bool plan_steady = true;                  // the plan is that of the steady contacts alone
  std::vector<Findings> tasks;
  LookupParts parts;                 // of this look
  std::vector<Inside> inside;        // two a pair
  std::vector<QuickFindings> quick;  // one a pair; of those that are quick
  std::vector<Traced> traced;        // two a pair that goes far in a substep
  std::vector<SweptParty> swept;     // one a party; of those in such pairs
  std::vector<ContactParty> seen;    // by lookAhead(), and what it found
  std::vector<Foreseen> foreseen;
  std::vector<std::shared_ptr<const Contacts>> ahead;  // whose findings this frame may take over
  std::vector<TakenOver> taken;                        // one a pair, or none at all
  bool was_steady = true;                              // the last solve had no others than the steady contacts
  bool settled = false;                                // nothing is quick or caught in this frame

  bool locate(const ContactParty& b, const SurfaceNow& surface, const MapFinder& finder, const ContactMap* maps,
              const Vec3& p, const std::function<Vec3()>& inwardAt, double reach, Index& hint,
              ContactShape::Nearest& found, bool& flipped, ContactCounters& counters) const;
  void addContact(Findings& to, const std::vector<ContactParty>& parties, Index a, Index number, const ContactSample& s,
                  Index b, Index triangle, const std::array<double, 3>& weights, bool was_caught, bool flipped);
  std::size_t firstKnown(const std::vector<Contact>& known, std::size_t end, const Pair& pair, bool second) const;
  void startAt(Findings& to, const std::vector<Contact>& known, std::size_t end, const Pair& pair, bool second) const;
  bool stillOver(Findings& to, const ContactParty& with, Index a, Index b, Index sample, const Vec3& p, Index& hint,
                 ContactShape::Nearest& found, bool& flipped) const;
  void lookInto(Findings& to, const std::vector<ContactParty>& parties, const Pair& pair, const ContactMap* maps,
                bool every_point, LookupPart& part);
  bool isForeseen(Index pair) const { return !taken.empty() && taken[pair].found; }
  template <class Look>
  void lookUp(std::size_t task, Findings& to, const std::vector<Contact>& known, std::size_t known_end,
              const Look& look);
  void lookIntoSelf(Findings& to, const std::vector<ContactParty>& parties, const Pair& pair);
  void crossRidges(Findings& to, const std::vector<ContactParty>& parties, const Pair& pair);
  void lookAtQuick(const std::vector<ContactParty>& parties, double substep, const RefitMaps& refit,
                   ContactCounters& counters, const ForEach& for_each);
  void trace(const std::vector<ContactParty>& parties, const Pair& pair, bool second, const std::vector<Contact>* found,
             Traced& traced) const;
  void addCaught(const std::vector<ContactParty>& parties);
  void releaseShallow(const std::vector<ContactParty>& parties);
  bool isShallow(const std::vector<ContactParty>& parties, Index a, Index b, Index sample, Index triangle) const;
  void addGround(Findings& to, const std::vector<ContactParty>& parties, Index a, double reach);
  void join(const Findings& from, std::size_t contacts_from, std::size_t contacts_to, std::size_t entries_from,
            std::size_t entries_to);
  void findHeaps(const std::vector<ContactParty>& parties, const ForEach& for_each);
  void prepareLookups(const std::vector<ContactParty>& parties, double h);
  bool isUnknown(const std::vector<ContactParty>& parties, const Pair& pair) const;
  void findForeseen(const std::vector<ContactParty>& parties);
  void takeForeseen(Findings& to, LookupPart& part) const;
  void followParties(const std::vector<ContactParty>& parties);
  void takeOver();
  double mostLooked() const;
  void chooseSubsteps(double torn, double standing);
  bool anyCaught(Index island) const;
  void choosePasses(const std::vector<ContactParty>& parties, double substep);
  bool letOutWhole(const std::vector<ContactParty>& parties, const Pair& pair, const Inside& of_a, const Inside& of_b,
                   double h, ContactCounters& counters);
};

// The parts of a task, with what is known of them from before.
template <class Look>
void Contacts::Impl::lookUp(std::size_t task, Findings& to, const std::vector<Contact>& known, std::size_t known_end,
                            const Look& look) {
  for (std::size_t k = parts.firstOf(task); k < parts.endOf(task); ++k) {
    LookupPart& part = parts[k];
    if (k == parts.firstOf(task)) startAt(to, known, known_end, pairs[part.pair], part.second);
    look(part);
    part.contacts = to.contacts.size();
    part.entries = to.entries.size();
    part.depths = to.depths.size();
  }
}

}  // namespace meshless
