#include "met_body.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/geometry/query/union_find.h"
#include "place_set.h"

namespace meshless {
namespace {

constexpr double kClosed = 0.3;  // [spacing] sides that are no farther apart are closed
constexpr double kAround = 1.5;  // [spacing] tissue that close to a blade leads it to rest

std::array<std::int32_t, 3> cornerOf(const std::array<std::int32_t, 3>& place, int k) {
  return {place[0] + (k & 1), place[1] + (k >> 1 & 1), place[2] + (k >> 2)};
}

class ClosedTissue {
 public:
  /// `positions` [m] of the particles.
  ClosedTissue(const BodyModel& model, const Points& positions);

  /// [m] of the particles.
  const Points& positions() const { return positions_; }
  /// [m] of the vertices of a surface, which are `present` and at `rest` follow these cells.
  Points surface(const Points& rest, const std::vector<Index>& cells, const Points& present) const;

 private:
  using Corner = std::array<std::int32_t, 3>;  // of the lattice
  struct Hash {
    std::size_t operator()(const Corner& corner) const {
      std::size_t hash = 0;
      for (const std::int32_t k : corner) hash = hash * 0x9e3779b97f4a7c15u + static_cast<std::uint32_t>(k);
      return hash;
    }
  };
  struct Copies {
    std::vector<Index> particles;
    bool wounded = false;  // a cell at it is one of several at its place, or has links that a blade has cut
  };

  void findCopies();
  void close();
  /// [m] where the tissue of a cell has a corner of the lattice.
  Vec3 positionOf(const Corner& corner, const Copies& copies, const LatticeCell& cell) const;

  const CellLattice& lattice_;
  Points positions_;
  std::unordered_map<Corner, Copies, Hash> corners_;  // around wounds
  Points tissue_;                                     // [m] from each particle there to the middle of its tissue
  std::vector<bool> near_;                            // cells with a wound within two places
};

ClosedTissue::ClosedTissue(const BodyModel& model, const Points& positions)
    : lattice_(*model.lattice), positions_(positions) {
  findCopies();
  close();
}

void ClosedTissue::findCopies() {
  const std::vector<LatticeCell>& cells = lattice_.cells;
  std::vector<PlaceSet::Place> places;
  for (const LatticeCell& cell : cells) places.push_back(cell.place);
  PlaceSet held(places, 3), wounded(places, 3);
  for (Index c = 0; c < cells.size(); ++c) {
    if (cells[c].isBridge(c)) continue;
    const LinkSet& parted = cells[c].parted;
    if (held.has(cells[c].place) || parted[0] || parted[1] || parted[2]) wounded.at(cells[c].place) = true;
    held.at(cells[c].place) = true;
  }
  PlaceSet around = wounded;
  around.widen(true);
  PlaceSet near = around;
  near.widen(true);
  near_.reserve(cells.size());
  tissue_.assign(positions_.size(), Vec3::Zero());
  std::vector<int> uses(positions_.size(), 0);
  for (Index c = 0; c < cells.size(); ++c) {
    const LatticeCell& cell = cells[c];
    near_.push_back(near.has(cell.place));
    if (cell.isBridge(c) || !around.has(cell.place)) continue;
    const Vec3 at = cell.filled ? Vec3(0.5 * (momentsOf(cell.filled).centroid + Vec3::Ones())) : Vec3::Constant(0.5);
    Vec3 middle = Vec3::Zero();
    for (int k = 0; k < 8; ++k) middle += trilinearWeight(k, at) * positions_[cell.corners[k]];
    for (int k = 0; k < 8; ++k) {
      const Index particle = cell.corners[k];
      Copies& copies = corners_[cornerOf(cell.place, k)];
      if (uses[particle]++ == 0) copies.particles.push_back(particle);
      copies.wounded = copies.wounded || wounded.has(cell.place);
      tissue_[particle] += middle - positions_[particle];
    }
  }
  for (std::size_t p = 0; p < tissue_.size(); ++p)
    if (uses[p] > 1) tissue_[p] /= uses[p];
}

void ClosedTissue::close() {
  for (const auto& [corner, copies] : corners_) {
    const std::vector<Index>& particles = copies.particles;
    const Index count = static_cast<Index>(particles.size());
    UnionFind sides(count);
    for (Index i = 0; i < count; ++i)
      for (Index j = i + 1; j < count; ++j) {
        const Index a = particles[i], b = particles[j];
        const Vec3 across = tissue_[b] - tissue_[a];
        const double apart = (positions_[b] - positions_[a]).dot(across);
        if (!(apart > kClosed * lattice_.spacing * across.norm())) sides.join(i, j);
      }
    std::vector<Vec3> sums(count, Vec3::Zero());
    std::vector<int> members(count, 0);
    for (Index i = 0; i < count; ++i) {
      sums[sides.find(i)] += positions_[particles[i]];
      ++members[sides.find(i)];
    }
    for (Index i = 0; i < count; ++i)
      if (const Index side = sides.find(i); members[side] > 1) positions_[particles[i]] = sums[side] / members[side];
  }
}

Vec3 ClosedTissue::positionOf(const Corner& corner, const Copies& copies, const LatticeCell& cell) const {
  const std::array<std::int32_t, 3> at{corner[0] - cell.place[0], corner[1] - cell.place[1], corner[2] - cell.place[2]};
  if (std::all_of(at.begin(), at.end(), [](std::int32_t n) { return n == 0 || n == 1; }))
    return positions_[cell.corners[static_cast<std::size_t>(at[0] + 2 * at[1] + 4 * at[2])]];
  Vec3 there = Vec3::Zero();
  for (int k = 0; k < 8; ++k) there += trilinearWeight(k, Vec3(at[0], at[1], at[2])) * positions_[cell.corners[k]];
  if (copies.particles.empty()) return there;
  return positions_[*std::min_element(copies.particles.begin(), copies.particles.end(), [&](Index a, Index b) {
    return (positions_[a] - there).squaredNorm() < (positions_[b] - there).squaredNorm();
  })];
}

Points ClosedTissue::surface(const Points& rest, const std::vector<Index>& cells, const Points& present) const {
  static const Copies kNone;
  Points closed = present;
  for (std::size_t v = 0; v < rest.size(); ++v) {
    if (!near_[cells[v]]) continue;
    const Corner place = lattice_.placeOf(rest[v]);
    const Vec3 at = (rest[v] - lattice_.origin) / lattice_.spacing - Vec3(place[0], place[1], place[2]);
    std::array<const Copies*, 8> copies;
    double wounded = 0.0;  // 0..1
    for (int k = 0; k < 8; ++k) {
      const auto found = corners_.find(cornerOf(place, k));
      copies[k] = found == corners_.end() ? &kNone : &found->second;
      if (copies[k]->wounded) wounded += trilinearWeight(k, at);
    }
    if (!(wounded > 0.0)) continue;
    Vec3 by_corners = Vec3::Zero();
    for (int k = 0; k < 8; ++k)
      by_corners += trilinearWeight(k, at) * positionOf(cornerOf(place, k), *copies[k], lattice_.cells[cells[v]]);
    const bool all = std::all_of(copies.begin(), copies.end(), [](const Copies* c) { return c->wounded; });
    closed[v] = all ? by_corners : Vec3(present[v] + wounded * (by_corners - present[v]));
  }
  return closed;
}

/// [m] from a point to the blade's rectangle.
double distanceTo(const Blade& blade, const Vec3& p) {
  const Vec3 r = p - blade.origin;
  const double along = blade.x_axis.dot(r), up = blade.y_axis.dot(r);
  const Vec2 beside(along - std::clamp(along, -blade.behind, blade.length),
                    up - std::clamp(up, -blade.depth, blade.rise));
  return std::hypot(blade.height(p), beside.norm());
}

}  // namespace

MetBody::MetBody(const BodyModel& model) : positions(model.rest), surface(model.surface) {
  if (!model.collision) return;
  collision = model.collision->mesh;
  collision.patches.resize(collision.triangles.size(), kOuterPatch);
}

MetBody::MetBody(const BodyModel& model, const BodyState& state) : MetBody(model) {
  positions = state.positions;
  surface.vertices = state.surface;
  if (model.collision) collision.vertices = collisionPlaces(model, state.positions);
  if (!model.incised) return;
  const ClosedTissue closed(model, state.positions);
  positions = closed.positions();
  surface.vertices = closed.surface(model.surface.vertices, model.binding.cells, surface.vertices);
  if (model.collision)
    collision.vertices =
        closed.surface(model.collision->mesh.vertices, model.collision->binding.cells, collision.vertices);
}

std::optional<Blade> bladeAtRest(const BodyModel& model, const BodyState& state, const Blade& blade) {
  // The tissue that the blade meets first, and what is around that at rest: other tissue may lie in it now.
  const double near = kAround * model.spacing, reach = std::hypot(blade.length + blade.behind, blade.depth + blade.rise) + near;
  Index first = kNoIndex;
  for (Index v = 0; v < state.surface.size(); ++v)
    if (distanceTo(blade, state.surface[v]) < near &&
        (first == kNoIndex || blade.y_axis.dot(state.surface[v] - state.surface[first]) > 0.0))
      first = v;
  if (first == kNoIndex) return std::nullopt;
  std::vector<Index> around;
  Vec3 middle = Vec3::Zero(), rest_middle = Vec3::Zero();
  for (Index i = 0; i < model.rest.size(); ++i) {
    if (!((model.rest[i] - model.surface.vertices[first]).norm() < reach)) continue;
    if (!(distanceTo(blade, state.positions[i]) < near)) continue;
    around.push_back(i);
    middle += state.positions[i];
    rest_middle += model.rest[i];
  }
  if (around.size() < 8) return std::nullopt;
  middle /= static_cast<double>(around.size());
  rest_middle /= static_cast<double>(around.size());
  Mat3 now = Mat3::Zero(), both = Mat3::Zero();
  for (const Index i : around) {
    const Vec3 p = state.positions[i] - middle;
    now += p * p.transpose();
    both += (model.rest[i] - rest_middle) * p.transpose();
  }
  const Mat3 map = both * now.inverse();
  if (!map.allFinite() || !(map.determinant() > 0.0)) return std::nullopt;
  Blade led = blade;
  led.origin = rest_middle + map * (blade.origin - middle);
  const Vec3 along = map * blade.x_axis, up = map * blade.y_axis;
  led.x_axis = along.normalized();
  const Vec3 aside = up - up.dot(led.x_axis) * led.x_axis;
  led.y_axis = aside.normalized();
  led.length *= along.norm();
  led.behind *= along.norm();
  led.depth *= aside.norm();
  led.rise *= aside.norm();
  return led;
}

}  // namespace meshless
