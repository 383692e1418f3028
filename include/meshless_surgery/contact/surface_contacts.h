// Contact of deformable surfaces in present space (docs/method.md, Contact): finds rows where something has moved,
// keeps them where nothing has, groups what they join into islands, and solves each island's rows in each substep.
// Knows neither materials nor tools.
#pragma once

#include <map>
#include <memory>
#include <optional>

#include "meshless_surgery/base/for_each.h"
#include "meshless_surgery/contact/broad_phase.h"
#include "meshless_surgery/contact/deformable.h"
#include "meshless_surgery/contact/row_solver.h"
#include "meshless_surgery/contact/surface_memory.h"
#include "meshless_surgery/geometry/query/union_find.h"

namespace meshless {

/// A body or an obstacle as contact sees it in a frame. Whoever fills it keeps what it points to alive.
struct Collider {
  std::uint64_t key = 0;                                     // of the body for as long as it lives
  Box bounds;                                                // [m] swept in the frame; empty: it meets nothing
  double edge_length = 0.0;                                  // [m] mean
  double spacing = std::numeric_limits<double>::infinity();  // [m] of its particles: points on ridges are as near
  const ContactSurface* surface = nullptr;                   // filled, with what follows, for those that needed() says
  // [m] now, one a vertex of the surface, for those that moved() says; null: they are where their supports put them
  const Vec3* vertices = nullptr;
  Vec3* positions = nullptr;               // [m] one a particle
  const Vec3* velocities = nullptr;        // [m/s]; null: of what does not move
  const double* inverse_masses = nullptr;  // [1/kg] 0: held
  Index particles = 0;
  double friction = 0.5;
  double restitution = 0.0;  // 0..1
  double modulus = 0.0;      // [Pa] E / (1 - nu^2) of relaxed tissue that cells carry; 0: of what has none
  const double* stiffness = nullptr;  // of each particle, times the modulus; null: 1 of all
  PairSearch::Self self = PairSearch::Self::kNo;
  bool obstacle = false;  // friction and position alone
  bool led = false;       // an obstacle that is moved from substep to substep by lead()
  bool moves = true;      // false: asleep, or an obstacle; its arrays are not written
  bool held = false;      // some of its particles are
  bool grasped = false;   // a spring pulls it
};

struct SurfaceScene {
  std::optional<double> ground;  // [m] height along z
  double ground_friction = 0.5;
  double gravity = 0.0;  // [m/s^2]
  struct Sphere {
    Vec3 centre = Vec3::Zero(), way = Vec3::Zero();  // [m] at the start of the frame, and in it
    double radius = 0.0;                             // [m]
  };
  std::optional<Sphere> sphere;
  double h = 0.0;        // [s] of the frame
  bool surfaces = true;  // bodies meet each other and obstacles by their surfaces; false: in the given rows alone
  struct Given {
    Index a = 0, b = 0;  // colliders
    RowSet set;
  };
  std::vector<Given> given;
  struct Join {  // fibres between two colliders, or of one and what does not move
    Index a = 0, b = kNoIndex;
  };
  std::vector<Join> joins;
};

constexpr double kSkin = 0.01;  // of the mean edge: surfaces rest so far above each other

class SurfaceContacts {
 public:
  /// Which pairs can touch: sets needed(). Once a frame, and again where some have woken.
  void findPairs(const SurfaceScene& scene, const std::vector<Collider>& colliders, ContactCounters& counters);
  /// One a collider: kNear where something is near, 1 where a spring or the body itself alone needs it.
  static constexpr char kNear = 2;
  const std::vector<char>& needed() const { return needed_; }
  /// Whose rows are to be found anew, since somebody has moved: sets moved().
  void findMoved(const SurfaceScene& scene, const std::vector<Collider>& colliders);
  const std::vector<char>& moved() const { return moved_; }
  /// Rows of the frame, and islands.
  void find(const SurfaceScene& scene, const std::vector<Collider>& colliders, ContactCounters& counters,
            const ForEach& for_each = oneAfterAnother);
  /// Colliders that sleep and are reached by one that moves; ascending.
  const std::vector<Index>& reached() const { return reached_; }

  struct Island {
    std::vector<Index> bodies;
    std::vector<Index> led;  // that these may meet, and no other island does
    std::vector<SolverRows> rows;
    bool held = false;    // some of it, or by others
    bool joined = false;  // by fibres
  };
  /// Each collider that moves is in one; in the order of their first bodies.
  const std::vector<Island>& islands() const { return islands_; }

  /// Of the answer of a collider to rows and springs in this frame, the part 0..1 that moves it as a rigid body, and
  /// one that is held not at all. None where it is not said.
  void setRigidShare(Index collider, double share);
  /// Keys of those that press on a collider, and of those that sleep, as they did last.
  std::vector<std::uint64_t> loadedBy(std::uint64_t key) const;
  /// Where what is led is [m] before and after the next substep, one a vertex.
  void lead(Index collider, const Points& before, const Points& now);
  /// Of a row that bears load, what is on one side of it.
  struct RowSide {
    Index collider = 0;
    const RowEntry *begin = nullptr, *end = nullptr;
  };
  /// visit(row, side of what is led, side of what it presses, [kg] the mass of this): after solveIsland().
  template <class Visit>
  void eachOnLed(Index island, Index collider, const Visit& visit) const {
    for (const SolverRows& rows : islands_[island].rows) {
      if ((rows.a != collider && rows.b != collider) || rows.b == kNoIndex) continue;
      const RowEntry* const entries = rows.set->entries.data();
      for (const ContactRow& row : rows.set->rows) {
        if (row.impulse.isZero(0.0)) continue;
        RowSide led{rows.a, entries + row.begin, entries + row.middle};
        RowSide other{rows.b, entries + row.middle, entries + row.end};
        if (rows.b == collider) std::swap(led, other);
        double answer = 0.0;  // [1/kg]
        for (const RowEntry* at = other.begin; at != other.end; ++at)
          answer += at->coefficient * at->coefficient * solver_bodies_[other.collider].now[at->particle].inverse_mass;
        visit(row, led, other, answer > 0.0 ? 1.0 / answer : 0.0);
      }
    }
  }
  /// After the bodies of an island have moved by a substep, the number-th of the frame. previous: [m] at its start, one
  /// a particle of each body of the island. step.warm and step.number are set here. colliders: as find() got them.
  void solveIsland(Index island, SolverStep step, int number, const std::vector<Collider>& colliders,
                   const std::vector<Vec3*>& previous, std::vector<SpringRow>& springs, std::vector<FibreRow>& fibres,
                   SolverScratch& scratch, SolverCounters& counters, const ForEach& for_each = oneAfterAnother);
  /// [kg m] that the push sphere gave the bodies of an island in the last substep.
  Vec3 sphereImpulse(Index island) const;
  /// visit(collider, entry, row, unit normal out of what it presses on): of rows of an island that press.
  template <class Visit>
  void eachPressed(Index island, const Visit& visit) const {
    for (const SolverRows& rows : islands_[island].rows)
      for (const ContactRow& row : rows.set->rows) {
        if (!(row.normal.dot(row.impulse) > 0.0)) continue;
        for (Index k = row.begin; k < row.middle; ++k) visit(rows.a, rows.set->entries[k], row, row.normal);
        for (Index k = row.middle; k < row.end; ++k) visit(rows.b, rows.set->entries[k], row, Vec3(-row.normal));
      }
  }
  /// One a collider: whether the sphere presses on it.
  void pushedBySphere(std::vector<char>& pushed) const;
  /// Impulses of the last substep of h [s] become forces.
  void finishIsland(Index island, double h);

  /// Pairs that press on each other, the lower number first; the second is kNoIndex for the ground.
  void loadedSurfaces(std::vector<std::pair<Index, Index>>& pairs) const;
  struct Point {
    Index on = 0;                     // never an obstacle where the other is a body
    Index by = kNoIndex;              // kNoIndex: the ground, or the sphere
    bool by_sphere = false;
    Vec3 position, normal;            // [m]; unit, out of what presses
    Vec3 force;                       // [N] on it, with friction
  };
  void points(const std::vector<Collider>& colliders, std::vector<Point>& points) const;

  SurfaceMemory memory() const;
  void recall(const SurfaceMemory& memory);
  void clear();
  /// Of a collider alone, whose surface is another from now on.
  void forget(std::uint64_t key);
  std::size_t bytes() const;

 private:
  using Kind = KeptPair::Kind;
  struct Pair : KeptPair {
    Index a = 0, b = kNoIndex;  // colliders of this frame
    bool stale = true, near = false;
    FineAnswer fine;
    std::size_t queried = 0;  // points, when it was found last
  };
  using PairName = std::tuple<std::uint64_t, std::uint64_t, Kind>;
  Pair& pairOf(Kind kind, const std::vector<Collider>& colliders, Index a, Index b, std::uint64_t key_b);
  Index colliderOf(std::uint64_t key) const;  // kNoIndex: none
  void findPair(const SurfaceScene& scene, const std::vector<Collider>& colliders, Pair& pair);
  void makeRows(const SurfaceScene& scene, const std::vector<Collider>& colliders,
                const std::vector<FeaturePair>& found, Pair& pair) const;
  void listReached(const SurfaceScene& scene, const std::vector<Collider>& colliders);
  void joinIslands(const SurfaceScene& scene, const std::vector<Collider>& colliders);
  void fillSlots(const std::vector<Collider>& colliders);

  BroadPhase broad_phase_;
  std::vector<Box> boxes_;
  std::vector<char> active_, needed_, moved_;
  std::vector<std::pair<std::uint64_t, Index>> numbers_;  // of colliders by their keys, ascending
  std::map<PairName, std::unique_ptr<Pair>> known_;
  std::map<std::uint64_t, KeptWay> ways_;
  std::vector<WayBox> gone_, ahead_;     // one a collider: its way, and what it goes in this frame
  std::vector<Points> velocities_;       // [m/s] one a collider, of its vertices
  std::vector<Pair*> pairs_;             // of this frame
  std::vector<SurfaceFrame> frames_;     // one a collider; filled where moved_
  std::vector<std::uint64_t> frame_of_;  // key of the obstacle whose frame stays
  std::vector<Index> reached_;
  std::vector<std::size_t> first_slots_;  // one a collider
  std::vector<Slot> now_, before_;
  std::vector<SolverBody> solver_bodies_;
  std::vector<Island> islands_;
  UnionFind joined_;
  std::vector<Index> island_of_;  // one a collider
};

}  // namespace meshless
