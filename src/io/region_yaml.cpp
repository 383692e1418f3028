#include "region_yaml.h"

namespace meshless {

Box readBox(YamlSource& source, const YAML::Node& node) {
  Box box;
  YamlMap corners(source, node, "box");
  if (!corners.has("min") || !corners.has("max")) source.fail(node, "box has no min or no max", "both");
  corners.vector("min", lengths(), box.min);
  corners.vector("max", lengths(), box.max);
  corners.finish();
  if (box.empty()) source.fail(node, "box has a min above its max", "min up to max, along each axis");
  return box;
}

Plane readPlane(YamlSource& source, const YAML::Node& node) {
  Plane plane;
  YamlMap map(source, node, "plane");
  if (!map.has("point") || !map.has("normal")) source.fail(node, "plane has no point or no normal", "both");
  map.vector("point", lengths(), plane.point);
  map.vector("normal", {-1000.0, 1000.0}, plane.normal);
  map.finish();
  if (!(plane.normal.norm() > 1e-6)) source.fail(node, "normal has the length 0", "a direction, longer than 1e-6");
  plane.normal.normalize();
  return plane;
}

Region readSphere(YamlSource& source, const YAML::Node& node) {
  Region sphere = Region::sphere(Vec3::Zero(), 0.0);
  YamlMap map(source, node, "sphere");
  if (!map.has("centre") || !map.has("radius")) source.fail(node, "sphere has no centre or no radius", "both");
  map.vector("centre", lengths(), sphere.centre);
  map.number("radius", lengths(0.0, true), sphere.radius);
  map.finish();
  return sphere;
}

}  // namespace meshless
