#include "meshless_surgery/contact/contact_shape.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <unordered_map>

#include "empty_space.h"
#include "grid_rings.h"
#include "meshless_surgery/base/bytes.h"
#include "meshless_surgery/geometry/nearest_on_triangle.h"

namespace meshless {
namespace {

constexpr double kBinEdges = 3.0;    // size of a bin in mean edges
constexpr double kCellEdges = 0.5;   // size of a cell in mean edges
constexpr double kSpaceEdges = 1.5;  // size of a cell of empty space in mean edges
constexpr double kMostBins = 1 << 18;
constexpr double kMostCells = 1 << 19;
constexpr double kLongEdge = 0.1;    // of the body's least extent: shorter edges need no samples
constexpr double kFlatEdge = 0.996;  // cosine between neighbours: about 5 degrees
constexpr double kGentleEdge = 0.7;  // likewise: 45 degrees
constexpr double kMostPlaces = 1e6;  // along an axis of the grid in which samples keep apart
constexpr int kMostEdgeSamples = 64;
constexpr std::size_t kThicknessRays = 48;
constexpr double kOnRim = 1e-6;           // of a squared distance: straight above the rim of a face
constexpr double kFacing = 0.1;           // cosine: a face pushes a body's point into the body
constexpr std::size_t kBounding = 4;      // triangles that tell how far the nearest to a point of a cell can be
constexpr std::uintptr_t kAsked = 12;     // times that the bins are searched before a cell is filled
constexpr double kSphereRounding = 1e-6;  // relative, of what is kept in single precision
constexpr double kFlat = 1e-12;           // squared sine of a corner: below, a triangle has no area but by rounding
constexpr float kAskedOnce = 1e30F;       // more than any distance; a cell that was asked about n times has n of them
constexpr float kAskedEnough = 4.0F * kAskedOnce;
constexpr double kTie = 1e-9;  // relative: two features are equally near

}  // namespace

// Of a triangle, what a query needs, side by side in memory.
struct ContactShape::Facet {
  Vec3 a, ab, ac, normal;
  Vec3 centre;
  double radius;
  double g00, g01, g11;  // inverse of the Gram matrix of ab and ac; zero where the triangle has no area
  Index triangle;
};

namespace {

using Facet = ContactShape::Facet;

Facet makeFacet(const TriangleMesh& mesh, Index t) {
  const Triangle& corners = mesh.triangles[t];
  Facet f;
  f.a = mesh.vertices[corners[0]];
  f.ab = mesh.vertices[corners[1]] - f.a;
  f.ac = mesh.vertices[corners[2]] - f.a;
  f.normal = f.ab.cross(f.ac).normalized();
  f.centre = f.a + (f.ab + f.ac) / 3.0;
  f.radius = std::sqrt(std::max(
      {(f.a - f.centre).squaredNorm(), (f.a + f.ab - f.centre).squaredNorm(), (f.a + f.ac - f.centre).squaredNorm()}));
  const double aa = f.ab.squaredNorm(), bb = f.ac.squaredNorm(), ab = f.ab.dot(f.ac);
  const double det = aa * bb - ab * ab;
  const double inverse = det > kFlat * aa * bb ? 1.0 / det : 0.0;
  f.g00 = bb * inverse;
  f.g01 = -ab * inverse;
  f.g11 = aa * inverse;
  f.triangle = t;
  return f;
}

double meanEdgeOf(const TriangleMesh& mesh) {
  double sum = 0.0;
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) sum += (mesh.vertices[t[k]] - mesh.vertices[t[(k + 1) % 3]]).norm();
  return mesh.triangles.empty() ? 0.0 : sum / (3.0 * static_cast<double>(mesh.triangles.size()));
}

double distanceToTriangle(const TriangleMesh& mesh, Index t, const Vec3& p) {
  const Triangle& c = mesh.triangles[t];
  return (nearestOnTriangle(p, mesh.vertices[c[0]], mesh.vertices[c[1]], mesh.vertices[c[2]]) - p).norm();
}

Box boundsOf(const TriangleMesh& mesh, Index t) {
  Box box;
  for (Index corner : mesh.triangles[t]) box.extend(mesh.vertices[corner]);
  return box;
}

// Entry of a line into the front of a triangle; time in units of the direction, false where it misses.
bool meets(const TriangleMesh& mesh, Index t, const Vec3& from, const Vec3& direction, double& time,
           std::array<double, 3>& weights) {
  const Triangle& c = mesh.triangles[t];
  const Vec3& a = mesh.vertices[c[0]];
  const Vec3 ab = mesh.vertices[c[1]] - a, ac = mesh.vertices[c[2]] - a;
  const Vec3 h = direction.cross(ac);
  const double det = ab.dot(h);
  if (!(std::abs(det) > 1e-14 * ab.norm() * ac.norm() * direction.norm())) return false;
  const Vec3 s = from - a;
  const double u = s.dot(h) / det;
  const Vec3 q = s.cross(ab);
  const double v = direction.dot(q) / det;
  constexpr double kSlack = 1e-9;  // so that no path slips between two triangles
  if (!(u >= -kSlack) || !(v >= -kSlack) || !(u + v <= 1.0 + kSlack)) return false;
  time = ac.dot(q) / det;
  weights = {1.0 - u - v, u, v};
  return true;
}

}  // namespace

namespace {

// Whether what a sphere holds, a centre and a radius, can be so near to a point.
bool isWithin(const std::array<float, 4>& sphere, const Eigen::Vector3f& p, float by) {
  const float x = p.x() - sphere[0], y = p.y() - sphere[1], z = p.z() - sphere[2], reach = by + sphere[3];
  return !(x * x + y * y + z * z > reach * reach);
}

}  // namespace

struct ContactShape::Cell {
  std::vector<Index> triangles;
};

ContactShape::ContactShape(const TriangleMesh& surface, const SurfaceRows& rows, double spacing)
    : surface_(surface), rows_(rows) {
  for (const Vec3& p : surface_.vertices) bounds_.extend(p);
  if (bounds_.empty()) return;
  size_ = (bounds_.max - bounds_.min).minCoeff();
  if (rows_.riders && !rows_.riders->empty()) {
    rider_of_.assign(surface_.vertices.size(), kNoIndex);
    for (Index r = 0; r < rows_.riders->size(); ++r) rider_of_[(*rows_.riders)[r]] = r;
  }
  facets_.reserve(surface_.triangles.size());
  for (Index t = 0; t < surface_.triangles.size(); ++t) facets_.push_back(makeFacet(surface_, t));
  binTriangles();
  chooseSamples(spacing);
  measureThickness();
  if (surface_.triangles.empty()) return;

  const Vec3 extent = bounds_.max - bounds_.min;
  cell_edge_ = kCellEdges * mean_edge_;
  const double padded = (extent.array() + 4.0 * cell_edge_).prod();
  cell_edge_ = std::max(cell_edge_, std::cbrt(padded / kMostCells));
  if (!(cell_edge_ > 0.0) || !std::isfinite(cell_edge_)) return;
  cells_per_metre_ = 1.0 / cell_edge_;
  cell_origin_ = bounds_.min.array() - 2.0 * cell_edge_;
  cell_total_ = 1;
  for (int d = 0; d < 3; ++d) {
    cells_count_[d] = static_cast<int>(std::ceil(extent[d] * cells_per_metre_)) + 4;
    cell_total_ *= static_cast<std::size_t>(cells_count_[d]);
  }
  cells_ = std::make_unique<std::atomic<std::uintptr_t>[]>(cell_total_);
  distances_ = std::make_unique<std::atomic<float>[]>(cell_total_);
  for (std::size_t i = 0; i < cell_total_; ++i)
    distances_[i].store(std::numeric_limits<float>::quiet_NaN(), std::memory_order_relaxed);
}

ContactShape::~ContactShape() {
  for (std::size_t i = 0; i < cell_total_; ++i)
    if (const std::uintptr_t cell = cells_[i].load(std::memory_order_relaxed); cell > kAsked)
      delete reinterpret_cast<const Cell*>(cell);
}

std::size_t ContactShape::bytes() const {
  return sizeof *this + bytesOf(surface_.vertices, surface_.triangles, surface_.patches, facets_, rider_of_, samples_) +
         bytesOf(bin_offsets_, bin_triangles_, bin_spheres_) +
         cell_total_ * (sizeof(std::atomic<std::uintptr_t>) + sizeof(std::atomic<float>)) +
         cell_bytes_.load(std::memory_order_relaxed);
}

void ContactShape::binTriangles() {
  const Vec3 extent = bounds_.max - bounds_.min;
  mean_edge_ = meanEdgeOf(surface_);
  bin_edge_ = kBinEdges * mean_edge_;
  bin_edge_ = std::max(bin_edge_, std::cbrt((extent.array() + 2.0 * bin_edge_).prod() / kMostBins));
  if (!(bin_edge_ > 0.0) || !std::isfinite(bin_edge_)) bin_edge_ = 1.0;
  bin_origin_ = bounds_.min.array() - 0.5 * bin_edge_;
  std::size_t total = 1;
  for (int d = 0; d < 3; ++d) {
    bins_[d] = std::max(1, static_cast<int>(std::ceil(extent[d] / bin_edge_)) + 1);
    total *= static_cast<std::size_t>(bins_[d]);
  }
  bin_offsets_.assign(total + 1, 0);
  const auto forBins = [this](Index t, const auto& visit) {
    const Box box = boundsOf(surface_, t);
    std::array<int, 3> first, last;
    for (int d = 0; d < 3; ++d) {
      first[d] = std::clamp(static_cast<int>((box.min[d] - bin_origin_[d]) / bin_edge_), 0, bins_[d] - 1);
      last[d] = std::clamp(static_cast<int>((box.max[d] - bin_origin_[d]) / bin_edge_), 0, bins_[d] - 1);
    }
    for (int x = first[0]; x <= last[0]; ++x)
      for (int y = first[1]; y <= last[1]; ++y)
        for (int z = first[2]; z <= last[2]; ++z) visit((static_cast<std::size_t>(x) * bins_[1] + y) * bins_[2] + z);
  };
  for (Index t = 0; t < surface_.triangles.size(); ++t)
    forBins(t, [this](std::size_t bin) { ++bin_offsets_[bin + 1]; });
  for (std::size_t i = 0; i < total; ++i) bin_offsets_[i + 1] += bin_offsets_[i];
  bin_triangles_.resize(bin_offsets_.back());
  std::vector<Index> next(bin_offsets_.begin(), bin_offsets_.end() - 1);
  for (Index t = 0; t < surface_.triangles.size(); ++t)
    forBins(t, [&](std::size_t bin) { bin_triangles_[next[bin]++] = t; });
  const double rounding = kSphereRounding * (extent.norm() + bin_edge_);
  bin_spheres_.reserve(bin_triangles_.size());
  for (const Index t : bin_triangles_) {
    const Facet& f = facets_[t];
    const Eigen::Vector3f centre = (f.centre - bin_origin_).cast<float>();
    bin_spheres_.push_back({centre.x(), centre.y(), centre.z(), static_cast<float>(f.radius + rounding)});
  }
}

// visit(k) for the places in bin_triangles_ of the bins that a box touches.
template <class Visit>
void ContactShape::visitBins(const Box& box, const Visit& visit) const {
  std::array<int, 3> first, last;
  for (int d = 0; d < 3; ++d) {
    const double low = (box.min[d] - bin_origin_[d]) / bin_edge_, high = (box.max[d] - bin_origin_[d]) / bin_edge_;
    if (!(high >= 0.0) || !(low <= bins_[d])) return;
    first[d] = low > 0.0 ? std::min(static_cast<int>(low), bins_[d] - 1) : 0;
    last[d] = high < bins_[d] ? static_cast<int>(high) : bins_[d] - 1;
  }
  for (int x = first[0]; x <= last[0]; ++x)
    for (int y = first[1]; y <= last[1]; ++y)
      for (int z = first[2]; z <= last[2]; ++z) {
        const std::size_t bin = (static_cast<std::size_t>(x) * bins_[1] + y) * bins_[2] + z;
        for (Index k = bin_offsets_[bin]; k < bin_offsets_[bin + 1]; ++k) visit(k);
      }
}

// The triangles of which one can be nearest to some point of the cell: those whose distance to the cell's box is not
// above the least, over triangles, of the farthest that a point of the box can be from it (at a corner: distance to a
// convex set is convex).
const ContactShape::Cell* ContactShape::fill(std::size_t index, const std::array<int, 3>& at) const {
  Box box;
  box.min = cell_origin_ + cell_edge_ * Vec3(at[0], at[1], at[2]);
  box.max = box.min.array() + cell_edge_;
  const Vec3 centre = 0.5 * (box.min + box.max);
  const double half_diagonal = 0.5 * box.diagonal();

  auto cell = std::make_unique<Cell>();
  std::vector<Index> around;
  std::vector<std::pair<double, Index>> near;  // by their distance from the centre
  double nearest = std::numeric_limits<double>::infinity();
  // Rings of bins until what lies beyond cannot be nearer.
  const double farthest = (bounds_.max - bounds_.min).norm() + 8.0 * cell_edge_;
  for (double radius = std::max(bin_edge_, 2.0 * half_diagonal);; radius *= 2.0) {
    around.clear();
    near.clear();
    Box ball;
    ball.min = centre.array() - radius;
    ball.max = centre.array() + radius;
    visitBins(ball, [&](Index k) { around.push_back(bin_triangles_[k]); });
    std::sort(around.begin(), around.end());
    around.erase(std::unique(around.begin(), around.end()), around.end());
    for (Index t : around) {
      const Facet& f = facets_[t];
      if ((centre - f.centre).norm() - f.radius > nearest + 2.0 * half_diagonal) continue;
      near.push_back({distanceToTriangle(surface_, t, centre), t});
      nearest = std::min(nearest, near.back().first);
    }
    if (nearest + 2.0 * half_diagonal <= radius || radius > farthest) break;
  }
  // Nearest first: the others are then dismissed by their bounds.
  std::sort(near.begin(), near.end());
  double bound = nearest + half_diagonal;
  for (std::size_t n = 0; n < std::min(kBounding, near.size()); ++n) {
    double worst = 0.0;
    for (int corner = 0; corner < 8 && worst < bound; ++corner) {
      const Vec3 p(corner & 1 ? box.max.x() : box.min.x(), corner & 2 ? box.max.y() : box.min.y(),
                   corner & 4 ? box.max.z() : box.min.z());
      worst = std::max(worst, distanceToTriangle(surface_, near[n].second, p));
    }
    bound = std::min(bound, worst);
  }
  bound *= 1.0 + 1e-9;
  for (const auto& [distance, t] : near) {
    if (distance - half_diagonal > bound) break;
    const Box b = boundsOf(surface_, t);
    const Vec3 gap = (b.min - box.max).cwiseMax(box.min - b.max).cwiseMax(0.0);
    if (gap.norm() <= bound) cell->triangles.push_back(t);
  }
  cell->triangles.shrink_to_fit();
  const std::uintptr_t made = reinterpret_cast<std::uintptr_t>(cell.get());
  std::uintptr_t known = cells_[index].load(std::memory_order_acquire);
  while (known <= kAsked)
    if (cells_[index].compare_exchange_weak(known, made, std::memory_order_acq_rel)) {
      cells_filled_.fetch_add(1, std::memory_order_relaxed);
      cell_bytes_.fetch_add(sizeof(Cell) + bytesOf(cell->triangles), std::memory_order_relaxed);
      return cell.release();
    }
  return reinterpret_cast<const Cell*>(known);
}

namespace {

// What a facet is to a point.
struct Measured {
  double squared = 0.0, over = 0.0;  // [m^2] distance, [m] height over the plane
  std::array<double, 3> weights{};
  bool above = false;
};

Measured measure(const Facet& f, const Vec3& p) {
  Measured m;
  const Vec3 ap = p - f.a;
  m.over = f.normal.dot(ap);
  const double d1 = f.ab.dot(ap), d2 = f.ac.dot(ap);
  const double v = f.g00 * d1 + f.g01 * d2, w = f.g01 * d1 + f.g11 * d2;
  m.above = v >= 0.0 && w >= 0.0 && v + w <= 1.0 && f.g00 > 0.0;
  if (m.above) {
    m.weights = {1.0 - v - w, v, w};
    m.squared = m.over * m.over;
  } else {
    const Vec3 u = nearestWeights(p, f.a, f.a + f.ab, f.a + f.ac);
    m.weights = {u.x(), u.y(), u.z()};
    m.squared = (ap - u.y() * f.ab - u.z() * f.ac).squaredNorm();
    m.above = m.squared <= (1.0 + kOnRim) * m.over * m.over;
  }
  return m;
}

// The nearest so far; where several are as near, settle() decides, whatever order they come in.
struct Best {
  explicit Best(double size) : least_tie(1e-20 * size * size) {}

  double least_tie;  // [m^2]
  double squared = std::numeric_limits<double>::infinity();
  double distance = std::numeric_limits<double>::infinity();
  double height = 0.0;  // over the plane of its triangle
  bool tied = false;

  double tie() const { return kTie * squared + least_tie; }

  void offer(const Facet& f, const Vec3& p, ContactShape::Nearest& found) {
    const double bound = distance + f.radius;
    if ((p - f.centre).squaredNorm() > bound * bound * (1.0 + kTie) + least_tie) return;
    const double over = f.normal.dot(p - f.a);
    if (over * over > squared + tie()) return;
    if (f.triangle == found.triangle) return;
    const Measured m = measure(f, p);
    if (m.squared > squared + tie()) return;
    const bool nearer = m.squared < squared - tie();
    tied = !nearer && std::isfinite(squared);  // not with the infinity that it starts from
    if (!(m.squared < squared)) return;
    squared = m.squared;
    distance = std::sqrt(squared);
    height = over;
    found.triangle = f.triangle;
    found.weights = m.weights;
    found.above = m.above;
  }
};

// At an edge or a corner. The sign is that of the normals about it, weighted by their angles (Baerentzen and Aanaes
// 2005); of the faces on that side the one whose plane is farthest is meant, and of equal ones the first.
class Settler {
 public:
  explicit Settler(const Best& best)
      : limit_(best.squared + 4.0 * best.tie()),
        reach_(std::sqrt(limit_)),
        touches_(best.squared <= 16.0 * best.least_tie) {}

  void offer(const Facet& f, const Vec3& p) {
    const double bound = reach_ + f.radius, over = f.normal.dot(p - f.a);
    if ((p - f.centre).squaredNorm() > bound * bound * (1.0 + kTie) || over * over > limit_ * (1.0 + kTie)) return;
    const Measured m = measure(f, p);
    if (!(m.squared <= limit_)) return;
    for (std::size_t k = 0; k < count_; ++k)
      if (faces_[k].triangle == f.triangle) return;  // bins show a triangle more than once
    for (const Face& face : more_)
      if (face.triangle == f.triangle) return;
    const Vec3 corners[3] = {f.a, f.a + f.ab, f.a + f.ac};
    constexpr double kAt = 1e-9;  // barycentric
    int at = 0;
    double angle = 3.14159265358979323846;
    for (int k = 0; k < 3; ++k) at += m.weights[k] > kAt;
    if (at == 1) {
      const int k = static_cast<int>(std::max_element(m.weights.begin(), m.weights.end()) - m.weights.begin());
      const Vec3 u = (corners[(k + 1) % 3] - corners[k]).normalized(),
                 v = (corners[(k + 2) % 3] - corners[k]).normalized();
      angle = std::acos(std::clamp(u.dot(v), -1.0, 1.0));
    } else if (at == 3) {
      angle *= 2.0;
    }
    normals_ += angle * f.normal;
    angles_ += angle;
    if (f.triangle < first_) {
      first_ = f.triangle;
      away_ = p - (m.weights[0] * corners[0] + m.weights[1] * corners[1] + m.weights[2] * corners[2]);
    }
    if (count_ == faces_.size()) {
      more_.push_back({f.triangle, m.over, m.weights, m.above});
    } else {
      faces_[count_++] = {f.triangle, m.over, m.weights, m.above};
    }
  }

  /// +1 outside, -1 inside.
  double settle(ContactShape::Nearest& found) const {
    // Two lips that lie on each other cancel but for rounding, which the order of the faces would decide.
    const bool inside = normals_.dot(away_) < -kCancelled * angles_ * away_.norm();
    const double sign = !touches_ && inside ? -1.0 : 1.0;
    const Face* best = nullptr;
    const auto better = [&](const Face& a, const Face& b) {
      if (touches_) return a.triangle < b.triangle;  // heights are rounding
      const bool on_side_a = a.over * sign >= 0.0, on_side_b = b.over * sign >= 0.0;
      if (on_side_a != on_side_b) return on_side_a;
      if (std::abs(a.over) != std::abs(b.over)) return std::abs(a.over) > std::abs(b.over);
      return a.triangle < b.triangle;
    };
    for (std::size_t k = 0; k < count_; ++k)
      if (!best || better(faces_[k], *best)) best = &faces_[k];
    for (const Face& face : more_)
      if (better(face, *best)) best = &face;
    if (best) {
      found.triangle = best->triangle;
      found.weights = best->weights;
      found.above = best->above;
    }
    return sign;
  }

 private:
  struct Face {
    Index triangle;
    double over;
    std::array<double, 3> weights;
    bool above;
  };
  static constexpr double kCancelled = 1e-9;
  double limit_, reach_;  // [m^2], [m]
  bool touches_;          // on the surface itself, which is not inside
  Index first_ = kNoIndex;
  Vec3 normals_ = Vec3::Zero(), away_ = Vec3::Zero();
  double angles_ = 0.0;
  std::array<Face, 48> faces_;
  std::vector<Face> more_;  // those of fans, and of lips with many slivers
  std::size_t count_ = 0;
};

}  // namespace

template <class Visit>
void ContactShape::visitNear(const Vec3& rest, double radius, const Visit& visit) const {
  Box box;
  box.min = rest.array() - radius;
  box.max = rest.array() + radius;
  const Eigen::Vector3f p = (rest - bin_origin_).cast<float>();
  const float around = static_cast<float>((1.0 + 10.0 * kSphereRounding) * radius);
  visitBins(box, [&](Index k) {
    if (isWithin(bin_spheres_[k], p, around)) visit(bin_triangles_[k]);
  });
}

// `within` [m]: something is known to be so near; infinite where nothing is known.
bool ContactShape::searchBins(const Vec3& rest, double within, Nearest& found) const {
  found.triangle = kNoIndex;
  const Grid grid{bin_origin_, bin_edge_, bins_};
  const Eigen::Vector3f p = (rest - bin_origin_).cast<float>();
  const double rounding = kSphereRounding * (bounds_.diagonal() + (rest - bin_origin_).norm());
  // A triangle is no farther than its centre: those tell how near the nearest is, before any is measured.
  float least = std::numeric_limits<float>::infinity();  // squared
  Index first_looked_at = kNoIndex;                      // whose centre it is
  const auto lookAtCentres = [&](std::size_t first, std::size_t last) {
    for (Index k = bin_offsets_[first]; k < bin_offsets_[last + 1]; ++k) {
      const std::array<float, 4>& s = bin_spheres_[k];
      const float x = p.x() - s[0], y = p.y() - s[1], z = p.z() - s[2], squared = x * x + y * y + z * z;
      if (squared >= least) continue;
      least = squared;
      first_looked_at = k;
    }
  };
  const auto nearestCentre = [&] { return std::sqrt(static_cast<double>(least)) + rounding; };
  const auto forBinsWithin = [&](double radius, const auto& visit) {
    const std::array<int, 3> low = grid.cellAt(rest.array() - radius), high = grid.cellAt(rest.array() + radius);
    for (int x = low[0]; x <= high[0]; ++x)
      for (int y = low[1]; y <= high[1]; ++y) visit(grid.number(x, y, low[2]), grid.number(x, y, high[2]));
  };
  double most = within;
  if (!std::isfinite(most)) {
    const std::array<int, 3> home = grid.cellAt(rest);
    for (int ring = 0, rings = grid.ringsAround(home); ring <= rings && !std::isfinite(least); ++ring)
      visitRing(grid, home, ring, [&](std::size_t bin) { lookAtCentres(bin, bin); });
    most = nearestCentre();
  }
  forBinsWithin(most + rounding, lookAtCentres);
  Best best(size_);
  const auto search = [&](double distance) {
    best.distance = distance;
    best.squared = distance * distance;
    float bound = INFINITY;
    const auto tighten = [&] { bound = static_cast<float>((1.0 + 10.0 * kSphereRounding) * best.distance); };
    if (first_looked_at != kNoIndex) best.offer(facets_[bin_triangles_[first_looked_at]], rest, found);
    tighten();
    forBinsWithin(best.distance + rounding, [&](std::size_t first, std::size_t last) {
      for (Index k = bin_offsets_[first]; k < bin_offsets_[last + 1]; ++k) {
        if (!isWithin(bin_spheres_[k], p, bound)) continue;
        best.offer(facets_[bin_triangles_[k]], rest, found);
        tighten();
      }
    });
  };
  search(std::min(most, nearestCentre()));
  // Rounding in triangles without area can make what is known too small.
  if (found.triangle == kNoIndex) search(std::numeric_limits<double>::infinity());
  double sign = best.height;
  if (best.tied) {
    Settler settler(best);
    const double around = best.distance + 1e-6 * size_;
    visitNear(rest, around, [&](Index t) { settler.offer(facets_[t], rest); });
    sign = settler.settle(found);
  }
  found.distance = std::copysign(best.distance, sign);
  return found.triangle != kNoIndex;
}

// The cell of a point, or the one at the border that is nearest to it.
std::size_t ContactShape::cellAt(const Vec3& rest, std::array<int, 3>& at) const {
  for (int d = 0; d < 3; ++d) {
    const double c = (rest[d] - cell_origin_[d]) * cells_per_metre_;
    at[d] = c > 0.0 ? (c < cells_count_[d] ? static_cast<int>(c) : cells_count_[d] - 1) : 0;
  }
  return (static_cast<std::size_t>(at[0]) * cells_count_[1] + at[1]) * cells_count_[2] + at[2];
}

bool ContactShape::isBeyondCells(const Vec3& rest) const {
  const Vec3 in_cells = (rest - cell_origin_) * cells_per_metre_;
  for (int d = 0; d < 3; ++d)
    if (!(in_cells[d] >= 0.0 && in_cells[d] < cells_count_[d])) return true;
  return false;
}

const EmptySpace& ContactShape::space() const {
  std::call_once(spaced_, [this] {
    space_ = std::make_unique<EmptySpace>(surface_, kSpaceEdges * mean_edge_);
    cell_bytes_.fetch_add(space_->bytes(), std::memory_order_relaxed);
  });
  return *space_;
}

bool ContactShape::isOutside(const Vec3& rest) const { return cells_ && space().isOutside(rest); }

Vec3 ContactShape::cellCentre(const std::array<int, 3>& at) const {
  return cell_origin_ + cell_edge_ * Vec3(at[0] + 0.5, at[1] + 0.5, at[2] + 0.5);
}

// Whether a triangle is so near to a point.
bool ContactShape::anyWithin(const Vec3& rest, double by) const {
  bool any = false;
  visitNear(rest, by, [&](Index t) { any = any || !(measure(facets_[t], rest).squared > by * by); });
  return any;
}

// [m] signed; whoever else asks finds the same.
float ContactShape::distanceOfCentre(std::size_t index, const std::array<int, 3>& at) const {
  Nearest found;
  const bool any = searchBins(cellCentre(at), std::numeric_limits<double>::infinity(), found);
  const float known = any ? static_cast<float>(found.distance) : -std::numeric_limits<float>::infinity();
  distances_[index].store(known, std::memory_order_relaxed);
  return known;
}

// A cell's centre is worth a search of its own only when the cell was asked about again and again.
bool ContactShape::isClear(const Vec3& rest, double by) const {
  if (!cells_ || !(by >= 0.0) || !rest.allFinite()) return false;
  if (space().around(rest) > by) return true;
  std::array<int, 3> at;
  const std::size_t index = cellAt(rest, at);
  float known = distances_[index].load(std::memory_order_relaxed);
  if (std::isnan(known) || (known >= kAskedOnce && known < kAskedEnough)) {
    distances_[index].store(std::isnan(known) ? kAskedOnce : known + kAskedOnce, std::memory_order_relaxed);
    return space().isOutside(rest) && !anyWithin(rest, by);
  }
  if (known >= kAskedEnough) known = distanceOfCentre(index, at);
  return known - kSphereRounding * std::abs(known) - (rest - cellCentre(at)).norm() > by;
}

double ContactShape::distanceTo(Index triangle, const Vec3& rest) const {
  const Facet& f = facets_[triangle];
  return std::max(std::sqrt(measure(f, rest).squared), (rest - f.centre).norm() - f.radius);
}

bool ContactShape::nearest(const Vec3& rest, Nearest& found, Index hint) const {
  found.triangle = kNoIndex;
  if (!cells_ || !rest.allFinite()) return false;
  std::array<int, 3> at;
  const std::size_t index = cellAt(rest, at);
  const std::uintptr_t known = cells_[index].load(std::memory_order_acquire);
  // A cell at the border does not know what is nearest beyond it: an answer from it would depend on who has asked
  // before.
  const bool beyond = isBeyondCells(rest);
  if (known < kAsked || beyond) {
    std::uintptr_t asked = known;
    if (!beyond) cells_[index].compare_exchange_strong(asked, known + 1, std::memory_order_acq_rel);
    const double centre = distances_[index].load(std::memory_order_relaxed);
    const Vec3 from = rest - cellCentre(at);
    double most = hint == kNoIndex ? std::numeric_limits<double>::infinity() : distanceTo(hint, rest);
    if (std::abs(centre) < kAskedOnce) most = std::min(most, std::abs(centre) + from.norm());
    const double within = (1.0 + 1e-6) * most + 1e-9 * size_;
    if (!searchBins(rest, std::isfinite(within) ? within : std::numeric_limits<double>::infinity(), found))
      return false;
    if (isMistaken(rest, found)) found.distance = -found.distance;
    return true;
  }
  const Cell* cell = known > kAsked ? reinterpret_cast<const Cell*>(known) : fill(index, at);
  Best best(size_);
  for (const Index t : cell->triangles) best.offer(facets_[t], rest, found);
  double sign = best.height;
  if (best.tied) {
    Settler settler(best);
    for (const Index t : cell->triangles) settler.offer(facets_[t], rest);
    sign = settler.settle(found);
  }
  found.distance = std::copysign(best.distance, sign);
  if (isMistaken(rest, found)) found.distance = -found.distance;
  return found.triangle != kNoIndex;
}

// Inside, though the point is in the empty space outside: at the tip of a thin rim, where the surface crosses itself,
// the sign of a corner can be wrong.
bool ContactShape::isMistaken(const Vec3& rest, const Nearest& found) const {
  return found.distance < 0.0 && isOutside(rest);
}

bool ContactShape::nearest(const Vec3& rest, const Vec3& inward, double slack, double reach, Nearest& found,
                           Index hint) const {
  if (!nearest(rest, found, hint)) return false;
  if (std::abs(found.distance) > slack || found.distance > reach) return true;
  if (facets_[found.triangle].normal.dot(inward) > kFacing) return true;
  double best = slack + std::abs(found.distance);
  Nearest other;
  visitNear(rest, best, [&](Index t) {
    const Facet& f = facets_[t];
    if (!(f.normal.dot(inward) > kFacing)) return;
    const Vec3 ap = rest - f.a;
    const double height = f.normal.dot(ap), bound = best + f.radius;
    if (std::abs(height) > best || (rest - f.centre).squaredNorm() > bound * bound * (1.0 + kTie)) return;
    const Vec3 u = nearestWeights(rest, f.a, f.a + f.ab, f.a + f.ac);
    const double distance = (ap - u.y() * f.ab - u.z() * f.ac).norm();
    // One of its own plane's: a face round the corner is farther than its plane is.
    if (!(distance < best) || std::abs(height) < 0.99 * distance - 1e-9 * size_) return;
    if (distance == best && t > other.triangle) return;
    best = distance;
    other.triangle = t;
    other.weights = {u.x(), u.y(), u.z()};
    other.distance = std::copysign(distance, height);
    other.above = true;
  });
  // Outside of that face the point does not touch; inside of it the sign is its own.
  if (other.triangle != kNoIndex && other.distance <= 0.0) found = other;
  return true;
}

// Edges by their lower vertex, and of each those with the same upper one.
void ContactShape::link() const {
  std::call_once(linked_, [this] {
    struct Edge {
      Index high, triangle;
      int corner;
    };
    const auto forEdges = [this](const auto& visit) {
      for (Index t = 0; t < surface_.triangles.size(); ++t)
        for (int k = 0; k < 3; ++k) {
          const Index a = surface_.triangles[t][(k + 1) % 3], b = surface_.triangles[t][(k + 2) % 3];
          visit(std::min(a, b), Edge{std::max(a, b), t, k});
        }
    };
    std::vector<Index> offsets(surface_.vertices.size() + 1, 0);
    forEdges([&](Index low, const Edge&) { ++offsets[low + 1]; });
    for (std::size_t v = 0; v + 1 < offsets.size(); ++v) offsets[v + 1] += offsets[v];
    std::vector<Edge> edges(offsets.back());
    std::vector<Index> next(offsets.begin(), offsets.end() - 1);
    forEdges([&](Index low, const Edge& edge) { edges[next[low]++] = edge; });
    across_.assign(surface_.triangles.size(), {kNoIndex, kNoIndex, kNoIndex});
    bends_.resize(surface_.triangles.size());
    for (std::size_t v = 0; v + 1 < offsets.size(); ++v) {
      const auto first = edges.begin() + offsets[v], end = edges.begin() + offsets[v + 1];
      std::stable_sort(first, end, [](const Edge& p, const Edge& q) { return p.high < q.high; });
      for (auto e = first; e != end && e + 1 != end; ++e) {
        const auto f = e + 1;
        if (e->high != f->high) continue;
        across_[e->triangle][e->corner] = f->triangle;
        across_[f->triangle][f->corner] = e->triangle;
      }
    }
    for (Index t = 0; t < surface_.triangles.size(); ++t)
      for (int k = 0; k < 3; ++k) bends_[t][k] = bendAt(t, k);
    cell_bytes_.fetch_add(bytesOf(across_, bends_), std::memory_order_relaxed);
  });
}

Index ContactShape::across(Index triangle, int corner) const {
  link();
  return across_[triangle][corner];
}

ContactShape::Bend ContactShape::bend(Index triangle, int corner) const {
  link();
  return bends_[triangle][corner];
}

ContactShape::Bend ContactShape::bendAt(Index triangle, int corner) const {
  const Index other = across_[triangle][corner];
  if (other == kNoIndex) return Bend::kBorder;
  const Facet &f = facets_[triangle], &g = facets_[other];
  const double cosine = f.normal.dot(g.normal);
  if (cosine > kFlatEdge) return Bend::kFlat;
  if (cosine > kGentleEdge) return Bend::kGentle;
  return f.normal.dot(g.centre - f.a) < 0.0 ? Bend::kRidge : Bend::kValley;
}

// How far it is from a point on the surface to the other side.
double ContactShape::depthAlong(const Vec3& from, const Vec3& direction, double longest) const {
  double depth = longest;
  Box box;
  box.extend(from);
  box.extend(from + longest * direction);
  visitBins(box, [&](Index k) {
    const Index t = bin_triangles_[k];
    const Vec3 to = facets_[t].centre - from;
    const double along = to.dot(direction), reach = 1.01 * facets_[t].radius;
    if (along - reach > depth || to.squaredNorm() - along * along > reach * reach) return;  // the ray passes it by
    double time;
    std::array<double, 3> weights;
    if (meets(surface_, t, from, direction, time, weights) && time > 1e-6 * longest && time < depth) depth = time;
  });
  return depth;
}

void ContactShape::measureThickness() {
  thickness_ = size_;
  const double longest = (bounds_.max - bounds_.min).norm();
  const std::size_t count = surface_.triangles.size();
  const std::size_t stride = std::max<std::size_t>(1, count / kThicknessRays);
  std::vector<double> depths;
  for (std::size_t t = 0; t < count; t += stride) {
    const Triangle& c = surface_.triangles[t];
    const Vec3 &p = surface_.vertices[c[0]], &q = surface_.vertices[c[1]], &r = surface_.vertices[c[2]];
    const Vec3 normal = (q - p).cross(r - p).normalized();
    const double depth = depthAlong((p + q + r) / 3.0, -normal, longest);
    if (depth < longest) depths.push_back(depth);
  }
  if (depths.empty()) return;
  // Near edges rays are short however thick the body is: the middle one says how thick it is on the whole.
  std::sort(depths.begin(), depths.end());
  thickness_ = depths[depths.size() / 2];
}

void ContactShape::chooseSamples(double spacing) {
  const Points& vertices = surface_.vertices;
  // Riders within most of a spacing of a sample are left out: the surface between the particles is smooth.
  std::vector<bool> chosen(vertices.size(), true);
  if (!rider_of_.empty() && spacing > 0.0) {
    const double apart = 0.9 * spacing, edge = apart;
    std::unordered_map<std::uint64_t, std::vector<Index>> grid;
    const auto key = [&](int x, int y, int z) {
      return (static_cast<std::uint64_t>(x + 2) << 42) ^ (static_cast<std::uint64_t>(y + 2) << 21) ^
             static_cast<std::uint64_t>(z + 2);
    };
    const auto place = [&](Index v) {
      std::array<int, 3> cell{};
      for (int d = 0; d < 3; ++d) {
        const double c = (vertices[v][d] - bounds_.min[d]) / edge;
        cell[d] = c > 0.0 ? static_cast<int>(std::min(c, kMostPlaces)) : 0;
      }
      return cell;
    };
    for (int pass = 0; pass < 2; ++pass)  // particles first
      for (Index v = 0; v < vertices.size(); ++v) {
        if ((rider_of_[v] == kNoIndex) != (pass == 0)) continue;
        const std::array<int, 3> c = place(v);
        bool free = true;
        if (pass == 1)
          for (int x = -1; free && x <= 1; ++x)
            for (int y = -1; free && y <= 1; ++y)
              for (int z = -1; free && z <= 1; ++z) {
                const auto found = grid.find(key(c[0] + x, c[1] + y, c[2] + z));
                if (found == grid.end()) continue;
                for (Index other : found->second)
                  if ((vertices[other] - vertices[v]).squaredNorm() < apart * apart) {
                    free = false;
                    break;
                  }
              }
        chosen[v] = free;
        if (free) grid[key(c[0], c[1], c[2])].push_back(v);
      }
  }
  std::vector<bool> used(vertices.size(), surface_.triangles.empty());
  Points normals(vertices.size(), Vec3::Zero());
  for (const Triangle& t : surface_.triangles)
    for (int k = 0; k < 3; ++k) {
      const Vec3 &p = vertices[t[k]], &q = vertices[t[(k + 1) % 3]], &r = vertices[t[(k + 2) % 3]];
      // By the angle, so that it does not matter how faces are divided into triangles.
      const Vec3 pq = (q - p).normalized(), pr = (r - p).normalized();
      normals[t[k]] += std::acos(std::clamp(pq.dot(pr), -1.0, 1.0)) * pq.cross(pr).normalized();
      used[t[k]] = true;
    }
  for (Index v = 0; v < vertices.size(); ++v)
    if (chosen[v] && used[v]) samples_.push_back({{v, v}, 0.0, normals[v].normalized()});

  const double least = kLongEdge * size_;
  struct Edge {
    Index low, high;
    Vec3 normal;
  };
  std::vector<Edge> edges;
  for (const Triangle& t : surface_.triangles) {
    const Vec3 normal = (vertices[t[1]] - vertices[t[0]]).cross(vertices[t[2]] - vertices[t[0]]).normalized();
    for (int k = 0; k < 3; ++k) {
      const Index a = t[k], b = t[(k + 1) % 3];
      if ((vertices[a] - vertices[b]).norm() > least) edges.push_back({std::min(a, b), std::max(a, b), normal});
    }
  }
  std::stable_sort(edges.begin(), edges.end(),
                   [](const Edge& p, const Edge& q) { return p.low != q.low ? p.low < q.low : p.high < q.high; });
  const double longest = (bounds_.max - bounds_.min).norm();
  for (std::size_t k = 0; k + 1 < edges.size(); ++k) {
    const Edge &e = edges[k], &f = edges[k + 1];
    if (e.low != f.low || e.high != f.high || e.normal.dot(f.normal) > kFlatEdge) continue;
    const Vec3 &p = vertices[e.low], &q = vertices[e.high];
    const Vec3 inwards = -(e.normal + f.normal).normalized();
    const double half = 0.5 * depthAlong(0.5 * (p + q), inwards, longest);
    const double length = (q - p).norm();
    const int parts = std::min(kMostEdgeSamples, static_cast<int>(std::ceil(0.999 * length / half)));
    for (int n = 1; n < parts; ++n) samples_.push_back({{e.low, e.high}, static_cast<double>(n) / parts, -inwards});
  }
}

}  // namespace meshless
