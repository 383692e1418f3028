// Elasticity of hexahedral cells that are filled in part: Young's modulus and Poisson's ratio by one integration point
// at the centroid of what fills a cell, and by how strain varies across the cell, as in plates.
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
  Vec3 fibre = Vec3::Zero();  // unit, along which its fibres lie at rest; zero: it has none
};

struct ElasticCells {
  double half_edge = 0.0;  // [m]
  std::vector<ElasticCell> cells;
  std::vector<double> masses;  // [kg] of each particle, > 0; any split of the cells' masses conserves momentum
};

/// Acceleration of every particle [m/s^2] at the positions y: less the gradient of elasticEnergy() over its mass. A
/// cell of volume V = mass / density holds, with the constants of its mix,
///   V [mu |F - R|^2 + lambda U(J)] + V mu sum_k var_k [e_k : e_k + q tr(e_k)^2] + V mu min(var) |a_xyz|^2.
/// F is the trilinear map's gradient at the centroid, R its rotation; U and what bounds it are those of
/// elasticAccelerations() in elastic.h. e_k (2x2) is how the strain along the two other axes varies along axis k, by
/// the coefficients of the map's products of two coordinates about the centroid, measured along the columns of F over
/// |F|/sqrt(3); with q = lambda / (lambda + 2 mu) it costs what it costs a plate. No shear across it is counted twice:
/// thin plates do not lock (MITC4: Dvorkin and Bathe 1984). The last term holds the product of all three. Fibres along a
/// add V k/2 W((|F a| - 1)^2) where |F a| > 1, W as in elastic.h, and nothing to bending within a cell. Conserves
/// linear and angular momentum to rounding. poses, one a cell: the rotation is read (where the search starts) and
/// written, as centre (the centroid [m]) and deformation (F) are. swelling: strain is that of F / swelling. plastic:
/// one a cell; null or empty where nothing has flowed. relaxed: one a cell where the material relaxes, with the part of
/// material.relaxation in the energy; they go on by its step. Returns how much faster than at rest the highest
/// frequency may be, as in elastic.h.
double elasticAccelerations(const ElasticCells& cells, const ElasticParameters& material, const Points& y,
                            std::vector<ClusterPose>& poses, Points& accelerations, MatchCounters& counters,
                            double swelling = 1.0, const std::vector<PlasticShape>* plastic = nullptr,
                            std::vector<RelaxedStrain>* relaxed = nullptr);

/// How much of the strain still fades: the largest |sum of shares of what branches have still to take on| of a cell
/// over the largest strain of one, or over kLeastStrain.
constexpr double kLeastStrain = 1e-3;
double relaxingShare(const ElasticCells& cells, const RelaxationStep& relaxation, const Points& y,
                     const std::vector<ClusterPose>& poses, const std::vector<RelaxedStrain>& relaxed, double swelling,
                     const std::vector<PlasticShape>& plastic);

/// F of a cell of half_edge [m]: the gradient of its map at its centroid.
Mat3 gradientOf(const ElasticCell& cell, double half_edge, const Points& y);

/// The energy [J] whose gradient that is.
double elasticEnergy(const ElasticCells& cells, const ElasticParameters& material, const Points& y,
                     std::vector<ClusterPose> poses, double swelling = 1.0,
                     const std::vector<PlasticShape>* plastic = nullptr,
                     const std::vector<RelaxedStrain>* relaxed = nullptr);

/// [Pa] First Piola-Kirchhoff stress of each cell at its centroid, without that of bending. poses are written as above.
std::vector<Mat3> cellStresses(const ElasticCells& cells, const ElasticParameters& material, const Points& y,
                               std::vector<ClusterPose>& poses, double swelling = 1.0,
                               const std::vector<PlasticShape>* plastic = nullptr,
                               const std::vector<RelaxedStrain>* relaxed = nullptr);

/// Highest angular frequency [rad/s] of the linearised body at rest, from below: by Lanczos' method, within a percent.
/// 0 where there are no cells.
double highestFrequency(const ElasticCells& cells, const ElasticParameters& material);

}  // namespace meshless
