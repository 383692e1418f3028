#include "cut_cells.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <sstream>
#include <tuple>
#include <unordered_map>
#include <utility>

#include <Eigen/Dense>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/body/cell_blend.h"
#include "meshless_surgery/body/filled_cells.h"
#include "meshless_surgery/geometry/lattice/cut_lattice.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/union_find.h"
#include "piece_parts.h"
#include "place_set.h"
#include "side_by_side.h"

namespace meshless {
namespace {

constexpr std::size_t kChunk = 256;  // vertices
constexpr double kAlong = 0.9;  // cosine of the normals of a wound face that runs along the blade, and of the blade
constexpr int kAnyPiece = -1;

// A vertex of a piece, or of its surface for contact, whose new cell is not known yet.
struct EmbeddedVertex {
  Vec3 rest = Vec3::Zero();  // [m]
  Index was = kNoIndex;      // the parent's cell that it followed
  Index same = kNoIndex;     // the parent's vertex that it is; kNoIndex: this blade made it
  Vec3 now = Vec3::Zero();   // [m] as the blade met it
  int side = 0;              // +1: that of the blade's normal, -1, or 0: both
  bool kept = false;         // the blade left its cell whole

  bool made() const { return same == kNoIndex; }
};

// The place in a cell that is at q; false where Newton's method finds none near it.
bool invert(const LatticeCell& cell, const Points& x, const Vec3& q, double size, Vec3& at) {
  at = Vec3::Constant(0.5);
  for (int step = 0; step < 20; ++step) {
    Vec3 p = Vec3::Zero();
    Mat3 slope = Mat3::Zero();
    for (int k = 0; k < 8; ++k) {
      const Vec3& corner = x[cell.corners[k]];
      p += trilinearWeight(k, at) * corner;
      for (int axis = 0; axis < 3; ++axis) {
        Vec3 along = at;
        along[axis] = 1.0;  // the weight is linear along an axis
        const int on = k | 1 << axis;
        slope.col(axis) += (k >> axis & 1 ? 1.0 : -1.0) * trilinearWeight(on, along) * corner;
      }
    }
    const Vec3 miss = q - p;
    if (miss.norm() < 1e-13 * size) return true;
    const Vec3 step_by = slope.fullPivLu().solve(miss);
    if (!step_by.allFinite() || !((at + step_by - Vec3::Constant(0.5)).norm() < 10.0)) return false;
    at += step_by;
  }
  return false;
}

struct HashOfPlace {
  std::size_t operator()(const Vec3& p) const {
    std::size_t hash = 0;
    for (int k = 0; k < 3; ++k) hash = 31 * hash + std::hash<double>()(p[k]);
    return hash;
  }
};

class CellCutter {
 public:
  CellCutter(const BodyModel& model, const BodyState& state, const MetBody& met, const Blade& blade,
             std::vector<IncisedPiece> sources, std::vector<IncisedPiece> collision)
      : model_(model),
        state_(state),
        positions_(met.positions),
        blade_(blade),
        sources_(std::move(sources)),
        collision_(std::move(collision)),
        before_(*model.lattice),
        cut_(cutLattice(before_, met.positions, blade)),
        finder_(cut_.lattice),
        children_(before_.cells.size()) {
    for (Index c = 0; c < cells().size(); ++c) children_[cut_.parent_cell[c]].push_back(c);
  }

  Result<std::vector<BodyPiece>> run(const std::vector<TissuePlace>& places, std::uint32_t new_patch, CutWork& work) {
    findInside();
    surfaces_.resize(sources_.size() + collision_.size());
    inChunks(surfaces_.size(), 1, [&](std::size_t s, std::size_t) {
      surfaces_[s] = s < sources_.size() ? surfaceOf(sources_[s], model_.surface.vertices, model_.binding)
                                         : surfaceOf(collision_[s - sources_.size()], model_.collision->mesh.vertices,
                                                     model_.collision->binding);
    });
    for (std::size_t s = 0; s < surfaces_.size(); ++s) {
      const auto& embedded = surfaces_[s].embedded;
      const auto lost = std::find_if(embedded.begin(), embedded.end(), [](const auto& e) { return e.was == kNoIndex; });
      if (lost == embedded.end()) continue;
      if (s >= sources_.size()) {
        surfaces_.resize(sources_.size());
        break;
      }
      std::ostringstream text;
      text << "the blade made a point at " << sources_[s].mesh.vertices[lost - embedded.begin()].transpose()
           << " that lies in none of its cells";
      return Error{ErrorCode::kUnsuitableShape, text.str()};
    }
    closeAtRest();
    inChunks(surfaces_.size(), 1, [&](std::size_t s, std::size_t) { surfaces_[s].cells = cellsOf(surfaces_[s]); });
    findPieces();
    sampled_ = static_cast<Index>(cells().size());
    bindCollision();
    bind();
    joinThePieces();
    std::vector<BodyPiece> pieces(sources_.size());
    std::vector<CutWork> works(sources_.size());
    inChunks(sources_.size(), 1, [&](std::size_t p, std::size_t) { pieces[p] = make(p, places, new_patch, works[p]); });
    for (const CutWork& done : works) work += done;
    return pieces;
  }

 private:
  std::vector<LatticeCell>& cells() { return cut_.lattice.cells; }

  // --- where vertices come from

  // What is known at rest of the surface of a source.
  struct RestSurface {
    std::vector<EmbeddedVertex> embedded;
    TriangleMesh mesh;         // [m]
    std::vector<Index> cells;  // of each vertex; kNoIndex: no tissue of its own is near

    void append(const RestSurface& other) {
      addPart(other.mesh, mesh);
      embedded.insert(embedded.end(), other.embedded.begin(), other.embedded.end());
      cells.insert(cells.end(), other.cells.begin(), other.cells.end());
    }
  };

  RestSurface surfaceOf(const IncisedPiece& source, const Points& parent_rest, const SurfaceBinding& parent) const {
    RestSurface surface;
    surface.embedded.reserve(source.origins.size());
    surface.mesh.vertices.reserve(source.origins.size());
    const std::vector<int> sides = sidesOf(source);
    for (Index v = 0; v < source.origins.size(); ++v) {
      surface.embedded.push_back(embeddedOf(source, v, parent_rest, parent));
      surface.embedded.back().now = source.mesh.vertices[v];
      surface.embedded.back().side = sides[v];
      surface.mesh.vertices.push_back(surface.embedded.back().rest);
    }
    surface.mesh.triangles = source.mesh.triangles;
    surface.mesh.patches = source.mesh.patches;
    return surface;
  }

  // A piece by a plane lies on one side of it. Else, of what is in a wound face along the blade by which way that
  // faces, of the rest by its height.
  std::vector<int> sidesOf(const IncisedPiece& source) const {
    const Points& now = source.mesh.vertices;
    std::vector<double> heights;
    for (const Vec3& p : now) heights.push_back(blade_.height(p));
    if (!blade_.bounded())
      return std::vector<int>(now.size(), std::accumulate(heights.begin(), heights.end(), 0.0) >= 0.0 ? 1 : -1);
    std::vector<char> beside(now.size(), 0);  // bits: tissue below, above
    const double on = kFollow * before_.spacing;
    for (std::size_t i = 0; i < source.mesh.triangles.size(); ++i) {
      const Triangle& t = source.mesh.triangles[i];
      double facing = source.facing[i];
      if (facing == 0.0 && isCutPatch(source.mesh.patches[i]) &&
          std::all_of(t.begin(), t.end(), [&](Index v) { return std::abs(heights[v]) <= on; })) {
        const Vec3 area = (now[t[1]] - now[t[0]]).cross(now[t[2]] - now[t[0]]);
        const double along = area.dot(blade_.plane().normal);
        if (std::abs(along) > kAlong * area.norm()) facing = along;
      }
      if (facing != 0.0)
        for (const Index v : t) beside[v] |= facing > 0.0 ? 1 : 2;
    }
    std::vector<int> sides;
    for (std::size_t v = 0; v < now.size(); ++v)
      sides.push_back(beside[v] == 0 ? heights[v] >= 0.0 ? 1 : -1 : beside[v] == 3 ? 0 : beside[v] == 2 ? 1 : -1);
    return sides;
  }

  EmbeddedVertex embeddedOf(const IncisedPiece& source, Index v, const Points& parent_rest,
                            const SurfaceBinding& parent) const {
    const VertexOrigins& origins = source.origins;
    EmbeddedVertex embedded{Vec3::Zero(), kNoIndex, origins.same(v)};
    if (origins.insideCap(v)) return inside_.at(source.mesh.vertices[v]);
    const VertexOrigin origin = origins[v];
    double most = 0.0;
    for (int k = 0; k < 4 && origin.parents[k] != kNoIndex; ++k) {
      embedded.rest += origin.weights[k] * parent_rest[origin.parents[k]];
      if (!(origin.weights[k] > most)) continue;
      most = origin.weights[k];
      embedded.was = parent.cells[origin.parents[k]];
    }
    if (!embedded.made()) embedded.rest = parent_rest[origin.parents[0]];
    return embedded;
  }

  // What the blade made in one place on both lips of a wound is in one place at rest too: no volume lies between.
  void closeAtRest() {
    std::unordered_map<Vec3, Vec3, HashOfPlace> places;
    for (RestSurface& surface : surfaces_)
      for (Index v = 0; v < surface.embedded.size(); ++v) {
        EmbeddedVertex& vertex = surface.embedded[v];
        if (!vertex.made()) continue;
        const Vec3& first = places.emplace(vertex.now, vertex.rest).first->second;
        if ((first - vertex.rest).norm() < kFollow * before_.spacing) vertex.rest = surface.mesh.vertices[v] = first;
      }
  }

  // Bounds of a cell as it is now.
  struct PresentBox {
    Box box;
    Vec3 middle;
    double squared;  // [m^2] from the middle to a corner
    Index cell;
  };

  // Vertices inside the caps. Both sides of a cut get the same place.
  void findInside() {
    for (const auto* sources : {&sources_, &collision_})
      for (const IncisedPiece& source : *sources)
        for (Index v = 0; v < source.origins.size(); ++v)
          if (source.origins.insideCap(v)) inside_.emplace(source.mesh.vertices[v], EmbeddedVertex());
    if (inside_.empty()) return;
    std::vector<PresentBox> boxes;  // of the parent's cells near the blade's plane
    for (Index c = 0; c < before_.cells.size(); ++c) {
      if (before_.cells[c].isBridge(c)) continue;
      Box box;
      Box heights;  // along x
      for (const Index corner : before_.cells[c].corners) {
        box.extend(positions_[corner]);
        heights.extend(Vec3(blade_.height(positions_[corner]), 0.0, 0.0));
      }
      const double wide = 0.5 * (box.max - box.min).norm();
      if (heights.min.x() <= wide && heights.max.x() >= -wide)
        boxes.push_back({box, 0.5 * (box.min + box.max), wide * wide, c});
    }
    std::vector<std::pair<const Vec3, EmbeddedVertex>*> all;
    for (auto& entry : inside_) all.push_back(&entry);
    inChunks(all.size(), kChunk, [&](std::size_t from, std::size_t to) {
      for (std::size_t n = from; n < to; ++n) all[n]->second = insideOf(all[n]->first, boxes);
    });
  }

  // By the inverse of the map of the cell whose samples are nearest.
  EmbeddedVertex insideOf(const Vec3& q, const std::vector<PresentBox>& boxes) const {
    EmbeddedVertex found{q, kNoIndex};
    for (const double margin : {0.01, 0.5, 2.0}) {
      double least = 1e300;
      const double widened = std::pow(1.01 + 2.0 * margin, 2);
      for (const auto& [box, middle, squared, c] : boxes) {
        if ((q - middle).squaredNorm() > widened * squared) continue;
        const Vec3 wider = margin * (box.max - box.min);
        if (((q - box.min + wider).array() < 0.0).any() || ((box.max + wider - q).array() < 0.0).any()) continue;
        Vec3 at;
        if (!invert(before_.cells[c], positions_, q, before_.spacing, at)) continue;
        // What lies in a cell and next to one of its samples is as good as what lies on it.
        const SampleSet samples = before_.cells[c].samples ? before_.cells[c].samples : before_.cells[c].filled;
        const double outside = (at - at.cwiseMax(0.0).cwiseMin(1.0)).norm();
        const double distance = outside + std::max(0.0, std::sqrt(squaredToSamples(samples, at)) - 0.22);
        if (!(distance < least)) continue;
        least = distance;
        found = {before_.restPlace(before_.cells[c], at), c};
      }
      if (least < 0.5) break;
    }
    return found;
  }

  // --- cells that a vertex may follow

  std::vector<Index> cellsOf(RestSurface& surface) const {
    std::vector<Index> cells(surface.embedded.size());
    inChunks(cells.size(), kChunk, [&](std::size_t from, std::size_t to) {
      for (std::size_t v = from; v < to; ++v) {
        EmbeddedVertex& vertex = surface.embedded[v];
        cells[v] = cellAsBefore(vertex);
        vertex.kept = cells[v] != kNoIndex;
        if (!vertex.kept) cells[v] = nearestCopy(vertex);
      }
    });
    return cells;
  }

  // A blade may leave a cell whole and part a vertex from it. Tissue that is in no sample is on one side of it.
  Index cellAsBefore(const EmbeddedVertex& embedded) const {
    const std::vector<Index>& copies = children_[embedded.was];
    if (embedded.made() || copies.size() != 1 || cut_.changed[copies[0]]) return kNoIndex;
    const Index c = copies[0];
    const SampleSet above = cut_.above[c], samples = cut_.lattice.cells[c].samples;
    const bool parted =
        samples ? samples & (embedded.side > 0 ? ~above : above) : sources_.size() > 1 && isPartedFrom(c, embedded);
    return parted ? kNoIndex : c;
  }

  // On which side of the blade most of a cell is.
  bool isAbove(Index c) const {
    const SampleSet tissue = cut_.lattice.cells[c].samples;
    if (!tissue) return blade_.height(middleOf(c)) >= 0.0;
    return 2 * countSamples(tissue & cut_.above[c]) >= countSamples(tissue);
  }
  Vec3 middleOf(Index c) const { return presentPlace({cut_.parent_cell[c], Vec3::Constant(0.5)}); }
  // Of a cell that the blade left whole, or that no sample is in.
  bool isPartedFrom(Index c, const EmbeddedVertex& vertex) const {
    return blade_.passes(vertex.now, vertex.side, middleOf(c), isAbove(c) ? 1 : -1);
  }

  // The copy of its cell with the nearest tissue that the blade does not part from it; kNoIndex: there is none.
  Index nearestCopy(const EmbeddedVertex& vertex) const {
    Index best = kNoIndex;
    double least = std::numeric_limits<double>::infinity();
    const Vec3 at = before_.placeIn(before_.cells[vertex.was], vertex.rest);
    for (const Index c : children_[vertex.was]) {
      const LatticeCell& cell = cut_.lattice.cells[c];
      if (cell.isBridge(c)) continue;
      for (SampleSet left = cell.samples; left;) {
        const int bit = nearestSample(left, at);
        left &= ~(SampleSet{1} << bit);
        const Vec3 sample = samplePlace(bit);
        const double squared = (sample - at).squaredNorm();
        if (!(squared < least)) break;
        if (blade_.passes(vertex.now, vertex.side, presentPlace({vertex.was, sample}),
                          cut_.above[c] >> bit & 1 ? 1 : -1))
          continue;
        least = squared;
        best = c;
        break;
      }
    }
    if (best == kNoIndex)  // tissue that no sample is in
      for (const Index c : children_[vertex.was])
        if (!cut_.lattice.cells[c].samples && !cut_.lattice.cells[c].isBridge(c) && !isPartedFrom(c, vertex)) best = c;
    return best;
  }

  // --- which cells are in which piece

  // Surfaces and the tissue that they follow hang together. Vertices whose cells the blade left whole say so; of tissue
  // that none of these is in, the others that are on one side of the blade. What has no volume at rest says nothing, and
  // is of the largest.
  void findPieces() {
    UnionFind corners(cut_.lattice.corners);
    for (const LatticeCell& cell : cells())
      for (int k = 1; k < 8; ++k) corners.join(cell.corners[0], cell.corners[k]);
    joinAtTheClamp(corners);
    std::map<Index, Index> names;
    for (const LatticeCell& cell : cells())
      component_.push_back(
          names.emplace(corners.find(cell.corners[0]), static_cast<Index>(names.size())).first->second);
    const Index components = static_cast<Index>(names.size());
    seen_.assign(components, false);
    UnionFind pieces(components + sources_.size());
    std::vector<bool> sheet(sources_.size());
    for (Index s = 0; s < sources_.size(); ++s) {
      sheet[s] = !(signedVolume(surfaces_[s].mesh) > kSheet * model_.rest_volume);
      if (sheet[s]) pieces.join(components + s, components);
    }
    for (const bool kept : {true, false}) {
      const std::vector<bool> told = seen_;
      for (Index s = 0; s < sources_.size(); ++s)
        for (std::size_t v = 0; v < surfaces_[s].cells.size() && !sheet[s]; ++v) {
          const Index c = surfaces_[s].cells[v];
          const EmbeddedVertex& vertex = surfaces_[s].embedded[v];
          if (c == kNoIndex || vertex.kept != kept || (!kept && (vertex.side == 0 || told[component_[c]]))) continue;
          seen_[component_[c]] = true;
          pieces.join(component_[c], components + s);
        }
    }
    std::vector<bool> enclosed = seen_;
    for (const bool across : {false, true}) joinUnseen(pieces, enclosed, across);
    std::map<Index, int> number;
    std::vector<IncisedPiece> merged;
    std::vector<RestSurface> surfaces;
    for (Index s = 0; s < sources_.size(); ++s) {
      const auto [known, is_new] = number.emplace(pieces.find(components + s), static_cast<int>(merged.size()));
      if (is_new) {
        merged.push_back(std::move(sources_[s]));
        surfaces.push_back(std::move(surfaces_[s]));
      } else {
        merged[known->second].append(sources_[s]);
        surfaces[known->second].append(surfaces_[s]);
      }
    }
    for (std::size_t s = sources_.size(); s < surfaces_.size(); ++s) surfaces.push_back(std::move(surfaces_[s]));
    const std::vector<Index> order = bySize(surfaces, merged.size());
    for (std::size_t p = 0; p < merged.size(); ++p) {
      sources_[p] = std::move(merged[order[p]]);
      surfaces_[p] = std::move(surfaces[order[p]]);
    }
    for (std::size_t s = merged.size(); s < surfaces.size(); ++s) surfaces_[s] = std::move(surfaces[s]);
    sources_.resize(merged.size());
    surfaces_.resize(surfaces.size());
    std::vector<int> place(order.size());
    for (std::size_t p = 0; p < order.size(); ++p) place[order[p]] = static_cast<int>(p);
    for (Index n = 0; n < components; ++n) {
      const auto known = number.find(pieces.find(n));
      piece_of_.push_back(known == number.end() ? 0 : place[static_cast<std::size_t>(known->second)]);
    }
    for (std::size_t p = 0; p < sources_.size(); ++p)
      for (Index& c : surfaces_[p].cells)
        if (c != kNoIndex && piece_of_[component_[c]] != static_cast<int>(p)) c = kNoIndex;
  }

  // The first so many, largest volume first.
  static std::vector<Index> bySize(const std::vector<RestSurface>& surfaces, std::size_t count) {
    std::vector<double> volumes;
    for (std::size_t p = 0; p < count; ++p) volumes.push_back(signedVolume(surfaces[p].mesh));
    std::vector<Index> order(count);
    std::iota(order.begin(), order.end(), Index{0});
    std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return volumes[a] > volumes[b]; });
    return order;
  }

  // What no vertex is in goes with what it has a corner in common with: on its side of the blade or `across`.
  void joinUnseen(UnionFind& pieces, std::vector<bool>& enclosed, bool across) {
    const std::vector<std::vector<Index>> users = usersOfCorners();
    for (bool again = true; again;) {
      again = false;
      for (const std::vector<Index>& at : users)
        for (const Index a : at)
          for (const Index b : at)
            if (!enclosed[component_[a]] && enclosed[component_[b]] && (across || isAbove(a) == isAbove(b))) {
              pieces.join(component_[a], component_[b]);
              enclosed[component_[a]] = again = true;
            }
    }
  }

  // Of each of the parent's corners.
  std::vector<std::vector<Index>> usersOfCorners() {
    std::vector<std::vector<Index>> users(before_.corners);
    for (Index c = 0; c < cells().size(); ++c)
      for (const Index corner : cells()[c].corners) users[cut_.parent_corner[corner]].push_back(c);
    return users;
  }

  // What is held has no corner in common with what is free. Links on one side of the blade hold them together.
  void joinAtTheClamp(UnionFind& corners) {
    for (Index held = 0; held < cells().size(); ++held) {
      const LatticeCell& cell = cells()[held];
      if (!cell.held) continue;
      for (int axis = 0; axis < 3; ++axis)
        for (const int step : {-1, 0, 1}) {
          std::array<std::int32_t, 3> place = cell.place;
          place[axis] += step;
          for (const Index free : finder_.at(place)) {
            if (cells()[free].held) continue;
            const auto linked = [&](bool above) {
              const auto side = [&](Index c) { return cells()[c].samples & (above ? cut_.above[c] : ~cut_.above[c]); };
              const SampleSet a = side(held), b = side(free);
              return step > 0   ? faceLinks(a, b, axis) != kNoSample
                     : step < 0 ? faceLinks(b, a, axis) != kNoSample
                                : linksWithin(a, b, axis);
            };
            if (linked(false) || linked(true)) corners.join(cell.corners[0], cells()[free].corners[0]);
          }
        }
    }
  }
  static bool linksWithin(SampleSet a, SampleSet b, int axis) {
    const auto from = [&](SampleSet low, SampleSet high) {
      return low & ~kUpperLayer[axis] & (high >> kSampleStride[axis]);
    };
    return from(a, b) || from(b, a);
  }

  // --- the surface; what has no cell gets crumbs

  // In a rim that is thinner than samples see: the nearest tissue of the piece, on the vertex's side. At rest the other
  // lip of an older wound is as near: it comes last.
  Index beyondTheRim(const EmbeddedVertex& vertex, int piece) const {
    for (const bool any : {false, true}) {
      const Index c = finder_.nearest(vertex.rest, [&](Index c) {
        if (piece != kAnyPiece && piece_of_[component_[c]] != piece) return kNoSample;
        if (!any && areLips(cut_.parent_cell[c], vertex.was)) return kNoSample;
        const SampleSet samples = cut_.lattice.cells[c].samples;
        if (vertex.side == 0) return samples;
        if (blade_.bounded() && !cut_.changed[c]) return isPartedFrom(c, vertex) ? kNoSample : samples;
        return samples & (vertex.side > 0 ? cut_.above[c] : ~cut_.above[c]);
      });
      if (c != kNoIndex) return c;
    }
    return kNoIndex;
  }

  // Cells of the parent that are beside each other and have no corner in common: an older wound is between them.
  bool areLips(Index a, Index b) const {
    const LatticeCell &one = before_.cells[a], &other = before_.cells[b];
    for (int k = 0; k < 3; ++k)
      if (std::abs(one.place[k] - other.place[k]) > 1) return false;
    return std::find_first_of(one.corners.begin(), one.corners.end(), other.corners.begin(), other.corners.end()) ==
           one.corners.end();
  }

  void bind() {
    const double least = kCrumb * std::pow(before_.spacing, 3);
    for (std::size_t p = 0; p < sources_.size(); ++p) {
      RestSurface& surface = surfaces_[p];
      const bool one = signedVolume(surface.mesh) < least;  // less tissue than a sample stands for goes as a whole
      std::map<Index, Index> crumbs;
      for (Index v = 0; v < surface.cells.size(); ++v) {
        Index& cell = surface.cells[v];
        if (cell == kNoIndex) cell = beyondTheRim(surface.embedded[v], static_cast<int>(p));
        if (cell != kNoIndex) continue;
        const Index was = one && !crumbs.empty() ? crumbs.begin()->first : withMass(surface.embedded[v].was);
        const auto [known, is_new] = crumbs.emplace(was, static_cast<Index>(cells().size()));
        cell = known->second;
        if (is_new) addCrumb(was, static_cast<int>(p));
      }
    }
  }

  // The surface for contact goes with the tissue that it follows.
  void bindCollision() {
    if (surfaces_.size() == sources_.size()) return;
    collisions_.resize(sources_.size());
    for (std::size_t s = sources_.size(); s < surfaces_.size(); ++s) {
      RestSurface& surface = surfaces_[s];
      std::size_t first = 0;
      while (first < surface.cells.size() && (surface.cells[first] == kNoIndex || surface.embedded[first].side == 0))
        ++first;
      if (first == surface.cells.size()) continue;
      const int p = piece_of_[component_[surface.cells[first]]];
      for (Index v = 0; v < surface.cells.size(); ++v)
        if (const Index c = surface.cells[v]; c == kNoIndex || piece_of_[component_[c]] != p)
          surface.cells[v] = beyondTheRim(surface.embedded[v], p);
      collisions_[static_cast<std::size_t>(p)].append(surface);
    }
  }

  // A bridge has no mass to give: one of what it joins.
  Index withMass(Index was) const {
    if (before_.cells[was].isBridge(was))
      for (Index part = 0; part < before_.cells.size(); ++part)
        if (part != was && before_.cells[part].bridge == was) return part;
    return was;
  }

  // A crumb is a copy of the whole cell with a share of what it weighs: corner by corner nothing is lost.
  void shareWithCrumbs() {
    std::map<Index, int> taken;
    for (Index c = sampled_; c < cells().size(); ++c) ++taken[cut_.parent_cell[c]];
    for (const auto& [was, count] : taken) {
      const double part = std::min(0.5, count * kCrumb);
      for (const Index c : children_[was]) {
        cells()[c].mass_share *= 1.0 - part;
        cells()[c].stiffness_share *= 1.0 - part;
      }
    }
    for (Index c = sampled_; c < cells().size(); ++c) {
      const Index was = cut_.parent_cell[c];
      const double part = std::min(0.5, taken[was] * kCrumb) / taken[was];
      cells()[c].mass_share = before_.cells[was].mass_share * part;
      cells()[c].stiffness_share = before_.cells[was].stiffness_share * part;
    }
  }

  Index addCrumb(Index was, int piece) {
    LatticeCell crumb = before_.cells[was];
    crumb.samples = kNoSample;
    crumb.bridge = kNoIndex;
    for (Index& corner : crumb.corners) {
      cut_.parent_corner.push_back(corner);
      corner = cut_.lattice.corners++;
    }
    component_.push_back(static_cast<Index>(piece_of_.size()));
    piece_of_.push_back(piece);
    seen_.push_back(true);
    cells().push_back(crumb);
    cut_.parent_cell.push_back(was);
    cut_.above.push_back(kNoSample);
    cut_.changed.push_back(true);
    return static_cast<Index>(cells().size()) - 1;
  }

  // --- what the surface holds together and samples do not see

  void joinThePieces() {
    // With room for a crumb of every cell and piece.
    UnionFind corners(cut_.lattice.corners + 8 * before_.cells.size() * sources_.size());
    const auto joinCells = [&](Index a, Index b) {
      for (const Index i : cells()[a].corners)
        for (const Index j : cells()[b].corners)
          if (cut_.parent_corner[i] == cut_.parent_corner[j]) corners.join(i, j);
    };
    for (std::size_t p = 0; p < sources_.size(); ++p)
      for (const Triangle& t : sources_[p].mesh.triangles)
        for (int k = 0; k < 3; ++k) {
          const Index a = surfaces_[p].cells[t[k]], b = surfaces_[p].cells[t[(k + 1) % 3]];
          if (a != b && (!blade_.bounded() || component_[a] != component_[b])) joinCells(a, b);
        }
    // What no vertex is in holds to its neighbours in the piece.
    for (const std::vector<Index>& at : usersOfCorners())
      for (const Index a : at)
        if (!seen_[component_[a]])
          for (const Index b : at)
            if (piece_of_[component_[a]] == piece_of_[component_[b]]) joinCells(a, b);
    for (std::size_t p = 0; p < sources_.size(); ++p)
      while (joinByTheShortestWay(static_cast<int>(p), corners, joinCells, 4) ||
             joinByTheShortestWay(static_cast<int>(p), corners, joinCells, 1)) {
      }
    shareWithCrumbs();
    std::vector<Index> number(cut_.lattice.corners, kNoIndex), parents;
    for (LatticeCell& cell : cells())
      for (Index& corner : cell.corners) {
        Index& known = number[corners.find(corner)];
        if (known == kNoIndex) {
          known = static_cast<Index>(parents.size());
          parents.push_back(cut_.parent_corner[corner]);
        }
        corner = known;
      }
    cut_.lattice.corners = static_cast<Index>(parents.size());
    cut_.parent_corner = std::move(parents);
    chooseHeirs();
  }

  // Two parts of a piece that nothing joins get crumbs of the parent's cells on the shortest way between, over what
  // has so many corners in common. False where there is one part, or no way.
  template <class Join>
  bool joinByTheShortestWay(int piece, UnionFind& corners, const Join& joinCells, int least_shared) {
    UnionFind parts(component_.size());  // of components
    std::vector<Index> user(cut_.lattice.corners, kNoIndex);
    std::vector<Index> mine;
    for (Index c = 0; c < cells().size(); ++c) {
      if (piece_of_[component_[c]] != piece) continue;
      mine.push_back(c);
      for (const Index corner : cells()[c].corners) {
        Index& known = user[corners.find(corner)];
        if (known == kNoIndex) known = component_[c];
        parts.join(known, component_[c]);
      }
    }
    const auto partOf = [&](Index c) { return parts.find(component_[c]); };
    if (mine.empty() || std::all_of(mine.begin(), mine.end(), [&](Index c) { return partOf(c) == partOf(mine[0]); }))
      return false;
    // The smallest part finds another: breadth first over the parent's cells.
    std::map<Index, int> sizes;
    for (const Index c : mine) ++sizes[partOf(c)];
    const Index lost = std::min_element(sizes.begin(), sizes.end(), [](const auto& a, const auto& b) {
                         return a.second < b.second;
                       })->first;
    std::vector<Index> there(before_.cells.size(), kNoIndex), from(before_.cells.size(), kNoIndex), queue;
    for (const Index c : mine)
      if (partOf(c) != lost) there[cut_.parent_cell[c]] = c;
    for (const Index c : mine) {
      const Index was = cut_.parent_cell[c];
      if (partOf(c) != lost || from[was] != kNoIndex) continue;
      from[was] = was;
      queue.push_back(was);
    }
    const CornerUses uses = cornerUses(before_);
    for (std::size_t n = 0; n < queue.size(); ++n) {
      const Index at = queue[n];
      if (there[at] != kNoIndex) {
        Index next = there[at], way = at;
        while (from[way] != way) {
          way = from[way];
          Index here = kNoIndex;
          if (from[way] == way) {
            for (const Index c : mine)
              if (partOf(c) == lost && cut_.parent_cell[c] == way) here = c;
          } else {
            here = addCrumb(withMass(way), piece);
          }
          joinCells(here, next);
          next = here;
        }
        if (way == at)  // both are of one cell
          for (const Index c : mine)
            if (partOf(c) == lost && cut_.parent_cell[c] == at) joinCells(c, next);
        return true;
      }
      std::map<Index, int> shared;
      for (const Index corner : before_.cells[at].corners)
        for (Index u = uses.offsets[corner]; u < uses.offsets[corner + 1]; ++u) ++shared[uses.cells[u]];
      for (const auto& [other, count] : shared)
        if (count >= least_shared && from[other] == kNoIndex && !before_.cells[other].isBridge(other)) {
          from[other] = at;
          queue.push_back(other);
        }
    }
    return false;
  }

  // The one copy of each of the parent's particles that goes on as it: with tissue, the first of them.
  void chooseHeirs() {
    const std::vector<bool> tissue = cornersWithTissue(cut_.lattice);
    heir_.assign(before_.corners, kNoIndex);
    for (Index i = 0; i < cut_.lattice.corners; ++i) {
      Index& heir = heir_[cut_.parent_corner[i]];
      if (heir == kNoIndex || (tissue[i] && !tissue[heir])) heir = i;
    }
  }

  // --- bodies

  BodyPiece make(std::size_t p, const std::vector<TissuePlace>& places, std::uint32_t new_patch, CutWork& work) {
    const IncisedPiece& from = sources_[p];
    BodyPiece piece;
    auto child = beginPiece(model_, from.mesh, surfaces_[p].mesh.vertices, blade_.bounded());

    auto lattice = std::make_shared<CellLattice>();
    lattice->spacing = before_.spacing;
    lattice->origin = before_.origin;
    lattice->regions = before_.regions;
    std::vector<Index> cell_of, renumbered(cells().size(), kNoIndex), corner_of;
    for (Index c = 0; c < cells().size(); ++c) {
      if (piece_of_[component_[c]] != static_cast<int>(p)) continue;
      renumbered[c] = static_cast<Index>(cell_of.size());
      cell_of.push_back(c);
      corner_of.insert(corner_of.end(), cells()[c].corners.begin(), cells()[c].corners.end());
    }
    std::sort(corner_of.begin(), corner_of.end(), [&](Index a, Index b) {
      const auto order = [&](Index i) {
        return std::make_tuple(heir_[cut_.parent_corner[i]] != i, cut_.parent_corner[i], i);
      };
      return order(a) < order(b);
    });
    corner_of.erase(std::unique(corner_of.begin(), corner_of.end()), corner_of.end());
    std::vector<Index> corner_number(cut_.lattice.corners, kNoIndex);
    for (Index i = 0; i < corner_of.size(); ++i) corner_number[corner_of[i]] = i;
    lattice->corners = static_cast<Index>(corner_of.size());
    for (const Index c : cell_of) {
      LatticeCell cell = cells()[c];
      for (Index& corner : cell.corners) corner = corner_number[corner];
      if (cell.bridge != kNoIndex) cell.bridge = renumbered[cell.bridge];
      lattice->cells.push_back(cell);
    }
    for (const Index i : corner_of) {
      const Index parent = cut_.parent_corner[i];
      piece.parent_particles.push_back(heir_[parent] == i ? parent : kNoIndex);
      piece.copied_from.push_back(parent);
      piece.state.positions.push_back(state_.positions[parent]);
      piece.state.velocities.push_back(state_.velocities[parent]);
      if (!model_.held_by.empty()) child->held_by.push_back(model_.held_by[parent]);
    }
    for (const TissuePlace& place : places) {
      Index c = kNoIndex;
      if (place.cell != kNoIndex) {
        c = nearestCopy(at(place));
        if (c == kNoIndex) c = beyondTheRim(at(place), kAnyPiece);
      }
      piece.places.push_back({c != kNoIndex ? renumbered[c] : kNoIndex, place.at});
    }
    child->lattice = lattice;
    child->cell_mass = model_.cell_mass;
    child->regions = model_.regions;
    atOnce([&] { bindPiece(p, piece, renumbered, *child); },
           [&] {
             makeParticlesOfCells(*child);
             holdCorners(*child);
             inheritClamp(*child, renumbered);
             for (const double m : child->masses) child->mass += m;
             for (const Index c : cell_of) {
               if (!model_.fibres.empty()) child->fibres.push_back(model_.fibres[cut_.parent_cell[c]]);
               piece.state.cells.push_back(state_.cells[cut_.parent_cell[c]]);
               if (!state_.plastic_cells.empty())
                 piece.state.plastic_cells.push_back(state_.plastic_cells[cut_.parent_cell[c]]);
               if (!state_.relaxed.empty()) piece.state.relaxed.push_back(state_.relaxed[cut_.parent_cell[c]]);
               ++(cut_.changed[c] ? work.rebuilt_clusters : work.kept_clusters);
             }
             inheritTissue(*child, piece);
           });
    for (const EmbeddedVertex& embedded : surfaces_[p].embedded) {
      ++(embedded.made() ? work.bound_embedded : work.kept_embedded);
      work.new_vertices += embedded.made();
    }
    for (const std::uint32_t patch : from.mesh.patches) work.new_triangles += patch == new_patch;
    finishPiece(state_, std::move(child), piece);
    return piece;
  }

  // What is seen and what meets contact, to the cells of the piece.
  void bindPiece(std::size_t p, const BodyPiece& piece, const std::vector<Index>& renumbered, BodyModel& child) const {
    const std::vector<bool> untouched = untouchedCells(static_cast<int>(p));
    std::vector<Index> particle(before_.corners, kNoIndex);
    for (Index i = 0; i < piece.parent_particles.size(); ++i)  // heirs come first: which of several copies is not said
      particle[piece.copied_from[i]] = piece.parent_particles[i] != kNoIndex ? i : kNoIndex;
    const auto bind = [&](const SurfaceBinding& parent, const Points& rest, const std::vector<Index>& cells,
                          const auto& sameAs) {
      KeptRows kept{&parent, {}, particle};
      std::vector<Index> numbers;
      for (Index v = 0; v < cells.size(); ++v) {
        kept.vertex.push_back(keptRow(parent, sameAs(v), cells[v], untouched));
        numbers.push_back(renumbered[cells[v]]);
      }
      return bindToCells(*child.lattice, rest, numbers, kept);
    };
    child.binding = bind(model_.binding, child.surface.vertices, surfaces_[p].cells,
                         [&](Index v) { return surfaces_[p].embedded[v].same; });
    if (collisions_.empty() || collisions_[p].cells.empty()) return;
    const RestSurface& from = collisions_[p];
    if (std::find(from.cells.begin(), from.cells.end(), kNoIndex) != from.cells.end()) return;
    child.collision = std::make_shared<CollisionSurface>(CollisionSurface{
        from.mesh,
        bind(model_.collision->binding, from.mesh.vertices, from.cells, [&](Index v) { return from.embedded[v].same; }),
        model_.collision->distance});
  }

  // The parent's vertex whose row one that is the same now and in a cell has too; kNoIndex: it is to be made.
  Index keptRow(const SurfaceBinding& parent, Index same, Index cell, const std::vector<bool>& untouched) const {
    const Index was = cut_.parent_cell[cell];
    return same != kNoIndex && parent.cells[same] == was && untouched[was] ? same : kNoIndex;
  }

  // The parent's cells around which, as far as bindToCells() looks from them, all tissue is in the piece as it was.
  std::vector<bool> untouchedCells(int piece) const {
    std::vector<PlaceSet::Place> places;
    for (const LatticeCell& cell : before_.cells) places.push_back(cell.place);
    PlaceSet touched(places, 3);
    for (Index c = 0; c < before_.cells.size(); ++c) {
      const std::vector<Index>& copies = children_[c];
      if (copies.size() != 1 || cut_.changed[copies[0]] || piece_of_[component_[copies[0]]] != piece)
        touched.at(places[c]) = true;
    }
    for (Index c = sampled_; c < cut_.lattice.cells.size(); ++c) touched.at(cut_.lattice.cells[c].place) = true;
    for (const bool corners : {true, true, false}) touched.widen(corners);  // two places, and what these join
    std::vector<bool> untouched;
    for (const auto& place : places) untouched.push_back(!touched.has(place));
    return untouched;
  }

  EmbeddedVertex at(const TissuePlace& place) const {
    EmbeddedVertex point{before_.restPlace(before_.cells[place.cell], place.at), place.cell};
    point.now = presentPlace(place);
    point.side = blade_.height(point.now) >= 0.0 ? 1 : -1;
    return point;
  }

  Vec3 presentPlace(const TissuePlace& place) const {
    Vec3 now = Vec3::Zero();
    for (int k = 0; k < 8; ++k) now += trilinearWeight(k, place.at) * positions_[before_.cells[place.cell].corners[k]];
    return now;
  }

  // What is held stays held.
  void inheritClamp(BodyModel& child, const std::vector<Index>& renumbered) const {
    for (ClampPoint point : model_.clamp_points) {
      const Index best = point.cell == kNoIndex ? kNoIndex : nearestCopy(at({point.cell, point.at}));
      if (best == kNoIndex || renumbered[best] == kNoIndex) continue;
      point.cell = renumbered[best];
      child.clamp_points.push_back(point);
    }
  }

  void inheritTissue(BodyModel& child, BodyPiece& piece) const {
    makeClamp(child);
    makeElastic(child);
    child.highest_frequency = highestFrequency(*child.cells, specificElasticity(child));
    child.match_masses = child.masses;
    if (model_.clusters.size() == 0) return;
    for (std::size_t i = 0; i < child.fixed.size(); ++i) {
      const Index parent = piece.copied_from[i];
      if (child.fixed[i]) child.match_masses[i] *= model_.match_masses[parent] / model_.masses[parent];
    }
    PieceClusters clusters = splitClusters(model_.clusters, child.rest, child.graph, piece.copied_from);
    child.clusters = std::move(clusters.clusters);
    child.shape = makeRestShape(child.rest, child.match_masses, child.clusters);
    if (!model_.shape.quadratic.empty()) addQuadraticRest(child.rest, child.match_masses, child.clusters, child.shape);
    for (const Index c : clusters.origin) {
      piece.state.poses.push_back(state_.poses[c]);
      if (!state_.plastic.empty()) piece.state.plastic.push_back(state_.plastic[c]);
    }
    fitClusters(matchInput(child, piece.state), piece.state.positions, piece.state.poses);
  }

  const BodyModel& model_;
  const BodyState& state_;
  const Points& positions_;  // [m] of the particles, as the blade meets them
  const Blade& blade_;
  std::vector<IncisedPiece> sources_, collision_;
  const CellLattice& before_;
  CutLattice cut_;
  const CellFinder finder_;                   // knows no crumbs
  std::vector<std::vector<Index>> children_;  // of each of the parent's cells
  std::vector<RestSurface> surfaces_;         // of each source, then of each piece; and of what is for contact
  std::vector<RestSurface> collisions_;       // of each piece, or none
  std::unordered_map<Vec3, EmbeddedVertex, HashOfPlace> inside_;
  std::vector<Index> component_;  // of each cell
  std::vector<int> piece_of_;     // of each component
  Index sampled_ = 0;             // cells before crumbs were made
  std::vector<bool> seen_;        // a vertex is in it
  std::vector<Index> heir_;       // of each of the parent's corners
};

}  // namespace

Result<std::vector<BodyPiece>> cutCells(const BodyModel& model, const BodyState& state, const MetBody& met,
                                        const Blade& blade, std::vector<IncisedPiece> sources,
                                        std::vector<IncisedPiece> collision, const std::vector<TissuePlace>& places,
                                        std::uint32_t new_patch, CutWork& work) {
  return CellCutter(model, state, met, blade, std::move(sources), std::move(collision)).run(places, new_patch, work);
}

}  // namespace meshless
