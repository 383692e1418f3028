// The solid's section within the blade's rectangle, triangulated.
#include <algorithm>
#include <cmath>
#include <memory>

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>

#include "cap_apart.h"
#include "cap_core.h"
#include "cap_outline.h"
#include "cap_rough.h"
#include "mesh/edge_table.h"
#include "surgery_parts.h"

namespace meshless {
namespace surgery {
namespace {

struct FaceInfo {
  int winding = 0;
  bool reached = false;
  bool in_core = false;
  bool filled = false;
};

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<Index, Kernel>;
using FaceBase =
    CGAL::Triangulation_face_base_with_info_2<FaceInfo, Kernel, CGAL::Constrained_triangulation_face_base_2<Kernel>>;
using Cdt =
    CGAL::Constrained_Delaunay_triangulation_2<Kernel, CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>>;
using Face = Cdt::Face_handle;

double cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

/// Every other bit of the result.
std::uint64_t spread(std::uint32_t bits) {
  std::uint64_t x = bits;
  x = (x | (x << 16)) & 0x0000ffff0000ffffu;
  x = (x | (x << 8)) & 0x00ff00ff00ff00ffu;
  x = (x | (x << 4)) & 0x0f0f0f0f0f0f0f0fu;
  x = (x | (x << 2)) & 0x3333333333333333u;
  return (x | (x << 1)) & 0x5555555555555555u;
}

/// Along a Morton curve, so that each point is inserted next to the one before. (CGAL's spatial_sort would take a tenth
/// of a plain cut.)
void sortByPlace(const std::vector<Vec2>& points, std::vector<Index>& order) {
  if (order.empty()) return;
  Vec2 low = points[order[0]], high = low;
  for (const Index i : order) {
    low = low.cwiseMin(points[i]);
    high = high.cwiseMax(points[i]);
  }
  const double extent = (high - low).maxCoeff(), scale = extent > 0.0 ? 65535.0 / extent : 0.0;
  std::vector<std::pair<std::uint64_t, Index>> keyed;
  keyed.reserve(order.size());
  for (const Index i : order) {
    const auto x = static_cast<std::uint32_t>(scale * (points[i].x() - low.x()));
    const auto y = static_cast<std::uint32_t>(scale * (points[i].y() - low.y()));
    keyed.emplace_back(spread(x) | spread(y) << 1, i);
  }
  std::sort(keyed.begin(), keyed.end());
  // In rounds, from coarse to fine: without them a rim that runs round is triangulated by thin fans, again and again.
  std::size_t stride = 1, sorted = 0;
  while (8 * stride < keyed.size()) stride *= 4;
  for (std::size_t k = 0; k < keyed.size(); k += stride) order[sorted++] = keyed[k].second;
  for (; stride > 1; stride /= 4)
    for (std::size_t k = 0; k < keyed.size(); k += stride / 4)
      if (k % stride != 0) order[sorted++] = keyed[k].second;
}

/// What a constrained edge parts.
struct Border {
  int weight = 0;  // from the lower number to the higher
  bool rim = false, core = false;
};
using Borders = EdgeTable<Border>;

enum class Filled { kYes, kCrossing, kOpen, kNothing };

/// What hangs together with one rim, filled. Nodes: those of the rim, the rectangle's four corners, those on its
/// border, those of the core.
class Filler {
 public:
  Filler(const SplitSurface& surface, const InciseOptions& options, const std::vector<Vec2>& places,
         std::vector<OutlineSegment> rim, const std::vector<SectionEdge>& section)
      : surface_(surface),
        frame_(surface.frame),
        options_(options),
        places_(places),
        rim_(std::move(rim)),
        section_(section),
        rim_nodes_(static_cast<Index>(places.size())) {
    for (const double x : {frame_.low.x(), frame_.high.x()})
      for (const double y : {frame_.low.y(), frame_.high.y()})
        if (std::find(places.begin(), places.end(), Vec2(x, y)) == places.end()) places_.emplace_back(x, y);
  }

  Filled run() {
    if (rim_.empty()) return Filled::kNothing;
    Filled state = triangulate({});
    if (state != Filled::kYes) return state;
    if (!any_filled_) return Filled::kNothing;
    const std::vector<OutlineSegment> outline = refineFront();
    const CapCore core = coreOf(places_, outline, spacing(), options_.max_points);
    for (const CapCore& tried : {core, CapCore()}) {
      state = triangulate(tried);
      if (state == Filled::kYes) return collect(outline, tried);
      if (core.places.empty()) return state;
    }
    return state;
  }

  /// Winding number of the section around p, counted along +x.
  static int windingAt(const SplitSurface& surface, const std::vector<SectionEdge>& section, const Vec2& p) {
    int winding = 0;
    for (const SectionEdge& e : section) {
      const Vec2 &a = surface.places[e.from], &b = surface.places[e.to];
      if ((a.y() > p.y()) == (b.y() > p.y())) continue;
      const double x = a.x() + (p.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
      if (x > p.x()) winding += b.y() > a.y() ? e.weight : -e.weight;
    }
    return winding;
  }

  // The result: nodes of the rim first; those without a triangle are not used.
  std::vector<Vec2> places() const { return places_; }
  Index rimNodes() const { return rim_nodes_; }
  std::vector<WoundTriangle> triangles;
  bool any_solid = false;
  // For roughness.
  std::vector<OutlineSegment> outline;
  CapCore core;
  Index first_core = 0;

 private:
  double spacing() const { return options_.spacing > 0.0 ? options_.spacing : surface_.spacing; }
  const Vec2& place(Face face, int i) const { return places_[face->vertex(i)->info()]; }

  Filled triangulate(const CapCore& core) {
    cdt_.clear();
    std::vector<Vec2> points = places_;
    const Index first_core = static_cast<Index>(points.size());
    points.insert(points.end(), core.places.begin(), core.places.end());
    std::vector<Index> order;
    std::vector<char> used(points.size(), 0);
    for (const OutlineSegment& s : rim_) used[s.from] = used[s.to] = 1;
    for (Index n = rim_nodes_; n < first_core; ++n) used[n] = 1;
    for (Index n = 0; n < core.places.size(); ++n) used[first_core + n] = !core.inside[n];
    for (Index n = 0; n < points.size(); ++n)
      if (used[n]) order.push_back(n);
    sortByPlace(points, order);
    std::vector<Cdt::Vertex_handle> handles(points.size());
    Face hint;
    for (const Index n : order) {
      handles[n] = cdt_.insert(Kernel::Point_2(points[n].x(), points[n].y()), hint);
      handles[n]->info() = n;
      hint = handles[n]->face();
    }
    borders_ = std::make_unique<Borders>(2 * (rim_.size() + core.border.size()), Border());
    try {
      for (const OutlineSegment& s : rim_) {
        Border& border = borders_->at(s.from, s.to);
        border.weight += s.from < s.to ? s.weight : -s.weight;
        border.rim = true;
        cdt_.insert_constraint(handles[s.from], handles[s.to]);
      }
      for (const auto& [from, to] : core.border) {
        borders_->at(first_core + from, first_core + to).core = true;
        cdt_.insert_constraint(handles[first_core + from], handles[first_core + to]);
      }
    } catch (const Cdt::Intersection_of_constraints_exception&) {
      return Filled::kCrossing;
    }
    // A segment that passes through a node was cut there by the triangulation, but not in the mesh.
    for (const OutlineSegment& s : rim_)
      if (!cdt_.is_edge(handles[s.from], handles[s.to])) return Filled::kCrossing;
    if (cdt_.dimension() < 2) return Filled::kNothing;
    return flood(handles) ? Filled::kYes : Filled::kOpen;
  }

  const Border* borderAt(Face face, int i) const {
    if (!face->is_constrained(i)) return nullptr;
    return &borders_->of(face->vertex(Cdt::ccw(i))->info(), face->vertex(Cdt::cw(i))->info());
  }

  /// Where the winding numbers start: beside the rectangle's corner in the air, or in the middle of the largest face,
  /// where rounding cannot reach.
  Face start(const std::vector<Cdt::Vertex_handle>& handles, int& winding) const {
    winding = 0;
    Face first = cdt_.infinite_face();
    if (!frame_.bounded) {
      auto around = cdt_.incident_faces(handles[rim_nodes_]);
      while (cdt_.is_infinite(Face(around))) ++around;
      return around;
    }
    double largest = -1.0;
    for (const Face face : cdt_.finite_face_handles()) {
      const double area = cross(place(face, 1) - place(face, 0), place(face, 2) - place(face, 0));
      if (!(area > largest)) continue;
      largest = area;
      first = face;
    }
    winding = windingAt(surface_, section_, (place(first, 0) + place(first, 1) + place(first, 2)) / 3.0);
    return first;
  }

  /// Winding numbers, and the parts of the solid's section that the rim bounds. False where two ways to a face
  /// disagree, or the core is not where the winding is 1.
  bool flood(const std::vector<Cdt::Vertex_handle>& handles) {
    for (const Face face : cdt_.all_face_handles()) face->info() = FaceInfo();
    int winding = 0;
    // The core's points are not in places_: the largest face is looked for among the rim's.
    if (!seeded_) {
      const Face first = start(handles, winding);
      seed_ = (place(first, 0) + place(first, 1) + place(first, 2)) / 3.0;
      seed_winding_ = winding;
      seeded_ = true;
    }
    // A face of the core may hold the seed: from the rectangle's corner all is reached as well.
    Face seed = cdt_.locate(Kernel::Point_2(seed_.x(), seed_.y()));
    if (cdt_.is_infinite(seed)) return false;
    seed->info().winding = seed_winding_;
    seed->info().reached = true;
    std::vector<Face> open{seed}, all;
    while (!open.empty()) {
      const Face face = open.back();
      open.pop_back();
      all.push_back(face);
      for (int i = 0; i < 3; ++i) {
        const Face other = face->neighbor(i);
        if (cdt_.is_infinite(other)) continue;
        FaceInfo there = face->info();
        if (const Border* border = borderAt(face, i)) {
          const Index from = face->vertex(Cdt::ccw(i))->info(), to = face->vertex(Cdt::cw(i))->info();
          there.winding -= from < to ? border->weight : -border->weight;
          there.in_core ^= border->core;
        }
        if (other->info().reached) {
          if (other->info().winding != there.winding || other->info().in_core != there.in_core) return false;
          continue;
        }
        other->info() = there;
        open.push_back(other);
      }
    }
    // The seed was taken to be outside of the core. If it is not, all are the other way round.
    bool inverted = false;
    for (const Face face : all)
      for (int i = 0; i < 3; ++i) inverted |= cdt_.is_infinite(face->neighbor(i)) && face->info().in_core;
    any_filled_ = any_solid = false;
    for (const Face face : all) {
      if (inverted) face->info().in_core = !face->info().in_core;
      if (face->info().in_core && face->info().winding != 1) return false;
      any_solid |= face->info().winding != 0;
      face->info().reached = false;
    }
    std::vector<Face> members;
    for (const Face first : all) {
      if (first->info().winding == 0 || first->info().reached) continue;
      members.assign(1, first);
      first->info().reached = true;
      bool reaches_rim = false;
      for (std::size_t m = 0; m < members.size(); ++m)
        for (int i = 0; i < 3; ++i) {
          const Border* border = borderAt(members[m], i);
          if (border && border->rim) {
            reaches_rim = true;
            continue;
          }
          const Face other = members[m]->neighbor(i);
          if (cdt_.is_infinite(other) || other->info().reached || other->info().winding == 0) continue;
          other->info().reached = true;
          members.push_back(other);
        }
      any_filled_ |= reaches_rim;
      for (const Face face : members) face->info().filled = reaches_rim;
    }
    return true;
  }

  int filledWinding(Face face) const {
    return !cdt_.is_infinite(face) && face->info().filled ? face->info().winding : 0;
  }

  /// Nodes on the buried front, at the spacing of the surface. What bounds the filled part.
  std::vector<OutlineSegment> refineFront() {
    std::vector<OutlineSegment> bounds;
    const double h = spacing();
    std::vector<std::pair<Index, Index>> fronts;
    std::vector<int> weights;
    double area = 0.0;
    for (const Face face : cdt_.finite_face_handles()) {
      if (!face->info().filled) continue;
      area += 0.5 * cross(place(face, 1) - place(face, 0), place(face, 2) - place(face, 0));
      for (int i = 0; i < 3; ++i) {
        const Border* border = borderAt(face, i);
        const bool rim = border && border->rim;
        const Face other = face->neighbor(i);
        const int beyond = filledWinding(other);
        if (!rim && beyond == face->info().winding) continue;
        const Index a = face->vertex(Cdt::ccw(i))->info(), b = face->vertex(Cdt::cw(i))->info();
        if (beyond != 0 && a > b) continue;  // once for both of its faces
        if (rim) {
          bounds.push_back({a, b, face->info().winding - beyond});
        } else {
          fronts.emplace_back(a, b);
          weights.push_back(face->info().winding);
        }
      }
    }
    const double least =
        options_.max_points > 0 ? std::sqrt(area / (0.866 * static_cast<double>(options_.max_points))) : 0.0;
    for (std::size_t n = 0; n < fronts.size(); ++n) {
      const auto [a, b] = fronts[n];
      const Vec2 from = places_[a], to = places_[b];
      const double step = std::max({h, least, 1e-3 * (frame_.high - frame_.low).norm()});
      const int parts = std::max(1, static_cast<int>(std::lround((to - from).norm() / step)));
      Index last = a;
      for (int k = 1; k < parts; ++k) {
        Vec2 p = from + (to - from) * (static_cast<double>(k) / parts);
        for (int axis = 0; axis < 2; ++axis)
          if (from[axis] == to[axis]) p[axis] = from[axis];  // on the border to the last bit
        const Index made = static_cast<Index>(places_.size());
        places_.push_back(p);
        bounds.push_back({last, made, weights[n]});
        last = made;
      }
      bounds.push_back({last, b, weights[n]});
    }
    return bounds;
  }

  Filled collect(const std::vector<OutlineSegment>& bounds, const CapCore& tried) {
    if (!any_filled_) return Filled::kNothing;
    outline = bounds;
    core = tried;
    first_core = static_cast<Index>(places_.size());
    places_.insert(places_.end(), core.places.begin(), core.places.end());
    for (const Face face : cdt_.finite_face_handles()) {
      if (!face->info().filled || face->info().in_core) continue;
      std::array<Index, 3> n{face->vertex(0)->info(), face->vertex(1)->info(), face->vertex(2)->info()};
      std::rotate(n.begin(), std::min_element(n.begin(), n.end()), n.end());
      triangles.push_back({n, face->info().winding});
    }
    // CGAL settles nodes on one circle by their coordinates: the triangles are always the same, their order need not
    // be.
    std::sort(triangles.begin(), triangles.end(),
              [](const WoundTriangle& a, const WoundTriangle& b) { return a.nodes < b.nodes; });
    for (const Triangle& t : core.triangles)
      triangles.push_back({{first_core + t[0], first_core + t[1], first_core + t[2]}, 1});
    return Filled::kYes;
  }

  const SplitSurface& surface_;
  const Frame& frame_;
  const InciseOptions& options_;
  std::vector<Vec2> places_;
  std::vector<OutlineSegment> rim_;
  const std::vector<SectionEdge>& section_;
  const Index rim_nodes_;
  std::unique_ptr<Borders> borders_;
  Cdt cdt_;
  bool seeded_ = false, any_filled_ = false;
  Vec2 seed_ = Vec2::Zero();
  int seed_winding_ = 0;
};

/// Puts what was filled into the wound. `nodes` has the vertices of this rim.
void add(const SplitSurface& surface, const InciseOptions& options, const Filler& filler, const Nodes& nodes,
         Wound& wound) {
  const Index first = static_cast<Index>(wound.nodes.size());
  for (const Vec2& place : filler.places()) wound.nodes.push_back({place, kNoIndex, 0.0});
  for (const auto& [vertex, node] : nodes.of_vertex) {
    wound.node_of_vertex.emplace(vertex, first + node);
    Index& lowest = wound.nodes[first + node].vertex;
    lowest = std::min(lowest, vertex);
  }
  const std::size_t first_triangle = wound.triangles.size();
  for (const WoundTriangle& t : filler.triangles)
    wound.triangles.push_back({{first + t.nodes[0], first + t.nodes[1], first + t.nodes[2]}, t.winding});
  if (options.roughness > 0.0 && !filler.triangles.empty())
    roughen(surface, filler.places(), filler.outline, filler.core, first + filler.first_core, first_triangle,
            options.roughness, options.seed, wound);
}

Vec3 restOf(const SplitSurface& surface, const InciseOptions& options, Index vertex) {
  Vec3 rest = Vec3::Zero();
  const VertexOrigin origin = surface.originOf(vertex);
  for (int k = 0; k < 4 && origin.parents[k] != kNoIndex; ++k)
    rest += origin.weights[k] * (*options.rest)[origin.parents[k]];
  return rest;
}

/// What is filled by itself.
struct Group {
  std::vector<RimEdge> rim;
  std::vector<SectionEdge> section;
};

/// The rim in groups that lie in each other now and are apart at rest; one group where they cannot be told.
std::vector<Group> groupsOf(const SplitSurface& surface, const std::vector<RimEdge>& rim,
                            const InciseOptions& options) {
  const std::vector<Group> whole{{rim, surface.section}};
  if (!options.rest) return whole;
  std::unordered_map<Index, Index> number;
  std::vector<Vec2> places;
  Points rest;
  std::vector<OutlineSegment> segments;
  const auto numberOf = [&](Index v) {
    const auto [at, fresh] = number.emplace(v, static_cast<Index>(places.size()));
    if (fresh) {
      places.push_back(surface.places[v]);
      rest.push_back(restOf(surface, options, v));
    }
    return at->second;
  };
  for (const SectionEdge& e : surface.section) {
    const Index from = numberOf(e.from), to = numberOf(e.to);
    segments.push_back({from, to, e.weight});
  }
  const std::vector<Index> group_of = curvesApart(places, segments, rest, options.apart);
  if (group_of.empty()) return whole;
  std::vector<Group> groups;
  const auto groupOf = [&](Index v) -> Group* {
    const auto made = surface.section_of_made.find(v);
    const auto at = number.find(made == surface.section_of_made.end() ? v : made->second);
    if (at == number.end() || group_of[at->second] == kNoIndex) return nullptr;
    if (group_of[at->second] >= groups.size()) groups.resize(group_of[at->second] + 1);
    return &groups[group_of[at->second]];
  };
  for (const RimEdge& e : rim) {
    Group* const group = groupOf(e.from);
    if (!group) return whole;
    group->rim.push_back(e);
  }
  for (const SectionEdge& e : surface.section)
    if (Group* const group = groupOf(e.from)) group->section.push_back(e);
  return groups;
}

std::vector<OutlineSegment> outlineOf(const Nodes& nodes, const std::vector<RimEdge>& rim) {
  std::vector<OutlineSegment> outline;
  outline.reserve(rim.size());
  for (const RimEdge& e : rim) {
    const Index from = nodes.of_vertex.at(e.from), to = nodes.of_vertex.at(e.to);
    if (from != to) outline.push_back({from, to, e.weight});
  }
  return outline;
}

/// Triangles no higher than rounding: parts of the rim that lie on each other.
bool hasSlivers(const std::vector<Vec2>& places, const std::vector<WoundTriangle>& triangles) {
  const double snap = snapDistance(places);
  for (const WoundTriangle& t : triangles) {
    const Vec2 &a = places[t.nodes[0]], &b = places[t.nodes[1]], &c = places[t.nodes[2]];
    const double longest = std::sqrt(std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()}));
    if (!(std::abs(cross(b - a, c - a)) > snap * longest)) return true;
  }
  return false;
}

/// Fills one group; where its rim crosses itself, if `crossing` may be, or lies on itself but for rounding, it is split
/// there.
Filled fillGroup(SplitSurface& surface, const InciseOptions& options, const Group& group, bool crossing, Wound& wound,
                 bool& any_solid) {
  const Nodes nodes = nodesOf(surface, group.rim);
  Filler plain(surface, options, nodes.places, outlineOf(nodes, group.rim), group.section);
  const Filled state = plain.run();
  any_solid |= plain.any_solid;
  if (state == Filled::kOpen) return state;
  if (state == Filled::kCrossing && !crossing) return state;
  const bool has_length = std::none_of(group.rim.begin(), group.rim.end(), [&](const RimEdge& e) {
    return nodes.of_vertex.at(e.from) == nodes.of_vertex.at(e.to);
  });
  const bool usable = state != Filled::kCrossing && has_length;
  if (usable && !hasSlivers(plain.places(), plain.triangles)) {
    add(surface, options, plain, nodes, wound);
    return state;
  }
  SplitSurface split = surface;
  std::vector<RimEdge> rim = group.rim;
  Nodes all = nodes;
  if (splitRim(split, rim, all)) {
    Filler filler(split, options, all.places, outlineOf(all, rim), group.section);
    const Filled again = filler.run();
    if (again == Filled::kYes || again == Filled::kNothing) {
      surface = std::move(split);
      add(surface, options, filler, all, wound);
      return again;
    }
  }
  if (usable) add(surface, options, plain, nodes, wound);
  return state;
}

}  // namespace

Result<Wound> fillWound(SplitSurface& surface, const InciseOptions& options) {
  const Frame& frame = surface.frame;
  const auto missed = [&](const std::string& why) -> Result<Wound> { return Error{ErrorCode::kMissed, why}; };
  const auto nothing = [&] {
    return missed(surface.lies_in_surface ? "nothing is left to open: the tissue is already open there, or the blade "
                                            "only lies on it"
                                          : "the blade meets no tissue");
  };
  Wound wound;
  std::vector<RimEdge> rim = rimOf(surface);
  if (rim.empty()) {
    if (!frame.bounded) return wound;  // it may lie between parts
    if (Filler::windingAt(surface, surface.section, 0.5 * (frame.low + frame.high)) != 0)
      return missed("the blade does not reach the surface: it is wholly inside the tissue");
    return nothing();
  }
  bool any_solid = false;
  Filled state = fillGroup(surface, options, {rim, surface.section}, options.rest == nullptr, wound, any_solid);
  if (state == Filled::kCrossing && options.rest)
    for (const Group& group : groupsOf(surface, rim, options)) {
      state = fillGroup(surface, options, group, true, wound, any_solid);
      if (state == Filled::kOpen || state == Filled::kCrossing) break;
    }
  if (state == Filled::kOpen)
    return Error{ErrorCode::kUnsuitableShape, "the surface is open or not oriented where the blade meets it"};
  if (state == Filled::kCrossing)
    return Error{ErrorCode::kUnsuitableShape,
                 "the surface crosses itself where the blade meets it, and cannot be closed"};
  if (wound.triangles.empty() && frame.bounded) {
    if (any_solid) return missed("the blade does not reach the surface: it touches it without opening it");
    return nothing();
  }
  wound.rim = rimOf(surface);
  return wound;
}

}  // namespace surgery
}  // namespace meshless
