// Which kinds of files there are, and how large they may be. Each kind has one reader (cells_of_file.h); it holds every
// count against what the file can hold before it takes memory for it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "meshless_surgery/base/result.h"

namespace meshless {

constexpr std::uint64_t kMaxMeshBytes = 512ull << 20;
constexpr std::size_t kMaxPoints = 2000000;
constexpr std::size_t kMaxFaces = 8000000;     // a closed surface has twice as many triangles as points
constexpr std::size_t kMaxCorners = 32000000;  // of all faces together
constexpr std::size_t kMaxPolygon = 1000;      // corners of one face

enum class MeshFormat { kPcd, kPly, kObj, kStl, kVtk, kOff, kVtkXml, kMsh };

/// By the file's ending, in any case.
Result<MeshFormat> meshFormatOf(const std::string& name);

/// The points of a PCD file, which PCL reads, as a binary one with x, y and z alone; a compressed one keeps its fields
/// and gets a checked header. `points` gets their number.
Result<std::string> plainPcd(const std::string& name, std::string_view text, std::optional<std::size_t>& points);

/// Refuses none and more than 2,000,000, more than 8,000,000 faces and 32,000,000 corners.
Status checkCounts(const std::string& name, double points, double faces, double corners);

}  // namespace meshless
