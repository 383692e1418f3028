// Static equilibrium of a hyperelastic body: Newton's method with a line search on the potential energy.
#pragma once

#include <optional>

#include "block_tridiagonal.h"
#include "mesh.h"

namespace meshless::truth {

/// A rigid frictionless sphere, pressed onto one face of the parameter box.
struct Sphere {
  Vec3 center = Vec3::Zero();
  double radius = 0.0;
  int face_axis = 2;
  int face_side = 1;
};

class Statics {
 public:
  Statics(const Mesh& mesh, const Material& material);

  const Mesh& mesh() const { return mesh_; }
  int size() const { return 3 * mesh_.nodeCount(); }

  /// Component `axis` of the node keeps the displacement that solve() is given.
  void fix(int node, int axis) { fixed_[3 * node + axis] = 1; }
  void fix(int node) { fix(node, 0), fix(node, 1), fix(node, 2); }

  /// Dead loads, at full size; loadFactor scales them.
  void addBodyForce(const Vec3& force_per_volume);
  void addTraction(int axis, int side, const std::function<Vec3(const Vec3& rest)>& traction);
  void setLoadFactor(double factor) { load_factor_ = factor; }
  const Eigen::VectorXd& load() const { return load_; }

  /// The first call fixes the quadrature; later ones move the sphere. `penalty` [Pa/m]; pressures are kept.
  void setSphere(const Sphere& sphere, double penalty);
  /// One step of the augmented Lagrangian: pressures take over the penalty's part.
  void updatePressures(const Eigen::VectorXd& displacement);
  /// Largest depth of a contact point inside the sphere where it presses, or its distance from it where it pulls [m].
  double contactGap(const Eigen::VectorXd& displacement) const;
  /// The sphere's force on the body.
  Vec3 sphereForce(const Eigen::VectorXd& displacement) const;

  double energy(const Eigen::VectorXd& displacement) const;
  /// Inner minus outer forces; at fixed components minus the reaction.
  Eigen::VectorXd residual(const Eigen::VectorXd& displacement) const;
  /// Dense product with the tangent, for checks.
  Eigen::VectorXd tangentTimes(const Eigen::VectorXd& displacement, const Eigen::VectorXd& direction) const;

  struct Report {
    bool converged = false;
    int iterations = 0;
    int shifted = 0;        // iterations whose tangent was not positive definite
    double residual = 0.0;  // relative to the largest force
  };
  /// From `displacement` (which holds the prescribed components) to equilibrium.
  Report solve(Eigen::VectorXd& displacement, double tolerance = 1e-9, int max_iterations = 60) const;

  /// Volume of the mesh at rest.
  double volume() const;

 private:
  struct QuadraturePoint {
    ShapeGradient gradient;  // by rest position
    double weight;           // [m^3]
  };
  struct ContactPoint {
    int element;
    Shape shape;
    double weight;  // [m^2] of rest surface
    Vec3 rest;
    double pressure = 0.0;
  };
  using ElementMatrix = Eigen::Matrix<double, 3 * kElementNodes, 3 * kElementNodes>;

  /// Calls visit(element, shape, rest, area vector) at the Gauss points of a face.
  void overFace(int axis, int side, int points,
                const std::function<void(int, const Shape&, const Vec3&, double)>& visit) const;
  ShapeGradient elementDisplacements(const Eigen::VectorXd& displacement, int element) const;
  /// Rows and columns are ordered by component, then by node.
  void elementTangent(const Eigen::VectorXd& displacement, int element, ElementMatrix& matrix) const;
  void contactTangent(const Eigen::VectorXd& displacement, const ContactPoint& point, ElementMatrix& matrix) const;
  void assemble(const Eigen::VectorXd& displacement, double shift, BlockTridiagonal& matrix) const;
  Vec3 contactPosition(const Eigen::VectorXd& displacement, const ContactPoint& point) const;
  Eigen::VectorXd outerForces() const { return load_factor_ * load_; }

  const Mesh& mesh_;
  Material material_;
  std::vector<QuadraturePoint> quadrature_;  // 27 an element
  std::vector<char> fixed_;
  Eigen::VectorXd load_;
  double load_factor_ = 1.0;
  std::optional<Sphere> sphere_;
  double penalty_ = 0.0;
  std::vector<ContactPoint> contact_points_;
};

}  // namespace meshless::truth
