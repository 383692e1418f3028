#include "meshless_surgery/geometry/mesh/mend.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <iterator>
#include <map>
#include <set>
#include <sstream>
#include <utility>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/triangulate_hole.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/version.h>
#if CGAL_VERSION_NR >= 1050500000
#include <CGAL/alpha_wrap_3.h>
#endif

#include "crossings.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/union_find.h"
#include "unite_parts.h"

namespace meshless {
namespace {

namespace pmp = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Surface = CGAL::Surface_mesh<Kernel::Point_3>;
using Soup = std::pair<std::vector<Kernel::Point_3>, std::vector<std::array<std::size_t, 3>>>;

constexpr double kFillable = 0.25;         // of a component's area: beyond it a patch makes another shape of it
constexpr double kCrumbs = 0.25;           // of all area: pieces that may be dropped
constexpr std::size_t kLongestRim = 3000;  // edges
constexpr double kFinestWrap = 0.01;       // of the bounds' diagonal, as the next one
constexpr double kCoarsestWrap = 0.05;
constexpr double kWrapOffset = 0.05;  // of the wrap's edge length
constexpr double kSameVolume = 1e-9;
constexpr double kMillilitre = 1e-6;  // [m^3]

Error refuse(const std::string& why) { return {ErrorCode::kUnsuitableShape, why}; }

Vec3 toVec(const Kernel::Point_3& p) { return {p.x(), p.y(), p.z()}; }

Soup toSoup(const TriangleMesh& mesh) {
  Soup soup;
  for (const Vec3& p : mesh.vertices) soup.first.emplace_back(p.x(), p.y(), p.z());
  for (const Triangle& t : mesh.triangles)  // CGAL's repair of triangles (CGAL 5.5) takes none with a vertex twice
    if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) soup.second.push_back({t[0], t[1], t[2]});
  return soup;
}

TriangleMesh toMesh(const Surface& surface) {
  TriangleMesh mesh;
  std::vector<Index> number(surface.num_vertices() + surface.number_of_removed_vertices(), kNoIndex);
  for (const auto v : surface.vertices()) {
    number[v] = static_cast<Index>(mesh.vertices.size());
    mesh.vertices.push_back(toVec(surface.point(v)));
  }
  for (const auto f : surface.faces()) {
    Triangle t;
    int k = 0;
    for (const auto v : CGAL::vertices_around_face(surface.halfedge(f), surface)) t[k++] = number[v];
    mesh.triangles.push_back(t);
  }
  return mesh;
}

/// Of what the triangles enclose, were they closed by a fan from the middle of their bounds: for surfaces with holes.
double volumeOf(const TriangleMesh& mesh) {
  const Box box = boundsOf(mesh.vertices);
  const Vec3 middle = 0.5 * (box.min + box.max);
  double volume = 0.0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3 a = mesh.vertices[t[0]] - middle, b = mesh.vertices[t[1]] - middle, c = mesh.vertices[t[2]] - middle;
    volume += a.dot(b.cross(c)) / 6.0;
  }
  return std::abs(volume);
}

/// Nothing where there is none.
std::vector<Triangle> patchOf(const TriangleMesh& mesh, const std::vector<Index>& rim) {
  if (rim.size() > kLongestRim) return {};
  std::vector<Kernel::Point_3> line;
  for (const Index v : rim) line.emplace_back(mesh.vertices[v].x(), mesh.vertices[v].y(), mesh.vertices[v].z());
  std::vector<CGAL::Triple<int, int, int>> found;
  pmp::triangulate_hole_polyline(line, std::back_inserter(found), CGAL::parameters::do_not_use_cubic_algorithm(true));
  std::vector<Triangle> patch;
  for (const auto& t : found) patch.push_back({rim[t.first], rim[t.second], rim[t.third]});
  return patch;
}

/// The rims of its holes: from an edge that one triangle has around its end, over triangles that share an edge with one
/// another alone, to the next one. A fin has none.
class Rims {
 public:
  /// Of triangles with three corners each, none of them twice.
  explicit Rims(const std::vector<Triangle>& triangles) : triangles_(triangles), joined_(triangles.size()) {
    for (Index t = 0; t < triangles.size(); ++t)
      for (int k = 0; k < 3; ++k) {
        std::vector<Index>& at = at_[key(triangles[t][k], triangles[t][(k + 1) % 3])];
        at.push_back(t);
        joined_.join(at.front(), t);
      }
    std::set<std::pair<Index, Index>> seen;
    for (const auto& [edge, at] : at_) {
      if (at.size() != 1 || seen.count(edge)) continue;
      std::vector<Index> rim = {edge.first};
      Index from = edge.first, to = edge.second, triangle = at.front();
      while (seen.insert(key(from, to)).second) {
        rim.push_back(to);
        const Index pivot = to;
        while (true) {  // around the pivot
          const Triangle& t = triangles_[triangle];
          to = t[0] + t[1] + t[2] - from - pivot;
          const std::vector<Index>& sharing = at_.at(key(pivot, to));
          if (sharing.size() != 2) break;
          triangle = sharing[0] == triangle ? sharing[1] : sharing[0];
          from = to;
        }
        from = pivot;
        if (at_.at(key(from, to)).size() != 1) break;
      }
      if (rim.size() < 4 || rim.front() != rim.back() || key(from, to) != edge) continue;
      rim.pop_back();
      all.push_back({joined_.find(at.front()), rim});
    }
  }

  Index pieceOf(Index triangle) { return joined_.find(triangle); }

  std::vector<std::pair<Index, std::vector<Index>>>
      all;  // with the piece that they are of: what hangs together by edges

 private:
  static std::pair<Index, Index> key(Index a, Index b) { return {std::min(a, b), std::max(a, b)}; }

  const std::vector<Triangle>& triangles_;
  UnionFind joined_;
  std::map<std::pair<Index, Index>, std::vector<Index>> at_;  // an edge's triangles
};

/// With patches in the holes of those pieces whose patches are small.
TriangleMesh withHolesFilled(const TriangleMesh& mesh, std::vector<std::string>& notes) {
  std::set<Triangle> seen;
  std::vector<Triangle> triangles;
  for (const Triangle& t : withMergedVertices(mesh).triangles) {
    Triangle sorted = t;
    std::sort(sorted.begin(), sorted.end());
    if (sorted[0] != sorted[1] && sorted[1] != sorted[2] && seen.insert(sorted).second) triangles.push_back(t);
  }
  Rims rims(triangles);
  std::map<Index, double> area;
  for (Index t = 0; t < triangles.size(); ++t) area[rims.pieceOf(t)] += surfaceArea(mesh.vertices, {triangles[t]});
  std::map<Index, std::vector<Triangle>> patches;
  std::set<Index> left;  // pieces with a rim that nothing fills
  for (const auto& [piece, rim] : rims.all) {
    const std::vector<Triangle> patch = patchOf(mesh, rim);
    if (patch.empty()) left.insert(piece);
    patches[piece].insert(patches[piece].end(), patch.begin(), patch.end());
  }
  TriangleMesh filled = mesh;
  filled.patches.clear();
  std::size_t count = 0, edges = 0;
  for (const auto& [piece, patch] : patches) {
    if (left.count(piece) || !(surfaceArea(mesh.vertices, patch) < kFillable * area[piece])) {
      left.insert(piece);
      continue;
    }
    filled.triangles.insert(filled.triangles.end(), patch.begin(), patch.end());
  }
  for (const auto& [piece, rim] : rims.all) {
    if (left.count(piece)) continue;
    ++count;
    edges += rim.size();
  }
  if (count > 0)
    notes.push_back("filled " + std::to_string(count) + (count == 1 ? " hole" : " holes") + " of " +
                    std::to_string(edges) + " open edges in all");
  return filled;
}

bool hasSoundTriangles(const TriangleMesh& mesh) {
  const MeshReport report = inspectMesh(mesh, false);
  return !mesh.empty() && report.non_finite_vertices == 0 && report.bad_indices == 0 &&
         surfaceArea(mesh.vertices, mesh.triangles) > 0.0;
}

std::string volumeNote(double before, double after) {
  std::ostringstream note;
  note << std::setprecision(3) << "the triangles enclosed " << before / kMillilitre << " ml, the surface now encloses "
       << after / kMillilitre << " ml";
  if (after < 2.0 * before) note << " (" << std::showpos << 100.0 * (after / before - 1.0) << " %)";
  return note.str();
}

/// `repaired` of `dirty`, with the notes of both and of the volume.
RepairedMesh noted(RepairedMesh repaired, std::vector<std::string> notes, double before) {
  notes.insert(notes.end(), repaired.notes.begin(), repaired.notes.end());
  if (repaired.solid) {
    const double after = std::abs(signedVolume(repaired.mesh));
    if (!(std::abs(after - before) <= kSameVolume * after)) notes.push_back(volumeNote(before, after));
  }
  repaired.notes = std::move(notes);
  return repaired;
}

/// What its triangles bound together, with the notes of that; `plain` where that is sound and the same.
Result<RepairedMesh> united(const TriangleMesh& mesh, const Result<RepairedMesh>& plain, std::vector<std::string> notes,
                            double before) {
  Result<UnitedParts> made = uniteParts(mesh);
  if (!made) return made.error();
  if (!(made->open_share < kCrumbs)) return refuse("most of its area bounds nothing");
  if (!made->changed && plain.ok() && plain->solid && !plain->self_intersecting) return noted(*plain, {}, before);
  Result<RepairedMesh> one = repairMesh(made->mesh, RepairRules{false, false, false});
  if (!one) return one.error();
  std::size_t crossings = 0;
  forEachCrossing(one->mesh.vertices, withMergedVertices(one->mesh).triangles, [&](Index, Index) { ++crossings; });
  one->self_intersecting = crossings > 0;
  notes.insert(notes.end(), made->notes.begin(), made->notes.end());
  one->warnings = std::move(made->warnings);
  if (crossings > 0)
    one->notes.push_back("rounding left " + std::to_string(crossings) + (crossings == 1 ? " pair" : " pairs") +
                         " of triangles that cross; cuts there may be refused");
  return noted(std::move(*one), std::move(notes), made->shared_walls ? std::abs(signedVolume(made->mesh)) : before);
}

Result<RepairedMesh> wrap(const TriangleMesh& mesh, std::vector<std::string> notes, double before) {
#if CGAL_VERSION_NR >= 1050500000
  double length = 0.0;
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) length += (mesh.vertices[t[(k + 1) % 3]] - mesh.vertices[t[k]]).norm();
  length /= 3.0 * static_cast<double>(std::max<std::size_t>(mesh.triangles.size(), 1));
  const double diagonal = boundsOf(mesh.vertices).diagonal();
  const double edge = std::clamp(length, kFinestWrap * diagonal, kCoarsestWrap * diagonal);
  const Soup soup = toSoup(mesh);
  Surface surface;
  CGAL::alpha_wrap_3(soup.first, soup.second, edge, kWrapOffset * edge, surface);
  Result<RepairedMesh> wrapped = repairMesh(toMesh(surface));
  if (!wrapped.ok()) return wrapped.error();
  if (!wrapped->solid) return refuse("no closed surface could be wrapped around it");
  std::ostringstream note;
  note << "wrapped it in a surface of edges of about " << edge << " m, " << kWrapOffset * edge << " m outside of it";
  notes.push_back(note.str());
  return noted(std::move(*wrapped), std::move(notes), before);
#else
  (void)mesh;
  (void)notes;
  (void)before;
  return refuse("to wrap it needs CGAL 5.5 or newer; accepted: repair none or mend");
#endif
}

}  // namespace

const std::vector<std::string>& meshRepairNames() {
  static const std::vector<std::string> names{"none", "mend", "wrap"};
  return names;
}

Result<RepairedMesh> repairMesh(const TriangleMesh& mesh, MeshRepair how) {
  RepairRules rules;
  rules.close_holes = how != MeshRepair::kNone;
  Result<RepairedMesh> plain = repairMesh(mesh, rules);
  if (how == MeshRepair::kNone) {
    if (plain.ok() && !plain->solid) {
      return refuse("the surface is not closed: " + std::to_string(plain->open_edges) +
                    " of its edges have a triangle on one side only; accepted with repair none: a closed surface (mend "
                    "fills holes, wrap closes anything)");
    }
    if (plain.ok() && plain->self_intersecting && plain->components > 1)
      plain->notes.push_back("it has " + std::to_string(plain->components) +
                             " parts: repair mend unites those that overlap");
    return plain;
  }
  if (!plain.ok() && !hasSoundTriangles(mesh)) return plain;
  const double before = volumeOf(mesh);
  const bool sound = plain.ok() && plain->solid && !plain->self_intersecting;
  if (sound && (how == MeshRepair::kWrap || plain->components == 1)) return noted(std::move(*plain), {}, before);
  std::vector<std::string> notes;
  const TriangleMesh filled = withHolesFilled(mesh, notes);
  if (how == MeshRepair::kWrap) return wrap(filled, std::move(notes), before);
  Result<RepairedMesh> one = united(filled, plain, std::move(notes), before);
  if (one.ok()) return one;
  if (plain.ok()) {  // a shell
    if (plain->solid)
      plain->notes.push_back("its parts cannot be united, and stay as they are: " + one.error().detail +
                             "; repair wrap may help");
    return plain;
  }
  return refuse(plain.error().detail + "; mending did not help (" + one.error().detail + "), repair wrap may");
}

}  // namespace meshless
