#include "meshless_surgery/contact/rigid_groups.h"

#include <Eigen/Eigenvalues>

namespace meshless {

RigidGroups::RigidGroups(const std::vector<Index>& group_offsets, const std::vector<Index>& group_members,
                         const std::vector<double>& group_weights, const std::vector<double>& particle_masses)
    : offsets(group_offsets), members(group_members), weights(group_weights), masses(particle_masses) {
  of_offsets.assign(masses.size() + 1, 0);
  for (const Index i : members) ++of_offsets[i + 1];
  for (std::size_t i = 0; i < masses.size(); ++i) of_offsets[i + 1] += of_offsets[i];
  of_groups.resize(members.size());
  of_weights.resize(members.size());
  std::vector<Index> next(of_offsets.begin(), of_offsets.end() - 1);
  for (Index g = 0; g < size(); ++g)
    for (Index k = offsets[g]; k < offsets[g + 1]; ++k) {
      const Index at = next[members[k]]++;
      of_groups[at] = g;
      of_weights[at] = weights[k];
    }
}

Mat3 inverseInertia(const Mat3& inertia) {
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
  GroupMotion motion;
  motion.current = true;
  const Index begin = groups.offsets[group], end = groups.offsets[group + 1];
  const Vec3 origin = position(groups.members[begin]);
  double mass = 0.0;
  Vec3 sum = Vec3::Zero();
  Mat3 moment = Mat3::Zero();
  for (Index k = begin; k < end; ++k) {
    const Index i = groups.members[k];
    const double m = groups.weights[k] * groups.masses[i];
    const Vec3 arm = position(i) - origin;
    mass += m;
    sum += m * arm;
    moment += m * arm * arm.transpose();
  }
  const Vec3 mean = sum / mass;
  moment -= mass * mean * mean.transpose();
  motion.inverse_mass = 1.0 / mass;
  motion.centre = origin + mean;
  motion.inverse_inertia = inverseInertia(moment.trace() * Mat3::Identity() - moment);
  return motion;
}

}  // namespace meshless
