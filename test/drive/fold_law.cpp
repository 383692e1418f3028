#include "drive/fold_law.h"

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <set>

#include <Eigen/Dense>

#include "meshless_surgery/geometry/lattice/cell_lattice.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "drive/words.h"

namespace meshless {
namespace {

constexpr double kFlat = 0.866;   // cosine of 30 degrees
constexpr double kFolded = 0.5;   // of 60
constexpr double kSliver = 0.02;  // of the mean edge
constexpr double kStretched = 2.0;
constexpr double kFolds = 2e-3;       // of all edges
constexpr double kFlatTissue = 0.01;  // of the largest moment of particles around one: less is a sheet

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

/// Gradients of the deformation beneath a vertex: the tissue folds where it is stretched or pressed too much, inverted,
/// or turned against what is next to it.
bool isFolded(const std::vector<Mat3>& gradients, const std::function<bool(std::size_t, std::size_t)>& next_to) {
  std::vector<Mat3> turns;
  for (const Mat3& gradient : gradients) {
    const Eigen::JacobiSVD<Mat3> svd(gradient, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Mat3 turn = svd.matrixU() * svd.matrixV().transpose();
    if (svd.singularValues()[0] > kStretched || svd.singularValues()[2] < 1.0 / kStretched || turn.determinant() < 0.0)
      return true;
    turns.push_back(turn);
  }
  // The trace of a rotation is 1 + 2 cos(angle).
  for (std::size_t a = 0; a < turns.size(); ++a)
    for (std::size_t b = a + 1; b < turns.size(); ++b)
      if (next_to(a, b) && 0.5 * ((turns[a].transpose() * turns[b]).trace() - 1.0) < kFolded) return true;
  return false;
}

class Tissue {
 public:
  virtual ~Tissue() = default;
  virtual bool isFolded(Index vertex) const = 0;
};

// That of a body of cells.
class TissueOfCells : public Tissue {
 public:
  TissueOfCells(const BodyModel& model, const Points& particles)
      : lattice_(*model.lattice), binding_(model.binding), particles_(particles) {
    for (Index c = 0; c < lattice_.cells.size(); ++c) at_[lattice_.cells[c].place].push_back(c);
  }

  bool isFolded(Index v) const override {
    const std::vector<Index> cells = followedBy(v);
    std::vector<Mat3> gradients;
    for (const Index c : cells) gradients.push_back(gradientOf(lattice_.cells[c]));
    return meshless::isFolded(gradients, [&](std::size_t a, std::size_t b) {
      int apart = 0;
      for (int k = 0; k < 3; ++k)
        apart += std::abs(lattice_.cells[cells[a]].place[k] - lattice_.cells[cells[b]].place[k]);
      return apart <= 1;
    });
  }

 private:
  // Those all of whose corners carry the vertex.
  std::vector<Index> followedBy(Index v) const {
    const auto begin = binding_.carriers.begin();
    const std::set<Index> carriers(begin + binding_.offsets[v], begin + binding_.offsets[v + 1]);
    const std::array<std::int32_t, 3> own = lattice_.cells[binding_.cells[v]].place;
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

// That of a body without an inside: around the particle that a vertex is or follows most, and around its neighbours.
class TissueOfClusters : public Tissue {
 public:
  TissueOfClusters(const BodyModel& model, const Points& particles) : model_(model), particles_(particles) {
    const SurfaceBinding& binding = model.binding;
    for (Index v = 0; v < binding.size(); ++v) {
      const auto begin = binding.weights.begin() + binding.offsets[v], end = binding.weights.begin() + binding.offsets[v + 1];
      particle_.push_back(binding.carriers[std::max_element(begin, end) - binding.weights.begin()]);
    }
  }

  bool isFolded(Index v) const override {
    const Index own = particle_[v];
    std::vector<Mat3> gradients{gradientAt(own)};
    const ParticleGraph& graph = model_.graph;
    for (Index k = graph.offsets[own]; k < graph.offsets[own + 1]; ++k)
      gradients.push_back(gradientAt(graph.neighbours[k]));
    return meshless::isFolded(gradients, [](std::size_t a, std::size_t) { return a == 0; });
  }

 private:
  // Least squares over the neighbours; in a sheet, what is across it keeps its length.
  Mat3 gradientAt(Index i) const {
    const ParticleGraph& graph = model_.graph;
    Mat3 between = Mat3::Zero(), rest = Mat3::Zero();
    for (Index k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k) {
      const Index j = graph.neighbours[k];
      const Vec3 was = model_.rest[j] - model_.rest[i], is = particles_[j] - particles_[i];
      between += is * was.transpose();
      rest += was * was.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Mat3> axes(rest);
    const Vec3& moments = axes.eigenvalues();  // ascending
    if (!(moments[1] > kFlatTissue * moments[2])) return Mat3::Identity();
    Mat3 gradient = Mat3::Zero();
    std::array<Vec3, 3> along;
    for (int k = 0; k < 3; ++k) along[k] = between * axes.eigenvectors().col(k) / moments[k];
    if (!(moments[0] > kFlatTissue * moments[2]))
      along[0] = axes.eigenvectors().determinant() * along[1].cross(along[2]).normalized();
    for (int k = 0; k < 3; ++k) gradient += along[k] * axes.eigenvectors().col(k).transpose();
    return gradient;
  }

  const BodyModel& model_;
  const Points& particles_;
  std::vector<Index> particle_;  // one a vertex
};

std::unique_ptr<Tissue> tissueOf(const SeenBody& body) {
  if (!body.model) return nullptr;
  if (body.model->lattice) return std::make_unique<TissueOfCells>(*body.model, body.particles);
  return std::make_unique<TissueOfClusters>(*body.model, body.particles);
}

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
  std::unique_ptr<Tissue> tissue;
  Folds folds;
  for (std::size_t s = 0; s + 1 < sides.size(); ++s) {
    const Side &a = sides[s], &b = sides[s + 1];
    if (a.low != b.low || a.high != b.high) continue;
    if (!(was[a.triangle].dot(was[b.triangle]) > kFlat && is[a.triangle].dot(is[b.triangle]) < kFolded)) continue;
    if (is[a.triangle].isZero(0.0) || is[b.triangle].isZero(0.0)) continue;
    if (!tissue) tissue = tissueOf(body);
    ++(tissue && (tissue->isFolded(a.low) || tissue->isFolded(a.high)) ? folds.of_tissue : folds.of_surface);
  }
  return folds;
}

Finding foldLaw(const Seen& seen) {
  std::size_t sum = 0, of_tissue = 0, most = 0, edges = 0;
  std::string where;
  for (const SeenBody& body : seen.bodies) {
    const Folds folds = foldsOf(body);
    sum += folds.of_surface;
    of_tissue += folds.of_tissue;
    edges += 3 * body.surface.triangles.size() / 2;
    if (folds.of_surface <= most) continue;
    most = folds.of_surface;
    where = body.name;
  }
  Finding worst;
  if (sum > 0)
    worst.take(
        static_cast<double>(sum) / (kFolds * static_cast<double>(edges)),
        words(sum, " of ", edges, " edges are folded over, most of ", where, ", and ", of_tissue, " with the tissue"));
  return worst;
}

}  // namespace meshless
