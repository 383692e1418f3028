#include "piece_maker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <unordered_map>
#include <unordered_set>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/dynamics/plastic.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "piece_parts.h"
#include "side_by_side.h"

namespace meshless {
namespace {

template <class Get>
Vec3 interpolate(const VertexOrigin& origin, const Get& get) {
  Vec3 sum = Vec3::Zero();
  for (int k = 0; k < 4; ++k)
    if (origin.parents[k] != kNoIndex) sum += origin.weights[k] * get(origin.parents[k]);
  return sum;
}

// Of its bits: both sides of a cut have the same places to the bit.
struct HashOfPlace {
  std::size_t operator()(const Vec3& p) const {
    std::uint64_t hash = 0;
    for (int axis = 0; axis < 3; ++axis) {
      std::uint64_t bits;
      const double x = p[axis] + 0.0;  // -0 is 0
      std::memcpy(&bits, &x, sizeof bits);
      hash = (hash ^ bits) * 0x9e3779b97f4a7c15u;
      hash ^= hash >> 32;
    }
    return hash;
  }
};

// The moments of the material that the parent has. What a cut leaves of a cell can be so narrow that its stress would
// need a shorter step: it then resists as a flat cluster does, and the parent's frequency holds for the piece as well.
void inheritMoments(const BodyModel& parent, const std::vector<Index>& members, BodyModel& child) {
  constexpr double kNarrower = 1.3;
  child.match_masses = child.masses;
  for (std::size_t i = 0; i < members.size(); ++i)
    child.match_masses[i] *= parent.match_masses[members[i]] / parent.masses[members[i]];
  child.shape = makeRestShape(child.rest, child.match_masses, child.clusters);
  if (!parent.shape.quadratic.empty()) addQuadraticRest(child.rest, child.match_masses, child.clusters, child.shape);
  if (parent.elastic.empty()) return;
  child.most_spread_inverse = parent.most_spread_inverse;
  double squared = parent.highest_frequency * parent.highest_frequency;
  if (std::isinf(parent.most_spread_inverse)) {  // the first cut of this body
    double narrowest = 0.0;
    for (const ElasticRest& e : parent.elastic) narrowest = std::max(narrowest, e.spread_inverse.norm());
    child.most_spread_inverse = kNarrower * narrowest;
    squared *= kNarrower;
  }
  makeElastic(child);
  double least = 0.0;
  for (const ElasticRest& e : child.elastic)
    if (e.spread > 0.0) least = std::max(least, 1.0 / e.spread);
  child.specific_stiffness = parent.specific_stiffness;
  child.highest_frequency = std::sqrt(std::max(squared, parent.specific_stiffness * least));
}

}  // namespace

// A piece without a particle would have no mass: it takes a part of the parent's nearest particle, which moves on with
// the same velocity, so that mass and momentum stay what they were.
struct PieceMaker::Crumb {
  Index donor;
  double mass;  // [kg]
};

PieceMaker::PieceMaker(const BodyModel& model, const BodyState& state, std::uint32_t new_patch)
    : model_(model), state_(state), new_patch_(new_patch) {
  embedded_of_.assign(model.surface.vertices.size(), kNoIndex);
  for (Index r = 0; r < model.binding.embedded.size(); ++r) embedded_of_[model.binding.embedded[r]] = r;
}

void PieceMaker::tear(ParticleGraph graph, std::vector<bool> torn) {
  graph_ = std::move(graph);
  torn_ = std::move(torn);
}

void PieceMaker::foresee(const Plane& plane) {
  rest_places_.emplace(model_, state_);
  rest_places_->foresee([&](const Vec3& p) { return std::abs(plane.height(p)) < model_.spacing; });
}

void PieceMaker::foresee(const Blade& blade) {
  rest_places_.emplace(model_, state_);
  const Plane plane = blade.plane();
  rest_places_->foresee([&](const Vec3& p) {
    const double along = blade.x_axis.dot(p - blade.origin), up = blade.y_axis.dot(p - blade.origin);
    return std::abs(plane.height(p)) < model_.spacing && along > -model_.spacing &&
           along < blade.length + model_.spacing && up < model_.spacing && up > -blade.depth - model_.spacing;
  });
}

std::vector<BodyPiece> PieceMaker::make(const std::vector<PieceSource>& sources) {
  double whole = 0.0;
  for (const PieceSource& source : sources) whole += std::abs(signedVolume(source.mesh));
  std::vector<double> masses = model_.masses;
  std::vector<std::optional<Crumb>> crumbs(sources.size());
  for (std::size_t p = 0; p < sources.size(); ++p) {
    if (!sources[p].members.empty()) continue;
    const Vec3 centre = solidCentroid(sources[p].mesh);
    Crumb crumb{0, 0.0};
    for (Index i = 0; i < model_.rest.size(); ++i)
      if ((state_.positions[i] - centre).squaredNorm() < (state_.positions[crumb.donor] - centre).squaredNorm())
        crumb.donor = i;
    const double share = whole > 0.0 ? model_.mass * std::abs(signedVolume(sources[p].mesh)) / whole : 0.0;
    crumb.mass = std::min(std::max(share, 1e-6 * masses[crumb.donor]), 0.5 * masses[crumb.donor]);
    masses[crumb.donor] -= crumb.mass;
    crumbs[p] = crumb;
  }
  std::vector<RestShape> rest = restVertices(sources);
  std::vector<BodyPiece> pieces;
  pieces.resize(sources.size());
  std::vector<CutWork> works(sources.size());
  // Pieces do not know of each other: the two large ones of most cuts are made side by side.
  inChunks(sources.size(), 1, [&](std::size_t p, std::size_t) {
    pieces[p] = makeOne(sources[p], std::move(rest[p]), masses, crumbs[p] ? &*crumbs[p] : nullptr, works[p]);
  });
  for (const CutWork& work : works) work_ += work;
  return pieces;
}

BodyPiece PieceMaker::makeOne(const PieceSource& from, RestShape rest, const std::vector<double>& masses,
                              const Crumb* crumb, CutWork& work) const {
  BodyPiece piece;
  auto child = beginPiece(model_, from.mesh, std::move(rest.vertices), !torn_.empty());

  piece.parent_particles = from.members;
  std::vector<Index> renumbered(model_.rest.size(), kNoIndex);
  for (Index i : from.members) {
    renumbered[i] = static_cast<Index>(child->rest.size());
    child->rest.push_back(model_.rest[i]);
    child->masses.push_back(masses[i]);
    child->fixed.push_back(model_.fixed[i]);
    child->any_fixed = child->any_fixed || model_.fixed[i];
    piece.state.positions.push_back(state_.positions[i]);
    piece.state.velocities.push_back(state_.velocities[i]);
  }
  child->graph = subgraph(graph_.offsets.empty() ? model_.graph : graph_, from.members);
  if (crumb) {
    child->rest.push_back(solidCentroid(child->surface));
    child->masses.push_back(crumb->mass);
    child->fixed.push_back(false);
    piece.state.positions.push_back(solidCentroid(from.mesh));
    piece.state.velocities.push_back(state_.velocities[crumb->donor]);
    piece.parent_particles.push_back(kNoIndex);
    child->graph = makeGraph(child->rest, {});
  }
  for (double m : child->masses) child->mass += m;
  PieceClusters clusters = splitClusters(model_.clusters, child->rest, child->graph, from.members, torn_);
  work.kept_clusters = clusters.kept;
  work.rebuilt_clusters = clusters.rebuilt;
  child->clusters = std::move(clusters.clusters);
  inheritMoments(model_, from.members, *child);
  piece.state.poses.resize(child->clusters.size());
  piece.state.plastic =
      inheritShapes(state_.plastic, model_.clusters, child->clusters, clusters.origin, piece.parent_particles);
  fitClusters(matchInput(*child, piece.state), piece.state.positions, piece.state.poses);

  std::vector<Index> vertex_particle;
  std::vector<bool> taken(child->rest.size(), false);
  InheritedBinding inherited{model_.binding, {}, renumbered, {}, nullptr};
  for (Index at = 0; at < from.origins.size(); ++at) {
    const Index v = from.origins.same(at);
    if (v == kNoIndex) ++work.new_vertices;
    inherited.embedded.push_back(v == kNoIndex ? kNoIndex : embedded_of_[v]);
    inherited.start.push_back(v == kNoIndex ? startOf(from, at, rest.inside[at], renumbered) : kNoIndex);
    const Index parent = v == kNoIndex ? kNoIndex : model_.binding.particle[v];
    Index mine = parent == kNoIndex ? kNoIndex : renumbered[parent];
    // A vertex that was split is in the piece twice; one of the two is embedded.
    if (mine != kNoIndex && (taken[mine] || (from.separated && from.separated(at, parent)))) mine = kNoIndex;
    if (mine != kNoIndex) taken[mine] = true;
    vertex_particle.push_back(mine);
  }
  if (from.separated)
    inherited.separated = [&](Index vertex, Index particle) {
      const Index parent = piece.parent_particles[particle];
      return parent != kNoIndex && from.separated(vertex, parent);
    };
  child->binding = bindSurface(child->rest, child->graph, child->clusters, child->surface.vertices,
                               std::move(vertex_particle), &inherited);
  work.bound_embedded = child->binding.bound;
  work.kept_embedded = child->binding.embedded.size() - child->binding.bound;
  for (std::uint32_t patch : from.mesh.patches) work.new_triangles += patch == new_patch_;
  finishPiece(state_, std::move(child), piece);
  return piece;
}

// Both sides of a cut have the same points inside: each is searched for once.
std::vector<PieceMaker::RestShape> PieceMaker::restVertices(const std::vector<PieceSource>& sources) {
  std::vector<RestShape> all(sources.size());
  Points inside;
  std::vector<KnownPlace> rim;
  std::unordered_map<Vec3, Index, HashOfPlace> inside_at;
  std::unordered_set<Vec3, HashOfPlace> rim_at;
  inChunks(sources.size(), 1, [&](std::size_t s, std::size_t) {
    for (Index v = 0; v < sources[s].origins.size(); ++v) {
      const Index same = sources[s].origins.same(v);
      all[s].vertices.push_back(same != kNoIndex ? model_.surface.vertices[same]
                                                 : interpolate(sources[s].origins[v], [&](Index parent) {
                                                     return model_.surface.vertices[parent];
                                                   }));
    }
  });
  for (std::size_t s = 0; s < sources.size(); ++s) {
    const PieceSource& source = sources[s];
    all[s].inside.assign(source.origins.size(), kNoIndex);
    bool any = false;
    for (Index v = 0; v < source.origins.size(); ++v) {
      if (!source.origins.insideCap(v)) continue;
      any = true;
      const auto [at, is_new] = inside_at.emplace(source.mesh.vertices[v], static_cast<Index>(inside.size()));
      all[s].inside[v] = at->second;
      if (is_new) inside.push_back(source.mesh.vertices[v]);
    }
    if (!any) continue;
    for (std::size_t t = 0; t < source.mesh.triangles.size(); ++t) {
      if (source.mesh.patches[t] != new_patch_) continue;
      for (Index v : source.mesh.triangles[t])
        if (!source.origins.insideCap(v) && rim_at.insert(source.mesh.vertices[v]).second)
          rim.push_back({source.mesh.vertices[v], all[s].vertices[v]});
    }
  }
  if (inside.empty()) return all;
  if (!rest_places_) rest_places_.emplace(model_, state_);
  places_ = rest_places_->of(inside, rim);
  for (RestShape& shape : all)
    for (Index v = 0; v < shape.vertices.size(); ++v)
      if (shape.inside[v] != kNoIndex) shape.vertices[v] = places_.rest[shape.inside[v]];
  return all;
}

Index PieceMaker::startOf(const PieceSource& source, Index vertex, Index inside,
                          const std::vector<Index>& renumbered) const {
  const auto firstOf = [&](auto begin, auto end) {
    for (; begin != end; ++begin)
      if (*begin != kNoIndex && renumbered[*begin] != kNoIndex &&
          !(source.separated && source.separated(vertex, *begin)))
        return renumbered[*begin];
    return kNoIndex;
  };
  if (inside != kNoIndex) {
    const auto& nearest = places_.nearest[inside];
    if (const Index start = firstOf(nearest.begin(), nearest.end()); start != kNoIndex) return start;
    const auto around = model_.graph.neighbours.begin();
    return firstOf(around + model_.graph.offsets[nearest[0]], around + model_.graph.offsets[nearest[0] + 1]);
  }
  for (const Index parent : source.origins[vertex].parents) {
    if (parent == kNoIndex) continue;
    const Index particle = model_.binding.particle[parent], embedded = embedded_of_[parent];
    const auto carriers = model_.binding.carriers.begin();
    const Index start = particle != kNoIndex ? firstOf(&particle, &particle + 1)
                                             : firstOf(carriers + model_.binding.offsets[embedded],
                                                       carriers + model_.binding.offsets[embedded + 1]);
    if (start != kNoIndex) return start;
  }
  return kNoIndex;
}

}  // namespace meshless
