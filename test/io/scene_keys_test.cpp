// Each key that the parser of scenes knows changes what it says it does, in copies too. The keys come from the parser:
// it lists them where it refuses an unknown one.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <regex>
#include <set>
#include <sstream>

#include "io/temporary_folder.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/io/scene.h"

namespace meshless {
namespace scene_keys_test {

template <class... Values>
std::string text(const Values&... values) {
  std::ostringstream out;
  (void)std::initializer_list<int>{(out << values << " ", 0)...};
  std::string joined = out.str();
  if (!joined.empty()) joined.pop_back();
  return joined;
}
std::string text(const Vec3& v) { return text(v.x(), v.y(), v.z()); }
std::string text(const Color& c) { return text(c.r, c.g, c.b, c.a); }
std::string curve(const ResponseCurve& c) { return c.points.empty() ? "none" : text(c.at(0.1)); }
std::string volume(const TriangleMesh& mesh) { return text(signedVolume(mesh)); }
std::string triangles(const TriangleMesh& mesh) { return std::to_string(mesh.triangles.size()); }

/// Each map by its name in messages, and scenes with it: its keys stand at @, copies of a body may be asked for at $.
const std::string kBody = "{bodies: [{primitive: {box: [1, 1, 1]}, $";
const std::string kTwoBodies =
    "{bodies: [{name: a, primitive: {box: [1, 1, 1]}}, {name: b, primitive: {box: [1, 1, 1]}}], ";
const std::map<std::string, std::vector<std::string>> kMaps = {
    {"the scene", {"{@}"}},
    {"world", {"{bodies: [], world: {@}}"}},
    {"pick", {"{bodies: [], world: {pick: {@}}}"}},
    {"push", {"{bodies: [], world: {push: {@}}}"}},
    {"a body", {"{materials: {m: {alpha: 0.3}}, bodies: [{$ @}]}"}},
    {"an obstacle", {"{bodies: [], obstacles: [{@}]}"}},
    {"an attachment", {kTwoBodies + "attachments: [{@}]}"}},
    {"an instrument", {"{bodies: [], instruments: {left: {@}}}"}},
    {"region", {kTwoBodies + "attachments: [{bodies: [a, b], stiffness: 1, distance: 1, region: {@}}]}"}},
    {"primitive", {"{bodies: [{$ primitive: {@}}]}"}},
    {"pose", {kBody + "pose: {@}}]}"}},
    {"clusters", {kBody + "clusters: {@}}]}"}},
    {"cavities", {kBody + "cavities: {@}}]}"}},
    {"prestretch", {kBody + "prestretch: {@}}]}"}},
    {"copies", {kBody + "copies: {@}}]}"}},
    {"fixed", {kBody + "fixed: [{@}]}]}"}},
    {"regions", {kBody + "regions: [{@}]}]}"}},
    {"box", {kBody + "fixed: [{box: {@}}]}]}", kBody + "regions: [{box: {@}, material: {}}]}]}"}},
    {"sphere", {kBody + "fixed: [{sphere: {@}}]}]}", kBody + "regions: [{sphere: {@}, material: {}}]}]}"}},
    {"plane", {kBody + "fixed: [{plane: {@}}]}]}"}},
    {"material",
     {kBody + "material: {@}}]}", kBody + "material: m}], materials: {m: {@}}}",
      kBody + "regions: [{box: {min: [0, 0, 0], max: [1, 1, 1]}, material: {@}}]}]}"}},
    {"plasticity",
     {kBody + "material: {plasticity: {@}}}]}", kBody + "material: m}], materials: {m: {plasticity: {@}}}}",
      kBody + "regions: [{box: {min: [0, 0, 0], max: [1, 1, 1]}, material: {plasticity: {@}}}]}]}"}},
    {"fibres", {kBody + "material: {fibres: {@}}}]}", kBody + "material: m}], materials: {m: {fibres: {@}}}}"}},
    {"relaxation",
     {kBody + "material: {relaxation: [{@}]}}]}", kBody + "material: m}], materials: {m: {relaxation: [{@}]}}}",
      kBody + "regions: [{box: {min: [0, 0, 0], max: [1, 1, 1]}, material: {relaxation: [{@}]}}]}]}"}},
    {"appearance",
     {kBody + "material: {appearance: {@}}}]}", kBody + "material: m}], materials: {m: {appearance: {@}}}}",
      kBody + "regions: [{box: {min: [0, 0, 0], max: [1, 1, 1]}, material: {appearance: {@}}}]}]}"}},
    {"outer", {kBody + "material: {appearance: {outer: {@}}}}]}"}},
    {"inner", {kBody + "material: {appearance: {inner: {@}}}}]}"}},
};

struct Seen {
  const SceneDef& scene;
  const BodyDef& body;  // each of the scene's
  const Region& region;
  const Material& material;  // the region's where it has one
};

struct Row {
  std::string map, with, without;  // the first word of `with` is the key
  std::function<std::string(const Seen&)> read;
  std::string expected;
};

std::size_t trianglesOfSphere(double edge) { return primitiveMesh("sphere", {1.0}, edge)->triangles.size(); }

/// How far copies are from their places, or turned, as shares of what was allowed: 1 where they use it.
std::string spread(const Seen& seen, double jitter, double turn) {
  double moved = 0.0, turned = 0.0;
  for (const BodyDef& body : seen.scene.bodies) {
    moved = std::max(moved, body.pose.translation.cwiseAbs().maxCoeff());
    turned = std::max(turned, body.pose.rotation.angularDistance(Quat::Identity()));
  }
  const auto used = [](double x, double most) { return most == 0.0 ? x < 1e-12 : x > 0.5 * most && x <= most + 1e-12; };
  return text(used(moved, jitter), used(turned, turn));
}

const InstrumentDef& instrumentOf(const Seen& seen) { return seen.scene.instruments.at(0); }
const AttachCommand& attachmentOf(const Seen& seen) { return seen.scene.attachments.at(0); }

#define READ(...) [](const Seen& s) { return text(__VA_ARGS__); }
#define SETTING(key) READ(s.scene.world.key)
#define MATERIAL(key) READ(s.material.key)

std::vector<Row> rows() {
  return {
      {"the scene", "bodies: [{primitive: {sphere: 1}}]", "bodies: []", READ(s.scene.bodies.size()), "1"},
      {"the scene", "world: {substeps: 7}, bodies: []", "bodies: []", SETTING(substeps), "7"},
      {"the scene", "materials: {m: {alpha: 0.3}}, bodies: []", "bodies: []", READ(s.scene.materials.count("m")), "1"},
      {"the scene", "space: RAS, bodies: [{file: ../lps.obj}]", "bodies: [{file: ../lps.obj}]",
       READ(s.body.mesh.vertices.at(0).x() < 0.0), "1"},
      {"the scene", "obstacles: [{primitive: {sphere: 1}}], bodies: []", "bodies: []", READ(s.scene.obstacles.size()),
       "1"},
      {"the scene",
       "attachments: [{bodies: [a, world], stiffness: 1}], bodies: [{name: a, primitive: {box: [1, 1, 1]}}]",
       "bodies: [{name: a, primitive: {box: [1, 1, 1]}}]", READ(s.scene.attachments.size()), "1"},
      {"the scene", "instruments: {left: {type: probe}}, bodies: []", "bodies: []", READ(s.scene.instruments.size()),
       "1"},

      {"an instrument", "type: hook", "type: probe", READ(toString(instrumentOf(s).type)), "hook"},
      {"an instrument", "pose: {position: [1, 2, 3]}, type: probe", "type: probe",
       READ(instrumentOf(s).pose.translation), "1 2 3"},
      {"an instrument", "remote_centre: [1, 2, 3], type: probe", "type: probe",
       READ(instrumentOf(s).remote_centre.value_or(Vec3::Zero())), "1 2 3"},
      {"an instrument", "shaft_radius: 0.004, type: grasper", "type: grasper", READ(instrumentOf(s).shaft_radius),
       "0.004"},
      {"an instrument", "shaft_length: 0.2, type: grasper", "type: grasper", READ(instrumentOf(s).shaft_length), "0.2"},
      {"an instrument", "jaw_length: 0.02, type: grasper", "type: grasper", READ(instrumentOf(s).jaw_length), "0.02"},
      {"an instrument", "jaw_width: 0.005, type: grasper", "type: grasper", READ(instrumentOf(s).jaw_width), "0.005"},
      {"an instrument", "jaw_thickness: 0.003, type: grasper", "type: grasper", READ(instrumentOf(s).jaw_thickness),
       "0.003"},
      {"an instrument", "friction: 0.7, type: grasper", "type: grasper", READ(instrumentOf(s).friction), "0.7"},
      {"an instrument", "stiffness: 3000, type: grasper", "type: grasper", READ(instrumentOf(s).stiffness), "3000"},
      {"an instrument", "damping: 30, type: grasper", "type: grasper", READ(instrumentOf(s).damping), "30"},
      {"an instrument", "angular_stiffness: 6, type: grasper", "type: grasper", READ(instrumentOf(s).angular_stiffness),
       "6"},
      {"an instrument", "angular_damping: 0.07, type: grasper", "type: grasper", READ(instrumentOf(s).angular_damping),
       "0.07"},
      {"an instrument", "max_force: 7, type: grasper", "type: grasper", READ(instrumentOf(s).max_force), "7"},
      {"an instrument", "max_torque: 0.3, type: grasper", "type: grasper", READ(instrumentOf(s).max_torque), "0.3"},
      {"an instrument", "max_speed: 0.8, type: grasper", "type: grasper", READ(instrumentOf(s).max_speed), "0.8"},
      {"an instrument", "grasp: latch, type: grasper", "type: grasper", READ(instrumentOf(s).latch), "1"},
      {"an instrument", "grip: 4, type: grasper", "type: grasper", READ(instrumentOf(s).grip), "4"},
      {"an instrument", "sharpness: 0.4, type: scalpel", "type: scalpel", READ(instrumentOf(s).sharpness), "0.4"},
      {"an instrument", "view_angle: 0.5, type: endoscope", "type: endoscope", READ(instrumentOf(s).view_angle), "0.5"},
      {"an instrument", "field_of_view: 0.8, type: endoscope", "type: endoscope", READ(instrumentOf(s).field_of_view),
       "0.8"},

      {"an attachment", "bodies: [b, a], stiffness: 1, distance: 1", "bodies: [a, b], stiffness: 1, distance: 1",
       READ(attachmentOf(s).body, attachmentOf(s).other), "b a"},
      {"an attachment", "name: bed, bodies: [a, b], stiffness: 1, distance: 1",
       "bodies: [a, b], stiffness: 1, distance: 1", READ(attachmentOf(s).name), "bed"},
      {"an attachment", "distance: 0.5, bodies: [a, b], stiffness: 1", "bodies: [a, b], stiffness: 1, distance: 1",
       READ(attachmentOf(s).distance), "0.5"},
      {"an attachment", "stiffness: 5, bodies: [a, b], distance: 1", "bodies: [a, b], stiffness: 1, distance: 1",
       READ(attachmentOf(s).stiffness), "5"},
      {"an attachment", "strength: 7, bodies: [a, b], stiffness: 1, distance: 1",
       "bodies: [a, b], stiffness: 1, distance: 1", READ(attachmentOf(s).strength.value_or(-1.0)), "7"},
      {"an attachment", "region: {sphere: {centre: [0, 0, 0], radius: 2}}, bodies: [a, b], stiffness: 1, distance: 1",
       "bodies: [a, b], stiffness: 1, distance: 1", READ(attachmentOf(s).region.has_value()), "1"},
      {"region", "box: {min: [0, 0, 0], max: [1, 2, 3]}", "sphere: {centre: [0, 0, 0], radius: 2}",
       READ(attachmentOf(s).region->box.max), "1 2 3"},
      {"region", "sphere: {centre: [0, 0, 0], radius: 2}", "box: {min: [0, 0, 0], max: [1, 2, 3]}",
       READ(attachmentOf(s).region->radius), "2"},
      {"region", "plane: {point: [0, 0, 1], normal: [0, 0, 1]}", "box: {min: [0, 0, 0], max: [1, 2, 3]}",
       READ(attachmentOf(s).region->plane.point), "0 0 1"},

      {"world", "gravity: [0.1, 0.2, -1.6]", "", READ(s.scene.world.gravity), "0.1 0.2 -1.6"},
      {"world", "ground: -0.5", "", READ(s.scene.world.ground.value_or(9.0)), "-0.5"},
      {"world", "ground: none", "", READ(s.scene.world.ground.has_value()), "0"},
      {"world", "ground_friction: 0.7", "", SETTING(ground_friction), "0.7"},
      {"world", "step_rate: 240", "", SETTING(step_rate), "240"},
      {"world", "substeps: 7", "", SETTING(substeps), "7"},
      {"world", "max_substeps: 77", "", SETTING(max_substeps), "77"},
      {"world", "threads: 3", "", SETTING(threads), "3"},
      {"world", "contact: none", "", READ(s.scene.world.contact == ContactMethod::kNone), "1"},
      {"world", "contact: textbook", "", READ(s.scene.world.contact == ContactMethod::kTextbook), "1"},
      {"world", "contact: rest_shape", "", READ(s.scene.warnings.empty()), "0"},
      {"world", "contact: auto", "", READ(s.scene.warnings.empty()), "0"},
      {"world", "sleep: false", "", SETTING(sleep), "0"},
      {"world", "pick: {stiffness: 300}", "", SETTING(pick_stiffness), "300"},
      {"world", "push: {radius: 0.015}", "", SETTING(push_radius), "0.015"},
      {"pick", "max_distance: 0.04", "", SETTING(pick_max_distance), "0.04"},
      {"pick", "stiffness: 300", "", SETTING(pick_stiffness), "300"},
      {"pick", "radius: 0.033", "", SETTING(pick_radius), "0.033"},
      {"push", "radius: 0.015", "", SETTING(push_radius), "0.015"},

      {"a body", "name: abc", "", READ(s.body.name.substr(0, 3)), "abc"},
      {"a body", "file: ../box.obj", "primitive: {sphere: 1}", READ(volume(s.body.mesh)), "6"},
      {"a body", "primitive: {box: [1, 2, 4]}", "file: ../box.obj", READ(volume(s.body.mesh)), "8"},
      {"a body", "scale: 0.5", "", READ(volume(s.body.mesh)), "0.125"},
      {"a body", "scale: 0.5, file: ../box.obj", "file: ../box.obj", READ(volume(s.body.mesh)), "0.75"},
      {"a body", "units: cm", "", READ(volume(s.body.mesh)), "1e-06"},
      {"a body", "spacing: 0.02", "", READ(s.body.spacing), "0.02"},
      {"a body", "thickness: 0.02", "", READ(s.body.thickness), "0.02"},
      {"a body", "cavities: {pressure: 20}", "", READ(s.body.cavities.pressure), "20"},
      {"a body", "fibre_direction: [0, 3, 4]", "", READ(s.body.fibre_direction), "0 0.6 0.8"},
      {"a body", "prestretch: {x: 1.25}", "", READ(s.body.prestretch.x()), "1.25"},
      {"a body", "up_axis: y, file: ../box.obj", "file: ../box.obj", READ(boundsOf(s.body.mesh.vertices).max),
       "0.5 1.5 1"},
      {"a body", "up_axis: z, file: ../box.obj", "up_axis: y, file: ../box.obj",
       READ(boundsOf(s.body.mesh.vertices).max), "0.5 1 1.5"},
      {"a body", "up_axis: y, file: ../box.obj, regions: [{file: ../box.obj, material: m}]",
       "file: ../box.obj, regions: [{file: ../box.obj, material: m}]", READ(s.region.contains(Vec3(0.4, 1.4, 0.9))),
       "1"},  // and a region's file
      {"a body", "resolution: fine", "", READ(static_cast<int>(s.body.resolution)), "2"},
      {"a body", "edge: 0.4, primitive: {sphere: 1}", "primitive: {sphere: 1}", READ(triangles(s.body.mesh)),
       text(trianglesOfSphere(0.4))},
      // An edge has the scale of its body.
      {"a body", "edge: 0.4, scale: 0.5, primitive: {sphere: 1}", "scale: 0.5, primitive: {sphere: 1}",
       READ(triangles(s.body.mesh)), text(trianglesOfSphere(0.4))},
      {"a body", "repair: wrap, file: ../fin.obj", "file: ../fin.obj", READ(s.body.mesh.triangles.size() > 200), "1"},
      {"a body", "pose: {position: [1, 2, 3]}", "", READ(s.body.pose.translation), "1 2 3"},
      {"a body", "clusters: one", "", READ(s.body.clusters.kind == ClusterOptions::Kind::kOne), "1"},
      {"a body", "clusters: cells", "", READ(s.body.clusters.kind == ClusterOptions::Kind::kCells), "1"},
      {"a body", "cells: whole", "", READ(s.body.warnings.size()), "1"},
      {"a body", "collision: 0.03", "",
       READ(s.body.collision.kind == CollisionChoice::Kind::kEdge, s.body.collision.edge), "1 0.03"},
      {"a body", "collision: visual", "", READ(s.body.collision.kind == CollisionChoice::Kind::kVisual), "1"},
      {"a body", "material: m", "", READ(s.body.material.name, s.body.material.alpha), "m 0.3"},
      {"a body", "fixed: [{box: {min: [0, 0, 0], max: [1, 1, 1]}}]", "", READ(s.body.fixed.size()), "1"},
      {"a body", "regions: [{box: {min: [0, 0, 0], max: [1, 1, 1]}, material: m}]", "", READ(s.body.regions.size()),
       "1"},
      {"a body", "scale: 2, primitive: {sphere: 1}, regions: [{file: ../box.obj, material: m}]",
       "primitive: {sphere: 1}, regions: [{file: ../box.obj, material: m}]",
       READ(s.region.contains(Vec3(0.9, 1.9, 2.9))), "1"},  // a region's file has the scale of its body
      {"a body", "copies: {count: 3}", "", READ(s.scene.bodies.size()), "3"},

      {"primitive", "box: [1, 2, 4]", "sphere: 1", READ(volume(s.body.mesh)), "8"},
      {"primitive", "sphere: 2", "box: [1, 1, 1]",
       READ(std::round(10.0 * boundsOf(s.body.mesh.vertices).max.norm()), signedVolume(s.body.mesh) > 30.0), "34 1"},
      {"primitive", "cylinder: [4, 1]", "sphere: 1",
       READ(boundsOf(s.body.mesh.vertices).max.z(), boundsOf(s.body.mesh.vertices).max.x()), "2 1"},

      {"pose", "position: [1, 2, 3]", "", READ(s.body.pose.translation), "1 2 3"},
      // About fixed axes, x first.
      {"pose", "rpy: [1.5707963267948966, 0, 1.5707963267948966]", "",
       READ(Vec3((s.body.pose.rotation * Vec3(1, 2, 3)).array().round())), "3 1 2"},
      {"pose", "xyzw: [0, 0, 0.6, 0.8]", "", READ(s.body.pose.rotation.z(), s.body.pose.rotation.w()), "0.6 0.8"},

      {"clusters", "grid: [5, 4, 1]", "count: 3",
       READ(s.body.clusters.kind == ClusterOptions::Kind::kGrid, s.body.clusters.grid[0], s.body.clusters.grid[1],
            s.body.clusters.grid[2]),
       "1 5 4 1"},
      {"clusters", "count: 20", "grid: [2, 2, 2]",
       READ(s.body.clusters.kind == ClusterOptions::Kind::kCount, s.body.clusters.count), "1 20"},
      {"clusters", "overlap: 0.77, count: 20", "count: 20", READ(s.body.clusters.overlap), "0.77"},
      {"clusters", "overlap: 0.77, grid: [2, 2, 2]", "grid: [2, 2, 2]", READ(s.body.clusters.overlap), "0.77"},

      {"copies", "count: 3", "count: 1", READ(s.scene.bodies.size(), s.scene.bodies.back().name), "3 box_3"},
      {"copies", "grid: [2, 3, 1], offset: [1, 1, 1]", "count: 6, offset: [1, 1, 1]",
       READ(s.scene.bodies.size(), text(s.scene.bodies.back().pose.translation)), "6 1 2 0"},
      {"copies", "offset: [1, 2, 3], grid: [2, 2, 2]", "grid: [2, 2, 2]", READ(s.scene.bodies.back().pose.translation),
       "1 2 3"},
      {"copies", "jitter: 0.2, count: 20", "count: 20", READ(spread(s, 0.2, 0.0)), "1 1"},
      {"copies", "turn: 0.5, count: 20", "count: 20", READ(spread(s, 0.0, 0.5)), "1 1"},
      {"copies", "seed: 4, count: 5, jitter: 1", "count: 5, jitter: 1", READ(s.scene.bodies.back().pose.translation),
       ""},  // anywhere else than without it

      {"fixed", "box: {min: [0, 0, 0], max: [1, 2, 3]}", "sphere: {centre: [9, 9, 9], radius: 1}",
       READ(s.region.contains(Vec3(0.9, 1.9, 2.9))), "1"},
      {"fixed", "plane: {point: [1, 2, 3], normal: [0, 0, 2]}", "sphere: {centre: [9, 9, 9], radius: 1}",
       READ(s.region.height(Vec3(9, 9, 3.5))), "0.5"},
      {"fixed", "sphere: {centre: [1, 2, 3], radius: 0.5}", "box: {min: [0, 0, 0], max: [1, 1, 1]}",
       READ(s.region.height(Vec3(1, 2, 4))), "0.5"},
      {"fixed", "follows: arm, box: {min: [0, 0, 0], max: [1, 1, 1]}", "box: {min: [0, 0, 0], max: [1, 1, 1]}",
       READ(s.body.fixed[0].follows), "arm"},
      {"fixed", "frame: body, box: {min: [0, 0, 0], max: [1, 1, 1]}", "box: {min: [0, 0, 0], max: [1, 1, 1]}",
       READ(s.body.fixed.at(0).in_world), "0"},
      {"regions", "box: {min: [0, 0, 0], max: [1, 2, 3]}, material: {}",
       "sphere: {centre: [9, 9, 9], radius: 1}, material: {}", READ(s.region.contains(Vec3(0.9, 1.9, 2.9))), "1"},
      {"regions", "sphere: {centre: [1, 2, 3], radius: 0.5}, material: {}",
       "box: {min: [0, 0, 0], max: [1, 1, 1]}, material: {}", READ(s.region.height(Vec3(1, 2, 4))), "0.5"},
      {"regions", "file: ../box.obj, material: {}", "sphere: {centre: [9, 9, 9], radius: 1}, material: {}",
       READ(s.region.contains(Vec3(0.4, 0.9, 1.4)), s.region.contains(Vec3(0.4, 0.9, 1.6))), "1 0"},
      {"regions", "material: {alpha: 0.3}, box: {min: [0, 0, 0], max: [1, 2, 3]}",
       "material: default, box: {min: [0, 0, 0], max: [1, 2, 3]}", MATERIAL(alpha), "0.3"},
      {"box", "min: [-1, -2, -3], max: [1, 2, 3]", "min: [0, 0, 0], max: [1, 2, 3]", READ(s.region.box.min),
       "-1 -2 -3"},
      {"box", "max: [1, 2, 3], min: [0, 0, 0]", "max: [4, 4, 4], min: [0, 0, 0]", READ(s.region.box.max), "1 2 3"},
      {"sphere", "centre: [1, 2, 3], radius: 1", "centre: [0, 0, 0], radius: 1", READ(s.region.centre), "1 2 3"},
      {"sphere", "radius: 0.3, centre: [0, 0, 0]", "radius: 1, centre: [0, 0, 0]", READ(s.region.radius), "0.3"},
      {"plane", "point: [0, 0, 3], normal: [0, 0, 1]", "point: [0, 0, 0], normal: [0, 0, 1]",
       READ(s.region.height(Vec3(0, 0, 4))), "1"},
      {"plane", "normal: [0, 2, 0], point: [0, 0, 0]", "normal: [0, 0, 1], point: [0, 0, 0]",
       READ(s.region.height(Vec3(1, 2, 4))), "2"},

      {"material", "mode: quadratic", "", READ(s.material.mode == MatchMode::kQuadratic), "1"},
      {"material", "mode: rigid", "", READ(s.material.mode == MatchMode::kRigid), "1"},
      {"material", "young: 5000", "", MATERIAL(youngs_modulus), "5000"},
      {"material", "youngs_modulus: 5000", "", MATERIAL(youngs_modulus), "5000"},
      {"material", "poissons_ratio: 0.123", "", MATERIAL(poissons_ratio), "0.123"},
      {"material", "stiffening: 12.5", "", MATERIAL(stiffening), "12.5"},
      {"material", "asymmetry: -7.5", "", MATERIAL(asymmetry), "-7.5"},
      {"material", "toughness: 250", "", MATERIAL(toughness), "250"},
      {"material", "relaxation: [{share: 0.25, time: 1.5}, {share: 0.5, time: 3}]", "", MATERIAL(relaxation.size()),
       "2"},
      {"material", "fibres: {stiffness: 500}", "", MATERIAL(fibres.stiffness), "500"},
      {"material", "alpha: 0.123", "", MATERIAL(alpha), "0.123"},
      {"material", "beta: 0.123", "", MATERIAL(beta), "0.123"},
      {"material", "density: 950", "", MATERIAL(density), "950"},
      {"material", "damping: 2.5", "", MATERIAL(damping), "2.5"},
      {"material", "friction: 0.123", "", MATERIAL(friction), "0.123"},
      {"material", "restitution: 0.123", "", MATERIAL(restitution), "0.123"},
      {"material", "self_contact: none", "self_contact: all", READ(s.material.self_contact == SelfContact::kNone), "1"},
      {"material", "self_contact: lips", "self_contact: all", READ(s.material.self_contact == SelfContact::kWoundFaces),
       "1"},
      {"material", "self_contact: all", "self_contact: none", READ(s.material.self_contact == SelfContact::kAll), "1"},
      {"material", "volume: [[0, 0.1], [0.2, 1]]", "", READ(curve(s.material.volume)), "0.55"},
      {"material", "area: 0.5", "", READ(curve(s.material.area)), "0.5"},
      {"material", "plasticity: {creep: 3}", "", MATERIAL(plasticity.creep), "3"},
      {"material", "color: [0.1, 0.2, 0.3]", "", MATERIAL(color), "0.1 0.2 0.3 1"},
      {"material", "inside_color: [0.4, 0.5, 0.6, 0.7]", "", MATERIAL(inside_color), "0.4 0.5 0.6 0.7"},
      {"material", "appearance: {outer: {scale: 0.123}}", "", MATERIAL(appearance.outer.scale), "0.123"},
      {"appearance", "outer: {scale: 0.123}", "", MATERIAL(appearance.outer.scale), "0.123"},
      {"appearance", "inner: {scale: 0.123}", "", MATERIAL(appearance.inner.scale), "0.123"},
      {"outer", "noise: fat", "", READ(toString(s.material.appearance.outer.noise)), "fat"},
      {"outer", "image: ../skin.png", "", READ(toString(s.material.appearance.outer.noise)), "image"},
      {"outer", "second: [0.1, 0.2, 0.3]", "", MATERIAL(appearance.outer.second), "0.1 0.2 0.3 1"},
      {"outer", "scale: 0.123", "", MATERIAL(appearance.outer.scale), "0.123"},
      {"outer", "wetness: 0.123", "", MATERIAL(appearance.outer.wetness), "0.123"},
      {"outer", "bump: 0.123", "", MATERIAL(appearance.outer.bump), "0.123"},
      {"inner", "noise: bone", "", READ(toString(s.material.appearance.inner.noise)), "bone"},
      {"inner", "image: ../skin.png", "", READ(toString(s.material.appearance.inner.noise)), "image"},
      {"inner", "second: [0.1, 0.2, 0.3]", "", MATERIAL(appearance.inner.second), "0.1 0.2 0.3 1"},
      {"inner", "scale: 0.123", "", MATERIAL(appearance.inner.scale), "0.123"},
      {"inner", "wetness: 0.123", "", MATERIAL(appearance.inner.wetness), "0.123"},
      {"inner", "bump: 0.123", "", MATERIAL(appearance.inner.bump), "0.123"},
      {"plasticity", "yield: 0.123", "", MATERIAL(plasticity.yield), "0.123"},
      {"plasticity", "creep: 3", "", MATERIAL(plasticity.creep), "3"},
      {"relaxation", "share: 0.25, time: 2", "share: 0.5, time: 2", MATERIAL(relaxation.at(0).share), "0.25"},
      {"relaxation", "time: 2, share: 0.25", "time: 3, share: 0.25", MATERIAL(relaxation.at(0).time), "2"},
      {"fibres", "stiffness: 500", "", MATERIAL(fibres.stiffness), "500"},
      {"fibres", "stiffening: 5, stiffness: 500", "stiffness: 500", MATERIAL(fibres.stiffening), "5"},
      {"plasticity", "maximum: 0.123", "", MATERIAL(plasticity.maximum), "0.123"},

      {"prestretch", "x: 1.25, y: 1.25", "y: 1.25", READ(s.body.prestretch), "1.25 1.25 0.64"},
      {"prestretch", "y: 0.64", "x: 1.25", READ(s.body.prestretch), "1.25 0.64 1.25"},
      {"prestretch", "z: 0.64, x: 1.25", "x: 1.25", READ(s.body.prestretch), "1.25 1.25 0.64"},

      {"cavities", "pressure: 20", "volume: 20", READ(s.body.cavities.pressure), "20"},
      {"cavities", "volume: 20", "compliance: 0.5", READ(s.body.cavities.volume), "2e-05"},
      {"cavities", "compliance: 0.5", "volume: 20", READ(s.body.cavities.compliance), "5e-07"},
      {"cavities", "leak: 3, volume: 20", "volume: 20", READ(s.body.cavities.leak), "3"},

      {"an obstacle", "name: abc", "", READ(s.scene.obstacles.at(0).name), "abc"},
      {"an obstacle", "file: ../box.obj", "primitive: {sphere: 1}", READ(volume(s.scene.obstacles.at(0).mesh)), "6"},
      {"an obstacle", "primitive: {box: [1, 2, 4]}", "", READ(volume(s.scene.obstacles.at(0).mesh)), "8"},
      {"an obstacle", "scale: 0.5", "", READ(volume(s.scene.obstacles.at(0).mesh)), "0.125"},
      {"an obstacle", "units: cm", "", READ(volume(s.scene.obstacles.at(0).mesh)), "1e-06"},
      {"an obstacle", "edge: 0.4, scale: 0.5, primitive: {sphere: 1}", "scale: 0.5, primitive: {sphere: 1}",
       READ(triangles(s.scene.obstacles.at(0).mesh)), text(trianglesOfSphere(0.4))},
      {"an obstacle", "repair: wrap, file: ../fin.obj", "file: ../fin.obj",
       READ(s.scene.obstacles.at(0).mesh.triangles.size() > 200), "1"},
      {"an obstacle", "up_axis: y, file: ../box.obj", "file: ../box.obj",
       READ(boundsOf(s.scene.obstacles.at(0).mesh.vertices).max), "0.5 1.5 1"},
      {"an obstacle", "friction: 0.123", "", READ(s.scene.obstacles.at(0).friction), "0.123"},
      {"an obstacle", "pose: {position: [1, 2, 3], rpy: [0, 0, 0.78539816339744828]}", "",
       READ(boundsOf(s.scene.obstacles.at(0).mesh.vertices).max), "1.70711 2.70711 3.5"},
  };
}

std::string keyOf(const Row& row) { return row.with.substr(0, row.with.find(':')); }

class SceneKeys : public ::testing::Test {
 protected:
  void SetUp() override {
    access_.folders = {folder_.path()};
    TriangleMesh box = boxMesh(Vec3(1, 2, 3), 1, 1, 1);
    ASSERT_TRUE(writeObj(folder_.file("box.obj"), box, "").ok());
    box.vertices.emplace_back(2.0, 2.0, 2.0);  // a fin, for repair
    box.triangles.push_back({0, 1, static_cast<Index>(box.vertices.size() - 1)});
    ASSERT_TRUE(writeObj(folder_.file("fin.obj"), box, "").ok());
    TriangleMesh beside = boxMesh(Vec3(1, 2, 3), 1, 1, 1);
    for (Vec3& q : beside.vertices) q.x() += 5.0;
    ASSERT_TRUE(writeObj(folder_.file("lps.obj"), beside, "SPACE=LPS").ok());
    std::filesystem::copy(std::string(SOURCE_DIR) + "/docs/images/endoscope.png", folder_.file("skin.png"));
  }
  Result<SceneDef> load(std::string scene, const Row& row, std::string keys, bool copied) {
    const bool shaped = keys.find("file:") != std::string::npos || keys.find("primitive:") != std::string::npos;
    if ((row.map == "a body" || row.map == "an obstacle") && !shaped) keys += ", primitive: {box: [1, 1, 1]}";
    if (keys.compare(0, 2, ", ") == 0) keys.erase(0, 2);
    const std::size_t at = scene.find('$');
    if (at != std::string::npos) scene.replace(at, 1, copied ? "copies: {count: 2}," : "");
    scene.replace(scene.find('@'), 1, keys);
    said_ = scene;
    return readScene(folder_.write("scenes/s.yaml", scene), access_);
  }
  /// What the row reads, of each body; a body of nothing where there is none.
  static std::set<std::string> values(const Row& row, const SceneDef& scene) {
    std::vector<BodyDef> bodies = scene.bodies;
    if (bodies.empty()) bodies.emplace_back();
    std::set<std::string> read;
    for (const BodyDef& body : bodies) {
      const Region region = !body.fixed.empty()     ? body.fixed[0].region
                            : !body.regions.empty() ? body.regions[0].region
                                                    : Region::sphere(Vec3::Zero(), 0.0);
      read.insert(row.read({scene, body, region, body.regions.empty() ? body.material : body.regions[0].material}));
    }
    return read;
  }

  TemporaryFolder folder_;
  FileAccess access_;
  std::string said_;  // the scene that was loaded
};

TEST_F(SceneKeys, EachChangesWhatItSays) {
  for (const Row& row : rows())
    for (const std::string& scene : kMaps.at(row.map))
      for (const bool copied : {false, true}) {
        if (copied && (scene.find('$') == std::string::npos || row.map == "copies" || keyOf(row) == "copies")) continue;
        const Result<SceneDef> without = load(scene, row, row.without, copied),
                               with = load(scene, row, row.with, copied);
        ASSERT_TRUE(with.ok() && without.ok())
            << said_ << ": " << (with.ok() ? without.error().detail : with.error().detail);
        const auto read = values(row, *with), before = values(row, *without);
        if (!row.expected.empty()) EXPECT_EQ(read, std::set<std::string>{row.expected}) << said_;
        EXPECT_NE(read, before) << said_ << " is as without " << keyOf(row);
      }
}

TEST_F(SceneKeys, EachThatTheParserKnowsHasARow) {
  std::map<std::string, std::set<std::string>> known, tried;
  for (const Row& row : rows()) {
    tried[row.map].insert(keyOf(row));
    const Result<SceneDef> scene = load(kMaps.at(row.map)[0], row, row.with + ", no_such_key: 1", false);
    ASSERT_FALSE(scene.ok()) << said_;
    const std::string start = "; accepted: ", &detail = scene.error().detail;
    ASSERT_NE(detail.find("unknown key 'no_such_key'"), std::string::npos) << detail;
    const std::size_t from = detail.find(start) + start.size();  // warnings come after it
    std::istringstream words(detail.substr(from, detail.find(';', from) - from));
    for (std::string word; std::getline(words, word, ',');)
      known[row.map].insert(word.substr(word.find_first_not_of(' ')));
  }
  EXPECT_EQ(known, tried);
}

TEST_F(SceneKeys, EachMapThatTheParserReadsHasRows) {
  std::set<std::string> read, tried;
  for (const auto& map : kMaps) tried.insert(map.first);
  for (const char* file : {"scene.cpp", "region_yaml.cpp", "material_yaml.cpp"}) {
    std::ifstream in(std::string(SOURCE_DIR) + "/src/io/" + file);
    const std::string source((std::istreambuf_iterator<char>(in)), {});
    const std::regex made("YamlMap \\w+\\([^;\"]*?(?:\"([^\"]*)\"|what)\\)");
    for (std::sregex_iterator at(source.begin(), source.end(), made), end; at != end; ++at)
      read.insert((*at)[1].matched ? (*at)[1].str() : "material");
  }
  read.erase("materials");  // its keys are names
  EXPECT_EQ(read, tried);
}

}  // namespace scene_keys_test
}  // namespace meshless
