// Elasticity of hexahedral cells that are filled in part: Young's modulus and Poisson's ratio by one integration point
// at the centroid of what fills a cell, and a stiffness against the modes that this point does not see.
#pragma once

#include <array>

#include "meshless_surgery/dynamics/elastic.h"

namespace meshless {

/// A cube of the lattice; several may lie at the same place and share some of their corners (virtual nodes: Molino et
/// al. 2004). Coordinates in a cell go from -1 to 1.
struct ElasticCell {
  std::array<Index, 8> corners{};             // particles; bits 0, 1, 2 of the position: upper end along x, y, z
  double mass = 0.0;                          // [kg] of the filled part, were it all of the body's material
  Vec3 centroid = Vec3::Zero();               // of it, within -0.9..0.9
  Vec3 variance = Vec3::Constant(1.0 / 3.0);  // of it about its centroid, > 0; 1/3 is that of a whole cell
  ElasticMix mix;
};

struct ElasticCells {
  double half_edge = 0.0;  // [m]
  std::vector<ElasticCell> cells;
  std::vector<double> masses;  // [kg] of each particle, > 0; any split of the cells' masses conserves momentum
};

/// Acceleration of every particle [m/s^2] at the positions y: less the gradient of elasticEnergy() over its mass. A
/// cell of volume V = mass / density holds, with the constants of its mix,
///   V [mu |F - R|^2 + lambda U(J)] + V/2 sum k_m |a_m|^2 / half_edge^2.
/// F is the trilinear map's gradient at the centroid, R its rotation; U and what bounds it are those of
/// elasticAccelerations() in elastic.h. a_m are the coefficients of the map's products of two or three coordinates,
/// taken from the centroid: hourglass modes, with k_xy = 0.9 E min(var_x, var_y), likewise yz and zx, and k_xyz = 0.9 E
/// min(var_x, var_y, var_z): 0.3 E in a whole cell. Conserves linear and angular momentum to rounding. poses, one a
/// cell: the rotation is read (where the search starts) and written, as centre (the centroid [m]) and deformation (F)
/// are. swelling: strain is that of F / swelling. plastic: one a cell; null or empty where nothing has flowed. Returns
/// how much faster than at rest the highest frequency may be, as in elastic.h.
double elasticAccelerations(const ElasticCells& cells, const ElasticParameters& material, const Points& y,
                            std::vector<ClusterPose>& poses, Points& accelerations, MatchCounters& counters,
                            double swelling = 1.0, const std::vector<PlasticShape>* plastic = nullptr);

/// The energy [J] whose gradient that is.
double elasticEnergy(const ElasticCells& cells, const ElasticParameters& material, const Points& y,
                     std::vector<ClusterPose> poses, double swelling = 1.0,
                     const std::vector<PlasticShape>* plastic = nullptr);

/// Highest angular frequency [rad/s] of the linearised body at rest, from below: by Lanczos' method, within a percent.
/// 0 where there are no cells.
double highestFrequency(const ElasticCells& cells, const ElasticParameters& material);

}  // namespace meshless
