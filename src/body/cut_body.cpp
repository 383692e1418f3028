#include "meshless_surgery/body/cut_body.h"

#include <algorithm>
#include <limits>
#include <queue>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/body/rest_places.h"
#include "meshless_surgery/dynamics/plastic.h"
#include "meshless_surgery/geometry/measures.h"
#include "meshless_surgery/geometry/nearest.h"

namespace meshless {
namespace {

constexpr int kNoPiece = -1;

template <class Get>
Vec3 interpolate(const VertexOrigin& origin, const Get& get) {
  Vec3 sum = Vec3::Zero();
  for (int k = 0; k < 4; ++k)
    if (origin.parents[k] != kNoIndex) sum += origin.weights[k] * get(origin.parents[k]);
  return sum;
}

// A vertex inside the cap, which no edge of the parent leads to.
bool insideCap(const VertexOrigin& origin) { return origin.parents[0] == kNoIndex; }

// The parent vertex that a piece's vertex is; kNoIndex for vertices that the cut made.
Index sameVertex(const VertexOrigin& origin) {
  return origin.parents[1] == kNoIndex && origin.parents[2] == kNoIndex ? origin.parents[0] : kNoIndex;
}

// The piece of every particle. Surface particles are where their vertex is; the others take the piece of the nearest
// one along the body on their side of the plane.
std::vector<int> assignParticles(const BodyModel& model, const BodyState& state, const Plane& plane,
                                 const CutSurface& cut) {
  std::vector<int> piece_of(model.rest.size(), kNoPiece);
  for (std::size_t p = 0; p < cut.pieces.size(); ++p)
    for (const VertexOrigin& origin : cut.pieces[p].origins) {
      const Index v = sameVertex(origin);
      if (v == kNoIndex || model.binding.particle[v] == kNoIndex) continue;
      int& piece = piece_of[model.binding.particle[v]];
      if (piece == kNoPiece) piece = static_cast<int>(p);  // one on the plane goes to the larger piece
    }
  const auto sideOf = [&](Index i) { return plane.height(state.positions[i]) >= 0.0 ? 1 : -1; };
  // A side with one piece needs no search.
  int only[2] = {kNoPiece, kNoPiece};
  for (const int side : {-1, 1}) {
    int& piece = only[side > 0];
    for (std::size_t p = 0; p < cut.pieces.size(); ++p)
      if (cut.pieces[p].side == side) piece = piece == kNoPiece ? static_cast<int>(p) : kNoPiece - 1;
  }
  bool all = true;
  for (Index i = 0; i < model.rest.size(); ++i) {
    if (piece_of[i] == kNoPiece && only[sideOf(i) > 0] >= 0) piece_of[i] = only[sideOf(i) > 0];
    all = all && piece_of[i] != kNoPiece;
  }
  if (all) return piece_of;
  using Entry = std::pair<double, Index>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue;
  std::vector<double> distance(model.rest.size(), std::numeric_limits<double>::infinity());
  for (Index i = 0; i < model.rest.size(); ++i)
    if (piece_of[i] != kNoPiece) {
      distance[i] = 0.0;
      queue.push({0.0, i});
    }
  while (!queue.empty()) {
    const auto [d, i] = queue.top();
    queue.pop();
    if (d > distance[i]) continue;
    for (Index k = model.graph.offsets[i]; k < model.graph.offsets[i + 1]; ++k) {
      const Index j = model.graph.neighbours[k];
      const double there = d + model.graph.lengths[k];
      if (!(there < distance[j]) || sideOf(j) != cut.pieces[static_cast<std::size_t>(piece_of[i])].side) continue;
      distance[j] = there;
      piece_of[j] = piece_of[i];
      queue.push({there, j});
    }
  }
  // What no path reached goes to the piece on its side with the nearest vertex.
  for (Index i = 0; i < model.rest.size(); ++i) {
    if (piece_of[i] != kNoPiece) continue;
    double best = std::numeric_limits<double>::infinity();
    for (int pass = 0; pass < 2 && piece_of[i] == kNoPiece; ++pass)
      for (std::size_t p = 0; p < cut.pieces.size(); ++p) {
        if (pass == 0 && cut.pieces[p].side != sideOf(i)) continue;
        for (const Vec3& v : cut.pieces[p].mesh.vertices)
          if ((v - state.positions[i]).squaredNorm() < best) {
            best = (v - state.positions[i]).squaredNorm();
            piece_of[i] = static_cast<int>(p);
          }
      }
  }
  return piece_of;
}

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

// The vertices of a piece in the rest shape.
Points restVertices(const BodyModel& model, const BodyState& state, const CutPiece& piece, std::uint32_t cap_patch) {
  Points rest;
  std::vector<Index> inside;
  for (Index v = 0; v < piece.origins.size(); ++v) {
    if (insideCap(piece.origins[v])) inside.push_back(v);
    rest.push_back(interpolate(piece.origins[v], [&](Index parent) { return model.surface.vertices[parent]; }));
  }
  if (inside.empty()) return rest;
  std::vector<bool> on_cap(rest.size(), false);
  for (std::size_t t = 0; t < piece.mesh.triangles.size(); ++t)
    if (piece.mesh.patches[t] == cap_patch)
      for (Index v : piece.mesh.triangles[t]) on_cap[v] = true;
  std::vector<KnownPlace> rim;
  for (Index v = 0; v < rest.size(); ++v)
    if (on_cap[v] && !insideCap(piece.origins[v])) rim.push_back({piece.mesh.vertices[v], rest[v]});
  Points present;
  for (Index v : inside) present.push_back(piece.mesh.vertices[v]);
  const Points places = restPlaces(model, state, present, rim);
  for (std::size_t k = 0; k < inside.size(); ++k) rest[inside[k]] = places[k];
  return rest;
}

// A piece without a particle would have no mass: it takes a part of the parent's nearest particle, which moves on with
// the same velocity, so that mass and momentum stay what they were.
struct Crumb {
  std::size_t piece;
  Index donor;
  double mass;  // [kg]
};

}  // namespace

Result<CutBody> cutBody(const BodyModel& model, const BodyState& state, const Plane& plane) {
  if (!model.solid)
    return Error{ErrorCode::kUnsuitableShape, "its surface is open, so it cannot be cut into closed pieces"};
  TriangleMesh present;
  present.vertices = state.surface;
  present.triangles = model.surface.triangles;
  present.patches = model.surface.patches;
  CutOptions options;
  options.cap_patch = model.next_patch;
  Result<CutSurface> cut = cutByPlane(present, plane, options);
  if (!cut) return cut.error();

  const std::vector<int> piece_of = assignParticles(model, state, plane, *cut);
  std::vector<std::vector<Index>> members(cut->pieces.size());
  for (Index i = 0; i < model.rest.size(); ++i) members[static_cast<std::size_t>(piece_of[i])].push_back(i);

  std::vector<double> masses = model.masses;
  std::vector<Crumb> crumbs;
  const double whole = std::abs(signedVolume(present));
  for (std::size_t p = 0; p < members.size(); ++p) {
    if (!members[p].empty()) continue;
    const Vec3 centre = solidCentroid(cut->pieces[p].mesh);
    Crumb crumb{p, 0, 0.0};
    for (Index i = 0; i < model.rest.size(); ++i)
      if ((state.positions[i] - centre).squaredNorm() < (state.positions[crumb.donor] - centre).squaredNorm())
        crumb.donor = i;
    const double share = whole > 0.0 ? model.mass * std::abs(signedVolume(cut->pieces[p].mesh)) / whole : 0.0;
    crumb.mass = std::min(std::max(share, 1e-6 * masses[crumb.donor]), 0.5 * masses[crumb.donor]);
    masses[crumb.donor] -= crumb.mass;
    crumbs.push_back(crumb);
  }

  std::vector<Index> rider_of(model.surface.vertices.size(), kNoIndex);
  for (Index r = 0; r < model.binding.riders.size(); ++r) rider_of[model.binding.riders[r]] = r;

  CutBody result;
  result.cap_area = cut->cap_area;
  for (std::size_t p = 0; p < cut->pieces.size(); ++p) {
    const CutPiece& from = cut->pieces[p];
    BodyPiece piece;
    auto child = std::make_shared<BodyModel>();
    child->solid = true;
    child->spacing = model.spacing;
    child->next_patch = model.next_patch + 1;
    child->surface.triangles = from.mesh.triangles;
    child->surface.patches = from.mesh.patches;
    child->surface.vertices = restVertices(model, state, from, options.cap_patch);
    child->rest_volume = signedVolume(child->surface);
    child->rest_area = surfaceArea(child->surface);

    piece.parent_particles = members[p];
    std::vector<Index> renumbered(model.rest.size(), kNoIndex);
    for (Index i : members[p]) {
      renumbered[i] = static_cast<Index>(child->rest.size());
      child->rest.push_back(model.rest[i]);
      child->masses.push_back(masses[i]);
      child->fixed.push_back(model.fixed[i]);
      child->any_fixed = child->any_fixed || model.fixed[i];
      piece.state.positions.push_back(state.positions[i]);
      piece.state.velocities.push_back(state.velocities[i]);
    }
    child->graph = subgraph(model.graph, members[p]);
    for (const Crumb& crumb : crumbs)
      if (crumb.piece == p) {
        child->rest.push_back(solidCentroid(child->surface));
        child->masses.push_back(crumb.mass);
        child->fixed.push_back(false);
        piece.state.positions.push_back(solidCentroid(from.mesh));
        piece.state.velocities.push_back(state.velocities[crumb.donor]);
        piece.parent_particles.push_back(kNoIndex);
        child->graph = makeGraph(child->rest, {});
      }
    for (double m : child->masses) child->mass += m;
    PieceClusters clusters = splitClusters(model.clusters, child->rest, child->graph, members[p]);
    result.kept_clusters += clusters.kept;
    result.rebuilt_clusters += clusters.rebuilt;
    child->clusters = std::move(clusters.clusters);
    inheritMoments(model, members[p], *child);

    std::vector<Index> vertex_particle;
    std::vector<bool> taken(child->rest.size(), false);
    for (const VertexOrigin& origin : from.origins) {
      const Index v = sameVertex(origin);
      const Index parent = v == kNoIndex ? kNoIndex : model.binding.particle[v];
      Index mine = parent == kNoIndex ? kNoIndex : renumbered[parent];
      // A vertex that was split where the surface pinched is in the piece twice; one of the two rides.
      if (mine != kNoIndex && taken[mine]) mine = kNoIndex;
      if (mine != kNoIndex) taken[mine] = true;
      vertex_particle.push_back(mine);
    }
    InheritedBinding inherited{model.binding, {}, renumbered};
    for (const VertexOrigin& origin : from.origins) {
      const Index v = sameVertex(origin);
      inherited.rider.push_back(v == kNoIndex ? kNoIndex : rider_of[v]);
    }
    child->binding = bindSurface(child->rest, child->graph, child->clusters, child->surface.vertices,
                                 std::move(vertex_particle), &inherited);
    piece.state.poses.resize(child->clusters.size());
    piece.state.plastic =
        inheritShapes(state.plastic, model.clusters, child->clusters, clusters.origin, piece.parent_particles);
    fitClusters(matchInput(*child, piece.state), piece.state.positions, piece.state.poses);
    piece.state.surface = from.mesh.vertices;
    piece.state.stretch = state.stretch;
    piece.state.swelling = state.swelling;
    for (Index r = 0; r < child->binding.riders.size(); ++r)
      piece.state.rider_offsets.push_back(from.mesh.vertices[child->binding.riders[r]] -
                                          riderPosition(child->binding, piece.state.positions, piece.state.poses, r));
    piece.model = std::move(child);
    result.pieces.push_back(std::move(piece));
  }
  return result;
}

}  // namespace meshless
