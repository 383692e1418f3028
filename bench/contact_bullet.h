// Bullet's soft bodies on the pile of bench_contact.
#pragma once

#include <memory>

#include "contact_pile.h"

namespace meshless::bench {

/// kLinks: pose matching plus links along the edges of the tetrahedra, vertices against faces (VF_SS).
/// kCluster: pose matching and one cluster a body, cluster against cluster (CL_SS).
enum class BulletWay { kLinks, kCluster };

class BulletPile {
 public:
  BulletPile(const PileOptions& options, BulletWay way);
  ~BulletPile();
  BulletPile(const BulletPile&) = delete;
  BulletPile& operator=(const BulletPile&) = delete;

  /// One frame of 1/60 s in options.substeps steps.
  void step();
  std::vector<Points> positions() const;
  /// Pairs of a node and what it touches, in the last substep; of clusters, joints.
  std::size_t contacts() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace meshless::bench
