// What the fuzzers feed with bytes: mesh files, scene files, cuts. Each is run by libFuzzer (scripts/fuzz) and, over
// test/corpus/fuzz, by an ordinary test. What breaks a law aborts.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>

#include <unistd.h>

#include "meshless_surgery/geometry/incise.h"
#include "meshless_surgery/geometry/measures.h"
#include "meshless_surgery/geometry/mesh_check.h"
#include "meshless_surgery/io/scene.h"
#include "support/shapes.h"

namespace meshless::fuzz {

inline void demand(bool law, const char* what) {
  if (law) return;
  std::cerr << "broken: " << what << std::endl;
  std::abort();
}

/// A folder of this process alone, for the files that are read.
inline const std::string& folder() {
  static const std::string path = [] {
    const auto made = std::filesystem::temp_directory_path() / ("meshless_fuzz_" + std::to_string(::getpid()));
    std::filesystem::create_directories(made);
    return made.string();
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
  const char* const endings[] = {"obj", "ply", "stl", "pcd", "vtk"};
  const Result<TriangleMesh> read = readMeshFile(write(std::string("m.") + endings[data[0] % 5], data + 1, size - 1));
  if (!read) {
    demand(!read.error().detail.empty(), "a refusal says why");
    return;
  }
  demand(!read->vertices.empty(), "what was read has points");
  if (read->triangles.empty() || read->triangles.size() > 500 || read->vertices.size() > 1000) return;
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

/// The first byte chooses a shape. Then thirteen bytes a cut: what it is, and six numbers of its plane or blade.
inline void cutPlane(const std::uint8_t* data, std::size_t size) {
  static const std::vector<shapes::Shape> all = shapes::simpleShapes();
  if (size < 1) return;
  TriangleMesh mesh = all[data[0] % all.size()].mesh;
  for (std::size_t at = 1, cuts = 0; at + 13 <= size && cuts < 8; at += 13, ++cuts) {
    double number[6];
    for (int k = 0; k < 6; ++k)
      number[k] = static_cast<std::int16_t>(data[at + 1 + 2 * k] | data[at + 2 + 2 * k] << 8) / 32768.0;
    Vec3 normal(number[0], number[1], number[2]);
    // Few bits: planes along axes, through vertices, almost in faces.
    if (data[at] & 1)
      for (int k = 0; k < 3; ++k) normal[k] = std::round(normal[k]);
    if (!(normal.norm() > 1e-9)) continue;
    normal.normalize();
    const double volume = signedVolume(mesh);
    Vec3 point = 0.12 * Vec3(number[3], number[4], number[5]);
    if (data[at] & 2) point = mesh.vertices[static_cast<std::size_t>(data[at + 7]) % mesh.vertices.size()];
    std::vector<TriangleMesh> pieces;
    if (data[at] & 4) {
      Blade blade;
      blade.y_axis = normal;
      blade.x_axis = normal.unitOrthogonal();
      blade.origin = point;
      blade.length = 0.02 + 0.3 * std::abs(number[4]);
      blade.depth = 0.01 + 0.2 * std::abs(number[5]);
      Result<Incision> opened = incise(mesh, blade);
      if (!opened) {
        demand(!opened.error().detail.empty(), "a refusal says why");
        continue;
      }
      for (IncisedPiece& piece : opened->pieces) pieces.push_back(std::move(piece.mesh));
    } else {
      CutOptions options;
      options.check_pieces = true;
      Result<CutSurface> cut = cutByPlane(mesh, {normal, point}, options);
      if (!cut) {
        demand(!cut.error().detail.empty(), "a refusal says why");
        continue;
      }
      for (CutPiece& piece : cut->pieces) pieces.push_back(std::move(piece.mesh));
    }
    double sum = 0.0;
    for (const TriangleMesh& piece : pieces) {
      for (const Vec3& p : piece.vertices) demand(p.allFinite(), "a piece is finite");
      sum += signedVolume(piece);
    }
    demand(std::abs(sum - volume) <= 1e-8 * std::pow(boundsOf(mesh.vertices).diagonal(), 3.0), "volumes add up");
    mesh = std::move(pieces[data[at] % pieces.size()]);
    if (mesh.triangles.size() > 5000) return;
  }
}

}  // namespace meshless::fuzz
