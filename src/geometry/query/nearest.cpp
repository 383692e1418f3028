#include "meshless_surgery/geometry/query/nearest.h"

#include <algorithm>
#include <array>

#include <nanoflann.hpp>

namespace meshless {
namespace {

struct Cloud {
  Points points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const { return points[i][static_cast<Eigen::Index>(axis)]; }
  template <class BoundingBox>
  bool kdtree_get_bbox(BoundingBox&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Cloud>, Cloud, 3, Index>;

constexpr std::size_t kFew = 32;       // are kept on the stack
constexpr std::size_t kScanned = 200;  // clouds no larger are looked at point by point: a tree takes longer

/// The `count` nearest, in order.
void scan(const Points& points, const Vec3& p, std::size_t count, Index* indices, double* squared) {
  std::size_t found = 0;
  for (Index i = 0; i < points.size(); ++i) {
    const double here = (points[i] - p).squaredNorm();
    if (found == count && !(here < squared[count - 1])) continue;
    std::size_t k = found < count ? found++ : count - 1;
    for (; k > 0 && here < squared[k - 1]; --k) {
      squared[k] = squared[k - 1];
      indices[k] = indices[k - 1];
    }
    squared[k] = here;
    indices[k] = i;
  }
}

}  // namespace

struct NearestPoints::Data {
  explicit Data(Points points)
      : cloud{std::move(points)}, tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(12)) {
    if (cloud.points.size() > 0) tree.buildIndex();
  }
  Cloud cloud;
  Tree tree;
};

NearestPoints::NearestPoints(Points points) : data_(std::make_unique<Data>(std::move(points))) {}
NearestPoints::~NearestPoints() = default;
NearestPoints::NearestPoints(NearestPoints&&) noexcept = default;
NearestPoints& NearestPoints::operator=(NearestPoints&&) noexcept = default;

Index NearestPoints::nearest(const Vec3& p) const {
  Index found = kNoIndex;
  nearest(p, 1, &found);
  return found;
}

std::vector<Index> NearestPoints::nearest(const Vec3& p, std::size_t count) const {
  std::vector<Index> found(std::min(count, data_->cloud.points.size()));
  nearest(p, count, found.data());
  return found;
}

std::size_t NearestPoints::nearest(const Vec3& p, std::size_t count, Index* found) const {
  const Points& points = data_->cloud.points;
  count = std::min(count, points.size());
  if (count == 0) return 0;
  // One more than asked for: a tie at the border is then seen and settled by index.
  const std::size_t asked = std::min(count + 1, points.size());
  std::array<Index, kFew> few_indices;
  std::array<double, kFew> few_squared;
  std::vector<Index> many_indices(asked > kFew ? asked : 0);
  std::vector<double> many_squared(asked > kFew ? asked : 0);
  Index* indices = asked > kFew ? many_indices.data() : few_indices.data();
  double* squared = asked > kFew ? many_squared.data() : few_squared.data();
  if (points.size() <= kScanned) {
    scan(points, p, asked, indices, squared);
  } else {
    nanoflann::KNNResultSet<double, Index> result(asked);
    result.init(indices, squared);
    data_->tree.findNeighbors(result, p.data(), nanoflann::SearchParams());
    // In the order of their distances already, but for ties.
    for (std::size_t k = 1; k < asked; ++k)
      for (std::size_t i = k; i > 0 && squared[i] == squared[i - 1] && indices[i] < indices[i - 1]; --i)
        std::swap(indices[i], indices[i - 1]);
  }
  std::copy(indices, indices + count, found);
  return count;
}

std::vector<Index> NearestPoints::within(const Vec3& p, double radius) const {
  std::vector<Index> found;
  if (data_->cloud.points.empty()) return found;
  std::vector<std::pair<Index, double>> matches;
  data_->tree.radiusSearch(p.data(), radius * radius, matches, nanoflann::SearchParams());
  for (const auto& m : matches) found.push_back(m.first);
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace meshless
