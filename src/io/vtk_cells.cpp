#include <cmath>
#include <vector>

#include "cells_of_file.h"
#include "vtk_text.h"

namespace meshless {

bool isUnstructuredGrid(std::string_view whole) {
  VtkText text(whole);
  for (int k = 0; k < 3; ++k) text.line();
  const std::vector<std::string> words = text.words();
  return words.size() == 2 && words[0] == "dataset" && words[1] == "unstructured_grid";
}

Result<CellsOfFile> readVtkCells(const std::string& name, std::string_view whole) {
  VtkText text(whole);
  const Result<VtkHead> head = readVtkHead(name, whole, text);
  if (!head) return head.error();
  CellsOfFile found;
  std::vector<double> coordinates;
  std::vector<std::int32_t> cells, types;
  double count = 0.0;
  bool has_points = false, has_cells = false, has_types = false;
  std::vector<std::string> words;
  while (!has_types && !(words = text.words()).empty()) {
    if (words[0] == "points") {
      const double n = words.size() == 3 ? countOf(words[1]) : std::nan("");
      if (n > static_cast<double>(kMaxPoints)) return checkCounts(name, n, 0.0, 0.0).error();
      if (!text.numbers(head->binary, words.size() == 3 ? words[2] : "", 3.0 * n, coordinates))
        return unreadable(name, "is truncated or damaged in its POINTS (float or double)");
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
  found.points.reserve(coordinates.size() / 3);
  for (std::size_t k = 0; k + 2 < coordinates.size(); k += 3)
    found.points.emplace_back(coordinates[k], coordinates[k + 1], coordinates[k + 2]);
  coordinates = {};
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
