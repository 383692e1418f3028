#include "meshless_surgery/contact/feature_pairs.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "meshless_surgery/geometry/nearest_on_triangle.h"

namespace meshless {
namespace {

constexpr double kMargin = 0.2;         // of the mean edge
constexpr double kAhead = 1.2;          // times the way of a frame: what speeds up is met too
constexpr double kTie = 2e-3;           // of the mean edge: nearer than this two surfaces touch
constexpr double kTouching = 1e-3;      // of the mean edge: nearer than this only a face that opposes tells the sides
constexpr double kDeepestEdges = 1.0;   // mean edges by which ridges overlap: deeper ones are not paired
constexpr double kDeeper = 1.3;         // times as deep as it was: a vertex inside may have gone on
constexpr double kLeastOpposed = 0.05;  // cosine by which a direction has to oppose a face of the pushed body
constexpr double kSameWay = 0.9;        // cosine from which a second direction of a vertex says nothing new
constexpr double kSelfOpposed = 0.3;    // cosine by which faces of one body oppose each other where they may meet
constexpr double kParallel = 0.05;      // sine between edges below which they have no common normal
constexpr double kLongRidge = 1.5;      // mean edges: shorter ridges are held by their ends
constexpr double kEnd = 0.01;           // of an edge: nearer to its end a vertex meets what is there

using Candidate = NearFace;

FloatBox boxAround(const Vec3& p, const Vec3& q, double by) {
  FloatBox box;
  box.extend(p.cwiseMin(q) - Vec3::Constant(by));
  box.extend(p.cwiseMax(q) + Vec3::Constant(by));
  return box;
}

bool isOutOf(const Box& bounds, const Vec3& p, const Vec3& q, double by) {
  return ((p.cwiseMin(q).array() - by) > bounds.max.array()).any() ||
         ((p.cwiseMax(q).array() + by) < bounds.min.array()).any();
}

/// Cosine by which a direction opposes the vertex: the most of its own normal and those of its faces.
double opposition(const PairSearch::Side& side, Index v, const Vec3& direction) {
  double most = -direction.dot(side.frame->vertex_normals[v]);
  const ContactSurface& s = *side.surface;
  for (Index k = s.face_offsets[v]; k < s.face_offsets[v + 1]; ++k)
    most = std::max(most, -direction.dot(side.frame->face_normals[s.faces[k]]));
  return most;
}

/// [m] Half the least width: who is deeper is nearer to the other side.
double deepestIn(const SurfaceFrame& frame) { return 0.5 * (frame.bounds.max - frame.bounds.min).minCoeff(); }

class VertexSearch {
 public:
  VertexSearch(const PairSearch& search, SearchScratch& scratch)
      : search_(search),
        a_(search.a),
        b_(search.b),
        tie_(kTie * search.length),
        touching_(kTouching * search.length),
        margin_(searchMargin(search.length)),
        deepest_(deepestIn(*search.b.frame)),
        pairs_(scratch.found.pairs),
        sides_(scratch.found.sides),
        watched_(scratch.found.watched),
        candidates_(scratch.faces) {}

  /// False where the vertex is out of the other's bounds.
  bool find(Index v) {
    if (search_.self == PairSearch::Self::kCuts && !a_.surface->cut_vertices[v]) return false;
    remembered_ = recall(v);
    const Vec3& p = a_.frame->vertices[v];
    const Vec3 end = p + search_.h * a_.frame->velocities[v];
    // A vertex inside is searched for as deep as it was, and a little more.
    const double deep = remembered_ ? std::min(deepest_, kDeeper * remembered_->depth) : 0.0;
    if (isOutOf(b_.frame->bounds, p, end, margin_ + deep)) return false;
    gather(v, p, end, margin_ + deep);
    if (candidates_.empty() && mayBeginInside() && windingAround(p) > 0) gather(v, p, end, margin_ + deepest_);
    if (candidates_.empty()) return true;
    const Candidate& best = chooseNearest(v);
    const double distance = signedDistance(best, p);
    made_ = 0;
    if (distance >= -tie_)
      meetOutside(v, p, best);
    else if (search_.self == PairSearch::Self::kNo || remembered_)
      meetInside(v, p, -distance);
    return true;
  }

 private:
  bool mayBeginInside() const { return search_.first && search_.self == PairSearch::Self::kNo && b_.surface->closed; }

  const RememberedSide* recall(Index v) const {
    const RememberedSide* const end = search_.remembered + search_.remembered_count;
    const RememberedSide* const at = std::lower_bound(
        search_.remembered, end, v, [](const RememberedSide& side, Index vertex) { return side.vertex < vertex; });
    return at != end && at->vertex == v ? at : nullptr;
  }

  bool mayMeet(Index v, Index face) const {
    if (search_.self == PairSearch::Self::kNo) return true;
    if (search_.self == PairSearch::Self::kCuts && !b_.surface->cut_faces[face]) return false;
    for (const Index corner : b_.surface->triangles[face])
      if (corner == v) return false;
    return b_.frame->face_normals[face].dot(a_.frame->vertex_normals[v]) < -kSelfOpposed;
  }

  void gather(Index v, const Vec3& p, const Vec3& end, double within) {
    candidates_.clear();
    const Vec3& velocity = a_.frame->velocities[v];
    b_.surface->tree.query(b_.frame->boxes, boxAround(p, end, within), [&](Index face) {
      if (!mayMeet(v, face)) return;
      const Triangle& t = b_.surface->triangles[face];
      const Points &x = b_.frame->vertices, &u = b_.frame->velocities;
      Candidate c;
      c.face = face;
      c.weights = nearestWeights(p, x[t[0]], x[t[1]], x[t[2]]);
      c.point = c.weights[0] * x[t[0]] + c.weights[1] * x[t[1]] + c.weights[2] * x[t[2]];
      c.distance = (p - c.point).norm();
      // What goes along the plane across what is between them comes no nearer.
      const Vec3 way = p - c.point;
      const double towards = std::max({way.dot(u[t[0]]), way.dot(u[t[1]]), way.dot(u[t[2]])}) - way.dot(velocity);
      c.reach = c.distance > 0.0 ? kAhead * search_.h * std::max(0.0, towards / c.distance) : 0.0;
      if (c.distance > within + c.reach) return;
      c.reach += margin_;
      c.corners = static_cast<int>((c.weights.array() > 0.0).count());
      candidates_.push_back(c);
    });
  }

  const Candidate& chooseNearest(Index v) const {
    const auto first = std::min_element(candidates_.begin(), candidates_.end(),
                                        [](const Candidate& x, const Candidate& y) { return x.distance < y.distance; });
    if (first->distance > tie_) return *first;  // signs hold at the nearest point alone
    const Candidate* best = nullptr;
    double most = -3.0;
    for (const Candidate& c : candidates_) {
      if (c.distance > tie_) continue;
      const double opposed = opposition(a_, v, b_.frame->face_normals[c.face]) + (c.corners == 3 ? 1e-6 : 0.0);
      if (!(opposed > most)) continue;
      most = opposed;
      best = &c;
    }
    return best ? *best : candidates_.front();
  }

  double signedDistance(const Candidate& best, const Vec3& p) const {
    const Vec3 way = p - best.point;
    if (best.distance <= tie_) return b_.frame->face_normals[best.face].dot(way);
    // A sheet has no inside: it is where it was.
    if (!b_.surface->closed) return remembered_ && remembered_->normal.dot(way) < 0.0 ? -best.distance : best.distance;
    Vec3 pseudonormal = Vec3::Zero();
    for (const Candidate& c : candidates_) {
      if (!((c.point - best.point).squaredNorm() <= 1e-18 * search_.length * search_.length)) continue;
      pseudonormal += angleAt(c) * b_.frame->face_normals[c.face];
    }
    const bool outside =
        pseudonormal.dot(way) >= 0.0 || (search_.self == PairSearch::Self::kNo && windingAround(p) <= 0);
    return outside ? best.distance : -best.distance;
  }

  /// How often the surface goes around a point, by a ray along x. Where a surface is folded, pseudonormals can take its
  /// outside for its inside; this cannot.
  int windingAround(const Vec3& p) const {
    Vec3 far = p;
    far.x() = std::max(p.x(), b_.frame->bounds.max.x()) + search_.length;
    int winding = 0;
    b_.surface->tree.query(b_.frame->boxes, boxAround(p, far, 0.0), [&](Index face) {
      const Triangle& t = b_.surface->triangles[face];
      std::array<Vec3, 3> corner;
      for (int k = 0; k < 3; ++k) corner[k] = b_.frame->vertices[t[k]] - p;
      // Edges that the ray's shadow on the y axis crosses; each end belongs to one side, so that neighbours agree.
      double crossed[2];  // z where they cross it
      double x[2];
      int edges = 0;
      for (int k = 0; k < 3; ++k) {
        // From the lower end to the upper, so that both faces of an edge compute the same.
        const Vec3 &from = corner[k], &to = corner[(k + 1) % 3];
        const Vec3& low = from.y() < to.y() ? from : to;
        const Vec3& high = from.y() < to.y() ? to : from;
        if (!(low.y() <= 0.0 && high.y() > 0.0)) continue;
        const double s = -low.y() / (high.y() - low.y());
        crossed[edges] = low.z() + s * (high.z() - low.z());
        x[edges] = low.x() + s * (high.x() - low.x());
        ++edges;
      }
      if (edges != 2 || (crossed[0] <= 0.0) == (crossed[1] <= 0.0)) return;
      const double s = -crossed[0] / (crossed[1] - crossed[0]);
      if (!(x[0] + s * (x[1] - x[0]) > 0.0)) return;
      winding += (corner[1] - corner[0]).cross(corner[2] - corner[0]).x() > 0.0 ? 1 : -1;
    });
    return winding;
  }

  /// Of the face at a vertex; 1 elsewhere, where both sides count alike.
  double angleAt(const Candidate& c) const {
    if (c.corners != 1) return 1.0;
    const Triangle& t = b_.surface->triangles[c.face];
    const int k = c.weights[0] > 0.0 ? 0 : c.weights[1] > 0.0 ? 1 : 2;
    const Vec3& at = b_.frame->vertices[t[k]];
    const Vec3 to = b_.frame->vertices[t[(k + 1) % 3]] - at, other = b_.frame->vertices[t[(k + 2) % 3]] - at;
    const double lengths = to.norm() * other.norm();
    return lengths > 0.0 ? std::acos(std::clamp(to.dot(other) / lengths, -1.0, 1.0)) : 0.0;
  }

  bool mayPush(Index v, const Vec3& normal) const {
    return !b_.surface->closed || !a_.surface->closed || opposition(a_, v, normal) > kLeastOpposed;
  }

  void meetOutside(Index v, const Vec3& p, const Candidate& best) {
    watch(v, p, best);
    const Vec3& face_normal = b_.frame->face_normals[best.face];
    if (best.distance <= tie_) {
      Vec3 normal = face_normal;
      if (!b_.surface->closed && remembered_ && remembered_->normal.dot(normal) < 0.0) normal = -normal;
      if (mayPush(v, normal)) {
        add(v, best, normal, normal.dot(p - best.point));
      }
    } else if (best.distance <= best.reach) {
      const Vec3 normal = (p - best.point) / best.distance;
      if (mayPush(v, normal)) add(v, best, normal, best.distance);
    }
    rememberOutside(v, p, best);
    if (!b_.surface->closed) return;
    for (const Candidate& c : candidates_) {
      if (made_ == used_.size()) break;
      if (&c == &best || c.corners != 3 || c.distance > c.reach) continue;
      const Vec3& normal = b_.frame->face_normals[c.face];
      if (normal.dot(p - c.point) < 0.0 || !mayPush(v, normal)) continue;
      if (std::any_of(used_.begin(), used_.begin() + made_, [&](const Vec3& u) { return u.dot(normal) > kSameWay; }))
        continue;
      add(v, c, normal, c.distance);
    }
  }

  // Also what no row pushes: should it come to touch, nothing else tells its side.
  void rememberOutside(Index v, const Vec3& p, const Candidate& best) {
    if (made_ > 0)
      sides_.push_back({v, 0.0, used_[0]});
    else if (best.distance > tie_ && best.distance <= best.reach)
      sides_.push_back({v, 0.0, (p - best.point) / best.distance});
    else if (best.distance <= tie_ && remembered_)
      sides_.push_back({v, 0.0, remembered_->normal});
  }

  bool wasOutOf(const Vec3& face_normal) const {
    return remembered_ && !(remembered_->depth > 0.0) && remembered_->normal.dot(face_normal) > kSameWay;
  }

  // What touches is held by the face that the vertex opposes most, or that it was out of.
  void watch(Index v, const Vec3& p, const Candidate& best) {
    for (const Candidate& c : candidates_) {
      if (c.distance > c.reach) continue;
      const Triangle& t = b_.surface->triangles[c.face];
      const Vec3& face_normal = b_.frame->face_normals[c.face];
      if (c.distance > touching_)
        watched_.push_back({{v, t[0], t[1], t[2]}, 1, (p - c.point) / c.distance, kLeastLeft * c.distance});
      else if ((&c == &best && mayPush(v, face_normal)) || wasOutOf(face_normal))
        watched_.push_back({{v, t[0], t[1], t[2]}, 1, face_normal, -touching_});
    }
  }

  // Out by the face that is near, that the vertex opposes, and on whose side it was.
  void meetInside(Index v, const Vec3& p, double depth) {
    const Candidate* out = nullptr;
    double least = std::numeric_limits<double>::infinity(), gap = 0.0;
    for (const Candidate& c : candidates_) {
      const Vec3& normal = b_.frame->face_normals[c.face];
      const double height = normal.dot(p - c.point);
      if (height > 0.0 || (c.corners != 3 && -height < 0.5 * c.distance)) continue;
      const double opposed = b_.surface->closed ? opposition(a_, v, normal) : 1.0;
      if (!(opposed > kLeastOpposed)) continue;
      double cost = c.distance / (opposed * opposed);
      if (remembered_) {
        const double same = normal.dot(remembered_->normal);
        cost /= kLeastOpposed + std::max(0.0, same) * same;
      }
      if (!(cost < least)) continue;
      least = cost;
      out = &c;
      gap = c.corners == 3 ? height : -c.distance;
    }
    if (!out) return;
    const Vec3& normal = b_.frame->face_normals[out->face];
    add(v, *out, normal, gap);
    sides_.push_back({v, depth, normal});
  }

  void add(Index v, const Candidate& c, const Vec3& normal, double gap) {
    const Triangle& t = b_.surface->triangles[c.face];
    FeaturePair pair;
    pair.order = static_cast<std::uint8_t>(made_);
    pair.features = {v, kNoIndex};
    pair.vertices = {v, t[0], t[1], t[2]};
    pair.shares = {1.0, -c.weights[0], -c.weights[1], -c.weights[2]};
    pair.normal = normal;
    pair.gap = gap;
    pairs_.push_back(pair);
    used_[made_++] = normal;
  }

  const PairSearch& search_;
  const PairSearch::Side a_, b_;
  const double tie_, touching_, margin_, deepest_;
  std::vector<FeaturePair>& pairs_;
  std::vector<RememberedSide>& sides_;
  std::vector<WatchedFeatures>& watched_;
  std::vector<Candidate>& candidates_;
  const RememberedSide* remembered_ = nullptr;
  std::size_t made_ = 0;
  std::array<Vec3, 3> used_;
};

// Ericson 2005, Real-Time Collision Detection, sec. 5.1.9.
Vec3 betweenSegments(const Vec3& p, const Vec3& p_end, const Vec3& q, const Vec3& q_end, double& s, double& t) {
  const Vec3 u = p_end - p, v = q_end - q, w = p - q;
  const double a = u.squaredNorm(), e = v.squaredNorm(), f = v.dot(w);
  s = t = 0.0;
  if (a > 0.0 && e > 0.0) {
    const double b = u.dot(v), c = u.dot(w), det = a * e - b * b;
    s = det > 0.0 ? std::clamp((b * f - c * e) / det, 0.0, 1.0) : 0.0;
    t = (b * s + f) / e;
    if (t < 0.0) {
      t = 0.0;
      s = std::clamp(-c / a, 0.0, 1.0);
    } else if (t > 1.0) {
      t = 1.0;
      s = std::clamp((b - c) / a, 0.0, 1.0);
    }
  } else if (a > 0.0) {
    s = std::clamp(-u.dot(w) / a, 0.0, 1.0);
  } else if (e > 0.0) {
    t = std::clamp(f / e, 0.0, 1.0);
  }
  return w + s * u - t * v;
}

// Both of the arc's ends are as far from its middle: inside is who is nearer.
bool isInArc(const SurfaceFrame& frame, const ContactEdge& edge, const Vec3& direction) {
  const Vec3& first = frame.face_normals[edge.faces[0]];
  if (edge.faces[1] == kNoIndex) return true;
  const Vec3 middle = (first + frame.face_normals[edge.faces[1]]).normalized();
  return direction.dot(middle) >= first.dot(middle) - 1e-9;
}

/// Whether a way from a ridge leads into the solid.
bool leadsInside(const SurfaceFrame& frame, const ContactEdge& ridge, const Vec3& way) {
  return ridge.faces[1] != kNoIndex && frame.face_normals[ridge.faces[0]].dot(way) < 0.0 &&
         frame.face_normals[ridge.faces[1]].dot(way) < 0.0;
}

// Where they are near enough to meet in the frame. Ridges that have got hooked into each other, with no vertex inside,
// must be free to come out.
void watchEdges(const PairSearch& search, const ContactEdge& of_a, const ContactEdge& of_b,
                std::vector<WatchedFeatures>& watched) {
  const SurfaceFrame &a = *search.a.frame, &b = *search.b.frame;
  const std::array<Index, 2>&va = of_a.vertices, &vb = of_b.vertices;
  const PairDistance apart =
      distanceOfPair(2, {a.vertices[va[0]], a.vertices[va[1]], b.vertices[vb[0]], b.vertices[vb[1]]});
  if (apart.distance <= kTouching * search.length) return;
  if (leadsInside(b, of_b, apart.between) || leadsInside(a, of_a, -apart.between)) return;
  const auto along = [&apart](const Vec3& velocity) { return apart.between.dot(velocity) / apart.distance; };
  const double towards = std::max(along(b.velocities[vb[0]]), along(b.velocities[vb[1]])) -
                         std::min(along(a.velocities[va[0]]), along(a.velocities[va[1]]));
  if (apart.distance > searchMargin(search.length) + kAhead * search.h * std::max(0.0, towards)) return;
  watched.push_back({{va[0], va[1], vb[0], vb[1]}, 2, apart.between / apart.distance, kLeastLeft * apart.distance});
}

// Who is inside as a whole goes out by one face, the nearest to any of its vertices: each by a face of its own, they
// would go to all sides.
void leadOut(const PairSearch& search, FoundFeatures& found) {
  if (found.sides.size() != search.a.surface->vertices() || found.pairs.size() != found.sides.size()) return;
  std::size_t nearest = 0;
  for (std::size_t n = 0; n < found.sides.size(); ++n) {
    if (!(found.sides[n].depth > 0.0)) return;
    if (found.pairs[n].gap > found.pairs[nearest].gap) nearest = n;
  }
  const FeaturePair by = found.pairs[nearest];
  Vec3 at = Vec3::Zero();
  for (int k = 1; k < 4; ++k) at -= by.shares[k] * search.b.frame->vertices[by.vertices[k]];
  for (std::size_t n = 0; n < found.pairs.size(); ++n) {
    FeaturePair& pair = found.pairs[n];
    const Index v = pair.vertices[0];
    pair.vertices = {v, by.vertices[1], by.vertices[2], by.vertices[3]};
    pair.shares = by.shares;
    pair.normal = found.sides[n].normal = by.normal;
    pair.gap = by.normal.dot(search.a.frame->vertices[v] - at);
  }
}

}  // namespace

PairDistance distanceOfPair(int of_a, const std::array<Vec3, 4>& corners) {
  PairDistance nearest;
  if (of_a == 1) {
    const Vec3 weights = nearestWeights(corners[0], corners[1], corners[2], corners[3]);
    nearest.shares = {1.0, -weights[0], -weights[1], -weights[2]};
    nearest.between = corners[0] - weights[0] * corners[1] - weights[1] * corners[2] - weights[2] * corners[3];
  } else {
    double s = 0.0, t = 0.0;
    nearest.between = betweenSegments(corners[0], corners[1], corners[2], corners[3], s, t);
    nearest.shares = {1.0 - s, s, t - 1.0, -t};
  }
  nearest.distance = nearest.between.norm();
  return nearest;
}

double searchMargin(double edge_length) { return kMargin * edge_length; }
double touchingDistance(double edge_length) { return kTouching * edge_length; }

void findVerticesNear(const PairSearch& search, SearchScratch& scratch) {
  double deepest = 0.0;
  for (std::size_t k = 0; k < search.remembered_count; ++k)
    deepest = std::max(deepest, kDeeper * search.remembered[k].depth);
  const ContactSurface& a = *search.a.surface;
  scratch.vertices.clear();
  if (search.first) {  // any may begin inside, far from all faces
    scratch.vertices.resize(a.vertices());
    std::iota(scratch.vertices.begin(), scratch.vertices.end(), Index{0});
    return;
  }
  scratch.near.assign(a.vertices(), 0);
  a.tree.queryTree(search.a.frame->boxes, search.b.surface->tree, search.b.frame->boxes,
                   searchMargin(search.length) + std::min(deepest, deepestIn(*search.b.frame)), scratch.query,
                   [&](Index face) {
                     for (const Index v : a.triangles[face]) scratch.near[v] = 1;
                   });
  for (Index v = 0; v < a.vertices(); ++v)
    if (scratch.near[v]) scratch.vertices.push_back(v);
}

std::size_t findVertexFace(const PairSearch& search, SearchScratch& scratch) {
  VertexSearch each(search, scratch);
  std::size_t queried = 0;
  for (const Index v : scratch.vertices) queried += each.find(v);
  if (search.self == PairSearch::Self::kNo && scratch.vertices.size() == search.a.surface->vertices())
    leadOut(search, scratch.found);
  return queried;
}

namespace {

/// visit: each edge of a ridge of `of` and what is near of `other`, but valleys.
template <class Visit>
void eachEdgeNear(const PairSearch::Side& of, const PairSearch::Side& other, double h, double margin,
                  const Visit& visit) {
  const SurfaceFrame& frame = *of.frame;
  for (const Index e : frame.ridges) {
    Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
    for (const Index v : of.surface->edges[e].vertices) {
      const Vec3 &p = frame.vertices[v], q = p + h * frame.velocities[v];
      low = low.cwiseMin(p).cwiseMin(q);
      high = high.cwiseMax(p).cwiseMax(q);
    }
    if (isOutOf(other.frame->bounds, low, high, margin)) continue;
    const FloatBox box = boxAround(low, high, margin);
    other.surface->tree.query(other.frame->boxes, box, [&](Index face) {
      for (const Index near : other.surface->face_edges[face]) {
        const ContactEdge& edge = other.surface->edges[near];
        if (other.frame->shapes[near] == EdgeShape::kValley || edge.faces[0] != face) continue;
        FloatBox swept = other.frame->swept[edge.vertices[0]];
        swept.extend(other.frame->swept[edge.vertices[1]]);
        if (swept.overlaps(box)) visit(e, near);
      }
    });
  }
}

/// Where their common normal is between the normals of both; false where it is not.
bool meetRidges(const PairSearch& search, Index e, Index other, FoundFeatures& found) {
  const SurfaceFrame &a = *search.a.frame, &b = *search.b.frame;
  const ContactEdge &of_a = search.a.surface->edges[e], &of_b = search.b.surface->edges[other];
  const Vec3 &a0 = a.vertices[of_a.vertices[0]], &a1 = a.vertices[of_a.vertices[1]];
  const Vec3 &b0 = b.vertices[of_b.vertices[0]], &b1 = b.vertices[of_b.vertices[1]];
  const Vec3 along_a = a1 - a0, along_b = b1 - b0, between = a0 - b0;
  Vec3 normal = along_a.cross(along_b);
  const double sine = normal.norm();
  if (!(sine > kParallel * along_a.norm() * along_b.norm())) return false;
  normal /= sine;
  Vec3 outwards = b.face_normals[of_b.faces[0]];
  if (of_b.faces[1] != kNoIndex) outwards += b.face_normals[of_b.faces[1]];
  if (normal.dot(outwards) < 0.0) normal = -normal;
  if (!isInArc(b, of_b, normal) || !isInArc(a, of_a, -normal)) return false;
  // Where they are nearest to each other.
  const double aa = along_a.squaredNorm(), ab = along_a.dot(along_b), bb = along_b.squaredNorm();
  const double da = along_a.dot(between), db = along_b.dot(between), det = aa * bb - ab * ab;
  const double s = (ab * db - bb * da) / det, t = (aa * db - ab * da) / det;
  if (!(s > kEnd && s < 1.0 - kEnd && t > kEnd && t < 1.0 - kEnd)) return false;
  const double gap = normal.dot(between + s * along_a - t * along_b);
  const Vec3 velocity = (1.0 - s) * a.velocities[of_a.vertices[0]] + s * a.velocities[of_a.vertices[1]] -
                        (1.0 - t) * b.velocities[of_b.vertices[0]] - t * b.velocities[of_b.vertices[1]];
  if (gap > searchMargin(search.length) + kAhead * search.h * std::max(0.0, -normal.dot(velocity)) ||
      gap < -kDeepestEdges * search.length)
    return false;
  FeaturePair pair;
  pair.kind = FeaturePair::Kind::kEdgeEdge;
  pair.of_a = pair.of_b = 2;
  pair.features = {e, other};
  pair.vertices = {of_a.vertices[0], of_a.vertices[1], of_b.vertices[0], of_b.vertices[1]};
  pair.shares = {1.0 - s, s, t - 1.0, -t};
  pair.normal = normal;
  pair.gap = gap;
  found.pairs.push_back(pair);
  return true;
}

double lengthOf(const PairSearch::Side& side, Index edge) {
  const std::array<Index, 2>& v = side.surface->edges[edge].vertices;
  return (side.frame->vertices[v[1]] - side.frame->vertices[v[0]]).norm();
}

/// A ridge longer than the edges that it lies on: between its ends the tissue has nothing else to lie on. The normal is
/// that of the flat side. False where they do not meet.
bool meetLongRidge(const PairSearch& search, bool ridge_of_a, Index ridge, Index flat, FoundFeatures& found) {
  const PairSearch::Side &long_side = ridge_of_a ? search.a : search.b, &flat_side = ridge_of_a ? search.b : search.a;
  if (!(lengthOf(long_side, ridge) > kLongRidge * search.length)) return false;
  const ContactEdge &of_ridge = long_side.surface->edges[ridge], &of_flat = flat_side.surface->edges[flat];
  const std::array<Index, 2>&v = of_ridge.vertices, &w = of_flat.vertices;
  const Points &x = long_side.frame->vertices, &y = flat_side.frame->vertices;
  Vec3 out = flat_side.frame->face_normals[of_flat.faces[0]];
  if (of_flat.faces[1] != kNoIndex) out = (out + flat_side.frame->face_normals[of_flat.faces[1]]).normalized();
  const Vec3 along = (x[v[1]] - x[v[0]]).normalized(), towards = -(out - along.dot(out) * along).normalized();
  if (towards.isZero(0.0) || !isInArc(*long_side.frame, of_ridge, towards)) return false;
  double s = 0.0, t = 0.0;
  const Vec3 between = betweenSegments(x[v[0]], x[v[1]], y[w[0]], y[w[1]], s, t);
  if (!(s > kEnd && s < 1.0 - kEnd && t > kEnd && t < 1.0 - kEnd)) return false;
  const double gap = out.dot(between), margin = searchMargin(search.length);
  if ((between - gap * out).norm() > margin + 0.5 * std::abs(gap)) return false;  // beside each other
  const Points &of_x = long_side.frame->velocities, &of_y = flat_side.frame->velocities;
  const Vec3 velocity = (1.0 - s) * of_x[v[0]] + s * of_x[v[1]] - (1.0 - t) * of_y[w[0]] - t * of_y[w[1]];
  if (gap > margin + kAhead * search.h * std::max(0.0, -out.dot(velocity)) || gap < -kDeepestEdges * search.length)
    return false;
  FeaturePair pair;
  pair.kind = FeaturePair::Kind::kEdgeEdge;
  pair.of_a = pair.of_b = 2;
  pair.gap = gap;
  if (ridge_of_a) {
    pair.features = {ridge, flat};
    pair.vertices = {v[0], v[1], w[0], w[1]};
    pair.shares = {1.0 - s, s, t - 1.0, -t};
    pair.normal = out;
  } else {
    pair.features = {flat, ridge};
    pair.vertices = {w[0], w[1], v[0], v[1]};
    pair.shares = {1.0 - t, t, s - 1.0, -s};
    pair.normal = -out;
  }
  found.pairs.push_back(pair);
  return true;
}

}  // namespace

void findEdgeEdge(const PairSearch& search, FoundFeatures& found) {
  const double margin = searchMargin(search.length);
  const std::vector<ContactEdge>&edges_a = search.a.surface->edges, &edges_b = search.b.surface->edges;
  eachEdgeNear(search.a, search.b, search.h, margin, [&](Index e, Index near) {
    watchEdges(search, edges_a[e], edges_b[near], found.watched);
    const bool ridges = search.b.frame->shapes[near] == EdgeShape::kRidge;
    if (ridges && meetRidges(search, e, near, found)) return;
    if (!meetLongRidge(search, true, e, near, found) && ridges) meetLongRidge(search, false, near, e, found);
  });
  eachEdgeNear(search.b, search.a, search.h, margin, [&](Index e, Index near) {
    if (search.a.frame->shapes[near] != EdgeShape::kFlat) return;
    watchEdges(search, edges_a[near], edges_b[e], found.watched);
    meetLongRidge(search, false, e, near, found);
  });
}

void findPlane(const PairSearch& search, double height, std::vector<FeaturePair>& pairs) {
  const SurfaceFrame& a = *search.a.frame;
  const double margin = searchMargin(search.length);
  for (Index v = 0; v < a.vertices.size(); ++v) {
    const double gap = a.vertices[v].z() - height;
    if (gap > margin + kAhead * search.h * std::max(0.0, -a.velocities[v].z())) continue;
    FeaturePair pair;
    pair.kind = FeaturePair::Kind::kPlane;
    pair.of_b = 0;
    pair.features = {v, kNoIndex};
    pair.vertices = {v, kNoIndex, kNoIndex, kNoIndex};
    pair.shares = {1.0, 0.0, 0.0, 0.0};
    pair.gap = gap;
    pairs.push_back(pair);
  }
}

void findSphere(const PairSearch& search, const Vec3& centre, double radius, const Vec3& way,
                std::vector<FeaturePair>& pairs) {
  const SurfaceFrame& a = *search.a.frame;
  const ContactSurface& surface = *search.a.surface;
  const double reach = radius + searchMargin(search.length);
  const auto meet = [&](std::array<Index, 3> corners, Vec3 weights) {
    // Only the corners that count, ascending: faces around a vertex find the same.
    FeaturePair pair;
    pair.kind = FeaturePair::Kind::kSphere;
    pair.of_a = pair.of_b = 0;
    pair.vertices.fill(kNoIndex);
    for (int k = 0; k < 3; ++k) {
      if (!(weights[k] > 0.0)) continue;
      int at = pair.of_a++;
      for (; at > 0 && pair.vertices[at - 1] > corners[k]; --at) {
        pair.vertices[at] = pair.vertices[at - 1];
        pair.shares[at] = pair.shares[at - 1];
      }
      pair.vertices[at] = corners[k];
      pair.shares[at] = weights[k];
    }
    Vec3 point = Vec3::Zero(), velocity = Vec3::Zero();
    for (int k = 0; k < pair.of_a; ++k) {
      point += pair.shares[k] * a.vertices[pair.vertices[k]];
      velocity += pair.shares[k] * a.velocities[pair.vertices[k]];
    }
    const double distance = (point - centre).norm();
    if (distance > reach + kAhead * (search.h * velocity - way).norm()) return;
    pair.features = {pair.vertices[0], pair.vertices[1]};
    pair.order = static_cast<std::uint8_t>(pair.of_a);
    pair.normal = distance > 0.0 ? Vec3((point - centre) / distance) : Vec3(Vec3::UnitZ());
    pair.gap = distance - radius;
    double apart = 0.0;  // [m^2] mean square of the corners from the point
    for (int k = 0; k < pair.of_a; ++k) apart += pair.shares[k] * (a.vertices[pair.vertices[k]] - point).squaredNorm();
    if (apart < radius * radius) pair.chord = 0.5 * apart / radius * (1.0 - apart / (radius * radius));
    pairs.push_back(pair);
  };
  const FloatBox box = boxAround(centre, centre + way, reach);
  surface.tree.query(a.boxes, box, [&](Index face) {
    const Triangle& t = surface.triangles[face];
    meet(t, nearestWeights(centre, a.vertices[t[0]], a.vertices[t[1]], a.vertices[t[2]]));
    for (int k = 0; k < 3; ++k) meet({t[k], t[(k + 1) % 3], t[(k + 2) % 3]}, Vec3::UnitX());
  });
  if (surface.triangles.empty())
    for (Index v = 0; v < a.vertices.size(); ++v) meet({v, kNoIndex, kNoIndex}, Vec3::UnitX());
  std::sort(pairs.begin(), pairs.end(),
            [](const FeaturePair& x, const FeaturePair& y) { return x.vertices < y.vertices; });
  pairs.erase(std::unique(pairs.begin(), pairs.end(),
                          [](const FeaturePair& x, const FeaturePair& y) { return x.vertices == y.vertices; }),
              pairs.end());
}

}  // namespace meshless
