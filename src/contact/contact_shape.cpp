#include "meshless_surgery/contact/contact_shape.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "contact_bins.h"
#include "contact_facet.h"
#include "empty_space.h"
#include "meshless_surgery/base/bytes.h"
#include "meshless_surgery/geometry/nearest_on_triangle.h"

namespace meshless {
namespace {

constexpr double kBinEdges = 3.0;    // size of a bin in mean edges
constexpr double kCellEdges = 0.5;   // size of a cell in mean edges
constexpr double kSpaceEdges = 1.5;  // size of a cell of empty space in mean edges
constexpr double kMostBins = 1 << 18;
constexpr double kMostCells = 1 << 19;
constexpr double kUsualCrowd = 50.0;      // triangles of a bin, for one of them
constexpr double kFacing = 0.1;           // cosine: a face pushes a body's point into the body
constexpr std::size_t kBounding = 4;      // triangles that tell how far the nearest to a point of a cell can be
constexpr std::uintptr_t kAsked = 12;     // times that the bins are searched before a cell is filled
constexpr double kSphereRounding = 1e-6;  // relative, of what is kept in single precision
constexpr double kFlat = 1e-12;           // squared sine of a corner: below, a triangle has no area but by rounding
constexpr float kAskedOnce = 1e30F;       // more than any distance; a cell that was asked about n times has n of them
constexpr float kAskedEnough = 4.0F * kAskedOnce;

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
  const Vec3 bc = f.ac - f.ab;
  const Vec3 longest = bb >= aa && bb >= bc.squaredNorm() ? f.ac : aa >= bc.squaredNorm() ? f.ab : bc;
  f.across = det > kFlat * aa * bb ? f.normal.cross(longest).normalized() : Vec3::Zero();
  f.low = std::min({0.0, f.across.dot(f.ab), f.across.dot(f.ac)});
  f.high = std::max({0.0, f.across.dot(f.ab), f.across.dot(f.ac)});
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
  if (rows_.embedded && !rows_.embedded->empty()) {
    embedded_of_.assign(surface_.vertices.size(), kNoIndex);
    for (Index r = 0; r < rows_.embedded->size(); ++r) embedded_of_[(*rows_.embedded)[r]] = r;
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
  return sizeof *this +
         bytesOf(surface_.vertices, surface_.triangles, surface_.patches, facets_, embedded_of_, samples_) +
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
  double squares = 0.0;
  for (std::size_t i = 0; i < total; ++i) squares += std::pow(bin_offsets_[i + 1] - bin_offsets_[i], 2);
  if (!bin_triangles_.empty())
    crowding_ = std::max(1.0, squares / static_cast<double>(bin_triangles_.size()) / kUsualCrowd);
  const double rounding = kSphereRounding * (extent.norm() + bin_edge_);
  bin_spheres_.reserve(bin_triangles_.size());
  for (const Index t : bin_triangles_) {
    const Facet& f = facets_[t];
    const Eigen::Vector3f centre = (f.centre - bin_origin_).cast<float>();
    bin_spheres_.push_back({centre.x(), centre.y(), centre.z(), static_cast<float>(f.radius + rounding)});
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
  Index first_searched = kNoIndex;                       // whose centre it is
  const auto searchCentres = [&](std::size_t first, std::size_t last) {
    for (Index k = bin_offsets_[first]; k < bin_offsets_[last + 1]; ++k) {
      const std::array<float, 4>& s = bin_spheres_[k];
      const float x = p.x() - s[0], y = p.y() - s[1], z = p.z() - s[2], squared = x * x + y * y + z * z;
      if (squared >= least) continue;
      least = squared;
      first_searched = k;
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
      visitRing(grid, home, ring, [&](std::size_t bin) { searchCentres(bin, bin); });
    most = nearestCentre();
  }
  forBinsWithin(most + rounding, searchCentres);
  Best best(size_);
  const auto search = [&](double distance) {
    best.distance = distance;
    best.squared = distance * distance;
    float bound = INFINITY;
    const auto tighten = [&] { bound = static_cast<float>((1.0 + 10.0 * kSphereRounding) * best.distance); };
    if (first_searched != kNoIndex) best.offer(facets_[bin_triangles_[first_searched]], rest, found);
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

}  // namespace meshless
