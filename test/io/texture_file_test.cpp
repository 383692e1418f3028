// Texture coordinates of OBJ and PLY files.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <limits>

#include "io/temporary_folder.h"
#include "meshless_surgery/io/scene.h"
#include "meshless_surgery/world/baked_colors.h"
#include "support/textured.h"

namespace meshless {
namespace texture_file_test {

using test::TexturedCube;

std::string text(double x) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, "%.9g", x);
  return buffer;
}

std::string vertexLines(const TexturedCube& cube, double scale = 1.0, const std::string& first = "v ") {
  std::string out;
  for (const Vec3& p : cube.mesh.vertices)
    out += first + text(scale * p.x()) + " " + text(scale * p.y()) + " " + text(scale * p.z()) + "\n";
  return out;
}
std::string replaced(std::string in, const std::string& what, const std::string& by) {
  for (std::size_t at = in.find(what); at != std::string::npos; at = in.find(what, at + by.size()))
    in.replace(at, what.size(), by);
  return in;
}

/// corner(v, k): a corner at vertex v with the k-th line vt, both from 1 on.
template <class Corner>
std::string obj(const TexturedCube& cube, const Corner& corner, double scale = 1.0) {
  std::string out = "mtllib nowhere.mtl\no cube\n" + vertexLines(cube, scale) + "vn 0 0 1\nusemtl skin\n";
  for (const TexturePoint& p : cube.points) out += "vt " + text(p[0]) + " " + text(p[1]) + "\n";
  for (std::size_t t = 0; t < cube.mesh.triangles.size(); ++t) {
    out += "f";
    for (std::size_t k = 0; k < 3; ++k) out += " " + corner(cube.mesh.triangles[t][k] + 1, 3 * t + k + 1);
    out += "\n";
  }
  return out;
}
std::string objText(const TexturedCube& cube, double scale = 1.0) {
  return obj(
      cube, [](std::size_t v, std::size_t k) { return std::to_string(v) + "/" + std::to_string(k); }, scale);
}

/// The six sides as they are, each one face.
std::string quads(const TexturedCube& cube) {
  std::string out = vertexLines(cube), faces;
  int count = 0;
  for (std::size_t t = 0; t + 1 < cube.mesh.triangles.size(); t += 2) {  // two triangles each
    std::vector<Index> corners(cube.mesh.triangles[t].begin(), cube.mesh.triangles[t].end());
    const Triangle& other = cube.mesh.triangles[t + 1];
    for (const Index v : other)
      if (std::find(corners.begin(), corners.end(), v) == corners.end()) {
        // Between the two that the other triangle shares.
        for (std::size_t k = 0; k < 3; ++k)
          if (std::find(other.begin(), other.end(), corners[k]) != other.end() &&
              std::find(other.begin(), other.end(), corners[(k + 1) % 3]) != other.end()) {
            corners.insert(corners.begin() + static_cast<std::ptrdiff_t>(k) + 1, v);
            break;
          }
        break;
      }
    const int side = test::sideOf(TexturedCube::normal(cube.mesh.vertices, cube.mesh.triangles[t]));
    faces += "f";
    for (const Index v : corners) {
      const TexturePoint at = cube.at(side, cube.mesh.vertices[v]);
      out += "vt " + text(at[0]) + " " + text(at[1]) + "\n";
      faces += " " + std::to_string(v + 1) + "/" + std::to_string(++count);
    }
    faces += "\n";
  }
  return out + faces;
}

/// Vertices that seams double, with their coordinates under the names.
std::string plyOfVertices(const TexturedCube& cube, const std::string& u, const std::string& v, bool binary) {
  std::string out =
      std::string("ply\nformat ") + (binary ? "binary_little_endian" : "ascii") + " 1.0\nelement vertex " +
      std::to_string(cube.points.size()) + "\nproperty float x\nproperty float " + u +
      "\nproperty float y\nproperty uchar red\nproperty float z\nproperty float " + v + "\nelement face " +
      std::to_string(cube.mesh.triangles.size()) + "\nproperty list uchar int vertex_indices\nend_header\n";
  const auto put = [&](auto number, bool last = false) {
    if (binary)
      out.append(reinterpret_cast<const char*>(&number), sizeof number);
    else
      out += text(static_cast<double>(number)) + (last ? "\n" : " ");
  };
  for (std::size_t c = 0; c < cube.points.size(); ++c) {
    const Vec3& p = cube.mesh.vertices[cube.mesh.triangles[c / 3][c % 3]];
    put(static_cast<float>(p.x()));
    put(cube.points[c][0]);
    put(static_cast<float>(p.y()));
    put(std::uint8_t{200});
    put(static_cast<float>(p.z()));
    put(cube.points[c][1], true);
  }
  for (int t = 0; t < static_cast<int>(cube.mesh.triangles.size()); ++t) {
    put(std::uint8_t{3});
    for (int k = 0; k < 3; ++k) put(3 * t + k, k == 2);
  }
  return out;
}

/// As MeshLab writes them: a list a face.
std::string plyOfFaces(const TexturedCube& cube, std::size_t numbers = 6) {
  std::string out = "ply\nformat ascii 1.0\ncomment TextureFile skin.png\nelement vertex " +
                    std::to_string(cube.mesh.vertices.size()) +
                    "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
                    std::to_string(cube.mesh.triangles.size()) +
                    "\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int "
                    "texnumber\nend_header\n" +
                    vertexLines(cube, 1.0, "");
  for (std::size_t t = 0; t < cube.mesh.triangles.size(); ++t) {
    out += "3";
    for (const Index v : cube.mesh.triangles[t]) out += " " + std::to_string(v);
    out += " " + std::to_string(numbers);
    for (std::size_t k = 0; k < numbers; ++k) out += " " + text(cube.points[3 * t + k / 2][k % 2]);
    out += " 0\n";
  }
  return out;
}

void expectCube(const TextureMap& map, const TexturedCube& cube, double scale, const std::string& of) {
  const TriangleMesh& mesh = map.surface();
  ASSERT_EQ(cube.mesh.triangles.size(), mesh.triangles.size()) << of;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_LT(test::apart(cube.at(test::sideOf(TexturedCube::normal(mesh.vertices, mesh.triangles[t])),
                                    mesh.vertices[mesh.triangles[t][k]] / scale),
                            map.points()[3 * t + k]),
                2e-6f)
          << of << " " << t;
}

TEST(TextureFiles, CoordinatesAreReadAsTheyAre) {
  const TemporaryFolder folder;
  const TexturedCube cube(0.1, 2);
  const auto number = [](auto n) { return std::to_string(n); };
  const long long vertices = static_cast<long long>(cube.mesh.vertices.size()),
                  points = static_cast<long long>(cube.points.size());
  struct File {
    std::string name, content;
  };
  std::string later = objText(cube);  // faces before their coordinates
  const std::size_t vt = later.find("vt "), f = later.find("f ", vt);
  later = later.substr(0, vt) + later.substr(f) + later.substr(vt, f - vt);
  const std::vector<File> files{
      {"plain.obj", objText(cube)},
      {"normals.obj", obj(cube, [&](auto v, auto k) { return number(v) + "/" + number(k) + "/1"; })},
      {"negative.obj", obj(cube,
                           [&](auto v, auto k) {
                             return number(static_cast<long long>(v) - vertices - 1) + "/" +
                                    number(static_cast<long long>(k) - points - 1);
                           })},
      {"crlf.obj", replaced(objText(cube), "\n", "\r\n")},
      {"depth.obj", replaced(objText(cube), "\nvt", " 0.0\nvt")},
      {"continued.obj", replaced(objText(cube), "\nf ", "\nf \\\n")},
      {"later.obj", later},
      {"quads.obj", quads(cube)},
      {"faces.ply", plyOfFaces(cube)},
      {"st.ply", plyOfVertices(cube, "s", "t", false)},
      {"uv.ply", plyOfVertices(cube, "u", "v", true)},
      {"meshlab.ply", plyOfVertices(cube, "texture_u", "texture_v", true)},
      {"paraview.ply", plyOfVertices(cube, "texture_s", "texture_t", false)}};
  for (const File& file : files) {
    const auto shape = loadShape(folder.write(file.name, file.content), 1.0);
    ASSERT_TRUE(shape.ok()) << file.name << ": " << shape.error().detail;
    ASSERT_TRUE(shape->texture) << file.name << ": " << (shape->notes.empty() ? "" : shape->notes.back());
    expectCube(*shape->texture, cube, 1.0, file.name);
    EXPECT_TRUE(shape->solid);
  }
}

TEST(TextureFiles, AreScaledAndMirroredAndRepeat) {
  const TemporaryFolder folder;
  for (const bool mirrored : {false, true}) {
    const TexturedCube cube(0.1, 2, mirrored);
    const auto shape = loadShape(folder.write("mm.obj", objText(cube, 1000.0)), 0.001);
    ASSERT_TRUE(shape.ok() && shape->texture);
    expectCube(*shape->texture, cube, 1.0, "mm");
  }
  TexturedCube cube(0.1, 2);
  for (TexturePoint& p : cube.points) p = {p[0] + 3.0f, p[1] - 2.0f};
  const auto shape = loadShape(folder.write("beyond.obj", objText(cube)), 1.0);
  ASSERT_TRUE(shape.ok() && shape->texture);
  for (std::size_t c = 0; c < cube.points.size(); ++c) {
    const TexturePoint p = shape->texture->points()[c];
    const Color there = colorAt(test::sixColors(), Color(), p),
                once = colorAt(test::sixColors(), Color(), {p[0] - 3.0f, p[1] + 2.0f});
    EXPECT_NEAR(once.r, there.r, 1e-3);
    EXPECT_NEAR(once.b, there.b, 1e-3);
  }
}

// The shape is read all the same.
TEST(TextureFiles, WhatIsWrongWithThemIsSaidAndTheyAreLeftOut) {
  const TemporaryFolder folder;
  const TexturedCube cube(0.1, 2);
  TexturedCube broken = cube;
  broken.points[5][1] = std::numeric_limits<float>::quiet_NaN();
  const std::string good = objText(cube);
  const std::size_t face = good.find("\nf ") + 1, end = good.find('\n', face);
  const auto line =
      std::to_string(std::count(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(face), '\n') + 1);
  std::string without = good;
  std::string corners = "f";
  for (const Index v : cube.mesh.triangles[0]) corners += " " + std::to_string(v + 1);
  without.replace(face, end - face, corners);
  const std::string last = std::to_string(cube.points.size()), beyond = std::to_string(cube.points.size() + 1);
  struct File {
    std::string name, content, word;
  };
  const std::vector<File> files{
      {"without.obj", without, "line " + line + " has none"},
      {"beyond.obj", replaced(good, "/" + last + "\n", "/" + beyond + "\n"),
       "number " + beyond + "; accepted: 1 to " + last},
      {"far.obj", replaced(good, "/" + last + "\n", "/99999999999999999999\n"), "accepted: 1 to " + last},
      {"zero.obj", replaced(good, "/" + last + "\n", "/0\n"), "has none"},
      {"before.obj", replaced(good, "/" + last + "\n", "/-9999\n"), "has none"},
      {"nan.obj", replaced(good, "\nvt ", "\nvt nan "), "not finite"},
      {"word.obj", replaced(good, "\nvt ", "\nvt left "), "not finite"},
      {"large.obj", replaced(good, "\nvt ", "\nvt 1e300 "), "not finite"},
      {"empty.obj", replaced(good, "\nvt ", "\nvn "), "accepted: 1 to 0"},
      {"short.ply", plyOfFaces(cube, 4), "3 corners has 4 numbers"},
      {"nan.ply", plyOfVertices(broken, "s", "t", false), "not finite"}};
  for (const File& file : files) {
    const auto shape = loadShape(folder.write(file.name, file.content), 1.0);
    ASSERT_TRUE(shape.ok()) << file.name << ": " << shape.error().detail;
    EXPECT_EQ(cube.mesh.triangles.size(), shape->mesh.triangles.size()) << file.name;
    EXPECT_FALSE(shape->texture) << file.name;
    std::string said;
    for (const std::string& note : shape->notes) said += note + "\n";
    EXPECT_NE(std::string::npos, said.find(file.name + ": its texture coordinates are not used: ")) << said;
    EXPECT_NE(std::string::npos, said.find(file.word)) << file.name << ": " << said;
  }
  // None at all is nothing to speak of.
  const auto plain =
      loadShape(folder.write("plain.obj", obj(cube, [](auto v, auto) { return std::to_string(v); })), 1.0);
  ASSERT_TRUE(plain.ok());
  EXPECT_FALSE(plain->texture);
  EXPECT_TRUE(plain->notes.empty());
}

/// The share of the outer surface whose triangles show their side's part; a place is on the side that it is nearest to.
double shareAsInTheFile(const BodyModel& model, const Material& material, const TexturedCube& cube, float within) {
  const VertexColors colors = bakeColors(model, material);
  if (colors.texture.empty()) return 0.0;
  double right = 0.0, all = 0.0;
  for (std::size_t t = 0; t < model.surface.triangles.size(); ++t) {
    std::array<Vec3, 3> own;
    for (std::size_t k = 0; k < 3; ++k) own[k] = model.own * model.surface.vertices[model.surface.triangles[t][k]];
    const Vec3 middle = (own[0] + own[1] + own[2]) / 3.0;
    const double area = (own[1] - own[0]).cross(own[2] - own[0]).norm();
    const int side = test::sideOf(middle);
    bool good = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 on = own[k].cwiseMax(-0.5 * cube.size).cwiseMin(0.5 * cube.size);
      good = good && test::apart(cube.at(side, on), colors.texture[3 * t + k]) < within;
    }
    all += area;
    right += good ? area : 0.0;
  }
  return right / all;
}

TEST(TextureFiles, AreOnScenesBodiesWhateverIsMadeOfThem) {
  const TemporaryFolder folder;
  const TexturedCube cube(0.1, 8);
  folder.write("cube.obj", objText(cube, 1000.0));
  // With a flap that crosses it, so that it needs a wrap.
  std::string flap = objText(cube, 1000.0);
  const auto n = static_cast<Index>(cube.mesh.vertices.size());
  flap += "v -20 -20 40\nv 20 -20 40\nv 0 20 60\nf " + std::to_string(n + 1) + "/1 " + std::to_string(n + 2) + "/1 " +
          std::to_string(n + 3) + "/1\n";
  folder.write("flap.obj", flap);
  // Two that overlap.
  TexturedCube two = cube;
  for (const Vec3& v : cube.mesh.vertices) two.mesh.vertices.push_back(v + Vec3(0.05, 0.013, 0.017));
  for (const Triangle& t : cube.mesh.triangles) two.mesh.triangles.push_back({t[0] + n, t[1] + n, t[2] + n});
  two.points.insert(two.points.end(), cube.points.begin(), cube.points.end());
  folder.write("two.obj", objText(two, 1000.0));
  const std::string path =
      folder.write("scene.yaml",
                   "bodies:\n"
                   "  - {name: plain, file: cube.obj, units: mm, material: liver}\n"
                   "  - {name: wall, file: cube.obj, units: mm, thickness: 0.02, spacing: 0.01, "
                   "material: liver}\n"
                   "  - {name: wrapped, file: flap.obj, units: mm, repair: wrap, material: liver}\n"
                   "  - {name: united, file: two.obj, units: mm, material: liver}\n"
                   "materials: {liver: {mode: linear, alpha: 0.5, beta: 0.5}}\n");
  FileAccess access;
  access.folders = {folder.path()};
  const auto scene = readScene(path, access);
  ASSERT_TRUE(scene.ok()) << scene.error().detail;
  ASSERT_EQ(4u, scene->bodies.size());
  for (BodyDef def : scene->bodies) {
    ASSERT_TRUE(def.texture) << def.name << (def.notes.empty() ? "" : def.notes.back());
    def.material.appearance.outer = test::sixColors();
    const auto body = prepareBody(def);
    ASSERT_TRUE(body.ok()) << body.error().detail;
    if (def.name == "united") {
      // Parts of what one of the two had there.
      EXPECT_LT(body->model->surface.triangles.size(), 3 * two.mesh.triangles.size());
      const VertexColors colors = bakeColors(*body->model, def.material);
      for (std::size_t c = 0; c < colors.texture.size(); ++c) {
        const Triangle& t = body->model->surface.triangles[c / 3];
        Points own;
        for (const Index v : t) own.push_back(body->model->own * body->model->surface.vertices[v]);
        const Vec3 normal = (own[1] - own[0]).cross(own[2] - own[0]);
        if (normal.norm() < 1e-8) continue;
        const int side = test::sideOf(normal);
        const Vec3 place = own[c % 3];
        EXPECT_LT(std::min(test::apart(cube.at(side, place), colors.texture[c]),
                           test::apart(cube.at(side, place - Vec3(0.05, 0.013, 0.017)), colors.texture[c])),
                  1e-4f);
      }
      continue;
    }
    const double share = shareAsInTheFile(*body->model, def.material, cube, def.name == "plain" ? 2e-6f : 0.02f);
    std::printf("%s: %.4f of the surface is as in the file\n", def.name.c_str(), share);
    EXPECT_GT(share, def.name == "plain" ? 0.999999 : 0.85) << def.name;
  }
}

}  // namespace texture_file_test
}  // namespace meshless
