#include "polygon.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace meshless {
namespace {

using Corners = std::array<std::size_t, 3>;

constexpr std::size_t kMostStarts = 64;  // of a fan that are tried

std::vector<Corners> fanFrom(std::size_t start, std::size_t n) {
  std::vector<Corners> fan;
  for (std::size_t k = 1; k + 1 < n; ++k) fan.push_back({start, (start + k) % n, (start + k + 1) % n});
  return fan;
}

double turn(const Vec2& a, const Vec2& b, const Vec2& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// Counted from a convex corner, whether another corner lies in the ear. One at the place of a corner of the ear, as a
/// bridge has them, lies in it where its own corner opens into it.
bool isEar(const std::vector<Vec2>& at, const std::vector<std::size_t>& left, std::size_t k, double& work) {
  const std::size_t n = left.size(), before = (k + n - 1) % n, after = (k + 1) % n;
  const Vec2 &a = at[left[before]], &b = at[left[k]], &c = at[left[after]];
  if (!(turn(a, b, c) > 0.0)) return false;
  for (std::size_t m = 0; m < n; ++m) {
    if (m == before || m == k || m == after) continue;
    work -= 1.0;
    const Vec2& p = at[left[m]];
    if (p == a || p == b || p == c) {
      // Its neighbours must not lie within the ear's angle there.
      for (const std::size_t beside : {(m + 1) % n, (m + n - 1) % n}) {
        const Vec2& q = at[left[beside]];
        if (turn(a, b, q) > 0.0 && turn(b, c, q) > 0.0 && turn(c, a, q) > 0.0) return false;
      }
      continue;
    }
    if (turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0) return false;
  }
  return true;
}

/// The least height of the triangle over its longest side: slivers come last.
double shape(const Vec2& a, const Vec2& b, const Vec2& c) {
  const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return longest > 0.0 ? turn(a, b, c) / longest : 0.0;
}

/// Empty where no ear is left before the end, as the polygon crosses itself, or no work.
std::vector<Corners> earsOf(const std::vector<Vec2>& at, double& work) {
  std::vector<std::size_t> left(at.size());
  std::iota(left.begin(), left.end(), 0);
  std::vector<Corners> ears;
  while (left.size() > 3) {
    const std::size_t n = left.size();
    std::vector<std::size_t> order(n);
    std::vector<double> shapes(n);
    for (std::size_t k = 0; k < n; ++k) {
      order[k] = k;
      shapes[k] = shape(at[left[(k + n - 1) % n]], at[left[k]], at[left[(k + 1) % n]]);
    }
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return shapes[a] > shapes[b]; });
    work -= static_cast<double>(n);
    const auto found =
        std::find_if(order.begin(), order.end(), [&](std::size_t k) { return work < 0.0 || isEar(at, left, k, work); });
    if (work < 0.0) return {};
    if (found == order.end()) {
      // What is left may be without area, as the two sides of a bridge.
      const auto flat = std::find_if(order.begin(), order.end(), [&](std::size_t k) { return shapes[k] == 0.0; });
      if (flat == order.end()) return {};
      ears.push_back({left[(*flat + n - 1) % n], left[*flat], left[(*flat + 1) % n]});
      left.erase(left.begin() + static_cast<std::ptrdiff_t>(*flat));
      continue;
    }
    ears.push_back({left[(*found + n - 1) % n], left[*found], left[(*found + 1) % n]});
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(*found));
  }
  ears.push_back({left[0], left[1], left[2]});
  return ears;
}

}  // namespace

std::vector<Corners> trianglesOf(const std::vector<Index>& corners, const Points& points, double& work) {
  const std::size_t n = corners.size();
  if (n < 3) return {};
  const bool known = std::all_of(corners.begin(), corners.end(), [&](Index k) { return k < points.size(); });
  if (n == 3 || !known) return fanFrom(0, n);
  const auto at = [&](std::size_t k) -> const Vec3& { return points[corners[k % n]]; };
  Vec3 normal = Vec3::Zero();
  for (std::size_t k = 1; k + 1 < n; ++k) normal += (at(k) - at(0)).cross(at(k + 1) - at(0));
  double best = 0.0;
  std::size_t start = 0;
  for (std::size_t s = 0; s < std::min(n, kMostStarts); ++s) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 1; k + 1 < n; ++k)
      least = std::min(least, (at(s + k) - at(s)).cross(at(s + k + 1) - at(s)).dot(normal));
    if (s == 0 || least > best + 1e-9 * std::abs(best)) {
      best = least;
      start = s;
    }
  }
  if (best > 0.0 || n == 4 || !(normal.norm() > 0.0) || work < 0.0) return fanFrom(start, n);
  const Vec3 u = normal.unitOrthogonal(), v = normal.normalized().cross(u);
  std::vector<Vec2> flat;
  for (std::size_t k = 0; k < n; ++k) flat.emplace_back((at(k) - at(0)).dot(u), (at(k) - at(0)).dot(v));
  std::vector<Corners> ears = earsOf(flat, work);
  return ears.empty() ? fanFrom(start, n) : ears;
}

}  // namespace meshless
