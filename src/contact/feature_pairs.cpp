#include "meshless_surgery/contact/feature_pairs.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "meshless_surgery/geometry/query/nearest_on_triangle.h"

namespace meshless {
namespace {

constexpr double kTie = 2e-3;           // of the mean edge: nearer than this two surfaces touch
constexpr double kLeastOpposed = 0.05;  // cosine by which a direction has to oppose a face of the pushed body
constexpr double kSameWay = 0.9;        // cosine from which a second direction of a vertex says nothing new
constexpr double kFlat = 0.3;           // sine by which neighbours may be farther out than what sticks out
constexpr double kMostRidgePoints = 1e6;
constexpr double kAcross = 2.0;        // points of the push sphere in the radius of its contact
constexpr double kWidest = 0.7;        // spacings between them, at most
constexpr double kWidestHard = 0.3;    // likewise of a surface that gives way as its vertices do, and not by cells
constexpr double kMostAcross = 100.0;  // points across all that it touches
constexpr double kLeastTouch = 0.03;   // spacings: the smallest such radius
constexpr double kSelfOpposed = 0.3;   // cosine by which faces of one body oppose each other where they may meet

FloatBox boxAround(const Vec3& p, const Vec3& q, double by) {
  FloatBox box;
  box.extend(p.cwiseMin(q) - Vec3::Constant(by));
  box.extend(p.cwiseMax(q) + Vec3::Constant(by));
  return box;
}

/// A point of a surface that is searched for in another: a vertex, or on a ridge.
struct SurfacePoint {
  std::array<Index, 2> vertices{kNoIndex, kNoIndex};  // the second of a ridge
  double share = 1.0;                                 // of the first
  std::array<Index, 2> name{kNoIndex, kNoIndex};
  const Index* faces = nullptr;  // around it
  std::size_t face_count = 0;
  Vec3 place, velocity, normal;

  bool isVertex() const { return vertices[1] == kNoIndex; }
};

SurfacePoint vertexOf(const PairSearch::Side& side, Index v) {
  const ContactSurface& s = *side.surface;
  const SurfaceFrame& frame = *side.frame;
  const Index begin = s.face_offsets[v], faces = s.face_offsets[v + 1] - begin;
  return {
      {v, kNoIndex},          1.0, {v, kNoIndex}, s.faces.data() + begin, faces, frame.vertices[v], frame.velocities[v],
      frame.vertex_normals[v]};
}

/// The number-th of so many between the ends of a ridge.
SurfacePoint ridgePoint(const PairSearch::Side& side, Index e, Index number, Index count) {
  const ContactEdge& edge = side.surface->edges[e];
  const SurfaceFrame& frame = *side.frame;
  SurfacePoint point;
  point.vertices = edge.vertices;
  point.share = 1.0 - (number + 1.0) / (count + 1.0);
  point.name = {side.surface->vertices() + e, number};  // after all vertices
  point.faces = edge.faces.data();
  point.face_count = edge.faces[1] == kNoIndex ? 1 : 2;
  const auto mean = [&](const Points& of) {
    return Vec3(point.share * of[edge.vertices[0]] + (1.0 - point.share) * of[edge.vertices[1]]);
  };
  point.place = mean(frame.vertices);
  point.velocity = mean(frame.velocities);
  point.normal = frame.face_normals[edge.faces[0]];
  if (point.face_count == 2) point.normal = (point.normal + frame.face_normals[edge.faces[1]]).normalized();
  return point;
}

/// Cosine by which a direction opposes the point: the most of its own normal and those of its faces.
double opposition(const SurfaceFrame& frame, const SurfacePoint& point, const Vec3& direction) {
  double most = -direction.dot(point.normal);
  for (std::size_t k = 0; k < point.face_count; ++k)
    most = std::max(most, -direction.dot(frame.face_normals[point.faces[k]]));
  return most;
}

/// Whether a point sticks out along a direction: what comes from there meets it and not its neighbours.
bool sticksOut(const PairSearch::Side& side, const SurfacePoint& point, const Vec3& direction) {
  for (std::size_t k = 0; k < point.face_count; ++k)
    for (const Index v : side.surface->triangles[point.faces[k]]) {
      const Vec3 way = side.frame->vertices[v] - point.place;
      if (way.dot(direction) > kFlat * way.norm()) return false;
    }
  return true;
}

/// The part of a way from p to q that is in a box, from .. to of 0 .. 1.
bool clip(const Box& box, const Vec3& p, const Vec3& q, double& from, double& to) {
  const Eigen::Array3d way = (q - p).array() + 1e-300;  // never 0
  const Eigen::Array3d low = (box.min - p).array() / way, high = (box.max - p).array() / way;
  from = std::max(0.0, low.min(high).maxCoeff());
  to = std::min(1.0, low.max(high).minCoeff());
  return from <= to;
}

class PointSearch {
 public:
  PointSearch(const PairSearch& search, SearchScratch& scratch)
      : search_(search),
        a_(search.a),
        b_(search.b),
        tie_(kTie * search.length),
        margin_(searchMargin(search.length)),
        pairs_(scratch.pairs),
        sides_(scratch.sides),
        scratch_(scratch),
        candidates_(scratch.faces) {}

  /// Of the vertices of a, each with the faces that it may meet.
  void findVertices() {
    const RememberedSide* side = search_.remembered;
    const RememberedSide* const end = side + search_.remembered_count;
    for (Index v = 0; v < scratch_.first.size(); ++v) {
      while (side != end && side->vertex < v) ++side;
      remembered_ = side != end && side->vertex == v ? side : nullptr;
      const bool inside = remembered_ && remembered_->depth > 0.0;
      if (scratch_.first[v] == kNoIndex && !inside && !mayBeginInside(a_.frame->vertices[v])) continue;
      if (search_.self == PairSearch::Self::kCuts && !a_.surface->cut_vertices[v]) continue;
      const SurfacePoint point = vertexOf(a_, v);
      candidates_.clear();
      if (meetsItself()) {
        behind_point_ = layersAt(point.place - margin_ * point.normal);
        if (behind_point_ == Layers::kNone) continue;
      }
      if (inside)
        gather(point, margin_ + remembered_->depth);
      else
        for (Index k = scratch_.first[v]; k != kNoIndex; k = scratch_.met[k].next)
          consider(point, scratch_.met[k].face, margin_);
      meet(point);
    }
    remembered_ = nullptr;
  }

  /// Between the ends of a long ridge nothing but points on it meets what it crosses.
  void findRidgePoints() {
    const SurfaceFrame& frame = *a_.frame;
    const Vec3 margin = Vec3::Constant(margin_);
    for (Index e = 0; e < a_.surface->edges.size(); ++e) {
      const ContactEdge& edge = a_.surface->edges[e];
      const Index count = static_cast<Index>(std::min(edge.length / search_.spacing + 1e-6, kMostRidgePoints));
      if (count == 0) break;                                                     // so are all that come after it
      Box around{b_.frame->bounds.min - margin, b_.frame->bounds.max + margin};  // swept, and as far as the ends go
      for (const Index v : edge.vertices) {
        const Vec3 way = search_.h * frame.velocities[v];
        around.min = around.min.cwiseMin(b_.frame->bounds.min - margin - way);
        around.max = around.max.cwiseMax(b_.frame->bounds.max + margin - way);
      }
      double from, to;
      if (!clip(around, frame.vertices[edge.vertices[0]], frame.vertices[edge.vertices[1]], from, to)) continue;
      if (!isRidge(*a_.surface, frame, edge)) continue;
      const Index first = static_cast<Index>(std::max(0.0, std::ceil(from * (count + 1.0)) - 1.0));
      for (Index n = first; n < count && n + 1.0 <= to * (count + 1.0); ++n) {
        const SurfacePoint point = ridgePoint(a_, e, n, count);
        candidates_.clear();
        gather(point, margin_);
        meet(point);
      }
    }
  }

  std::size_t queried() const { return queried_; }

 private:
  /// The point and its candidates.
  void meet(const SurfacePoint& point) {
    const Vec3& p = point.place;
    ++queried_;
    if (candidates_.empty() && mayBeginInside(p) && windingAround(p) > 0) gather(point, b_.frame->bounds.diagonal());
    if (candidates_.empty()) return;
    const NearFace* const best = chooseNearest(point);
    if (!best) return;
    const double distance = signedDistance(point, *best);
    made_ = 0;
    if (distance >= -tie_)
      meetOutside(point, *best);
    else if (search_.self == PairSearch::Self::kNo || remembered_)
      meetInside(point, -distance);
  }

  bool mayBeginInside(const Vec3& p) const {
    return search_.first && search_.self == PairSearch::Self::kNo && b_.surface->closed && b_.frame->bounds.contains(p);
  }

  bool mayMeet(const SurfacePoint& point, Index face) const {
    if (search_.self == PairSearch::Self::kNo) return true;
    if (search_.self == PairSearch::Self::kCuts && !b_.surface->cut_faces[face]) return false;
    for (const Index corner : b_.surface->triangles[face])
      if (corner == point.vertices[0]) return false;
    return b_.frame->face_normals[face].dot(point.normal) < -kSelfOpposed;
  }

  bool meetsItself() const { return search_.self != PairSearch::Self::kNo && b_.surface->closed; }

  // A surface meets itself where there is tissue behind the point and the face: beyond what overlaps, one layer of it.
  // Elsewhere it is turned inside out, or has gone through itself, and a row would keep it so. In a crumple each point
  // has hundreds of candidates, and what overlaps costs a hundred times what the rest of one does: it is asked last.
  bool hasTissueBehind(const SurfacePoint& point, NearFace& c) const {
    if (!meetsItself()) return true;
    if (c.behind == Layers::kUnknown) c.behind = findBehind(point, c) ? Layers::kOne : Layers::kNone;
    return c.behind == Layers::kOne;
  }

  bool findBehind(const SurfacePoint& point, const NearFace& c) const {
    const Vec3& normal = b_.frame->face_normals[c.face];
    const double deep = normal.dot(c.point - point.place);
    if (!(deep > 0.0)) return behind_point_ == Layers::kOne && scratch_.behind[c.face] == Layers::kOne;
    return windingAround(middleOf(c.face) - (deep + margin_) * normal) == 1 &&
           windingAround(point.place + deep * normal - margin_ * point.normal) == 1;
  }

  Vec3 middleOf(Index face) const {  // its ends may lie on a rim
    const Triangle& t = b_.surface->triangles[face];
    const Points& x = b_.frame->vertices;
    return (x[t[0]] + x[t[1]] + x[t[2]]) / 3.0;
  }

  /// Asked once a face for all points.
  Layers layersBehind(Index face) {
    Layers& known = scratch_.behind[face];
    if (known == Layers::kUnknown) known = layersAt(middleOf(face) - margin_ * b_.frame->face_normals[face]);
    return known;
  }

  Layers layersAt(const Vec3& at) const {
    const int winding = windingAround(at);
    return winding < 1 ? Layers::kNone : winding == 1 ? Layers::kOne : Layers::kMore;
  }

  void gather(const SurfacePoint& point, double within) {
    const FloatBox box = boxAround(point.place, point.place + search_.h * point.velocity, within);
    b_.surface->tree.query(b_.frame->faces, box, [&](Index face) { consider(point, face, within); });
  }

  void consider(const SurfacePoint& point, Index face, double within) {
    if (!mayMeet(point, face)) return;
    const Vec3& p = point.place;
    const Triangle& t = b_.surface->triangles[face];
    const Points &x = b_.frame->vertices, &u = b_.frame->velocities;
    NearFace c;
    c.face = face;
    c.weights = nearestWeights(p, x[t[0]], x[t[1]], x[t[2]]);
    c.point = c.weights[0] * x[t[0]] + c.weights[1] * x[t[1]] + c.weights[2] * x[t[2]];
    // What goes along the plane across what is between them comes no nearer.
    const Vec3 way = p - c.point;
    c.distance = way.norm();
    const double towards = std::max({way.dot(u[t[0]]), way.dot(u[t[1]]), way.dot(u[t[2]])}) - way.dot(point.velocity);
    c.reach = c.distance > 0.0 ? search_.h * std::max(0.0, towards / c.distance) : 0.0;
    if (c.distance > within + c.reach || (meetsItself() && layersBehind(face) == Layers::kNone)) return;
    c.reach += margin_;
    c.corners = static_cast<int>((c.weights.array() > 0.0).count());
    candidates_.push_back(c);
  }

  /// Of those with tissue behind them; null: there are none.
  NearFace* chooseNearest(const SurfacePoint& point) {
    const auto farther = [this](Index x, Index y) {
      return std::tie(candidates_[x].distance, x) > std::tie(candidates_[y].distance, y);
    };
    std::vector<Index>& order = scratch_.order;
    order.resize(candidates_.size());
    std::iota(order.begin(), order.end(), 0);
    std::make_heap(order.begin(), order.end(), farther);
    while (!order.empty() && !hasTissueBehind(point, candidates_[order.front()])) {
      std::pop_heap(order.begin(), order.end(), farther);
      order.pop_back();
    }
    NearFace* const nearest = order.empty() ? nullptr : &candidates_[order.front()];
    if (!nearest || nearest->distance > tie_) return nearest;  // signs hold at the nearest point alone
    NearFace* best = nearest;
    double most = -3.0;
    for (NearFace& c : candidates_) {
      if (c.distance > tie_) continue;
      const double opposed =
          opposition(*a_.frame, point, b_.frame->face_normals[c.face]) + (c.corners == 3 ? 1e-6 : 0.0);
      if (!(opposed > most) || !hasTissueBehind(point, c)) continue;
      most = opposed;
      best = &c;
    }
    return best;
  }

  double signedDistance(const SurfacePoint& point, const NearFace& best) {
    const Vec3 way = point.place - best.point;
    if (best.distance <= tie_) return b_.frame->face_normals[best.face].dot(way);
    // A sheet has no inside: it is where it was.
    if (!b_.surface->closed) return remembered_ && remembered_->normal.dot(way) < 0.0 ? -best.distance : best.distance;
    Vec3 pseudonormal = Vec3::Zero();
    for (NearFace& c : candidates_) {
      if (!((c.point - best.point).squaredNorm() <= 1e-18 * search_.length * search_.length)) continue;
      if (hasTissueBehind(point, c)) pseudonormal += angleAt(c) * b_.frame->face_normals[c.face];
    }
    const bool outside =
        pseudonormal.dot(way) >= 0.0 || (search_.self == PairSearch::Self::kNo && windingAround(point.place) <= 0);
    return outside ? best.distance : -best.distance;
  }

  /// How often the surface goes around a point, by a ray along x. Where a surface is folded, pseudonormals can take its
  /// outside for its inside; this cannot.
  int windingAround(const Vec3& p) const {
    Vec3 far = p;
    far.x() = std::max(p.x(), b_.frame->bounds.max.x()) + search_.length;
    int winding = 0;
    b_.surface->tree.query(b_.frame->faces, boxAround(p, far, 0.0), [&](Index face) {
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
  double angleAt(const NearFace& c) const {
    if (c.corners != 1) return 1.0;
    const Triangle& t = b_.surface->triangles[c.face];
    const int k = c.weights[0] > 0.0 ? 0 : c.weights[1] > 0.0 ? 1 : 2;
    const Vec3& at = b_.frame->vertices[t[k]];
    const Vec3 to = b_.frame->vertices[t[(k + 1) % 3]] - at, other = b_.frame->vertices[t[(k + 2) % 3]] - at;
    const double lengths = to.norm() * other.norm();
    return lengths > 0.0 ? std::acos(std::clamp(to.dot(other) / lengths, -1.0, 1.0)) : 0.0;
  }

  bool mayPush(const SurfacePoint& point, const Vec3& normal) const {
    return !b_.surface->closed || !a_.surface->closed || opposition(*a_.frame, point, normal) > kLeastOpposed ||
           (remembered_ && remembered_->normal.dot(normal) > kSameWay);  // turned inside out, but on the side it was
  }

  void meetOutside(const SurfacePoint& point, const NearFace& best) {
    const Vec3& p = point.place;
    if (best.distance <= tie_) {
      Vec3 normal = b_.frame->face_normals[best.face];
      if (!b_.surface->closed && remembered_ && remembered_->normal.dot(normal) < 0.0) normal = -normal;
      if (mayPush(point, normal)) add(point, best, normal, normal.dot(p - best.point));
    } else if (best.distance <= best.reach) {
      const Vec3 normal = (p - best.point) / best.distance;
      if (mayPush(point, normal) && (best.corners == 3 || sticksOut(a_, point, -normal)))
        add(point, best, normal, best.distance);
    }
    if (point.isVertex()) rememberOutside(point.vertices[0], p, best);
    if (!b_.surface->closed) return;
    for (NearFace& c : candidates_) {
      if (made_ == used_.size()) break;
      if (&c == &best || c.corners != 3 || c.distance > c.reach) continue;
      const Vec3& normal = b_.frame->face_normals[c.face];
      if (normal.dot(p - c.point) < 0.0 || !mayPush(point, normal)) continue;
      if (std::any_of(used_.begin(), used_.begin() + made_, [&](const Vec3& u) { return u.dot(normal) > kSameWay; }) ||
          !hasTissueBehind(point, c))
        continue;
      add(point, c, normal, c.distance);
    }
  }

  // Also what no row pushes: should it come to touch, nothing else tells its side.
  void rememberOutside(Index v, const Vec3& p, const NearFace& best) {
    if (made_ > 0)
      sides_.push_back({v, 0.0, used_[0]});
    else if (best.distance > tie_ && best.distance <= best.reach)
      sides_.push_back({v, 0.0, (p - best.point) / best.distance});
    else if (best.distance <= tie_ && remembered_)
      sides_.push_back({v, 0.0, remembered_->normal});
  }

  // Out by the face that is near, that the vertex opposes, and on whose side it was.
  void meetInside(const SurfacePoint& point, double depth) {
    const Vec3& p = point.place;
    const NearFace* out = nullptr;
    double least = std::numeric_limits<double>::infinity(), gap = 0.0;
    for (NearFace& c : candidates_) {
      const Vec3& normal = b_.frame->face_normals[c.face];
      const double height = normal.dot(p - c.point);
      if (height > 0.0 || (c.corners != 3 && -height < 0.5 * c.distance)) continue;
      const double opposed = b_.surface->closed ? opposition(*a_.frame, point, normal) : 1.0;
      const double same = remembered_ ? normal.dot(remembered_->normal) : 0.0;
      if (!(opposed > kLeastOpposed || same > kSameWay)) continue;
      double cost = c.distance / std::max(kLeastOpposed, opposed * opposed);
      if (remembered_) cost /= kLeastOpposed + std::max(0.0, same) * same;
      if (!(cost < least) || !hasTissueBehind(point, c)) continue;
      least = cost;
      out = &c;
      gap = c.corners == 3 ? height : -c.distance;
    }
    if (!out) return;
    const Vec3& normal = b_.frame->face_normals[out->face];
    add(point, *out, normal, gap);
    if (point.isVertex()) sides_.push_back({point.vertices[0], depth, normal});
  }

  void add(const SurfacePoint& point, const NearFace& c, const Vec3& normal, double gap) {
    FeaturePair pair;
    pair.order = static_cast<std::uint8_t>(made_);
    pair.features = point.name;
    pair.of_a = point.isVertex() ? 1 : 2;
    pair.vertices[0] = point.vertices[0];
    pair.vertices[1] = point.vertices[1];
    pair.shares[0] = point.share;
    pair.shares[1] = 1.0 - point.share;
    for (int k = 0; k < 3; ++k) {
      pair.vertices[pair.of_a + k] = b_.surface->triangles[c.face][k];
      pair.shares[pair.of_a + k] = -c.weights[k];
    }
    pair.normal = normal;
    pair.gap = gap;
    pairs_.push_back(pair);
    used_[made_++] = normal;
  }

  const PairSearch& search_;
  const PairSearch::Side a_, b_;
  const double tie_, margin_;
  std::vector<FeaturePair>& pairs_;
  std::vector<RememberedSide>& sides_;
  SearchScratch& scratch_;
  Layers behind_point_ = Layers::kUnknown;
  std::vector<NearFace>& candidates_;
  const RememberedSide* remembered_ = nullptr;
  std::size_t made_ = 0, queried_ = 0;
  std::array<Vec3, 3> used_;
};

// Who is inside as a whole goes out by one face, the nearest to any of its vertices: each by a face of its own, they
// would go to all sides.
void leadOut(const PairSearch& search, SearchScratch& found) {
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
    pair.vertices = {v, by.vertices[1], by.vertices[2], by.vertices[3], kNoIndex};
    pair.shares = by.shares;
    pair.normal = found.sides[n].normal = by.normal;
    pair.gap = by.normal.dot(search.a.frame->vertices[v] - at);
  }
}

/// Which faces of b vertices of a may meet.
void findNear(const PairSearch& search, SearchScratch& scratch) {
  scratch.met.clear();
  scratch.first.assign(search.a.surface->vertices(), kNoIndex);
  const SurfaceFrame &a = *search.a.frame, &b = *search.b.frame;
  const auto mayMeet = [&](Index mine, Index child, Index theirs) {
    if (search.self == PairSearch::Self::kNo) return ~0u;
    return b.face_turns.nodes[theirs].dotBelow(a.point_turns.nodes[mine].box(static_cast<int>(child)), -kSelfOpposed);
  };
  const float by = static_cast<float>(searchMargin(search.length));
  search.a.surface->vertex_tree.queryTree(a.points, search.b.surface->tree, b.faces, by, scratch.stack, mayMeet,
                                          [&](Index v, Index face) {
                                            scratch.met.push_back({face, scratch.first[v]});
                                            scratch.first[v] = static_cast<Index>(scratch.met.size() - 1);
                                          });
}

}  // namespace

std::size_t findVertexFace(const PairSearch& search, SearchScratch& scratch) {
  findNear(search, scratch);
  if (search.self != PairSearch::Self::kNo) scratch.behind.assign(search.b.surface->triangles.size(), Layers::kUnknown);
  PointSearch each(search, scratch);
  each.findVertices();
  if (search.self != PairSearch::Self::kNo) return each.queried();
  leadOut(search, scratch);
  each.findRidgePoints();
  return each.queried();
}

void findPlane(const PairSearch& search, double height, std::vector<FeaturePair>& pairs) {
  const SurfaceFrame& a = *search.a.frame;
  const double margin = searchMargin(search.length);
  for (Index v = 0; v < a.vertices.size(); ++v) {
    const double gap = a.vertices[v].z() - height;
    if (gap > margin + search.h * std::max(0.0, -a.velocities[v].z())) continue;
    FeaturePair pair;
    pair.kind = FeaturePair::Kind::kPlane;
    pair.of_b = 0;
    pair.features = {v, kNoIndex};
    pair.vertices.fill(kNoIndex);
    pair.vertices[0] = v;
    pair.shares[0] = 1.0;
    pair.gap = gap;
    pairs.push_back(pair);
  }
}

namespace {

/// Directions from the centre of a sphere: an even hexagonal grid on each of its halves, wrapped around the ends of an
/// axis.
class RayGrid {
 public:
  RayGrid(const Vec3& axis, double radius, double apart) : radius_(radius), apart_(apart) {
    // As the axis turns, the grid turns as little as it can: it is that about -z, brought along.
    const Quat turn = Quat::FromTwoVectors(-Vec3::UnitZ(), axis);
    halves_[0] = {axis, turn * Vec3::UnitX(), turn * -Vec3::UnitY()};
    halves_[1] = {-axis, halves_[0][1], halves_[0][2]};
  }

  /// visit(name, direction, [m^2] of the sphere) of rays within an angle of a direction, by its cosine.
  template <class Visit>
  void eachWithin(const Vec3& direction, double cosine, const Visit& visit) const {
    const double angle = std::acos(std::clamp(cosine, -1.0, 1.0));
    for (int half = 0; half < 2; ++half) {
      const auto& [axis, first, second] = halves_[half];
      const double sine = std::hypot(direction.dot(first), direction.dot(second));
      const double from_axis = std::atan2(sine, direction.dot(axis)), most = from_axis + angle;
      if (from_axis - angle > 0.5 * M_PI) continue;
      // Wrapping stretches across the radius: by angle over sine.
      const double edge = 0.5 * M_PI * radius_, stretched = most < 2.0 ? most / std::sin(most) * angle : 2.0 * M_PI;
      const double by = radius_ * stretched, out = sine > 0.0 ? radius_ * from_axis / sine : 0.0;
      const double x = out * direction.dot(first), y = out * direction.dot(second);
      const double height = std::sqrt(0.75) * apart_;
      const int last = static_cast<int>(std::floor(std::min(y + by, edge) / height));
      for (int j = static_cast<int>(std::ceil(std::max(y - by, -edge) / height)); j <= last; ++j) {
        const double shift = 0.5 * (j & 1), v = height * j;
        const int end = static_cast<int>(std::floor(std::min(x + by, edge) / apart_ - shift));
        for (int i = static_cast<int>(std::ceil(std::max(x - by, -edge) / apart_ - shift)); i <= end; ++i) {
          const double u = apart_ * (i + shift), r = std::hypot(u, v), theta = r / radius_;
          if (theta > 0.5 * M_PI) continue;
          const double shrunk = theta > 0.0 ? std::sin(theta) / theta : 1.0;
          const Vec3 way = std::cos(theta) * axis + shrunk / radius_ * (u * first + v * second);
          if (way.dot(direction) >= cosine) visit(nameOf(half, i, j), way, apart_ * height * shrunk);
        }
      }
    }
  }

 private:
  static std::array<Index, 2> nameOf(int half, int i, int j) {
    constexpr int kMiddle = 1 << 29;
    return {static_cast<Index>(j + kMiddle) + (half == 0 ? 0 : Index{1} << 31), static_cast<Index>(i + kMiddle)};
  }

  std::array<Vec3, 3> halves_[2];  // axis, and two across it
  double radius_, apart_;
};

}  // namespace

void findSphere(const PairSearch& search, const SphereTouch& touch, std::vector<FeaturePair>& pairs) {
  const SurfaceFrame& a = *search.a.frame;
  const ContactSurface& surface = *search.a.surface;
  const double radius = touch.radius;
  // As it lies half way; what comes so fast that it jumps over tissue, as it starts.
  const double half = 0.5 * std::min(touch.way.norm(), radius);
  const Vec3 centre = touch.centre + half * touch.way.stableNormalized();
  struct Near {
    Index face;
    double distance;
    Vec3 to;  // from the centre to its nearest point
    double approach;
  };
  static thread_local std::vector<Near> near;
  near.clear();
  const double margin = searchMargin(search.length);
  const FloatBox box = boxAround(touch.centre, touch.centre + touch.way, radius + margin);
  double swept = 0.0;
  Box extent;
  const Near* nearest = nullptr;
  surface.tree.query(a.faces, box, [&](Index face) {
    const Triangle& t = surface.triangles[face];
    const Vec3 w = nearestWeights(centre, a.vertices[t[0]], a.vertices[t[1]], a.vertices[t[2]]);
    const Vec3 to = w[0] * a.vertices[t[0]] + w[1] * a.vertices[t[1]] + w[2] * a.vertices[t[2]] - centre;
    const Vec3 velocity = w[0] * a.velocities[t[0]] + w[1] * a.velocities[t[1]] + w[2] * a.velocities[t[2]];
    const double distance = to.norm();
    const Vec3 by = touch.way - search.h * velocity;
    const double approach = distance > 0.0 ? std::max(0.0, by.dot(to) / distance) : by.norm();
    if (distance > radius + margin + approach + half) return;
    near.push_back({face, distance, to, approach});
    swept = std::max(swept, approach);
    for (const Index v : t) extent.extend(a.vertices[v]);
  });
  if (surface.triangles.empty())
    for (Index v = 0; v < a.vertices.size(); ++v) {
      const Vec3 to = a.vertices[v] - centre;
      const double distance = to.norm();
      if (distance > radius + margin + (search.h * a.velocities[v] - touch.way).norm()) continue;
      FeaturePair pair;
      pair.kind = FeaturePair::Kind::kSphere;
      pair.of_b = 0;
      pair.features = {v, kNoIndex};
      pair.vertices = {v, kNoIndex, kNoIndex, kNoIndex, kNoIndex};
      pair.shares[0] = 1.0;
      pair.normal = distance > 0.0 ? Vec3(to / distance) : Vec3(Vec3::UnitZ());
      pair.gap = distance - radius;
      pairs.push_back(pair);
    }
  if (near.empty()) return;
  for (const Near& n : near)
    if (!nearest || n.distance < nearest->distance) nearest = &n;
  Vec3 axis = touch.force;
  if (!(axis.norm() > 0.0)) axis = nearest->to;
  if (!(axis.norm() > 0.0)) axis = -Vec3::UnitZ();
  axis.normalize();
  // Hertz: of the force of now, of what the sphere comes nearer in the frame, and of what it overlaps.
  double contact = std::sqrt(radius * std::max(swept, radius - nearest->distance));
  contact =
      std::max(contact, touch.modulus > 0.0 ? std::cbrt(0.75 * touch.force.norm() * radius / touch.modulus) : radius);
  contact = std::clamp(contact, std::min(radius, kLeastTouch * touch.spacing), radius);
  const double seen = std::min(2.0 * M_PI, extent.diagonal() / std::max(nearest->distance, 1e-9 * radius));
  const double apart =
      std::max(std::min(contact / kAcross, (touch.modulus > 0.0 ? kWidest : kWidestHard) * touch.spacing),
               radius * seen / kMostAcross);
  const double over = 0.25 * contact * contact / radius;  // [m] that rows reach beyond what touches
  const RayGrid grid(axis, radius, apart);
  for (const Near& n : near) {
    const double reach = radius + over + n.approach + half;
    if (n.distance > reach) continue;
    const Triangle& t = surface.triangles[n.face];
    const Vec3 p = a.vertices[t[0]] - centre, q = a.vertices[t[1]] - centre, r = a.vertices[t[2]] - centre;
    const double volume = p.dot(q.cross(r));
    if (volume == 0.0) continue;
    // No farther from its nearest point than its corners, and than it is in reach.
    const Vec3 to = n.distance > 0.0 ? Vec3(n.to / n.distance) : axis;
    const double corners = std::min({to.dot(p) / p.norm(), to.dot(q) / q.norm(), to.dot(r) / r.norm()});
    grid.eachWithin(to, std::max(corners, n.distance / reach) - 1e-9,
                    [&](const std::array<Index, 2>& name, const Vec3& way, double area) {
                      Vec3 w(way.dot(q.cross(r)), way.dot(r.cross(p)), way.dot(p.cross(q)));
                      w /= volume;  // barycentric over the distance along the ray
                      const double sum = w.sum();
                      if (!(sum > 0.0) || w.minCoeff() < -1e-9 * sum) return;
                      const double distance = 1.0 / sum;
                      if (distance > reach) return;
                      FeaturePair pair;
                      pair.kind = FeaturePair::Kind::kSphere;
                      pair.of_a = 3;
                      pair.of_b = 0;
                      pair.features = name;
                      pair.vertices = {t[0], t[1], t[2], kNoIndex, kNoIndex};
                      w = w.cwiseMax(0.0);
                      w /= w.sum();
                      pair.shares = {w[0], w[1], w[2], 0.0, 0.0};
                      pair.normal = way;
                      pair.gap = distance - radius;
                      pair.area = area;
                      pairs.push_back(pair);
                    });
  }
  // The first face that a ray meets.
  std::sort(pairs.begin(), pairs.end(), [](const FeaturePair& x, const FeaturePair& y) {
    return std::tie(x.features, x.gap, x.vertices) < std::tie(y.features, y.gap, y.vertices);
  });
  pairs.erase(std::unique(pairs.begin(), pairs.end(),
                          [](const FeaturePair& x, const FeaturePair& y) { return x.features == y.features; }),
              pairs.end());
}

}  // namespace meshless
