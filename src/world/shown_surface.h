// A surface with its places, the nearest face of it, and points on it by what carries them.
#pragma once

#include <cmath>
#include <limits>
#include <map>

#include "meshless_surgery/contact/row_solver.h"
#include "meshless_surgery/contact/surface_contacts.h"
#include "meshless_surgery/geometry/query/nearest_on_triangle.h"

namespace meshless {

/// A surface as it is now, or at rest.
struct ShownSurface {
  const ContactSurface* surface = nullptr;
  Points vertices;  // [m]

  Vec3 corner(Index face, int k) const { return vertices[surface->triangles[face][k]]; }
  Vec3 at(Index face, const Vec3& shares) const {
    return shares[0] * corner(face, 0) + shares[1] * corner(face, 1) + shares[2] * corner(face, 2);
  }
  Vec3 areaOf(Index face) const {
    return 0.5 * (corner(face, 1) - corner(face, 0)).cross(corner(face, 2) - corner(face, 0));
  }
};

struct NearestFace {
  Index face = kNoIndex;
  Vec3 shares = Vec3::Zero();  // of its corners
  double distance = std::numeric_limits<double>::infinity();
};

class FaceSearch {
 public:
  explicit FaceSearch(const ShownSurface& shown) : shown_(shown) {
    for (const Triangle& t : shown.surface->triangles) {
      FloatBox box;
      for (const Index v : t) box.extend(shown.vertices[v]);
      boxes_.items.push_back(box);
    }
    shown.surface->tree.refit(boxes_);
  }

  /// Of those that are nearer than `most` [m]; none: face is kNoIndex.
  NearestFace nearest(const Vec3& p, double most = std::numeric_limits<double>::infinity()) const {
    NearestFace nearest;
    const auto sharesOf = [&](Index face) {
      return nearestWeights(p, shown_.corner(face, 0), shown_.corner(face, 1), shown_.corner(face, 2));
    };
    double squared = most * most;
    nearest.face = shown_.surface->tree.nearest(
        boxes_, p, squared, [&](Index face) { return (shown_.at(face, sharesOf(face)) - p).squaredNorm(); });
    if (nearest.face == kNoIndex) return nearest;
    nearest.shares = sharesOf(nearest.face);
    nearest.distance = std::sqrt(squared);
    return nearest;
  }

 private:
  const ShownSurface& shown_;
  TreeBoxes boxes_;
};

/// A mean of vertices, by what carries them.
class PointMaker {
 public:
  explicit PointMaker(const VertexSupports& supports) : supports_(supports) {}

  void add(Index vertex, double weight) {
    for (Index k = supports_.offsets[vertex]; k < supports_.offsets[vertex + 1]; ++k)
      weights_[supports_.particles[k]] += weight * supports_.weights[k];
    total_ += weight;
  }
  BodyPoint make() const {
    BodyPoint point;
    for (const auto& [particle, weight] : weights_) {
      point.particles.push_back(particle);
      point.weights.push_back(weight / total_);
    }
    return point;
  }

 private:
  const VertexSupports& supports_;
  std::map<Index, double> weights_;
  double total_ = 0.0;
};

inline BodyPoint pointOn(const ContactSurface& surface, const NearestFace& on) {
  PointMaker maker(surface.supports);
  for (int k = 0; k < 3; ++k) maker.add(surface.triangles[on.face][k], on.shares[k]);
  return maker.make();
}

}  // namespace meshless
