#include "volume_within.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace {

constexpr int kColumns = 16384;

struct Span {
  double low = 0.0, high = 0.0;
};

// Where a line along z is in the region; empty: low = high.
Span spanAt(const Region& region, double x, double y) {
  constexpr double kFar = std::numeric_limits<double>::max();
  switch (region.kind) {
    case Region::Kind::kBox: {
      const Box& b = region.box;
      if (!(x >= b.min.x() && x <= b.max.x() && y >= b.min.y() && y <= b.max.y())) return {};
      return {b.min.z(), b.max.z()};
    }
    case Region::Kind::kSphere: {
      const double square = region.radius * region.radius - (Vec2(x, y) - region.centre.head<2>()).squaredNorm();
      if (!(square > 0.0)) return {};
      return {region.centre.z() - std::sqrt(square), region.centre.z() + std::sqrt(square)};
    }
    case Region::Kind::kPlane: {
      const Vec3& n = region.plane.normal;
      const double height = region.plane.height(Vec3(x, y, 0.0));
      if (n.z() == 0.0) return height <= 0.0 ? Span{-kFar, kFar} : Span{};
      return n.z() > 0.0 ? Span{-kFar, -height / n.z()} : Span{-height / n.z(), kFar};
    }
    case Region::Kind::kMesh:
      break;
  }
  return {};
}

}  // namespace

double volumeWithin(const TriangleMesh& solid, const Region& region) {
  if (solid.empty()) return 0.0;
  const Box bounds = boundsOf(solid.vertices);
  const Vec3 size = bounds.max - bounds.min;
  if (!(size.minCoeff() > 0.0)) return 0.0;
  // A Fibonacci lattice: even in both directions, in line with no mesh.
  const double golden = 0.5 * (std::sqrt(5.0) - 1.0);
  std::vector<Span> spans(kColumns);
  std::vector<double> ys(kColumns);
  const auto xOf = [&](int k) { return bounds.min.x() + size.x() * (k + 0.5) / kColumns; };
  for (int k = 0; k < kColumns; ++k) {
    const double share = k * golden;
    ys[static_cast<std::size_t>(k)] = bounds.min.y() + size.y() * (share - std::floor(share));
    spans[static_cast<std::size_t>(k)] = spanAt(region, xOf(k), ys[static_cast<std::size_t>(k)]);
  }
  // Where a column leaves through a face it adds what of the region is below there, where it enters it takes that off.
  double inside = 0.0, whole = 0.0;
  for (const Triangle& t : solid.triangles) {
    const Vec3 &a = solid.vertices[t[0]], &b = solid.vertices[t[1]], &c = solid.vertices[t[2]];
    const Vec2 ab = (b - a).head<2>(), ac = (c - a).head<2>();
    const double twice = ab.x() * ac.y() - ab.y() * ac.x();
    if (twice == 0.0) continue;
    const double sign = twice > 0.0 ? 1.0 : -1.0;
    const double low = std::min({a.x(), b.x(), c.x()}), high = std::max({a.x(), b.x(), c.x()});
    const double least_y = std::min({a.y(), b.y(), c.y()}), most_y = std::max({a.y(), b.y(), c.y()});
    const int first = std::max(0, static_cast<int>(std::floor((low - bounds.min.x()) / size.x() * kColumns - 0.5)));
    for (int k = first; k < kColumns && xOf(k) <= high; ++k) {
      const double y = ys[static_cast<std::size_t>(k)];
      if (!(y >= least_y && y <= most_y)) continue;
      const Vec2 from = Vec2(xOf(k), y) - a.head<2>();
      const double u = (from.x() * ac.y() - from.y() * ac.x()) / twice;
      const double v = (ab.x() * from.y() - ab.y() * from.x()) / twice;
      if (!(u >= 0.0 && v >= 0.0 && u + v <= 1.0)) continue;
      const double z = a.z() + u * (b.z() - a.z()) + v * (c.z() - a.z());
      whole += sign * (z - bounds.min.z());
      const Span& span = spans[static_cast<std::size_t>(k)];
      const double from_z = std::max(span.low, bounds.min.z());
      if (span.high > from_z) inside += sign * (std::clamp(z, from_z, span.high) - from_z);
    }
  }
  // The share is known better than the volume of so many columns.
  if (!(whole > 0.0)) return 0.0;
  return std::clamp(inside / whole, 0.0, 1.0) * signedVolume(solid);
}

}  // namespace meshless
