// Every kind of file with faces, as programs write them: what is read is what was written.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "io/temporary_folder.h"
#include "meshless_surgery/io/files.h"

namespace meshless {
namespace mesh_kinds_test {

// --- what is written

using Polygon = std::vector<Index>;

/// Coordinates are floats, so that every file holds them.
struct Surface {
  Points points;
  std::vector<Polygon> faces;
};

/// A torus of quads, each split into triangles if `split`, and a prism over a polygon of seven corners if not.
Surface thing(int around, int across, bool split) {
  Surface surface;
  const auto place = [&](double x, double y, double z) {
    surface.points.emplace_back(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
  };
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < across; ++j) {
      const double a = 2.0 * M_PI * i / around, b = 2.0 * M_PI * j / across, r = 0.1 + 0.03 * std::cos(b);
      place(r * std::cos(a), r * std::sin(a), 0.03 * std::sin(b));
    }
  const auto at = [&](int i, int j) { return static_cast<Index>(i % around * across + j % across); };
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < across; ++j) {
      const Index a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
      if (split) {
        surface.faces.push_back({a, b, c});
        surface.faces.push_back({a, c, d});
      } else {
        surface.faces.push_back({a, b, c, d});
      }
    }
  if (split) return surface;
  const Index n = static_cast<Index>(surface.points.size());
  Polygon low, high;
  for (Index k = 0; k < 7; ++k) {
    const double a = 2.0 * M_PI * k / 7;
    place(0.02 * std::cos(a), 0.02 * std::sin(a), -0.01);
    place(0.02 * std::cos(a), 0.02 * std::sin(a), 0.01);
    low.insert(low.begin(), n + 2 * k);
    high.push_back(n + 2 * k + 1);
    const Index next = n + 2 * ((k + 1) % 7);
    surface.faces.push_back({n + 2 * k, next, next + 1, n + 2 * k + 1});
  }
  surface.faces.push_back(low);
  surface.faces.push_back(high);
  return surface;
}

// --- writers

template <class T>
void put(std::string& out, T value, bool big_endian = false) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  if (big_endian) std::reverse(bytes, bytes + sizeof(T));
  out.append(bytes, sizeof(T));
}

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", x);
  return text;
}

std::string text(std::size_t n) { return std::to_string(n); }

std::string withCarriageReturns(const std::string& lines) {
  std::string out;
  for (const char c : lines) out += c == '\n' ? std::string("\r\n") : std::string(1, c);
  return out;
}

std::string place(const Vec3& p) { return number(p.x()) + " " + number(p.y()) + " " + number(p.z()); }

struct PlyStyle {
  std::string format = "ascii";
  std::string number = "float", list = "uchar", index = "int";
  bool extras = false;       // normals, colours and texture coordinates of vertices, colours of faces
  bool wedges = false;       // MeshLab's texture coordinates of corners, another list
  bool flags_first = false;  // a property of the faces before their corners
};

std::string ply(const Surface& surface, const PlyStyle& style) {
  std::string out = "ply\nformat " + style.format + " 1.0\ncomment von Hand gemacht: Läppchen\nobj_info num_cols 7\n";
  out += "element vertex " + text(surface.points.size()) + "\n";
  for (const char* axis : {"x", "y", "z"}) out += "property " + style.number + " " + axis + "\n";
  if (style.extras) {
    for (const char* of : {"nx", "ny", "nz"}) out += std::string("property float ") + of + "\n";
    for (const char* of : {"red", "green", "blue", "alpha"}) out += std::string("property uchar ") + of + "\n";
    out += "property float s\nproperty float t\n";
  }
  out += "element face " + text(surface.faces.size()) + "\n";
  if (style.flags_first) out += "property int flags\n";
  out += "property list " + style.list + " " + style.index + " vertex_indices\n";
  if (style.wedges) out += "property list uchar float texcoord\n";
  if (style.extras) out += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  out += "end_header\n";
  const bool ascii = style.format == "ascii", big = style.format == "binary_big_endian";
  const auto value = [&](const std::string& type, double x) {
    if (ascii)
      out += (type == "float" || type == "double" ? number(x) : std::to_string(static_cast<long>(x))) + " ";
    else if (type == "float")
      put(out, static_cast<float>(x), big);
    else if (type == "double")
      put(out, x, big);
    else if (type == "uchar")
      put(out, static_cast<std::uint8_t>(x), big);
    else if (type == "ushort")
      put(out, static_cast<std::uint16_t>(x), big);
    else
      put(out, static_cast<std::int32_t>(x), big);
  };
  for (const Vec3& p : surface.points) {
    for (int d = 0; d < 3; ++d) value(style.number, p[d]);
    if (style.extras) {
      for (int d = 0; d < 3; ++d) value("float", 0.5);
      for (int d = 0; d < 4; ++d) value("uchar", 200);
      for (int d = 0; d < 2; ++d) value("float", 0.25);
    }
    if (ascii) out += "\n";
  }
  for (const Polygon& face : surface.faces) {
    if (style.flags_first) value("int", 3);
    value(style.list, static_cast<double>(face.size()));
    for (const Index k : face) value(style.index, k);
    if (style.wedges) {
      value("uchar", static_cast<double>(2 * face.size()));
      for (std::size_t k = 0; k < 2 * face.size(); ++k) value("float", 0.75);
    }
    if (style.extras)
      for (int d = 0; d < 3; ++d) value("uchar", 100);
    if (ascii) out += "\n";
  }
  return out;
}

/// Of triangles.
std::string binaryStl(const Surface& surface, const std::string& header) {
  std::string out = header;
  out.resize(80, ' ');
  put(out, static_cast<std::uint32_t>(surface.faces.size()));
  for (const Polygon& face : surface.faces) {
    const Vec3 a = surface.points[face[0]];
    const Vec3 normal = (surface.points[face[1]] - a).cross(surface.points[face[2]] - a).normalized();
    for (int d = 0; d < 3; ++d) put(out, static_cast<float>(normal[d]));
    for (const Index k : face)
      for (int d = 0; d < 3; ++d) put(out, static_cast<float>(surface.points[k][d]));
    put(out, static_cast<std::uint16_t>(0x8421));  // a colour, as some programs put it there
  }
  return out;
}

std::string asciiStl(const Surface& surface, const std::string& name, std::size_t solids = 1, bool upper = false) {
  std::string out;
  const std::size_t share = (surface.faces.size() + solids - 1) / solids;
  for (std::size_t f = 0; f < surface.faces.size(); ++f) {
    if (f % share == 0) out += (f > 0 ? "endsolid " + name + "\n" : "") + "solid " + name + "\n";
    const Polygon& face = surface.faces[f];
    const Vec3 a = surface.points[face[0]];
    out += "  facet normal " + place((surface.points[face[1]] - a).cross(surface.points[face[2]] - a).normalized()) +
           "\n    outer loop\n";
    for (const Index k : face) out += "      vertex " + place(surface.points[k]) + "\n";
    out += "    endloop\n  endfacet\n";
  }
  out += "endsolid " + name + "\n";
  if (upper) std::transform(out.begin(), out.end(), out.begin(), [](unsigned char c) { return std::toupper(c); });
  return out;
}

struct ObjStyle {
  bool colours = false, normals = false, textures = false, negative = false, groups = false;
};

std::string obj(const Surface& surface, const ObjStyle& style) {
  std::string out = "# Läppchen, von Hand gemacht\nmtllib Läppchen.mtl\n";
  const auto object = [&](std::size_t k) { return "o Läppchen " + text(k) + "\ng Gruppe_" + text(k) + " zwei\ns 1\n"; };
  // With objects, points and faces of each stand together; numbers go on.
  const std::size_t parts = style.groups ? 3 : 1;
  std::size_t points = 0;
  const auto writePoints = [&](std::size_t until) {
    for (; points < until; ++points) {
      out += "v " + place(surface.points[points]) + (style.colours ? " 0.5 0.25 1\n" : "\n");
      if (style.textures) out += "vt 0.5 0.25\n";
      if (style.normals) out += "vn 0 0 1\n";
    }
  };
  for (std::size_t f = 0; f < surface.faces.size(); ++f) {
    if (style.groups && f % (surface.faces.size() / parts) == 0) out += object(f);
    if (style.groups && f % 100 == 50) out += "usemtl rot\nl 1 2\np 1\n# dazwischen\n\n";
    writePoints(*std::max_element(surface.faces[f].begin(), surface.faces[f].end()) + 1);
    out += "f";
    for (const Index k : surface.faces[f]) {
      const std::string corner =
          style.negative ? std::to_string(static_cast<long>(k) - static_cast<long>(points)) : text(k + 1);
      out += " " + corner;
      if (style.textures) out += "/" + corner;
      if (style.normals) out += (style.textures ? "/" : "//") + corner;
    }
    out += "\n";
  }
  writePoints(surface.points.size());
  return out;
}

struct VtkStyle {
  std::string version = "3.0", number = "float";
  bool binary = false, extras = false;  // extras: lines and vertices, fields, normals, colours, texture coordinates
};

std::string vtk(const Surface& surface, const VtkStyle& style) {
  const bool five = style.version[0] == '5';
  std::string out = "# vtk DataFile Version " + style.version + "\nLäppchen, von Hand\n" +
                    (style.binary ? "BINARY" : "ASCII") + "\nDATASET POLYDATA\n";
  const auto real = [&](const std::string& type, double x) {
    if (!style.binary)
      out += number(x) + " ";
    else if (type == "float")
      put(out, static_cast<float>(x), true);
    else
      put(out, x, true);
  };
  const auto whole = [&](std::size_t k, bool wide) {
    if (!style.binary)
      out += text(k) + " ";
    else if (wide)
      put(out, static_cast<std::int64_t>(k), true);
    else
      put(out, static_cast<std::int32_t>(k), true);
  };
  const auto cells = [&](const std::string& kind, const std::vector<Polygon>& all) {
    std::size_t corners = 0;
    for (const Polygon& face : all) corners += face.size();
    if (five) {
      out += kind + " " + text(all.size() + 1) + " " + text(corners) + "\nOFFSETS vtktypeint64\n";
      std::size_t end = 0;
      whole(0, true);
      for (const Polygon& face : all) whole(end += face.size(), true);
      out += "\nCONNECTIVITY vtktypeint64\n";
      for (const Polygon& face : all)
        for (const Index k : face) whole(k, true);
    } else {
      out += kind + " " + text(all.size()) + " " + text(corners + all.size()) + "\n";
      for (const Polygon& face : all) {
        whole(face.size(), false);
        for (const Index k : face) whole(k, false);
        if (!style.binary) out += "\n";
      }
    }
    out += "\n";
  };
  if (style.extras) {
    out += "FIELD FieldData 1\nTimeValue 1 1 double\n";
    real("double", 0.5);
    out += "\n";
  }
  out += "POINTS " + text(surface.points.size()) + " " + style.number + "\n";
  for (const Vec3& p : surface.points)
    for (int d = 0; d < 3; ++d) real(style.number, p[d]);
  out += "\n";
  if (five && style.extras) out += "METADATA\nINFORMATION 0\n\n";
  if (style.extras) {
    cells("VERTICES", {{0}, {1}});
    cells("LINES", {{0, 1, 2}, {3, 4}});
  }
  cells("POLYGONS", surface.faces);
  if (style.extras) {
    out += "CELL_DATA " + text(surface.faces.size() + 4) + "\nSCALARS label float 1\nLOOKUP_TABLE default\n";
    for (std::size_t k = 0; k < surface.faces.size() + 4; ++k) real("float", 3.0);
    out += "\nPOINT_DATA " + text(surface.points.size()) + "\nNORMALS Normals float\n";
    for (std::size_t k = 0; k < 3 * surface.points.size(); ++k) real("float", 0.25);
    out += "\nTEXTURE_COORDINATES uv 2 float\n";
    for (std::size_t k = 0; k < 2 * surface.points.size(); ++k) real("float", 0.75);
    out += "\n";
  }
  return out;
}

// --- reading

using Corner = std::array<float, 3>;
using Edges = std::map<std::pair<Corner, Corner>, int>;

/// As floats: those that are written as text come back as the next double.
Corner cornerOf(const Vec3& p) {
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
}

/// Faces come in their order, each as triangles whose sides, those that two of them have left out, are the polygon's.
void expectSame(const TemporaryFolder& folder, const std::string& name, const std::string& content,
                const Surface& written) {
  SCOPED_TRACE(name);
  const Result<TriangleMesh> read = readMeshFile(folder.write(name, content));
  ASSERT_TRUE(read.ok()) << read.error().detail;
  std::size_t triangles = 0;
  for (const Polygon& face : written.faces) triangles += face.size() - 2;
  ASSERT_EQ(read->triangles.size(), triangles);
  std::size_t at = 0, wrong = 0;
  for (const Polygon& face : written.faces) {
    Edges sides;
    const auto add = [&](const Vec3& from, const Vec3& to, int times) {
      const Corner a = cornerOf(from), b = cornerOf(to);
      sides[{std::min(a, b), std::max(a, b)}] += a < b ? times : -times;
    };
    for (std::size_t k = 0; k < face.size(); ++k)
      add(written.points[face[k]], written.points[face[(k + 1) % face.size()]], 1);
    for (std::size_t k = 0; k + 2 < face.size(); ++k, ++at)
      for (int c = 0; c < 3; ++c)
        add(read->vertices[read->triangles[at][c]], read->vertices[read->triangles[at][(c + 1) % 3]], -1);
    wrong += std::any_of(sides.begin(), sides.end(), [](const auto& side) { return side.second != 0; });
  }
  EXPECT_EQ(wrong, 0u) << "faces of " << written.faces.size();
}

TEST(MeshKinds, AHundredThousandTriangles) {
  const TemporaryFolder folder;
  const Surface large = thing(250, 200, true);
  ASSERT_EQ(large.faces.size(), 100000u);
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"})
    expectSame(folder, std::string(format) + ".ply", ply(large, {format}), large);
  expectSame(folder, "ascii.stl", asciiStl(large, "organ"), large);
  expectSame(folder, "binary.stl", binaryStl(large, "organ"), large);
  expectSame(folder, "a.obj", obj(large, {}), large);
  for (const bool binary : {false, true})
    expectSame(folder, binary ? "binary.vtk" : "ascii.vtk", vtk(large, {"4.2", "float", binary, false}), large);
}

TEST(MeshKinds, Ply) {
  const TemporaryFolder folder;
  for (const bool split : {true, false}) {
    const Surface surface = thing(40, 30, split);
    for (const std::string format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
      const auto same = [&](const std::string& name, PlyStyle style) {
        style.format = format;
        expectSame(folder, format + name + ".ply", ply(surface, style), surface);
      };
      same("_plain", {});
      same("_double", {"", "double"});
      for (const char* list : {"int", "ushort"}) same(std::string("_") + list, {"", "float", list, "uint"});
      same("_short", {"", "float", "uchar", "ushort"});
      same("_extras", {"", "float", "uchar", "int", true});
      same("_flags", {"", "float", "uchar", "int", false, false, true});
      same("_wedges", {"", "float", "uchar", "int", false, true});
      same("_all", {"", "double", "uchar", "int", true, true, true});
    }
    expectSame(folder, "crlf.ply", withCarriageReturns(ply(surface, {"ascii", "float", "uchar", "int", true})),
               surface);
  }
}

TEST(MeshKinds, PlyFaultsAreNamedWithTheirLine) {
  const TemporaryFolder folder;
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  for (const auto& [content, words] : std::vector<std::pair<std::string, std::string>>{
           {head + "0 0 0\n1 0 zero\n0 1 0\n3 0 1 2\n", "'a.ply' is damaged: line 11: 'zero' is no number"},
           {head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
            "'a.ply' is damaged: its face 0 has the corner 3; accepted: 0 to 3"},
           {head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n", "its face 0 has the corner -1"},
           {head + "0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "is truncated: it holds 0 of 1 of its element face"},
           {head + "0 0 0\n1 0 0\n0 1 0\n-3 0 1 2\n", "has a list of damaged size"},
           {head.substr(0, 21) + "element vertex 3\nproperty float x\nproperty float y\nend_header\n",
            "its vertices have no x, y and z of float or double"},
           {head.substr(0, 21) + "elemnt vertex 3\n", "line 3: a damaged header: 'elemnt vertex 3'"}}) {
    const Result<TriangleMesh> read = readMeshFile(folder.write("a.ply", content));
    ASSERT_FALSE(read.ok()) << content;
    EXPECT_NE(read.error().detail.find(words), std::string::npos) << read.error().detail;
  }
}

TEST(MeshKinds, Stl) {
  const TemporaryFolder folder;
  const Surface surface = thing(40, 30, true);
  for (const char* name : {"", "organ", "two words", "Läppchen", "肝臓"}) {
    expectSame(folder, "name.stl", asciiStl(surface, name), surface);
    expectSame(folder, "binary.stl", binaryStl(surface, name), surface);
  }
  expectSame(folder, "solid.stl", binaryStl(surface, "solid as some write it"), surface);
  expectSame(folder, "several.stl", asciiStl(surface, "part", 3), surface);
  expectSame(folder, "crlf.stl", withCarriageReturns(asciiStl(surface, "organ")), surface);
  expectSame(folder, "upper.stl", asciiStl(surface, "organ", 1, true), surface);
  expectSame(folder, "UPPER.STL", binaryStl(surface, "organ"), surface);
  expectSame(folder, "Läppchen rechts.stl", binaryStl(surface, "organ"), surface);
}

TEST(MeshKinds, Obj) {
  const TemporaryFolder folder;
  for (const bool split : {true, false}) {
    const Surface surface = thing(40, 30, split);
    for (int k = 0; k < 32; ++k) {
      const ObjStyle style{(k & 1) != 0, (k & 2) != 0, (k & 4) != 0, (k & 8) != 0, (k & 16) != 0};
      const std::string name = "style" + std::to_string(k);
      expectSame(folder, name + ".obj", obj(surface, style), surface);
      expectSame(folder, name + "_crlf.obj", withCarriageReturns(obj(surface, style)), surface);
    }
  }
}

TEST(MeshKinds, Vtk) {
  const TemporaryFolder folder;
  for (const bool split : {true, false}) {
    const Surface surface = thing(40, 30, split);
    for (const char* version : {"2.0", "3.0", "4.2", "5.1"})
      for (const bool binary : {false, true})
        for (const bool extras : {false, true})
          for (const char* type : {"float", "double"}) {
            const std::string name =
                std::string(version) + (binary ? "_binary" : "") + (extras ? "_extras_" : "_") + type;
            const std::string content = vtk(surface, {version, type, binary, extras});
            expectSame(folder, name + ".vtk", content, surface);
            if (!binary) expectSame(folder, name + "_crlf.vtk", withCarriageReturns(content), surface);
          }
  }
}

}  // namespace mesh_kinds_test
}  // namespace meshless
