// The fuzzer of mesh files; see targets.h.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include <unistd.h>

#include "fuzz/demand.h"
#include "meshless_surgery/geometry/mesh/mend.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "meshless_surgery/geometry/mesh/texture_map.h"
#include "meshless_surgery/io/files.h"

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

inline void repaired(const Result<RepairedMesh>& made) {
  if (!made) {
    demand(!made.error().detail.empty(), "a refusal says why");
    return;
  }
  for (const Vec3& p : made->mesh.vertices) demand(p.allFinite(), "a repaired mesh is finite");
  for (const Triangle& t : made->mesh.triangles)
    for (Index corner : t) demand(corner < made->mesh.vertices.size(), "corners are vertices");
  if (made->solid) demand(inspectMesh(made->mesh, false).closed(), "a solid is closed");
}

/// The first byte chooses the ending, the rest is the file.
inline void meshFile(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return;
  const char* const endings[] = {"obj", "ply", "stl", "pcd", "vtk", "off", "vtu", "msh", "vtp"};
  FileTexture texture;
  const Result<TriangleMesh> read =
      readMeshFile(write(std::string("m.") + endings[data[0] % 9], data + 1, size - 1), nullptr, &texture);
  if (!read) {
    demand(!read.error().detail.empty(), "a refusal says why");
    return;
  }
  demand(!read->vertices.empty(), "what was read has points");
  if (read->triangles.empty() || read->triangles.size() > 500 || read->vertices.size() > 1000) return;
  const auto map = TextureMap::make(*read, texture.corners);
  demand(map || texture.corners.size() == 3 * read->triangles.size() || texture.corners.empty(), "three a triangle");
  repaired(repairMesh(*read));
  if (read->triangles.size() <= 60) repaired(repairMesh(*read, MeshRepair::kMend));
}

}  // namespace meshless::fuzz
