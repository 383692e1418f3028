#include "meshless_surgery/geometry/mesh/mend.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <iterator>
#include <map>
#include <optional>
#include <sstream>
#include <utility>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/manifoldness.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/repair_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/stitch_borders.h>
#include <CGAL/Polygon_mesh_processing/triangulate_hole.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/version.h>
#if CGAL_VERSION_NR >= 1050500000
#include <CGAL/alpha_wrap_3.h>
#endif

#include "meshless_surgery/geometry/mesh/measures.h"
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

/// The pieces that hang together by edges.
struct Pieces {
  std::vector<Index> of;                              // one a triangle
  std::vector<double> areas;                          // [m^2]
  std::vector<std::vector<std::vector<Index>>> rims;  // against their triangles; of each piece
};

/// Of a surface whose edges have two triangles at the most.
Pieces piecesOf(const TriangleMesh& mesh) {
  std::map<std::pair<Index, Index>, Index> at;  // directed edge -> its triangle
  for (Index f = 0; f < mesh.triangles.size(); ++f)
    for (int k = 0; k < 3; ++k) at[{mesh.triangles[f][k], mesh.triangles[f][(k + 1) % 3]}] = f;
  Pieces pieces;
  pieces.of.assign(mesh.triangles.size(), kNoIndex);
  for (Index seed = 0; seed < mesh.triangles.size(); ++seed) {
    if (pieces.of[seed] != kNoIndex) continue;
    const Index piece = static_cast<Index>(pieces.areas.size());
    pieces.areas.push_back(0.0);
    pieces.rims.emplace_back();
    std::vector<Index> stack = {seed};
    pieces.of[seed] = piece;
    std::map<Index, Index> next;  // along the rim; a vertex has one fan, so it is left once
    while (!stack.empty()) {
      const Triangle t = mesh.triangles[stack.back()];
      stack.pop_back();
      pieces.areas[piece] += surfaceArea(mesh.vertices, {t});
      for (int k = 0; k < 3; ++k) {
        const auto other = at.find({t[(k + 1) % 3], t[k]});
        if (other == at.end()) {
          next[t[(k + 1) % 3]] = t[k];
        } else if (pieces.of[other->second] == kNoIndex) {
          pieces.of[other->second] = piece;
          stack.push_back(other->second);
        }
      }
    }
    while (!next.empty()) {
      std::vector<Index> rim;
      for (auto step = next.begin(); step != next.end(); step = next.find(rim.back())) {
        rim.push_back(step->second);
        next.erase(step);
      }
      pieces.rims[piece].push_back(std::move(rim));
    }
  }
  return pieces;
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

class Mending {
 public:
  explicit Mending(const TriangleMesh& mesh) { sew(mesh); }

  TriangleMesh mesh;
  std::vector<std::string> notes;  // what was done to it

  void fillHoles() {
    const Pieces pieces = piecesOf(mesh);
    std::size_t filled = 0, rims = 0;
    for (std::size_t p = 0; p < pieces.areas.size(); ++p) {
      std::vector<Triangle> patches;
      bool whole = true;
      for (const auto& rim : pieces.rims[p]) {
        const std::vector<Triangle> patch = patchOf(mesh, rim);
        whole = whole && !patch.empty();
        patches.insert(patches.end(), patch.begin(), patch.end());
      }
      if (!whole || patches.empty() || !(surfaceArea(mesh.vertices, patches) < kFillable * pieces.areas[p])) continue;
      mesh.triangles.insert(mesh.triangles.end(), patches.begin(), patches.end());
      for (const auto& rim : pieces.rims[p]) rims += rim.size();
      filled += pieces.rims[p].size();
    }
    if (filled > 0)
      notes.push_back("filled " + std::to_string(filled) + (filled == 1 ? " hole" : " holes") + " of " +
                      std::to_string(rims) + " open edges in all");
  }

  void dropOpenPieces() {
    const Pieces pieces = piecesOf(mesh);
    double all = 0.0, open = 0.0;
    std::size_t count = 0;
    for (std::size_t p = 0; p < pieces.areas.size(); ++p) {
      all += pieces.areas[p];
      if (pieces.rims[p].empty()) continue;
      open += pieces.areas[p];
      ++count;
    }
    if (count == 0 || count == pieces.areas.size() || !(open < kCrumbs * all)) return;
    std::vector<Triangle> kept;
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f)
      if (pieces.rims[pieces.of[f]].empty()) kept.push_back(mesh.triangles[f]);
    mesh.triangles = std::move(kept);
    dropUnusedVertices();
    std::ostringstream note;
    note << "dropped " << count << (count == 1 ? " open piece" : " open pieces") << " with " << 100.0 * open / all
         << " % of the area";
    notes.push_back(note.str());
  }

 private:
  void dropUnusedVertices() {
    std::vector<Index> number(mesh.vertices.size(), kNoIndex);
    Points used;
    for (Triangle& t : mesh.triangles)
      for (Index& v : t) {
        if (number[v] == kNoIndex) {
          number[v] = static_cast<Index>(used.size());
          used.push_back(mesh.vertices[v]);
        }
        v = number[v];
      }
    mesh.vertices = std::move(used);
  }

  /// A surface whose edges have one triangle or two, and whose vertices have one fan.
  void sew(const TriangleMesh& dirty) {
    Soup soup = toSoup(withMergedVertices(dirty));
    pmp::repair_polygon_soup(soup.first, soup.second);
    if (!pmp::orient_polygon_soup(soup.first, soup.second))
      notes.push_back("cut the surface where it is not manifold, and sewed each piece up by itself");
    Surface surface;
    pmp::polygon_soup_to_polygon_mesh(soup.first, soup.second, surface);
    // Where two bodies share an edge four sides lie on each other: only within one body it is clear which belong
    // together.
    pmp::stitch_borders(surface, CGAL::parameters::apply_per_connected_component(true));
    const std::size_t doubled = pmp::duplicate_non_manifold_vertices(surface);
    if (doubled > 0)
      notes.push_back("doubled " + std::to_string(doubled) + (doubled == 1 ? " vertex" : " vertices") +
                      " that several fans of triangles share");
    mesh = toMesh(surface);
  }
};

bool hasSoundTriangles(const TriangleMesh& mesh) {
  const MeshReport report = inspectMesh(mesh, false);
  return !mesh.empty() && report.non_finite_vertices == 0 && report.bad_indices == 0 &&
         surfaceArea(mesh.vertices, mesh.triangles) > 0.0;
}

std::string volumeNote(double before, double after) {
  std::ostringstream note;
  note << std::setprecision(3) << "the triangles enclosed " << before << " m^3, the surface now encloses " << after
       << " m^3";
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

/// With its parts that overlap made one; nothing where there is nothing to do, or it fails: `why` says so.
std::optional<RepairedMesh> united(const TriangleMesh& mesh, RepairRules rules, std::string& why) {
  rules.turn_outwards = false;
  const Result<RepairedMesh> parts = repairMesh(mesh, rules);
  if (!parts.ok() || !parts->solid || parts->components < 2) return std::nullopt;
  const Result<UnitedParts> made = uniteParts(parts->mesh);
  if (!made.ok()) why = made.error().detail;
  if (!made.ok() || !made->changed()) return std::nullopt;
  Result<RepairedMesh> one = repairMesh(made->mesh, RepairRules{false, false, true});
  if (!one.ok()) return std::nullopt;
  std::vector<std::string> notes = parts->notes;
  std::ostringstream note;
  if (made->turned > 0)
    notes.push_back(std::to_string(made->turned) + (made->turned == 1 ? " part was" : " parts were") +
                    " inside-out and turned");
  if (made->overlapping > 0) {
    note << made->overlapping << " parts that overlap were united"
         << (made->solids > 1 ? " into " + std::to_string(made->solids) : "") << ": volume "
         << made->volume / kMillilitre << " ml";
    notes.push_back(note.str());
  }
  if (made->filled > 0)
    one->warnings.push_back(
        std::to_string(made->filled) +
        (made->filled == 1 ? " part is turned inwards as a cavity is, and reaches"
                           : " parts are turned inwards as cavities are, and reach") +
        " through the surface of another: tissue fills it; a cavity has to lie inside of the other");
  if (made->swallowed > 0)
    one->warnings.push_back(std::to_string(made->swallowed) +
                            (made->swallowed == 1
                                 ? " part inside of another is turned as it is, and became tissue of it"
                                 : " parts inside of others are turned as they are, and became tissue of them") +
                            " (turned against it, it would be a cavity)");
  notes.insert(notes.end(), one->notes.begin(), one->notes.end());
  one->notes = std::move(notes);
  return std::move(*one);
}

/// The same, or else `plain` with a word why.
RepairedMesh unitedOr(RepairedMesh plain, const TriangleMesh& mesh, const RepairRules& rules) {
  std::string why;
  if (std::optional<RepairedMesh> one = united(mesh, rules, why)) return std::move(*one);
  if (!why.empty())
    plain.notes.push_back("its parts cannot be united, and stay as they are: " + why + "; repair wrap may help");
  return plain;
}

Result<RepairedMesh> wrap(const Mending& mended, double before) {
#if CGAL_VERSION_NR >= 1050500000
  const TriangleMesh& mesh = mended.mesh;
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
  std::vector<std::string> notes = mended.notes;
  std::ostringstream note;
  note << "wrapped it in a surface of edges of about " << edge << " m, " << kWrapOffset * edge << " m outside of it";
  notes.push_back(note.str());
  return noted(std::move(*wrapped), std::move(notes), before);
#else
  (void)mended;
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
  if (how == MeshRepair::kMend) {
    // Parts as the file has them: where they touch, merged vertices would join them.
    std::string why;
    if (std::optional<RepairedMesh> one = united(mesh, RepairRules{false, false, false}, why))
      return noted(std::move(*one), {}, before);
    if (plain.ok() && plain->solid) return noted(unitedOr(std::move(*plain), mesh, rules), {}, before);
  }
  Mending mending(mesh);
  if (mending.mesh.empty()) return plain;
  mending.fillHoles();
  if (how == MeshRepair::kWrap) return wrap(mending, before);
  mending.dropOpenPieces();
  rules.merge_vertices = false;  // what was cut apart lies in the same places
  Result<RepairedMesh> mended = repairMesh(mending.mesh, rules);
  if (!mended.ok() || !mended->solid) {
    if (plain.ok()) return plain;  // a shell
    return refuse(plain.error().detail + "; mending did not help, repair wrap may");
  }
  return noted(unitedOr(std::move(*mended), mending.mesh, rules), std::move(mending.notes), before);
}

}  // namespace meshless
