// Elasticity with Young's modulus and Poisson's ratio on the moments of shape matching: elastic materials.
#pragma once

#include <array>

#include "meshless_surgery/dynamics/material.h"
#include "meshless_surgery/dynamics/shape_matching.h"

namespace meshless {

/// Strains that the branches of a relaxation have taken on: symmetric, without trace; xx yy zz xy yz zx.
struct RelaxedStrain {
  std::array<std::array<double, 6>, kMostRelaxations> of{};
};

/// A relaxation in a step of h [s].
struct RelaxationStep {
  int branches = 0;
  std::array<double, kMostRelaxations> shares{};
  std::array<double, kMostRelaxations> taken{};  // 1 - exp(-h / time)
  double all = 0.0;                              // of shares
};
RelaxationStep relaxationStep(const std::vector<Relaxation>& relaxation, double h);

/// Lame's constants of an isotropic material, its density, and how its stress grows beyond small strain.
struct ElasticParameters {
  double mu = 0.0;          // [Pa]
  double lambda = 0.0;      // [Pa]
  double youngs = 0.0;      // [Pa]
  double density = 0.0;     // [kg/m^3]
  double stiffening = 0.0;  // >= 0, see elasticAccelerations()
  double asymmetry = 0.0;   // likewise, any sign
  RelaxationStep relaxation;
  double fibres = 0.0;             // [Pa] of cells that have a direction of fibres
  double fibre_stiffening = 0.0;   // >= 0

  bool stiffens() const { return stiffening != 0.0 || asymmetry != 0.0; }
};
/// Needs youngs_modulus > 0 [Pa], -1 < poissons_ratio < 0.5, density > 0 [kg/m^3].
ElasticParameters elasticParameters(double youngs_modulus, double poissons_ratio, double density);

/// What a cell is made of where it is not, or not all, of the body's material: constants are means by volume.
struct ElasticMix {
  double own = 1.0;                             // 0..1, share of the body's material
  double mu = 0.0, lambda = 0.0, youngs = 0.0;  // what others add to it, over the Young's modulus of the body's
  double stiffening = 0.0, asymmetry = 0.0;     // what others add to it

  bool isOwn() const { return own == 1.0 && mu == 0.0 && lambda == 0.0 && youngs == 0.0 && !stiffens(); }
  bool stiffens() const { return stiffening != 0.0 || asymmetry != 0.0; }
  ElasticParameters of(const ElasticParameters& body) const {
    return {own * body.mu + mu * body.youngs,
            own * body.lambda + lambda * body.youngs,
            (own + youngs) * body.youngs,
            body.density,
            own * body.stiffening + stiffening,
            own * body.asymmetry + asymmetry,
            body.relaxation,
            own * body.fibres,
            body.fibre_stiffening};
  }
};

/// Of a cluster's rest shape, in addition to ClusterRest.
struct ElasticRest {
  Mat3 spread_inverse = Mat3::Zero();  // [1/m^2] (sum m q q^T / M)^-1
  double spread = 0.0;                 // [m^2] trace(sum m q q^T / M) / 3
};
std::vector<ElasticRest> makeElasticRest(const RestShape& shape);

/// Acceleration of every particle [m/s^2] at the positions y: the weighted mean over its clusters of
///   -(1/rho) P(F) (sum m q q^T / M)^-1 q - k E / (rho s^2) (p - F q),  P = 2 mu (F - R) + lambda g(J) cof F
/// with F = A_pq (sum m q q^T)^-1 and R its rotation. g(J) = J - 1, but falls as J^(-2/3) above J = 1.5 and stays as it
/// is below -0.8: what is torn or turned inside out is drawn back with a bounded stress. Where |F|^2 is above 12 (3 at
/// rest), J is replaced by J s(|F|^2), which stays bounded: a needle would stiffen without end.
/// Where stiffening b or asymmetry a are not 0, 2 mu (F - R) is the gradient of mu W(q) instead of that of mu |F -
/// R|^2:
///   q = |e|^2 - a tr(d^3) u + a^2 |d|^4 u^2 / 4,  u = (1 + a^2 |d|^2 / 40)^(-1/2),
///   W'(q) = 1 + b q / (1 + b q / 9),  e = R^T F - I the strain, d its deviator.
/// q is convex in e for every a: tissue that stiffens where it is pressed (a > 0) yields where it is pulled, and never
/// gives way. W is Fung's exponential exp(b q) / b to the second order, with a slope of at most 10. Both leave Young's
/// modulus and Poisson's ratio of small strain as they are.
/// All of it is the gradient of an energy, conserves linear and angular momentum, and does not change with resolution.
/// Clusters whose points do not span space resist as a rigid match would, with E/(rho s^2). poses is read (last
/// rotation) and written. With cells of 2x2x2 particles it is the hexahedron with one integration point, k its
/// hourglass stiffness. Returns how much faster than at rest the body's highest frequency may be, at least 1: the root
/// of the largest (|dJ/dF|^2 + |g| |F|) / 3 of a cluster, never above 5; of what stiffens also of the most that its
/// stress may grow by strain, over that at rest.
double elasticAccelerations(const MatchInput& input, const std::vector<ElasticRest>& elastic,
                            const ElasticParameters& material, const Points& y, std::vector<ClusterPose>& poses,
                            Points& accelerations, MatchCounters& counters, double swelling = 1.0);

/// The energy [J] whose gradient that is.
double elasticEnergy(const MatchInput& input, const std::vector<ElasticRest>& elastic,
                     const ElasticParameters& material, const Points& y, std::vector<ClusterPose> poses);

/// Highest angular frequency [rad/s] of the linearised body at rest, by power iteration (from below, within a percent).
double highestFrequency(const MatchInput& input, const std::vector<ElasticRest>& elastic,
                        const ElasticParameters& material);

}  // namespace meshless
