// Bodies as laws see them, made by hand.
#pragma once

#include <gtest/gtest.h>

#include "drive/seen.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"

namespace meshless::test {

inline SeenBody bodyOf(const std::string& name, const TriangleMesh& mesh, const Vec3& at = Vec3::Zero()) {
  SeenBody body;
  body.name = name;
  body.surface = mesh;
  for (Vec3& p : body.surface.vertices) p += at;
  body.rest = body.surface.vertices;
  body.elastic = true;
  body.asleep = true;
  body.rest_volume = signedVolume(mesh);
  body.mass = 1000.0 * body.rest_volume;
  body.centre = at;
  body.diagonal = boundsOf(body.rest).diagonal();
  return body;
}

/// 0.1 m wide, with edges of 1 cm.
inline TriangleMesh fineBox() { return boxMesh(Vec3(0.1, 0.1, 0.1), 10, 10, 10); }

/// Two boxes on each other on the ground, at rest.
inline Seen sound() {
  Seen seen;
  seen.ground = 0.0;
  seen.gravity = Vec3(0, 0, -9.81);
  seen.bodies = {bodyOf("organ_1", fineBox(), Vec3(0, 0, 0.05)), bodyOf("organ_2", fineBox(), Vec3(0, 0, 0.15))};
  return seen;
}

}  // namespace meshless::test
