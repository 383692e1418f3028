#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "mesh_check_before.h"
#include "vtk_text.h"

namespace meshless {
namespace {

template <class T>
void putBigEndian(std::string& out, T value) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  std::reverse(bytes, bytes + sizeof(T));
  out.append(bytes, sizeof(T));
}

/// Number of cells; -1 where sizes or corners are not what they can be.
double checkCells(const std::vector<std::int32_t>& cells, std::size_t points) {
  double found = 0.0;
  for (std::size_t at = 0; at < cells.size(); ++found) {
    const std::int32_t size = cells[at++];
    if (size < 1 || static_cast<std::size_t>(size) > cells.size() - at) return -1.0;
    for (std::int32_t k = 0; k < size; ++k, ++at)
      if (cells[at] < 0 || static_cast<std::size_t>(cells[at]) >= points) return -1.0;
  }
  return found;
}

/// Every second triangle of a strip has its first two corners swapped, so that all face one way.
std::vector<std::int32_t> trianglesOfStrips(const std::vector<std::int32_t>& strips) {
  std::vector<std::int32_t> cells;
  for (std::size_t at = 0; at < strips.size(); at += 1 + static_cast<std::size_t>(strips[at]))
    for (std::size_t k = 0; k + 2 < static_cast<std::size_t>(strips[at]); ++k) {
      const std::int32_t* corner = &strips[at + 1 + k];
      cells.insert(cells.end(), {3, corner[k % 2], corner[1 - k % 2], corner[2]});
    }
  return cells;
}

}  // namespace

Result<std::string> plainVtk(const std::string& name, std::string_view whole, PromisedCounts& promised) {
  const auto unreadable = [&](const std::string& what) {
    return Error{ErrorCode::kUnreadable, "'" + name + "' " + what};
  };
  VtkText text(whole);

  const Result<VtkHead> head = readVtkHead(name, whole, text);
  if (!head) return head.error();
  const auto& [offsets, binary, dataset] = *head;
  if (dataset != "polydata")
    return unreadable("is not a DATASET POLYDATA or UNSTRUCTURED_GRID, or truncated; accepted: these two");

  std::vector<double> points;
  std::vector<std::int32_t> cells, strips;
  double polygons = 0.0;
  bool has_points = false;
  std::vector<std::string> words;
  while (!(words = text.words()).empty()) {
    if (words[0] == "point_data" || words[0] == "cell_data") break;  // no shape after it
    if (words[0] == "points") {
      const double n = words.size() == 3 ? countOf(words[1]) : std::nan("");
      if (n > static_cast<double>(kMaxPoints)) return checkCounts(name, n, 0.0, 0.0).error();
      if (!text.numbers(binary, words.size() == 3 ? words[2] : "", 3.0 * n, points))
        return unreadable("is truncated or damaged in its POINTS (float or double)");
      has_points = true;
    } else if (words[0] == "polygons" || words[0] == "triangle_strips" || words[0] == "lines" ||
               words[0] == "vertices") {
      std::vector<std::int32_t> read;
      const double n = words.size() == 3 ? countOf(words[1]) : std::nan("");
      const double size = words.size() == 3 ? countOf(words[2]) : std::nan("");
      const double corners = offsets ? size : size - n;
      if (n > static_cast<double>(kMaxFaces) || corners > static_cast<double>(kMaxCorners))
        return checkCounts(name, 1.0, n, corners).error();
      if (!has_points || !readCells(text, binary, offsets, n, size, read))
        return unreadable("is truncated or damaged in its " + words[0]);
      if (words[0] == "lines" || words[0] == "vertices") continue;
      const double found = checkCells(read, points.size() / 3);
      if (found < 0.0 || found != (offsets ? std::max(0.0, n - 1.0) : n))
        return unreadable("has damaged " + words[0] +
                          ": their sizes and corners do not fit their number and that of the points");
      if (words[0] == "polygons") {
        cells = std::move(read);
        polygons = found;
      } else {
        strips = trianglesOfStrips(read);
      }
    }
  }
  if (!has_points) return unreadable("has no POINTS, or is truncated");
  if (points.empty()) return Error{ErrorCode::kUnsuitableShape, "'" + name + "' has no points"};

  cells.insert(cells.end(), strips.begin(), strips.end());
  polygons += static_cast<double>(strips.size() / 4);
  if (Status status = checkCounts(name, 1.0, polygons, 0.0); !status) return status.error();
  promised.points = points.size() / 3;
  promised.faces = static_cast<std::size_t>(polygons);
  std::string plain = "# vtk DataFile Version 3.0\nplain\nBINARY\nDATASET POLYDATA\nPOINTS " +
                      std::to_string(points.size() / 3) + " double\n";
  for (double x : points) putBigEndian(plain, x);
  if (!cells.empty()) {
    plain += "\nPOLYGONS " + std::to_string(*promised.faces) + " " + std::to_string(cells.size()) + "\n";
    for (std::int32_t k : cells) putBigEndian(plain, k);
  }
  plain += "\n";
  return plain;
}

}  // namespace meshless
