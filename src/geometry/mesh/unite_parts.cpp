#include "unite_parts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <map>
#include <numeric>
#include <set>
#include <sstream>
#include <tuple>
#include <utility>

#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/boost/graph/Euler_operations.h>

#include "arrangement.h"
#include "exact.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "meshless_surgery/geometry/query/union_find.h"

namespace meshless {
namespace {

using RoundedKernel = CGAL::Simple_cartesian<double>;
using RoundedSurface = CGAL::Surface_mesh<RoundedKernel::Point_3>;

constexpr double kThin = 1e-9;        // of the bounds' diagonal: as near as vertices are taken for one
constexpr double kMillilitre = 1e-6;  // [m^3]

Error refuse(const std::string& why) { return {ErrorCode::kUnsuitableShape, why}; }

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

TriangleMesh withoutThin(const TriangleMesh& mesh) {
  RoundedSurface surface;
  for (const Vec3& p : mesh.vertices) surface.add_vertex(RoundedKernel::Point_3(p.x(), p.y(), p.z()));
  using Vertex = RoundedSurface::Vertex_index;
  for (const Triangle& t : mesh.triangles) surface.add_face(Vertex(t[0]), Vertex(t[1]), Vertex(t[2]));
  dropThin(surface, kThin * boundsOf(mesh.vertices).diagonal());
  TriangleMesh kept;
  std::vector<Index> number(mesh.vertices.size(), kNoIndex);
  for (const auto v : surface.vertices()) {
    if (surface.is_isolated(v)) continue;
    number[v] = static_cast<Index>(kept.vertices.size());
    kept.vertices.push_back(placeOf(surface, v));
  }
  for (const auto f : surface.faces()) {
    Triangle t;
    int k = 0;
    for (const auto v : CGAL::vertices_around_face(surface.halfedge(f), surface)) t[k++] = number[v];
    kept.triangles.push_back(t);
  }
  return kept;
}

std::string millilitres(double volume) {
  std::ostringstream text;
  text.precision(3);
  text << volume / kMillilitre << " ml";
  return text.str();
}

/// "0.12 ml of its 4 ml (3 %)"
std::string shareOf(double volume, double all) {
  std::ostringstream text;
  text.precision(2);
  text << millilitres(volume) << " of its " << millilitres(all) << " (" << 100.0 * volume / all << " %)";
  return text.str();
}

std::string counted(std::size_t n, const std::string& one, const std::string& many) {
  return n == 1 ? "1 " + one : std::to_string(n) + " " + many;
}

bool runsUp(const Triangle& t, Index low, Index high) {
  return (t[0] == low && t[1] == high) || (t[1] == low && t[2] == high) || (t[2] == low && t[0] == high);
}

class Uniting {
 public:
  explicit Uniting(const TriangleMesh& file) { take(file); }

  Result<UnitedParts> run() {
    turnToNeighbours();
    dropTwins();
    space_ = arrange(points_, triangles_);
    countWalls();
    findUnbalanced();
    wind();
    fillRegions();
    turnParts();
    decide();
    if (std::none_of(solid_.begin(), solid_.end(), [](char solid) { return solid; }))
      return refuse("the surface encloses nothing");
    extract();
    describe();
    return std::move(result_);
  }

 private:
  struct Part {
    bool regions = false;  // its triangles cannot agree: cells are counted, not how often it winds around them
    bool turned = false;
    bool inside_out = false;  // in the file
    double extent = 0.0;      // [m^3] of the cells that it winds around
    Index holder = kNoIndex;
    bool touches = false;       // another one
    std::size_t crossings = 0;  // with itself

    bool inwards() const { return turned != inside_out; }
  };
  /// Of a part, on a facet.
  struct Wall {
    Index part;
    int net = 0;  // how often more it is turned as the facet than against it
    bool both = false;
    bool open = false;  // it does not part what this part divides space into

    int once() const { return (net > 0) - (net < 0); }
  };
  struct Side {
    Index group, low, high, triangle;
    int k;  // the triangle's k-th
    bool up;
    auto key() const { return std::make_tuple(group, low, high); }
    bool operator<(const Side& o) const {
      return std::make_tuple(group, low, high, triangle) < std::make_tuple(o.group, o.low, o.high, o.triangle);
    }
  };

  /// Calls with the first side and the one behind the last of each edge.
  template <class Edge>
  static void forEachEdge(std::vector<Side>& sides, const Edge& edge) {
    std::sort(sides.begin(), sides.end());
    for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
      while (end < sides.size() && sides[end].key() == sides[begin].key()) ++end;
      edge(&sides[begin], &sides[begin] + (end - begin));
    }
  }

  static Side sideOf(const Triangle& t, int k, Index triangle) {
    const Index a = t[k], b = t[(k + 1) % 3];
    return {0, std::min(a, b), std::max(a, b), triangle, k, a < b};
  }

  /// At one place one vertex; parts by the edges of the file.
  void take(const TriangleMesh& file) {
    const TriangleMesh merged = withMergedVertices(file);
    points_ = file.vertices;
    std::vector<Side> sides, open;
    for (std::size_t f = 0; f < merged.triangles.size(); ++f) {
      const Triangle& t = merged.triangles[f];
      if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0] || exact::onALine({points_[t[0]], points_[t[1]], points_[t[2]]}))
        continue;
      const Index number = static_cast<Index>(triangles_.size());
      triangles_.push_back(t);
      for (int k = 0; k < 3; ++k) {
        sides.push_back(sideOf(file.triangles[f], k, number));
        places_.push_back(sideOf(t, k, number));
      }
    }
    UnionFind joined(triangles_.size());
    const auto join = [&](const Side* first, const Side* last) {
      for (const Side* s = first + 1; s < last; ++s) joined.join(first->triangle, s->triangle);
      return last - first == 1;
    };
    forEachEdge(sides, [&](const Side* first, const Side* last) {
      if (join(first, last)) open.push_back(places_[3 * first->triangle + static_cast<Index>(first->k)]);
    });
    forEachEdge(open, join);
    const std::vector<Index>& root = joined.flatten();
    std::map<Index, Index> number;
    for (const Index r : root) part_of_.push_back(number.emplace(r, static_cast<Index>(number.size())).first->second);
    parts_.resize(number.size());
  }

  /// Triangles of a part that share an edge with one another alone.
  void turnToNeighbours() {
    struct Neighbour {
      Index triangle;
      bool agrees;
    };
    for (Side& side : places_) side.group = part_of_[side.triangle];
    std::vector<std::vector<Neighbour>> neighbours(triangles_.size());
    forEachEdge(places_, [&](const Side* first, const Side* last) {
      if (last - first != 2) return;
      const bool agrees = first[0].up != first[1].up;
      neighbours[first[0].triangle].push_back({first[1].triangle, agrees});
      neighbours[first[1].triangle].push_back({first[0].triangle, agrees});
    });
    std::vector<char> reached(triangles_.size(), 0), against(triangles_.size(), 0);
    std::size_t turned = 0;
    for (Index seed = 0; seed < triangles_.size(); ++seed) {
      if (reached[seed]) continue;
      std::vector<Index> patch = {seed};
      reached[seed] = 1;
      std::size_t turns = 0;
      for (std::size_t k = 0; k < patch.size(); ++k)
        for (const Neighbour& n : neighbours[patch[k]]) {
          if (reached[n.triangle]) continue;
          reached[n.triangle] = 1;
          against[n.triangle] = n.agrees ? against[patch[k]] : !against[patch[k]];
          turns += against[n.triangle];
          patch.push_back(n.triangle);
        }
      const bool fewer = 2 * turns <= patch.size();
      for (const Index t : patch)
        if ((against[t] != 0) == fewer) {
          std::swap(triangles_[t][1], triangles_[t][2]);
          ++turned;
        }
    }
    if (turned > 0)
      result_.notes.push_back("turned " + counted(turned, "triangle", "triangles") +
                              " that faced against the neighbours");
  }

  /// Parts that lie on another one, triangle on triangle.
  void dropTwins() {
    std::map<Triangle, std::set<Index>> at;  // by corners
    std::vector<std::size_t> size(parts_.size(), 0);
    for (Index t = 0; t < triangles_.size(); ++t) {
      Triangle key = triangles_[t];
      std::sort(key.begin(), key.end());
      size[part_of_[t]] += at[key].insert(part_of_[t]).second;
    }
    std::vector<std::map<Index, std::size_t>> shared(parts_.size());  // of each part with those before it
    for (const auto& [key, parts] : at)
      for (auto later = parts.begin(); later != parts.end(); ++later)
        for (auto part = parts.begin(); part != later; ++part) ++shared[*later][*part];
    std::vector<char> gone(parts_.size(), 0);
    for (Index p = 0; p < parts_.size(); ++p)
      for (const auto& [other, count] : shared[p]) gone[p] |= count == size[p] && count == size[other];
    std::size_t kept = 0;
    for (Index t = 0; t < triangles_.size(); ++t) {
      if (gone[part_of_[t]]) continue;
      triangles_[kept] = triangles_[t];
      part_of_[kept++] = part_of_[t];
    }
    noteTwice(triangles_.size() - kept);
    triangles_.resize(kept);
    part_of_.resize(kept);
  }

  void noteTwice(std::size_t count) {
    if (count == 0) return;
    result_.notes.push_back("dropped " + counted(count, "triangle that was", "triangles that were") + " there twice");
    result_.changed = true;
  }

  void countWalls() {
    walls_.resize(space_.facets.size());
    for (std::size_t f = 0; f < walls_.size(); ++f) {
      for (const Arrangement::Use& use : space_.uses[f]) {
        const Index part = part_of_[use.triangle];
        auto wall = std::find_if(walls_[f].begin(), walls_[f].end(), [&](const Wall& w) { return w.part == part; });
        const bool is_new = wall == walls_[f].end();
        if (is_new) wall = walls_[f].insert(wall, Wall{part});
        const int net = use.forward ? 1 : -1;
        wall->both = wall->both || (!is_new && wall->net * net <= 0);
        wall->net += net;
      }
      if (walls_[f].size() > 1)
        for (const Wall& wall : walls_[f]) parts_[wall.part].touches = true;
    }
    for (const auto& [a, b] : space_.crossings) {
      if (part_of_[a] == part_of_[b]) ++parts_[part_of_[a]].crossings;
      if (part_of_[a] != part_of_[b]) parts_[part_of_[a]].touches = parts_[part_of_[b]].touches = true;
    }
  }

  /// Whether a part winds around what it bounds a whole number of times: with what it has twice, or with that once.
  void findUnbalanced() {
    std::vector<char> winds(parts_.size(), 0), open(parts_.size(), 0), open_once(parts_.size(), 0);
    for (const Arrangement::Edge& edge : space_.edges) {
      std::map<Index, std::array<int, 2>> sum;
      for (const auto& spoke : edge.spokes) {
        if (space_.cells[spoke.facet][0] == space_.cells[spoke.facet][1]) continue;  // bounds nothing
        const int sign = runsUp(space_.facets[spoke.facet], edge.low, edge.high) ? 1 : -1;
        for (const Wall& wall : walls_[spoke.facet]) {
          winds[wall.part] |= wall.net != 0;
          sum[wall.part][0] += sign * wall.net;
          sum[wall.part][1] += sign * wall.once();
        }
      }
      for (const auto& [part, net] : sum) {
        open[part] |= net[0] != 0;
        open_once[part] |= net[1] != 0;
      }
    }
    for (Index p = 0; p < parts_.size(); ++p) parts_[p].regions = !winds[p] || (open[p] && open_once[p]);
    std::size_t twice = 0;
    for (auto& walls : walls_)
      for (Wall& wall : walls) {
        if (!open[wall.part]) continue;
        twice += static_cast<std::size_t>(std::abs(wall.net - wall.once()));
        wall.net = wall.once();
      }
    noteTwice(twice);
  }

  void wind() {
    std::vector<std::vector<Index>> around(space_.volumes.size());  // facets of cells
    for (Index f = 0; f < walls_.size(); ++f)
      if (space_.cells[f][0] != space_.cells[f][1])
        for (const Index cell : space_.cells[f]) around[cell].push_back(f);
    windings_.resize(space_.volumes.size());
    std::vector<char> reached(space_.volumes.size(), 0);
    std::vector<Index> queue = {Arrangement::kOutside};
    reached[Arrangement::kOutside] = 1;
    for (std::size_t k = 0; k < queue.size(); ++k)
      for (const Index f : around[queue[k]]) {
        const bool inwards = space_.cells[f][0] == queue[k];
        const Index other = space_.cells[f][inwards ? 1 : 0];
        if (reached[other]) continue;
        reached[other] = 1;
        queue.push_back(other);
        windings_[other] = windings_[queue[k]];
        for (const Wall& wall : walls_[f]) {
          if (parts_[wall.part].regions || wall.net == 0) continue;
          int& winding = windings_[other][wall.part];
          winding += inwards ? wall.net : -wall.net;
          if (winding == 0) windings_[other].erase(wall.part);
        }
      }
  }

  /// Of parts whose triangles cannot agree: once around each of its cells that some triangle has its back to.
  void fillRegions() {
    for (Index p = 0; p < parts_.size(); ++p) {
      if (!parts_[p].regions) continue;
      UnionFind regions(space_.volumes.size());
      const auto wallOf = [&](Index f) {
        return std::find_if(walls_[f].begin(), walls_[f].end(), [&](const Wall& w) { return w.part == p; });
      };
      for (Index f = 0; f < walls_.size(); ++f)
        if (wallOf(f) == walls_[f].end()) regions.join(space_.cells[f][0], space_.cells[f][1]);
      const std::vector<Index>& region = regions.flatten();
      std::vector<char> tissue(region.size(), 0);
      for (Index f = 0; f < walls_.size(); ++f) {
        const auto wall = wallOf(f);
        if (wall == walls_[f].end()) continue;
        const Index ahead = region[space_.cells[f][0]], behind = region[space_.cells[f][1]];
        wall->open = ahead == behind;
        if (wall->open) continue;
        const bool both = wall->both || ahead == Arrangement::kOutside || behind == Arrangement::kOutside;
        tissue[ahead] |= both || wall->net < 0;
        tissue[behind] |= both || wall->net > 0;
      }
      std::set<Index> filled;
      for (Index cell = 1; cell < region.size(); ++cell)
        if (region[cell] != Arrangement::kOutside && tissue[region[cell]]) {
          windings_[cell][p] = 1;
          filled.insert(region[cell]);
        }
      for (Index f = 0; f < walls_.size(); ++f)
        result_.shared_walls |=
            wallOf(f) != walls_[f].end() && region[space_.cells[f][0]] != region[space_.cells[f][1]] &&
            filled.count(region[space_.cells[f][0]]) > 0 && filled.count(region[space_.cells[f][1]]) > 0;
      if (filled.size() > 1) regions_ += filled.size();
    }
  }

  /// Most of what one sees of a part from outside.
  bool looksOutwards(Index p) const {
    UnionFind apart(space_.volumes.size());  // by the part alone
    const auto wallOf = [&](Index f) {
      return std::find_if(walls_[f].begin(), walls_[f].end(), [&](const Wall& w) { return w.part == p && w.net != 0; });
    };
    for (Index f = 0; f < walls_.size(); ++f)
      if (wallOf(f) == walls_[f].end()) apart.join(space_.cells[f][0], space_.cells[f][1]);
    double outwards = 0.0;  // [m^2] less what looks inwards
    for (Index f = 0; f < walls_.size(); ++f) {
      const auto wall = wallOf(f);
      if (wall == walls_[f].end()) continue;
      const bool ahead = apart.find(space_.cells[f][0]) == Arrangement::kOutside,
                 behind = apart.find(space_.cells[f][1]) == Arrangement::kOutside;
      if (ahead == behind) continue;
      const double area = surfaceArea(space_.vertices, {space_.facets[f]});
      outwards += ahead == (wall->net > 0) ? area : -area;
    }
    return outwards > 0.0;
  }

  void turnParts() {
    std::vector<int> lowest(parts_.size(), 0), highest(parts_.size(), 0);
    for (Index cell = 1; cell < windings_.size(); ++cell)
      for (const auto& [part, winding] : windings_[cell]) {
        parts_[part].extent += space_.volumes[cell];
        lowest[part] = std::min(lowest[part], winding);
        highest[part] = std::max(highest[part], winding);
      }
    for (Index p = 0; p < parts_.size(); ++p)
      parts_[p].inside_out = lowest[p] < 0 && (highest[p] <= 0 || !looksOutwards(p));
    std::vector<std::map<Index, double>> held(parts_.size());  // [m^3] of each part in others
    for (Index cell = 1; cell < windings_.size(); ++cell)
      for (const auto& [part, one] : windings_[cell])
        for (const auto& [other, two] : windings_[cell])
          if (part != other) held[part][other] += space_.volumes[cell];
    std::vector<Index> order(parts_.size());
    std::iota(order.begin(), order.end(), Index{0});
    std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return parts_[a].extent > parts_[b].extent; });
    std::vector<char> known(parts_.size(), 0);
    for (const Index p : order) {
      Part& part = parts_[p];
      for (const auto& [other, volume] : held[p])
        if (known[other] && volume > 0.5 * part.extent &&
            (part.holder == kNoIndex || parts_[other].extent > parts_[part.holder].extent))
          part.holder = other;
      part.turned = part.holder != kNoIndex ? parts_[part.holder].turned : part.inside_out;
      if (part.regions) part.turned = false;
      known[p] = 1;
    }
  }

  void decide() {
    total_.assign(windings_.size(), 0);
    solid_.assign(windings_.size(), 0);
    for (Index cell = 1; cell < windings_.size(); ++cell) {
      for (const auto& [part, winding] : windings_[cell]) total_[cell] += parts_[part].turned ? -winding : winding;
      solid_[cell] = total_[cell] > 0;
    }
  }

  bool isBoundary(Index f) const { return solid_[space_.cells[f][0]] != solid_[space_.cells[f][1]]; }

  void extract() {
    const Index facets = static_cast<Index>(space_.facets.size());
    UnionFind corners(3 * facets);
    const auto cornerAt = [&](Index f, Index vertex) {
      const Triangle& t = space_.facets[f];
      return 3 * f + (t[0] == vertex ? 0 : t[1] == vertex ? 1 : 2);
    };
    // The two that bound the same tissue beside an edge hang together there.
    struct Seam {
      Index low, high, here, there;
    };
    std::vector<Seam> seams;
    for (const Arrangement::Edge& edge : space_.edges)
      for (std::size_t k = 0; k < edge.spokes.size(); ++k) {
        const Index here = edge.spokes[k].facet;
        if (!isBoundary(here) || !solid_[edge.spokes[k].cell_after]) continue;
        std::size_t next = (k + 1) % edge.spokes.size();
        while (!isBoundary(edge.spokes[next].facet)) next = (next + 1) % edge.spokes.size();
        seams.push_back({edge.low, edge.high, here, edge.spokes[next].facet});
        for (const Index v : {edge.low, edge.high}) corners.join(cornerAt(here, v), cornerAt(seams.back().there, v));
      }
    std::map<std::pair<Index, Index>, Index> number;  // of a vertex and a fan
    const auto numberOf = [&](Index corner) -> Index& {
      return number[{space_.facets[corner / 3][corner % 3], corners.find(corner)}];
    };
    for (Index f = 0; f < facets; ++f)
      if (isBoundary(f))
        for (Index k = 0; k < 3; ++k) numberOf(3 * f + k) = 0;
    Points& vertices = result_.mesh.vertices;
    Index last = kNoIndex;
    for (auto& [corner, at] : number) {
      at = static_cast<Index>(vertices.size());
      vertices.push_back(space_.vertices[corner.first]);
      result_.doubled += corner.first == last;
      last = corner.first;
    }
    // Of two that hang together at one edge and around both of its ends, each needs an edge of its own.
    std::map<std::pair<Index, Index>, std::vector<const Seam*>> alike;
    for (const Seam& seam : seams)
      alike[{numberOf(cornerAt(seam.here, seam.low)), numberOf(cornerAt(seam.here, seam.high))}].push_back(&seam);
    std::map<Index, std::vector<Triangle>> split;  // of facets
    const auto triangleOf = [&](Index f) {
      Triangle t = {numberOf(3 * f), numberOf(3 * f + 1), numberOf(3 * f + 2)};
      if (solid_[space_.cells[f][0]]) std::swap(t[1], t[2]);
      return t;
    };
    for (const auto& [ends, together] : alike) {
      if (together.size() < 2) continue;
      for (const Seam* seam : together) {
        const Index middle = static_cast<Index>(vertices.size());
        vertices.push_back(0.5 * (vertices[ends.first] + vertices[ends.second]));
        for (const Index f : {seam->here, seam->there}) {
          std::vector<Triangle>& parts = split.emplace(f, std::vector<Triangle>{triangleOf(f)}).first->second;
          for (std::size_t n = 0; n < parts.size(); ++n) {
            const auto from = std::find(parts[n].begin(), parts[n].end(), ends.first);
            const auto to = std::find(parts[n].begin(), parts[n].end(), ends.second);
            if (from == parts[n].end() || to == parts[n].end()) continue;
            Triangle other = parts[n];
            other[static_cast<std::size_t>(from - parts[n].begin())] = middle;
            *to = middle;
            parts.push_back(other);
            break;
          }
        }
      }
      result_.doubled += together.size() - 1;
    }
    for (Index f = 0; f < facets; ++f) {
      if (!isBoundary(f)) continue;
      const auto parts = split.find(f);
      if (parts == split.end())
        result_.mesh.triangles.push_back(triangleOf(f));
      else
        result_.mesh.triangles.insert(result_.mesh.triangles.end(), parts->second.begin(), parts->second.end());
    }
    result_.changed =
        result_.changed || !space_.crossings.empty() || result_.mesh.triangles.size() != triangles_.size();
    if (!space_.crossings.empty()) result_.mesh = withoutThin(result_.mesh);
  }

  void note(const std::string& what) { result_.notes.push_back(what); }
  void warn(const std::string& what) { result_.warnings.push_back(what); }

  void describe() {
    describeOpen();
    std::size_t turned = 0, overlapping = 0, crossings = 0;
    std::vector<char> bounds(parts_.size(), 0);
    for (Index f = 0; f < walls_.size(); ++f)
      if (isBoundary(f))
        for (const Wall& wall : walls_[f]) bounds[wall.part] = 1;
    double swallowed_volume = 0.0;
    std::size_t swallowed = 0;
    for (Index p = 0; p < parts_.size(); ++p) {
      const Part& part = parts_[p];
      if (!(part.extent > 0.0)) continue;
      crossings += part.crossings;
      turned += part.turned && part.holder == kNoIndex;
      if (part.touches && !part.inwards()) ++overlapping;
      if (part.inwards()) continue;
      if (part.holder == kNoIndex && reachesAgainst(p))
        warn("a part of " + millilitres(part.extent) +
             " is turned against a larger one that it reaches into, as a cavity is, but lies mostly outside of it: it "
             "is "
             "tissue");
      if (!bounds[p] && part.holder != kNoIndex && !part.touches) {
        ++swallowed;
        swallowed_volume += part.extent;
      }
    }
    if (turned > 0 && parts_.size() > 1)
      note(counted(turned, "part was", "parts were") + " inside-out and turned");
    else if (turned > 0)
      note("the surface was inside-out and has been turned");
    double all = 0.0;
    for (Index cell = 1; cell < solid_.size(); ++cell)
      if (solid_[cell]) all += space_.volumes[cell];
    if (overlapping > 1)
      note(std::to_string(overlapping) + " parts that overlap were united: volume " + millilitres(all));
    if (regions_ > 1)
      note(std::to_string(regions_) + " regions that share walls were united: volume " + millilitres(all));
    if (crossings > 0)
      note("the surface crossed itself, " + counted(crossings, "pair of triangles", "pairs of triangles") +
           " met: what it winds around was kept, volume " + millilitres(all));
    if (swallowed > 0)
      warn(counted(swallowed, "part inside of another is turned as it is, and became",
                   "parts inside of others are turned as they are, and became") +
           " tissue of " + (swallowed == 1 ? "it" : "them") + ": " + millilitres(swallowed_volume) +
           " (turned against it, it would be a cavity)");
    describeHoles();
    if (result_.doubled > 0)
      note("doubled " + counted(result_.doubled, "vertex", "vertices") +
           " where the surface touches itself: nothing hangs together there");
  }

  /// Into a larger part that is turned the other way in the file.
  bool reachesAgainst(Index p) const {
    for (const std::map<Index, int>& windings : windings_)
      if (windings.count(p) > 0)
        for (const auto& [other, winding] : windings)
          if (parts_[other].extent > parts_[p].extent && parts_[other].holder == kNoIndex &&
              parts_[other].turned != parts_[p].turned)
            return true;
    return false;
  }

  void describeOpen() {
    double all = 0.0, open = 0.0;
    UnionFind joined(walls_.size());
    const auto isOpen = [&](Index f) {
      return space_.cells[f][0] == space_.cells[f][1] ||
             std::all_of(walls_[f].begin(), walls_[f].end(), [](const Wall& wall) { return wall.open; });
    };
    for (const Arrangement::Edge& edge : space_.edges) {
      Index first = kNoIndex;
      for (const auto& spoke : edge.spokes) {
        if (!isOpen(spoke.facet)) continue;
        if (first != kNoIndex) joined.join(first, spoke.facet);
        first = spoke.facet;
      }
    }
    std::set<Index> pieces;
    for (Index f = 0; f < walls_.size(); ++f) {
      const double area = surfaceArea(space_.vertices, {space_.facets[f]});
      all += area;
      if (!isOpen(f)) continue;
      open += area;
      pieces.insert(joined.find(f));
    }
    result_.open_share = all > 0.0 ? open / all : 0.0;
    if (pieces.empty()) return;
    std::ostringstream text;
    text.precision(3);
    text << "dropped " << counted(pieces.size(), "open piece", "open pieces") << " with " << 100.0 * result_.open_share
         << " % of the area";
    note(text.str());
  }

  void describeHoles() {
    UnionFind empty(solid_.size());
    for (Index f = 0; f < walls_.size(); ++f)
      if (!solid_[space_.cells[f][0]] && !solid_[space_.cells[f][1]])
        empty.join(space_.cells[f][0], space_.cells[f][1]);
    for (Index p = 0; p < parts_.size(); ++p) {
      const Part& part = parts_[p];
      double outside = 0.0, filled = 0.0;
      bool open = false;
      for (Index cell = 1; cell < windings_.size(); ++cell) {
        const auto winding = windings_[cell].find(p);
        if (winding == windings_[cell].end()) continue;
        if (total_[cell] < 0 && (winding->second < 0) != part.turned) outside += space_.volumes[cell];
        if (solid_[cell]) filled += space_.volumes[cell];
        open = open || empty.find(cell) == Arrangement::kOutside;
      }
      if (!part.inwards()) {
        if (outside > 0.0) warn(shareOf(outside, part.extent) + " are wound around inside out, and were left out");
        continue;
      }
      const std::string hole = "a part of " + millilitres(part.extent) + " that is turned inwards is a hole, ";
      if (outside > 0.0)
        warn(hole + "and reaches through the surface: " + shareOf(outside, part.extent) +
             " lie outside; it is open there");
      else if (open && part.touches)
        warn(hole + "and touches the surface: it is open there");
      if (filled > 0.0) warn(hole + "but " + shareOf(filled, part.extent) + " lie in the tissue of other parts");
    }
  }

  Points points_;
  std::vector<Triangle> triangles_;
  std::vector<Side> places_;    // by merged vertices
  std::vector<Index> part_of_;  // of each triangle
  std::vector<Part> parts_;
  Arrangement space_;
  std::vector<std::vector<Wall>> walls_;        // of each facet
  std::vector<std::map<Index, int>> windings_;  // of each cell, by part, where not 0
  std::vector<int> total_;                      // of each cell
  std::vector<char> solid_;                     // of each cell
  std::size_t regions_ = 0;                     // that share walls
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
