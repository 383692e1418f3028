#include "meshless_surgery/contact/contacts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "cell_table.h"
#include "contact_set.h"

namespace meshless {
namespace {

constexpr double kMargin = 1e-3;        // of the smaller body's size: contacts are kept while so near
constexpr double kQuick = 0.25;         // of the thickness: who goes farther is looked up in every substep, or traced
constexpr double kMovedInRest = 0.005;  // of the size: a lookup is repeated where the deviation moved it farther
constexpr std::size_t kTaskPairs = 32, kTaskParties = 128;  // looked at by one task
constexpr std::size_t kLookAnew = 8;    // frames after which a point is looked up though it seems to be where it was
constexpr double kWellWithin = 0.02;    // barycentric
constexpr double kNearby = 0.1;         // of the thickness
constexpr int kMostLookups = 3;
constexpr Index kManyPartners = 4;      // from here on it pays to know how far a surface is from its map
constexpr double kDeviation = 0.1;      // of the bounds' diagonal: how far a surface may be from where its maps have it
constexpr Index kFewMaps = 8;           // so many are searched one by one
constexpr double kExitTime = 1.0;       // [s] in which one body is let out of another
constexpr double kExitDeep = 0.05;      // of the size: how deep the deepest point is at the least
constexpr double kBesidePath = 1e-6;    // barycentric: no path slips between two triangles
constexpr double kLongestStep = 0.5;    // of the smaller body's extent: how far quick bodies go in a substep
constexpr int kCaughtPasses = 24;       // of an island in which something was caught: it has to stop at once
constexpr int kMostSlides = 8;          // triangles that a caught point goes on in a substep
constexpr double kSameShare = 0.8;      // of points inside each other, both ways: bodies at the same place

struct Pair {
  Index a, b;
  double reach;  // [m] how far outside a point is taken as a contact to come
  bool quick;    // looked up anew in every substep
  double way;   // [m/s] at which its bodies move, at most
};

/// The cluster whose centre is nearest: a grid over the centres.
class MapFinder {
 public:
  void make(const ContactMap* maps, Index count) {
    maps_ = maps;
    count_ = count;
    if (count <= kFewMaps) return;
    Box box;
    for (Index m = 0; m < count; ++m)
      if (maps[m].centre.allFinite()) box.extend(maps[m].centre);
    if (box.empty()) {
      count_ = std::min<Index>(count, 1);
      return;
    }
    const Vec3 extent = (box.max - box.min).cwiseMax(1e-9 * box.diagonal());
    edge_ = std::max(std::cbrt(extent.prod() / count), extent.maxCoeff() / 256.0);
    if (!(edge_ > 0.0)) edge_ = 1.0;
    origin_ = box.min;
    std::size_t total = 1;
    for (int d = 0; d < 3; ++d) {
      cells_[d] = std::min(256, static_cast<int>(extent[d] / edge_) + 1);
      total *= static_cast<std::size_t>(cells_[d]);
    }
    offsets_.assign(total + 1, 0);
    items_.resize(count);
    for (Index m = 0; m < count; ++m) ++offsets_[cellOf(maps[m].centre) + 1];
    for (std::size_t i = 0; i < total; ++i) offsets_[i + 1] += offsets_[i];
    next_.assign(offsets_.begin(), offsets_.end() - 1);
    for (Index m = 0; m < count; ++m) items_[next_[cellOf(maps[m].centre)]++] = m;
  }

  Index nearest(const Vec3& p) const {
    if (count_ <= 1) return 0;
    Index best = 0;
    double least = std::numeric_limits<double>::infinity();
    const auto look = [&](Index m) {
      const double squared = (maps_[m].centre - p).squaredNorm();
      if (squared < least || (squared == least && m < best)) {
        least = squared;
        best = m;
      }
    };
    if (count_ <= kFewMaps) {
      for (Index m = 0; m < count_; ++m) look(m);
      return best;
    }
    std::array<int, 3> at;
    for (int d = 0; d < 3; ++d) at[d] = clampCell(p[d], d);
    const int most = std::max({cells_[0], cells_[1], cells_[2]});
    for (int ring = 0; ring <= most; ++ring) {
      // What lies beyond the rings looked at is farther than their inner radius.
      if (ring > 0) {
        const double inner = (ring - 1) * edge_;
        if (least < std::numeric_limits<double>::infinity() && inner * inner > least) break;
      }
      for (int x = std::max(0, at[0] - ring); x <= std::min(cells_[0] - 1, at[0] + ring); ++x)
        for (int y = std::max(0, at[1] - ring); y <= std::min(cells_[1] - 1, at[1] + ring); ++y)
          for (int z = std::max(0, at[2] - ring); z <= std::min(cells_[2] - 1, at[2] + ring); ++z) {
            if (std::max({std::abs(x - at[0]), std::abs(y - at[1]), std::abs(z - at[2])}) != ring) continue;
            const std::size_t cell = (static_cast<std::size_t>(x) * cells_[1] + y) * cells_[2] + z;
            for (Index k = offsets_[cell]; k < offsets_[cell + 1]; ++k) look(items_[k]);
          }
    }
    return best;
  }

 private:
  int clampCell(double v, int d) const {
    const double c = (v - origin_[d]) / edge_;
    return c > 0.0 ? (c < cells_[d] ? static_cast<int>(c) : cells_[d] - 1) : 0;
  }
  std::size_t cellOf(const Vec3& p) const {
    return (static_cast<std::size_t>(clampCell(p.x(), 0)) * cells_[1] + clampCell(p.y(), 1)) * cells_[2] +
           clampCell(p.z(), 2);
  }

  const ContactMap* maps_ = nullptr;
  Index count_ = 0;
  double edge_ = 1.0;
  Vec3 origin_ = Vec3::Zero();
  std::array<int, 3> cells_{{1, 1, 1}};
  std::vector<Index> offsets_, items_, next_;
};

double speedOf(const ContactParty& party) { return party.velocity.norm() + party.spread; }

/// [m/s] at which two parties can come nearer, at most.
double approachOf(const ContactParty& a, const ContactParty& b) {
  Vec3 relative = Vec3::Zero();
  double spread = 0.0;
  if (a.moves) {
    relative += a.velocity;
    spread += a.spread;
  }
  if (b.moves) {
    relative -= b.velocity;
    spread += b.spread;
  }
  return relative.norm() + spread;
}

Vec3 vertexAt(const ContactParty& party, Index vertex) {
  return party.surface ? party.surface[vertex] : party.positions[(*party.shape->rows().particle)[vertex]];
}

Vec3 sampleAt(const ContactParty& party, const ContactSample& sample) {
  const Vec3 p = vertexAt(party, sample.vertices[0]);
  return sample.share > 0.0 ? Vec3(p + sample.share * (vertexAt(party, sample.vertices[1]) - p)) : p;
}

/// How far a point of the surface has moved in the substep [m], by its particles.
Vec3 vertexMotion(const ContactParty& party, Index vertex) {
  const SurfaceRows& rows = party.shape->rows();
  const Index particle = (*rows.particle)[vertex];
  if (particle != kNoIndex) return party.positions[particle] - party.previous[particle];
  const Index r = party.shape->riderOf(vertex);
  Vec3 sum = Vec3::Zero();
  for (Index k = (*rows.offsets)[r]; k < (*rows.offsets)[r + 1]; ++k) {
    const Index i = (*rows.carriers)[k];
    sum += (*rows.weights)[k] * (party.positions[i] - party.previous[i]);
  }
  return sum;
}

/// Appends who carries a vertex; returns what it has beyond its particles [m].
Vec3 addRow(const ContactParty& party, Index vertex, double weight, std::vector<ContactEntry>& entries) {
  const SurfaceRows& rows = party.shape->rows();
  const Index particle = (*rows.particle)[vertex];
  if (particle != kNoIndex) {
    entries.push_back({particle, weight});
    return Vec3::Zero();
  }
  const Index r = party.shape->riderOf(vertex);
  Vec3 rest = party.surface[vertex];
  for (Index k = (*rows.offsets)[r]; k < (*rows.offsets)[r + 1]; ++k) {
    const Index i = (*rows.carriers)[k];
    rest -= (*rows.weights)[k] * party.positions[i];
    entries.push_back({i, weight * (*rows.weights)[k]});
  }
  return weight * rest;
}

/// Entries of the same particle become one, ascending.
void tidy(std::vector<ContactEntry>& entries, std::size_t first) {
  std::sort(entries.begin() + static_cast<std::ptrdiff_t>(first), entries.end(),
            [](const ContactEntry& p, const ContactEntry& q) { return p.particle < q.particle; });
  std::size_t out = first;
  for (std::size_t k = first; k < entries.size(); ++k) {
    if (out > first && entries[out - 1].particle == entries[k].particle)
      entries[out - 1].weight += entries[k].weight;
    else
      entries[out++] = entries[k];
  }
  entries.resize(out);
}

Box intersection(const Box& a, const Box& b) { return {a.min.cwiseMax(b.min), a.max.cwiseMin(b.max)}; }

Box grown(Box box, double by) {
  box.min.array() -= by;
  box.max.array() += by;
  return box;
}

// What a sweep leaves spreads through a stack as heat does, and grows with the fall in a substep: so much
// work do stacks need to stand (found with towers of cubes, see docs/method.md).
constexpr double kStackWork = 4.75;
constexpr double kMostPasses = 4.0;  // beyond it substeps do more
constexpr double kCalm = 0.02;       // of the size, how far particles go apart in a frame
constexpr int kFewSubsteps = 4;      // below it two sweeps, there and back

/// Sweeps in a frame of h [s] for an island.
double stackWork(const ContactScene& scene, const std::vector<ContactParty>& parties, const IslandPlan& plan,
                 Index island, double h) {
  const double gravity = scene.gravity.norm();
  if (!(gravity > 0.0)) return 0.0;
  const Vec3 up = -scene.gravity / gravity;
  double low = std::numeric_limits<double>::infinity(), high = -low, size = 0.0;
  for (Index k = plan.party_offsets[island]; k < plan.party_offsets[island + 1]; ++k) {
    const ContactParty& party = parties[plan.parties[k]];
    const Vec3 centre = 0.5 * (party.bounds.min + party.bounds.max);
    const double reach = 0.5 * up.cwiseAbs().dot(party.bounds.max - party.bounds.min);
    low = std::min(low, up.dot(centre) - reach);
    high = std::max(high, up.dot(centre) + reach);
    size += party.shape->size();
  }
  const Index count = plan.party_offsets[island + 1] - plan.party_offsets[island];
  if (count < 2 || !(size > 0.0)) return 0.0;
  size /= count;
  const double layers = std::max(1.0, (high - low) / size);
  return kStackWork * h * std::sqrt(gravity / size) * std::min(layers * layers, 1e4);
}

/// The order in which contacts are made.
std::tuple<bool, Index, Index, bool, Index> keyOf(const Contact& c) {
  return {c.b != kNoIndex, std::min(c.a, c.b), c.b == kNoIndex ? 0 : std::max(c.a, c.b), c.b != kNoIndex && c.a > c.b,
          c.sample};
}

using PairKey = std::pair<std::uint64_t, std::uint64_t>;

/// What passed through and is still on the wrong side.
struct CaughtKey {
  std::uint64_t a, b;
  Index sample;
  bool operator<(const CaughtKey& o) const {
    return std::tie(a, b, sample) < std::tie(o.a, o.b, o.sample);
  }
};

struct Exit {
  Vec3 direction;  // of a out of b
  double speed;    // [m/s]
};

}  // namespace

namespace {

/// What a task finds; tasks are joined in their order.
struct Findings {
  std::vector<Contact> contacts;
  std::vector<ContactEntry> entries;
  std::vector<double> depths;
  ContactCounters counters;
  std::size_t cursor = 0;  // in the contacts of the last frame

  void clear() {
    contacts.clear();
    entries.clear();
    depths.clear();
    counters = ContactCounters();
    cursor = 0;
  }
};

/// How many points of one party lie in the other.
struct Inside {
  std::size_t points = 0, inside = 0, near = 0;
  double deepest = 0.0;
};

/// Where a task has the contacts of a pair.
struct PairFindings {
  Inside of_a, of_b;
  std::size_t contacts = 0, entries = 0, depths = 0;  // ends
};

}  // namespace

struct Contacts::Impl {
  ContactScene scene;
  BroadPhase broad;
  std::vector<Box> boxes;
  std::vector<char> active, needed;
  std::vector<Pair> pairs;
  std::vector<Index> partners;  // one a party: how many pairs it is in
  std::vector<Index> grounded;  // parties that can meet the ground
  std::vector<MapFinder> finders;
  std::vector<double> deviations;  // [m] one a party: how far its surface may be from where its maps have it
  std::vector<std::vector<ContactMap>> maps_now;  // of those in quick pairs
  std::vector<Contact> contacts, last;  // of this frame and of the one before
  std::vector<ContactEntry> entries;
  std::size_t steady_contacts = 0, steady_entries = 0;  // those found once a frame; quick ones follow
  std::map<CaughtKey, Index> caught;                    // triangle
  std::map<PairKey, Exit> exits;
  std::vector<double> depths;
  std::vector<Index> reached;
  int needed_substeps = 1;
  double frame = 0.0;  // [s]
  ContactSolver solver;
  IslandPlan plan;
  std::size_t frames = 0, last_sorted = 0;  // of `last`, before what was found out of turn
  std::vector<std::uint64_t> keys;  // of the parties of the last frame
  bool same_parties = false;        // as in the last frame, in the same order
  bool fresh = true;        // nothing has been solved since the contacts were made
  bool plan_steady = true;  // the plan is that of the steady contacts alone
  std::vector<Findings> tasks;
  std::vector<PairFindings> pair_findings;

  bool locate(const ContactParty& b, Index party, const MapFinder& finder, const ContactMap* maps, const Vec3& p, double reach,
              ContactShape::Nearest& found, bool& flipped, ContactCounters& counters) const;
  void addContact(Findings& to, const std::vector<ContactParty>& parties, Index a, Index sample, Index b, Index triangle,
                  const std::array<double, 3>& weights, bool was_caught, bool flipped);
  bool stillOver(std::size_t& cursor, const ContactParty& with, Index a, Index b, Index sample, const Vec3& p, bool anew,
                 ContactShape::Nearest& found, bool& flipped);
  void lookInto(Findings& to, const std::vector<ContactParty>& parties, const Pair& pair, Index a, Index b, const ContactMap* maps,
                bool every_point, Inside& inside);
  void trace(const std::vector<ContactParty>& parties, Index a, Index b, ContactCounters& counters);
  void addCaught(const std::vector<ContactParty>& parties);
  void addGround(Findings& to, const std::vector<ContactParty>& parties, Index a, double reach);
  void join(const Findings& from, std::size_t contacts_from, std::size_t contacts_to, std::size_t entries_from,
            std::size_t entries_to);
  void takeOver();
  void choosePasses(const std::vector<ContactParty>& parties, double substep);
  bool letOutWhole(const std::vector<ContactParty>& parties, const Pair& pair, const Inside& of_a, const Inside& of_b,
                   double h, ContactCounters& counters);
};

Contacts::Contacts() : impl_(std::make_unique<Impl>()) {}
Contacts::~Contacts() = default;
Contacts::Contacts(Contacts&&) noexcept = default;
Contacts& Contacts::operator=(Contacts&&) noexcept = default;

const std::vector<char>& Contacts::needed() const { return impl_->needed; }
int Contacts::neededSubsteps() const { return impl_->needed_substeps; }
const std::vector<Index>& Contacts::reached() const { return impl_->reached; }
const std::vector<double>& Contacts::depths() const { return impl_->depths; }

void Contacts::clear() {
  impl_->caught.clear();
  impl_->exits.clear();
  impl_->contacts.clear();
  impl_->last.clear();
  impl_->reached.clear();
  impl_->keys.clear();
  impl_->needed_substeps = 1;
  impl_->depths.clear();
}

void Contacts::findPairs(const ContactScene& scene, const std::vector<ContactParty>& parties, double h,
                         ContactCounters& counters) {
  Impl& w = *impl_;
  w.scene = scene;
  w.pairs.clear();
  w.grounded.clear();
  w.needed.assign(parties.size(), 0);
  w.boxes.clear();
  w.active.clear();
  const double falling = scene.gravity.norm() * h * h;
  for (const ContactParty& party : parties) {
    // Relative kMargin on both sides; what moves reaches as far as it can get.
    const double diagonal = party.bounds.diagonal();
    w.boxes.push_back(grown(party.bounds, kMargin * diagonal + (party.moves ? speedOf(party) * h + falling : 0.0)));
    w.active.push_back(party.moves);
  }
  if (parties.size() > 1) {
    const auto& found = w.broad.find(w.boxes, w.active);
    counters.bounds_tested += w.broad.tested();
    for (const auto& pair : found) {
      w.pairs.push_back({pair[0], pair[1], 0.0, false, 0.0});
      w.needed[pair[0]] = w.needed[pair[1]] = 1;
    }
    counters.pairs += found.size();
  }
  if (scene.ground)
    for (Index a = 0; a < parties.size(); ++a)
      if (parties[a].moves && parties[a].mass > 0.0 && w.boxes[a].min.z() < *scene.ground) {
        w.grounded.push_back(a);
        w.needed[a] |= 2;
      }
}

bool Contacts::Impl::locate(const ContactParty& b, Index party, const MapFinder& finder, const ContactMap* maps, const Vec3& p,
                            double reach, ContactShape::Nearest& found, bool& flipped, ContactCounters& counters) const {
  const ContactMap& map = maps[finder.nearest(p)];
  flipped = map.flipped;
  const ContactShape& shape = *b.shape;
  Vec3 rest = map.to_rest * (p - map.centre) + map.rest;
  // So far outside of the rest bounds that no deviation brings it back: nothing to look up.
  const Box& bounds = shape.bounds();
  const Vec3 beyond = (bounds.min - rest).cwiseMax(rest - bounds.max).cwiseMax(0.0);
  const double far = deviations[party] + reach;
  if (!(beyond.squaredNorm() < far * far)) return false;
  const double enough = kMovedInRest * shape.size();
  for (int n = 0; n < kMostLookups; ++n) {
    ++counters.lookups;
    if (!shape.nearest(rest, found)) return false;
    if (n + 1 == kMostLookups) break;
    // The surface does not lie where the affine map has it: by so much the point is looked up elsewhere.
    const Triangle& corners = shape.surface().triangles[found.triangle];
    Vec3 at_rest = Vec3::Zero(), at_present = Vec3::Zero();
    for (int k = 0; k < 3; ++k) {
      at_rest += found.weights[k] * shape.surface().vertices[corners[k]];
      at_present += found.weights[k] * vertexAt(b, corners[k]);
    }
    const Vec3 there = map.to_rest * (p - at_present) + at_rest;
    if ((there - rest).squaredNorm() < enough * enough) break;
    rest = there;
  }
  return std::isfinite(found.distance);
}

void Contacts::Impl::addContact(Findings& to, const std::vector<ContactParty>& parties, Index a, Index sample, Index b,
                                Index triangle, const std::array<double, 3>& weights, bool was_caught,
                                bool flipped) {
  const ContactParty& of = parties[a];
  const ContactSample& s = of.shape->samples()[sample];
  Contact c;
  c.a = a;
  c.b = b;
  c.sample = sample;
  c.triangle = triangle;
  c.weights = weights;
  c.caught = was_caught;
  c.flipped = flipped;
  const std::vector<Index>& particle = *of.shape->rows().particle;
  c.point = {particle[s.vertices[0]], particle[s.vertices[1]]};
  c.share = s.share;
  c.direct = c.point[0] != kNoIndex && c.point[1] != kNoIndex;
  if (b != kNoIndex) {
    const ContactShape& shape = *parties[b].shape;
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
      const ContactParty& with = parties[b];
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

// A point that was over a triangle in the last frame and still is, well within it and near, need not be looked up; now
// and then it is.
bool Contacts::Impl::stillOver(std::size_t& cursor, const ContactParty& with, Index a, Index b, Index sample, const Vec3& p, bool anew,
                               ContactShape::Nearest& found, bool& flipped) {
  const auto mine = std::make_tuple(true, std::min(a, b), std::max(a, b), a > b, sample);
  while (cursor < last_sorted && keyOf(last[cursor]) < mine) ++cursor;
  if (anew || cursor >= last_sorted || (frames + sample) % kLookAnew == 0) return false;
  const Contact& before = last[cursor];
  if (keyOf(before) != mine || before.caught || !same_parties) return false;
  const Triangle& corners = with.shape->surface().triangles[before.triangle];
  const Vec3 q0 = vertexAt(with, corners[0]);
  const Vec3 e1 = vertexAt(with, corners[1]) - q0, e2 = vertexAt(with, corners[2]) - q0, d = p - q0;
  const Vec3 area = e1.cross(e2);
  const double squared = area.squaredNorm();
  const double v = d.cross(e2).dot(area), w = e1.cross(d).dot(area), least = kWellWithin * squared;
  if (!(v > least) || !(w > least) || !(squared - v - w > least)) return false;
  const double height = (before.flipped ? -1.0 : 1.0) * area.dot(d) / std::sqrt(squared);
  if (!(std::abs(height) < kNearby * with.shape->thickness())) return false;
  found.triangle = before.triangle;
  found.weights = {1.0 - (v + w) / squared, v / squared, w / squared};
  found.distance = height;
  found.above = true;
  flipped = before.flipped;
  return true;
}

// The points of a in the shape of b.
void Contacts::Impl::lookInto(Findings& to, const std::vector<ContactParty>& parties, const Pair& pair, Index a, Index b,
                              const ContactMap* maps, bool every_point, Inside& inside) {
  const ContactParty &of = parties[a], &with = parties[b];
  const ContactShape& shape = *with.shape;
  if (shape.surface().triangles.empty() || with.map_count == 0) return;
  const Box region = grown(intersection(of.bounds, with.bounds), pair.reach);
  const double size = shape.size(), near = kMargin * std::min(size, of.shape->size());
  const std::vector<ContactSample>& samples = of.shape->samples();
  inside.points = samples.size();
  for (Index s = 0; s < samples.size(); ++s) {
    const Vec3 p = sampleAt(of, samples[s]);
    if (!region.contains(p)) continue;
    if (!caught.empty()) {
      const auto held = caught.find({of.key, with.key, s});
      if (held != caught.end()) continue;  // see trace()
    }
    ContactShape::Nearest found;
    bool flipped = false;
    if (!stillOver(to.cursor, with, a, b, s, p, every_point, found, flipped) &&
        !locate(with, b, finders[b], maps, p, pair.reach, found, flipped, to.counters)) continue;
    if (found.distance < 0.0) {
      ++inside.inside;
      inside.deepest = std::min(inside.deepest, found.distance);
    }
    if (found.distance < near) ++inside.near;
    if (found.distance > pair.reach || (found.distance > near && !found.above && !every_point)) continue;
    addContact(to, parties, a, s, b, found.triangle, found.weights, false, flipped);
    if (!to.contacts.empty()) to.contacts.back().below = found.distance < 0.0;
    if (found.distance < 0.0) to.depths.push_back(-found.distance / std::min(size, of.shape->size()));
  }
}

// Points of a that a triangle of b swept over in this substep, from its front: who has passed through is remembered.
void Contacts::Impl::trace(const std::vector<ContactParty>& parties, Index a, Index b, ContactCounters& counters) {
  const ContactParty &of = parties[a], &with = parties[b];
  const ContactShape& shape = *with.shape;
  const std::vector<ContactSample>& samples = of.shape->samples();
  const std::vector<Triangle>& triangles = shape.surface().triangles;
  if (triangles.empty()) return;
  struct Path {
    Vec3 from, to;
  };
  std::vector<Path> paths(samples.size());
  Box box_a, box_b;
  for (Index s = 0; s < samples.size(); ++s) {
    const Vec3 p = sampleAt(of, samples[s]);
    Vec3 motion = vertexMotion(of, samples[s].vertices[0]);
    if (samples[s].share > 0.0) motion += samples[s].share * (vertexMotion(of, samples[s].vertices[1]) - motion);
    paths[s] = {p - motion, p};
    if (!p.allFinite() || !motion.allFinite()) continue;
    box_a.extend(p);
    box_a.extend(p - motion);
  }
  std::vector<Path> corners(shape.surface().vertices.size());
  for (Index v = 0; v < corners.size(); ++v) {
    const Vec3 q = vertexAt(with, v);
    corners[v] = {q - vertexMotion(with, v), q};
  }
  std::vector<Index> near;
  double size = 0.0;
  const auto sweptBox = [&](Index t) {
    Box box;
    for (Index v : triangles[t]) {
      box.extend(corners[v].from);
      box.extend(corners[v].to);
    }
    return box;
  };
  for (Index t = 0; t < triangles.size(); ++t) {
    const Box box = sweptBox(t);
    if (!box.overlaps(box_a)) continue;
    near.push_back(t);
    box_b.extend(box.min);
    box_b.extend(box.max);
    size += (box.max - box.min).maxCoeff();
  }
  if (near.empty() || !(size > 0.0)) return;
  const Box region = intersection(box_a, box_b);
  static thread_local CellTable table;
  table.start(region, size / static_cast<double>(near.size()), 4 * near.size());
  for (Index k = 0; k < near.size(); ++k) {
    const CellRange range = table.cellsOf(sweptBox(near[k]));
    Cell cell;
    for (cell[0] = range.first[0]; cell[0] <= range.last[0]; ++cell[0])
      for (cell[1] = range.first[1]; cell[1] <= range.last[1]; ++cell[1])
        for (cell[2] = range.first[2]; cell[2] <= range.last[2]; ++cell[2]) table.insert(cell, near[k]);
  }
  for (Index s = 0; s < samples.size(); ++s) {
    if (caught.count({of.key, with.key, s})) continue;
    const Path& path = paths[s];
    Box box;
    box.extend(path.from);
    box.extend(path.to);
    if (!box.overlaps(region)) continue;
    ++counters.traced;
    double first = 2.0;
    Index hit = kNoIndex;
    table.forEach(table.cellsOf(box), [&](Index t) {
      const Path &p0 = corners[triangles[t][0]], &p1 = corners[triangles[t][1]], &p2 = corners[triangles[t][2]];
      const Vec3 n0 = (p1.from - p0.from).cross(p2.from - p0.from), n1 = (p1.to - p0.to).cross(p2.to - p0.to);
      const double h0 = n0.dot(path.from - p0.from), h1 = n1.dot(path.to - p0.to);
      if (!(h0 >= 0.0) || !(h1 < 0.0)) return;
      const double d0 = h0 / n0.norm(), d1 = h1 / n1.norm();
      const double time = d0 / (d0 - d1);
      if (!(time < first) && !(time == first && t < hit)) return;
      const auto then = [time](const Path& q) -> Vec3 { return q.from + time * (q.to - q.from); };
      const Vec3 q = then(p0), e1 = then(p1) - q, e2 = then(p2) - q, d = then(path) - q;
      const Vec3 area = e1.cross(e2);
      const double squared = area.squaredNorm();
      const double v = d.cross(e2).dot(area) / squared, w = e1.cross(d).dot(area) / squared;
      if (!(v >= -kBesidePath) || !(w >= -kBesidePath) || !(v + w <= 1.0 + kBesidePath)) return;
      first = time;
      hit = t;
    });
    if (hit == kNoIndex) continue;
    ++counters.caught;
    caught[{of.key, with.key, s}] = hit;
  }
}

// Contacts of those that have passed through: with the triangle that they slid to, until they are back outside.
void Contacts::Impl::addCaught(const std::vector<ContactParty>& parties) {
  Findings found;
  std::map<std::uint64_t, Index> by_key;
  for (Index p = 0; p < parties.size(); ++p) by_key[parties[p].key] = p;
  for (auto it = caught.begin(); it != caught.end();) {
    const auto a = by_key.find(it->first.a), b = by_key.find(it->first.b);
    bool over = a == by_key.end() || b == by_key.end();
    over = over || !parties[a->second].shape || !parties[b->second].shape ||
           it->first.sample >= parties[a->second].shape->samples().size() ||
           it->second >= parties[b->second].shape->surface().triangles.size();
    if (!over) {
      const ContactParty &of = parties[a->second], &with = parties[b->second];
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
        // Not round an edge: there the next one looks another way, and the point is in front of it.
        if (next == kNoIndex) break;
        const Triangle& turned = shape.surface().triangles[next];
        const Vec3 r0 = vertexAt(with, turned[0]);
        const Vec3 other = (vertexAt(with, turned[1]) - r0).cross(vertexAt(with, turned[2]) - r0);
        if (!(other.dot(area) > 0.0) || !(other.dot(p - r0) < 0.0)) break;
        it->second = next;
      }
      if (!over) addContact(found, parties, a->second, it->first.sample, b->second, it->second, weights, true, false);
    }
    it = over ? caught.erase(it) : std::next(it);
  }
  join(found, 0, found.contacts.size(), 0, found.entries.size());
}

void Contacts::Impl::addGround(Findings& to, const std::vector<ContactParty>& parties, Index a, double reach) {
  const ContactParty& party = parties[a];
  const std::vector<ContactSample>& samples = party.shape->samples();
  const double below = *scene.ground + reach;
  for (Index s = 0; s < samples.size(); ++s) {
    if (samples[s].share > 0.0) continue;  // between two vertices above a plane nothing is below it
    const double z = vertexAt(party, samples[s].vertices[0]).z();
    if (!(z < below)) continue;
    addContact(to, parties, a, s, kNoIndex, kNoIndex, {}, false, false);
    to.contacts.back().below = z < *scene.ground;
    if (z < *scene.ground) to.depths.push_back((*scene.ground - z) / party.shape->size());
  }
}

// Appends a part of what a task has found; its entries are then numbered from where they come to lie.
void Contacts::Impl::join(const Findings& from, std::size_t contacts_from, std::size_t contacts_to,
                          std::size_t entries_from, std::size_t entries_to) {
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

void Contacts::Impl::choosePasses(const std::vector<ContactParty>& parties, double substep) {
  plan.passes.resize(plan.size());
  plan.calm.resize(plan.size());
  const double substeps = std::max(1.0, std::round(frame / substep));
  const int least = substeps < kFewSubsteps ? 2 : 1;
  for (Index island = 0; island < plan.size(); ++island) {
    const double work = stackWork(scene, parties, plan, island, frame) / substeps;
    plan.passes[island] = std::max(least, static_cast<int>(std::ceil(std::min(work, kMostPasses))));
    plan.calm[island] = 1;
    for (Index k = plan.party_offsets[island]; k < plan.party_offsets[island + 1]; ++k) {
      const ContactParty& party = parties[plan.parties[k]];
      if (!(party.spread * frame < kCalm * party.shape->size())) plan.calm[island] = 0;
    }
    if (caught.empty()) continue;
    for (Index k = plan.contact_offsets[island]; k < plan.contact_offsets[island + 1]; ++k)
      if (contacts[plan.contacts[k]].caught) plan.passes[island] = kCaughtPasses;
  }
}

// What pressed in the last frame is where the solver starts: both lists are in the same order.
void Contacts::Impl::takeOver() {
  if (!same_parties) return;
  const auto key = keyOf;
  std::size_t old = 0;
  for (Contact& c : contacts) {
    while (old < last_sorted && key(last[old]) < key(c)) ++old;
    if (old >= last_sorted) break;
    if (key(last[old]) != key(c) || !(last[old].impulse > 0.0)) continue;
    c.impulse = last[old].impulse;
    c.slip_impulse = last[old].slip_impulse;
  }
}

// One body inside another, or both at the same place: along the cheapest way out, as a whole, until they are apart.
bool Contacts::Impl::letOutWhole(const std::vector<ContactParty>& parties, const Pair& pair, const Inside& of_a,
                                 const Inside& of_b, double h, ContactCounters& counters) {
  const ContactParty &a = parties[pair.a], &b = parties[pair.b];
  const PairKey key{a.key, b.key};
  const auto known = exits.find(key);
  const auto wholly = [](const Inside& in, const ContactParty& party) {
    return in.points > 0 && in.inside == in.points && -in.deepest > kExitDeep * party.shape->size();
  };
  const auto share = [](const Inside& in) {
    return in.points ? static_cast<double>(in.near) / static_cast<double>(in.points) : 0.0;
  };
  if (known == exits.end()) {
    const bool same = share(of_a) >= kSameShare && share(of_b) >= kSameShare;
    if (!wholly(of_a, a) && !wholly(of_b, b) && !same) return false;
  } else if (of_a.inside == 0 && of_b.inside == 0 && of_a.near == 0 && of_b.near == 0) {
    exits.erase(known);
    return false;
  }
  const double part_a = a.moves && a.rigid_share > 0.0 ? 1.0 / a.mass : 0.0;
  const double part_b = b.moves && b.rigid_share > 0.0 ? 1.0 / b.mass : 0.0;
  if (!(part_a + part_b > 0.0)) return false;
  const auto extent = [](const ContactParty& party, const Vec3& d, bool most) {
    double value = -std::numeric_limits<double>::infinity();
    for (const ContactSample& s : party.shape->samples())
      if (!(s.share > 0.0)) value = std::max(value, (most ? 1.0 : -1.0) * d.dot(vertexAt(party, s.vertices[0])));
    return value;
  };
  Exit exit{Vec3::UnitZ(), 0.0};
  if (known != exits.end()) {
    exit = known->second;
  } else {
    double least = std::numeric_limits<double>::infinity();
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y)
        for (int z = -1; z <= 1; ++z) {
          if (!x && !y && !z) continue;
          const Vec3 d = Vec3(x, y, z).normalized();
          // Nobody leaves into the ground.
          if (scene.ground && ((part_a > 0.0 && d.z() < -0.5) || (part_b > 0.0 && part_a == 0.0 && d.z() > 0.5)))
            continue;
          const double way = extent(b, d, true) + extent(a, d, false);
          if (way < least * (1.0 - 1e-9)) {
            least = way;
            exit = {d, way / kExitTime};
          }
        }
    if (!std::isfinite(least)) return false;
    exit.speed = std::clamp(exit.speed, 0.1 * a.shape->size() / kExitTime,
                            2.0 * std::max(a.shape->size(), b.shape->size()));
    exits[key] = exit;
  }
  ++counters.expelled;
  const Vec3 way = exit.speed * h * exit.direction / (part_a + part_b);
  for (Index i = 0; part_a > 0.0 && i < a.particles; ++i) a.positions[i] += part_a * way;
  for (Index i = 0; part_b > 0.0 && i < b.particles; ++i) b.positions[i] -= part_b * way;
  return true;
}

void Contacts::make(const std::vector<ContactParty>& parties, double h, ContactCounters& counters,
                    const ForEach& for_each) {
  Impl& w = *impl_;
  if (w.reached.empty()) {
    w.last.swap(w.contacts);
    w.last_sorted = std::min(w.steady_contacts, w.last.size());
  }
  ++w.frames;
  w.same_parties = w.keys.size() == parties.size();
  w.keys.resize(parties.size());
  for (Index p = 0; p < parties.size(); ++p) {
    w.same_parties = w.same_parties && w.keys[p] == parties[p].key;
    w.keys[p] = parties[p].key;
  }
  w.contacts.clear();
  w.entries.clear();
  w.depths.clear();
  if (w.finders.size() < parties.size()) {
    w.finders.resize(parties.size());
    w.maps_now.resize(parties.size());
  }
  w.deviations.resize(parties.size());
  std::vector<Index>& partners = w.partners;
  partners.assign(parties.size(), 0);
  for (const Pair& pair : w.pairs) {
    ++partners[pair.a];
    ++partners[pair.b];
  }
  for (Index p = 0; p < parties.size(); ++p) {
    if (!(w.needed[p] & 1)) continue;
    const ContactParty& party = parties[p];
    w.finders[p].make(party.maps, party.map_count);
    w.deviations[p] = kDeviation * party.shape->bounds().diagonal();
    if (partners[p] < kManyPartners || party.map_count != 1) continue;
    double farthest = 0.0;
    for (const ContactSample& s : party.shape->samples()) {
      if (s.share > 0.0) continue;
      const Vec3 fitted =
          party.maps[0].from_rest * (party.shape->surface().vertices[s.vertices[0]] - party.maps[0].rest) +
          party.maps[0].centre;
      farthest = std::max(farthest, (vertexAt(party, s.vertices[0]) - fitted).squaredNorm());
    }
    w.deviations[p] = std::min(w.deviations[p], 2.0 * std::sqrt(farthest));
  }
  // From below upwards where it matters: ground first.
  const double falling = w.scene.gravity.norm() * h * h;
  const std::size_t ground_tasks = (w.grounded.size() + kTaskParties - 1) / kTaskParties;
  const std::size_t pair_tasks = (w.pairs.size() + kTaskPairs - 1) / kTaskPairs;
  if (w.tasks.size() < ground_tasks + pair_tasks) w.tasks.resize(ground_tasks + pair_tasks);
  w.pair_findings.resize(w.pairs.size());
  for_each(ground_tasks + pair_tasks, [&](std::size_t n) {
    Findings& task = w.tasks[n];
    task.clear();
    if (n < ground_tasks) {
      for (std::size_t k = n * kTaskParties; k < std::min(w.grounded.size(), (n + 1) * kTaskParties); ++k) {
        const ContactParty& party = parties[w.grounded[k]];
        w.addGround(task, parties, w.grounded[k], kMargin * party.shape->size() + speedOf(party) * h + falling);
      }
      return;
    }
    const std::size_t first = (n - ground_tasks) * kTaskPairs;
    if (first < w.pairs.size()) {
      const Pair& pair = w.pairs[first];
      const auto start = std::make_tuple(true, pair.a, pair.b, false, Index{0});
      task.cursor = static_cast<std::size_t>(
          std::partition_point(w.last.begin(), w.last.begin() + static_cast<std::ptrdiff_t>(w.last_sorted),
                               [&](const Contact& c) { return keyOf(c) < start; }) -
          w.last.begin());
    }
    for (std::size_t k = first; k < std::min(w.pairs.size(), first + kTaskPairs); ++k) {
      Pair& pair = w.pairs[k];
      const ContactParty &a = parties[pair.a], &b = parties[pair.b];
      const double size = std::min(a.shape->size(), b.shape->size());
      const double thickness = std::min(a.shape->thickness(), b.shape->thickness());
      const double most = kQuick * thickness;
      pair.way = approachOf(a, b);
      pair.reach = kMargin * size + std::min(pair.way * h + falling, most);
      pair.quick = pair.way * h > most;
      PairFindings& findings = w.pair_findings[k];
      findings = PairFindings();
      w.lookInto(task, parties, pair, pair.a, pair.b, b.maps, false, findings.of_a);
      w.lookInto(task, parties, pair, pair.b, pair.a, a.maps, false, findings.of_b);
      findings.contacts = task.contacts.size();
      findings.entries = task.entries.size();
      findings.depths = task.depths.size();
    }
  });
  double fastest = 0.0;  // substeps that the fastest quick pair asks for
  for (std::size_t n = 0; n < ground_tasks + pair_tasks; ++n) {
    const Findings& task = w.tasks[n];
    counters.lookups += task.counters.lookups;
    if (n < ground_tasks) {
      w.join(task, 0, task.contacts.size(), 0, task.entries.size());
      w.depths.insert(w.depths.end(), task.depths.begin(), task.depths.end());
      continue;
    }
    const std::size_t first = (n - ground_tasks) * kTaskPairs;
    PairFindings start;
    for (std::size_t k = first; k < std::min(w.pairs.size(), first + kTaskPairs); ++k) {
      Pair& pair = w.pairs[k];
      const PairFindings& findings = w.pair_findings[k];
      const ContactParty &a = parties[pair.a], &b = parties[pair.b];
      if (w.letOutWhole(parties, pair, findings.of_a, findings.of_b, h, counters)) {
        pair.quick = false;
      } else {
        w.join(task, start.contacts, findings.contacts, start.entries, findings.entries);
        w.depths.insert(w.depths.end(), task.depths.begin() + static_cast<std::ptrdiff_t>(start.depths),
                        task.depths.begin() + static_cast<std::ptrdiff_t>(findings.depths));
        const double step = kLongestStep * std::min((a.bounds.max - a.bounds.min).maxCoeff(),
                                                    (b.bounds.max - b.bounds.min).maxCoeff());
        if (pair.quick) fastest = std::max(fastest, pair.way * h / step);
      }
      start = findings;
    }
  }
  counters.contacts += w.contacts.size();
  w.reached.clear();
  for (const Contact& c : w.contacts) {
    if (c.b == kNoIndex) continue;
    for (Index p : {c.a, c.b})
      if (!parties[p].moves && parties[p].mass > 0.0) w.reached.push_back(p);
  }
  std::sort(w.reached.begin(), w.reached.end());
  w.reached.erase(std::unique(w.reached.begin(), w.reached.end()), w.reached.end());
  if (!w.reached.empty()) return;  // they wake, and all is looked at anew
  w.takeOver();
  const std::size_t lasting = w.contacts.size(), lasting_entries = w.entries.size();
  if (!w.caught.empty()) w.addCaught(parties);
  w.plan.make(parties, w.contacts);
  w.needed_substeps = std::max(1, w.needed_substeps - 1);  // a stack that bounces apart for a frame is still one
  if (fastest > 1.0) w.needed_substeps = std::max(w.needed_substeps, static_cast<int>(std::ceil(std::min(fastest, 1e6))));
  for (Index island = 0; island < w.plan.size(); ++island) {
    const double work = stackWork(w.scene, parties, w.plan, island, h);
    w.needed_substeps = std::max(w.needed_substeps, static_cast<int>(std::ceil(work / kMostPasses)));
  }
  w.frame = h;
  w.solver.letOut(w.scene, parties, w.contacts, w.entries, w.plan, h, counters);
  // Quick pairs are looked up again when they have moved, and so is what was caught.
  const bool any_caught = w.contacts.size() > lasting;
  w.contacts.resize(lasting);
  w.entries.resize(lasting_entries);
  std::size_t out = 0;
  bool any_quick = false;
  for (const Pair& pair : w.pairs) any_quick = any_quick || pair.quick;
  if (any_quick) {
    std::map<std::pair<Index, Index>, bool> quick;
    for (const Pair& pair : w.pairs)
      if (pair.quick) quick[{pair.a, pair.b}] = true;
    for (const Contact& c : w.contacts)
      if (c.b == kNoIndex || !quick.count({std::min(c.a, c.b), std::max(c.a, c.b)})) w.contacts[out++] = c;
    w.contacts.resize(out);
  }
  if (any_quick || any_caught) {
    w.plan.make(parties, w.contacts);
  }
  w.plan_steady = true;
  w.steady_contacts = w.contacts.size();
  w.steady_entries = w.entries.size();
}

void Contacts::begin(const std::vector<ContactParty>& parties, double substep) {
  impl_->scene.substep = substep;
  impl_->choosePasses(parties, substep);
  impl_->fresh = true;
}

void Contacts::solve(const std::vector<ContactParty>& parties, double substep, const RefitMaps& refit,
                     ContactCounters& counters, const ForEach& for_each) {
  Impl& w = *impl_;
  w.contacts.resize(w.steady_contacts);
  w.entries.resize(w.steady_entries);
  std::vector<char> fitted;
  const double falling = w.scene.gravity.norm() * substep * substep;
  for (Pair pair : w.pairs) {
    if (!pair.quick) continue;
    if (fitted.empty()) fitted.assign(parties.size(), 0);
    for (Index p : {pair.a, pair.b})
      if (!fitted[p]) {
        refit(p, w.maps_now[p]);
        w.finders[p].make(w.maps_now[p].data(), static_cast<Index>(w.maps_now[p].size()));
        fitted[p] = 1;
      }
    if (pair.way * substep > kQuick * std::min(parties[pair.a].shape->thickness(), parties[pair.b].shape->thickness())) {
      w.trace(parties, pair.a, pair.b, counters);
      w.trace(parties, pair.b, pair.a, counters);
    }
    const double size = std::min(parties[pair.a].shape->size(), parties[pair.b].shape->size());
    const double thickness = std::min(parties[pair.a].shape->thickness(), parties[pair.b].shape->thickness());
    pair.reach = kMargin * size + std::min(pair.way * substep + falling, kQuick * thickness);
    const std::size_t before = w.contacts.size();
    Inside ignored;
    Findings found;
    w.lookInto(found, parties, pair, pair.a, pair.b, w.maps_now[pair.b].data(), true, ignored);
    w.lookInto(found, parties, pair, pair.b, pair.a, w.maps_now[pair.a].data(), true, ignored);
    w.join(found, 0, found.contacts.size(), 0, found.entries.size());
    counters.lookups += found.counters.lookups;
    counters.contacts += w.contacts.size() - before;
  }
  if (!w.caught.empty()) w.addCaught(parties);
  const bool steady = w.contacts.size() == w.steady_contacts;
  if (!steady || !w.plan_steady) {
    w.plan.make(parties, w.contacts);
    w.choosePasses(parties, substep);
  }
  w.plan_steady = steady;
  w.solver.solve(w.scene, parties, w.contacts, w.entries, w.plan, w.fresh || !steady, for_each, counters);
  w.fresh = !steady;
}

void Contacts::loadedPairs(std::vector<LoadedPair>& pairs) const {
  pairs.clear();
  for (const Contact& c : impl_->contacts) {
    if (!(c.impulse > 0.0)) continue;
    LoadedPair pair{c.a, c.b};
    if (c.b != kNoIndex && c.b < c.a) pair = {c.b, c.a};
    if (pairs.empty() || pairs.back().a != pair.a || pairs.back().b != pair.b) pairs.push_back(pair);
  }
  const auto key = [](const LoadedPair& p) { return std::make_pair(p.a, p.b); };
  std::sort(pairs.begin(), pairs.end(), [&](const LoadedPair& p, const LoadedPair& q) { return key(p) < key(q); });
  pairs.erase(std::unique(pairs.begin(), pairs.end(),
                          [&](const LoadedPair& p, const LoadedPair& q) { return key(p) == key(q); }),
              pairs.end());
}

std::size_t Contacts::groundLoaded() const {
  std::size_t count = 0;
  for (const Contact& c : impl_->contacts) count += c.b == kNoIndex && c.impulse > 0.0;
  return count;
}

void Contacts::points(const std::vector<ContactParty>& parties, std::vector<Point>& points) const {
  points.clear();
  for (const Contact& c : impl_->contacts) {
    if (!(c.impulse > 0.0)) continue;
    const ContactParty& a = parties[c.a];
    Vec3 p = Vec3::Zero();
    if (c.direct) {
      p = (1.0 - c.share) * a.positions[c.point[0]] + c.share * a.positions[c.point[1]];
    } else {
      for (Index k = c.first; k < c.split; ++k)
        p += impl_->entries[k].weight * a.positions[impl_->entries[k].particle];
    }
    points.push_back({p, c.normal, c.impulse});
  }
}

}  // namespace meshless
