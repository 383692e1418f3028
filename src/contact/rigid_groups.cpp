#include "meshless_surgery/contact/rigid_groups.h"

#include <Eigen/Eigenvalues>

#include "meshless_surgery/base/compressed_rows.h"

namespace meshless {

RigidGroups::RigidGroups(const std::vector<Index>& group_offsets, const std::vector<Index>& group_members,
                         const std::vector<double>& group_weights, const std::vector<double>& particle_masses)
    : offsets(group_offsets), members(group_members), weights(group_weights), masses(particle_masses) {
  for (Index g = 0; g < size(); ++g) groups.insert(groups.end(), offsets[g + 1] - offsets[g], g);
  const auto each = [this](const auto& visit) {
    for (Index k = 0; k < members.size(); ++k) visit(members[k], k);
  };
  compressRows(masses.size(), each, of_offsets, of_members);
}

Mat3 MassMoments::inverseInertia() const {
  const Vec3 mean = sum_ / mass_;
  const Mat3 moment = moment_ - mass_ * mean * mean.transpose();
  const Mat3 inertia = moment.trace() * Mat3::Identity() - moment;
  const double scale = inertia.trace();
  if (!(scale > 0.0)) return Mat3::Zero();
  if (inertia.determinant() > 1e-9 * scale * scale * scale) return inertia.inverse();
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(inertia / scale);
  Mat3 inverse = Mat3::Zero();
  for (int k = 0; k < 3; ++k)
    if (solver.eigenvalues()[k] > 1e-12)
      inverse +=
          solver.eigenvectors().col(k) * solver.eigenvectors().col(k).transpose() / (solver.eigenvalues()[k] * scale);
  return inverse;
}

GroupMotion groupAt(const RigidGroups& groups, Index group, const std::function<Vec3(Index particle)>& position) {
  const Index begin = groups.offsets[group], end = groups.offsets[group + 1];
  MassMoments moments(position(groups.members[begin]));
  for (Index k = begin; k < end; ++k) {
    const Index i = groups.members[k];
    moments.add(groups.weights[k] * groups.masses[i], position(i));
  }
  GroupMotion motion;
  motion.current = true;
  motion.inverse_mass = 1.0 / moments.mass();
  motion.centre = moments.centre();
  motion.inverse_inertia = moments.inverseInertia();
  return motion;
}

}  // namespace meshless
