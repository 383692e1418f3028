// The points of a body that are queried in others, and how thick it is.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <unordered_map>
#include <unsupported/Eigen/BVH>

#include "contact_bins.h"
#include "contact_facet.h"

namespace meshless {
namespace {

constexpr double kLongEdge = 0.1;            // of the body's least extent: shorter edges need no samples
constexpr double kMostPlaces = 1e6;          // along an axis of the grid in which samples keep apart
constexpr int kMostEdgeSamples = 64;         // of an edge
constexpr std::size_t kEdgeSamples = 1000;   // of a body, and
constexpr std::size_t kEdgeSamplesEach = 4;  // for each sample at a vertex
constexpr std::size_t kThicknessRays = 48;
constexpr std::size_t kManyRays = 128;  // beyond it a tree of the triangles is worth making
constexpr double kItself = 1e-6;        // of the longest ray: nearer is the surface from which it comes

// Entry of a line into the front of a triangle; time in units of the direction, false where it misses.
bool meets(const TriangleMesh& mesh, Index t, const Vec3& from, const Vec3& direction, double& time,
           std::array<double, 3>& weights) {
  const Triangle& c = mesh.triangles[t];
  const Vec3& a = mesh.vertices[c[0]];
  const Vec3 ab = mesh.vertices[c[1]] - a, ac = mesh.vertices[c[2]] - a;
  const Vec3 h = direction.cross(ac);
  const double det = ab.dot(h);
  if (!(std::abs(det) > 1e-14 * ab.norm() * ac.norm() * direction.norm())) return false;
  const Vec3 s = from - a;
  const double u = s.dot(h) / det;
  const Vec3 q = s.cross(ab);
  const double v = direction.dot(q) / det;
  constexpr double kSlack = 1e-9;  // so that no path slips between two triangles
  if (!(u >= -kSlack) || !(v >= -kSlack) || !(u + v <= 1.0 + kSlack)) return false;
  time = ac.dot(q) / det;
  weights = {1.0 - u - v, u, v};
  return true;
}

using TriangleTree = Eigen::KdBVH<double, 3, Index>;

TriangleTree makeTree(const TriangleMesh& mesh) {
  std::vector<Index> triangles(mesh.triangles.size());
  std::iota(triangles.begin(), triangles.end(), Index{0});
  std::vector<TriangleTree::Volume> boxes(triangles.size());
  for (Index t = 0; t < triangles.size(); ++t)
    for (Index corner : mesh.triangles[t]) boxes[t].extend(mesh.vertices[corner]);
  return TriangleTree(triangles.begin(), triangles.end(), boxes.begin(), boxes.end());
}

/// For Eigen::BVMinimize: the first triangle that a ray meets farther than `least`; `depth` is where.
struct FirstMet {
  using Scalar = double;
  const TriangleMesh& mesh;
  Vec3 from, direction;
  double least, depth;
  Eigen::Array3d inverse = direction.array().inverse();

  static constexpr double kNever = std::numeric_limits<double>::max();
  double minimumOnVolume(const TriangleTree::Volume& box) const {
    // Along an axis in which the ray does not move: infinities of both signs within, of one sign beyond.
    const Eigen::Array3d slack = Eigen::Array3d::Constant(1e-6 * depth);
    const Eigen::Array3d a = (box.min().array() - slack - from.array()) * inverse,
                         b = (box.max().array() + slack - from.array()) * inverse;
    const double begin = std::max(0.0, a.min(b).maxCoeff()), end = std::min(depth, a.max(b).minCoeff());
    return begin <= end ? begin : kNever;
  }
  double minimumOnObject(Index t) {
    double time;
    std::array<double, 3> weights;
    if (!meets(mesh, t, from, direction, time, weights) || !(time > least)) return kNever;
    depth = std::min(depth, time);
    return time;
  }
};

}  // namespace

// How far it is from a point on the surface to the other side; what is nearer than `least` is the surface itself.
double ContactShape::depthAlong(const Vec3& from, const Vec3& direction, double least, double longest) const {
  double depth = longest;
  Box box;
  box.extend(from);
  box.extend(from + longest * direction);
  visitBins(box, [&](Index k) {
    const Index t = bin_triangles_[k];
    const Vec3 to = facets_[t].centre - from;
    const double along = to.dot(direction), reach = 1.01 * facets_[t].radius;
    if (along - reach > depth || to.squaredNorm() - along * along > reach * reach) return;  // the ray passes it by
    double time;
    std::array<double, 3> weights;
    if (meets(surface_, t, from, direction, time, weights) && time > least && time < depth) depth = time;
  });
  return depth;
}

void ContactShape::measureThickness() {
  thickness_ = size_;
  const double longest = (bounds_.max - bounds_.min).norm();
  const std::size_t count = surface_.triangles.size();
  const std::size_t stride = std::max<std::size_t>(1, count / kThicknessRays);
  std::vector<double> depths;
  for (std::size_t t = 0; t < count; t += stride) {
    const Triangle& c = surface_.triangles[t];
    const Vec3 &p = surface_.vertices[c[0]], &q = surface_.vertices[c[1]], &r = surface_.vertices[c[2]];
    const Vec3 normal = (q - p).cross(r - p).normalized();
    const double depth = depthAlong((p + q + r) / 3.0, -normal, kItself * longest, longest);
    if (depth < longest) depths.push_back(depth);
  }
  if (depths.empty()) return;
  // Near edges rays are short however thick the body is: the middle one says how thick it is on the whole.
  std::sort(depths.begin(), depths.end());
  thickness_ = depths[depths.size() / 2];
}

void ContactShape::chooseSamples(double spacing) {
  const Points& vertices = surface_.vertices;
  // Embedded vertices nearer to a sample than most of a spacing are left out: the surface between particles is smooth.
  std::vector<bool> chosen(vertices.size(), true);
  if (!embedded_of_.empty() && spacing > 0.0) {
    const double apart = 0.9 * spacing, edge = apart;
    std::unordered_map<std::uint64_t, std::vector<Index>> grid;
    const auto key = [&](int x, int y, int z) {
      return (static_cast<std::uint64_t>(x + 2) << 42) ^ (static_cast<std::uint64_t>(y + 2) << 21) ^
             static_cast<std::uint64_t>(z + 2);
    };
    const auto place = [&](Index v) {
      std::array<int, 3> cell{};
      for (int d = 0; d < 3; ++d) {
        const double c = (vertices[v][d] - bounds_.min[d]) / edge;
        cell[d] = c > 0.0 ? static_cast<int>(std::min(c, kMostPlaces)) : 0;
      }
      return cell;
    };
    for (int pass = 0; pass < 2; ++pass)  // particles first
      for (Index v = 0; v < vertices.size(); ++v) {
        if ((embedded_of_[v] == kNoIndex) != (pass == 0)) continue;
        const std::array<int, 3> c = place(v);
        bool free = true;
        if (pass == 1)
          for (int x = -1; free && x <= 1; ++x)
            for (int y = -1; free && y <= 1; ++y)
              for (int z = -1; free && z <= 1; ++z) {
                const auto found = grid.find(key(c[0] + x, c[1] + y, c[2] + z));
                if (found == grid.end()) continue;
                for (Index other : found->second)
                  if ((vertices[other] - vertices[v]).squaredNorm() < apart * apart) {
                    free = false;
                    break;
                  }
              }
        chosen[v] = free;
        if (free) grid[key(c[0], c[1], c[2])].push_back(v);
      }
  }
  std::vector<bool> used(vertices.size(), surface_.triangles.empty());
  Points normals(vertices.size(), Vec3::Zero());
  for (const Triangle& t : surface_.triangles)
    for (int k = 0; k < 3; ++k) {
      const Vec3 &p = vertices[t[k]], &q = vertices[t[(k + 1) % 3]], &r = vertices[t[(k + 2) % 3]];
      // By the angle, so that it does not matter how faces are divided into triangles.
      const Vec3 pq = (q - p).normalized(), pr = (r - p).normalized();
      normals[t[k]] += std::acos(std::clamp(pq.dot(pr), -1.0, 1.0)) * pq.cross(pr).normalized();
      used[t[k]] = true;
    }
  for (Index v = 0; v < vertices.size(); ++v)
    if (chosen[v] && used[v]) samples_.push_back({{v, v}, 0.0, normals[v].normalized()});

  const double least = kLongEdge * size_;
  struct Edge {
    Index low, high;
    Vec3 normal;
  };
  std::vector<Edge> edges;
  for (const Triangle& t : surface_.triangles) {
    const Vec3 normal = (vertices[t[1]] - vertices[t[0]]).cross(vertices[t[2]] - vertices[t[0]]).normalized();
    for (int k = 0; k < 3; ++k) {
      const Index a = t[k], b = t[(k + 1) % 3];
      if ((vertices[a] - vertices[b]).norm() > least) edges.push_back({std::min(a, b), std::max(a, b), normal});
    }
  }
  std::stable_sort(edges.begin(), edges.end(),
                   [](const Edge& p, const Edge& q) { return p.low != q.low ? p.low < q.low : p.high < q.high; });
  const double longest = (bounds_.max - bounds_.min).norm();
  struct Sampled {
    Index low, high;
    double length;
    Vec3 inwards;
    double apart;  // [m] samples at most
  };
  std::vector<Sampled> sharp;
  for (std::size_t k = 0; k + 1 < edges.size(); ++k) {
    const Edge &e = edges[k], &f = edges[k + 1];
    if (e.low != f.low || e.high != f.high || e.normal.dot(f.normal) > kFlatEdge) continue;
    const Vec3 inwards = -(e.normal + f.normal).normalized();
    sharp.push_back({e.low, e.high, (vertices[e.high] - vertices[e.low]).norm(), inwards, 0.0});
  }
  // Slivers between cuts lie in most bins each: a tree of boxes tells them apart.
  const bool by_tree = sharp.size() > kManyRays;
  TriangleTree tree;
  if (by_tree) tree = makeTree(surface_);
  for (Sampled& s : sharp) {
    const Vec3 middle = 0.5 * (vertices[s.low] + vertices[s.high]);
    // Where the other side is two lengths away an edge needs no samples.
    FirstMet first{surface_, middle, s.inwards, kItself * longest, std::min(longest, 2.0 * s.length)};
    if (by_tree)
      Eigen::BVMinimize(tree, first);
    else
      first.depth = depthAlong(middle, s.inwards, first.least, first.depth);
    s.apart = 0.5 * first.depth;
  }
  // Slivers are thinner than they matter: of all edges together no more than this.
  const std::size_t most = std::max(kEdgeSamples, kEdgeSamplesEach * samples_.size());
  double apart = 0.0;
  const auto partsOf = [&](const Sampled& s) {
    return std::min(kMostEdgeSamples, static_cast<int>(std::ceil(0.999 * s.length / std::max(s.apart, apart))));
  };
  const auto count = [&] {
    std::size_t sum = 0;
    for (const Sampled& s : sharp) sum += static_cast<std::size_t>(partsOf(s) - 1);
    return sum;
  };
  for (double wider = 1e-3 * longest; count() > most; wider *= 1.25) apart = wider;
  for (const Sampled& s : sharp) {
    const int parts = partsOf(s);
    for (int n = 1; n < parts; ++n) samples_.push_back({{s.low, s.high}, static_cast<double>(n) / parts, -s.inwards});
  }
}

}  // namespace meshless
