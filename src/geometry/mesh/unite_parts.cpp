#include "unite_parts.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/corefinement.h>
#include <CGAL/Polygon_mesh_processing/manifoldness.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/boost/graph/Euler_operations.h>

#include "crossings.h"
#include "meshless_surgery/geometry/mesh/add_part.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "meshless_surgery/geometry/query/union_find.h"

namespace meshless {
namespace {

using Kernel = CGAL::Exact_predicates_exact_constructions_kernel;
using ExactSurface = CGAL::Surface_mesh<Kernel::Point_3>;
using RoundedKernel = CGAL::Simple_cartesian<double>;
using RoundedSurface = CGAL::Surface_mesh<RoundedKernel::Point_3>;
using PartPairs = std::set<std::pair<Index, Index>>;

constexpr double kThin = 1e-9;  // of the bounds' diagonal: as near as vertices are taken for one

Error refuse(const std::string& why) { return {ErrorCode::kUnsuitableShape, why}; }

/// What hangs together by vertices.
struct Part {
  TriangleMesh mesh;
  Box box;
  double volume = 0.0;  // [m^3]; negative where it is turned inwards

  bool outwards() const { return volume > 0.0; }
  void turn() {
    for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
    volume = -volume;
  }
};

struct Parts {
  std::vector<Part> all;
  std::vector<Index> of;  // one a triangle
};

Parts partsOf(const TriangleMesh& mesh) {
  UnionFind joined(mesh.vertices.size());
  for (const Triangle& t : mesh.triangles) {
    joined.join(t[0], t[1]);
    joined.join(t[0], t[2]);
  }
  Parts parts;
  std::vector<Index> part_of(mesh.vertices.size(), kNoIndex), number(mesh.vertices.size(), kNoIndex);
  for (const Triangle& t : mesh.triangles) {
    Index& part = part_of[joined.find(t[0])];
    if (part == kNoIndex) {
      part = static_cast<Index>(parts.all.size());
      parts.all.emplace_back();
    }
    parts.of.push_back(part);
    TriangleMesh& own = parts.all[part].mesh;
    Triangle corners;
    for (int k = 0; k < 3; ++k) {
      if (number[t[k]] == kNoIndex) {
        number[t[k]] = static_cast<Index>(own.vertices.size());
        own.vertices.push_back(mesh.vertices[t[k]]);
      }
      corners[k] = number[t[k]];
    }
    own.triangles.push_back(corners);
  }
  for (Part& part : parts.all) {
    part.box = boundsOf(part.mesh.vertices);
    part.volume = signedVolume(part.mesh);
  }
  return parts;
}

/// Of each part those that hold it whole and do not cross it.
std::vector<std::vector<Index>> containersOf(const std::vector<Part>& parts, const PartPairs& crossing) {
  std::vector<std::vector<Index>> containers(parts.size());
  for (Index outer = 0; outer < parts.size(); ++outer) {
    std::unique_ptr<SolidQuery> query;  // made for those that hold another's box
    for (Index inner = 0; inner < parts.size(); ++inner) {
      const Box &in = parts[inner].box, &out = parts[outer].box;
      if (inner == outer || !out.contains(in.min) || !out.contains(in.max) ||
          crossing.count({std::min(inner, outer), std::max(inner, outer)}))
        continue;
      if (!query) {
        Part turned = parts[outer];
        if (!turned.outwards()) turned.turn();
        query = std::make_unique<SolidQuery>(turned.mesh);
      }
      // Most of some vertices: one alone could lie on the other surface but for rounding.
      const Points& own = parts[inner].mesh.vertices;
      const std::size_t asked = std::min<std::size_t>(own.size(), 9);
      std::size_t inside = 0;
      for (std::size_t k = 0; k < asked; ++k) inside += query->contains(own[k * own.size() / asked]);
      if (2 * inside > asked) containers[inner].push_back(outer);
    }
  }
  return containers;
}

ExactSurface toExact(const TriangleMesh& mesh) {
  ExactSurface surface;
  for (const Vec3& p : mesh.vertices) surface.add_vertex(Kernel::Point_3(p.x(), p.y(), p.z()));
  for (const Triangle& t : mesh.triangles)
    surface.add_face(ExactSurface::Vertex_index(t[0]), ExactSurface::Vertex_index(t[1]),
                     ExactSurface::Vertex_index(t[2]));
  return surface;
}

Vec3 placeOf(const RoundedSurface& surface, RoundedSurface::Vertex_index v) {
  const auto& p = surface.point(v);
  return {p.x(), p.y(), p.z()};
}

double lengthOf(const RoundedSurface& surface, RoundedSurface::Halfedge_index h) {
  return (placeOf(surface, surface.target(h)) - placeOf(surface, surface.source(h))).norm();
}

RoundedSurface::Halfedge_index longestOf(const RoundedSurface& surface, RoundedSurface::Face_index f) {
  auto longest = surface.halfedge(f);
  for (const auto h : {surface.next(longest), surface.prev(longest)})
    if (lengthOf(surface, h) > lengthOf(surface, longest)) longest = h;
  return longest;
}

/// Above its longest edge.
double heightOf(const RoundedSurface& surface, RoundedSurface::Face_index f) {
  const auto h = longestOf(surface, f);
  const Vec3 a = placeOf(surface, surface.source(h)), b = placeOf(surface, surface.target(h)),
             c = placeOf(surface, surface.target(surface.next(h)));
  return (b - a).cross(c - a).norm() / std::max((b - a).norm(), 1e-300);
}

/// Where edges of two parts nearly meet, triangles are as thin as numbers are rounded, and rounding turns them over:
/// edges shorter than that collapse, and triangles that are less high are flipped into their neighbours.
void dropThin(RoundedSurface& surface, double thin) {
  for (bool changed = true; changed;) {
    changed = false;
    const auto edges = surface.edges();
    for (const auto e : std::vector<RoundedSurface::Edge_index>(edges.begin(), edges.end())) {
      if (surface.is_removed(e) || !(lengthOf(surface, surface.halfedge(e)) < thin) ||
          !CGAL::Euler::does_satisfy_link_condition(e, surface))
        continue;
      CGAL::Euler::collapse_edge(e, surface);
      changed = true;
    }
    for (const auto f : surface.faces()) {
      const double height = heightOf(surface, f);
      if (!(height < thin)) continue;
      const auto h = longestOf(surface, f), back = surface.opposite(h);
      const auto apex = surface.target(surface.next(h)), across = surface.target(surface.next(back));
      if (apex == across || CGAL::halfedge(apex, across, surface).second) continue;
      const double least = std::min(height, heightOf(surface, surface.face(back)));
      const auto flip = [&] { CGAL::Euler::flip_edge(h, surface); };
      flip();
      if (std::min(heightOf(surface, surface.face(h)), heightOf(surface, surface.face(back))) > least)
        changed = true;
      else
        flip();
    }
  }
}

TriangleMesh toRounded(ExactSurface& exact) {
  CGAL::Polygon_mesh_processing::duplicate_non_manifold_vertices(exact);
  RoundedSurface surface;
  std::vector<RoundedSurface::Vertex_index> vertex(exact.num_vertices() + exact.number_of_removed_vertices());
  for (const auto v : exact.vertices()) {
    const auto& p = CGAL::exact(exact.point(v));
    vertex[v] = surface.add_vertex(
        RoundedKernel::Point_3(CGAL::to_double(p.x()), CGAL::to_double(p.y()), CGAL::to_double(p.z())));
  }
  for (const auto f : exact.faces()) {
    const auto h = exact.halfedge(f);
    surface.add_face(vertex[exact.source(h)], vertex[exact.target(h)], vertex[exact.target(exact.next(h))]);
  }
  Box box;
  for (const auto v : surface.vertices()) box.extend(placeOf(surface, v));
  dropThin(surface, kThin * box.diagonal());
  TriangleMesh mesh;
  std::vector<Index> number(surface.num_vertices() + surface.number_of_removed_vertices(), kNoIndex);
  for (const auto f : surface.faces()) {
    Triangle t;
    int k = 0;
    for (const auto v : CGAL::vertices_around_face(surface.halfedge(f), surface)) {
      if (number[v] == kNoIndex) {
        number[v] = static_cast<Index>(mesh.vertices.size());
        mesh.vertices.push_back(placeOf(surface, v));
      }
      t[k++] = number[v];
    }
    mesh.triangles.push_back(t);
  }
  return mesh;
}

/// Two by two, so that the surfaces that are united are of about one size.
Result<ExactSurface> unionOf(std::vector<ExactSurface> solids) {
  while (solids.size() > 1) {
    std::vector<ExactSurface> united;
    for (std::size_t k = 0; k + 1 < solids.size(); k += 2) {
      ExactSurface both;
      if (!CGAL::Polygon_mesh_processing::corefine_and_compute_union(solids[k], solids[k + 1], both))
        return refuse("some of them meet in edges alone: what they make together is not manifold");
      united.push_back(std::move(both));
    }
    if (solids.size() % 2 == 1) united.push_back(std::move(solids.back()));
    solids = std::move(united);
  }
  return std::move(solids.front());
}

/// Those that cross each other of one solid's cavities are one cavity.
Result<TriangleMesh> cavitiesOf(const std::vector<Part>& parts, const std::vector<Index>& cavities,
                                const PartPairs& crossing) {
  UnionFind groups(parts.size());
  for (const auto& [a, b] : crossing)
    if (std::find(cavities.begin(), cavities.end(), a) != cavities.end() &&
        std::find(cavities.begin(), cavities.end(), b) != cavities.end())
      groups.join(a, b);
  std::map<Index, std::vector<Index>> members;
  for (const Index c : cavities) members[groups.find(c)].push_back(c);
  TriangleMesh all;
  for (const auto& [root, group] : members) {
    if (group.size() == 1) {
      addPart(parts[root].mesh, all);
      continue;
    }
    std::vector<ExactSurface> turned;
    for (const Index c : group) {
      Part part = parts[c];
      part.turn();
      turned.push_back(toExact(part.mesh));
    }
    Result<ExactSurface> united = unionOf(std::move(turned));
    if (!united) return united.error();
    TriangleMesh cavity = toRounded(*united);
    for (Triangle& t : cavity.triangles) std::swap(t[1], t[2]);
    addPart(cavity, all);
  }
  return all;
}

/// Without those parts that have the inside, or the outside, on both sides. Nothing crosses. How many these were.
std::size_t dropInner(TriangleMesh& mesh) {
  const std::vector<Part> parts = partsOf(mesh).all;
  const auto containers = containersOf(parts, {});
  TriangleMesh kept;
  std::size_t dropped = 0;
  for (std::size_t c = 0; c < parts.size(); ++c) {
    int around = 0;  // how often the others wind around it
    for (const Index outer : containers[c]) around += parts[outer].outwards() ? 1 : -1;
    const int within = around + (parts[c].outwards() ? 1 : -1);
    if ((around > 0) == (within > 0))
      ++dropped;
    else
      addPart(parts[c].mesh, kept);
  }
  if (dropped > 0) mesh = std::move(kept);
  return dropped;
}

std::string describe(const Part& part, std::size_t crossings) {
  const Vec3 middle = 0.5 * (part.box.min + part.box.max);
  std::ostringstream text;
  text << "one of " << part.mesh.triangles.size() << " triangles about (" << middle.x() << ", " << middle.y() << ", "
       << middle.z() << ") crosses itself: " << crossings
       << (crossings == 1 ? " pair of triangles meets" : " pairs of triangles meet");
  return text.str();
}

class Uniting {
 public:
  explicit Uniting(const TriangleMesh& mesh) {
    Parts split = partsOf(mesh);
    parts_ = std::move(split.all);
    if (parts_.size() < 2) return;
    own_crossings_.assign(parts_.size(), 0);
    forEachCrossing(mesh.vertices, mesh.triangles, [&](Index s, Index t) {
      const Index a = split.of[s], b = split.of[t];
      if (a == b)
        ++own_crossings_[a];
      else
        crossing_.insert({std::min(a, b), std::max(a, b)});
    });
  }

  Result<UnitedParts> run() {
    if (parts_.size() < 2) return UnitedParts{};
    containers_ = containersOf(parts_, crossing_);
    turnOutermost();
    findOwners();
    UnionFind groups(parts_.size());
    for (const auto& [a, b] : crossing_) groups.join(a, b);
    result_.filled = filledCavities();
    for (Index c = 0; c < parts_.size(); ++c)
      if (owner_[c] != kNoIndex) groups.join(owner_[c], c);
    std::map<Index, std::vector<Index>> members;
    for (Index c = 0; c < parts_.size(); ++c) members[groups.find(c)].push_back(c);
    std::set<Index> overlapping;
    for (const auto& [a, b] : crossing_) overlapping.insert({a, b});
    for (const auto& [root, group] : members) {
      if (std::none_of(group.begin(), group.end(), [&](Index c) { return overlapping.count(c) > 0; })) {
        for (const Index c : group) addPart(parts_[c].mesh, result_.mesh);
      } else if (Status united = unite(group); !united) {
        return united.error();
      }
    }
    result_.overlapping = overlapping.size();
    result_.swallowed = dropInner(result_.mesh);
    if (!result_.changed()) return UnitedParts{};
    return std::move(result_);
  }

 private:
  /// What lies in no other is a solid, however it is turned; what it holds is turned with it.
  void turnOutermost() {
    turned_.assign(parts_.size(), false);
    for (Index c = 0; c < parts_.size(); ++c) {
      Index outermost = c;
      for (const Index outer : containers_[c])
        if (std::abs(parts_[outer].volume) > std::abs(parts_[outermost].volume)) outermost = outer;
      turned_[c] = !parts_[outermost].outwards();
      result_.turned += turned_[c] && outermost == c;
    }
    for (Index c = 0; c < parts_.size(); ++c)
      if (turned_[c]) parts_[c].turn();
  }

  /// What was turned against a larger solid that it crosses is most often a cavity that reaches through its surface.
  std::size_t filledCavities() const {
    std::set<Index> filled;
    for (const auto& [a, b] : crossing_)
      if (parts_[a].outwards() && parts_[b].outwards() && turned_[a] != turned_[b])
        filled.insert(parts_[a].volume < parts_[b].volume ? a : b);
    return filled.size();
  }

  /// Of a cavity the innermost solid that holds it.
  void findOwners() {
    owner_.assign(parts_.size(), kNoIndex);
    for (Index c = 0; c < parts_.size(); ++c) {
      if (parts_[c].outwards()) continue;
      for (const Index outer : containers_[c])
        if (parts_[outer].outwards() && (owner_[c] == kNoIndex || parts_[outer].volume < parts_[owner_[c]].volume))
          owner_[c] = outer;
    }
  }

  Status unite(const std::vector<Index>& group) {
    TriangleMesh all;
    for (const Index c : group) {
      if (own_crossings_[c] > 0) return refuse(describe(parts_[c], own_crossings_[c]));
      addPart(parts_[c].mesh, all);
    }
    if (inspectMesh(all, false).degenerate_triangles > 0) return refuse("some have triangles without area");
    std::vector<ExactSurface> solids;
    for (const Index c : group) {
      if (!parts_[c].outwards()) continue;
      std::vector<Index> cavities;
      for (const Index other : group)
        if (owner_[other] == c) cavities.push_back(other);
      const Result<TriangleMesh> hollow = cavitiesOf(parts_, cavities, crossing_);
      if (!hollow) return hollow.error();
      TriangleMesh solid = parts_[c].mesh;
      addPart(*hollow, solid);
      solids.push_back(toExact(solid));
    }
    if (solids.empty()) return refuse("they enclose no volume");
    Result<ExactSurface> united = unionOf(std::move(solids));
    if (!united) return united.error();
    const TriangleMesh rounded = toRounded(*united);
    const MeshReport report = inspectMesh(rounded);
    if (!report.closed() || report.degenerate_triangles > 0 || report.self_intersections > 0)
      return refuse("what they make together touches itself");
    for (const Part& part : partsOf(rounded).all) result_.solids += part.outwards();
    result_.volume += report.signed_volume;
    addPart(rounded, result_.mesh);
    return Done{};
  }

  std::vector<Part> parts_;
  std::vector<std::size_t> own_crossings_;
  PartPairs crossing_;
  std::vector<std::vector<Index>> containers_;
  std::vector<bool> turned_;  // since the file
  std::vector<Index> owner_;  // of each cavity
  UnitedParts result_;
};

}  // namespace

Result<UnitedParts> uniteParts(const TriangleMesh& mesh) {
  try {
    return Uniting(mesh).run();
  } catch (const std::exception& fault) {  // CGAL's
    return refuse(std::string("CGAL found: ") + fault.what());
  }
}

}  // namespace meshless
