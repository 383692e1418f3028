// The contacts of a frame, as the finder makes them and the solver moves them.
#pragma once

#include "meshless_surgery/base/for_each.h"
#include "meshless_surgery/contact/contacts.h"

namespace meshless {

/// A share of a particle in a point of a surface.
struct ContactEntry {
  Index particle;
  double weight;
};

/// A point of collider a against a triangle of collider b, or against the ground.
struct Contact {
  Index a = 0, b = kNoIndex;  // kNoIndex: the ground
  Index sample = 0;           // of a; of a body against itself a vertex
  Index triangle = kNoIndex;  // of b
  // direct: all corners are particles, normal and weights follow them
  bool direct = false;
  bool caught = false;   // has passed through: the side is remembered
  bool below = true;     // the surface, when it was made
  bool flipped = false;  // the body is inside out where it is touched
  std::array<Index, 2> point{};
  double share = 0.0;
  std::array<Index, 3> corners{};
  std::array<double, 3> weights{};
  // else: entries [first, split) of a and [split, end) of b; the normal is that of the frame
  Index first = 0, split = 0, end = 0;
  Vec3 offset = Vec3::Zero();  // [m] offsets of embedded vertices from where their carriers have them: of a less of b
  Vec3 normal = Vec3::UnitZ();
  // of the solver
  double answer = 0.0;   // [1/kg] to an impulse, where it is the same in all substeps; 0: it is not, or not known yet
  double impulse = 0.0;  // [kg m]
  Vec3 slip_impulse = Vec3::Zero();
};

/// Contacts and colliders by islands, which do not know of each other.
struct IslandPlan {
  std::vector<Index> contacts, contact_offsets;    // in their order within an island
  std::vector<Index> colliders, collider_offsets;  // those that move
  std::vector<Index> shifts;                       // one a collider: where its particles' shifts begin; kNoIndex: none
  std::vector<int> passes;                         // one an island: sweeps in a substep
  std::vector<char> calm;                          // one an island: hardly turns or deforms within the frame

  Index size() const { return contact_offsets.empty() ? 0 : static_cast<Index>(contact_offsets.size() - 1); }
  void make(const std::vector<ShapeCollider>& colliders, const std::vector<Contact>& contacts);
  std::size_t bytes() const;

 private:
  std::vector<Index> root_, number_, next_, moving_;
};

/// Moves colliders so that what touches does not come nearer.
class ContactSolver {
 public:
  ContactSolver();
  ~ContactSolver();
  ContactSolver(ContactSolver&&) noexcept;
  ContactSolver& operator=(ContactSolver&&) noexcept;

  /// Sweeps back and forth over each island, from the impulses that the contacts had. fresh: contacts, plan or
  /// colliders are others than in the last call; else calm islands keep normals, levers and answers.
  void solve(const ContactScene& scene, const std::vector<ShapeCollider>& colliders, std::vector<Contact>& contacts,
             const std::vector<ContactEntry>& entries, const IslandPlan& plan, bool fresh, const ForEach& for_each,
             ContactCounters& counters);
  /// The same island by island, on any threads, between calls of begin().
  void begin(const ContactScene& scene, const std::vector<ShapeCollider>& colliders,
             const std::vector<ContactEntry>& entries, const IslandPlan& plan);
  void solveIsland(Index island, std::vector<Contact>& contacts, bool fresh, std::size_t& corrected);
  void depenetrateIsland(Index island, std::vector<Contact>& contacts, double h, std::size_t& corrected);
  /// One sweep that removes some of the old overlap, h [s] after the last one. Impulses are left alone.
  void depenetrate(const ContactScene& scene, const std::vector<ShapeCollider>& colliders,
                   std::vector<Contact>& contacts, const std::vector<ContactEntry>& entries, const IslandPlan& plan,
                   double h, const ForEach& for_each, ContactCounters& counters);
  std::size_t bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace meshless
