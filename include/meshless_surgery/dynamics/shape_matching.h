// Shape matching of overlapping clusters (Mueller et al. 2005; docs/method.md says what we do otherwise and why).
#pragma once

#include "meshless_surgery/dynamics/clusters.h"
#include "meshless_surgery/dynamics/material.h"

namespace meshless {

using Vec9 = Eigen::Matrix<double, 9, 1>;
using Mat9 = Eigen::Matrix<double, 9, 9>;
using Mat39 = Eigen::Matrix<double, 3, 9>;

/// Constants of a cluster's rest shape. q = rest - centre; masses are the shared ones, m_i * w_ic.
struct ClusterRest {
  double mass = 0.0;           // [kg]
  Vec3 centre = Vec3::Zero();  // [m]
  double radius = 0.0;         // [m] root of the mean square of |q|
  bool linear_rank = false;    // the points span space: a linear map can be fitted
  bool quadratic_rank = false;
  Mat3 moment_inverse = Mat3::Zero();  // [1/(kg m^2)] (sum m q q^T)^-1 where linear_rank
};

/// Of the centred quadratic basis, in units of the cluster's radius; formed only where a body is quadratic.
struct QuadraticRest {
  Vec9 mean = Vec9::Zero();            // mass mean of (qx qy qz qx^2 qy^2 qz^2 qxqy qyqz qzqx) / radius
  Mat9 moment_inverse = Mat9::Zero();  // [1/kg]
};

struct RestShape {
  std::vector<ClusterRest> clusters;
  std::vector<QuadraticRest> quadratic;  // empty until needed
};

RestShape makeRestShape(const Points& rest, const std::vector<double>& masses, const ClusterSet& clusters);
void addQuadraticRest(const Points& rest, const std::vector<double>& masses, const ClusterSet& clusters,
                      RestShape& shape);

/// Where a cluster is at present. rotation is kept from step to step: it starts the next search and stands in where the
/// rotation is not unique.
struct ClusterPose {
  Vec3 centre = Vec3::Zero();  // [m]
  Quat rotation = Quat::Identity();
  Mat3 deformation = Mat3::Identity();  // F, the best affine fit; the rigid map where the rank does not allow one
};

/// The rest shape that a cluster has taken by plastic flow: q becomes stretch * q. Symmetric, of determinant 1.
struct PlasticShape {
  Mat3 stretch = Mat3::Identity();
  Mat3 inverse = Mat3::Identity();
  double stiffening = 1.0;  // largest eigenvalue of the inverse
};

/// Work counted, so that tests can hold what a scene does not need at zero.
struct MatchCounters {
  std::size_t clusters = 0;
  std::size_t rotations = 0;
  std::size_t cold_rotations = 0;     // the warm start did not verify
  std::size_t linear_fits = 0;
  std::size_t quadratic_moments = 0;
  std::size_t plastic_flows = 0;      // clusters whose rest shape has changed
  std::size_t rank_fallbacks = 0;     // linear -> rigid, quadratic -> linear, rigid -> last rotation

  MatchCounters& operator+=(const MatchCounters& other);
};

struct MatchInput {
  const Points& rest;
  const std::vector<double>& masses;  // [kg]
  const ClusterSet& clusters;
  const RestShape& shape;
  const std::vector<PlasticShape>* plastic = nullptr;  // one a cluster; null or empty: nothing has flowed

  const PlasticShape* plasticShapeOf(Index c) const { return plastic && !plastic->empty() ? &(*plastic)[c] : nullptr; }
};

/// Goal position of every particle for the positions y: the weighted mean of its clusters' goals. poses is read (last
/// rotation) and written. Linear and angular momentum of (goal - y) weighted with the masses are zero to rounding.
/// swelling scales the goals about their centres. deformations: form those of poses even where the mode needs none.
void matchShapes(const MatchInput& input, const Points& y, MatchMode mode, double beta, std::vector<ClusterPose>& poses,
                 Points& goals, MatchCounters& counters, double swelling = 1.0, bool deformations = false);

/// poses for given positions, without goals: after positions were set by hand.
void fitClusters(const MatchInput& input, const Points& positions, std::vector<ClusterPose>& poses);
/// Of some clusters, for what lies beside their points: directions that they hardly span turn with the cluster, since
/// the points' noise would stretch them without bounds.
void fitClusters(const MatchInput& input, const Points& positions, const std::vector<Index>& which,
                 std::vector<ClusterPose>& poses);

}  // namespace meshless
