// Writes the organ-like meshes that the package ships.
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>

#include <CLI/CLI.hpp>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/hollow_organs.h"
#include "shapes/instruments.h"
#include "shapes/organs.h"

namespace {

using meshless::Triangle;
using meshless::TriangleMesh;
using meshless::Vec3;

constexpr double kSmoothUpTo = 0.7;  // cosine between faces that share a normal

/// One a corner of a triangle: the mean of the faces around its vertex that are nearly in its plane.
meshless::Points cornerNormals(const TriangleMesh& mesh) {
  meshless::Points faces, normals;
  std::vector<std::vector<std::size_t>> around(mesh.vertices.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& corners = mesh.triangles[t];
    const Vec3& a = mesh.vertices[corners[0]];
    faces.push_back((mesh.vertices[corners[1]] - a).cross(mesh.vertices[corners[2]] - a));
    for (const auto v : corners) around[v].push_back(t);
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const auto v : mesh.triangles[t]) {
      Vec3 normal = Vec3::Zero();
      for (const std::size_t other : around[v])
        if (faces[other].dot(faces[t]) >= kSmoothUpTo * faces[other].norm() * faces[t].norm()) normal += faces[other];
      normals.push_back(normal.normalized());
    }
  return normals;
}

/// False, with a message, where the file cannot be written in full. What is drawn alone has normals.
bool writeObj(const std::string& path, const std::string& comment, const TriangleMesh& mesh, bool drawn = false) {
  std::FILE* file = std::fopen(path.c_str(), "w");
  if (file == nullptr) {
    std::fprintf(stderr, "make_meshes: cannot write %s: %s\n", path.c_str(), std::strerror(errno));
    return false;
  }
  std::fprintf(file, "# %s\n", comment.c_str());
  // 17 digits give the same double back.
  for (const Vec3& p : mesh.vertices) std::fprintf(file, "v %.17g %.17g %.17g\n", p.x(), p.y(), p.z());
  if (drawn) {
    for (const Vec3& n : cornerNormals(mesh)) std::fprintf(file, "vn %.4f %.4f %.4f\n", n.x(), n.y(), n.z());
    std::size_t corner = 0;
    for (const Triangle& t : mesh.triangles) {
      std::fprintf(file, "f");
      for (const auto v : t) std::fprintf(file, " %u//%zu", v + 1, ++corner);
      std::fprintf(file, "\n");
    }
  } else {
    for (const Triangle& t : mesh.triangles) std::fprintf(file, "f %u %u %u\n", t[0] + 1, t[1] + 1, t[2] + 1);
  }
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
      "vessel.obj, omentum.obj, peg_triangle.obj "
      "and cup.obj, and the parts of the instruments that are drawn.");
  std::string folder, drawn;
  unsigned seed = 1;
  app.add_option("--out", folder, "folder to write into; it must exist")->required()->check(CLI::ExistingDirectory);
  app.add_option("--seed", seed, "same seed, same meshes")->capture_default_str();
  app.add_option("--instruments", drawn, "folder for the instruments; it must exist")->check(CLI::ExistingDirectory);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;  // --help is no error
  }

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
                       writeObj(folder + "/omentum.obj", fixed, meshless::omentumMesh()) &&
                       writeObj(folder + "/peg_triangle.obj", fixed, meshless::pegTriangleMesh()) &&
                       writeObj(folder + "/cup.obj", fixed, meshless::cupMesh());
  if (!written) return 1;
  if (drawn.empty()) return 0;
  const bool drawn_too = writeObj(drawn + "/shaft.obj", fixed, meshless::shaftMesh(), true) &&
                         writeObj(drawn + "/grasping_jaw.obj", fixed, meshless::graspingJawMesh(), true) &&
                         writeObj(drawn + "/scissors_blade.obj", fixed, meshless::scissorsBladeMesh(), true) &&
                         writeObj(drawn + "/scalpel.obj", fixed, meshless::scalpelMesh(), true);
  return drawn_too ? 0 : 1;
}
