#include "cells_of_file.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "mesh_format.h"
#include "polygon.h"

namespace meshless {
namespace {

enum class CellUse { kVolume, kSurface, kNone };

/// What is kept of a cell of a type of VTK: its first corners.
struct CellType {
  int vtk;
  CellUse use;
  CellShape shape;      // of a volume
  std::size_t corners;  // 0: as many as it has
  bool curved;          // it has more nodes
};

constexpr CellShape kTet = CellShape::kTetrahedron, kHex = CellShape::kHexahedron, kWedge = CellShape::kWedge,
                    kPyramid = CellShape::kPyramid;
constexpr CellType kCellTypes[] = {
    {1, CellUse::kNone, kTet, 0, false},       {2, CellUse::kNone, kTet, 0, false},
    {3, CellUse::kNone, kTet, 0, false},       {4, CellUse::kNone, kTet, 0, false},
    {21, CellUse::kNone, kTet, 0, false},      {35, CellUse::kNone, kTet, 0, false},
    {68, CellUse::kNone, kTet, 0, false},      {75, CellUse::kNone, kTet, 0, false},
    {5, CellUse::kSurface, kTet, 3, false},    {7, CellUse::kSurface, kTet, 0, false},
    {8, CellUse::kSurface, kTet, 4, false},    {9, CellUse::kSurface, kTet, 4, false},
    {22, CellUse::kSurface, kTet, 3, true},    {23, CellUse::kSurface, kTet, 4, true},
    {28, CellUse::kSurface, kTet, 4, true},    {30, CellUse::kSurface, kTet, 4, true},
    {34, CellUse::kSurface, kTet, 3, true},    {69, CellUse::kSurface, kTet, 3, true},
    {70, CellUse::kSurface, kTet, 4, true},    {76, CellUse::kSurface, kTet, 3, true},
    {77, CellUse::kSurface, kTet, 4, true},    {10, CellUse::kVolume, kTet, 4, false},
    {11, CellUse::kVolume, kHex, 8, false},    {12, CellUse::kVolume, kHex, 8, false},
    {13, CellUse::kVolume, kWedge, 6, false},  {14, CellUse::kVolume, kPyramid, 5, false},
    {24, CellUse::kVolume, kTet, 4, true},     {25, CellUse::kVolume, kHex, 8, true},
    {26, CellUse::kVolume, kWedge, 6, true},   {27, CellUse::kVolume, kPyramid, 5, true},
    {29, CellUse::kVolume, kHex, 8, true},     {31, CellUse::kVolume, kWedge, 6, true},
    {32, CellUse::kVolume, kWedge, 6, true},   {33, CellUse::kVolume, kHex, 8, true},
    {37, CellUse::kVolume, kPyramid, 5, true}, {71, CellUse::kVolume, kTet, 4, true},
    {72, CellUse::kVolume, kHex, 8, true},     {73, CellUse::kVolume, kWedge, 6, true},
    {74, CellUse::kVolume, kPyramid, 5, true}, {78, CellUse::kVolume, kTet, 4, true},
    {79, CellUse::kVolume, kHex, 8, true},     {80, CellUse::kVolume, kWedge, 6, true},
    {81, CellUse::kVolume, kPyramid, 5, true},
};
constexpr int kVtkPixel = 8, kVtkVoxel = 11, kVtkStrip = 6;

/// 1234567 as 1,234,567.
std::string grouped(std::size_t n) {
  std::string text = std::to_string(n);
  for (std::size_t at = text.size(); at > 3;) text.insert(at -= 3, ",");
  return text;
}

std::string counted(std::size_t n, const char* one, const char* more) {
  return grouped(n) + " " + (n == 1 ? one : more);
}

/// "5,230 tetrahedra, 3 wedges and 12 hexahedra".
std::string volumesInWords(const VolumeCells& cells) {
  constexpr const char* kNames[kCellShapes][2] = {
      {"tetrahedron", "tetrahedra"}, {"hexahedron", "hexahedra"}, {"wedge", "wedges"}, {"pyramid", "pyramids"}};
  std::array<std::size_t, kCellShapes> counts{};
  for (const CellShape shape : cells.shapes) ++counts[static_cast<std::size_t>(shape)];
  std::vector<std::string> parts;
  for (std::size_t k = 0; k < kCellShapes; ++k)
    if (counts[k] > 0) parts.push_back(counted(counts[k], kNames[k][0], kNames[k][1]));
  std::string text = parts[0];
  for (std::size_t k = 1; k < parts.size(); ++k) text += (k + 1 < parts.size() ? ", " : " and ") + parts[k];
  return text;
}

}  // namespace

std::string CellsOfFile::add(int vtk_type, const std::int64_t* nodes, std::size_t count) {
  if (vtk_type == kVtkStrip) {
    // Every second triangle has its first two corners swapped, so that all face one way.
    for (std::size_t k = 0; k + 2 < count; ++k) {
      const std::int64_t corners[3] = {nodes[k + k % 2], nodes[k + 1 - k % 2], nodes[k + 2]};
      if (std::string fault = add(kVtkTriangle, corners, 3); !fault.empty()) return fault;
    }
    return "";
  }
  const CellType* type = std::find_if(std::begin(kCellTypes), std::end(kCellTypes),
                                      [&](const CellType& one) { return one.vtk == vtk_type; });
  if (type == std::end(kCellTypes))
    return "is of VTK's type " + std::to_string(vtk_type) +
           "; accepted: tetrahedra, hexahedra, wedges, pyramids, triangles, quads and polygons";
  if (type->use == CellUse::kNone) return "";
  const std::size_t corners = type->corners ? type->corners : count;
  if (count < std::max<std::size_t>(corners, 3) || (!type->curved && count != corners))
    return "has " + std::to_string(count) +
           " corners; accepted for its type: " + std::to_string(std::max<std::size_t>(corners, 3));
  if (corners > kMaxPolygon) return "has " + std::to_string(corners) + " corners; accepted: up to 1000";
  for (std::size_t k = 0; k < corners; ++k)
    if (nodes[k] < 0 || nodes[k] >= static_cast<std::int64_t>(points.size()))
      return "has the corner " + std::to_string(nodes[k]) + "; accepted: 0 to " + std::to_string(points.size()) +
             " exclusive, the number of points";
  std::vector<Index>& to = type->use == CellUse::kVolume ? volumes.corners : polygons;
  if (type->use == CellUse::kVolume) {
    volumes.shapes.push_back(type->shape);
    curved += type->curved;
  } else {
    polygons.push_back(static_cast<Index>(corners));
    ++polygon_count;
  }
  for (std::size_t k = 0; k < corners; ++k) to.push_back(static_cast<Index>(nodes[k]));
  // These two go along the axes and not around.
  if (vtk_type == kVtkPixel || vtk_type == kVtkVoxel) std::swap(to[to.size() - 1], to[to.size() - 2]);
  if (vtk_type == kVtkVoxel) std::swap(to[to.size() - 5], to[to.size() - 6]);
  return "";
}

namespace {

constexpr double kMostWork = 1e8;  // looks at corners for the ears of a file's polygons: some seconds

/// As triangles (polygon.h). `points`: of the corners, which `texture` gets for each triangle; or null.
void addPolygon(const std::vector<Index>& corners, const TexturePoint* points, TriangleMesh& mesh, FileTexture& texture,
                double& work) {
  for (const std::array<std::size_t, 3>& triangle : trianglesOf(corners, mesh.vertices, work)) {
    mesh.triangles.push_back({corners[triangle[0]], corners[triangle[1]], corners[triangle[2]]});
    if (points)
      for (const std::size_t corner : triangle) texture.corners.push_back(points[corner]);
  }
}

}  // namespace

Result<TriangleMesh> surfaceOf(const std::string& name, CellsOfFile&& cells, std::vector<std::string>& notes,
                               FileTexture& texture) {
  if (cells.points.empty()) return Error{ErrorCode::kUnsuitableShape, "'" + name + "' has no points"};
  if (cells.repeated > 0)
    notes.push_back(name + ": " + counted(cells.repeated, "element", "elements") +
                    " that repeat others, as for several physical groups, were left out");
  if (!cells.volumes.empty()) {
    Result<TriangleMesh> surface = outerSurface(cells.points, cells.volumes);
    if (!surface) return Error{surface.error().code, "'" + name + "': " + surface.error().detail};
    notes.push_back(name + ": the outer surface of " + volumesInWords(cells.volumes) +
                    " is taken: " + counted(surface->triangles.size(), "triangle", "triangles"));
    if (cells.curved > 0)
      notes.push_back(name + ": " + counted(cells.curved, "quadratic cell is", "quadratic cells are") +
                      " taken by the corners");
    return surface;
  }
  TriangleMesh mesh;
  mesh.vertices = std::move(cells.points);
  texture.fault = cells.texture.fault;
  const TexturePoint* points = cells.texture.corners.empty() ? nullptr : cells.texture.corners.data();
  std::vector<Index> corners;
  double work = kMostWork;
  for (std::size_t at = 0; at < cells.polygons.size(); at += 1 + cells.polygons[at]) {
    const auto first = cells.polygons.begin() + static_cast<std::ptrdiff_t>(at) + 1;
    corners.assign(first, first + cells.polygons[at]);
    addPolygon(corners, points, mesh, texture, work);
    if (points) points += corners.size();
  }
  return mesh;
}

}  // namespace meshless
