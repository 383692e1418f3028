#include "statics.h"

#include <cmath>
#include <stdexcept>

namespace meshless::truth {
namespace {

constexpr int kPoints = 27;       // a full 3 x 3 x 3 rule
constexpr int kContactOrder = 4;  // finer than the elements, to follow the rim of the contact
constexpr int kTractionOrder = 3;

}  // namespace

Statics::Statics(const Mesh& mesh, const Material& material)
    : mesh_(mesh), material_(material), fixed_(3 * mesh.nodeCount(), 0), load_(Eigen::VectorXd::Zero(size())) {
  const GaussRule rule = gaussRule(3);
  quadrature_.reserve(static_cast<std::size_t>(mesh.elementCount()) * kPoints);
  for (int element = 0; element < mesh.elementCount(); ++element) {
    const auto nodes = mesh.elementNodes(element);
    ShapeGradient rest;
    for (int n = 0; n < kElementNodes; ++n) {
      rest.row(n) = mesh.rest(nodes[n]);
    }
    for (int q = 0; q < kPoints; ++q) {
      const int i = q / 9, j = q / 3 % 3, k = q % 3;
      const ShapeGradient local = shapeGradientAt({rule.points[i], rule.points[j], rule.points[k]});
      const Mat3 jacobian = rest.transpose() * local;
      if (jacobian.determinant() <= 0.0) {
        throw std::runtime_error("the mesh has an inverted element");
      }
      quadrature_.push_back(
          {local * jacobian.inverse(), rule.weights[i] * rule.weights[j] * rule.weights[k] * jacobian.determinant()});
    }
  }
}

double Statics::volume() const {
  double sum = 0.0;
  for (const QuadraturePoint& point : quadrature_) {
    sum += point.weight;
  }
  return sum;
}

void Statics::addBodyForce(const Vec3& force_per_volume) {
  const GaussRule rule = gaussRule(3);
  for (int element = 0; element < mesh_.elementCount(); ++element) {
    const auto nodes = mesh_.elementNodes(element);
    for (int q = 0; q < kPoints; ++q) {
      const Shape shape = shapeAt({rule.points[q / 9], rule.points[q / 3 % 3], rule.points[q % 3]});
      for (int n = 0; n < kElementNodes; ++n) {
        load_.segment<3>(3 * nodes[n]) += quadrature_[element * kPoints + q].weight * shape[n] * force_per_volume;
      }
    }
  }
}

void Statics::overFace(int axis, int side, int points,
                       const std::function<void(int, const Shape&, const Vec3&, double)>& visit) const {
  const GaussRule rule = gaussRule(points);
  const int first = (axis + 1) % 3, second = (axis + 2) % 3;
  std::array<int, 3> cell;
  cell[axis] = side == 0 ? 0 : mesh_.elements(axis) - 1;
  for (cell[first] = 0; cell[first] < mesh_.elements(first); ++cell[first]) {
    for (cell[second] = 0; cell[second] < mesh_.elements(second); ++cell[second]) {
      const int element = mesh_.element(cell[0], cell[1], cell[2]);
      const auto nodes = mesh_.elementNodes(element);
      ShapeGradient rest;
      for (int n = 0; n < kElementNodes; ++n) {
        rest.row(n) = mesh_.rest(nodes[n]);
      }
      for (int p = 0; p < points; ++p) {
        for (int q = 0; q < points; ++q) {
          Vec3 local;
          local[axis] = side == 0 ? -1.0 : 1.0;
          local[first] = rule.points[p];
          local[second] = rule.points[q];
          const Shape shape = shapeAt(local);
          const Mat3 jacobian = rest.transpose() * shapeGradientAt(local);
          const double area = jacobian.col(first).cross(jacobian.col(second)).norm();
          visit(element, shape, rest.transpose() * shape, rule.weights[p] * rule.weights[q] * area);
        }
      }
    }
  }
}

void Statics::addTraction(int axis, int side, const std::function<Vec3(const Vec3&)>& traction) {
  overFace(axis, side, kTractionOrder, [&](int element, const Shape& shape, const Vec3& rest, double area) {
    const auto nodes = mesh_.elementNodes(element);
    for (int n = 0; n < kElementNodes; ++n) {
      load_.segment<3>(3 * nodes[n]) += area * shape[n] * traction(rest);
    }
  });
}

void Statics::setSphere(const Sphere& sphere, double penalty) {
  if (!sphere_) {
    overFace(sphere.face_axis, sphere.face_side, kContactOrder,
             [&](int element, const Shape& shape, const Vec3& rest, double area) {
               contact_points_.push_back({element, shape, area, rest});
             });
  }
  sphere_ = sphere;
  penalty_ = penalty;
}

Vec3 Statics::contactPosition(const Eigen::VectorXd& displacement, const ContactPoint& point) const {
  return point.rest + elementDisplacements(displacement, point.element).transpose() * point.shape;
}

void Statics::updatePressures(const Eigen::VectorXd& displacement) {
  for (ContactPoint& point : contact_points_) {
    const double gap = (contactPosition(displacement, point) - sphere_->center).norm() - sphere_->radius;
    point.pressure = std::max(0.0, point.pressure - penalty_ * gap);
  }
}

double Statics::contactGap(const Eigen::VectorXd& displacement) const {
  double worst = 0.0;
  for (const ContactPoint& point : contact_points_) {
    const double gap = (contactPosition(displacement, point) - sphere_->center).norm() - sphere_->radius;
    if (point.pressure - penalty_ * gap > 0.0) {
      worst = std::max(worst, std::abs(gap));
    }
  }
  return worst;
}

Vec3 Statics::sphereForce(const Eigen::VectorXd& displacement) const {
  Vec3 sum = Vec3::Zero();
  for (const ContactPoint& point : contact_points_) {
    const Vec3 from_center = contactPosition(displacement, point) - sphere_->center;
    const double distance = from_center.norm();
    sum +=
        point.weight * std::max(0.0, point.pressure - penalty_ * (distance - sphere_->radius)) / distance * from_center;
  }
  return sum;
}

ShapeGradient Statics::elementDisplacements(const Eigen::VectorXd& displacement, int element) const {
  const auto nodes = mesh_.elementNodes(element);
  ShapeGradient u;
  for (int n = 0; n < kElementNodes; ++n) {
    u.row(n) = displacement.segment<3>(3 * nodes[n]);
  }
  return u;
}

double Statics::energy(const Eigen::VectorXd& displacement) const {
  double sum = -outerForces().dot(displacement);
  for (int element = 0; element < mesh_.elementCount(); ++element) {
    const ShapeGradient u = elementDisplacements(displacement, element);
    for (int q = 0; q < kPoints; ++q) {
      const QuadraturePoint& point = quadrature_[element * kPoints + q];
      const Mat3 f = Mat3::Identity() + u.transpose() * point.gradient;
      sum += point.weight * fixedCorotated(material_, f, false).energy;
    }
  }
  for (const ContactPoint& point : contact_points_) {
    const double gap = (contactPosition(displacement, point) - sphere_->center).norm() - sphere_->radius;
    const double pressure = std::max(0.0, point.pressure - penalty_ * gap);
    sum += point.weight * (pressure * pressure - point.pressure * point.pressure) / (2.0 * penalty_);
  }
  return sum;
}

Eigen::VectorXd Statics::residual(const Eigen::VectorXd& displacement) const {
  Eigen::VectorXd sum = -outerForces();
  for (int element = 0; element < mesh_.elementCount(); ++element) {
    const auto nodes = mesh_.elementNodes(element);
    const ShapeGradient u = elementDisplacements(displacement, element);
    ShapeGradient force = ShapeGradient::Zero();
    for (int q = 0; q < kPoints; ++q) {
      const QuadraturePoint& point = quadrature_[element * kPoints + q];
      const Mat3 f = Mat3::Identity() + u.transpose() * point.gradient;
      force += point.weight * point.gradient * fixedCorotated(material_, f, false).stress.transpose();
    }
    for (int n = 0; n < kElementNodes; ++n) {
      sum.segment<3>(3 * nodes[n]) += force.row(n);
    }
  }
  for (const ContactPoint& point : contact_points_) {
    const Vec3 from_center = contactPosition(displacement, point) - sphere_->center;
    const double distance = from_center.norm();
    const double pressure = std::max(0.0, point.pressure - penalty_ * (distance - sphere_->radius));
    if (pressure > 0.0) {
      const auto nodes = mesh_.elementNodes(point.element);
      for (int n = 0; n < kElementNodes; ++n) {
        sum.segment<3>(3 * nodes[n]) -= point.weight * pressure * point.shape[n] / distance * from_center;
      }
    }
  }
  return sum;
}

void Statics::elementTangent(const Eigen::VectorXd& displacement, int element, ElementMatrix& matrix) const {
  using Rows = Eigen::Matrix<double, 3, 3 * kElementNodes>;
  const ShapeGradient u = elementDisplacements(displacement, element);
  matrix.setZero();
  for (int q = 0; q < kPoints; ++q) {
    const QuadraturePoint& point = quadrature_[element * kPoints + q];
    const Mat3 f = Mat3::Identity() + u.transpose() * point.gradient;
    const Mat9 tangent = point.weight * fixedCorotated(material_, f, true).tangent;
    for (int i = 0; i < 3; ++i) {
      Rows stress;  // row i of the stress's change, for a unit displacement of each component of each node
      for (int j = 0; j < 3; ++j) {
        Mat3 part;
        for (int k = 0; k < 3; ++k) {
          for (int l = 0; l < 3; ++l) {
            part(k, l) = tangent(i + 3 * k, j + 3 * l);
          }
        }
        stress.middleCols<kElementNodes>(j * kElementNodes) = part * point.gradient.transpose();
      }
      matrix.middleRows<kElementNodes>(i * kElementNodes).noalias() += point.gradient * stress;
    }
  }
}

void Statics::contactTangent(const Eigen::VectorXd& displacement, const ContactPoint& point,
                             ElementMatrix& matrix) const {
  const Vec3 from_center = contactPosition(displacement, point) - sphere_->center;
  const double distance = from_center.norm();
  const double pressure = point.pressure - penalty_ * (distance - sphere_->radius);
  matrix.setZero();
  if (pressure <= 0.0) {
    return;
  }
  const Vec3 normal = from_center / distance;
  const Mat3 across = Mat3::Identity() - normal * normal.transpose();
  const Mat3 stiffness = point.weight * (penalty_ * normal * normal.transpose() - pressure / distance * across);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      matrix.block<kElementNodes, kElementNodes>(i * kElementNodes, j * kElementNodes) =
          stiffness(i, j) * point.shape * point.shape.transpose();
    }
  }
}

Eigen::VectorXd Statics::tangentTimes(const Eigen::VectorXd& displacement, const Eigen::VectorXd& direction) const {
  Eigen::VectorXd product = Eigen::VectorXd::Zero(size());
  ElementMatrix matrix;
  const auto apply = [&](int element) {
    const auto nodes = mesh_.elementNodes(element);
    for (int row = 0; row < 3 * kElementNodes; ++row) {
      for (int column = 0; column < 3 * kElementNodes; ++column) {
        product[3 * nodes[row % kElementNodes] + row / kElementNodes] +=
            matrix(row, column) * direction[3 * nodes[column % kElementNodes] + column / kElementNodes];
      }
    }
  };
  for (int element = 0; element < mesh_.elementCount(); ++element) {
    elementTangent(displacement, element, matrix);
    apply(element);
  }
  for (const ContactPoint& point : contact_points_) {
    contactTangent(displacement, point, matrix);
    apply(point.element);
  }
  return product;
}

void Statics::assemble(const Eigen::VectorXd& displacement, double shift, BlockTridiagonal& target) const {
  target.setZero();
  ElementMatrix matrix;
  const auto add = [&](int element) {
    const auto nodes = mesh_.elementNodes(element);
    std::array<int, 3 * kElementNodes> unknowns;
    for (int n = 0; n < 3 * kElementNodes; ++n) {
      unknowns[n] = 3 * nodes[n % kElementNodes] + n / kElementNodes;
    }
    for (int column = 0; column < 3 * kElementNodes; ++column) {
      if (fixed_[unknowns[column]]) {
        continue;
      }
      for (int row = 0; row < 3 * kElementNodes; ++row) {
        if (!fixed_[unknowns[row]]) {
          target.add(unknowns[row], unknowns[column], matrix(row, column));
        }
      }
    }
  };
  for (int element = 0; element < mesh_.elementCount(); ++element) {
    elementTangent(displacement, element, matrix);
    add(element);
  }
  for (const ContactPoint& point : contact_points_) {
    contactTangent(displacement, point, matrix);
    if (matrix(kElementNodes - 1, kElementNodes - 1) != 0.0 || matrix.squaredNorm() > 0.0) {
      add(point.element);
    }
  }
  for (int row = 0; row < size(); ++row) {
    target.add(row, row, fixed_[row] ? 1.0 : shift * std::abs(target.diagonal(row)));
  }
}

Statics::Report Statics::solve(Eigen::VectorXd& displacement, double tolerance, int max_iterations) const {
  constexpr double kSufficientDecrease = 1e-4;
  BlockTridiagonal matrix(mesh_.layers(0), 3 * mesh_.layers(1) * mesh_.layers(2));
  Report report;
  double shift = 0.0;
  double best_energy = energy(displacement);
  Eigen::VectorXd forces = residual(displacement);
  for (;; ++report.iterations) {
    Eigen::VectorXd free_forces = forces;
    for (int row = 0; row < size(); ++row) {
      free_forces[row] = fixed_[row] ? 0.0 : forces[row];
    }
    // The largest force is a reaction, an outer load or, before equilibrium, what is out of balance.
    const double scale = std::max(forces.norm(), outerForces().norm());
    report.residual = scale > 0.0 ? free_forces.norm() / scale : 0.0;
    if (report.residual <= tolerance) {
      report.converged = true;
      return report;
    }
    if (report.iterations == max_iterations) {
      return report;
    }

    assemble(displacement, shift, matrix);
    bool shifted = shift > 0.0;
    while (!matrix.factor()) {
      shift = std::max(1e-3, 4.0 * shift);
      shifted = true;
      assemble(displacement, shift, matrix);
    }
    report.shifted += shifted;
    shift = shift > 1e-3 ? 0.25 * shift : 0.0;
    const Eigen::VectorXd step = -matrix.solve(free_forces);

    const double slope = free_forces.dot(step);
    double length = 1.0;
    for (;; length *= 0.5) {
      const Eigen::VectorXd tried = displacement + length * step;
      const double tried_energy = energy(tried);
      bool accepted = tried_energy <= best_energy + kSufficientDecrease * length * slope;
      if (!accepted && std::abs(slope) < 1e-9 * std::abs(best_energy)) {
        // Differences of energy drown in rounding here: go by the forces.
        Eigen::VectorXd tried_forces = residual(tried);
        for (int row = 0; row < size(); ++row) {
          tried_forces[row] = fixed_[row] ? 0.0 : tried_forces[row];
        }
        accepted = tried_forces.norm() < free_forces.norm();
      }
      if (accepted) {
        displacement = tried;
        best_energy = tried_energy;
        break;
      }
      if (length < 1e-10) {
        return report;
      }
    }
    forces = residual(displacement);
  }
}

}  // namespace meshless::truth
