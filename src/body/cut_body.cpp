#include "meshless_surgery/body/cut_body.h"

#include <algorithm>
#include <limits>
#include <queue>

#include "cut_cells.h"
#include "piece_maker.h"
#include "side_by_side.h"

namespace meshless {
namespace {

constexpr int kNoPiece = -1;
constexpr double kOnPlane = 0.1;  // [spacing]
constexpr double kSnap = 0.2;     // [spacing] shorter edges would cost contact much, and cells do not resolve them

// The piece of every particle. Surface particles are where their vertex is; the others take the piece of the nearest
// one along the body on their side of the plane.
std::vector<int> assignParticles(const BodyModel& model, const BodyState& state, const Plane& plane,
                                 const CutSurface& cut) {
  std::vector<int> piece_of(model.rest.size(), kNoPiece);
  for (std::size_t p = 0; p < cut.pieces.size(); ++p)
    for (std::size_t at = 0; at < cut.pieces[p].origins.size(); ++at) {
      const Index v = cut.pieces[p].origins.same(at);
      if (v == kNoIndex || model.binding.particle[v] == kNoIndex) continue;
      int& piece = piece_of[model.binding.particle[v]];
      if (piece == kNoPiece) piece = static_cast<int>(p);  // one on the plane goes to the larger piece
    }
  // A layer that lies on the plane but for a little goes to one side as a whole, or the cap's binding were ragged.
  const double on_plane = kOnPlane * model.spacing;
  const auto sideOf = [&](Index i) { return plane.height(state.positions[i]) >= -on_plane ? 1 : -1; };
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

}  // namespace

CutWork& CutWork::operator+=(const CutWork& other) {
  new_vertices += other.new_vertices;
  new_triangles += other.new_triangles;
  bound_embedded += other.bound_embedded;
  kept_embedded += other.kept_embedded;
  kept_clusters += other.kept_clusters;
  rebuilt_clusters += other.rebuilt_clusters;
  return *this;
}

namespace {

Result<CutBody> cutFilled(const BodyModel& model, const BodyState& state, const Plane& plane,
                          const TriangleMesh& present, const CutOptions& options,
                          const std::vector<TissuePlace>& places) {
  Result<CutSurface> cut = Error(), cut_contact = Error();
  const TriangleMesh for_contact = presentCollision(model, state);
  atOnce([&] { cut = cutByPlane(present, plane, options); },
         [&] {
           if (!model.collision) return;
           CutOptions likewise = options;
           likewise.rest = &model.collision->mesh.vertices;
           cut_contact = cutByPlane(for_contact, plane, likewise);
         });
  if (!cut) return cut.error();
  std::vector<CellPieceSource> sources, collision;
  for (const CutPiece& piece : cut->pieces) sources.push_back({piece.mesh, piece.origins});
  if (cut_contact)
    for (const CutPiece& piece : cut_contact->pieces) collision.push_back({piece.mesh, piece.origins});
  CutBody result;
  result.cap_area = cut->cap_area;
  Result<std::vector<BodyPiece>> pieces =
      cutCells(model, state, BladeGate(plane), sources, collision, places, options.cap_patch, result.work);
  if (!pieces) return pieces.error();
  result.pieces = std::move(*pieces);
  return result;
}

}  // namespace

Result<CutBody> cutBody(const BodyModel& model, const BodyState& state, const Plane& plane,
                        const CutBodyOptions& wanted) {
  if (!model.solid)
    return Error{ErrorCode::kUnsuitableShape, "its surface is open, so it cannot be cut into closed pieces"};
  TriangleMesh present;
  present.vertices = state.surface;
  present.triangles = model.surface.triangles;
  present.patches = model.surface.patches;
  CutOptions options;
  options.cap_patch = model.next_patch;
  options.cap_points = kUsualCapPoints;
  options.roughness = wanted.roughness;
  options.seed = wanted.seed;
  options.rest = &model.surface.vertices;
  options.apart = kOneTissue * model.spacing;
  if (model.lattice) {
    options.snap = kSnap * model.spacing;
    return cutFilled(model, state, plane, present, options, wanted.places);
  }
  // Surface particles are where their vertices are, so vertices stay.
  PieceMaker maker(model, state, options.cap_patch);
  Result<CutSurface> cut = Error();
  atOnce([&] { cut = cutByPlane(present, plane, options); }, [&] { maker.foresee(plane); });
  if (!cut) return cut.error();

  const std::vector<int> piece_of = assignParticles(model, state, plane, *cut);
  std::vector<std::vector<Index>> members(cut->pieces.size());
  for (Index i = 0; i < model.rest.size(); ++i) members[static_cast<std::size_t>(piece_of[i])].push_back(i);

  std::vector<PieceSource> sources;
  for (std::size_t p = 0; p < cut->pieces.size(); ++p)
    sources.push_back({cut->pieces[p].mesh, cut->pieces[p].origins, std::move(members[p])});
  CutBody result;
  result.cap_area = cut->cap_area;
  result.pieces = maker.make(sources);
  result.work = maker.work();
  return result;
}

}  // namespace meshless
