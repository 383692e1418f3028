#include "meshless_surgery/geometry/nearest.h"

#include <algorithm>

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
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Cloud>, Cloud, 3, std::size_t>;

}  // namespace

struct NearestPoints::Data {
  explicit Data(Points points)
      : cloud{std::move(points)}, tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(12)) {
    if (!cloud.points.empty()) tree.buildIndex();
  }
  Cloud cloud;
  Tree tree;
};

NearestPoints::NearestPoints(Points points) : data_(std::make_unique<Data>(std::move(points))) {}
NearestPoints::~NearestPoints() = default;
NearestPoints::NearestPoints(NearestPoints&&) noexcept = default;
NearestPoints& NearestPoints::operator=(NearestPoints&&) noexcept = default;

Index NearestPoints::nearest(const Vec3& p) const {
  const std::vector<Index> found = nearest(p, 1);
  return found.empty() ? kNoIndex : found[0];
}

std::vector<Index> NearestPoints::nearest(const Vec3& p, std::size_t count) const {
  count = std::min(count, data_->cloud.points.size());
  if (count == 0) return {};
  // One more than asked for: a tie at the border is then seen and settled by index.
  const std::size_t asked = std::min(count + 1, data_->cloud.points.size());
  std::vector<std::size_t> indices(asked);
  std::vector<double> squared(asked);
  nanoflann::KNNResultSet<double, std::size_t> result(asked);
  result.init(indices.data(), squared.data());
  data_->tree.findNeighbors(result, p.data(), nanoflann::SearchParams());
  std::vector<std::pair<double, Index>> order;
  for (std::size_t k = 0; k < result.size(); ++k) order.emplace_back(squared[k], static_cast<Index>(indices[k]));
  std::sort(order.begin(), order.end());
  std::vector<Index> found;
  for (std::size_t k = 0; k < std::min(count, order.size()); ++k) found.push_back(order[k].second);
  return found;
}

std::vector<Index> NearestPoints::within(const Vec3& p, double radius) const {
  std::vector<Index> found;
  if (data_->cloud.points.empty()) return found;
  std::vector<std::pair<std::size_t, double>> matches;
  data_->tree.radiusSearch(p.data(), radius * radius, matches, nanoflann::SearchParams());
  for (const auto& m : matches) found.push_back(static_cast<Index>(m.first));
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace meshless
