// Which points of a collider are near the surface of another, or of the ground.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "contacts_impl.h"

namespace meshless {
namespace {

constexpr double kDeviation = 0.1;   // of the rest bounds' diagonal: how far a surface may be from its maps, at most
constexpr double kNeighbour = 3.0;   // times what a vertex is off by its own map: by the one beside it
constexpr double kSameMap = 2.0;     // likewise, between two vertices
constexpr double kLoose = 0.02;      // of the size: where a surface is farther from its maps, queries start at vertices
constexpr double kLooseEdges = 0.5;  // of its mean edge: likewise
constexpr std::size_t kFewVertices = 100;  // of a surface: there are few places to query, and they are soon known
constexpr double kCovering = 0.578;     // of the longest edge: a point of a triangle is as near to one of its corners
constexpr double kSlopeError = 0.5;     // of a map, at most
constexpr double kMovedInRest = 0.005;  // of the size: a query is repeated where the deviation moved it farther
constexpr std::size_t kQueryAnew = 8;   // frames after which a point is queried though it seems to be where it was
constexpr Index kMostTriangles = 4;     // that a point has slid across since the frame before
constexpr double kWellWithin = 0.02;    // barycentric
constexpr double kOnSurface = 0.05;     // of a triangle's extent
constexpr double kFarBeside = 4.0;      // likewise
constexpr double kNearby = 0.1;         // of the thickness
constexpr int kMostQueries = 8;
constexpr double kSamePlace = 1e-6;  // of the size
constexpr double kFlattest = 1e-3;   // det of a slope: below, the cluster's affine map tells directions
constexpr double kSlack = 0.1;       // of the thickness: how much farther a better face may be

}  // namespace

namespace {

// How far a surface is from where its maps have it, within a region.
void measureDeviation(const ShapeCollider& collider, const MapFinder& finder, const ContactMap* maps, const Box& region,
                      SurfaceNow& surface) {
  surface.finder.clear();
  surface.vertices.clear();
  bool bent = false;
  const ContactShape& shape = *collider.shape;
  const double most = kDeviation * shape.bounds().diagonal();
  const Box near = grown(region, most);
  double farthest = 0.0;
  for (const ContactSample& s : shape.samples()) {
    if (s.share > 0.0) continue;
    const Vec3& now = vertexAt(collider, s.vertices[0]);
    if (!near.contains(now)) continue;
    const ContactMap& map = maps[finder.nearest(now)];
    const Vec3& at_rest = shape.surface().vertices[s.vertices[0]];
    const Vec3 fitted =
        map.quadratic ? map.quadratic->at(at_rest) : Vec3(map.from_rest * (at_rest - map.rest) + map.centre);
    farthest = std::max(farthest, (now - fitted).squaredNorm());
    bent = bent || map.quadratic;
  }
  surface.deviation = std::min(most, (collider.map_count > 1 ? kNeighbour : kSameMap) * std::sqrt(farthest));
  surface.loose = !bent && shape.surface().vertices.size() > kFewVertices &&
                  surface.deviation > std::max(kLoose * shape.size(), kLooseEdges * shape.meanEdge());
  if (!surface.loose) return;
  for (Index v = 0; v < shape.surface().vertices.size(); ++v) {
    const Vec3& now = vertexAt(collider, v);
    if (!near.contains(now)) continue;
    surface.finder.add(now);
    surface.vertices.push_back(v);
  }
  surface.finder.build();
  surface.loose = !surface.vertices.empty();
  surface.around = most;
  double longest = 0.0;
  for (const Triangle& t : shape.surface().triangles)
    for (int k = 0; k < 3; ++k)
      longest = std::max(longest, (vertexAt(collider, t[k]) - vertexAt(collider, t[(k + 1) % 3])).squaredNorm());
  surface.gap = kCovering * std::sqrt(longest);
}

}  // namespace

namespace {

// A point that is well within a triangle, seen from above it, and near: which no search has to confirm. With
// `beyond` it may be over an edge as well across which the surface goes on as it is, or nearly so and the point lies on
// it, and up to a ridge from above; where it has gone across such an edge, that is the triangle behind it.
bool isOver(const ShapeCollider& collider, Index triangle, const Vec3& p, bool flipped, Index* beyond,
            ContactShape::Nearest& found) {
  const ContactShape& shape = *collider.shape;
  const Triangle& corners = shape.surface().triangles[triangle];
  const Vec3 q0 = vertexAt(collider, corners[0]);
  const Vec3 e1 = vertexAt(collider, corners[1]) - q0, e2 = vertexAt(collider, corners[2]) - q0, d = p - q0;
  const Vec3 area = e1.cross(e2);
  const double squared = area.squaredNorm();
  const double v = d.cross(e2).dot(area) / squared, w = e1.cross(d).dot(area) / squared;
  const double height = (flipped ? -1.0 : 1.0) * area.dot(d) / std::sqrt(squared);
  if (!(std::abs(height) < kNearby * shape.thickness())) return false;
  const std::array<double, 3> weights{1.0 - v - w, v, w};
  const bool on_it = height * height < kOnSurface * kOnSurface * std::sqrt(squared);
  int across = -1;  // the edge that it is farthest beyond
  for (int k = 0; k < 3; ++k) {
    if (weights[k] > kWellWithin) continue;
    if (!beyond) return false;
    using Bend = ContactShape::Bend;
    const Bend bend = shape.bend(triangle, k);
    const bool goes_on = bend == Bend::kFlat || (bend == Bend::kGentle && on_it);
    if (!goes_on && !(bend == Bend::kRidge && weights[k] >= 0.0 && height >= 0.0)) return false;
    if (!(weights[k] > -kWellWithin) && (across < 0 || weights[k] < weights[across])) across = k;
  }
  if (across >= 0) {
    *beyond = shape.across(triangle, across);
    return false;
  }
  found.triangle = triangle;
  found.weights = weights;
  found.distance = height;
  found.above = true;
  return true;
}

// Where a point is at rest by the triangle that is nearest to it: beside or above it as it is now.
Vec3 seenFrom(const ShapeCollider& collider, const ContactShape::Nearest& nearest, const Vec3& p, const Mat3& to_rest) {
  const TriangleMesh& surface = collider.shape->surface();
  const Triangle& corners = surface.triangles[nearest.triangle];
  const Vec3 q0 = vertexAt(collider, corners[0]);
  const Vec3 e1 = vertexAt(collider, corners[1]) - q0, e2 = vertexAt(collider, corners[2]) - q0, d = p - q0;
  const Vec3 area = e1.cross(e2);
  const double squared = area.squaredNorm();
  double v = d.cross(e2).dot(area) / squared, w = e1.cross(d).dot(area) / squared;
  // From far beside it, or where it is all but a line, the map tells more: from the nearest point.
  if (!(std::max({std::abs(v), std::abs(w), std::abs(1.0 - v - w)}) < kFarBeside)) {
    v = nearest.weights[1];
    w = nearest.weights[2];
  }
  const Vec3 &r0 = surface.vertices[corners[0]], &r1 = surface.vertices[corners[1]], &r2 = surface.vertices[corners[2]];
  return r0 + v * (r1 - r0) + w * (r2 - r0) + to_rest * (d - v * e1 - w * e2);
}

}  // namespace

bool Contacts::Impl::locate(const ShapeCollider& b, const SurfaceNow& surface, const MapFinder& finder,
                            const ContactMap* maps, const Vec3& p, const std::function<Vec3()>& inwardAt, double reach,
                            Index& hint, ContactShape::Nearest& found, bool& flipped, ContactCounters& counters) const {
  const ContactMap& map = maps[finder.nearest(p)];
  flipped = map.flipped;
  const ContactShape& shape = *b.shape;
  Vec3 rest = map.to_rest * (p - map.centre) + map.rest;
  const Mat3* to_rest = &map.to_rest;
  Mat3 bent;
  if (map.quadratic && map.quadratic->invert(p, shape.bounds().diagonal(), rest, bent)) {
    to_rest = &bent;
    flipped = bent.determinant() < 0.0;
  }
  double deviation = surface.deviation;
  if (surface.loose) {
    // From the nearest vertex, whose place at rest is known.
    Index v = kNoIndex;
    Vec3 from, from_vertex;
    const auto startAtVertex = [&](double limit) {
      v = surface.vertices[surface.finder.nearest(p, limit)];
      from = p - vertexAt(b, v);
      from_vertex = map.to_rest * from + shape.surface().vertices[v];
    };
    const double touching = reach + surface.gap;
    startAtVertex(touching);
    if (from.norm() > touching && surface.around > touching) {
      if (shape.isOutside(from_vertex)) return false;
      startAtVertex(std::numeric_limits<double>::infinity());
    }
    if (kSlopeError * from.norm() < deviation) {
      rest = from_vertex;
      deviation = kSlopeError * from.norm();
    }
  }
  // So far outside of the rest bounds that no deviation brings it back: no query is needed.
  const Box& bounds = shape.bounds();
  const Vec3 beyond = (bounds.min - rest).cwiseMax(rest - bounds.max).cwiseMax(0.0);
  const double far = deviation + reach;
  if (!(beyond.squaredNorm() < far * far)) return false;
  const bool near = hint != kNoIndex && shape.distanceTo(hint, rest) <= far;
  if (!near && shape.isClear(rest, far)) return false;
  const Vec3 inward_rest = (*to_rest * inwardAt()).normalized();
  const double enough = kMovedInRest * shape.size();
  // In torn bodies a point often goes round the same few places: then what the last query would find is known.
  std::array<Vec3, kMostQueries> places;
  std::array<ContactShape::Nearest, kMostQueries> founds;
  const double same = kSamePlace * shape.size();
  for (int n = 0; n < kMostQueries; ++n) {
    for (int q = n - 2; q >= 0; --q)
      if ((rest - places[q]).squaredNorm() < same * same) {
        found = founds[q + (kMostQueries - 1 - q) % (n - q)];
        hint = found.triangle;
        return std::isfinite(found.distance);
      }
    places[n] = rest;
    ++counters.queries;
    if (!shape.nearest(rest, inward_rest, kSlack * shape.thickness(), far, found, hint)) return false;
    founds[n] = found;
    hint = found.triangle;
    if (n + 1 == kMostQueries) break;
    if (found.distance > far) return false;
    if (isOver(b, found.triangle, p, flipped, nullptr, found)) break;
    // The surface does not lie where the affine map has it: the next query is that much elsewhere.
    const Vec3 there = seenFrom(b, found, p, *to_rest);
    if ((there - rest).squaredNorm() < enough * enough) break;
    rest = there;
  }
  return std::isfinite(found.distance);
}

void Contacts::Impl::addContact(Findings& to, const std::vector<ShapeCollider>& colliders, Index a, Index number,
                                const ContactSample& s, Index b, Index triangle, const std::array<double, 3>& weights,
                                bool was_caught, bool flipped) {
  const ShapeCollider& of = colliders[a];
  Contact c;
  c.a = a;
  c.b = b;
  c.sample = number;
  c.triangle = triangle;
  c.weights = weights;
  c.caught = was_caught;
  c.flipped = flipped;
  const std::vector<Index>& particle = *of.shape->rows().particle;
  c.point = {particle[s.vertices[0]], particle[s.vertices[1]]};
  c.share = s.share;
  c.direct = c.point[0] != kNoIndex && c.point[1] != kNoIndex;
  if (b != kNoIndex) {
    const ContactShape& shape = *colliders[b].shape;
    for (int k = 0; k < 3; ++k) {
      c.corners[k] = (*shape.rows().particle)[shape.surface().triangles[triangle][k]];
      c.direct = c.direct && c.corners[k] != kNoIndex;
    }
  }
  if (!c.direct) {
    c.first = static_cast<Index>(to.entries.size());
    c.offset = addRow(of, s.vertices[0], 1.0 - s.share, to.entries);
    if (s.share > 0.0) {
      c.offset += addRow(of, s.vertices[1], s.share, to.entries);
      tidy(to.entries, c.first);
    }
    c.split = static_cast<Index>(to.entries.size());
    if (b != kNoIndex) {
      const ShapeCollider& with = colliders[b];
      const Triangle& corners = with.shape->surface().triangles[triangle];
      Vec3 x[3];
      for (int k = 0; k < 3; ++k) {
        c.offset -= addRow(with, corners[k], weights[k], to.entries);
        x[k] = vertexAt(with, corners[k]);
      }
      tidy(to.entries, c.split);
      const Vec3 area = (x[1] - x[0]).cross(x[2] - x[0]);
      const double length = area.norm();
      if (!(length > 0.0)) {
        to.entries.resize(c.first);
        return;
      }
      c.normal = area / (flipped ? -length : length);
    }
    c.end = static_cast<Index>(to.entries.size());
  }
  to.contacts.push_back(c);
}

// Where what is known of a pair begins; second: of its points of b in a.
std::size_t Contacts::Impl::firstKnown(const std::vector<Contact>& known, std::size_t end, const Pair& pair,
                                       bool second) const {
  const auto start = std::make_tuple(true, pair.a, pair.b, second, Index{0});
  return static_cast<std::size_t>(std::partition_point(known.begin(), known.begin() + static_cast<std::ptrdiff_t>(end),
                                                       [&](const Contact& c) { return keyOf(c) < start; }) -
                                  known.begin());
}

void Contacts::Impl::startAt(Findings& to, const std::vector<Contact>& known, std::size_t end, const Pair& pair,
                             bool second) const {
  to.known = &known;
  to.known_end = end;
  to.cursor = firstKnown(known, end, pair, second);
}

// A point that was over a triangle, and still is over it or over one beside it, and near, need not be queried. Now and
// then it is. `hint` is the triangle in any case.
bool Contacts::Impl::stillOver(Findings& to, const ShapeCollider& with, Index a, Index b, Index sample, const Vec3& p,
                               Index& hint, ContactShape::Nearest& found, bool& flipped) const {
  const auto mine = std::make_tuple(true, std::min(a, b), std::max(a, b), a > b, sample);
  if (!to.known) return false;
  const std::vector<Contact>& known = *to.known;
  while (to.cursor < to.known_end && keyOf(known[to.cursor]) < mine) ++to.cursor;
  if (to.cursor >= to.known_end) return false;
  const Contact& before = known[to.cursor];
  if (keyOf(before) != mine || before.caught) return false;
  hint = before.triangle;
  if ((frames + sample) % kQueryAnew == 0) return false;
  flipped = before.flipped;
  for (Index triangle = before.triangle, n = 0; triangle != kNoIndex && n < kMostTriangles; ++n) {
    hint = triangle;
    triangle = kNoIndex;
    if (isOver(with, hint, p, flipped, &triangle, found)) return true;
  }
  return false;
}

// The points of one collider of a pair in the shape of the other, whose maps these are.
void Contacts::Impl::queryPart(Findings& to, const std::vector<ShapeCollider>& colliders, const Pair& pair,
                               const ContactMap* maps, bool every_point, QueryPart& part) {
  const Index a = part.second ? pair.b : pair.a, b = part.second ? pair.a : pair.b;
  const ShapeCollider &of = colliders[a], &with = colliders[b];
  Inside& inside = part.inside;
  const ContactShape& shape = *with.shape;
  if (shape.surface().triangles.empty() || with.map_count == 0) return;
  const bool now = maps != with.maps;  // they have moved since the frame began
  const Box region =
      grown(now ? intersection(bounds_now[a], bounds_now[b]) : intersection(of.bounds, with.bounds), pair.reach);
  const double size = shape.size(), near = kMargin * std::min(size, of.shape->size());
  const std::vector<ContactSample>& samples = of.shape->samples();
  inside.points = part.end - part.first;
  if (region.empty()) return;  // near by their speeds alone
  const ContactMap* own = now ? maps_now[a].data() : of.maps;
  const auto inwardAt = [&](const Vec3& p, const ContactSample& sample) -> Vec3 {
    const ContactMap& map = own[finders[a].nearest(p)];
    if (!map.quadratic) return -(map.to_rest.transpose() * sample.normal).normalized();
    const Mat3 slope = map.quadratic->slope(of.shape->surface().vertices[sample.vertices[0]]);
    const double det = slope.determinant();
    if (!(std::abs(det) > kFlattest)) return -(map.to_rest.transpose() * sample.normal).normalized();
    return -(slope.inverse().transpose() * sample.normal).normalized();
  };
  to.surface.deviation = -1.0;
  Index hint = kNoIndex;  // the triangle that was found last: the next point is often near it
  for (Index s = part.first; s < part.end; ++s) {
    const Vec3 p = sampleAt(of, samples[s]);
    if (!region.contains(p)) continue;
    if (!caught.empty()) {
      const auto held = caught.find({of.key, with.key, s});
      if (held != caught.end()) continue;  // see trace()
    }
    ++inside.asked;
    ContactShape::Nearest found;
    bool flipped = false;
    if (!stillOver(to, with, a, b, s, p, hint, found, flipped)) {
      if (to.surface.deviation < 0.0) measureDeviation(with, finders[b], maps, region, to.surface);
      const auto inward = [&] { return inwardAt(p, samples[s]); };
      if (!locate(with, to.surface, finders[b], maps, p, std::cref(inward), pair.reach, hint, found, flipped,
                  to.counters))
        continue;
    }
    if (found.distance < 0.0) {
      ++inside.inside;
      inside.deepest = std::min(inside.deepest, found.distance);
    }
    if (found.distance < near) ++inside.near;
    if (found.distance > pair.reach || (found.distance > near && !found.above && !every_point)) continue;
    const std::size_t before = to.contacts.size();
    addContact(to, colliders, a, s, samples[s], b, found.triangle, found.weights, false, flipped);
    if (to.contacts.size() > before) to.contacts.back().below = found.distance < 0.0;
    if (found.distance < 0.0) to.depths.push_back(-found.distance / std::min(size, of.shape->size()));
  }
}

void Contacts::Impl::addGround(Findings& to, const std::vector<ShapeCollider>& colliders, Index a, double reach) {
  const ShapeCollider& collider = colliders[a];
  const std::vector<ContactSample>& samples = collider.shape->samples();
  const double below = *scene.ground + reach;
  for (Index s = 0; s < samples.size(); ++s) {
    if (samples[s].share > 0.0) continue;  // between two vertices above a plane nothing is below it
    const double z = vertexAt(collider, samples[s].vertices[0]).z();
    if (!(z < below)) continue;
    addContact(to, colliders, a, s, samples[s], kNoIndex, kNoIndex, {}, false, false);
    to.contacts.back().below = z < *scene.ground;
    if (z < *scene.ground) to.depths.push_back((*scene.ground - z) / collider.shape->size());
  }
}

void Contacts::Impl::join(const Findings& from, std::size_t contacts_from, std::size_t contacts_to,
                          std::size_t entries_from, std::size_t entries_to) {
  append(contacts, entries, from, contacts_from, contacts_to, entries_from, entries_to);
}

void append(std::vector<Contact>& contacts, std::vector<ContactEntry>& entries, const Findings& from,
            std::size_t contacts_from, std::size_t contacts_to, std::size_t entries_from, std::size_t entries_to) {
  const Index moved = static_cast<Index>(entries.size()) - static_cast<Index>(entries_from);  // modulo 2^32
  entries.insert(entries.end(), from.entries.begin() + static_cast<std::ptrdiff_t>(entries_from),
                 from.entries.begin() + static_cast<std::ptrdiff_t>(entries_to));
  const std::size_t first = contacts.size();
  contacts.insert(contacts.end(), from.contacts.begin() + static_cast<std::ptrdiff_t>(contacts_from),
                  from.contacts.begin() + static_cast<std::ptrdiff_t>(contacts_to));
  if (entries_to > entries_from)
    for (std::size_t k = first; k < contacts.size(); ++k)
      if (!contacts[k].direct) {
        contacts[k].first += moved;
        contacts[k].split += moved;
        contacts[k].end += moved;
      }
}

}  // namespace meshless
