#include <cmath>
#include <vector>

#include "cells_of_file.h"
#include "mesh_format.h"
#include "text_words.h"

namespace meshless {
namespace {

/// The words of the next line of an OFF file that has any, without its comment; empty at the end.
std::vector<std::string> offWords(std::string_view& text, std::size_t& line_number) {
  std::vector<std::string> words;
  for (std::string_view line; words.empty() && nextLine(text, line);) {
    ++line_number;
    words = wordsOf(line.substr(0, std::min(line.find('#'), kMaxLine)));
  }
  return words;
}

}  // namespace

Result<CellsOfFile> readOffCells(const std::string& name, std::string_view text) {
  const auto unreadable = [&](const std::string& what) {
    return Error{ErrorCode::kUnreadable, "'" + name + "' " + what};
  };
  if (const std::string fault = notText(text); !fault.empty()) return unreadable(fault);
  std::size_t line_number = 0;
  const auto bad = [&](const std::string& what) {
    return unreadable("line " + std::to_string(line_number) + ": " + what);
  };
  const auto unsuitable = [&](const std::string& what) {
    return Error{ErrorCode::kUnsuitableShape, "'" + name + "' line " + std::to_string(line_number) + ": " + what};
  };
  std::vector<std::string> w = offWords(text, line_number);
  if (!w.empty() && w[0].size() >= 3 && w[0].compare(w[0].size() - 3, 3, "OFF") == 0) {
    const std::string kind = w[0].substr(0, w[0].size() - 3);
    for (const char* known : {"", "C", "N", "CN", "ST", "STC", "STN", "STCN"})
      if (kind == known) w[0].clear();
    if (!w[0].empty() || (w.size() > 1 && w[1] == "BINARY"))
      return bad("'" + printable(w[0].empty() ? "OFF BINARY" : w[0]) + "'; accepted: OFF, COFF, NOFF, in text");
    w.erase(w.begin());
    if (w.empty()) w = offWords(text, line_number);
  }
  const double points = w.size() >= 2 ? countOf(w[0]) : std::nan(""),
               faces = w.size() >= 2 ? countOf(w[1]) : std::nan("");
  if (std::isnan(points) || std::isnan(faces))
    return bad("is no OFF file, or truncated: no numbers of points and faces");
  if (Status status = checkCounts(name, points, faces, 0.0); !status) return status.error();
  CellsOfFile found;
  for (double k = 0.0; k < points; ++k) {
    w = offWords(text, line_number);
    if (w.empty()) return bad("is truncated in its points");
    if (w.size() < 3) return bad("a point needs three numbers, it has " + std::to_string(w.size()));
    Vec3 p;
    for (int c = 0; c < 3; ++c) {
      const std::optional<double> x = numberOf(w[static_cast<std::size_t>(c)]);
      if (!x) return bad("'" + printable(w[static_cast<std::size_t>(c)]) + "' is no number");
      p[c] = *x;
    }
    if (!p.allFinite() && faces > 0.0)  // of a cloud they are dropped
      return unsuitable("point " + std::to_string(found.points.size()) + " is not finite; accepted: finite numbers");
    found.points.push_back(p);
  }
  double all_corners = 0.0;
  for (double k = 0.0; k < faces; ++k) {
    w = offWords(text, line_number);
    if (w.empty()) return bad("is truncated in its faces");
    const double corners = countOf(w[0]);
    if (!(corners <= static_cast<double>(w.size() - 1))) return bad("a face has fewer corners than it says");
    if (corners > static_cast<double>(kMaxPolygon)) return bad("a face has more than 1000 corners");
    if (corners < 3.0) continue;  // a point or an edge
    all_corners += corners;
    if (Status status = checkCounts(name, 1.0, 0.0, all_corners); !status) return status.error();
    found.polygons.push_back(static_cast<Index>(corners));
    for (std::size_t c = 1; static_cast<double>(c) <= corners; ++c) {
      const double corner = countOf(w[c]);
      if (std::isnan(corner)) return bad("'" + printable(w[c]) + "' is no number of a point");
      if (!(corner < points))
        return unsuitable("face " + std::to_string(static_cast<std::size_t>(k)) + " has the corner " + printable(w[c]) +
                          "; accepted: 0 to " + std::to_string(found.points.size() - 1));
      found.polygons.push_back(static_cast<Index>(corner));
    }
    ++found.polygon_count;
  }
  return found;
}

}  // namespace meshless
