// Files as other programs write them: texts of every kind, faces of any shape, and coordinates in all their digits.
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>

#include "io/temporary_folder.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/io/files.h"
#include "meshless_surgery/io/scene.h"

namespace meshless {
namespace odd_files_test {

const TriangleMesh& ball() {
  static const TriangleMesh mesh = sphereMesh(0.03, 0.01);
  return mesh;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

std::string number(const char* format, double x) {
  char text[64];
  std::snprintf(text, sizeof text, format, x);
  return text;
}

std::string obj(const char* format = "%.9f", const std::string& first = "v ", const std::string& between = " ") {
  std::string text;
  for (const Vec3& p : ball().vertices)
    text += first + number(format, p.x()) + between + number(format, p.y()) + between + number(format, p.z()) + "\n";
  for (const Triangle& t : ball().triangles)
    text += "f " + std::to_string(t[0] + 1) + " " + std::to_string(t[1] + 1) + " " + std::to_string(t[2] + 1) + "\n";
  return text;
}

std::string stl(const std::string& solid = "solid organ", const char* format = "%.9e") {
  std::string text = solid + "\n";
  for (const Triangle& t : ball().triangles) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const Index v : t) {
      const Vec3& p = ball().vertices[v];
      text += "vertex " + number(format, p.x()) + " " + number(format, p.y()) + " " + number(format, p.z()) + "\n";
    }
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid organ\n";
}

std::string binaryStl(const std::string& head, long more = 0, std::uint16_t attribute = 0,
                      const std::string& tail = "") {
  std::string text = head;
  text.resize(80, ' ');
  const auto put = [&](const auto& value) { text.append(reinterpret_cast<const char*>(&value), sizeof value); };
  put(static_cast<std::uint32_t>(static_cast<long>(ball().triangles.size()) + more));
  for (const Triangle& t : ball().triangles) {
    for (int k = 0; k < 3; ++k) put(0.0f);
    for (const Index v : t)
      for (int k = 0; k < 3; ++k) put(static_cast<float>(ball().vertices[v][k]));
    put(attribute);
  }
  return text + tail;
}

// A byte-order mark, tabs, decimal commas, ends of lines, exponents of Windows and Fortran, names of any length,
// "solid" behind blanks and in front of binary triangles, bytes behind them: trackers of tinyobjloader, MeshLab,
// three.js, assimp, trimesh and ITK have one each.
TEST(OddFiles, AreReadRightAsTextComes) {
  const std::string mark = "\xEF\xBB\xBF";
  const std::pair<std::string, std::string> files[] = {
      {"mark.obj", mark + obj()},
      {"tab.obj", obj("%.9f", "v\t", "\t")},
      {"comma.obj", replaced(obj(), ".", ",")},
      {"no_newline.obj", obj().substr(0, obj().size() - 1)},
      {"cr.obj", replaced(obj(), "\n", "\r")},
      {"crlf.obj", replaced(obj(), "\n", "\r\n")},
      {"windows.obj", replaced(replaced(obj("%.9e"), "e-", "e-0"), "e+", "e+0")},
      {"fortran.obj", replaced(replaced(obj("%.9e"), "e-", "D-"), "e+", "D+")},
      {"long.stl", stl("solid " + std::string(400, 'n') + std::string(60, '/'))},
      {"letters.stl", stl("solid L\xC3\xA4ppchen \xE2\x98\x82")},
      {"comma.stl", replaced(stl(), ".", ",")},
      {"windows.stl", replaced(replaced(stl(), "e-", "e-0"), "e+", "e+0")},
      {"fortran.stl", replaced(replaced(stl(), "e-", "D-"), "e+", "D+")},
      {"cr.stl", replaced(stl(), "\n", "\r")},
      {"crlf.stl", replaced(stl(), "\n", "\r\n")},
      {"no_newline.stl", stl().substr(0, stl().size() - 1)},
      {"blanks.stl", stl("  solid organ")},
      {"capitals.stl", replaced(replaced(stl("SOLID ORGAN"), "vertex", "VERTEX"), "endsolid", "ENDSOLID")},
      {"mark.stl", mark + stl()},
      {"two.stl", stl().substr(0, stl().find("endsolid")) + "endsolid organ\nsolid other\nendsolid other\n"},
      {"one_line.stl",
       replaced(replaced(replaced(replaced(stl(), "0 0 0\nouter", "0 0 0 outer"), "\nvertex", " vertex"), "\nendloop",
                         " endloop"),
                "\nendfacet", " endfacet")},
      {"solid.stl", binaryStl("solid from a CAD program")},
      {"attribute.stl", binaryStl("x", 0, 0x7fff)},
      {"tail.stl", binaryStl("x", 0, 0, std::string(37, '\0'))},
      {"solid_tail.stl", binaryStl("solid", 0, 0, std::string(37, '\0'))},
  };
  const TemporaryFolder folder;
  for (const auto& [name, text] : files) {
    const Result<TriangleMesh> read = readMeshFile(folder.write(name, text));
    ASSERT_TRUE(read.ok()) << name << ": " << read.error().detail;
    EXPECT_EQ(ball().vertices.size(), read->vertices.size()) << name;
    EXPECT_NEAR(signedVolume(ball()), signedVolume(*read), 1e-6 * signedVolume(ball())) << name;
  }
}

TEST(OddFiles, AreRefusedByWhatIsWrongWithThem) {
  const std::tuple<std::string, std::string, std::string> files[] = {
      {"thousands.obj", replaced(obj(), "f 1 ", "f 1,234 "), "'1,234' is no vertex number"},
      {"no_end.stl", replaced(stl(), "endsolid organ\n", ""),
       "no endsolid behind its " + std::to_string(ball().triangles.size())},
      {"empty.stl", "solid Empty\nendsolid Empty", "has no triangles"},
      {"count_zero.stl", binaryStl("x", -static_cast<long>(ball().triangles.size())),
       "promises 0 triangles at byte 80"},
      {"count_more.stl", binaryStl("x", 1), "promises " + std::to_string(ball().triangles.size() + 1) + " triangles"},
      {"four.stl", replaced(stl(), "endloop", "vertex 0 0 0\nendloop"), "line 7: a triangle has more than 3 corners"},
      {"two.stl", "solid\nfacet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendsolid",
       "line 6: a triangle has 2 corners"},
      {"short.stl", "solid\nfacet\nouter loop\nvertex 0 0\n", "line 4: a corner has fewer than three numbers"},
      {"word.stl", "solid\nfacet\nouter loop\nvertex 0 0 up\n", "line 4: 'up' is no number"},
      {"note.stl", "hello", "is no STL file: it has 5 bytes"},
  };
  const TemporaryFolder folder;
  for (const auto& [name, text, says] : files) {
    const Result<TriangleMesh> read = readMeshFile(folder.write(name, text));
    ASSERT_FALSE(read.ok()) << name;
    EXPECT_NE(std::string::npos, read.error().detail.find(says)) << read.error().detail;
    EXPECT_EQ(std::string::npos, read.error().detail.find("or damaged")) << read.error().detail;
  }
}

// Equal to nothing, not even to each other: each look for one would walk past all others.
TEST(OddFiles, NumbersThatAreNoneTakeNoTime) {
  const float none = std::nanf("");
  std::string text(80, ' ');
  const std::uint32_t count = 200000;
  text.append(reinterpret_cast<const char*>(&count), 4);
  for (std::uint32_t k = 0; k < count; ++k) {
    for (int n = 0; n < 12; ++n) text.append(reinterpret_cast<const char*>(&none), 4);
    text.append(2, '\0');
  }
  const TemporaryFolder folder;
  EXPECT_FALSE(loadShape(folder.write("none.stl", text), 1.0).ok());
}

// A star that crosses itself has no ears to speak of: tens of thousands of them are given up as fans.
TEST(OddFiles, FacesThatCrossThemselvesAreNotLookedAtForEver) {
  std::string text;
  for (int k = 0; k < 1000; ++k)
    text += "v " + number("%.9f", std::cos(2.0 * M_PI * 333 * k / 1000.0)) + " " +
            number("%.9f", std::sin(2.0 * M_PI * 333 * k / 1000.0)) + " 0\n";
  std::string face = "f";
  for (int k = 1; k <= 1000; ++k) face += " " + std::to_string(k);
  for (int k = 0; k < 3000; ++k) text += face + "\n";
  const TemporaryFolder folder;
  const Result<TriangleMesh> read = readMeshFile(folder.write("star.obj", text));
  ASSERT_TRUE(read.ok()) << read.error().detail;
  EXPECT_EQ(3000u * 998u, read->triangles.size());
}

TEST(OddFiles, KeepAllDigits) {
  // A triangle of a millimetre in a frame of a map, 500 km and 5,000 km from its origin.
  const Vec3 far(500000.123456, 5000000.654321, 100.0);
  const TemporaryFolder folder;
  const auto at = [&](const Vec3& p) {
    return number("%.17g", p.x()) + " " + number("%.17g", p.y()) + " " + number("%.17g", p.z()) + "\n";
  };
  const Vec3 corners[] = {far, far + Vec3(0.001, 0, 0), far + Vec3(0, 0.001, 0)};
  std::string o, f = "OFF\n3 1 0\n", v = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 double\n",
                 s = "solid\nfacet\nouter loop\n";
  for (const Vec3& p : corners) {
    o += "v " + at(p);
    f += at(p);
    v += at(p);
    s += "vertex " + at(p);
  }
  for (const auto& [name, text] : {std::make_pair("a.obj", o + "f 1 2 3\n"),
                                   {"a.off", f + "3 0 1 2\n"},
                                   {"a.vtk", v + "POLYGONS 1 4\n3 0 1 2\n"},
                                   {"a.stl", s + "endloop\nendsolid\n"}}) {
    const Result<TriangleMesh> read = readMeshFile(folder.write(name, text));
    ASSERT_TRUE(read.ok()) << name << read.error().detail;
    ASSERT_EQ(3u, read->vertices.size()) << name;
    for (int k = 0; k < 3; ++k) EXPECT_EQ(corners[k], read->vertices[static_cast<std::size_t>(k)]) << name;
  }
}

// Slicer writes one lump in LPS and another in RAS, and says so in a comment.
TEST(OddFiles, OfTwoSpacesAreBroughtTogetherOrRefused) {
  const TemporaryFolder folder;
  const auto written = [&](const std::string& name, const std::string& space, bool turned) {
    std::string text = "# 3D Slicer output. SPACE=" + space + "\n";
    for (const Vec3& p : ball().vertices) {
      const Vec3 q = p + Vec3(0.1, 0.05, 0.02);
      text += "v " + number("%.9f", turned ? -q.x() : q.x()) + " " + number("%.9f", turned ? -q.y() : q.y()) + " " +
              number("%.9f", q.z()) + "\n";
    }
    for (const Triangle& t : ball().triangles)
      text += "f " + std::to_string(t[0] + 1) + " " + std::to_string(t[1] + 1) + " " + std::to_string(t[2] + 1) + "\n";
    folder.write(name, space.empty() ? text.substr(text.find('\n') + 1) : text);
  };
  written("ras.obj", "RAS", false);
  written("lps.obj", "LPS", true);
  written("none.obj", "", false);
  const auto scene = [&](const std::string& text) {
    FileAccess access;
    access.folders = {folder.path()};
    return readScene(folder.write("scene.yaml", text), access);
  };
  const std::string both = "bodies: [{file: ras.obj}, {file: lps.obj}, {file: none.obj}]\n";
  const auto refused = scene(both);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(std::string::npos,
            refused.error().detail.find("'lps.obj' has its coordinates in LPS, and 'ras.obj' in RAS"))
      << refused.error().detail;
  const auto together = scene(both + "space: RAS\n");
  ASSERT_TRUE(together.ok()) << together.error().detail;
  for (const BodyDef& body : together->bodies) {
    Vec3 mean = Vec3::Zero();
    for (const Vec3& p : body.mesh.vertices) mean += p / static_cast<double>(body.mesh.vertices.size());
    EXPECT_NEAR(0.0, (mean - Vec3(0.1, 0.05, 0.02)).norm(), 1e-3) << body.name;
    EXPECT_GT(signedVolume(body.mesh), 0.0) << body.name;
  }
  EXPECT_NE(std::string::npos, together->bodies[1].notes[0].find("in LPS, turned to RAS"));
  EXPECT_TRUE(scene("bodies: [{file: lps.obj}, {file: none.obj}]").ok());
  EXPECT_FALSE(scene(both + "space: XYZ\n").ok());
}

/// A prism of the outline, its caps one face each, as the format writes them; its volume.
double prism(const std::vector<Vec2>& outline, const std::string& ending, std::string& text) {
  const std::size_t n = outline.size();
  double area = 0.0;
  for (std::size_t k = 0; k < n; ++k)
    area += 0.5 * (outline[k].x() * outline[(k + 1) % n].y() - outline[(k + 1) % n].x() * outline[k].y());
  std::vector<std::vector<std::size_t>> faces(2);
  for (std::size_t k = 0; k < n; ++k) {
    faces[0].push_back(n - 1 - k);
    faces[1].push_back(n + k);
    faces.push_back({k, (k + 1) % n, n + (k + 1) % n, n + k});
  }
  std::string points, cells;
  std::size_t size = 0;
  for (const double z : {0.0, 0.04})
    for (const Vec2& p : outline)
      points += (ending == "obj" ? "v " : "") + number("%.9g", p.x()) + " " + number("%.9g", p.y()) + " " +
                number("%.9g", z) + "\n";
  for (const auto& face : faces) {
    cells += ending == "obj" ? "f" : std::to_string(face.size());
    for (const std::size_t k : face) cells += " " + std::to_string(k + (ending == "obj" ? 1 : 0));
    cells += "\n";
    size += 1 + face.size();
  }
  const std::string p = std::to_string(2 * n), f = std::to_string(faces.size());
  if (ending == "obj") text = points + cells;
  if (ending == "off") text = "OFF\n" + p + " " + f + " 0\n" + points + cells;
  if (ending == "ply")
    text = "ply\nformat ascii 1.0\nelement vertex " + p +
           "\nproperty double x\nproperty double y\nproperty double z\nelement face " + f +
           "\nproperty list uchar int vertex_indices\nend_header\n" + points + cells;
  if (ending == "vtk")
    text = "# vtk DataFile Version 3.0\nprism\nASCII\nDATASET POLYDATA\nPOINTS " + p + " double\n" + points +
           "POLYGONS " + f + " " + std::to_string(size) + "\n" + cells;
  if (ending == "vtp") {
    std::string nodes, ends;
    std::size_t end = 0;
    for (const auto& face : faces) {
      for (const std::size_t k : face) nodes += std::to_string(k) + " ";
      ends += std::to_string(end += face.size()) + " ";
    }
    text = "<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"" + p + "\" NumberOfPolys=\"" + f +
           "\"><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">" + points +
           "</DataArray></Points><Polys><DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">" + nodes +
           "</DataArray><DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">" + ends +
           "</DataArray></Polys></Piece></PolyData></VTKFile>";
  }
  return 0.04 * area;
}

TEST(OddFiles, FacesOfAnyShapeKeepTheirArea) {
  std::vector<Vec2> comb{{0, 0}, {0.07, 0}}, star, spiral, round;
  for (int k = 3; k >= 0; --k) {
    comb.emplace_back(0.02 * k + 0.01, 0.05);
    comb.emplace_back(0.02 * k, 0.05);
    if (k == 0) continue;
    comb.emplace_back(0.02 * k, 0.01);
    comb.emplace_back(0.02 * k - 0.01, 0.01);
  }
  for (int k = 0; k < 10; ++k) {
    const double r = k % 2 ? 0.015 : 0.04;
    star.emplace_back(r * std::cos(M_PI * k / 5), r * std::sin(M_PI * k / 5));
  }
  for (int k = 0; k <= 60; ++k)
    spiral.emplace_back((0.02 + 0.0006 * k) * std::cos(0.2 * k), (0.02 + 0.0006 * k) * std::sin(0.2 * k));
  for (int k = 60; k >= 0; --k)
    spiral.emplace_back((0.014 + 0.0006 * k) * std::cos(0.2 * k), (0.014 + 0.0006 * k) * std::sin(0.2 * k));
  for (int k = 0; k < 400; ++k)
    round.emplace_back(0.03 * std::cos(0.005 * M_PI * k), 0.03 * std::sin(0.005 * M_PI * k));
  const std::pair<const char*, std::vector<Vec2>> outlines[] = {
      {"L", {{0, 0}, {0.05, 0}, {0.05, 0.02}, {0.02, 0.02}, {0.02, 0.05}, {0, 0.05}}},
      {"U", {{0, 0}, {0.06, 0}, {0.06, 0.05}, {0.04, 0.05}, {0.04, 0.02}, {0.02, 0.02}, {0.02, 0.05}, {0, 0.05}}},
      {"S",
       {{0, 0},
        {0.07, 0},
        {0.07, 0.07},
        {0.01, 0.07},
        {0.01, 0.04},
        {0.04, 0.04},
        {0.04, 0.05},
        {0.02, 0.05},
        {0.02, 0.06},
        {0.06, 0.06},
        {0.06, 0.01},
        {0, 0.01}}},
      {"comb", comb},
      {"star", star},
      {"spiral", spiral},
      {"round", round}};
  const TemporaryFolder folder;
  for (const auto& [name, outline] : outlines)
    for (const char* ending : {"obj", "off", "ply", "vtk", "vtp"}) {
      SCOPED_TRACE(std::string(name) + "." + ending);
      std::string text;
      const double volume = prism(outline, ending, text);
      const Result<TriangleMesh> read = readMeshFile(folder.write(std::string(name) + "." + ending, text));
      ASSERT_TRUE(read.ok()) << read.error().detail;
      double around = 0.0;
      for (std::size_t k = 0; k < outline.size(); ++k)
        around += (outline[k] - outline[(k + 1) % outline.size()]).norm();
      EXPECT_NEAR(volume, signedVolume(*read), 1e-6 * volume);
      EXPECT_NEAR(2.0 * volume / 0.04 + 0.04 * around, surfaceArea(read->vertices, read->triangles), 1e-6);
      EXPECT_EQ(2 * (outline.size() - 2) + 2 * outline.size(), read->triangles.size());
      EXPECT_TRUE(loadShape(folder.file(std::string(name) + "." + ending), 1.0)->solid);
    }
}

TEST(OddFiles, AFaceWithAHoleThatABridgeLeadsToKeepsIt) {
  // A square of 6 cm with a square hole of 2 cm, as one face: out along the bridge, around the hole, and back.
  const std::string text =
      "v 0 0 0\nv 0.06 0 0\nv 0.06 0.06 0\nv 0 0.06 0\nv 0.02 0.02 0\nv 0.04 0.02 0\nv 0.04 0.04 0\nv 0.02 0.04 0\n"
      "f 1 2 3 4 1 5 8 7 6 5\n";
  const TemporaryFolder folder;
  const Result<TriangleMesh> read = readMeshFile(folder.write("hole.obj", text));
  ASSERT_TRUE(read.ok()) << read.error().detail;
  EXPECT_NEAR(0.06 * 0.06 - 0.02 * 0.02, surfaceArea(read->vertices, read->triangles), 1e-12);
  for (const Triangle& t : read->triangles) {
    const Vec3 middle = (read->vertices[t[0]] + read->vertices[t[1]] + read->vertices[t[2]]) / 3.0;
    EXPECT_FALSE(std::abs(middle.x() - 0.03) < 0.009 && std::abs(middle.y() - 0.03) < 0.009) << middle.transpose();
  }
}

TEST(OddFiles, RandomSimplePolygonsKeepTheirArea) {
  std::uint32_t state = 12345;
  const auto random = [&] { return static_cast<double>((state = 1664525u * state + 1013904223u) >> 8) / 16777216.0; };
  const TemporaryFolder folder;
  for (int round = 0; round < 200; ++round) {
    // Star-shaped around a point, with deep notches, tilted.
    const int n = 5 + static_cast<int>(60 * random());
    const Vec3 axis = Vec3(random() - 0.5, random() - 0.5, random() + 0.1).normalized();
    const Vec3 u = axis.unitOrthogonal(), v = axis.cross(u);
    std::string text;
    std::vector<Vec2> outline;
    for (int k = 0; k < n; ++k) {
      const double r = 0.01 + 0.05 * random(), turn = 2.0 * M_PI * (k + 0.8 * random()) / n;
      outline.emplace_back(r * std::cos(turn), r * std::sin(turn));
      const Vec3 p = outline.back().x() * u + outline.back().y() * v;
      text += "v " + number("%.17g", p.x()) + " " + number("%.17g", p.y()) + " " + number("%.17g", p.z()) + "\n";
    }
    text += "f";
    double area = 0.0;
    for (int k = 0; k < n; ++k) {
      const Vec2 &a = outline[static_cast<std::size_t>(k)], &b = outline[static_cast<std::size_t>((k + 1) % n)];
      area += 0.5 * (a.x() * b.y() - b.x() * a.y());
      text += " " + std::to_string(k + 1);
    }
    const Result<TriangleMesh> read = readMeshFile(folder.write("a.obj", text + "\n"));
    ASSERT_TRUE(read.ok()) << read.error().detail;
    EXPECT_NEAR(area, surfaceArea(read->vertices, read->triangles), 1e-9 * area) << round << ": " << n;
  }
}

}  // namespace odd_files_test
}  // namespace meshless
