#include "meshless_surgery/io/files.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <random>
#include <sstream>

#include "io/temporary_folder.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "support/random.h"

namespace meshless {
namespace files_test {

namespace fs = std::filesystem;

// --- files written by hand, in every format

template <class T>
void put(std::string& out, T value, bool big_endian = false) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  if (big_endian) std::reverse(bytes, bytes + sizeof(T));
  out.append(bytes, sizeof(T));
}

std::string number(double x) {
  std::ostringstream out;
  out.precision(9);
  out << x;
  return out.str();
}

std::string objText(const TriangleMesh& mesh) {
  std::string out = "# a comment\nmtllib nowhere.mtl\no thing\n";
  for (const Vec3& p : mesh.vertices) out += "v " + number(p.x()) + " " + number(p.y()) + " " + number(p.z()) + "\n";
  for (const Triangle& t : mesh.triangles)
    out += "f " + std::to_string(t[0] + 1) + " " + std::to_string(t[1] + 1) + " " + std::to_string(t[2] + 1) + "\n";
  return out;
}

std::string plyText(const TriangleMesh& mesh, bool binary, bool with_double = false) {
  const std::string type = with_double ? "double" : "float";
  std::string out = std::string("ply\nformat ") + (binary ? "binary_little_endian" : "ascii") +
                    " 1.0\nelement vertex " + std::to_string(mesh.vertices.size()) + "\nproperty " + type +
                    " x\nproperty " + type + " y\nproperty " + type + " z\n";
  if (!mesh.triangles.empty())
    out += "element face " + std::to_string(mesh.triangles.size()) + "\nproperty list uchar int vertex_indices\n";
  out += "end_header\n";
  for (const Vec3& p : mesh.vertices) {
    for (int d = 0; d < 3; ++d) {
      if (!binary)
        out += number(p[d]) + " ";
      else if (with_double)
        put(out, p[d]);
      else
        put(out, static_cast<float>(p[d]));
    }
    if (!binary) out += "\n";
  }
  for (const Triangle& t : mesh.triangles) {
    if (!binary) {
      out += "3 " + std::to_string(t[0]) + " " + std::to_string(t[1]) + " " + std::to_string(t[2]) + "\n";
      continue;
    }
    put(out, static_cast<unsigned char>(3));
    for (Index k : t) put(out, static_cast<std::int32_t>(k));
  }
  return out;
}

std::string stlText(const TriangleMesh& mesh, bool binary) {
  std::string out;
  if (binary) {
    out.assign(80, ' ');
    put(out, static_cast<std::uint32_t>(mesh.triangles.size()));
  } else {
    out = "solid thing\n";
  }
  for (const Triangle& t : mesh.triangles) {
    if (binary) {
      for (int k = 0; k < 3; ++k) put(out, 0.0f);
      for (Index k : t)
        for (int d = 0; d < 3; ++d) put(out, static_cast<float>(mesh.vertices[k][d]));
      put(out, static_cast<std::uint16_t>(0));
    } else {
      out += " facet normal 0 0 0\n  outer loop\n";
      for (Index k : t) {
        const Vec3& p = mesh.vertices[k];
        out += "   vertex " + number(p.x()) + " " + number(p.y()) + " " + number(p.z()) + "\n";
      }
      out += "  endloop\n endfacet\n";
    }
  }
  return binary ? out : out + "endsolid thing\n";
}

std::string vtkText(const TriangleMesh& mesh, bool binary) {
  std::string out = std::string("# vtk DataFile Version 3.0\nthing\n") + (binary ? "BINARY" : "ASCII") +
                    "\nDATASET POLYDATA\nPOINTS " + std::to_string(mesh.vertices.size()) + " float\n";
  for (const Vec3& p : mesh.vertices)
    for (int d = 0; d < 3; ++d) {
      if (binary)
        put(out, static_cast<float>(p[d]), true);
      else
        out += number(p[d]) + (d == 2 ? "\n" : " ");
    }
  if (mesh.triangles.empty()) return out + "\n";
  const std::string n = std::to_string(mesh.triangles.size());
  out += "\nPOLYGONS " + n + " " + std::to_string(4 * mesh.triangles.size()) + "\n";
  for (const Triangle& t : mesh.triangles) {
    if (binary) {
      put(out, std::int32_t{3}, true);
      for (Index k : t) put(out, static_cast<std::int32_t>(k), true);
    } else {
      out += "3 " + std::to_string(t[0]) + " " + std::to_string(t[1]) + " " + std::to_string(t[2]) + "\n";
    }
  }
  return out + "\n";
}

std::string pcdText(const Points& points, bool binary, bool with_double = false) {
  const std::string n = std::to_string(points.size());
  const std::string size = with_double ? "8 8 8" : "4 4 4";
  std::string out = "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE " + size +
                    "\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " + n + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + n +
                    "\nDATA " + (binary ? "binary" : "ascii") + "\n";
  for (const Vec3& p : points) {
    for (int d = 0; d < 3; ++d) {
      if (!binary)
        out += (std::isnan(p[d]) ? "nan" : number(p[d])) + (d == 2 ? "\n" : " ");
      else if (with_double)
        put(out, p[d]);
      else
        put(out, static_cast<float>(p[d]));
    }
  }
  return out;
}

/// LZF that packs nothing: runs of up to 32 bytes as they are. The fields stand one after the other.
std::string compressedPcd(const Points& points) {
  std::string plain, packed;
  for (int d = 0; d < 3; ++d)
    for (const Vec3& p : points) put(plain, static_cast<float>(p[d]));
  for (std::size_t at = 0; at < plain.size(); at += 32) {
    const std::size_t run = std::min<std::size_t>(32, plain.size() - at);
    packed += static_cast<char>(run - 1);
    packed += plain.substr(at, run);
  }
  std::string out = pcdText(points, true);
  out = out.substr(0, out.find("DATA")) + "DATA binary_compressed\n";
  put(out, static_cast<std::uint32_t>(packed.size()));
  put(out, static_cast<std::uint32_t>(plain.size()));
  return out + packed;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

/// Each face over two lines; a comment that ends in a backslash does not go on.
std::string continuedObj(const TriangleMesh& mesh) {
  return replaced(replaced(objText(mesh), "\nf ", "\nf \\\r\n "), "o thing\n", "# in C:\\models\\\n");
}

/// Edges with numbers and a list, between points and faces.
std::string plyWithEdges(const TriangleMesh& mesh, bool binary) {
  const std::string text = plyText(mesh, binary);
  TriangleMesh cloud = mesh;
  cloud.triangles.clear();
  const std::size_t points = plyText(cloud, binary).size() - plyText(cloud, binary).find("end_header");
  const std::size_t faces_at = text.find("end_header") + points;
  std::string edges;
  for (int k = 0; k < 2; ++k) {
    if (!binary) {
      edges += "0 1 2 7 8\n";
      continue;
    }
    put(edges, std::int32_t{0});
    put(edges, std::int32_t{1});
    put(edges, static_cast<unsigned char>(2));
    put(edges, 7.0f);
    put(edges, 8.0f);
  }
  return replaced(text.substr(0, faces_at) + edges + text.substr(faces_at), "element face",
                  "element edge 2\nproperty int vertex1\nproperty int vertex2\n"
                  "property list uchar float weights\nelement face");
}

/// Pairs of neighbouring triangles as strips of four corners, the others as strips of three.
std::string vtkStrips(const TriangleMesh& mesh) {
  std::string strips;
  std::size_t count = 0, size = 0;
  std::vector<char> used(mesh.triangles.size(), 0);
  for (std::size_t k = 0; k < mesh.triangles.size(); ++k) {
    if (used[k]) continue;
    const Triangle& t = mesh.triangles[k];
    std::string corners = std::to_string(t[0]) + " " + std::to_string(t[1]) + " " + std::to_string(t[2]);
    int n = 3;
    for (std::size_t j = k + 1; j < mesh.triangles.size() && n == 3; ++j)
      for (int c = 0; c < 3 && n == 3; ++c) {
        const Triangle& o = mesh.triangles[j];
        if (used[j] || o[c] != t[2] || o[(c + 1) % 3] != t[1]) continue;
        used[j] = 1;
        corners += " " + std::to_string(o[(c + 2) % 3]);
        n = 4;
      }
    strips += std::to_string(n) + " " + corners + "\n";
    ++count;
    size += static_cast<std::size_t>(n) + 1;
  }
  const std::string text = vtkText(mesh, false);
  return text.substr(0, text.find("\nPOLYGONS")) + "\nTRIANGLE_STRIPS " + std::to_string(count) + " " +
         std::to_string(size) + "\n" + strips + "\n";
}

std::string offText(const TriangleMesh& mesh, const std::string& head, const std::string& of_point = "",
                    const std::string& of_face = "") {
  std::string out =
      head + std::to_string(mesh.vertices.size()) + " " + std::to_string(mesh.triangles.size()) + " 0\n# a comment\n\n";
  for (const Vec3& p : mesh.vertices)
    out += number(p.x()) + " " + number(p.y()) + " " + number(p.z()) + of_point + "\n";
  for (const Triangle& t : mesh.triangles)
    out += "3 " + std::to_string(t[0]) + " " + std::to_string(t[1]) + " " + std::to_string(t[2]) + of_face + "\n";
  return out;
}

struct Written {
  std::string name, content;
};

TriangleMesh thing() { return cylinderMesh(0.1, 0.03, 0.01); }

std::vector<Written> surfaceFiles() {
  return {{"ascii.obj", objText(thing())},
          {"ascii.ply", plyText(thing(), false)},
          {"binary.ply", plyText(thing(), true)},
          {"double.ply", plyText(thing(), true, true)},
          {"ascii.stl", stlText(thing(), false)},
          {"binary.stl", stlText(thing(), true)},
          {"ascii.vtk", vtkText(thing(), false)},
          {"binary.vtk", vtkText(thing(), true)},
          {"UPPER.OBJ", objText(thing())},
          {"continued.obj", continuedObj(thing())},
          {"edges.ply", plyWithEdges(thing(), false)},
          {"edges_binary.ply", plyWithEdges(thing(), true)},
          {"strips.vtk", vtkStrips(thing())},
          {"plain.off", offText(thing(), "OFF\n")},
          {"colours.off", offText(thing(), "COFF ", " 9 9 9 255", " 0.5 0.5 0.5 # a comment")}};
}

std::vector<Written> cloudFiles() {
  TriangleMesh cloud = thing();
  cloud.triangles.clear();
  return {{"ascii.pcd", pcdText(cloud.vertices, false)},
          {"binary.pcd", pcdText(cloud.vertices, true)},
          {"double.pcd", pcdText(cloud.vertices, true, true)},
          {"packed.pcd", compressedPcd(cloud.vertices)},
          {"cloud.ply", plyText(cloud, true)},
          {"cloud.obj", objText(cloud)},
          {"cloud.vtk", vtkText(cloud, false)}};
}

bool says(const Error& error, const std::string& words) { return error.detail.find(words) != std::string::npos; }

// --- reading

TEST(ReadMeshFile, EveryFormatGivesTheSameSurface) {
  const TemporaryFolder folder;
  const TriangleMesh expected = thing();
  for (const Written& file : surfaceFiles()) {
    const Result<TriangleMesh> read = readMeshFile(folder.write(file.name, file.content));
    EXPECT_TRUE(read.ok()) << file.name << ": " << read.error().detail;
    if (!read.ok()) continue;
    EXPECT_EQ(read->triangles.size(), expected.triangles.size()) << file.name;
    EXPECT_NEAR(signedVolume(*read), signedVolume(expected), 1e-6 * signedVolume(expected)) << file.name;
    EXPECT_NEAR(surfaceArea(*read), surfaceArea(expected), 1e-6 * surfaceArea(expected)) << file.name;
    const Box a = boundsOf(read->vertices), b = boundsOf(expected.vertices);
    EXPECT_LT((a.min - b.min).norm() + (a.max - b.max).norm(), 1e-7) << file.name;
  }
}

TEST(ReadMeshFile, EveryFormatGivesTheSameCloud) {
  const TemporaryFolder folder;
  const Points expected = thing().vertices;
  for (const Written& file : cloudFiles()) {
    const Result<TriangleMesh> read = readMeshFile(folder.write(file.name, file.content));
    ASSERT_TRUE(read.ok()) << file.name << ": " << read.error().detail;
    EXPECT_TRUE(read->triangles.empty()) << file.name;
    ASSERT_EQ(read->vertices.size(), expected.size()) << file.name;
    for (std::size_t k = 0; k < expected.size(); ++k) EXPECT_LT((read->vertices[k] - expected[k]).norm(), 1e-8);
  }
}

TEST(ReadMeshFile, PolygonsBecomeTriangles) {
  const TemporaryFolder folder;
  // A prism over an L: two hexagons that are not convex and six quads; the first corner does not see all the others.
  std::string text;
  const double outline[6][2] = {{1, 0}, {2, 0}, {2, 2}, {0, 2}, {0, 1}, {1, 1}};
  for (const double z : {0.0, 1.0})
    for (const auto& p : outline) text += "v " + number(p[0]) + " " + number(p[1]) + " " + number(z) + "\n";
  text += "f 6 5 4 3 2 1\nf 7 8 9 10 11 12\n";
  for (int k = 1; k <= 6; ++k) {
    const int next = k % 6 + 1;
    text += "f " + std::to_string(k) + " " + std::to_string(next) + " " + std::to_string(next + 6) + " " +
            std::to_string(k + 6) + "\n";
  }
  const Result<TriangleMesh> read = readMeshFile(folder.write("prism.obj", text));
  ASSERT_TRUE(read.ok()) << read.error().detail;
  EXPECT_EQ(read->triangles.size(), 20u);
  EXPECT_NEAR(signedVolume(*read), 3.0, 1e-6);
  EXPECT_NEAR(surfaceArea(*read), 2 * 3.0 + 8.0, 1e-6);
}

// Whatever corner it is numbered from.
TEST(ReadMeshFile, APolygonWithACornerThatSeesTheOthersKeepsItsArea) {
  const TemporaryFolder folder;
  test::Random random(3);
  for (int trial = 0; trial < 20; ++trial) {
    const int n = random.integer(5, 12), first = random.integer(0, n - 1);
    Points corners{Vec3::Zero()};
    for (int k = 1; k < n; ++k) {
      const double angle = 2.8 * k / n, radius = random.uniform(0.2, 1.0);
      corners.push_back(radius * Vec3(std::cos(angle), std::sin(angle), 0.0));
    }
    double area = 0.0;
    for (int k = 1; k + 1 < n; ++k) area += 0.5 * corners[k].cross(corners[k + 1]).z();
    std::string text, face = "f";
    for (const Vec3& p : corners) text += "v " + number(p.x()) + " " + number(p.y()) + " 0\n";
    for (int k = 0; k < n; ++k) face += " " + std::to_string((first + k) % n + 1);
    const Result<TriangleMesh> read = readMeshFile(folder.write("polygon.obj", text + face + "\n"));
    ASSERT_TRUE(read.ok()) << read.error().detail;
    EXPECT_NEAR(surfaceArea(*read), area, 1e-6) << text << face;
  }
}

TEST(ReadMeshFile, VtkOfVersionFive) {
  const TemporaryFolder folder;
  const std::string head =
      "# vtk DataFile Version 5.1\ntitle\nASCII\nDATASET POLYDATA\nPOINTS 4 double\n"
      "0 0 0 1 0 0\n0 1 0 0 0 1\n";
  const std::string text = head +
                           "POLYGONS 5 12\nOFFSETS vtktypeint64\n0 3 6 9 12\nCONNECTIVITY vtktypeint64\n"
                           "0 2 1 0 1 3 0 3 2\n1 2 3\n\nPOINT_DATA 4\nSCALARS s float\nnonsense\n";
  const Result<TriangleMesh> read = readMeshFile(folder.write("a.vtk", text));
  ASSERT_TRUE(read.ok()) << read.error().detail;
  EXPECT_EQ(read->triangles.size(), 4u);
  EXPECT_NEAR(signedVolume(*read), 1.0 / 6.0, 1e-7);
  for (const char* damaged :
       {"POLYGONS 5 12\nOFFSETS vtktypeint64\n0 3 6 9 99\nCONNECTIVITY vtktypeint64\n0 2 1 0 1 3 0 3 2 1 2 3\n",
        "POLYGONS 5 12\nOFFSETS vtktypeint64\n0 3 6 9 12\nCONNECTIVITY vtktypeint64\n0 2 1 0 1 3 0 3 2 1 2 4\n",
        "POLYGONS 4 12\n3 0 1 2\n"})
    EXPECT_FALSE(readMeshFile(folder.write("b.vtk", head + damaged)).ok()) << damaged;
}

TEST(ReadMeshFile, PlyAsPclWritesIt) {
  const TemporaryFolder folder;
  std::string text =
      "ply\nformat ascii 1.0\ncomment by PCL\nelement vertex 4\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "element camera 1\n";
  for (const char* name :
       {"view_px", "view_py", "view_pz", "x_axisx", "x_axisy", "x_axisz", "y_axisx", "y_axisy", "y_axisz", "z_axisx",
        "z_axisy", "z_axisz", "focal", "scalex", "scaley", "centerx", "centery"})
    text += std::string("property float ") + name + "\n";
  text +=
      "property int viewportx\nproperty int viewporty\nproperty float k1\nproperty float k2\nelement face 4\n"
      "property list uchar int vertex_indices\nend_header\n";
  const std::string body =
      "0 0 0 9 9 9\n1 0 0 9 9 9\n0 1 0 9 9 9\n0 0 1 9 9 9\n"
      "0 0 0 1 0 0 0 1 0 0 0 1 0 0 0 0 0 4 1 0 0\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
  const Result<TriangleMesh> read = readMeshFile(folder.write("a.ply", text + body));
  ASSERT_TRUE(read.ok()) << read.error().detail;
  EXPECT_EQ(read->triangles.size(), 4u);
  EXPECT_NEAR(signedVolume(*read), 1.0 / 6.0, 1e-7);
}

TEST(ReadMeshFile, PlyHeadersThatWouldAbortTheProcessAreRefused) {
  const TemporaryFolder folder;
  const std::string good = plyText(thing(), false);
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    return text.replace(text.find(from), from.size(), to);
  };
  for (const std::string& text :
       {with("property float y", "property list uchar int y"),
        with("property list uchar int vertex_indices", "property list uchar int corners"),
        with("property float z", "property float y"), with("property float y", "property int y"),
        with("element face", "element tristrips"), with("end_header", "end_header_")}) {
    const Result<TriangleMesh> read = readMeshFile(folder.write("a.ply", text));
    ASSERT_FALSE(read.ok());
    EXPECT_EQ(read.error().code, ErrorCode::kUnreadable);
  }
}

TEST(ReadMeshFile, PcdWithOtherFieldsBetween) {
  const TemporaryFolder folder;
  std::string text =
      "FIELDS rgb y normal x z\nSIZE 4 4 4 8 4\nTYPE U F F F F\nCOUNT 1 1 3 1 1\nWIDTH 2\nHEIGHT 1\n"
      "POINTS 2\nDATA ";
  const std::string ascii = text + "ascii\n7 2 0 0 1 1 3\n8 5 0 0 1 4 6\n";
  std::string binary = text + "binary\n";
  for (int k = 0; k < 2; ++k) {
    put(binary, std::uint32_t{7});
    put(binary, 2.0f + 3.0f * static_cast<float>(k));
    for (int j = 0; j < 3; ++j) put(binary, 0.0f);
    put(binary, 1.0 + 3.0 * k);
    put(binary, 3.0f + 3.0f * static_cast<float>(k));
  }
  for (const std::string& content : {ascii, binary}) {
    const Result<TriangleMesh> read = readMeshFile(folder.write("a.pcd", content));
    ASSERT_TRUE(read.ok()) << read.error().detail;
    ASSERT_EQ(read->vertices.size(), 2u);
    EXPECT_EQ(read->vertices[0], Vec3(1, 2, 3));
    EXPECT_EQ(read->vertices[1], Vec3(4, 5, 6));
  }
}

TEST(ReadMeshFile, PcdHeadersWhoseLinesDoNotAgreeAreRefused) {
  const TemporaryFolder folder;
  const std::string good = pcdText(thing().vertices, true);
  for (const std::string line : {"FIELDS x y z\n", "SIZE 4 4 4\n", "TYPE F F F\n", "COUNT 1 1 1\n"})
    for (const std::string& to : {line.substr(0, line.size() - 3) + "\n", std::string()}) {
      if (to.empty() && line[0] == 'C') continue;  // 1 each, where it is left out
      const Result<TriangleMesh> read = readMeshFile(folder.write("a.pcd", replaced(good, line, to)));
      ASSERT_FALSE(read.ok()) << line << to;
      EXPECT_TRUE(says(read.error(), "FIELDS, SIZE, TYPE and COUNT of different lengths")) << to << read.error().detail;
    }
}

TEST(ReadMeshFile, ObjInEveryStyle) {
  const TemporaryFolder folder;
  const std::string text =
      "\xEF\xBB\xBF# a mark of encoding\r\n"
      "\tv  0 0 0 0.5 0.5 0.5\r\n"  // with a colour
      "v 1.0e0 0 0 1.0\r\n"
      "v 0 +1 0\r\n"
      "v 0 0 1\r\n"
      "vn 0 0 1\r\nvn 0 0 1\r\nvn 0 0 1\r\nvn 0 0 1\r\nvn 0 0 1\r\nvn 0 0 1\r\n"  // more than vertices
      "vt 0 0\r\n\r\ng a\r\nusemtl m\r\ns off\r\n"
      "f 1/1/1 3/1/1 2/1/1\r\n"
      "f 1//2 2//2 4//2\r\n"
      "f -4/1 -1/1 -2/1\r\n"
      "f 2 3 4";
  const Result<TriangleMesh> read = readMeshFile(folder.write("styles.obj", text));
  ASSERT_TRUE(read.ok()) << read.error().detail;
  EXPECT_EQ(read->vertices.size(), 4u);
  ASSERT_EQ(read->triangles.size(), 4u);
  EXPECT_NEAR(signedVolume(*read), 1.0 / 6.0, 1e-7);
}

TEST(ReadMeshFile, ObjMaterialFilesAreNotOpened) {
  const TemporaryFolder folder;
  // A pipe: whoever opens it to read would wait for ever.
  ASSERT_EQ(std::system(("mkfifo " + folder.file("pipe.mtl")).c_str()), 0);
  EXPECT_TRUE(readMeshFile(folder.write("a.obj", "mtllib pipe.mtl\n" + objText(thing()))).ok());
}

TEST(ReadMeshFile, BadObjLinesAreNamed) {
  const TemporaryFolder folder;
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"v 0 0\n", "line 1: a vertex needs three numbers"},
      {"v 0 0 zero\n", "line 1: 'zero' is no number"},
      {"v 0 0 0\nf 1 1\n", "line 2: a face needs three corners"},
      {"v 0 0 0\nf a b c\n", "line 2: 'a' is no vertex number"},
      {"v 0 0 0\nf 1 1 1x\n", "line 2: '1x' is no vertex number"},
      {"v 0 0 0\nf 1 1 99999999999999999999999\n", "line 2"},
  };
  for (const auto& one : cases) {
    const Result<TriangleMesh> read = readMeshFile(folder.write("bad.obj", one.first));
    ASSERT_FALSE(read.ok()) << one.first;
    EXPECT_EQ(read.error().code, ErrorCode::kUnreadable);
    EXPECT_TRUE(says(read.error(), one.second)) << read.error().detail;
  }
}

TEST(ReadMeshFile, BadOffFilesAreNamed) {
  const TemporaryFolder folder;
  const std::string points = "OFF\n3 1 0\n0 0 0\n1 0 0\n";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"4OFF\n3 1 0\n", "line 1: '4OFF'"},
      {"OFF BINARY\n", "OFF BINARY"},
      {"OFF\n", "no numbers of points and faces"},
      {"OFF\n-3 1 0\n", "no numbers of points and faces"},
      {"OFF\n4000000 1 0\n", "accepted: up to 2000000"},
      {"OFF\n3 99999999 0\n", "accepted: up to 8000000"},
      {points, "truncated in its points"},
      {points + "0 1\n", "line 5: a point needs three numbers"},
      {points + "0 1 zero\n", "line 5: 'zero' is no number"},
      {points + "0 1 0\n", "truncated in its faces"},
      {points + "0 1 0\n3 0 1\n", "line 6: a face has fewer corners"},
      {points + "0 1 0\n1e30 0 1\n", "line 6: a face has fewer corners"},
      {points + "0 1 0\n3 0 1 -2\n", "line 6: '-2' is no number of a point"},
      {points + "0 1 0\n3 0 1 3\n", "line 6: face 0 has the corner 3; accepted: 0 to 2"},
      {points + "0 nan 0\n3 0 1 2\n", "line 5: point 2 is not finite"}};
  for (const auto& one : cases) {
    const Result<TriangleMesh> read = readMeshFile(folder.write("bad.off", one.first));
    ASSERT_FALSE(read.ok()) << one.first;
    EXPECT_TRUE(says(read.error(), one.second)) << read.error().detail;
  }
}

// Counted as the file counts: lines, faces and vertices from 1.
TEST(ReadMeshFile, WhatIsWrongInAnObjIsNamedByItsLine) {
  const TemporaryFolder folder;
  const std::string points = "# four\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {points + "f 1 3 2\nf 1 2 5\n", "'bad.obj' line 7: face 2 has the corner '5'; accepted: 1 to 4, the number"},
      {points + "f 1 3 2\nf 1//1 5//1 2//1\n", "'bad.obj' line 7: face 2 has the corner '5//1'; accepted: 1 to 4"},
      {points + "f 1 3 2\nf 0 1 2\n", "'bad.obj' line 7: face 2 has the corner '0'; accepted: 1 to 4"},
      {points + "f 1 3 2\nf -5 1 2\n", "'bad.obj' line 7: face 2 has the corner '-5'; accepted: 1 to 4"},
      {points + "f 1 2 2000000000\n", "'bad.obj' line 6: face 1 has the corner '2000000000'; accepted: 1 to 4"},
      // The vertex of the first face comes later, that of the second does not.
      {points + "f 1 2 5\nf 1 2 7\nf 1 2 6\nf 0 1 2\nv 1 1 1\n", "line 7: face 2 has the corner '7'; accepted: 1 to 5"},
      {points + "v 0 nan 0\nf 1 2 5\n", "'bad.obj' line 6: vertex 5 is not finite"}};
  for (const auto& [text, said] : cases) {
    const Result<TriangleMesh> read = readMeshFile(folder.write("bad.obj", text));
    ASSERT_FALSE(read.ok()) << text;
    EXPECT_EQ(read.error().code, ErrorCode::kUnsuitableShape) << read.error().detail;
    EXPECT_TRUE(says(read.error(), said)) << read.error().detail;
  }
  EXPECT_TRUE(readMeshFile(folder.write("good.obj", "f 1 2 3\nf 1 3 4\n" + points)).ok()) << "vertices may come later";
  EXPECT_EQ(readMeshFile(folder.write("cloud.obj", points + "v 0 nan 0\n"))->vertices.size(), 4u);
}

TEST(ReadMeshFile, TruncatedFilesAreRefused) {
  const TemporaryFolder folder;
  std::vector<Written> files = surfaceFiles();
  for (const Written& file : cloudFiles()) files.push_back(file);
  for (const Written& file : files) {
    // OBJ says nowhere how long it is: what is missing shows as an open surface.
    if (file.name.find(".obj") != std::string::npos || file.name.find(".OBJ") != std::string::npos) continue;
    for (const double share : {0.0, 0.02, 0.3, 0.6, 0.9, 0.98}) {
      const std::size_t size = static_cast<std::size_t>(share * static_cast<double>(file.content.size()));
      const Result<TriangleMesh> read = readMeshFile(folder.write(file.name, file.content.substr(0, size)));
      ASSERT_FALSE(read.ok()) << file.name << " cut to " << size << " of " << file.content.size();
      EXPECT_EQ(read.error().code, ErrorCode::kUnreadable) << read.error().detail;
      EXPECT_TRUE(says(read.error(), file.name)) << read.error().detail;
    }
  }
}

TEST(ReadMeshFile, EmptyMissingAndUnknownFilesAreNamed) {
  const TemporaryFolder folder;
  for (const char* name : {"a.pcd", "a.ply", "a.obj", "a.stl", "a.vtk", "a.off"}) {
    const Result<TriangleMesh> missing = readMeshFile(folder.file(name));
    ASSERT_FALSE(missing.ok());
    EXPECT_EQ(missing.error().code, ErrorCode::kUnreadable);
    EXPECT_TRUE(says(missing.error(), "missing")) << missing.error().detail;
    const Result<TriangleMesh> empty = readMeshFile(folder.write(name, ""));
    ASSERT_FALSE(empty.ok());
    EXPECT_TRUE(says(empty.error(), "empty")) << empty.error().detail;
  }
  for (const char* name : {"a.dae", "a", "a.obj.txt", ".obj"}) {
    const Result<TriangleMesh> unknown = readMeshFile(folder.write(name, objText(thing())));
    ASSERT_FALSE(unknown.ok()) << name;
    EXPECT_EQ(unknown.error().code, ErrorCode::kUnreadable);
    EXPECT_TRUE(says(unknown.error(), ".pcd, .ply, .obj, .stl, .vtk, .off")) << unknown.error().detail;
  }
  EXPECT_FALSE(readMeshFile(folder.path()).ok());
}

TEST(ReadMeshFile, NothingButAHeaderHasNoPoints) {
  const TemporaryFolder folder;
  for (const Written& file : std::vector<Written>{{"a.pcd", pcdText({}, false)},
                                                  {"a.ply", plyText({}, false)},
                                                  {"a.obj", "# nothing\n"},
                                                  {"a.stl", stlText({}, true)},
                                                  {"a.vtk", vtkText({}, false)}}) {
    const Result<TriangleMesh> read = readMeshFile(folder.write(file.name, file.content));
    ASSERT_FALSE(read.ok()) << file.name;
    EXPECT_EQ(read.error().code, ErrorCode::kUnsuitableShape) << file.name << read.error().detail;
  }
}

TEST(ReadMeshFile, HeadersThatPromiseTooMuchAreRefusedBeforeMemoryIsTaken) {
  const TemporaryFolder folder;
  const auto with = [](std::string text, const std::string& from, const std::string& to) {
    for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
      text.replace(at, from.size(), to);
    return text;
  };
  const Points points = thing().vertices;
  const std::string n = std::to_string(points.size()), triangles = std::to_string(thing().triangles.size());
  for (const std::string huge : {"4000000000", "1999999", "99999999999999999999", "-5"}) {
    for (const Written& file : std::vector<Written>{
             {"a.pcd",
              with(with(pcdText(points, true), "WIDTH " + n, "WIDTH " + huge), "POINTS " + n, "POINTS " + huge)},
             {"b.pcd",
              with(with(pcdText(points, false), "WIDTH " + n, "WIDTH " + huge), "POINTS " + n, "POINTS " + huge)},
             {"c.pcd", with(pcdText(points, true), "WIDTH " + n, "WIDTH " + huge)},
             {"d.pcd", with(pcdText(points, true), "COUNT 1", "COUNT " + huge)},
             {"a.ply", with(plyText(thing(), true), "vertex " + n, "vertex " + huge)},
             {"b.ply", with(plyText(thing(), true), "face " + triangles, "face " + huge)},
             {"a.vtk", with(vtkText(thing(), true), "POINTS " + n, "POINTS " + huge)},
             {"b.vtk", with(vtkText(thing(), false), "POLYGONS " + triangles, "POLYGONS " + huge)}}) {
      EXPECT_FALSE(readMeshFile(folder.write(file.name, file.content)).ok()) << file.name << " with " << huge;
    }
  }
}

TEST(ReadMeshFile, NonFinitePointsOfACloudAreDropped) {
  const TemporaryFolder folder;
  Points points = thing().vertices;
  const std::size_t finite = points.size();
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  points.insert(points.begin() + 3, Vec3(nan, 0, 0));
  points.push_back(Vec3(0, infinity, 0));
  for (const bool binary : {true, false}) {
    const Result<TriangleMesh> read = readMeshFile(folder.write("a.pcd", pcdText(points, binary)));
    if (!read.ok()) {
      ADD_FAILURE() << binary << read.error().detail;
      continue;
    }
    EXPECT_EQ(read->vertices.size(), finite);
  }
  const Result<TriangleMesh> none = readMeshFile(folder.write("none.pcd", pcdText({Vec3(nan, nan, nan)}, true)));
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.error().code, ErrorCode::kUnsuitableShape);
}

TEST(ReadMeshFile, NonFinitePointsOfASurfaceAreNamed) {
  const TemporaryFolder folder;
  TriangleMesh mesh = thing();
  mesh.vertices[5].y() = std::numeric_limits<double>::quiet_NaN();
  for (const Written& file :
       std::vector<Written>{{"a.ply", plyText(mesh, true)}, {"a.obj", objText(mesh)}, {"a.vtk", vtkText(mesh, true)}}) {
    const Result<LoadedShape> shape = loadShape(folder.write(file.name, file.content), 1.0);
    ASSERT_FALSE(shape.ok()) << file.name;
    EXPECT_EQ(shape.error().code, ErrorCode::kUnsuitableShape) << file.name << ": " << shape.error().detail;
    EXPECT_TRUE(says(shape.error(), "finite")) << shape.error().detail;
  }
}

TEST(ReadMeshFile, SurvivesDamagedBytes) {
  const TemporaryFolder folder;
  std::vector<Written> files = surfaceFiles();
  for (const Written& file : cloudFiles()) files.push_back(file);
  std::mt19937 random(17);
  std::size_t refused = 0;
  for (const Written& file : files)
    for (int round = 0; round < 40; ++round) {
      std::string content = file.content;
      // In the header as often as in the data.
      const std::size_t reach = round % 2 ? content.size() : std::min<std::size_t>(300, content.size());
      for (int k = 0; k < 1 + round % 5; ++k) content[random() % reach] = static_cast<char>(random() % 256);
      const Result<TriangleMesh> read = readMeshFile(folder.write(file.name, content));
      if (!read.ok()) {
        ++refused;
        EXPECT_FALSE(read.error().detail.empty());
      } else {
        EXPECT_FALSE(read->vertices.empty());
      }
    }
  EXPECT_GT(refused, 50u);
}

// --- shapes

TEST(LoadShape, ScalesAndRepairs) {
  const TemporaryFolder folder;
  const double volume = signedVolume(thing());
  for (const Written& file : surfaceFiles()) {
    const Result<LoadedShape> shape = loadShape(folder.write(file.name, file.content), 3.0);
    ASSERT_TRUE(shape.ok()) << file.name << ": " << shape.error().detail;
    EXPECT_TRUE(shape->solid) << file.name;
    EXPECT_NEAR(signedVolume(shape->mesh), 27.0 * volume, 1e-5 * volume * 27.0) << file.name;
    EXPECT_TRUE(inspectMesh(shape->mesh).closed()) << file.name;
  }
}

TEST(LoadShape, ACloudGetsAClosedSurfaceAndSaysHow) {
  const TemporaryFolder folder;
  const Points points = sphereMesh(0.1, 0.012).vertices;
  const Result<LoadedShape> shape = loadShape(folder.write("ball.pcd", pcdText(points, true)), 0.5);
  ASSERT_TRUE(shape.ok()) << shape.error().detail;
  EXPECT_TRUE(shape->solid);
  EXPECT_TRUE(inspectMesh(shape->mesh).closed());
  const double volume = 4.0 / 3.0 * 3.14159265 * std::pow(0.05, 3);
  EXPECT_NEAR(signedVolume(shape->mesh), volume, 0.15 * volume);
  ASSERT_FALSE(shape->notes.empty());
  EXPECT_NE(shape->notes[0].find("cloud of " + std::to_string(points.size()) + " points"), std::string::npos);
  EXPECT_EQ(shape->notes[0].find("e-1"), std::string::npos) << "a distance that is a rounding: " << shape->notes[0];
}

TEST(LoadShape, RepairsAsFarAsItIsAsked) {
  const TemporaryFolder folder;
  TriangleMesh open = thing();
  const Triangle t = open.triangles[open.triangles.size() / 2];
  open.triangles.push_back({t[1], t[0], static_cast<Index>(open.vertices.size())});  // a fin
  open.vertices.push_back(open.vertices[t[0]] + 0.3 * (open.vertices[t[1]] - open.vertices[t[0]]) +
                          0.3 * (open.vertices[t[0]] - open.vertices[t[2]]));
  const std::string path = folder.write("fin.obj", objText(open));
  const Result<LoadedShape> refused = loadShape(path, 1.0, MeshRepair::kNone);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kUnsuitableShape);
  EXPECT_TRUE(says(refused.error(), "'fin.obj': the surface is not manifold")) << refused.error().detail;
  const double volume = signedVolume(thing());
  for (const MeshRepair repair : {MeshRepair::kMend, MeshRepair::kWrap}) {
    const Result<LoadedShape> shape = loadShape(path, 1.0, repair);
    ASSERT_TRUE(shape.ok()) << shape.error().detail;
    EXPECT_TRUE(shape->solid);
    EXPECT_NEAR(signedVolume(shape->mesh), volume, (repair == MeshRepair::kMend ? 1e-5 : 0.2) * volume);
    ASSERT_FALSE(shape->notes.empty());
    EXPECT_EQ(shape->notes[0].compare(0, 8, "fin.obj:"), 0) << shape->notes[0];
  }
}

TEST(LoadShape, NulsAfterTheLastLineOfAnObjAreNothing) {
  const TemporaryFolder folder;
  const std::string text = objText(thing());
  for (const std::size_t nuls : {1u, 65536u}) {
    const Result<LoadedShape> shape = loadShape(folder.write("a.obj", text + std::string(nuls, '\0')), 1.0);
    ASSERT_TRUE(shape.ok()) << shape.error().detail;
    EXPECT_EQ(shape->mesh.triangles.size(), thing().triangles.size());
  }
  EXPECT_FALSE(loadShape(folder.write("a.obj", std::string(1, '\0') + text), 1.0).ok());
  EXPECT_FALSE(loadShape(folder.write("a.obj", text + std::string(1, '\0') + "v 0 0 0\n"), 1.0).ok());
  EXPECT_FALSE(loadShape(folder.write("a.obj", std::string(100, '\0')), 1.0).ok());
  EXPECT_FALSE(loadShape(folder.write("a.obj", text + std::string(65537, '\0')), 1.0).ok());
}

TEST(LoadShape, SaysWhatWasRepaired) {
  const TemporaryFolder folder;
  TriangleMesh inside_out = thing();
  for (Triangle& t : inside_out.triangles) std::swap(t[0], t[1]);
  const Result<LoadedShape> shape = loadShape(folder.write("a.obj", objText(inside_out)), 1.0);
  ASSERT_TRUE(shape.ok());
  EXPECT_GT(signedVolume(shape->mesh), 0.0);
  ASSERT_FALSE(shape->notes.empty());
  EXPECT_NE(shape->notes[0].find("a.obj"), std::string::npos);
}

TEST(LoadShape, RefusesScalesThatAreNone) {
  const TemporaryFolder folder;
  const std::string path = folder.write("a.obj", objText(thing()));
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  for (const double scale : {0.0, -1.0, nan, infinity}) {
    const Result<LoadedShape> shape = loadShape(path, scale);
    ASSERT_FALSE(shape.ok()) << scale;
    EXPECT_EQ(shape.error().code, ErrorCode::kInvalidArgument);
    EXPECT_TRUE(says(shape.error(), "scale is " + number(scale))) << shape.error().detail;
  }
}

TEST(LoadShape, RealMeshesAreSolid) {
  std::error_code missing;
  const std::string data = fs::canonical(std::string(SOURCE_DIR) + "/../shared/data", missing).string();
  if (missing) GTEST_SKIP() << "the real meshes are not beside the checkout";
  const std::vector<std::pair<std::string, double>> volumes = {
      {"liver-smooth.obj", 39.27}, {"liver2.obj", 1.147}, {"torus2_for_collision.obj", 5.258}};
  for (const auto& one : volumes) {
    const Result<LoadedShape> shape = loadShape(data + "/" + one.first, 0.1);
    ASSERT_TRUE(shape.ok()) << one.first << ": " << shape.error().detail;
    EXPECT_TRUE(shape->solid) << one.first;
    EXPECT_NEAR(signedVolume(shape->mesh), 1e-3 * one.second, 2e-6 * one.second) << one.first;
  }
}

// --- writing

TEST(WriteObj, KeepsEveryDigit) {
  const TemporaryFolder folder;
  TriangleMesh mesh = thing();
  for (Vec3& p : mesh.vertices) p *= 1.0 / 3.0;
  ASSERT_TRUE(writeObj(folder.file("a.obj"), mesh, "two\nlines").ok());
  std::istringstream in(folder.read("a.obj"));
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line, "# two");
  std::getline(in, line);
  EXPECT_EQ(line, "# lines");
  for (const Vec3& p : mesh.vertices) {
    std::string v;
    Vec3 q;
    in >> v >> q.x() >> q.y() >> q.z();
    EXPECT_EQ(v, "v");
    EXPECT_EQ(q, p);
  }
  EXPECT_FALSE(fs::exists(folder.file("a.obj.part")));
  const Result<TriangleMesh> again = readMeshFile(folder.file("a.obj"));
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(again->triangles, mesh.triangles);
}

TEST(WriteObj, SaysWhereTheDiskRefuses) {
  const TemporaryFolder folder;
  const Status status = writeObj(folder.file("no/such/folder/a.obj"), thing(), "");
  ASSERT_FALSE(status.ok());
  EXPECT_TRUE(says(status.error(), "a.obj"));
  if (fs::exists("/dev/full")) {
    fs::create_symlink("/dev/full", folder.file("full.obj.part"));
    EXPECT_FALSE(writeObj(folder.file("full.obj"), thing(), "").ok());
    EXPECT_FALSE(fs::exists(folder.file("full.obj")));
  }
}

// --- which files may be read

struct Access : ::testing::Test {
  TemporaryFolder folder;
  FileAccess access;
  std::string inside;

  void SetUp() override {
    inside = folder.write("allowed/meshes/a.obj", "v 0 0 0\n");
    folder.write("allowed_not/a.obj", "v 0 0 0\n");
    folder.write("secret/a.obj", "v 0 0 0\n");
    folder.write("package/share/a.obj", "v 0 0 0\n");
    access.folders = {folder.file("allowed"), folder.file("missing"), folder.file("package")};
    access.find_package = [this](const std::string& name) {
      return name == "tissue" ? folder.file("package") : name == "evil" ? folder.file("secret") : std::string();
    };
  }
  ErrorCode refusal(const std::string& path, const std::string& base = "/") {
    const Result<std::string> real = access.resolve(path, base);
    EXPECT_FALSE(real.ok()) << path;
    return real.ok() ? ErrorCode::kFailed : real.error().code;
  }
};

TEST_F(Access, FilesBelowAFolderAreFoundByEveryWayOfNamingThem) {
  const std::string scenes = folder.file("allowed/scenes");
  fs::create_directories(scenes);
  for (const auto& one :
       std::vector<std::pair<std::string, std::string>>{{inside, "/"},
                                                        {"../meshes/a.obj", scenes},
                                                        {"a.obj", folder.file("allowed/meshes")},
                                                        {"./x/../a.obj", folder.file("allowed/meshes")},
                                                        {inside, "anything"}}) {
    const Result<std::string> real = access.resolve(one.first, one.second);
    ASSERT_TRUE(real.ok()) << one.first << ": " << real.error().detail;
    EXPECT_EQ(*real, inside);
  }
  const Result<std::string> package = access.resolve("package://tissue/share/a.obj", "/");
  ASSERT_TRUE(package.ok()) << package.error().detail;
  EXPECT_EQ(*package, folder.file("package/share/a.obj"));
}

TEST_F(Access, EverythingElseIsForbidden) {
  EXPECT_EQ(refusal(folder.file("secret/a.obj")), ErrorCode::kForbidden);
  EXPECT_EQ(refusal(folder.file("allowed_not/a.obj")), ErrorCode::kForbidden);  // a name that only begins the same
  EXPECT_EQ(refusal("../secret/a.obj", folder.file("allowed")), ErrorCode::kForbidden);
  EXPECT_EQ(refusal(folder.file("allowed/../secret/a.obj")), ErrorCode::kForbidden);
  EXPECT_EQ(refusal("package://tissue/../secret/a.obj"), ErrorCode::kForbidden);
  EXPECT_EQ(refusal("package://evil/a.obj"), ErrorCode::kForbidden);
  EXPECT_EQ(refusal("/etc/passwd"), ErrorCode::kForbidden);
  // Whether it exists is not told.
  EXPECT_EQ(refusal(folder.file("secret/none.obj")), ErrorCode::kForbidden);
}

TEST_F(Access, WhatIsForbiddenIsToldWhereFilesMayLieEachFolderOnceAndWhatAddsMore) {
  access.folders.push_back(folder.file("allowed") + "/");
  access.more = "below a folder of the parameter data_folders";
  const std::string detail = access.resolve("/etc/passwd", "/").error().detail;
  EXPECT_EQ(detail, "'/etc/passwd' is outside the folders that may be read; accepted: below " + folder.file("allowed") +
                        ", " + folder.file("package") + ", or below a folder of the parameter data_folders");
}

TEST_F(Access, LinksAreFollowedBeforeTheyAreJudged) {
  fs::create_symlink(folder.file("secret/a.obj"), folder.file("allowed/link.obj"));
  fs::create_directory_symlink(folder.file("secret"), folder.file("allowed/way"));
  fs::create_symlink(inside, folder.file("secret/in.obj"));
  EXPECT_EQ(refusal(folder.file("allowed/link.obj")), ErrorCode::kForbidden);
  EXPECT_EQ(refusal(folder.file("allowed/way/a.obj")), ErrorCode::kForbidden);
  EXPECT_EQ(refusal(folder.file("allowed/way/none.obj")), ErrorCode::kForbidden);
  const Result<std::string> real = access.resolve(folder.file("secret/in.obj"), "/");
  ASSERT_TRUE(real.ok());
  EXPECT_EQ(*real, inside);
  // A folder may be named through a link itself.
  fs::create_directory_symlink(folder.file("allowed"), folder.file("also"));
  access.folders = {folder.file("also") + "/"};
  EXPECT_TRUE(access.resolve(inside, "/").ok());
}

TEST_F(Access, WhatIsNoFileIsUnreadable) {
  EXPECT_EQ(refusal(folder.file("allowed/none.obj")), ErrorCode::kUnreadable);
  EXPECT_EQ(refusal(folder.file("allowed/meshes")), ErrorCode::kUnreadable);
  EXPECT_EQ(refusal(folder.file("allowed")), ErrorCode::kUnreadable);
  fs::create_symlink(folder.file("allowed/loop"), folder.file("allowed/loop"));
  EXPECT_EQ(refusal(folder.file("allowed/loop")), ErrorCode::kUnreadable);
}

TEST_F(Access, NamesThatAreNoPathsAreRefused) {
  EXPECT_EQ(refusal(""), ErrorCode::kInvalidArgument);
  EXPECT_EQ(refusal(std::string("a\0b", 3)), ErrorCode::kInvalidArgument);
  EXPECT_EQ(refusal(std::string(5000, 'a')), ErrorCode::kInvalidArgument);
  EXPECT_EQ(refusal("package://"), ErrorCode::kInvalidArgument);
  EXPECT_EQ(refusal("package://tissue"), ErrorCode::kInvalidArgument);
  EXPECT_EQ(refusal("package:///a.obj"), ErrorCode::kInvalidArgument);
  EXPECT_EQ(refusal("package://unheard_of/a.obj"), ErrorCode::kUnknownName);
  access.find_package = nullptr;
  EXPECT_EQ(refusal("package://tissue/share/a.obj"), ErrorCode::kForbidden);
  access.folders.clear();
  EXPECT_EQ(refusal(inside), ErrorCode::kForbidden);
}

}  // namespace files_test
}  // namespace meshless
