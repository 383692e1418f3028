// Contact of deformable surfaces in present space (docs/method.md, Contact): finds rows once a frame, groups what they
// join into islands, and solves each island's rows in each substep. Knows neither materials nor tools.
#pragma once

#include <optional>

#include "meshless_surgery/base/for_each.h"
#include "meshless_surgery/contact/broad_phase.h"
#include "meshless_surgery/contact/contact_memory.h"
#include "meshless_surgery/contact/deformable.h"
#include "meshless_surgery/contact/motion_limit.h"
#include "meshless_surgery/contact/row_solver.h"

namespace meshless {

/// A body or an obstacle as contact sees it in a frame. Whoever fills it keeps what it points to alive.
struct Collider {
  std::uint64_t key = 0;                    // of the body for as long as it lives
  Box bounds;                               // [m] swept in the frame; empty: it meets nothing
  double edge_length = 0.0;                 // [m] mean
  const ContactSurface* surface = nullptr;  // filled, with what follows, for those that findPairs() calls needed
  const Vec3* vertices = nullptr;           // [m] now, one a vertex of the surface
  Vec3* positions = nullptr;                // [m] one a particle
  const Vec3* velocities = nullptr;         // [m/s]; null: of an obstacle
  const double* inverse_masses = nullptr;   // [1/kg] 0: held
  Index particles = 0;
  const RigidGroups* groups = nullptr;  // where part of the answer is rigid
  double rigid_share = 0.0;             // 0..1
  double friction = 0.5;
  double restitution = 0.0;  // 0..1
  PairSearch::Self self = PairSearch::Self::kNo;
  bool obstacle = false;  // friction and position alone
  bool moves = true;      // false: asleep, or an obstacle; its arrays are not written
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
  bool between_bodies = true;  // false: ground and sphere alone
  double h = 0.0;              // [s] of the frame
};

/// Two bodies that press on each other; b is kNoIndex for the ground, or the number of an obstacle.
struct LoadedSurfaces {
  Index a = 0, b = kNoIndex;
};

class SurfaceContacts {
 public:
  /// Before the first find() of a frame: rows of the last one become memory.
  void begin(const std::vector<Collider>& colliders);
  /// Which pairs can touch; sets needed().
  void findPairs(const SurfaceScene& scene, const std::vector<Collider>& colliders, ContactCounters& counters);
  const std::vector<char>& needed() const { return needed_; }
  /// Rows of the frame, and islands. May be called again after some have woken.
  void find(const SurfaceScene& scene, const std::vector<Collider>& colliders, ContactCounters& counters,
            const ForEach& for_each = oneAfterAnother);
  /// Colliders that sleep and are reached by one that moves; ascending.
  const std::vector<Index>& reached() const { return reached_; }

  struct Island {
    std::vector<Index> bodies, rows;
    bool free = true;        // nothing that does not move is met
    double tolerance = 0.0;  // [m] of its solver
    MotionLimit limit;
  };
  /// Each collider that moves is in one; in the order of their first bodies.
  const std::vector<Island>& islands() const { return islands_; }

  /// Before the first substep of an island: lets out its old overlap, and begins to watch what is apart.
  std::size_t beginIsland(Index island, SolverScratch& scratch);
  /// After the bodies of an island have moved by a substep. first: of the frame.
  void solveIsland(Index island, SolverStep step, bool first, std::vector<SpringRow>& springs, SolverScratch& scratch,
                   SolverCounters& counters);
  /// Impulses of the last substep of h [s] become forces.
  void finishIsland(Index island, double h);
  /// [m] at the start of the substep, one a particle of the collider.
  void setPrevious(Index collider, const Vec3* previous) {
    solver_bodies_[collider].previous = limited_[collider].previous = previous;
  }

  /// Rows of the frame; impulses are forces [N] after finishIsland().
  const std::vector<ContactRow>& rows() const { return set_.rows; }
  void loadedSurfaces(std::vector<LoadedSurfaces>& pairs) const;
  struct Point {
    Vec3 position, normal;
    double force;  // [N]
  };
  void points(const std::vector<Collider>& colliders, std::vector<Point>& points) const;

  ContactMemory memory() const;
  void recall(ContactMemory memory);
  void clear();
  /// Of a collider alone, whose surface is another from now on.
  void forget(std::uint64_t key);
  std::size_t bytes() const;

 private:
  struct Task {
    enum class Kind : char { kVertexFace, kEdgeEdge, kGround, kSphere } kind;
    Index a, b;
    Index near = 0, begin = 0, end = 0;  // which of the lists of vertices, and the part of it
  };
  struct Found {
    FoundFeatures features;
    RowSet rows;
    std::size_t looked = 0;
  };
  PairSearch searchOf(const SurfaceScene& scene, const std::vector<Collider>& colliders, Index a, Index b,
                      std::vector<RememberedSide>& remembered) const;
  void listTasks(const SurfaceScene& scene, const std::vector<Collider>& colliders, const ForEach& for_each);
  void placeFrames(const SurfaceScene& scene, const std::vector<Collider>& colliders, const ForEach& for_each);
  void findTask(const SurfaceScene& scene, const std::vector<Collider>& colliders, const Task& task,
                Found& found) const;
  void makeRows(const SurfaceScene& scene, const std::vector<Collider>& colliders, const Task& task,
                Found& found) const;
  void joinIslands(const std::vector<Collider>& colliders);
  double approach(const std::vector<Collider>& colliders, const ContactRow& row) const;

  BroadPhase broad_phase_;
  std::vector<std::array<Index, 2>> near_;  // pairs of colliders
  std::vector<char> needed_;
  std::vector<SurfaceFrame> frames_;     // one a collider; filled where needed
  std::vector<std::uint64_t> frame_of_;  // key of the obstacle whose frame stays
  std::vector<Task> tasks_;
  std::vector<Found> found_;
  std::vector<std::array<Index, 2>> looking_;      // a and b of each list of vertices
  std::vector<std::vector<Index>> near_vertices_;  // of a that b is near
  std::vector<Index> reached_;
  RowSet set_;
  double frame_h_ = 0.0;               // [s]
  std::vector<std::uint64_t> moving_;  // keys, ascending: of this frame
  std::vector<double> lengths_;        // [m] mean edges
  std::vector<SolverBody> solver_bodies_;
  std::vector<LimitedBody> limited_;
  std::vector<Island> islands_;
  ContactMemory memory_;                    // of the last frame
  std::vector<ContactMemory::Side> sides_;  // of this one
};

}  // namespace meshless
