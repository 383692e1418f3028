// What a file of cells holds: volumes such as tetrahedra, and surfaces such as triangles, as Slicer, ParaView, SOFA and
// Gmsh write them. Each of its readers looks at every number itself and takes no memory that the file does not pay for.
// VTK has readers for two of these kinds. Those of VTK 9.1 give no error for most truncated files; damaged counts and
// bytes end the process: the one for legacy files reads outside of its arrays, the one for XML divides by zero. To hold
// every array against what the file can hold before they see it is to read it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/mesh/outer_surface.h"
#include "meshless_surgery/io/files.h"

namespace meshless {

struct CellsOfFile {
  Points points;
  VolumeCells volumes;
  std::vector<Index> polygons;  // of each surface cell the number of its corners, then these
  std::size_t polygon_count = 0;
  FileTexture texture;       // of the corners of `polygons`
  std::size_t curved = 0;    // volume cells with nodes beside their corners
  std::size_t repeated = 0;  // cells, points and lines that were left out as they are there already

  /// A cell of a type of VTK with `nodes`, corners first; of curved cells these alone are kept, points and lines are
  /// left out. What is wrong with it, for a message behind the number of the cell; empty where nothing is.
  std::string add(int vtk_type, const std::int64_t* nodes, std::size_t count);
};

/// VTK's type of a surface or volume of as many corners.
constexpr int kVtkTriangle = 5, kVtkQuad = 9, kVtkTetrahedron = 10, kVtkHexahedron = 12, kVtkWedge = 13,
              kVtkPyramid = 14, kVtkLine = 3, kVtkVertex = 1;

// Each refuses kUnreadable and kUnsuitableShape; `name` is for messages.

/// A legacy VTK file, versions up to 5.1, with a DATASET POLYDATA or UNSTRUCTURED_GRID.
Result<CellsOfFile> readVtkCells(const std::string& name, std::string_view text);

/// VTK's XML of type PolyData or UnstructuredGrid: numbers as text, base64 or appended, plain or compressed by zlib.
Result<CellsOfFile> readVtkXmlCells(const std::string& name, std::string_view text);

/// Gmsh's own format, versions 2 to 2.2 and 4.1, ASCII and binary.
Result<CellsOfFile> readGmshCells(const std::string& name, std::string_view text);

/// The vertices and faces of a PLY file, ASCII and binary.
Result<CellsOfFile> readPlyCells(const std::string& name, std::string_view text);

/// Wavefront OBJ; faces and vertices are counted from 1, as in the file.
Result<CellsOfFile> readObjCells(const std::string& name, std::string_view text);

/// STL, text and binary.
Result<CellsOfFile> readStlCells(const std::string& name, std::string_view text);

/// OFF in text; colours, normals and texture coordinates are left out.
Result<CellsOfFile> readOffCells(const std::string& name, std::string_view text);

/// The outer surface of the volumes; without any the surface cells; without these a cloud. A note says which volumes
/// there were. `texture`: three points a triangle, where the surface cells have them.
Result<TriangleMesh> surfaceOf(const std::string& name, CellsOfFile&& cells, std::vector<std::string>& notes,
                               FileTexture& texture);

}  // namespace meshless
