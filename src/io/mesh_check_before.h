// What can be said of a mesh file before PCL reads it. PCL's readers trust the counts in a header (and reserve memory
// for them), and the one for OBJ writes past its array where there are more normals than vertices and opens the
// material files that are named; VTK's follows damaged cells out of its arrays, and PCD's damaged headers. So counts
// are held against the file's size first, and PCD, OBJ and VTK are handed over rewritten, as their points and faces
// alone; OFF, which PCL does not know, as OBJ. PLY is not given to it (cells_of_file.h). Everything works on the bytes
// that were read once: `name` is for messages.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/io/files.h"

namespace meshless {

constexpr std::uint64_t kMaxMeshBytes = 512ull << 20;
constexpr std::size_t kMaxPoints = 2000000;
constexpr std::size_t kMaxFaces = 8000000;     // a closed surface has twice as many triangles as points
constexpr std::size_t kMaxCorners = 32000000;  // of all faces together
constexpr std::size_t kMaxPolygon = 1000;      // corners of one face

enum class MeshFormat { kPcd, kPly, kObj, kStl, kVtk, kOff, kVtu, kMsh };

/// By the file's ending, in any case.
Result<MeshFormat> meshFormatOf(const std::string& name);

/// What the file's header promises; empty where the format promises nothing.
struct PromisedCounts {
  std::optional<std::size_t> points, faces;
};

// Each refuses kUnreadable and kUnsuitableShape.

/// Empty, truncated as far as it can be seen without reading, bad header; no points, too many points or faces.
Result<PromisedCounts> checkBeforeReading(const std::string& name, std::string_view text, MeshFormat format);

/// The points of a PCD file as a binary one with x, y and z alone; a compressed one keeps its fields and gets a checked
/// header. `promised` gets their number.
Result<std::string> plainPcd(const std::string& name, std::string_view text, PromisedCounts& promised);

/// A text STL file in lower case and without the names of its solids, which may be of any letters: the reader takes
/// others than ASCII for a binary file. Empty where nothing is to be changed.
std::string plainStl(std::string_view text);

/// The points, polygons and triangle strips of a legacy VTK file (versions up to 5.1, POLYDATA) as a binary one of
/// version 3.0 that holds nothing else. `promised` gets what it holds.
Result<std::string> plainVtk(const std::string& name, std::string_view text, PromisedCounts& promised);

/// The lines of an OBJ file that make its shape: "v x y z" and "f a b c ...", texture and normal numbers left out.
/// `texture` gets the former.
Result<std::string> plainObj(const std::string& name, std::string_view text, FileTexture& texture);

/// An OFF file as OBJ: normals, colours and texture coordinates are left out. `promised` gets the number of points.
Result<std::string> plainOff(const std::string& name, std::string_view text, PromisedCounts& promised);

/// Refuses none and more than 2,000,000, more than 8,000,000 faces and 32,000,000 corners.
Status checkCounts(const std::string& name, double points, double faces, double corners);

}  // namespace meshless
