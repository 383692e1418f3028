// What the fuzzers feed with bytes: mesh files, scene files, cuts. Each is run by libFuzzer (scripts/fuzz) and, over
// test/corpus/fuzz, by an ordinary test. What breaks a law aborts.
#pragma once

#include "fuzz/cuts.h"
#include "fuzz/mesh_files.h"
#include "meshless_surgery/io/scene.h"

namespace meshless::fuzz {

inline void sceneFile(const std::uint8_t* data, std::size_t size) {
  FileAccess access;
  access.folders = {folder()};
  const Result<SceneDef> scene = readScene(write("scene.yaml", data, size), access);
  if (!scene) {
    demand(!scene.error().detail.empty(), "a refusal says why");
    return;
  }
  demand(scene->world.validate().ok(), "a world that was read is valid");
  for (const auto& [name, material] : scene->materials) demand(material.validate().ok(), "so are its materials");
  for (const BodyDef& body : scene->bodies) {
    demand(body.material.validate().ok(), "and those of bodies");
    demand(body.pose.translation.allFinite() && body.pose.rotation.coeffs().allFinite(), "poses are finite");
  }
}

}  // namespace meshless::fuzz
