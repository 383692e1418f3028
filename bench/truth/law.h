// The material law that the truth and the deformer share: compressible fixed-corotated elasticity.
//   psi(F) = mu |F - R|^2 + lambda/2 (J - 1)^2,   P = 2 mu (F - R) + lambda (J - 1) cof F
// R is the rotation of F's polar decomposition, never a reflection (Stomakhin et al. 2012).
#pragma once

#include <Eigen/Dense>

namespace meshless::truth {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Mat9 = Eigen::Matrix<double, 9, 9>;

struct Material {
  double youngs_modulus = 0.0;  // [Pa]
  double poissons_ratio = 0.0;

  double mu() const { return youngs_modulus / (2.0 * (1.0 + poissons_ratio)); }
  double lambda() const {
    return youngs_modulus * poissons_ratio / ((1.0 + poissons_ratio) * (1.0 - 2.0 * poissons_ratio));
  }
};

struct Response {
  double energy = 0.0;  // [J/m^3] of rest volume
  Mat3 stress;          // [Pa] first Piola-Kirchhoff
  Mat9 tangent;         // [Pa] d stress / d F, both stacked by columns; filled on request
};

Response fixedCorotated(const Material& material, const Mat3& deformation_gradient, bool with_tangent);

/// The stretch along x of a bar pulled with the dead traction `traction` [Pa] whose sides are free.
double uniaxialStretch(const Material& material, double traction);

}  // namespace meshless::truth
