#include "mesh.h"

#include <algorithm>
#include <cmath>

namespace meshless::truth {
namespace {

Vec3 quadratic(double s) { return {0.5 * s * (s - 1.0), 1.0 - s * s, 0.5 * s * (s + 1.0)}; }
Vec3 quadraticSlope(double s) { return {s - 0.5, -2.0 * s, s + 0.5}; }

}  // namespace

Shape shapeAt(const Vec3& local) {
  const Vec3 a = quadratic(local.x()), b = quadratic(local.y()), c = quadratic(local.z());
  Shape shape;
  for (int n = 0; n < kElementNodes; ++n) {
    shape[n] = a[n / 9] * b[n / 3 % 3] * c[n % 3];
  }
  return shape;
}

ShapeGradient shapeGradientAt(const Vec3& local) {
  const Vec3 a = quadratic(local.x()), b = quadratic(local.y()), c = quadratic(local.z());
  const Vec3 da = quadraticSlope(local.x()), db = quadraticSlope(local.y()), dc = quadraticSlope(local.z());
  ShapeGradient gradient;
  for (int n = 0; n < kElementNodes; ++n) {
    const int i = n / 9, j = n / 3 % 3, k = n % 3;
    gradient.row(n) << da[i] * b[j] * c[k], a[i] * db[j] * c[k], a[i] * b[j] * dc[k];
  }
  return gradient;
}

GaussRule gaussRule(int count) {
  // Roots of the Legendre polynomial by Newton from Chebyshev's guess.
  GaussRule rule;
  const double pi = std::acos(-1.0);
  for (int i = 0; i < count; ++i) {
    double x = -std::cos(pi * (i + 0.75) / (count + 0.5));
    double slope = 1.0;
    for (int iteration = 0; iteration < 50; ++iteration) {
      double p = 1.0, previous = 0.0;
      for (int n = 1; n <= count; ++n) {
        const double next = ((2.0 * n - 1.0) * x * p - (n - 1.0) * previous) / n;
        previous = p;
        p = next;
      }
      slope = count * (x * p - previous) / (x * x - 1.0);
      x -= p / slope;
    }
    rule.points.push_back(x);
    rule.weights.push_back(2.0 / ((1.0 - x * x) * slope * slope));
  }
  return rule;
}

std::vector<double> gradedLines(double from, double to, int count, double begin, double end) {
  const double pi = std::acos(-1.0);
  std::vector<double> lines;
  for (int i = 0; i <= count; ++i) {
    const double s = static_cast<double>(i) / count;
    // The interval's density is 1 - begin at its beginning and 1 - end at its end, and one on average.
    const double both = 0.5 * (begin + end), skew = 0.5 * (begin - end);
    lines.push_back(from +
                    (to - from) * (s - both * std::sin(2.0 * pi * s) / (2.0 * pi) - skew * std::sin(pi * s) / pi));
  }
  lines.back() = to;
  return lines;
}

Mesh::Mesh(Lines lines, Map map) : lines_(std::move(lines)) {
  std::array<std::vector<double>, 3> node_lines;
  for (int axis = 0; axis < 3; ++axis) {
    for (int i = 0; i < layers(axis); ++i) {
      const double at = lines_[axis][i / 2];
      node_lines[axis].push_back(i % 2 == 0 ? at : 0.5 * (at + lines_[axis][i / 2 + 1]));
    }
  }
  for (double x : node_lines[0]) {
    for (double y : node_lines[1]) {
      for (double z : node_lines[2]) {
        parameters_.emplace_back(x, y, z);
        rest_.push_back(map ? map(parameters_.back()) : parameters_.back());
      }
    }
  }
}

std::array<int, kElementNodes> Mesh::elementNodes(int element) const {
  const int k = element % elements(2), j = element / elements(2) % elements(1), i = element / elements(2) / elements(1);
  std::array<int, kElementNodes> nodes;
  for (int n = 0; n < kElementNodes; ++n) {
    nodes[n] = node(2 * i + n / 9, 2 * j + n / 3 % 3, 2 * k + n % 3);
  }
  return nodes;
}

std::vector<int> Mesh::faceNodes(int axis, int side) const {
  std::vector<int> nodes;
  for (int n = 0; n < nodeCount(); ++n) {
    const std::array<int, 3> ijk{n / (layers(1) * layers(2)), n / layers(2) % layers(1), n % layers(2)};
    if (ijk[axis] == (side == 0 ? 0 : layers(axis) - 1)) {
      nodes.push_back(n);
    }
  }
  return nodes;
}

Vec3 Mesh::interpolate(const Eigen::VectorXd& field, const Vec3& parameter) const {
  Vec3 local;
  std::array<int, 3> cell;
  for (int axis = 0; axis < 3; ++axis) {
    const std::vector<double>& line = lines_[axis];
    const auto above = std::upper_bound(line.begin(), line.end(), parameter[axis]);
    cell[axis] = std::clamp(static_cast<int>(above - line.begin()) - 1, 0, elements(axis) - 1);
    const double low = line[cell[axis]], high = line[cell[axis] + 1];
    local[axis] = 2.0 * (parameter[axis] - low) / (high - low) - 1.0;
  }
  const Shape shape = shapeAt(local);
  const std::array<int, kElementNodes> nodes = elementNodes(element(cell[0], cell[1], cell[2]));
  Vec3 value = Vec3::Zero();
  for (int n = 0; n < kElementNodes; ++n) {
    value += shape[n] * field.segment<3>(3 * nodes[n]);
  }
  return value;
}

}  // namespace meshless::truth
