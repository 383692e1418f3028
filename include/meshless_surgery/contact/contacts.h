// Contact of deformable bodies with each other, with obstacles and with the ground: found in their rest shapes, solved
// as projections with friction. Knows neither materials nor tools; the world says where bodies are.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>

#include "meshless_surgery/base/for_each.h"
#include "meshless_surgery/contact/broad_phase.h"
#include "meshless_surgery/contact/contact_shape.h"
#include "meshless_surgery/contact/deformable.h"
#include "meshless_surgery/contact/quadratic_map.h"
#include "meshless_surgery/contact/self_contact.h"

namespace meshless {

/// The affine map of a cluster between rest shape and present: present = from_rest (r - rest) + centre.
struct ContactMap {
  Mat3 from_rest = Mat3::Identity();
  Mat3 to_rest = Mat3::Identity();
  Vec3 rest = Vec3::Zero();                 // [m]
  Vec3 centre = Vec3::Zero();               // [m]
  bool flipped = false;                     // it turns what it maps inside out
  const QuadraticMap* quadratic = nullptr;  // where the cluster bends: the better map, to which this is the start
};

/// A collider (a body or an obstacle) as contact in rest shapes sees it in a frame. Whoever fills it keeps what it
/// points to alive. Contact of surfaces has a Collider of its own (contact/surface_contacts.h).
struct ShapeCollider {
  std::uint64_t key = 0;                   // of the body for as long as it lives
  const ContactShape* shape = nullptr;     // filled by the time make() is called
  Vec3* positions = nullptr;               // [m] one a particle: read and moved
  const Vec3* previous = nullptr;          // [m] at the start of the substep
  const double* masses = nullptr;          // [kg]
  const double* inverse_masses = nullptr;  // [1/kg] 0: held
  Index particles = 0;
  const Vec3* surface = nullptr;     // [m] present vertices; null where all are particles
  const ContactMap* maps = nullptr;  // at the start of the frame; filled by the time make() is called
  Index map_count = 0;
  double mass = 0.0;         // [kg]
  double rigid_share = 0.0;  // 0..1 of an impulse that moves the body as a whole; 0 where it is held
  double friction = 0.5;
  double restitution = 0.0;      // 0..1
  Box bounds;                    // [m] of the particles (and vertices) now
  Vec3 velocity = Vec3::Zero();  // [m/s] about the middle of its particles' velocities
  double spread = 0.0;           // [m/s] by which they differ from it at most
  bool meets_itself = false;
  const SelfContactSet* self = nullptr;  // where it meets itself; filled by the time make() is called
  bool moves = true;                     // false: asleep, or an obstacle; its arrays are not written
};

struct ContactScene {
  std::optional<double> ground;  // [m] height along z
  double ground_friction = 0.5;
  Vec3 gravity = Vec3::Zero();  // [m/s^2]
  double substep = 0.0;         // [s] of begin()
};

/// Brings a collider's maps, and its surface where it has one, up to date with its particles.
using RefitMaps = std::function<void(Index collider, std::vector<ContactMap>& maps)>;

/// Two colliders that press on each other; b is kNoIndex for the ground.
struct LoadedPair {
  Index a = 0, b = kNoIndex;
};

class ContactsMemory;

/// Kept between steps: scratch, and what a contact has to remember. The order of colliders is that of the bodies.
class Contacts {
 public:
  Contacts();
  ~Contacts();
  Contacts(Contacts&&) noexcept;
  Contacts& operator=(Contacts&&) noexcept;

  /// Which pairs can touch within the frame of h [s]; sets needed() for the colliders that need shape, maps and
  /// surface.
  void findPairs(const ContactScene& scene, const std::vector<ShapeCollider>& colliders, double h,
                 ContactCounters& counters);
  const std::vector<char>& needed() const;

  /// Finds the contacts of the frame. A body inside another one is moved out as a whole. Where contacts are not
  /// settled(), old overlap is depenetrated too: at a bounded speed, without a change of velocities.
  void make(const std::vector<ShapeCollider>& colliders, double h, ContactCounters& counters,
            const ForEach& for_each = oneAfterAnother);

  /// Substeps that the frame asks for, as make() found it: tall stacks and fast bodies that are about to meet; 1 where
  /// there are none.
  int neededSubsteps() const;
  /// Substeps that the frame can afford, as make() found it: of a deep heap fewer than stiff materials would have.
  int affordableSubsteps() const;
  /// Removes old overlap where make() has not: either this or depenetrateIslands() has to be called then.
  void depenetrate(const std::vector<ShapeCollider>& colliders, ContactCounters& counters,
                   const ForEach& for_each = oneAfterAnother);
  /// Before the first solve() of a frame, of substeps of so many seconds.
  void begin(const std::vector<ShapeCollider>& colliders, double substep);

  /// Colliders that do not move, have a mass, and were reached in make() by one that moves; ascending.
  const std::vector<Index>& reached() const;

  /// After bodies have moved by a substep: what approached deeper goes back to where it was or to the surface, with
  /// friction. Impulses are equal and opposite.
  void solve(const std::vector<ShapeCollider>& colliders, double substep, const RefitMaps& refit,
             ContactCounters& counters, const ForEach& for_each = oneAfterAnother);

  /// True where the contacts of the frame stay those that make() found. Then islands, which do not know of each other,
  /// may go through all substeps one after the other, by solveIslands() in place of solve().
  bool settled() const;
  /// The colliders of island i are islandColliders()[islandOffsets()[i]] .. [islandOffsets()[i + 1] - 1].
  const std::vector<Index>& islandOffsets() const;
  const std::vector<Index>& islandColliders() const;
  /// After begin(), before the first solveIslands(). The colliders must stay where they are until the last.
  void beginIslands(const std::vector<ShapeCollider>& colliders);
  /// As depenetrate(), for some islands.
  void depenetrateIslands(Index first_island, Index end_island, std::size_t& corrected);
  /// As solve(), for some islands; several threads may each do others. first: of the frame's substeps. Adds to the
  /// contacts that moved something and to those with the ground that carry load.
  void solveIslands(Index first_island, Index end_island, bool first, std::size_t& corrected,
                    std::size_t& ground_loaded);

  /// Pairs that pressed on each other in the last solve(); ascending, without duplicates.
  void loadedPairs(std::vector<LoadedPair>& pairs) const;
  /// Contacts with the ground that carried load in the last solve().
  std::size_t groundLoaded() const;
  /// Points of the last solve() that carry load [m], for display.
  struct Point {
    Vec3 position, normal;
    double impulse;  // [kg m] mass times displacement in the substep
  };
  void points(const std::vector<ShapeCollider>& colliders, std::vector<Point>& points) const;
  /// How deep each contact below the surface was when make() found it, relative to the smaller body's size
  /// (ContactShape::size()).
  const std::vector<double>& depths() const;
  /// Bytes that it holds.
  std::size_t bytes() const;
  /// Forgets what it remembers of pairs.
  void clear();
  /// Of a collider alone, whose surface is another from now on.
  void forget(std::uint64_t key);
  /// After findPairs(), on any thread: does the queries of make() for the pairs with one of the first `fresh`
  /// colliders. Moves nothing. What the colliders point to has to live as long as this.
  void queryAhead(const std::vector<ShapeCollider>& colliders, Index fresh, double h);
  /// From now on make() may take over what these have found by queryAhead(). It does so for pairs of which nothing else
  /// is known and whose colliders are to the bit as they were then. It would find the same itself.
  void expect(std::vector<std::shared_ptr<const Contacts>> ahead);
  /// All that the next frame reads of the ones before, to be given back to contacts of the same colliders
  /// (contact/contacts_memory.h).
  ContactsMemory memory() const;
  void recall(const ContactsMemory& memory);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace meshless
