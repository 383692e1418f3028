/// What one triangle of a surface is to a point, and which of several is meant.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "meshless_surgery/contact/contact_shape.h"
#include "meshless_surgery/geometry/nearest_on_triangle.h"

namespace meshless {

inline constexpr double kOnRim = 1e-6;        // of a squared distance: straight above the rim of a face
inline constexpr double kFlatEdge = 0.996;    // cosine between neighbours: about 5 degrees
inline constexpr double kTie = 1e-9;          // relative: two features are equally near
inline constexpr double kNormalSlack = 1e-8;  // of the radius: more than planes are off at corners as sharp as kFlat

// Of a triangle, what a query needs, side by side in memory.
struct ContactShape::Facet {
  Vec3 a, ab, ac, normal;
  Vec3 centre;
  double radius;
  double g00, g01, g11;  // inverse of the Gram matrix of ab and ac; zero where the triangle has no area
  Vec3 across;           // unit, in the plane, square to the longest edge: the triangle is narrowest along it
  double low, high;      // [m] along it from a
  Index triangle;

  // Whether a point, so far over the plane and at `from` from a, is farther than that [m^2], whatever the rounding of a
  // sliver's normal.
  bool isBeyond(double squared, double over, const Vec3& from) const {
    const double at = across.dot(from), slack = kNormalSlack * radius;
    const double beside = std::max({low - at, at - high, slack}) - slack;
    const double height = std::max(std::abs(over) - slack, 0.0);
    return height * height + beside * beside > squared;
  }
};

// What a facet is to a point.
struct Measured {
  double squared = 0.0, over = 0.0;  // [m^2] distance, [m] height over the plane
  std::array<double, 3> weights{};
  bool above = false;
};

inline Measured measure(const ContactShape::Facet& f, const Vec3& p) {
  Measured m;
  const Vec3 ap = p - f.a;
  m.over = f.normal.dot(ap);
  const double d1 = f.ab.dot(ap), d2 = f.ac.dot(ap);
  const double v = f.g00 * d1 + f.g01 * d2, w = f.g01 * d1 + f.g11 * d2;
  m.above = v >= 0.0 && w >= 0.0 && v + w <= 1.0 && f.g00 > 0.0;
  if (m.above) {
    m.weights = {1.0 - v - w, v, w};
    m.squared = m.over * m.over;
  } else {
    const Vec3 u = nearestWeights(p, f.a, f.a + f.ab, f.a + f.ac);
    m.weights = {u.x(), u.y(), u.z()};
    m.squared = (ap - u.y() * f.ab - u.z() * f.ac).squaredNorm();
    m.above = m.squared <= (1.0 + kOnRim) * m.over * m.over;
  }
  return m;
}

// The nearest so far; where several are as near, settle() decides, whatever order they come in.
struct Best {
  explicit Best(double size) : least_tie(1e-20 * size * size) {}

  double least_tie;  // [m^2]
  double squared = std::numeric_limits<double>::infinity();
  double distance = std::numeric_limits<double>::infinity();
  double height = 0.0;  // over the plane of its triangle
  bool tied = false;

  double tie() const { return kTie * squared + least_tie; }

  void offer(const ContactShape::Facet& f, const Vec3& p, ContactShape::Nearest& found) {
    const double bound = distance + f.radius;
    if ((p - f.centre).squaredNorm() > bound * bound * (1.0 + kTie) + least_tie) return;
    const Vec3 from = p - f.a;
    const double over = f.normal.dot(from);
    if (over * over > squared + tie() || f.isBeyond(squared + tie(), over, from)) return;
    if (f.triangle == found.triangle) return;
    const Measured m = measure(f, p);
    if (m.squared > squared + tie()) return;
    const bool nearer = m.squared < squared - tie();
    tied = !nearer && std::isfinite(squared);  // not with the infinity that it starts from
    if (!(m.squared < squared)) return;
    squared = m.squared;
    distance = std::sqrt(squared);
    height = over;
    found.triangle = f.triangle;
    found.weights = m.weights;
    found.above = m.above;
  }
};

// At an edge or a corner. The sign is that of the normals about it, weighted by their angles (Baerentzen and Aanaes
// 2005); of the faces on that side the one whose plane is farthest is meant, and of equal ones the first.
class Settler {
 public:
  explicit Settler(const Best& best)
      : limit_(best.squared + 4.0 * best.tie()),
        reach_(std::sqrt(limit_)),
        touches_(best.squared <= 16.0 * best.least_tie) {}

  void offer(const ContactShape::Facet& f, const Vec3& p) {
    const double bound = reach_ + f.radius;
    if ((p - f.centre).squaredNorm() > bound * bound * (1.0 + kTie)) return;
    const Vec3 from = p - f.a;
    const double over = f.normal.dot(from), limit = limit_ * (1.0 + kTie);
    if (over * over > limit || f.isBeyond(limit, over, from)) return;
    const Measured m = measure(f, p);
    if (!(m.squared <= limit_)) return;
    for (std::size_t k = 0; k < count_; ++k)
      if (faces_[k].triangle == f.triangle) return;  // bins show a triangle more than once
    for (const Face& face : more_)
      if (face.triangle == f.triangle) return;
    const Vec3 corners[3] = {f.a, f.a + f.ab, f.a + f.ac};
    constexpr double kAt = 1e-9;  // barycentric
    int at = 0;
    double angle = 3.14159265358979323846;
    for (int k = 0; k < 3; ++k) at += m.weights[k] > kAt;
    if (at == 1) {
      const int k = static_cast<int>(std::max_element(m.weights.begin(), m.weights.end()) - m.weights.begin());
      const Vec3 u = (corners[(k + 1) % 3] - corners[k]).normalized(),
                 v = (corners[(k + 2) % 3] - corners[k]).normalized();
      angle = std::acos(std::clamp(u.dot(v), -1.0, 1.0));
    } else if (at == 3) {
      angle *= 2.0;
    }
    normals_ += angle * f.normal;
    angles_ += angle;
    if (f.triangle < first_) {
      first_ = f.triangle;
      away_ = p - (m.weights[0] * corners[0] + m.weights[1] * corners[1] + m.weights[2] * corners[2]);
    }
    if (count_ == faces_.size()) {
      more_.push_back({f.triangle, m.over, m.weights, m.above});
    } else {
      faces_[count_++] = {f.triangle, m.over, m.weights, m.above};
    }
  }

  /// +1 outside, -1 inside.
  double settle(ContactShape::Nearest& found) const {
    // The two wound faces that lie on each other cancel but for rounding, which the order of the faces would decide.
    const bool inside = normals_.dot(away_) < -kCancelled * angles_ * away_.norm();
    const double sign = !touches_ && inside ? -1.0 : 1.0;
    const Face* best = nullptr;
    const auto better = [&](const Face& a, const Face& b) {
      if (touches_) return a.triangle < b.triangle;  // heights are rounding
      const bool on_side_a = a.over * sign >= 0.0, on_side_b = b.over * sign >= 0.0;
      if (on_side_a != on_side_b) return on_side_a;
      if (std::abs(a.over) != std::abs(b.over)) return std::abs(a.over) > std::abs(b.over);
      return a.triangle < b.triangle;
    };
    for (std::size_t k = 0; k < count_; ++k)
      if (!best || better(faces_[k], *best)) best = &faces_[k];
    for (const Face& face : more_)
      if (better(face, *best)) best = &face;
    if (best) {
      found.triangle = best->triangle;
      found.weights = best->weights;
      found.above = best->above;
    }
    return sign;
  }

 private:
  struct Face {
    Index triangle;
    double over;
    std::array<double, 3> weights;
    bool above;
  };
  static constexpr double kCancelled = 1e-9;
  double limit_, reach_;  // [m^2], [m]
  bool touches_;          // on the surface itself, which is not inside
  Index first_ = kNoIndex;
  Vec3 normals_ = Vec3::Zero(), away_ = Vec3::Zero();
  double angles_ = 0.0;
  std::array<Face, 48> faces_;
  std::vector<Face> more_;  // those of fans, and of wound faces with many slivers
  std::size_t count_ = 0;
};

}  // namespace meshless
