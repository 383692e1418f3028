// Points that have passed through a surface within a substep. They stay known until they are back outside.
#include <algorithm>
#include <map>
#include <set>

#include "cell_table.h"
#include "contacts_impl.h"

namespace meshless {
namespace {

constexpr double kBesidePath = 1e-6;  // barycentric: no path slips between two triangles
constexpr double kSlowPath =
    0.25;  // of the thickness: a point that meets a face no faster than that in a substep is found by a query
constexpr double kShallow = 0.1;          // of the smaller thickness: likewise, and from inside
constexpr double kSameSide = 0.5;         // cosine between the normals of faces that face the same way
constexpr std::size_t kFewWays = 8;       // are compared with all faces
constexpr std::int64_t kMostCells = 512;  // of a face
constexpr int kMostSlides = 8;            // triangles that a caught point goes on in a substep

Vec3 normalNow(const ShapeCollider& collider, Index triangle) {
  const Triangle& corners = collider.shape->surface().triangles[triangle];
  const Vec3 q0 = vertexAt(collider, corners[0]);
  return (vertexAt(collider, corners[1]) - q0).cross(vertexAt(collider, corners[2]) - q0).normalized();
}

}  // namespace

void SweptCollider::make(const ShapeCollider& collider, Index count) {
  const std::vector<ContactSample>& all = collider.shape->samples();
  samples.resize(count);
  box = Box();
  for (Index s = 0; s < count; ++s) {
    const Vec3 p = sampleAt(collider, all[s]);
    Vec3 motion = vertexMotion(collider, all[s].vertices[0]);
    if (all[s].share > 0.0) motion += all[s].share * (vertexMotion(collider, all[s].vertices[1]) - motion);
    samples[s] = {p - motion, p};
    if (!p.allFinite() || !motion.allFinite()) continue;
    box.extend(p);
    box.extend(p - motion);
  }
  const TriangleMesh& surface = collider.shape->surface();
  corners.resize(surface.vertices.size());
  for (Index v = 0; v < corners.size(); ++v) {
    const Vec3 q = vertexAt(collider, v);
    corners[v] = {q - vertexMotion(collider, v), q};
  }
  triangles.assign(surface.triangles.size(), Box());
  for (Index t = 0; t < surface.triangles.size(); ++t)
    for (Index v : surface.triangles[t]) {
      triangles[t].extend(corners[v].from);
      triangles[t].extend(corners[v].to);
    }
}

// Finds the points of a that a triangle of b has swept over in this substep, coming from its front.
void Contacts::Impl::trace(const std::vector<ShapeCollider>& colliders, const Pair& pair, bool second,
                           const std::vector<Contact>* found, Traced& traced) const {
  const Index a = second ? pair.b : pair.a, b = second ? pair.a : pair.b;
  traced.paths = 0;
  traced.caught.clear();
  const ShapeCollider &of = colliders[a], &with = colliders[b];
  const ContactShape& shape = *with.shape;
  const std::vector<Triangle>& triangles = shape.surface().triangles;
  if (triangles.empty()) return;
  const Index count = static_cast<Index>(swept[a].samples.size());
  const std::vector<Path>&paths = swept[a].samples, &corners = swept[b].corners;
  const Box& box_a = swept[a].box;
  Box box_b;
  // A slower point is found by the next query.
  const double slow = kSlowPath * shape.thickness() / query_gap;
  const double shallow = kShallow * std::min(of.shape->thickness(), shape.thickness());
  // What lay on a face may have been a hair below; what had no contact there is outside on the other side of a fin.
  const auto lay = [&](Index sample, Index triangle) {
    const auto key = std::make_tuple(true, std::min(a, b), std::max(a, b), a > b, sample);
    for (const std::vector<Contact>* known : {&fast_known, found}) {
      if (!known) continue;
      const auto at =
          std::partition_point(known->begin(), known->end(), [&](const Contact& c) { return keyOf(c) < key; });
      if (at != known->end() && keyOf(*at) == key && !at->flipped && at->triangle < triangles.size() &&
          normalNow(with, at->triangle).dot(normalNow(with, triangle)) > kSameSide)
        return true;
    }
    return false;
  };
  struct Near {
    Index triangle;
    Box box;
    Vec3 normal_from, normal_to;
  };
  struct Way {
    Index sample;
    Box box;
  };
  // Of two bodies that are large and meet in few places, few triangles are near to few ways.
  static thread_local std::vector<Near> own_near;
  static thread_local std::vector<Way> own_ways;
  std::vector<Near>& near = own_near;
  std::vector<Way>& ways = own_ways;
  near.clear();
  ways.clear();
  for (Index t = 0; t < triangles.size(); ++t) {
    const Box box = grown(swept[b].triangles[t], shallow);
    if (!box.overlaps(box_a)) continue;
    near.push_back({t, box, Vec3::Zero(), Vec3::Zero()});
    box_b.extend(box.min);
    box_b.extend(box.max);
  }
  if (near.empty()) return;
  Box region;
  for (Index s = 0; s < count; ++s) {
    Box box;
    box.extend(paths[s].from);
    box.extend(paths[s].to);
    if (!box.overlaps(box_b) || caught.count({of.key, with.key, s})) continue;
    ways.push_back({s, box});
    region.extend(box.min);
    region.extend(box.max);
  }
  if (ways.empty()) return;
  double size = 0.0;
  near.erase(std::remove_if(near.begin(), near.end(), [&](const Near& n) { return !n.box.overlaps(region); }),
             near.end());
  for (Near& n : near) {
    const Triangle& t = triangles[n.triangle];
    const Path &p0 = corners[t[0]], &p1 = corners[t[1]], &p2 = corners[t[2]];
    n.normal_from = (p1.from - p0.from).cross(p2.from - p0.from).normalized();
    n.normal_to = (p1.to - p0.to).cross(p2.to - p0.to).normalized();
    size += (n.box.max - n.box.min).maxCoeff();
  }
  traced.paths = ways.size();
  if (near.empty() || !(size > 0.0)) return;
  region = intersection(region, box_b);
  static thread_local CellTable own_table;
  CellTable& table = own_table;  // each access of the other asks whose thread it is
  const bool by_cells = ways.size() > kFewWays;
  if (by_cells) {
    table.start(region, size / static_cast<double>(near.size()), 4 * near.size());
    // Torn triangles among small ones would be in millions of cells.
    for (Index k = 0; k < near.size(); ++k) table.insert(near[k].box, k, kMostCells);
  }
  for (const Way& way : ways) {
    const Path& path = paths[way.sample];
    double first = 2.0;
    Index hit = kNoIndex;
    const auto meet = [&](Index k) {
      if (!near[k].box.overlaps(way.box)) return;
      const Index t = near[k].triangle;
      const Path &p0 = corners[triangles[t][0]], &p1 = corners[triangles[t][1]], &p2 = corners[triangles[t][2]];
      const double d0 = near[k].normal_from.dot(path.from - p0.from), d1 = near[k].normal_to.dot(path.to - p0.to);
      if (!(d1 < 0.0) || !(d0 >= -shallow) || !(d0 - d1 > slow) || (d0 < 0.0 && !lay(way.sample, t))) return;
      const double time = std::max(0.0, d0 / (d0 - d1));
      if (!(time < first) && !(time == first && t < hit)) return;
      const auto then = [time](const Path& q) -> Vec3 { return q.from + time * (q.to - q.from); };
      const Vec3 q = then(p0), e1 = then(p1) - q, e2 = then(p2) - q, d = then(path) - q;
      const Vec3 area = e1.cross(e2);
      const double squared = area.squaredNorm();
      const double v = d.cross(e2).dot(area) / squared, w = e1.cross(d).dot(area) / squared;
      if (!(v >= -kBesidePath) || !(w >= -kBesidePath) || !(v + w <= 1.0 + kBesidePath)) return;
      first = time;
      hit = t;
    };
    const CellRange range = by_cells ? table.cellsOf(way.box) : CellRange{};
    if (by_cells && range.count() < static_cast<std::int64_t>(near.size())) {
      table.forEach(range, meet);
    } else {
      for (Index k = 0; k < near.size(); ++k) meet(k);
    }
    if (hit == kNoIndex) continue;
    traced.caught.emplace_back(CaughtKey{of.key, with.key, way.sample}, hit);
  }
}

// Where a pair is slow and all its caught points lie just below their triangles, they are forgotten: queries find them
// like any other.
void Contacts::Impl::releaseShallow(const std::vector<ShapeCollider>& colliders) {
  if (caught.empty()) return;
  std::map<std::uint64_t, Index> by_key;
  for (Index p = 0; p < colliders.size(); ++p) by_key[colliders[p].key] = p;
  std::set<PairKey> kept;
  const auto pairOf = [](const CaughtKey& key) { return std::minmax({key.a, key.b}); };
  for (const auto& [key, triangle] : caught) {
    const auto a = by_key.find(key.a), b = by_key.find(key.b);
    if (a == by_key.end() || b == by_key.end() || !isShallow(colliders, a->second, b->second, key.sample, triangle))
      kept.insert(pairOf(key));
  }
  for (auto it = caught.begin(); it != caught.end();)
    it = kept.count(pairOf(it->first)) ? std::next(it) : caught.erase(it);
}

bool Contacts::Impl::isShallow(const std::vector<ShapeCollider>& colliders, Index a, Index b, Index sample,
                               Index triangle) const {
  const auto key = std::make_pair(std::min(a, b), std::max(a, b));
  const auto pair =
      std::lower_bound(pairs.begin(), pairs.end(), key, [](const Pair& p, const std::pair<Index, Index>& of) {
        return std::tie(p.a, p.b) < std::tie(of.first, of.second);
      });
  if (pair == pairs.end() || std::make_pair(pair->a, pair->b) != key || pair->fast) return false;
  const ShapeCollider &of = colliders[a], &with = colliders[b];
  if (sample >= of.shape->samples().size() || triangle >= with.shape->surface().triangles.size()) return false;
  const Triangle& corners = with.shape->surface().triangles[triangle];
  const Vec3 q0 = vertexAt(with, corners[0]);
  const Vec3 area = (vertexAt(with, corners[1]) - q0).cross(vertexAt(with, corners[2]) - q0);
  const double depth = -area.normalized().dot(sampleAt(of, of.shape->samples()[sample]) - q0);
  return depth < kShallow * std::min(of.shape->thickness(), with.shape->thickness());
}

// Adds contacts of the points that have passed through, each with the triangle that it slid to, until it is outside.
void Contacts::Impl::addCaught(const std::vector<ShapeCollider>& colliders) {
  Findings found;
  std::map<std::uint64_t, Index> by_key;
  for (Index p = 0; p < colliders.size(); ++p) by_key[colliders[p].key] = p;
  for (auto it = caught.begin(); it != caught.end();) {
    const auto a = by_key.find(it->first.a), b = by_key.find(it->first.b);
    bool over = a == by_key.end() || b == by_key.end();
    over = over || !colliders[a->second].shape || !colliders[b->second].shape ||
           it->first.sample >= colliders[a->second].shape->samples().size() ||
           it->second >= colliders[b->second].shape->surface().triangles.size();
    if (!over) {
      const ShapeCollider &of = colliders[a->second], &with = colliders[b->second];
      const ContactShape& shape = *with.shape;
      const Vec3 p = sampleAt(of, of.shape->samples()[it->first.sample]);
      std::array<double, 3> weights{};
      for (int step = 0;; ++step) {
        const Triangle& corners = shape.surface().triangles[it->second];
        const Vec3 q0 = vertexAt(with, corners[0]);
        const Vec3 e1 = vertexAt(with, corners[1]) - q0, e2 = vertexAt(with, corners[2]) - q0, d = p - q0;
        const Vec3 area = e1.cross(e2);
        const double squared = area.squaredNorm();
        const double v = d.cross(e2).dot(area) / squared, w = e1.cross(d).dot(area) / squared;
        weights = {1.0 - v - w, v, w};
        over = !(area.dot(d) < 0.0);
        const int corner = static_cast<int>(std::min_element(weights.begin(), weights.end()) - weights.begin());
        if (over || weights[corner] >= 0.0 || step == kMostSlides) break;
        const Index next = shape.across(it->second, corner);
        // Not round an edge: there the next triangle faces another way, and the point is in front of it.
        if (next == kNoIndex) break;
        const Triangle& turned = shape.surface().triangles[next];
        const Vec3 r0 = vertexAt(with, turned[0]);
        const Vec3 other = (vertexAt(with, turned[1]) - r0).cross(vertexAt(with, turned[2]) - r0);
        if (!(other.dot(area) > 0.0) || !(other.dot(p - r0) < 0.0)) break;
        it->second = next;
      }
      if (!over)
        addContact(found, colliders, a->second, it->first.sample, of.shape->samples()[it->first.sample], b->second,
                   it->second, weights, true, false);
    }
    it = over ? caught.erase(it) : std::next(it);
  }
  join(found, 0, found.contacts.size(), 0, found.entries.size());
}

}  // namespace meshless
