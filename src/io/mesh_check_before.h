// What can be said of a mesh file before PCL reads it. PCL's readers trust the counts in a header (and reserve memory
// for them), and the one for OBJ writes past its array where there are more normals than vertices and opens the
// material files that are named; VTK's follows damaged cells out of its arrays, and PCD's damaged headers. So counts
// are held against the file's size first, and PCD, OBJ and VTK are handed over rewritten, as their points and faces
// alone.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "meshless_surgery/base/result.h"

namespace meshless {

enum class MeshFormat { kPcd, kPly, kObj, kStl, kVtk };

/// By the file's ending, in any case.
Result<MeshFormat> meshFormatOf(const std::string& path);

/// What the file's header promises; empty where the format promises nothing.
struct PromisedCounts {
  std::optional<std::size_t> points, faces;
};

/// Refuses kUnreadable (missing, empty, too large, truncated as far as it can be seen without reading, bad header) and
/// kUnsuitableShape (no points, more than 2,000,000).
Result<PromisedCounts> checkBeforeReading(const std::string& path, MeshFormat format);

/// The points of a PCD file as a binary one with x, y and z alone; a compressed one keeps its fields and gets a checked
/// header. `promised` gets their number. Refuses kUnreadable and kUnsuitableShape.
Result<std::string> plainPcd(const std::string& path, PromisedCounts& promised);

/// The points and polygons of a legacy VTK file (versions up to 5.1, POLYDATA) as a binary one of version 3.0 that
/// holds nothing else. `promised` gets what it holds. Refuses kUnreadable and kUnsuitableShape.
Result<std::string> plainVtk(const std::string& path, PromisedCounts& promised);

/// The lines of an OBJ file that make its shape: "v x y z" and "f a b c ...", texture and normal numbers left out.
Result<std::string> plainObj(const std::string& path);

}  // namespace meshless
