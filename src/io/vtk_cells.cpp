#include <cmath>
#include <vector>

#include "cells_of_file.h"
#include "mesh_format.h"
#include "vtk_text.h"

namespace meshless {

namespace {

constexpr int kVtkPolygon = 7, kVtkStrip = 6;

Status readPoints(const std::string& name, VtkText& text, bool binary, const std::vector<std::string>& words,
                  CellsOfFile& found) {
  const double n = words.size() == 3 ? countOf(words[1]) : std::nan("");
  if (n > static_cast<double>(kMaxPoints)) return checkCounts(name, n, 0.0, 0.0);
  std::vector<double> coordinates;
  if (!text.numbers(binary, words.size() == 3 ? words[2] : "", 3.0 * n, coordinates))
    return unreadable(name, "is truncated or damaged in its POINTS (float or double)");
  found.points.clear();
  found.points.reserve(coordinates.size() / 3);
  for (std::size_t k = 0; k + 2 < coordinates.size(); k += 3)
    found.points.emplace_back(coordinates[k], coordinates[k + 1], coordinates[k + 2]);
  return Done{};
}

/// POLYGONS and TRIANGLE_STRIPS; lines and points are no faces.
Result<CellsOfFile> readPolyData(const std::string& name, VtkText& text, const VtkHead& head) {
  CellsOfFile found;
  bool has_points = false;
  std::vector<std::string> words;
  std::vector<std::int32_t> read;
  std::vector<std::int64_t> nodes;
  while (!(words = text.words()).empty()) {
    if (words[0] == "point_data" || words[0] == "cell_data") break;  // no shape after it
    if (words[0] == "points") {
      if (Status status = readPoints(name, text, head.binary, words, found); !status) return status.error();
      has_points = true;
    } else if (words[0] == "polygons" || words[0] == "triangle_strips" || words[0] == "lines" ||
               words[0] == "vertices") {
      const double n = words.size() == 3 ? countOf(words[1]) : std::nan("");
      const double size = words.size() == 3 ? countOf(words[2]) : std::nan("");
      const double corners = head.offsets ? size : size - n;
      if (n > static_cast<double>(kMaxFaces) || corners > static_cast<double>(kMaxCorners))
        return checkCounts(name, 1.0, n, corners).error();
      if (!has_points || !readCells(text, head.binary, head.offsets, n, size, read))
        return unreadable(name, "is truncated or damaged in its " + words[0]);
      if (words[0] == "lines" || words[0] == "vertices") continue;
      const int type = words[0] == "polygons" ? kVtkPolygon : kVtkStrip;
      const auto damaged = [&] {
        return unreadable(name, "has damaged " + words[0] +
                                    ": their sizes and corners do not fit their number and that of the points");
      };
      double cells = 0.0;
      for (std::size_t at = 0; at < read.size(); ++cells) {
        const std::int32_t count = read[at++];
        if (count < 1 || static_cast<std::size_t>(count) > read.size() - at) return damaged();
        nodes.assign(read.begin() + static_cast<std::ptrdiff_t>(at),
                     read.begin() + static_cast<std::ptrdiff_t>(at) + count);
        at += static_cast<std::size_t>(count);
        if (count < 3) continue;
        if (const std::string fault = found.add(type, nodes.data(), nodes.size()); !fault.empty())
          return unreadable(name, "has damaged " + words[0] + ": one " + fault);
        if (found.polygon_count > kMaxFaces || found.polygons.size() > kMaxFaces + kMaxCorners)
          return checkCounts(name, 1.0, static_cast<double>(found.polygon_count),
                             static_cast<double>(found.polygons.size()))
              .error();
      }
      if (cells != (head.offsets ? std::max(0.0, n - 1.0) : n)) return damaged();
    }
  }
  if (!has_points) return unreadable(name, "has no POINTS, or is truncated");
  if (Status status =
          checkCounts(name, static_cast<double>(found.points.size()), static_cast<double>(found.polygon_count), 0.0);
      !status)
    return status.error();
  return found;
}

}  // namespace

Result<CellsOfFile> readVtkCells(const std::string& name, std::string_view whole) {
  VtkText text(whole);
  const Result<VtkHead> head = readVtkHead(name, whole, text);
  if (!head) return head.error();
  if (head->dataset == "polydata") return readPolyData(name, text, *head);
  if (head->dataset != "unstructured_grid")
    return unreadable(name, "is not a DATASET POLYDATA or UNSTRUCTURED_GRID, or truncated; accepted: these two");
  CellsOfFile found;
  std::vector<std::int32_t> cells, types;
  double count = 0.0;
  bool has_points = false, has_cells = false, has_types = false;
  std::vector<std::string> words;
  while (!has_types && !(words = text.words()).empty()) {
    if (words[0] == "points") {
      if (Status status = readPoints(name, text, head->binary, words, found); !status) return status.error();
      has_points = true;
    } else if (words[0] == "cells") {
      const double n = words.size() == 3 ? countOf(words[1]) : std::nan("");
      const double size = words.size() == 3 ? countOf(words[2]) : std::nan("");
      const double corners = head->offsets ? size : size - n;
      count = head->offsets ? std::max(0.0, n - 1.0) : n;
      if (count > static_cast<double>(kMaxFaces) || corners > static_cast<double>(kMaxCorners))
        return checkCounts(name, 1.0, count, corners).error();
      if (!readCells(text, head->binary, head->offsets, n, size, cells))
        return unreadable(name, "is truncated or damaged in its CELLS");
      has_cells = true;
    } else if (words[0] == "cell_types") {
      const double n = words.size() == 2 ? countOf(words[1]) : std::nan("");
      if (!has_cells || !(n == count))
        return unreadable(name, "has CELL_TYPES for " + (words.size() == 2 ? printable(words[1]) : "") +
                                    " cells; accepted: as many as its CELLS before them");
      if (!text.numbers(head->binary, "int", n, types))
        return unreadable(name, "is truncated or damaged in its CELL_TYPES");
      has_types = true;
    }
  }
  if (!has_points || !has_types) return unreadable(name, "has no POINTS, CELLS and CELL_TYPES, or is truncated");
  std::vector<std::int64_t> nodes;
  std::size_t at = 0;
  for (std::size_t k = 0; k < types.size(); ++k) {
    const std::int32_t size = at < cells.size() ? cells[at++] : -1;
    if (size < 0 || static_cast<std::size_t>(size) > cells.size() - at)
      return unreadable(name, "has damaged CELLS: the sizes of the cells do not fit their number");
    nodes.assign(cells.begin() + static_cast<std::ptrdiff_t>(at),
                 cells.begin() + static_cast<std::ptrdiff_t>(at) + size);
    at += static_cast<std::size_t>(size);
    if (const std::string fault = found.add(types[k], nodes.data(), nodes.size()); !fault.empty())
      return unreadable(name, "is damaged: cell " + std::to_string(k) + " " + fault);
  }
  if (at != cells.size()) return unreadable(name, "has damaged CELLS: the sizes of the cells do not fit their number");
  return found;
}

}  // namespace meshless
