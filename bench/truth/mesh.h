// Structured meshes of 27-node hexahedra: a box of parameters, cut by planes, and a smooth map from it to the body.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "law.h"

namespace meshless::truth {

constexpr int kElementNodes = 27;
using Shape = Eigen::Matrix<double, kElementNodes, 1>;
using ShapeGradient = Eigen::Matrix<double, kElementNodes, 3>;

/// Values and derivatives of the 27 quadratic shape functions at `local` in [-1, 1]^3; node (i, j, k) is 9 i + 3 j + k.
Shape shapeAt(const Vec3& local);
ShapeGradient shapeGradientAt(const Vec3& local);

struct GaussRule {
  std::vector<double> points;  // in [-1, 1]
  std::vector<double> weights;
};
GaussRule gaussRule(int count);  // 1 to 6

/// `count` intervals of [from, to]. `begin` and `end` (0 to below 1) narrow those next to the two ends.
std::vector<double> gradedLines(double from, double to, int count, double begin = 0.0, double end = 0.0);

class Mesh {
 public:
  using Map = std::function<Vec3(const Vec3&)>;
  using Lines = std::array<std::vector<double>, 3>;

  /// Without a map the parameters are the rest positions. The factorisation is cheapest with the longest side first.
  explicit Mesh(Lines lines, Map map = nullptr);

  int elements(int axis) const { return static_cast<int>(lines_[axis].size()) - 1; }
  int elementCount() const { return elements(0) * elements(1) * elements(2); }
  int layers(int axis) const { return 2 * elements(axis) + 1; }
  int nodeCount() const { return static_cast<int>(rest_.size()); }
  int node(int i, int j, int k) const { return (i * layers(1) + j) * layers(2) + k; }
  std::array<int, kElementNodes> elementNodes(int element) const;
  int element(int i, int j, int k) const { return (i * elements(1) + j) * elements(2) + k; }
  /// Nodes where the parameter of `axis` is smallest (side 0) or largest (side 1).
  std::vector<int> faceNodes(int axis, int side) const;

  const Vec3& rest(int node) const { return rest_[node]; }
  const Vec3& parameter(int node) const { return parameters_[node]; }
  /// For tests: meshes with crooked inner elements.
  void moveNode(int node, const Vec3& rest) { rest_[node] = rest; }

  /// The value of a nodal field (three components a node) at a point of the parameter box.
  Vec3 interpolate(const Eigen::VectorXd& field, const Vec3& parameter) const;

 private:
  Lines lines_;
  std::vector<Vec3> parameters_;
  std::vector<Vec3> rest_;
};

}  // namespace meshless::truth
