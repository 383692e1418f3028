#include "meshless_surgery/geometry/query/inside.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "meshless_surgery/base/bytes.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/nearest_on_triangle.h"

namespace meshless {
namespace {

constexpr std::size_t kLeafSize = 4;
constexpr double kPi = 3.14159265358979323846;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Corners {
  Vec3 a, b, c;
};

/// A node of the tree; children are the next node and `right`. Leaves have count > 0.
struct Node {
  Box box;
  Index right = 0;
  Index first = 0;
  Index count = 0;
};

/// A direction with its dominant axis and shear: triangles are projected along it onto the plane of the other two axes,
/// where the sign of a shared edge is computed from the same numbers for both its triangles: no ray slips between them
/// (Woop, Benthin and Wald 2013).
struct RayDirection {
  int u, v, w;
  double shear_u, shear_v;
  double sign;  // of the dominant axis
  Vec3 inverse;

  explicit RayDirection(const Vec3& d) {
    d.cwiseAbs().maxCoeff(&w);
    u = (w + 1) % 3;
    v = (w + 2) % 3;
    shear_u = d[u] / d[w];
    shear_v = d[v] / d[w];
    sign = d[w] > 0.0 ? 1.0 : -1.0;
    inverse = d.cwiseInverse();
  }
};

/// Directions that no modeller aligns faces or edges with.
const RayDirection& genericDirection(int k) {
  static const std::array<RayDirection, 3> directions = {RayDirection(Vec3(0.7360127, 0.3517041, 0.5784313)),
                                                         RayDirection(Vec3(-0.2871049, 0.8930577, -0.3465619)),
                                                         RayDirection(Vec3(0.3310553, -0.4190281, -0.8454901))};
  return directions[k];
}

bool rayMeetsBox(const Vec3& p, const Vec3& inverse, const Box& box) {
  double near = 0.0, far = kInfinity;
  for (int k = 0; k < 3; ++k) {
    const double t0 = (box.min[k] - p[k]) * inverse[k], t1 = (box.max[k] - p[k]) * inverse[k];
    near = std::max(near, std::min(t0, t1));
    far = std::min(far, std::max(t0, t1));
  }
  // The box is a few units in the last place tighter than the rounding of the slabs.
  return near <= far * (1.0 + 1e-12);
}

bool segmentMeetsBox(const Vec3& middle, const Vec3& half, const Vec3& abs_half, const Box& bounds, const Box& box) {
  for (int k = 0; k < 3; ++k)
    if (box.min[k] > bounds.max[k] || box.max[k] < bounds.min[k]) return false;
  const Vec3 centre = middle - 0.5 * (box.min + box.max);
  const Vec3 extent = 0.5 * (box.max - box.min);
  const double slack = 1e-12 * (extent.sum() + abs_half.sum());
  for (int k = 0; k < 3; ++k)
    if (std::abs(centre[k]) > extent[k] + abs_half[k] + slack) return false;
  const auto apart = [&](int i, int j) {
    return std::abs(centre[i] * half[j] - centre[j] * half[i]) >
           extent[i] * abs_half[j] + extent[j] * abs_half[i] + slack * (abs_half[i] + abs_half[j] + slack);
  };
  return !(apart(1, 2) || apart(2, 0) || apart(0, 1));
}

/// Strictly through the triangle's plane by more than `flat`, inside the triangle or on its rim.
bool segmentMeetsTriangle(const Vec3& p, const Vec3& q, const Corners& t, double flat) {
  const Vec3 normal = (t.b - t.a).cross(t.c - t.a);
  const double at_p = normal.dot(p - t.a), at_q = normal.dot(q - t.a);
  if (at_p * at_q > 0.0) return false;  // as most are
  const double limit = flat * normal.norm();
  if (!(std::min(at_p, at_q) < -limit && std::max(at_p, at_q) > limit)) return false;
  const Vec3 pa = t.a - p, pb = t.b - p, pc = t.c - p, d = q - p;
  const double ab = d.dot(pa.cross(pb)), bc = d.dot(pb.cross(pc)), ca = d.dot(pc.cross(pa));
  return (ab >= 0.0 && bc >= 0.0 && ca >= 0.0) || (ab <= 0.0 && bc <= 0.0 && ca <= 0.0);
}

Vec3 onTriangle(const Vec3& p, const Corners& t) { return nearestOnTriangle(p, t.a, t.b, t.c); }

double squaredDistance(const Vec3& p, const Box& box) {
  return (box.min - p).cwiseMax(p - box.max).cwiseMax(Vec3::Zero()).squaredNorm();
}

}  // namespace

struct SolidQuery::Data {
  std::vector<Corners> triangles;  // in the order of the leaves
  std::vector<Index> numbers;      // of them in the mesh
  std::vector<Node> nodes;
  Box bounds;
  double flat = 0.0;  // [m] a segment that stays closer to a triangle's plane than this lies in it

  struct Centre {
    Vec3 thrice;  // [m] the sum of the corners
    Index triangle;
  };

  /// Returns the node.
  Index build(std::vector<Centre>& centres, const std::vector<Corners>& source, std::size_t begin, std::size_t end) {
    const Index at = static_cast<Index>(nodes.size());
    nodes.emplace_back();
    if (end - begin <= kLeafSize) {
      nodes[at].first = static_cast<Index>(begin);
      nodes[at].count = static_cast<Index>(end - begin);
      for (std::size_t k = begin; k < end; ++k) {
        const Corners& t = source[centres[k].triangle];
        for (const Vec3& p : {t.a, t.b, t.c}) nodes[at].box.extend(p);
      }
      return at;
    }
    Box bounds;
    for (std::size_t k = begin; k < end; ++k) bounds.extend(centres[k].thrice);
    int axis = 0;
    (bounds.max / 3.0 - bounds.min / 3.0).maxCoeff(&axis);
    const auto middle = centres.begin() + static_cast<std::ptrdiff_t>(begin + (end - begin) / 2);
    std::nth_element(centres.begin() + static_cast<std::ptrdiff_t>(begin), middle,
                     centres.begin() + static_cast<std::ptrdiff_t>(end), [axis](const Centre& a, const Centre& b) {
                       return a.thrice[axis] != b.thrice[axis] ? a.thrice[axis] < b.thrice[axis]
                                                               : a.triangle < b.triangle;
                     });
    const Index left = build(centres, source, begin, begin + (end - begin) / 2);
    const Index right = build(centres, source, begin + (end - begin) / 2, end);
    nodes[at].right = right;
    nodes[at].box = nodes[left].box;
    nodes[at].box.extend(nodes[right].box.min);
    nodes[at].box.extend(nodes[right].box.max);
    return at;
  }

  /// Calls leaf(triangle) -> bool (stop) for every triangle in nodes that enter(box) lets through; true when stopped.
  template <class Enter, class Leaf>
  bool visit(const Enter& enter, const Leaf& leaf) const {
    if (nodes.empty()) return false;
    Index stack[64];
    int depth = 0;
    stack[depth++] = 0;
    while (depth > 0) {
      const Index at = stack[--depth];
      const Node& node = nodes[at];
      if (!enter(node.box)) continue;
      for (Index k = 0; k < node.count; ++k)
        if (leaf(triangles[node.first + k])) return true;
      if (node.count == 0) {
        stack[depth++] = node.right;
        stack[depth++] = at + 1;
      }
    }
    return false;
  }

  /// Signed crossings of the ray from p: how often the surface winds around p, if it is closed. False where the ray
  /// meets an edge or a vertex and cannot say.
  bool windingByRay(const Vec3& p, const RayDirection& ray, int& winding) const {
    winding = 0;
    const int u = ray.u, v = ray.v, w = ray.w;
    const bool unsure =
        visit([&](const Box& box) { return rayMeetsBox(p, ray.inverse, box); },
              [&](const Corners& t) {
                const double az = t.a[w] - p[w], bz = t.b[w] - p[w], cz = t.c[w] - p[w];
                const double ax = (t.a[u] - p[u]) - ray.shear_u * az, ay = (t.a[v] - p[v]) - ray.shear_v * az;
                const double bx = (t.b[u] - p[u]) - ray.shear_u * bz, by = (t.b[v] - p[v]) - ray.shear_v * bz;
                const double cx = (t.c[u] - p[u]) - ray.shear_u * cz, cy = (t.c[v] - p[v]) - ray.shear_v * cz;
                const double ab = ax * by - ay * bx, bc = bx * cy - by * cx, ca = cx * ay - cy * ax;
                if ((ab > 0.0 || bc > 0.0 || ca > 0.0) && (ab < 0.0 || bc < 0.0 || ca < 0.0)) return false;
                if (ab == 0.0 || bc == 0.0 || ca == 0.0) {
                  // On the rim, or beside a triangle seen edge-on: only the first is unsure.
                  const double sum = ab + bc + ca;
                  return sum != 0.0 || (std::min({ax, bx, cx}) <= 0.0 && std::max({ax, bx, cx}) >= 0.0 &&
                                        std::min({ay, by, cy}) <= 0.0 && std::max({ay, by, cy}) >= 0.0);
                }
                const double sum = ab + bc + ca;
                const double height = (bc * az + ca * bz + ab * cz) / sum;
                if (height * ray.sign > 0.0) winding += sum * ray.sign > 0.0 ? 1 : -1;
                return false;
              });
    return !unsure;
  }

  /// Its number in the mesh, and where on it; `place` stays where there is none.
  Index nearest(const Vec3& p, Vec3& place) const;

  /// Jacobson et al. 2013; solid angles after van Oosterom and Strackee 1983.
  double windingBySum(const Vec3& p) const {
    double sum = 0.0;
    for (const Corners& t : triangles) {
      const Vec3 a = t.a - p, b = t.b - p, c = t.c - p;
      const double la = a.norm(), lb = b.norm(), lc = c.norm();
      sum += std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
    }
    return sum / (2.0 * kPi);
  }
};

SolidQuery::SolidQuery(const TriangleMesh& mesh) : data_(std::make_unique<Data>()) {
  std::vector<Corners> source;
  std::vector<Index> numbers;
  source.reserve(mesh.triangles.size());
  for (Index number = 0; number < mesh.triangles.size(); ++number) {
    const Triangle& t = mesh.triangles[number];
    if (t[0] >= mesh.vertices.size() || t[1] >= mesh.vertices.size() || t[2] >= mesh.vertices.size()) continue;
    const Corners corners = {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
    if (!corners.a.allFinite() || !corners.b.allFinite() || !corners.c.allFinite()) continue;
    source.push_back(corners);
    numbers.push_back(number);
  }
  if (source.empty()) return;
  std::vector<Data::Centre> centres;
  centres.reserve(source.size());
  for (const Corners& t : source) centres.push_back({t.a + t.b + t.c, static_cast<Index>(centres.size())});
  data_->nodes.reserve(source.size());
  data_->build(centres, source, 0, source.size());
  data_->triangles.reserve(source.size());
  for (const Data::Centre& c : centres) {
    data_->triangles.push_back(source[c.triangle]);
    data_->numbers.push_back(numbers[c.triangle]);
  }
  data_->bounds = data_->nodes[0].box;
  data_->flat = 1e-12 * data_->bounds.diagonal();
}

SolidQuery::~SolidQuery() = default;
SolidQuery::SolidQuery(SolidQuery&&) noexcept = default;
SolidQuery& SolidQuery::operator=(SolidQuery&&) noexcept = default;

bool SolidQuery::contains(const Vec3& p) const {
  if (!data_->bounds.contains(p)) return false;
  int first = 0, agreeing = 0;
  for (int k = 0; k < 3; ++k) {
    int winding = 0;
    if (!data_->windingByRay(p, genericDirection(k), winding)) continue;
    if (agreeing > 0 && winding != first) break;
    first = winding;
    if (++agreeing == 2) return winding > 0;
  }
  return data_->windingBySum(p) > 0.5;
}

bool SolidQuery::crosses(const Vec3& a, const Vec3& b) const {
  constexpr double kShortening = 1e-6;
  const Vec3 p = a + kShortening * (b - a), q = b - kShortening * (b - a);
  const Vec3 middle = 0.5 * (p + q), half = 0.5 * (q - p), abs_half = half.cwiseAbs();
  Box bounds;
  for (const Vec3& end : {p, q}) bounds.extend(end);
  return data_->visit([&](const Box& box) { return segmentMeetsBox(middle, half, abs_half, bounds, box); },
                      [&](const Corners& t) { return segmentMeetsTriangle(p, q, t, data_->flat); });
}

double SolidQuery::distance(const Vec3& p) const { return data_->nodes.empty() ? kInfinity : (nearest(p) - p).norm(); }

Vec3 SolidQuery::nearest(const Vec3& p) const {
  Vec3 place = p;
  data_->nearest(p, place);
  return place;
}

Index SolidQuery::nearestTriangle(const Vec3& p) const {
  Vec3 place = p;
  return data_->nearest(p, place);
}

std::size_t SolidQuery::bytes() const {
  return sizeof *data_ + bytesOf(data_->triangles, data_->numbers, data_->nodes);
}

Index SolidQuery::Data::nearest(const Vec3& p, Vec3& place) const {
  if (nodes.empty()) return kNoIndex;
  // Depth first, the nearer child first.
  struct Entry {
    Index node;
    double squared;
  };
  Entry stack[64];
  int depth = 0;
  double best = kInfinity;
  Index number = kNoIndex;
  stack[depth++] = {0, squaredDistance(p, bounds)};
  while (depth > 0) {
    const Entry entry = stack[--depth];
    if (entry.squared >= best) continue;
    const Node& node = nodes[entry.node];
    for (Index k = 0; k < node.count; ++k) {
      const Vec3 there = onTriangle(p, triangles[node.first + k]);
      const double squared = (there - p).squaredNorm();
      if (!(squared < best)) continue;
      best = squared;
      place = there;
      number = numbers[node.first + k];
    }
    if (node.count > 0) continue;
    Entry left = {entry.node + 1, squaredDistance(p, nodes[entry.node + 1].box)};
    Entry right = {node.right, squaredDistance(p, nodes[node.right].box)};
    if (left.squared < right.squared) std::swap(left, right);
    stack[depth++] = left;
    stack[depth++] = right;
  }
  return number;
}

}  // namespace meshless
