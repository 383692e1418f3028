// Groups of particles that answer a contact partly as rigid bodies: the clusters of an appearance material, which pulls
// them back to rigid shapes within a frame.
#pragma once

#include <functional>

#include "meshless_surgery/base/bytes.h"
#include "meshless_surgery/base/types.h"

namespace meshless {

struct RigidGroups {
  /// Compressed rows of members with weights that add up to 1 over the groups of a particle; masses [kg] > 0 of
  /// particles.
  RigidGroups(const std::vector<Index>& group_offsets, const std::vector<Index>& group_members,
              const std::vector<double>& group_weights, const std::vector<double>& particle_masses);

  std::vector<Index> offsets, members;
  std::vector<double> weights;
  std::vector<double> masses;                 // [kg] of particles
  std::vector<Index> groups;                  // of members
  std::vector<Index> of_offsets, of_members;  // of each particle: which members it is, compressed rows

  Index size() const { return static_cast<Index>(offsets.size() - 1); }
  std::size_t bytes() const {
    return sizeof *this + bytesOf(offsets, members, weights, masses, groups, of_offsets, of_members);
  }
};

/// How a group has been moved in a substep, about its centre at the substep's start.
struct GroupMotion {
  bool current = false;                 // mass, centre and inverse_inertia are of this substep
  double inverse_mass = 0.0;            // [1/kg]
  Vec3 centre = Vec3::Zero();           // [m]
  Mat3 inverse_inertia = Mat3::Zero();  // [1/(kg m^2)]; no turn about an axis with nothing beside it
  Vec3 shift = Vec3::Zero();            // [m]
  Vec3 turn = Vec3::Zero();             // [rad]
};

/// Centre and inertia for positions [m], without motion yet.
GroupMotion groupAt(const RigidGroups& groups, Index group, const std::function<Vec3(Index particle)>& position);

/// Mass, centre and inertia of points, added up about one of them.
class MassMoments {
 public:
  explicit MassMoments(const Vec3& about) : about_(about) {}
  void add(double mass, const Vec3& place) {
    const Vec3 arm = place - about_;
    mass_ += mass;
    sum_ += mass * arm;
    moment_ += mass * arm * arm.transpose();
  }
  double mass() const { return mass_; }
  Vec3 centre() const { return about_ + sum_ / mass_; }
  Vec3 fromCentre(const Vec3& place) const { return place - about_ - sum_ / mass_; }
  /// Of the inertia about the centre; directions below 1e-12 of the largest stay 0.
  Mat3 inverseInertia() const;

 private:
  const Vec3 about_;            // [m]
  double mass_ = 0.0;           // [kg]
  Vec3 sum_ = Vec3::Zero();     // [kg m]
  Mat3 moment_ = Mat3::Zero();  // [kg m^2]
};

}  // namespace meshless
