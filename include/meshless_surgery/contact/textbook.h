// The paper's contact: particles against tetrahedra (Teschner et al. 2003, who find them by a spatial hash; here it is
// the tree of boxes that all contact has), consistent penetration depth and direction (Heidelberger et al. 2004). What
// it finds goes to the solver of rows. A scene chooses it as `contact: textbook`.
#pragma once

#include "meshless_surgery/contact/contact_rows.h"
#include "meshless_surgery/contact/deformable.h"

namespace meshless {

/// A particle of body `a` inside body `b`.
struct Penetration {
  Index body_a = 0, particle = 0;
  Index body_b = 0, tetrahedron = 0;
  std::array<double, 4> weights{};  // barycentric in the tetrahedron
  double depth = 0.0;               // [m] >= 0
  Vec3 direction = Vec3::Zero();    // unit: where the particle must go to get out
};

/// Finds every penetration between different bodies whose bounds overlap; ordered by body and particle.
std::vector<Penetration> findPenetrations(const std::vector<ContactBody>& bodies, ContactCounters& counters);

/// Appends the row of a penetration: the particle of a against the point of b in which it is.
void addRow(const Penetration& penetration, const std::vector<ContactBody>& bodies, double friction, RowSet& set);

}  // namespace meshless
