// Writes the organ-like meshes that the package ships.
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>

#include <CLI/CLI.hpp>

#include "meshless_surgery/geometry/hollow_organs.h"
#include "meshless_surgery/geometry/measures.h"
#include "meshless_surgery/geometry/organs.h"

namespace {

using meshless::Triangle;
using meshless::TriangleMesh;
using meshless::Vec3;

/// False, with a message, where the file cannot be written in full.
bool writeObj(const std::string& path, const std::string& comment, const TriangleMesh& mesh) {
  std::FILE* file = std::fopen(path.c_str(), "w");
  if (file == nullptr) {
    std::fprintf(stderr, "make_meshes: cannot write %s: %s\n", path.c_str(), std::strerror(errno));
    return false;
  }
  std::fprintf(file, "# %s\n", comment.c_str());
  // 17 digits give the same double back.
  for (const Vec3& p : mesh.vertices) std::fprintf(file, "v %.17g %.17g %.17g\n", p.x(), p.y(), p.z());
  for (const Triangle& t : mesh.triangles) std::fprintf(file, "f %u %u %u\n", t[0] + 1, t[1] + 1, t[2] + 1);
  const bool complete = std::ferror(file) == 0;
  const bool closed = std::fclose(file) == 0;
  if (!complete || !closed) {
    std::fprintf(stderr, "make_meshes: cannot write all of %s: %s\n", path.c_str(), std::strerror(errno));
    return false;
  }
  std::printf("%s: %zu vertices, %zu triangles, %.4g m^3\n", path.c_str(), mesh.vertices.size(), mesh.triangles.size(),
              meshless::signedVolume(mesh));
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Writes liver.obj, kidney.obj, fish.obj, bladder.obj, skin.obj, block.obj, gallbladder.obj, stomach.obj, "
      "vessel.obj "
      "and omentum.obj.");
  std::string folder;
  unsigned seed = 1;
  app.add_option("--out", folder, "folder to write into; it must exist")->required()->check(CLI::ExistingDirectory);
  app.add_option("--seed", seed, "same seed, same meshes")->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  const std::string seeded = "made by make_meshes --seed " + std::to_string(seed) + "; metres";
  const std::string fixed = "made by make_meshes (does not depend on the seed); metres";
  const bool written = writeObj(folder + "/liver.obj", seeded, meshless::liverMesh(seed)) &&
                       writeObj(folder + "/kidney.obj", seeded, meshless::kidneyMesh(seed)) &&
                       writeObj(folder + "/fish.obj", seeded, meshless::fishMesh(seed)) &&
                       writeObj(folder + "/bladder.obj", fixed, meshless::bladderMesh()) &&
                       writeObj(folder + "/skin.obj", fixed, meshless::skinSlabMesh()) &&
                       writeObj(folder + "/block.obj", fixed, meshless::block32Mesh()) &&
                       writeObj(folder + "/gallbladder.obj", fixed, meshless::gallbladderMesh()) &&
                       writeObj(folder + "/stomach.obj", fixed, meshless::stomachMesh()) &&
                       writeObj(folder + "/vessel.obj", fixed, meshless::vesselMesh()) &&
                       writeObj(folder + "/omentum.obj", fixed, meshless::omentumMesh());
  return written ? 0 : 1;
}
