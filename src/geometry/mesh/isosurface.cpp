#include "meshless_surgery/geometry/mesh/isosurface.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace meshless {
namespace {

class SurfaceNet {
 public:
  SurfaceNet(const ScalarField& field, const Box& box, const Vec3& cell) : origin_(box.min), cell_(cell) {
    for (int d = 0; d < 3; ++d) nodes_[d] = static_cast<int>(std::ceil((box.max[d] - box.min[d]) / cell[d])) + 1;
    values_.resize(static_cast<std::size_t>(nodes_[0]) * nodes_[1] * nodes_[2]);
    for (int k = 0; k < nodes_[2]; ++k)
      for (int j = 0; j < nodes_[1]; ++j)
        for (int i = 0; i < nodes_[0]; ++i) values_[number({i, j, k})] = field(position({i, j, k}));
  }

  TriangleMesh mesh() {
    TriangleMesh mesh;
    std::map<std::size_t, Index> vertex_of_cell;
    const auto vertex = [&](const Node& cell) {
      const auto found = vertex_of_cell.emplace(number(cell), static_cast<Index>(mesh.vertices.size()));
      if (found.second) mesh.vertices.push_back(meanCrossing(cell));
      return found.first->second;
    };
    for (int k = 1; k + 1 < nodes_[2]; ++k)
      for (int j = 1; j + 1 < nodes_[1]; ++j)
        for (int i = 1; i + 1 < nodes_[0]; ++i)
          for (int axis = 0; axis < 3; ++axis) {
            const Node a = {i, j, k};
            Node b = a;
            ++b[axis];
            if (inside(a) == inside(b)) continue;
            // The four cells about this edge, counter-clockwise seen from +axis.
            const int u = (axis + 1) % 3, v = (axis + 2) % 3;
            std::array<Index, 4> quad;
            for (int corner = 0; corner < 4; ++corner) {
              Node cell = a;
              if (corner == 0 || corner == 3) --cell[u];
              if (corner < 2) --cell[v];
              quad[corner] = vertex(cell);
            }
            if (!inside(a)) std::swap(quad[1], quad[3]);
            const auto length = [&](int p, int q) { return (mesh.vertices[quad[p]] - mesh.vertices[quad[q]]).norm(); };
            const int first = length(0, 2) <= length(1, 3) ? 0 : 1;
            const auto at = [&](int n) { return quad[(first + n) % 4]; };
            mesh.triangles.push_back({at(0), at(1), at(2)});
            mesh.triangles.push_back({at(0), at(2), at(3)});
          }
    return mesh;
  }

 private:
  using Node = std::array<int, 3>;

  std::size_t number(const Node& n) const {
    return (static_cast<std::size_t>(n[2]) * nodes_[1] + n[1]) * nodes_[0] + n[0];
  }
  Vec3 position(const Node& n) const { return origin_ + cell_.cwiseProduct(Vec3(n[0], n[1], n[2])); }
  bool inside(const Node& n) const { return values_[number(n)] < 0.0; }

  Vec3 meanCrossing(const Node& cell) const {
    Vec3 sum = Vec3::Zero();
    int count = 0;
    for (int corner = 0; corner < 8; ++corner)
      for (int axis = 0; axis < 3; ++axis) {
        if (corner >> axis & 1) continue;
        const Node a = {cell[0] + (corner & 1), cell[1] + (corner >> 1 & 1), cell[2] + (corner >> 2 & 1)};
        Node b = a;
        ++b[axis];
        if (inside(a) == inside(b)) continue;
        const double va = values_[number(a)], vb = values_[number(b)];
        sum += position(a) + va / (va - vb) * (position(b) - position(a));
        ++count;
      }
    return sum / count;
  }

  Vec3 origin_, cell_;
  Node nodes_;
  std::vector<double> values_;
};

Vec3 gradient(const ScalarField& field, const Vec3& p, double step) {
  Vec3 g;
  for (int d = 0; d < 3; ++d) {
    const Vec3 e = step * Vec3::Unit(d);
    g[d] = (field(p + e) - field(p - e)) / (2.0 * step);
  }
  return g;
}

double smallestAngleCosine(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = (b - a).normalized(), bc = (c - b).normalized(), ca = (a - c).normalized();
  return std::max({-ab.dot(ca), -bc.dot(ab), -ca.dot(bc)});
}

/// Flips edges towards six neighbours a vertex and wider angles; one pass, each triangle at most once.
void flipEdges(TriangleMesh& mesh) {
  struct Side {
    Index low, high, triangle, opposite;
    bool operator<(const Side& o) const {
      return low != o.low ? low < o.low : high != o.high ? high < o.high : triangle < o.triangle;
    }
  };
  std::vector<Side> sides;
  std::vector<int> degree(mesh.vertices.size(), 0);
  for (Index f = 0; f < mesh.triangles.size(); ++f)
    for (int k = 0; k < 3; ++k) {
      const Triangle& t = mesh.triangles[f];
      const Index a = t[k], b = t[(k + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), f, t[(k + 2) % 3]});
      ++degree[a];
    }
  std::sort(sides.begin(), sides.end());
  std::map<std::pair<Index, Index>, bool> made;
  const auto exists = [&](Index a, Index b) {
    const Side wanted = {std::min(a, b), std::max(a, b), 0, 0};
    const auto found = std::lower_bound(sides.begin(), sides.end(), wanted);
    return (found != sides.end() && found->low == wanted.low && found->high == wanted.high) ||
           made.count({wanted.low, wanted.high}) > 0;
  };
  std::vector<char> touched(mesh.triangles.size(), 0);
  for (std::size_t s = 0; s + 1 < sides.size(); ++s) {
    if (sides[s].low != sides[s + 1].low || sides[s].high != sides[s + 1].high) continue;
    const Index f = sides[s].triangle, g = sides[s + 1].triangle, c = sides[s].opposite, d = sides[s + 1].opposite;
    if (touched[f] || touched[g] || c == d || exists(c, d)) continue;
    // f = a b c in its own order.
    Triangle& t = mesh.triangles[f];
    const int k = static_cast<int>(std::find(t.begin(), t.end(), c) - t.begin());
    const Index a = t[(k + 1) % 3], b = t[(k + 2) % 3];
    const Vec3 &pa = mesh.vertices[a], &pb = mesh.vertices[b], &pc = mesh.vertices[c], &pd = mesh.vertices[d];
    const Vec3 n_abc = (pb - pa).cross(pc - pa), n_bad = (pa - pb).cross(pd - pb);
    const Vec3 n_adc = (pd - pa).cross(pc - pa), n_dbc = (pb - pd).cross(pc - pd);
    const Vec3 mean = (n_abc + n_bad).normalized();
    if (!(mean.dot(n_adc.normalized()) > 0.7 && mean.dot(n_dbc.normalized()) > 0.7)) continue;
    const auto off = [](int n) { return (n - 6) * (n - 6); };
    const int before = off(degree[a]) + off(degree[b]) + off(degree[c]) + off(degree[d]);
    const int after = off(degree[a] - 1) + off(degree[b] - 1) + off(degree[c] + 1) + off(degree[d] + 1);
    const double narrow_before = std::max(smallestAngleCosine(pa, pb, pc), smallestAngleCosine(pb, pa, pd));
    const double narrow_after = std::max(smallestAngleCosine(pa, pd, pc), smallestAngleCosine(pd, pb, pc));
    const bool better =
        after < before ? narrow_after < std::max(narrow_before, 0.9) : narrow_after < narrow_before - 0.05;
    if (!better || after > before + 4) continue;
    mesh.triangles[f] = {a, d, c};
    mesh.triangles[g] = {d, b, c};
    touched[f] = touched[g] = 1;
    made[{std::min(c, d), std::max(c, d)}] = true;
    --degree[a], --degree[b], ++degree[c], ++degree[d];
  }
}

/// Moves each vertex towards the area-weighted mean of its triangles' centres, then back onto the surface.
void relax(TriangleMesh& mesh, const ScalarField& field, double step) {
  Points centre(mesh.vertices.size(), Vec3::Zero());
  std::vector<double> weight(mesh.vertices.size(), 0.0);
  for (const Triangle& t : mesh.triangles) {
    const Vec3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    const double area = (b - a).cross(c - a).norm();
    for (const Index v : t) {
      centre[v] += area * (a + b + c) / 3.0;
      weight[v] += area;
    }
  }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    Vec3& p = mesh.vertices[v];
    const Vec3 old = p;
    if (weight[v] > 0.0) p += 0.6 * (centre[v] / weight[v] - p);
    for (int newton = 0; newton < 3; ++newton) {
      const Vec3 g = gradient(field, p, 0.1 * step);
      const double squared = g.squaredNorm();
      if (!(squared > 1e-6)) break;
      Vec3 move = -field(p) / squared * g;
      if (move.norm() > 0.5 * step) move *= 0.5 * step / move.norm();
      p += move;
    }
    if (!p.allFinite()) p = old;
  }
}

}  // namespace

TriangleMesh isosurface(const ScalarField& field, const Box& box, const Vec3& cell, int relaxations) {
  TriangleMesh mesh = SurfaceNet(field, box, cell).mesh();
  for (int pass = 0; pass < relaxations; ++pass) {
    flipEdges(mesh);
    relax(mesh, field, cell.minCoeff());
  }
  return mesh;
}

}  // namespace meshless
