// A world of soft boxes, for the tests of the ROS side.
#pragma once

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/world/world.h"

namespace meshless {

inline std::shared_ptr<const PreparedBody> softBox(const std::string& name, const Vec3& centre) {
  BodyDef def;
  def.name = name;
  def.mesh = boxMesh(Vec3(0.1, 0.1, 0.1), 3, 3, 3);
  def.pose.translation = centre;
  auto body = prepareBody(std::move(def));
  if (!body.ok()) {
    ADD_FAILURE() << body.error().detail;
    return nullptr;
  }
  return std::make_shared<PreparedBody>(std::move(*body));
}

/// Two boxes that hang in the air without gravity: "a" about the origin, "b" half a metre along x.
inline std::unique_ptr<World> twoBoxes(double step_rate = 120.0) {
  WorldSettings settings;
  settings.gravity = Vec3::Zero();
  settings.ground.reset();
  settings.step_rate = step_rate;
  auto world = std::make_unique<World>(settings);
  for (const auto& [name, x] : {std::pair<const char*, double>{"a", 0.0}, {"b", 0.5}}) {
    const auto body = softBox(name, Vec3(x, 0.0, 0.0));
    if (!body || !world->addSceneBody(body).ok()) ADD_FAILURE() << name;
  }
  return world;
}

/// Unbounded blades in the plane x = offset, normal +x.
inline CutCommand cutAcross(double offset) {
  CutCommand command;
  command.blades.origin = Vec3(offset, -1.0, 0.0);
  command.blades.x_axis = Vec3::UnitY();
  command.blades.y_axis = Vec3::UnitZ();
  return command;
}

}  // namespace meshless
