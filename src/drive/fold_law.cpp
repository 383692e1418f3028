#include "meshless_surgery/drive/fold_law.h"

#include <algorithm>
#include <map>
#include <set>

#include <Eigen/Dense>

#include "meshless_surgery/geometry/cell_lattice.h"
#include "meshless_surgery/geometry/measures.h"
#include "words.h"

namespace meshless {
namespace {

constexpr double kFlat = 0.866;   // cosine of 30 degrees
constexpr double kFolded = 0.5;   // of 60
constexpr double kSliver = 0.02;  // of the mean edge
constexpr double kStretched = 2.0;

struct Side {
  Index low, high, triangle;
  bool operator<(const Side& o) const {
    return low != o.low ? low < o.low : high != o.high ? high < o.high : triangle < o.triangle;
  }
};

/// Unit; zero for a triangle whose height over its longest edge is less than `flattest`.
Vec3 normalOf(const Points& p, const Triangle& t, double flattest) {
  const Vec3 normal = (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]);
  const double longest = std::max({(p[t[1]] - p[t[0]]).norm(), (p[t[2]] - p[t[1]]).norm(), (p[t[0]] - p[t[2]]).norm()});
  if (!(normal.norm() > flattest * longest)) return Vec3::Zero();
  return normal.normalized();
}

// The cells of a body, as a fold asks for them.
class TissueBeneath {
 public:
  TissueBeneath(const BodyModel& model, const Points& particles)
      : lattice_(*model.lattice), binding_(model.binding), particles_(particles) {
    for (Index c = 0; c < lattice_.cells.size(); ++c) at_[lattice_.cells[c].place].push_back(c);
  }

  bool isFolded(Index v) const {
    const std::vector<Index> cells = followedBy(v);
    std::vector<Mat3> turns;
    for (const Index c : cells) {
      const Eigen::JacobiSVD<Mat3> svd(gradientOf(lattice_.cells[c]), Eigen::ComputeFullU | Eigen::ComputeFullV);
      const Mat3 turn = svd.matrixU() * svd.matrixV().transpose();
      if (svd.singularValues()[0] > kStretched || svd.singularValues()[2] < 1.0 / kStretched ||
          turn.determinant() < 0.0)
        return true;
      turns.push_back(turn);
    }
    for (std::size_t a = 0; a < cells.size(); ++a)
      for (std::size_t b = a + 1; b < cells.size(); ++b) {
        int apart = 0;
        for (int k = 0; k < 3; ++k)
          apart += std::abs(lattice_.cells[cells[a]].place[k] - lattice_.cells[cells[b]].place[k]);
        // The trace of a rotation is 1 + 2 cos(angle).
        if (apart <= 1 && 0.5 * ((turns[a].transpose() * turns[b]).trace() - 1.0) < kFolded) return true;
      }
    return false;
  }

 private:
  // Those all of whose corners carry the vertex.
  std::vector<Index> followedBy(Index v) const {
    const auto begin = binding_.carriers.begin();
    const std::set<Index> carriers(begin + binding_.offsets[v], begin + binding_.offsets[v + 1]);
    const std::array<std::int32_t, 3> own = lattice_.cells[binding_.turners[v]].place;
    std::vector<Index> cells;
    for (std::int32_t z = -2; z <= 2; ++z)
      for (std::int32_t y = -2; y <= 2; ++y)
        for (std::int32_t x = -2; x <= 2; ++x) {
          const auto there = at_.find({own[0] + x, own[1] + y, own[2] + z});
          if (there == at_.end()) continue;
          for (const Index c : there->second) {
            const auto& corners = lattice_.cells[c].corners;
            if (std::all_of(corners.begin(), corners.end(), [&](Index i) { return carriers.count(i) > 0; }))
              cells.push_back(c);
          }
        }
    return cells;
  }

  Mat3 gradientOf(const LatticeCell& cell) const {
    const Vec3 at = 0.5 * (momentsOf(cell.filled).centroid + Vec3::Ones());
    Mat3 gradient = Mat3::Zero();
    for (int k = 0; k < 8; ++k) {
      Vec3 slope;
      for (int axis = 0; axis < 3; ++axis) {
        Vec3 along = at;
        along[axis] = 1.0;
        slope[axis] = (k >> axis & 1 ? 1.0 : -1.0) * trilinearWeight(k | 1 << axis, along) / lattice_.spacing;
      }
      gradient += particles_[cell.corners[k]] * slope.transpose();
    }
    return gradient;
  }

  const CellLattice& lattice_;
  const SurfaceBinding& binding_;
  const Points& particles_;
  std::map<std::array<std::int32_t, 3>, std::vector<Index>> at_;
};

}  // namespace

Folds foldsOf(const SeenBody& body) {
  const std::vector<Triangle>& triangles = body.surface.triangles;
  const double flattest = kSliver * meanEdgeLength({body.rest, triangles, {}});
  std::vector<Side> sides;
  std::vector<Vec3> was(triangles.size()), is(triangles.size());
  for (Index f = 0; f < triangles.size(); ++f) {
    const Triangle& t = triangles[f];
    was[f] = normalOf(body.rest, t, flattest);
    is[f] = normalOf(body.surface.vertices, t, flattest);
    for (int k = 0; k < 3; ++k) sides.push_back({std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3]), f});
  }
  std::sort(sides.begin(), sides.end());
  std::optional<TissueBeneath> tissue;
  Folds folds;
  for (std::size_t s = 0; s + 1 < sides.size(); ++s) {
    const Side &a = sides[s], &b = sides[s + 1];
    if (a.low != b.low || a.high != b.high) continue;
    if (!(was[a.triangle].dot(was[b.triangle]) > kFlat && is[a.triangle].dot(is[b.triangle]) < kFolded)) continue;
    if (is[a.triangle].isZero(0.0) || is[b.triangle].isZero(0.0)) continue;
    if (!tissue && body.model && body.model->lattice) tissue.emplace(*body.model, body.particles);
    ++(tissue && (tissue->isFolded(a.low) || tissue->isFolded(a.high)) ? folds.of_tissue : folds.of_surface);
  }
  return folds;
}

Finding foldLaw(const Seen& seen) {
  std::size_t sum = 0, of_tissue = 0, most = 0;
  std::string where;
  for (const SeenBody& body : seen.bodies) {
    const Folds folds = foldsOf(body);
    sum += folds.of_surface;
    of_tissue += folds.of_tissue;
    if (folds.of_surface <= most) continue;
    most = folds.of_surface;
    where = body.name;
  }
  Finding worst;
  if (sum > 0)
    worst.take(1.0 + static_cast<double>(sum),
               words(sum, " edges are folded over, most of ", where, ", and ", of_tissue, " with the tissue"));
  return worst;
}

}  // namespace meshless
