// Files of tetrahedra, hexahedra and the like: legacy VTK, VTK's XML, Gmsh.
#include <gtest/gtest.h>

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <random>
#include <sstream>

#include <zlib.h>

#include "io/temporary_folder.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "meshless_surgery/io/files.h"
#include "support/mesh_laws.h"
#include "support/random.h"

namespace meshless {
namespace volume_mesh_test {

// --- what is written

struct Cell {
  int vtk;  // its type
  std::vector<int> nodes;
};

struct Grid {
  Points points;
  std::vector<Cell> cells;
};

constexpr int kLine = 3, kTriangle = 5, kQuad = 9, kTetrahedron = 10, kHexahedron = 12, kWedge = 13, kPyramid = 14,
              kCurvedTetrahedron = 24;

/// A row of boxes: two hexahedra, one of pyramids, one of wedges, two of tetrahedra; with a line, a triangle and a quad
/// of their surface, and a point that belongs to nothing.
Grid thing() {
  Grid grid;
  for (int i = 0; i <= 6; ++i)
    for (int j = 0; j < 4; ++j)
      grid.points.emplace_back(0.125 * i, 0.25 * (j == 1 || j == 2) + 0.0625 * (i % 2), 0.25 * (j >= 2));
  grid.points.emplace_back(7.0, 8.0, 9.0);
  grid.cells = {{kLine, {0, 1}}, {kTriangle, {0, 1, 2}}, {kQuad, {0, 1, 5, 4}}};
  const auto box = [](int i) {
    return std::vector<int>{4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 3, 4 * i + 4, 4 * i + 5, 4 * i + 6, 4 * i + 7};
  };
  grid.cells.push_back({kHexahedron, box(0)});
  grid.cells.push_back({kHexahedron, box(1)});
  std::vector<int> c = box(2);
  Vec3 middle = Vec3::Zero();
  for (const int k : c) middle += grid.points[static_cast<std::size_t>(k)] / 8.0;
  const int apex = static_cast<int>(grid.points.size());
  grid.points.push_back(middle);
  for (const auto& f :
       {std::array<int, 4>{0, 1, 2, 3}, {4, 7, 6, 5}, {0, 4, 5, 1}, {1, 5, 6, 2}, {2, 6, 7, 3}, {3, 7, 4, 0}})
    grid.cells.push_back({kPyramid, {c[f[0]], c[f[1]], c[f[2]], c[f[3]], apex}});
  c = box(3);
  grid.cells.push_back({kWedge, {c[0], c[3], c[4], c[1], c[2], c[5]}});
  grid.cells.push_back({kWedge, {c[3], c[7], c[4], c[2], c[6], c[5]}});
  for (const int i : {4, 5}) {
    c = box(i);
    for (const auto& t :
         {std::array<int, 4>{0, 1, 2, 6}, {0, 2, 3, 6}, {0, 3, 7, 6}, {0, 7, 4, 6}, {0, 4, 5, 6}, {0, 5, 1, 6}})
      grid.cells.push_back({kTetrahedron, {c[t[0]], c[t[1]], c[t[2]], c[t[3]]}});
  }
  return grid;
}

constexpr double kVolume = 6 * 0.125 * 0.25 * 0.25;
const char* const kNote = ": the outer surface of 12 tetrahedra, 2 hexahedra, 2 wedges and 6 pyramids is taken: ";

// --- writers

template <class T>
void put(std::string& out, T value, bool big_endian = false) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  if (big_endian) std::reverse(bytes, bytes + sizeof(T));
  out.append(bytes, sizeof(T));
}

std::string number(double x) {
  std::ostringstream out;
  out.precision(17);
  out << x;
  return out.str();
}

std::string text(std::size_t n) { return std::to_string(n); }

std::string vtkFile(const Grid& grid, const std::string& version, bool binary) {
  std::string out = "# vtk DataFile Version " + version + "\nthing\n" + (binary ? "BINARY" : "ASCII") +
                    "\nDATASET UNSTRUCTURED_GRID\nPOINTS " + text(grid.points.size()) + " double\n";
  const auto ints = [&](const std::vector<int>& values, bool wide) {
    for (const int k : values) {
      if (!binary)
        out += std::to_string(k) + " ";
      else if (wide)
        put(out, static_cast<std::int64_t>(k), true);
      else
        put(out, static_cast<std::int32_t>(k), true);
    }
    out += "\n";
  };
  for (const Vec3& p : grid.points)
    for (int d = 0; d < 3; ++d) {
      if (binary)
        put(out, p[d], true);
      else
        out += number(p[d]) + (d == 2 ? "\n" : " ");
    }
  std::vector<int> offsets{0}, corners, old, types;
  for (const Cell& cell : grid.cells) {
    corners.insert(corners.end(), cell.nodes.begin(), cell.nodes.end());
    offsets.push_back(static_cast<int>(corners.size()));
    old.push_back(static_cast<int>(cell.nodes.size()));
    old.insert(old.end(), cell.nodes.begin(), cell.nodes.end());
    types.push_back(cell.vtk);
  }
  if (version[0] == '5') {
    out += "\nMETADATA\nINFORMATION 0\n\nCELLS " + text(offsets.size()) + " " + text(corners.size()) +
           "\nOFFSETS vtktypeint64\n";
    ints(offsets, true);
    out += "CONNECTIVITY vtktypeint64\n";
    ints(corners, true);
  } else {
    out += "\nCELLS " + text(types.size()) + " " + text(old.size()) + "\n";
    ints(old, false);
  }
  out += "\nCELL_TYPES " + text(types.size()) + "\n";
  ints(types, false);
  return out;
}

std::string base64(const std::string& bytes) {
  const char* const digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t at = 0; at < bytes.size(); at += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
      bits = bits << 8 | (at + k < bytes.size() ? static_cast<unsigned char>(bytes[at + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) out += at + k > bytes.size() ? '=' : digits[bits >> (18 - 6 * k) & 63];
  }
  return out;
}

struct VtuStyle {
  std::string format = "ascii";  // binary, appended
  bool encoded = true, packed = false, wide = false, big_endian = false;
};

std::string vtuFile(const Grid& grid, const VtuStyle& style, const std::string& count_of_points = "") {
  std::string appended;
  const auto header = [&](std::string& out, std::size_t n) {
    if (style.wide)
      put(out, static_cast<std::uint64_t>(n), style.big_endian);
    else
      put(out, static_cast<std::uint32_t>(n), style.big_endian);
  };
  /// The array's attributes and content, from its bytes.
  const auto content = [&](const std::string& bytes) {
    std::string head, body;
    if (style.packed) {
      constexpr std::size_t kBlock = 200;
      std::vector<std::string> blocks;
      for (std::size_t at = 0; at < bytes.size(); at += kBlock) {
        const std::string block = bytes.substr(at, kBlock);
        uLongf size = compressBound(static_cast<uLong>(block.size()));
        std::string packed(size, '\0');
        EXPECT_EQ(compress(reinterpret_cast<Bytef*>(&packed[0]), &size, reinterpret_cast<const Bytef*>(block.data()),
                           static_cast<uLong>(block.size())),
                  Z_OK);
        blocks.push_back(packed.substr(0, size));
      }
      header(head, blocks.size());
      header(head, kBlock);
      header(head, bytes.size() % kBlock);
      for (const std::string& block : blocks) {
        header(head, block.size());
        body += block;
      }
    } else {
      header(head, bytes.size());
      body = bytes;
    }
    // The header of compressed data is encoded by itself.
    const std::string encoded = style.packed ? base64(head) + base64(body) : base64(head + body);
    if (style.format == "binary") return "format=\"binary\">\n" + encoded + "\n";
    const std::string offset = text(appended.size());
    appended += style.encoded ? encoded : head + body;
    return "format=\"appended\" offset=\"" + offset + "\">";
  };
  const auto array = [&](const std::string& head, const std::vector<double>& values, auto as) {
    std::string bytes, written;
    for (const double x : values) {
      put(bytes, static_cast<decltype(as)>(x), style.big_endian);
      written += number(x) + " ";
    }
    return "<DataArray " + head + (style.format == "ascii" ? " format=\"ascii\">\n" + written : " " + content(bytes)) +
           "<InformationKey name=\"L2_NORM_RANGE\" location=\"vtkDataArray\"><Value index=\"0\">5</Value>"
           "</InformationKey>\n</DataArray>\n";
  };
  std::vector<double> coordinates, corners, offsets, types;
  for (const Vec3& p : grid.points) coordinates.insert(coordinates.end(), {p.x(), p.y(), p.z()});
  for (const Cell& cell : grid.cells) {
    corners.insert(corners.end(), cell.nodes.begin(), cell.nodes.end());
    offsets.push_back(static_cast<double>(corners.size()));
    types.push_back(cell.vtk);
  }
  std::string out =
      std::string("<?xml version=\"1.0\"?>\n<!-- a > b --><VTKFile type=\"UnstructuredGrid\" version=\"1.0\"") +
      " byte_order=\"" + (style.big_endian ? "BigEndian" : "LittleEndian") + "\"" +
      (style.wide ? " header_type=\"UInt64\"" : "") + (style.packed ? " compressor=\"vtkZLibDataCompressor\"" : "") +
      ">\n<UnstructuredGrid>\n" + "<Piece NumberOfPoints=\"" +
      (count_of_points.empty() ? text(grid.points.size()) : count_of_points) + "\" NumberOfCells=\"" +
      text(grid.cells.size()) + "\">\n<PointData>\n" + array("type=\"Float64\" Name=\"offsets\"", {1, 2, 3}, double{}) +
      "</PointData>\n<Points>\n" +
      array("type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\"", coordinates, double{}) +
      "</Points>\n<Cells>\n" + array("type=\"Int64\" Name=\"connectivity\"", corners, std::int64_t{}) +
      array("type=\"Int32\" Name=\"offsets\"", offsets, std::int32_t{}) +
      array("type=\"UInt8\" Name=\"types\"", types, std::uint8_t{}) + "</Cells>\n</Piece>\n</UnstructuredGrid>\n";
  if (style.format == "appended")
    out += std::string("<AppendedData encoding=\"") + (style.encoded ? "base64" : "raw") + "\">\n  _" + appended +
           "\n</AppendedData>\n";
  return out + "</VTKFile>\n";
}

int gmshType(int vtk) {
  for (const auto& [gmsh, of] : {std::pair<int, int>{1, kLine},
                                 {2, kTriangle},
                                 {3, kQuad},
                                 {4, kTetrahedron},
                                 {5, kHexahedron},
                                 {6, kWedge},
                                 {7, kPyramid},
                                 {11, kCurvedTetrahedron}})
    if (of == vtk) return gmsh;
  return 15;
}

/// Node k has the number 100000 - 3 k: they need not ascend, nor be without gaps.
std::string mshFile(const Grid& grid, const std::string& version, bool binary, bool big_endian = false) {
  const bool four = version[0] == '4';
  std::string out = "$MeshFormat\n" + version + (binary ? " 1 8\n" : " 0 8\n");
  const auto narrow = [&](std::size_t n) {
    if (binary)
      put(out, static_cast<std::int32_t>(n), big_endian);
    else
      out += text(n) + " ";
  };
  const auto wide = [&](std::size_t n) {
    if (binary && four)
      put(out, static_cast<std::uint64_t>(n), big_endian);
    else
      narrow(n);
  };
  const auto point = [&](const Vec3& p) {
    for (int d = 0; d < 3; ++d) {
      if (binary)
        put(out, p[d], big_endian);
      else
        out += number(p[d]) + " ";
    }
  };
  const auto line = [&] { out += binary ? "" : "\n"; };
  const auto tag = [](int node) { return static_cast<std::size_t>(100000 - 3 * std::int64_t{node}); };
  if (binary) {
    put(out, std::int32_t{1}, big_endian);
    out += "\n";
  }
  out += "$EndMeshFormat\n$PhysicalNames\n1\n3 1 \"a $Nodes b\"\n$EndPhysicalNames\n$Nodes\n";
  const std::size_t n = grid.points.size(), m = grid.cells.size();
  if (four) {
    // Two blocks; the points of the second lie on a surface and have two parameters.
    for (const std::size_t k : {std::size_t{2}, n, tag(static_cast<int>(n) - 1), tag(0)}) wide(k);
    line();
    const std::size_t half = n / 2;
    for (const bool second : {false, true}) {
      narrow(second ? 2 : 3);
      narrow(1);
      narrow(second);
      wide(second ? n - half : half);
      line();
      for (std::size_t k = second ? half : 0; k < (second ? n : half); ++k) {
        wide(tag(static_cast<int>(k)));
        line();
      }
      for (std::size_t k = second ? half : 0; k < (second ? n : half); ++k) {
        point(grid.points[k]);
        for (int parameter = 0; second && parameter < 2; ++parameter) {
          if (binary)
            put(out, 0.5, big_endian);
          else
            out += "0.5 ";
        }
        line();
      }
    }
  } else {
    out += text(n) + "\n";
    for (std::size_t k = 0; k < n; ++k) {
      narrow(tag(static_cast<int>(k)));
      point(grid.points[k]);
      line();
    }
  }
  out += std::string(binary ? "\n" : "") + "$EndNodes\n$Elements\n";
  if (four) {
    for (const std::size_t k : {m, m, std::size_t{1}, m}) wide(k);
    line();
  } else {
    out += text(m) + "\n";
  }
  for (std::size_t k = 0; k < m; ++k) {
    const Cell& cell = grid.cells[k];
    const auto type = static_cast<std::size_t>(gmshType(cell.vtk));
    if (four) {  // each in a block of its own
      for (const std::size_t head : {std::size_t{3}, std::size_t{1}, type}) narrow(head);
      wide(1);
      line();
      wide(k + 1);
    } else if (binary) {
      for (const std::size_t head : {type, std::size_t{1}, std::size_t{2}, k + 1, std::size_t{7}, std::size_t{1}})
        narrow(head);
    } else {
      for (const std::size_t head : {k + 1, type, std::size_t{2}, std::size_t{7}, std::size_t{1}}) narrow(head);
    }
    for (const int node : cell.nodes) wide(tag(node));
    line();
  }
  return out + (binary ? "\n" : "") + "$EndElements\n";
}

struct Written {
  std::string name, content;
};

std::vector<Written> filesOf(const Grid& grid) {
  std::vector<Written> files;
  for (const bool binary : {false, true}) {
    const std::string of = binary ? "_binary" : "_ascii";
    for (const char* version : {"2.0", "3.0", "4.2", "5.0", "5.1"})
      files.push_back({std::string("v") + version + of + ".vtk", vtkFile(grid, version, binary)});
    for (const char* version : {"2.2", "4.1"})
      files.push_back({std::string("v") + version + of + ".msh", mshFile(grid, version, binary)});
  }
  for (const char* version : {"2.2", "4.1"})
    files.push_back({std::string("v") + version + "_big.msh", mshFile(grid, version, true, true)});
  files.push_back({"ascii.vtu", vtuFile(grid, {})});
  for (const bool packed : {false, true})
    for (const bool wide : {false, true})
      for (const bool big : {false, true}) {
        const std::string of =
            std::string(packed ? "_packed" : "") + (wide ? "_wide" : "") + (big ? "_big" : "") + ".vtu";
        files.push_back({"inline" + of, vtuFile(grid, {"binary", true, packed, wide, big})});
        files.push_back({"appended" + of, vtuFile(grid, {"appended", true, packed, wide, big})});
        files.push_back({"raw" + of, vtuFile(grid, {"appended", false, packed, wide, big})});
      }
  return files;
}

bool says(const std::string& detail, const std::string& words) { return detail.find(words) != std::string::npos; }

// --- reading

TEST(VolumeMesh, EveryKindGivesTheSameSurface) {
  const TemporaryFolder folder;
  Result<TriangleMesh> first = Error{};
  for (const Written& file : filesOf(thing())) {
    std::vector<std::string> notes;
    const Result<TriangleMesh> read = readMeshFile(folder.write(file.name, file.content), &notes);
    ASSERT_TRUE(read.ok()) << file.name << ": " << read.error().detail;
    if (!first.ok()) first = read;
    EXPECT_EQ(read->vertices, first->vertices) << file.name;
    EXPECT_EQ(read->triangles, first->triangles) << file.name;
    ASSERT_EQ(notes.size(), 1u);
    EXPECT_EQ(notes[0], file.name + kNote + text(read->triangles.size()) + " triangles");
  }
  ASSERT_TRUE(first.ok());
  EXPECT_TRUE(laws::isClosedOriented(*first));
  EXPECT_TRUE(laws::usesEveryVertex(*first));
  EXPECT_EQ(first->vertices.size(), 28u);
  EXPECT_NEAR(signedVolume(*first), kVolume, 1e-12 * kVolume);
}

TEST(VolumeMesh, ItsNotesComeWithTheShape) {
  const TemporaryFolder folder;
  const Result<LoadedShape> shape = loadShape(folder.write("liver.vtk", vtkFile(thing(), "3.0", false)), 2.0);
  ASSERT_TRUE(shape.ok()) << shape.error().detail;
  EXPECT_TRUE(shape->solid);
  EXPECT_NEAR(signedVolume(shape->mesh), 8.0 * kVolume, 1e-9);
  ASSERT_EQ(shape->notes.size(), 1u);
  EXPECT_TRUE(says(shape->notes[0], std::string("liver.vtk") + kNote)) << shape->notes[0];
}

TEST(VolumeMesh, NumbersInNotesAreGrouped) {
  const TemporaryFolder folder;
  Grid grid;
  for (int k = 0; k < 1234; ++k) {
    const int first = static_cast<int>(grid.points.size());
    for (const Vec3& p : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)})
      grid.points.push_back(p + Vec3(2 * k, 0, 0));
    grid.cells.push_back({kTetrahedron, {first, first + 1, first + 2, first + 3}});
  }
  std::vector<std::string> notes;
  ASSERT_TRUE(readMeshFile(folder.write("a.msh", mshFile(grid, "2.2", false)), &notes).ok());
  EXPECT_EQ(notes.at(0), "a.msh: the outer surface of 1,234 tetrahedra is taken: 4,936 triangles");
}

TEST(VolumeMesh, QuadraticCellsAreTakenByTheirCorners) {
  const TemporaryFolder folder;
  Grid grid;
  grid.points = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)};
  for (const auto& edge : {std::array<int, 2>{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}})
    grid.points.push_back(
        0.5 * (grid.points[static_cast<std::size_t>(edge[0])] + grid.points[static_cast<std::size_t>(edge[1])]));
  grid.cells = {{kCurvedTetrahedron, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9}}};
  for (const Written& file : filesOf(grid)) {
    std::vector<std::string> notes;
    const Result<TriangleMesh> read = readMeshFile(folder.write(file.name, file.content), &notes);
    ASSERT_TRUE(read.ok()) << file.name << ": " << read.error().detail;
    EXPECT_EQ(read->vertices.size(), 4u);
    EXPECT_EQ(read->triangles.size(), 4u);
    EXPECT_NEAR(signedVolume(*read), 1.0 / 6.0, 1e-15);
    ASSERT_EQ(notes.size(), 2u);
    EXPECT_EQ(notes[1], file.name + ": 1 quadratic cell is taken by the corners");
  }
}

TEST(VolumeMesh, WithoutVolumesTheSurfaceCellsAreTheSurface) {
  const TemporaryFolder folder;
  Grid grid;
  for (int k = 0; k < 8; ++k) grid.points.emplace_back(k & 1, k >> 1 & 1, k >> 2 & 1);
  grid.cells = {{kQuad, {0, 2, 3, 1}}, {kQuad, {4, 5, 7, 6}},  {kQuad, {0, 1, 5, 4}},  {kQuad, {2, 6, 7, 3}},
                {kQuad, {0, 4, 6, 2}}, {kTriangle, {1, 3, 7}}, {kTriangle, {1, 7, 5}}, {kLine, {0, 1}}};
  for (const Written& file : filesOf(grid)) {
    std::vector<std::string> notes;
    const Result<TriangleMesh> read = readMeshFile(folder.write(file.name, file.content), &notes);
    ASSERT_TRUE(read.ok()) << file.name << ": " << read.error().detail;
    EXPECT_TRUE(laws::isClosedOriented(*read)) << file.name;
    EXPECT_NEAR(signedVolume(*read), 1.0, 1e-15) << file.name;
    EXPECT_TRUE(notes.empty());
  }
}

TEST(VolumeMesh, VoxelsAndPixelsGoAlongTheAxes) {
  const TemporaryFolder folder;
  Grid grid;
  for (int k = 0; k < 8; ++k) grid.points.emplace_back(k & 1, k >> 1 & 1, k >> 2 & 1);
  grid.cells = {{11, {0, 1, 2, 3, 4, 5, 6, 7}}, {8, {0, 1, 2, 3}}};
  const Result<TriangleMesh> read = readMeshFile(folder.write("a.vtk", vtkFile(grid, "4.2", true)));
  ASSERT_TRUE(read.ok()) << read.error().detail;
  EXPECT_TRUE(laws::isClosedOriented(*read));
  EXPECT_NEAR(signedVolume(*read), 1.0, 1e-15);
  grid.cells.erase(grid.cells.begin());
  const Result<TriangleMesh> pixel = readMeshFile(folder.write("b.vtu", vtuFile(grid, {})));
  ASSERT_TRUE(pixel.ok()) << pixel.error().detail;
  EXPECT_NEAR(surfaceArea(*pixel), 1.0, 1e-15);
}

// One hexahedron of 1 x 1 x 2, as VTK 9.1 writes it.
TEST(VolumeMesh, AsVtkWritesIt) {
  const TemporaryFolder folder;
  const char* const inline_data =
      R"(<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64" compressor="vtkZLibDataCompressor">
 <UnstructuredGrid>
 <Piece NumberOfPoints="8" NumberOfCells="1">
 <Points>
 <DataArray type="Float64" Name="Points" NumberOfComponents="3" format="binary">
 AQAAAAAAAAAABAAAAAAAAMAAAAAAAAAAJQAAAAAAAAA=eF5jYMAHPtjjlcaQh/EJ6WNwgFAY6hxQuXB5B1Q+QhwAGXUKeQ==
 </DataArray>
 </Points>
 <Cells>
 <DataArray type="Int64" Name="connectivity" format="binary">
 AQAAAAAAAAAABAAAAAAAAEAAAAAAAAAAHgAAAAAAAAA=eF5jYIAARijNDKWZoDQLlGaF0uxQmg1KAwAC8AAd
 </DataArray>
 <DataArray type="Int64" Name="offsets" format="binary">
 AQAAAAAAAAAABAAAAAAAAAgAAAAAAAAACwAAAAAAAAA=eF7jYIAAAABIAAk=
 </DataArray>
 <DataArray type="UInt8" Name="types" format="binary">
 AQAAAAAAAAAABAAAAAAAAAEAAAAAAAAACQAAAAAAAAA=eF7jAQAADQAN
 </DataArray>
 </Cells>
 </Piece>
 </UnstructuredGrid>
</VTKFile>
)";
  const char* const appended_data = R"(<?xml version="1.0"?>
<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian" header_type="UInt32" compressor="vtkZLibDataCompressor">
 <UnstructuredGrid>
 <Piece NumberOfPoints="8" NumberOfCells="1" >
 <Points>
 <DataArray type="Float64" Name="Points" NumberOfComponents="3" format="appended" offset="0" >
 </DataArray>
 </Points>
 <Cells>
 <DataArray type="Int64" Name="connectivity" format="appended" offset="76" />
 <DataArray type="Int64" Name="offsets" format="appended" offset="140" />
 <DataArray type="UInt8" Name="types" format="appended" offset="180" >
 </DataArray>
 </Cells>
 </Piece>
 </UnstructuredGrid>
 <AppendedData encoding="base64">
 _AQAAAAAEAADAAAAAJQAAAA==eF5jYMAHPtjjlcaQh/EJ6WNwgFAY6hxQuXB5B1Q+QhwAGXUKeQ==AQAAAAAEAABAAAAAHgAAAA==eF5jYIAARijNDKWZoDQLlGaF0uxQmg1KAwAC8AAdAQAAAAAEAAAIAAAACwAAAA==eF7jYIAAAABIAAk=AQAAAAAEAAABAAAACQAAAA==eF7jAQAADQAN
 </AppendedData>
</VTKFile>
)";
  for (const char* file : {inline_data, appended_data}) {
    std::vector<std::string> notes;
    const Result<TriangleMesh> read = readMeshFile(folder.write("a.vtu", file), &notes);
    ASSERT_TRUE(read.ok()) << read.error().detail;
    EXPECT_TRUE(laws::isClosedOriented(*read));
    EXPECT_NEAR(signedVolume(*read), 2.0, 1e-15);
    ASSERT_EQ(notes.size(), 1u);
    EXPECT_EQ(notes[0], "a.vtu: the outer surface of 1 hexahedron is taken: 12 triangles");
  }
}

TEST(VolumeMesh, PiecesAreReadTogether) {
  const TemporaryFolder folder;
  const std::string one = vtuFile(thing(), {});
  const std::size_t from = one.find("<Piece"), to = one.find("</UnstructuredGrid>");
  const std::string twice = one.substr(0, to) + one.substr(from, to - from) + one.substr(to);
  const Result<TriangleMesh> read = readMeshFile(folder.write("a.vtu", twice));
  ASSERT_TRUE(read.ok()) << read.error().detail;
  EXPECT_EQ(read->vertices.size(), 56u);
  EXPECT_NEAR(signedVolume(*read), 2.0 * kVolume, 1e-12);
}

// --- hostile files

TEST(VolumeMesh, TruncatedFilesAreRefused) {
  const TemporaryFolder folder;
  for (const Written& file : filesOf(thing()))
    for (std::size_t size = 0; size + 4 < file.content.size(); size += 97) {
      const Result<TriangleMesh> read = readMeshFile(folder.write(file.name, file.content.substr(0, size)));
      ASSERT_FALSE(read.ok()) << file.name << " cut to " << size << " of " << file.content.size();
      EXPECT_EQ(read.error().code, ErrorCode::kUnreadable) << read.error().detail;
      EXPECT_TRUE(says(read.error().detail, file.name)) << read.error().detail;
    }
}

/// The most memory that this process has had [MiB].
double mostMemory() {
  rusage use{};
  ::getrusage(RUSAGE_SELF, &use);
  return static_cast<double>(use.ru_maxrss) / 1024.0;
}

std::string replaced(std::string in, const std::string& from, const std::string& to) {
  const std::size_t at = in.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? in : in.replace(at, from.size(), to);
}

TEST(VolumeMesh, CountsThatAreTooLargeAreRefusedBeforeMemoryIsTaken) {
  const TemporaryFolder folder;
  const Grid grid = thing();
  const std::string n = text(grid.points.size()), m = text(grid.cells.size());
  const double before = mostMemory();
  for (const std::string huge : {"1000000000000000000", "99999999999999999999999", "1999999", "7999999", "-1", "x"}) {
    std::vector<Written> files;
    for (const bool binary : {false, true}) {
      for (const char* version : {"3.0", "5.1"}) {
        const std::string vtk = vtkFile(grid, version, binary);
        files.push_back({"points.vtk", replaced(vtk, "POINTS " + n, "POINTS " + huge)});
        files.push_back({"cells.vtk", replaced(vtk, "\nCELLS ", "\nCELLS " + huge)});
        files.push_back({"types.vtk", replaced(vtk, "CELL_TYPES " + m, "CELL_TYPES " + huge)});
      }
      const std::string two = mshFile(grid, "2.2", binary);
      files.push_back({"points.msh", replaced(two, "$Nodes\n" + n + "\n", "$Nodes\n" + huge + "\n")});
      files.push_back({"cells.msh", replaced(two, "$Elements\n" + m + "\n", "$Elements\n" + huge + "\n")});
    }
    const std::string four = mshFile(grid, "4.1", false);
    files.push_back({"points4.msh", replaced(four, "$Nodes\n2 " + n, "$Nodes\n2 " + huge)});
    files.push_back({"blocks4.msh", replaced(four, "$Nodes\n2", "$Nodes\n" + huge)});
    files.push_back({"cells4.msh", replaced(four, "$Elements\n" + m + " " + m, "$Elements\n" + m + " " + huge)});
    for (const VtuStyle& style : {VtuStyle{}, VtuStyle{"binary", true, true}, VtuStyle{"appended", false}}) {
      const std::string vtu = vtuFile(grid, style);
      files.push_back({"points.vtu", vtuFile(grid, style, huge)});
      files.push_back({"cells.vtu", replaced(vtu, "NumberOfCells=\"" + m, "NumberOfCells=\"" + huge)});
      files.push_back({"components.vtu", replaced(vtu, "NumberOfComponents=\"3", "NumberOfComponents=\"" + huge)});
    }
    for (const Written& file : files)
      EXPECT_FALSE(readMeshFile(folder.write(file.name, file.content)).ok()) << file.name << " with " << huge;
  }
  // In the numbers of a binary file, and in the headers of blocks: each 8 bytes of it.
  for (const Written& file : filesOf(grid)) {
    for (std::size_t at = 0; at + 8 < file.content.size(); at += 41) {
      std::string damaged = file.content;
      for (std::size_t k = 0; k < 8; ++k) damaged[at + k] = static_cast<char>(k == 0 || k == 7 ? 0x7f : 0xff);
      const Result<TriangleMesh> read = readMeshFile(folder.write(file.name, damaged));
      if (!read.ok()) {
        EXPECT_FALSE(read.error().detail.empty());
      }
    }
  }
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  EXPECT_LT(mostMemory() - before, 64.0);
#endif
}

// A gigabyte of zeros from a few bytes.
TEST(VolumeMesh, DataThatUnpackToMoreThanTheyCanAreRefused) {
  const TemporaryFolder folder;
  const double before = mostMemory();
  std::string bytes;
  for (const std::uint32_t n : {1u, 48000000u, 0u, 8u}) put(bytes, n);
  const std::string array = base64(bytes) + base64("12345678");
  const std::string file =
      "<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\" compressor=\"vtkZLibDataCompressor\">"
      "<UnstructuredGrid><Piece NumberOfPoints=\"2000000\" NumberOfCells=\"1\"><Points><DataArray type=\"Float64\" "
      "NumberOfComponents=\"3\" format=\"binary\">" +
      array + "</DataArray></Points></Piece></UnstructuredGrid></VTKFile>";
  const Result<TriangleMesh> read = readMeshFile(folder.write("a.vtu", file));
  ASSERT_FALSE(read.ok());
  EXPECT_TRUE(says(read.error().detail, "promise 48000000 bytes")) << read.error().detail;
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  EXPECT_LT(mostMemory() - before, 16.0);
#endif
}

TEST(VolumeMesh, CornersThatAreNotThereAreNamed) {
  const TemporaryFolder folder;
  for (const int corner : {-1, 300, 40000000, std::numeric_limits<int>::max()}) {
    Grid grid = thing();
    grid.cells.back().nodes[2] = corner;
    for (const Written& file : filesOf(grid)) {
      const Result<TriangleMesh> read = readMeshFile(folder.write(file.name, file.content));
      ASSERT_FALSE(read.ok()) << file.name;
      EXPECT_EQ(read.error().code, ErrorCode::kUnreadable);
      EXPECT_TRUE(says(read.error().detail, "has the corner") || says(read.error().detail, "has the node") ||
                  says(read.error().detail, "truncated or damaged in its"))
          << file.name << ": " << read.error().detail;
    }
  }
}

TEST(VolumeMesh, PointsThatAreNotFiniteAreRefused) {
  const TemporaryFolder folder;
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    Grid grid = thing();
    grid.points[5].y() = bad;
    for (const Written& file : filesOf(grid)) {
      const Result<TriangleMesh> read = readMeshFile(folder.write(file.name, file.content));
      ASSERT_FALSE(read.ok()) << file.name;
      EXPECT_EQ(read.error().code, ErrorCode::kUnsuitableShape);
      EXPECT_TRUE(says(read.error().detail, "which is not finite")) << file.name << ": " << read.error().detail;
    }
  }
}

// Gmsh writes an element of version 2 for each of its physical groups.
TEST(VolumeMesh, ElementsOfSeveralPhysicalGroupsAreReadOnce) {
  const TemporaryFolder folder;
  const Grid once = thing();
  Grid twice, flat;
  twice.points = flat.points = once.points;
  for (const Cell& cell : once.cells) {
    twice.cells.push_back(cell);
    twice.cells.push_back(cell);
    if (cell.vtk == kTriangle || cell.vtk == kQuad) flat.cells.insert(flat.cells.end(), {cell, cell});
  }
  twice.cells.insert(twice.cells.end(), once.cells.begin(), once.cells.end());  // a group after another
  for (const bool binary : {false, true}) {
    const std::string of = binary ? "_binary" : "_ascii";
    std::vector<std::string> notes;
    const auto plain = readMeshFile(folder.write("once" + of + ".msh", mshFile(once, "2.2", binary)));
    const auto read = readMeshFile(folder.write("twice" + of + ".msh", mshFile(twice, "2.2", binary)), &notes);
    ASSERT_TRUE(read.ok()) << read.error().detail;
    EXPECT_EQ(read->vertices, plain->vertices);
    EXPECT_EQ(read->triangles, plain->triangles);
    ASSERT_EQ(notes.size(), 2u);
    EXPECT_TRUE(says(notes[0], ": 50 elements that repeat others, as for several physical groups, were left out"))
        << notes[0];
    EXPECT_TRUE(says(notes[1], kNote)) << notes[1];
    const auto surface = readMeshFile(folder.write("flat" + of + ".msh", mshFile(flat, "2.2", binary)));
    ASSERT_TRUE(surface.ok()) << surface.error().detail;
    EXPECT_EQ(surface->triangles.size(), 3u);
  }
  // In version 4.1 each is there once, and one that is not is a fault.
  EXPECT_FALSE(readMeshFile(folder.write("twice.msh", mshFile(twice, "4.1", false))).ok());
}

TEST(VolumeMesh, AFaceOfThreeCellsIsRefused) {
  const TemporaryFolder folder;
  Grid grid = thing();
  grid.cells.push_back({kTetrahedron, {0, 1, 2, 28}});
  grid.cells.push_back({kTetrahedron, {0, 2, 1, 29}});
  for (const Written& file : filesOf(grid)) {
    const Result<TriangleMesh> read = readMeshFile(folder.write(file.name, file.content));
    ASSERT_FALSE(read.ok()) << file.name;
    EXPECT_EQ(read.error().code, ErrorCode::kUnsuitableShape);
    EXPECT_TRUE(says(read.error().detail, "the face of the points 0, 1 and 2 belongs to 3 cells"))
        << read.error().detail;
  }
}

TEST(VolumeMesh, WhatIsNotReadIsNamed) {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& name, const std::string& content, const std::string& words) {
    const Result<TriangleMesh> read = readMeshFile(folder.write(name, content));
    ASSERT_FALSE(read.ok()) << name;
    EXPECT_EQ(read.error().code, ErrorCode::kUnreadable);
    EXPECT_TRUE(says(read.error().detail, words)) << read.error().detail;
  };
  for (const char* name : {"a.3mf", "a.gltf", "a.glb", "a.mesh"})
    refused(name, "x", "accepted endings: .pcd, .ply, .obj, .stl, .vtk, .off, .vtu, .vtp, .msh");
  Grid grid = thing();
  grid.cells[0].vtk = 42;
  refused("a.vtk", vtkFile(grid, "3.0", true), "cell 0 is of VTK's type 42; accepted: tetrahedra");
  refused("a.vtu", vtuFile(grid, {}), "cell 0 is of VTK's type 42; accepted: tetrahedra");
  grid = thing();
  grid.cells.back().nodes.push_back(0);
  refused("a.vtk", vtkFile(grid, "5.1", true), "has 5 corners; accepted for its type: 4");
  refused("a.msh", replaced(mshFile(thing(), "2.2", false), "2.2", "1.0"), "accepted: 2 to 2.2 and 4.1");
  refused("a.msh", replaced(mshFile(thing(), "4.1", false), "4.1", "4"), "accepted: 2 to 2.2 and 4.1");
  refused("a.msh", "solid\n", "no Gmsh file");
  refused("a.vtu", replaced(vtuFile(thing(), {"binary", true, true}), "ZLib", "LZ4"),
          "accepted: vtkZLibDataCompressor");
  refused("a.vtu", replaced(vtuFile(thing(), {}), "UnstructuredGrid", "ImageData"), "accepted: PolyData, UnstructuredGrid");
  refused("a.vtu", replaced(vtuFile(thing(), {}), "<!--", "<!DOCTYPE a [<!ENTITY b \"bb\">]><!--"), "document type");
  refused("a.vtu", "solid\n", "truncated");
  refused("a.vtk", replaced(vtkFile(thing(), "3.0", false), "UNSTRUCTURED", "STRUCTURED"), "accepted: these two");
  for (const char* name : {"a.vtu", "a.msh"}) refused(name, "", "is empty");
}

TEST(VolumeMesh, SurvivesDamagedBytes) {
  const TemporaryFolder folder;
  std::mt19937 random(19);
  std::size_t refused = 0;
  for (const Written& file : filesOf(thing()))
    for (int round = 0; round < 60; ++round) {
      std::string content = file.content;
      const std::size_t reach = round % 2 ? content.size() : std::min<std::size_t>(400, content.size());
      for (int k = 0; k < 1 + round % 5; ++k) content[random() % reach] = static_cast<char>(random() % 256);
      const Result<TriangleMesh> read = readMeshFile(folder.write(file.name, content));
      refused += !read.ok();
      if (!read.ok()) {
        EXPECT_FALSE(read.error().detail.empty());
        continue;
      }
      for (const Triangle& t : read->triangles)
        for (const Index k : t) EXPECT_LT(k, read->vertices.size());
    }
  EXPECT_GT(refused, 300u);
}

}  // namespace volume_mesh_test
}  // namespace meshless
