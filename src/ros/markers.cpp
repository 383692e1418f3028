#include "markers.h"

#include <algorithm>
#include <cmath>

#include "convert.h"
#include "marker.h"

namespace meshless {
namespace {

using visualization_msgs::Marker;

constexpr int kSaidDeletes = 30;         // arrays: a second at the highest rate
constexpr double kThinnest = 1e-8;       // a triangle's height over its longest edge: thinner ones have no area
constexpr double kSmoothUpTo = 0.75;     // cosine between face and vertex normal: the edges of a box stay sharp
constexpr double kSpringWidth = 0.0015;  // [m]
constexpr double kSpringEnd = 0.006;     // [m] diameter
constexpr double kFibreWidth = 0.0005;   // [m]
constexpr double kJawWidth = 0.0015;     // [m] of a line on a clip

bool hasArea(double area, const Vec3& a, const Vec3& b, const Vec3& c) {
  return area > kThinnest * std::max({(b - a).squaredNorm(), (c - a).squaredNorm(), (c - b).squaredNorm()});
}

// rviz lights a triangle list only where it has one colour: a body with cut faces would turn flat. So the light is in
// the colours, for every body alike: ambient, a lamp over the left shoulder, and a weak one opposite.
double lightOn(const Vec3& normal) {
  static const Vec3 lamp = Vec3(-0.35, -0.55, 0.76).normalized();
  const double facing = normal.dot(lamp);
  return 0.42 + (facing > 0.0 ? 0.58 * facing : 0.12 * -facing);
}

std_msgs::ColorRGBA shaded(std_msgs::ColorRGBA color, double light) {
  color.r = static_cast<float>(color.r * light);
  color.g = static_cast<float>(color.g * light);
  color.b = static_cast<float>(color.b * light);
  return color;
}

void addObstacle(const ObstacleDef& obstacle, Marker& marker) {
  marker.color = toColor(obstacle.color);
  marker.scale.x = marker.scale.y = marker.scale.z = 1.0;
  for (const Triangle& t : obstacle.mesh.triangles) {
    const Vec3 &a = obstacle.mesh.vertices[t[0]], &b = obstacle.mesh.vertices[t[1]], &c = obstacle.mesh.vertices[t[2]];
    const Vec3 normal = (b - a).cross(c - a);
    const double area = normal.norm();
    if (!hasArea(area, a, b, c)) continue;
    const double light = lightOn(normal / area);
    for (const Vec3& p : {a, b, c}) {
      marker.points.push_back(toPoint(p));
      marker.colors.push_back(shaded(marker.color, light));
    }
  }
}

void addObstacles(const WorldSnapshot& snapshot, const std_msgs::Header& header,
                  visualization_msgs::MarkerArray& array) {
  for (std::size_t o = 0; o < snapshot.obstacles.size(); ++o) {
    Marker surface = newMarker(header, "obstacles", static_cast<int>(o), Marker::TRIANGLE_LIST);
    addObstacle(*snapshot.obstacles[o], surface);
    if (!surface.points.empty()) array.markers.push_back(std::move(surface));
  }
}

// Unit normals of vertices, and the light on them.
struct Shading {
  Points normals;
  std::vector<double> lights;

  void finish() {
    lights.reserve(normals.size());
    for (Vec3& normal : normals) {
      normal.normalize();
      lights.push_back(lightOn(normal));
    }
  }
};

void addBody(const BodySnapshot& body, const VertexColors& baked, Marker& marker) {
  const TriangleMesh& mesh = body.model->surface;
  marker.color = toColor(body.material.color);
  marker.scale.x = marker.scale.y = marker.scale.z = 1.0;
  const auto inside = toColor(body.material.inside_color);
  const auto colorOf = [&](Index v, bool cut) {
    const std::vector<Color>& colors = cut ? baked.inside : baked.outer;
    return colors.empty() ? (cut ? inside : marker.color) : toColor(colors[v]);
  };
  // Normals are smooth over the outer surface and over all cut faces, each on their own: the rim between stays sharp.
  Shading shadings[2];
  const bool any_cut = std::any_of(mesh.patches.begin(), mesh.patches.end(), isCutPatch);
  for (const bool cut : {false, true})
    if (!cut || any_cut) shadings[cut].normals.assign(body.surface.size(), Vec3::Zero());
  Points areas;
  areas.reserve(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& corners = mesh.triangles[t];
    const Vec3& a = body.surface[corners[0]];
    areas.push_back((body.surface[corners[1]] - a).cross(body.surface[corners[2]] - a));
    for (const Index v : corners) shadings[isCutPatch(mesh.patchOf(t))].normals[v] += areas.back();
  }
  for (Shading& shading : shadings) shading.finish();
  marker.points.reserve(3 * mesh.triangles.size());
  marker.colors.reserve(3 * mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& corners = mesh.triangles[t];
    const double area = areas[t].norm();
    if (!hasArea(area, body.surface[corners[0]], body.surface[corners[1]], body.surface[corners[2]])) continue;
    const bool cut = isCutPatch(mesh.patchOf(t));
    const Vec3 flat = areas[t] / area;
    for (const Index v : corners) {
      const bool smooth = shadings[cut].normals[v].dot(flat) > kSmoothUpTo;
      const double light = smooth ? shadings[cut].lights[v] : lightOn(flat);
      marker.points.push_back(toPoint(body.surface[v]));
      marker.colors.push_back(shaded(colorOf(v, cut), light));
    }
  }
}

void addInstruments(const std::vector<meshless_surgery::InstrumentPart>& parts, const std_msgs::Header& header,
                    visualization_msgs::MarkerArray& array) {
  for (std::size_t k = 0; k < parts.size(); ++k) {
    Marker marker = newMarker(header, "instruments", static_cast<int>(k), Marker::MESH_RESOURCE);
    marker.mesh_resource = parts[k].mesh;
    marker.pose = parts[k].pose;
    marker.scale.x = marker.scale.y = marker.scale.z = parts[k].scale;
    marker.color = parts[k].color;
    array.markers.push_back(std::move(marker));
  }
}

}  // namespace

void MarkerBuilder::addTools(const WorldSnapshot& snapshot, const std_msgs::Header& header,
                             visualization_msgs::MarkerArray& array) {
  const auto free_color = toColor({0.2f, 0.9f, 0.3f, 1.0f});
  const auto locked_color = toColor({1.0f, 0.8f, 0.1f, 1.0f});
  if (!snapshot.picks.empty()) {
    Marker springs = newMarker(header, "tools", 0, Marker::LINE_LIST);
    springs.scale.x = kSpringWidth;
    springs.color = free_color;
    Marker ends = newMarker(header, "tools", 1, Marker::SPHERE_LIST);
    ends.scale.x = ends.scale.y = ends.scale.z = kSpringEnd;
    ends.color = free_color;
    for (const Pick& pick : snapshot.picks) {
      const auto& color = pick.locked ? locked_color : free_color;
      springs.points.push_back(toPoint(pick.position));
      springs.points.push_back(toPoint(pick.target));
      springs.colors.insert(springs.colors.end(), 2, color);
      ends.points.push_back(toPoint(pick.target));
      ends.colors.push_back(color);
    }
    array.markers.push_back(std::move(springs));
    array.markers.push_back(std::move(ends));
  }
  Marker fibres = newMarker(header, "tools", 4, Marker::LINE_LIST);
  fibres.scale.x = kFibreWidth;
  fibres.color = toColor({0.95f, 0.9f, 0.75f, 1.0f});
  Marker clips = newMarker(header, "tools", 5, Marker::LINE_LIST);
  clips.scale.x = kJawWidth;
  clips.color = toColor({0.78f, 0.82f, 0.88f, 1.0f});
  for (const AttachmentSnapshot& attachment : snapshot.attachments)
    for (const auto& line : attachment.lines)
      for (const Vec3& end : line) (attachment.jaws ? clips : fibres).points.push_back(toPoint(end));
  if (!fibres.points.empty()) array.markers.push_back(std::move(fibres));
  if (!clips.points.empty()) array.markers.push_back(std::move(clips));
  if (snapshot.push.enabled) {
    Marker sphere = newMarker(header, "tools", 2, Marker::SPHERE);
    sphere.pose.position = toPoint(snapshot.push.position);
    sphere.scale.x = sphere.scale.y = sphere.scale.z = 2.0 * snapshot.push.radius;
    sphere.color = toColor(snapshot.push.touching ? Color{0.95f, 0.75f, 0.3f, 0.85f} : Color{0.7f, 0.75f, 0.8f, 0.85f});
    array.markers.push_back(std::move(sphere));
  }
}

visualization_msgs::MarkerArray obstacleMarkers(const WorldSnapshot& snapshot, const std_msgs::Header& header) {
  visualization_msgs::MarkerArray array;
  array.markers.push_back(deleteAllMarkers(header));
  addObstacles(snapshot, header, array);
  return array;
}

bool MarkerBuilder::deleting() const {
  return std::any_of(shown_.begin(), shown_.end(),
                     [](const auto& s) { return s.second > 0 && s.second < kSaidDeletes; });
}

visualization_msgs::MarkerArray MarkerBuilder::build(const WorldSnapshot& snapshot, const ros::Time& stamp, bool fresh,
                                                     const std::vector<meshless_surgery::InstrumentPart>& instruments) {
  visualization_msgs::MarkerArray array;
  std_msgs::Header header;
  header.frame_id = world_frame_;
  header.stamp = stamp;
  if (fresh || !run_ || *run_ != snapshot.run) {
    array.markers.push_back(deleteAllMarkers(header));
    shown_.clear();
    run_ = snapshot.run;
  }
  baked_.update(snapshot);
  const std::size_t first = array.markers.size();
  for (const BodySnapshot& body : snapshot.bodies) {
    Marker surface = newMarker(header, "bodies", static_cast<int>(body.number), Marker::TRIANGLE_LIST);
    addBody(body, baked_.of(body), surface);
    if (!surface.points.empty()) array.markers.push_back(std::move(surface));
  }
  addObstacles(snapshot, header, array);
  addTools(snapshot, header, array);
  addInstruments(instruments, header, array);

  std::map<Key, int> now;
  for (std::size_t m = first; m < array.markers.size(); ++m)
    now[{array.markers[m].ns, array.markers[m].id}] = kSaidDeletes;
  for (auto& [key, left] : shown_) {
    if (now.count(key) > 0 || left == 0) continue;
    Marker gone = newMarker(header, key.first, key.second, Marker::TRIANGLE_LIST);
    gone.action = Marker::DELETE;
    array.markers.push_back(std::move(gone));
    now[key] = left - 1;
  }
  shown_ = std::move(now);
  return array;
}

}  // namespace meshless
