#include "cluster_markers.h"

#include <cmath>

#include "convert.h"
#include "marker.h"

namespace meshless {
namespace {

using visualization_msgs::Marker;

constexpr double kCentre = 0.3;           // diameter in particle spacings
constexpr double kClusterLine = 0.04;     // width in particle spacings
constexpr double kGoldenTurn = 0.618034;  // of the hues: neighbours in the list differ

std_msgs::ColorRGBA hue(Index number) {
  const double turn = 2.0 * M_PI * std::fmod(kGoldenTurn * static_cast<double>(number), 1.0);
  std_msgs::ColorRGBA color;
  color.r = static_cast<float>(0.55 + 0.45 * std::cos(turn));
  color.g = static_cast<float>(0.55 + 0.45 * std::cos(turn - 2.0 * M_PI / 3.0));
  color.b = static_cast<float>(0.55 + 0.45 * std::cos(turn + 2.0 * M_PI / 3.0));
  color.a = 1.0f;
  return color;
}

// Clusters, or the cells where there are none.
ClusterSet groupsOf(const BodyModel& model) {
  if (model.clusters.size() > 0) return model.clusters;
  ClusterSet cells;
  cells.offsets.push_back(0);
  for (const LatticeCell& cell : model.lattice->cells) {
    cells.members.insert(cells.members.end(), cell.corners.begin(), cell.corners.end());
    cells.offsets.push_back(static_cast<Index>(cells.members.size()));
  }
  cells.weights.assign(cells.members.size(), 1.0);
  return cells;
}

}  // namespace

visualization_msgs::MarkerArray clusterMarkers(const WorldSnapshot& snapshot, const std_msgs::Header& header) {
  visualization_msgs::MarkerArray array;
  array.markers.push_back(deleteAllMarkers(header));
  for (const BodySnapshot& body : snapshot.bodies) {
    const ClusterSet clusters = groupsOf(*body.model);
    const int id = static_cast<int>(body.number);
    Marker centres = newMarker(header, "centres", id, Marker::SPHERE_LIST);
    centres.scale.x = centres.scale.y = centres.scale.z = kCentre * body.model->spacing;
    Marker members = newMarker(header, "members", id, Marker::LINE_LIST);
    members.scale.x = kClusterLine * body.model->spacing;
    for (Index c = 0; c < clusters.size(); ++c) {
      Vec3 centre = Vec3::Zero();
      double mass = 0.0;
      for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k) {
        const double share = clusters.weights[k] * body.model->masses[clusters.members[k]];
        centre += share * body.particles[clusters.members[k]];
        mass += share;
      }
      centre /= mass;
      const std_msgs::ColorRGBA color = hue(c);
      centres.points.push_back(toPoint(centre));
      centres.colors.push_back(color);
      for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k) {
        members.points.push_back(toPoint(centre));
        members.points.push_back(toPoint(body.particles[clusters.members[k]]));
        members.colors.insert(members.colors.end(), 2, color);
      }
    }
    if (centres.points.empty()) continue;
    array.markers.push_back(std::move(centres));
    array.markers.push_back(std::move(members));
  }
  return array;
}

}  // namespace meshless
