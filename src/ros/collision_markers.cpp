#include "collision_markers.h"

#include "convert.h"
#include "marker.h"
#include "meshless_surgery/world/collision_shape.h"

namespace meshless {
namespace {

using visualization_msgs::Marker;

constexpr double kEdgeLine = 0.04;  // width in particle spacings

}  // namespace

visualization_msgs::MarkerArray collisionMarkers(const WorldSnapshot& snapshot, const std_msgs::Header& header) {
  visualization_msgs::MarkerArray array;
  array.markers.push_back(deleteAllMarkers(header));
  for (const BodySnapshot& body : snapshot.bodies) {
    if (!body.model->collision) continue;
    Marker edges = newMarker(header, "collision", static_cast<int>(body.number), Marker::LINE_LIST);
    edges.scale.x = kEdgeLine * body.model->spacing;
    edges.color.r = edges.color.g = 1.0f;
    edges.color.a = 1.0f;
    const Points places = collisionShape(body);
    for (const Triangle& t : body.model->collision->mesh.triangles)
      for (int k = 0; k < 3; ++k) {
        const Index a = t[k], b = t[(k + 1) % 3];
        if (a > b) continue;  // the other face has it
        edges.points.push_back(toPoint(places[a]));
        edges.points.push_back(toPoint(places[b]));
      }
    array.markers.push_back(std::move(edges));
  }
  return array;
}

}  // namespace meshless
