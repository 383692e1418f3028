// Plots of benchmark tables, by gnuplot.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace meshless::bench {

/// Logarithmic in both axes.
struct Plot {
  std::string title, x, y;
  std::map<std::string, std::vector<std::pair<double, double>>> series;
  std::set<std::string> points_alone;  // series without lines
};

/// Writes a PNG file. False where gnuplot is missing or fails.
bool draw(const Plot& plot, const std::string& path);

}  // namespace meshless::bench
