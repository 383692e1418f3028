// Bodies for tests of the rooms above geometry.
#pragma once

#include <gtest/gtest.h>

#include "meshless_surgery/body/body.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/world/world.h"
#include "support/shapes.h"

namespace meshless::test {

inline BodyDef defOf(const TriangleMesh& mesh, const std::string& name = "body") {
  BodyDef def;
  def.name = name;
  def.mesh = mesh;
  return def;
}

inline PreparedBody prepared(const BodyDef& def) {
  Result<PreparedBody> body = prepareBody(def);
  EXPECT_TRUE(body.ok()) << (body.ok() ? "" : body.error().detail);
  return *body;
}

inline std::shared_ptr<const PreparedBody> shared(const BodyDef& def) {
  return std::make_shared<const PreparedBody>(prepared(def));
}

/// A ball, small enough to be computed fast, large enough for several clusters.
inline BodyDef ball(const std::string& name = "ball", const Vec3& at = Vec3(0, 0, 0.2)) {
  BodyDef def = defOf(sphereMesh(0.1, 0.03), name);
  def.pose.translation = at;
  return def;
}

inline BodyDef block(const std::string& name = "block", const Vec3& at = Vec3(0, 0, 0.2)) {
  BodyDef def = defOf(boxMesh(Vec3(0.2, 0.1, 0.1), 8, 4, 4), name);
  def.pose.translation = at;
  return def;
}

inline WorldSettings weightless() {
  WorldSettings settings;
  settings.gravity = Vec3::Zero();
  settings.ground.reset();
  return settings;
}

inline bool allFinite(const Points& points) {
  for (const Vec3& p : points)
    if (!p.allFinite()) return false;
  return true;
}

template <class T>
T replyOf(Result<Reply> reply) {
  EXPECT_TRUE(reply.ok()) << (reply.ok() ? "" : reply.error().detail);
  return reply.ok() ? std::get<T>(*reply) : T();
}

}  // namespace meshless::test
