// Which tissue a pick holds.
#pragma once

#include "meshless_surgery/tools/tools.h"

namespace meshless {

/// Makes the pick hold `point` [m], which is at or beside the particle `centre`: fills particle, patch, weights and
/// position. The patch are the particles within `radius` [m] of `centre`, shares falling to zero at the radius and
/// proportional to mass: one particle alone would be pulled out of the tissue as a spike. Then shares change linearly
/// with the place, the farthest below zero, until the mean is the point: it goes with the tissue at the point however
/// that turns and stretches, and a force on it turns the body as one at the point does. In directions in which the patch
/// does not reach (a single particle: all) the mean stays where it is. Distances are straight where the way along the
/// body is no longer than links of a cubic lattice make it, else that way over sqrt(3). Fixed particles are held by
/// nothing else than what fixes them, but where there are no others: in place of a fixed centre its nearest free one is
/// held.
void makeGrasp(const BodyModel& model, const Points& positions, Index centre, double radius, const Vec3& point,
               Pick& pick);

/// Where a particle of a body of cells is: in that of its cells whose tissue is nearest. Nowhere in other bodies.
TissuePlace placeOf(const BodyModel& model, Index particle);

/// Weighted mean of the patch [m]: where the tissue is that it holds.
Vec3 graspMean(const Pick& pick, const Points& positions);

/// Of the mean of what the grasp holds [1/kg]; 0 where all of it is fixed.
double graspInverseMass(const BodyModel& model, const Pick& pick);

/// The stiffness [N/m] with which the grasp answers within `h` [s], as an implicit spring does: its own where the patch
/// is heavy or fixed, less where it gives way.
double graspStiffness(const BodyModel& model, const Pick& pick, double h);

/// First hit of a ray with a surface; direction need not be unit length.
struct RayHit {
  bool hit = false;
  double distance = 0.0;  // [m]
  Index triangle = 0;
  Vec3 point = Vec3::Zero();
};
RayHit castRay(const Points& vertices, const std::vector<Triangle>& triangles, const Vec3& origin,
               const Vec3& direction);

}  // namespace meshless
