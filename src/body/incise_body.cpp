#include "meshless_surgery/body/incise_body.h"

#include <algorithm>
#include <map>

#include "cut_cells.h"
#include "meshless_surgery/geometry/query/nearest.h"
#include "piece_maker.h"
#include "side_by_side.h"

namespace meshless {
namespace {

constexpr double kOnPlane = 0.1;           // [spacing] from the blade: on it
constexpr std::size_t kNearVertices = 16;  // vertices near a particle that say where it belongs

// The blade's rectangle as something that links can pass through.
class Gate {
 public:
  Gate(const Blade& blade, double spacing) : blade_(blade), plane_(blade.plane()), on_it_(kOnPlane * spacing) {}

  int side(const Vec3& p) const { return plane_.height(p) >= 0.0 ? 1 : -1; }
  /// A layer of particles that nearly lies on the blade goes to one side as a whole. Otherwise wound faces were ragged.
  int particleSide(const Vec3& p) const { return plane_.height(p) >= -on_it_ ? 1 : -1; }

  /// The way from a to b passes through the blade; `a_side` and `b_side` stand in for points that lie on its plane.
  bool between(const Vec3& a, int a_side, const Vec3& b, int b_side) const {
    if (a_side == b_side || a_side == 0 || b_side == 0) return false;
    const double ha = std::abs(plane_.height(a)), hb = std::abs(plane_.height(b));
    const double t = ha + hb > 0.0 ? ha / (ha + hb) : 0.5;
    const Vec3 r = a + t * (b - a) - blade_.origin;
    const double along = r.dot(blade_.x_axis), up = r.dot(blade_.y_axis);
    return along >= 0.0 && along <= blade_.length && up <= 0.0 && up >= -blade_.depth;
  }
  bool betweenParticles(const Vec3& a, const Vec3& b) const { return between(a, particleSide(a), b, particleSide(b)); }

 private:
  Blade blade_;
  Plane plane_;
  double on_it_;  // [m]
};

// The side of the blade that each vertex of a piece is on; 0 where both new wound faces have it (the buried front).
std::vector<int> sidesOf(const IncisedPiece& piece, const Gate& gate) {
  std::vector<int> side;
  for (const Vec3& p : piece.mesh.vertices) side.push_back(gate.side(p));
  std::vector<bool> on_wound_face(side.size(), false), both(side.size(), false);
  for (std::size_t t = 0; t < piece.mesh.triangles.size(); ++t) {
    if (piece.facing[t] == 0) continue;
    for (Index v : piece.mesh.triangles[t]) {
      const int here = -piece.facing[t];  // the tissue is behind the wound face
      if (on_wound_face[v] && side[v] != here) both[v] = true;
      on_wound_face[v] = true;
      side[v] = here;
    }
  }
  for (std::size_t v = 0; v < side.size(); ++v)
    if (both[v]) side[v] = 0;
  return side;
}

// The graph without the links that the blade cuts.
ParticleGraph cutLinks(const ParticleGraph& graph, const Points& x, const Gate& gate) {
  ParticleGraph left;
  left.offsets.push_back(0);
  for (Index i = 0; i < graph.size(); ++i) {
    for (Index k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k) {
      const Index j = graph.neighbours[k];
      // Both directions must agree to the bit.
      if (gate.betweenParticles(x[std::min(i, j)], x[std::max(i, j)])) continue;
      left.neighbours.push_back(j);
      left.lengths.push_back(graph.lengths[k]);
    }
    left.offsets.push_back(static_cast<Index>(left.neighbours.size()));
  }
  return left;
}

// Clusters with members on both sides of the blade.
std::vector<bool> tornClusters(const ClusterSet& clusters, const ParticleGraph& before, const Points& x,
                               const Gate& gate) {
  std::vector<bool> torn(clusters.size(), false);
  std::vector<Index> seen(x.size(), kNoIndex);
  for (Index c = 0; c < clusters.size(); ++c) {
    for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k) seen[clusters.members[k]] = c;
    for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1] && !torn[c]; ++k) {
      const Index i = clusters.members[k];
      for (Index e = before.offsets[i]; e < before.offsets[i + 1] && !torn[c]; ++e) {
        const Index j = before.neighbours[e];
        torn[c] = seen[j] == c && gate.betweenParticles(x[std::min(i, j)], x[std::max(i, j)]);
      }
    }
  }
  return torn;
}

// Parts of the body that hold together by their links.
std::vector<Index> partsOf(const ParticleGraph& graph) {
  std::vector<Index> part(graph.size(), kNoIndex), stack;
  Index parts = 0;
  for (Index start = 0; start < graph.size(); ++start) {
    if (part[start] != kNoIndex) continue;
    stack.assign(1, start);
    part[start] = parts;
    while (!stack.empty()) {
      const Index i = stack.back();
      stack.pop_back();
      for (Index k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k) {
        const Index j = graph.neighbours[k];
        if (part[j] != kNoIndex) continue;
        part[j] = parts;
        stack.push_back(j);
      }
    }
    ++parts;
  }
  return part;
}

// The piece of every particle: that of the nearest vertex that no wound face hides. Particles that hold together vote.
std::vector<std::size_t> assignParticles(const std::vector<IncisedPiece>& pieces, const ParticleGraph& graph,
                                         const Points& x, const Gate& gate) {
  Points vertices;
  std::vector<std::size_t> owner;
  std::vector<int> side;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    const std::vector<int> here = sidesOf(pieces[p], gate);
    side.insert(side.end(), here.begin(), here.end());
    vertices.insert(vertices.end(), pieces[p].mesh.vertices.begin(), pieces[p].mesh.vertices.end());
    owner.resize(vertices.size(), p);
  }
  const NearestPoints nearest(vertices);
  const std::vector<Index> part = partsOf(graph);
  std::map<std::pair<Index, std::size_t>, int> votes;
  for (Index i = 0; i < x.size(); ++i) {
    const std::vector<Index> near = nearest.nearest(x[i], kNearVertices);
    Index best = near[0];
    for (Index v : near)
      if (!gate.between(vertices[v], side[v], x[i], gate.particleSide(x[i]))) {
        best = v;
        break;
      }
    ++votes[{part[i], owner[best]}];
  }
  std::vector<std::size_t> winner(x.size(), 0);
  std::vector<int> most(x.size(), 0);
  for (const auto& [key, count] : votes)
    if (count > most[key.first]) {
      most[key.first] = count;
      winner[key.first] = key.second;
    }
  std::vector<std::size_t> piece_of(x.size());
  for (Index i = 0; i < x.size(); ++i) piece_of[i] = winner[part[i]];
  return piece_of;
}

}  // namespace

namespace {

Result<IncisedBody> inciseFilled(const BodyModel& model, const BodyState& state, const Blade& blade,
                                 const TriangleMesh& present, const InciseOptions& options,
                                 const std::vector<TissuePlace>& places) {
  Result<Incision> incision = Error(), contact_incision = Error();
  atOnce([&] { incision = incise(present, blade, options); },
         [&] {
           if (model.collision) contact_incision = incise(presentCollision(model, state), blade, options);
         });
  if (!incision) return incision.error();
  std::vector<CellPieceSource> sources, collision;
  for (const IncisedPiece& piece : incision->pieces) sources.push_back({piece.mesh, piece.origins});
  if (contact_incision)
    for (const IncisedPiece& piece : contact_incision->pieces) collision.push_back({piece.mesh, piece.origins});
  IncisedBody result;
  result.opened_area = incision->opened_area;
  Result<std::vector<BodyPiece>> pieces =
      cutCells(model, state, BladeGate(blade), sources, collision, places, options.patch, result.work);
  if (!pieces) return pieces.error();
  result.pieces = std::move(*pieces);
  return result;
}

}  // namespace

Result<IncisedBody> inciseBody(const BodyModel& model, const BodyState& state, const Blade& blade,
                               const std::vector<TissuePlace>& places) {
  if (!model.solid) return Error{ErrorCode::kUnsuitableShape, "its surface is open, so it has no inside to be opened"};
  TriangleMesh present;
  present.vertices = state.surface;
  present.triangles = model.surface.triangles;
  present.patches = model.surface.patches;
  InciseOptions options;
  options.patch = model.next_patch;
  if (model.lattice) return inciseFilled(model, state, blade, present, options, places);
  PieceMaker maker(model, state, options.patch);
  Result<Incision> incision = Error();
  atOnce([&] { incision = incise(present, blade, options); }, [&] { maker.foresee(blade); });
  if (!incision) return incision.error();

  const Gate gate(blade, model.spacing);
  const Points& x = state.positions;
  ParticleGraph graph = cutLinks(model.graph, x, gate);
  std::vector<bool> torn = tornClusters(model.clusters, model.graph, x, gate);
  std::vector<std::vector<Index>> members(incision->pieces.size());
  if (incision->pieces.size() == 1) {
    for (Index i = 0; i < x.size(); ++i) members[0].push_back(i);
  } else {
    const std::vector<std::size_t> piece_of = assignParticles(incision->pieces, graph, x, gate);
    for (Index i = 0; i < x.size(); ++i) members[piece_of[i]].push_back(i);
  }
  std::vector<PieceSource> sources;
  std::vector<std::vector<int>> sides;
  for (const IncisedPiece& piece : incision->pieces) sides.push_back(sidesOf(piece, gate));
  for (std::size_t p = 0; p < incision->pieces.size(); ++p) {
    const IncisedPiece& piece = incision->pieces[p];
    sources.push_back({piece.mesh, piece.origins, std::move(members[p]), [&, p](Index vertex, Index particle) {
                         const Vec3& at = incision->pieces[p].mesh.vertices[vertex];
                         return gate.between(at, sides[p][vertex], x[particle], gate.particleSide(x[particle]));
                       }});
  }
  maker.tear(std::move(graph), std::move(torn));
  IncisedBody result;
  result.pieces = maker.make(sources);
  result.opened_area = incision->opened_area;
  result.work = maker.work();
  return result;
}

}  // namespace meshless
