// What the fuzzers feed with bytes: mesh files, scene files, cuts. Each is run by libFuzzer (scripts/fuzz) and, over
// test/corpus/fuzz, by an ordinary test. What breaks a law aborts.
#pragma once

#include <filesystem>
#include <fstream>

#include <unistd.h>

#include "fuzz/cuts.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "meshless_surgery/io/scene.h"

namespace meshless::fuzz {

/// A folder of this process alone, for the files that are read.
inline const std::string& folder() {
  static const std::string path = [] {
    const auto made = std::filesystem::temp_directory_path() / ("meshless_fuzz_" + std::to_string(::getpid()));
    std::filesystem::create_directories(made);
    return std::filesystem::canonical(made).string();  // as files are read: without links
  }();
  return path;
}

inline std::string write(const std::string& name, const std::uint8_t* data, std::size_t size) {
  const std::string path = folder() + "/" + name;
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  return path;
}

/// The first byte chooses the ending, the rest is the file.
inline void meshFile(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return;
  const char* const endings[] = {"obj", "ply", "stl", "pcd", "vtk", "off", "vtu", "msh"};
  FileTexture texture;
  const Result<TriangleMesh> read =
      readMeshFile(write(std::string("m.") + endings[data[0] % 8], data + 1, size - 1), nullptr, &texture);
  if (!read) {
    demand(!read.error().detail.empty(), "a refusal says why");
    return;
  }
  demand(!read->vertices.empty(), "what was read has points");
  if (read->triangles.empty() || read->triangles.size() > 500 || read->vertices.size() > 1000) return;
  const auto map = TextureMap::make(*read, texture.corners);
  demand(map || texture.corners.size() == 3 * read->triangles.size() || texture.corners.empty(), "three a triangle");
  const Result<RepairedMesh> repaired = repairMesh(*read);
  if (!repaired) {
    demand(!repaired.error().detail.empty(), "a refusal says why");
    return;
  }
  for (const Vec3& p : repaired->mesh.vertices) demand(p.allFinite(), "a repaired mesh is finite");
  for (const Triangle& t : repaired->mesh.triangles)
    for (Index corner : t) demand(corner < repaired->mesh.vertices.size(), "corners are vertices");
  if (repaired->solid) demand(inspectMesh(repaired->mesh, false).closed(), "a solid is closed");
}

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
