#include "plot.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>

namespace meshless::bench {

bool draw(const Plot& plot, const std::string& path) {
  const std::string script = path + ".gp";
  {
    std::ofstream file(script);
    file << "set terminal pngcairo size 1200,720\nset output '" << path << "'\nset logscale xy\nset grid\n"
         << "set format y '10^{%L}'\nset key outside right font ',9' noenhanced\nset title \"" << plot.title
         << "\"\nset xlabel \"" << plot.x << "\"\nset ylabel \"" << plot.y << "\"\n";
    int number = 0;
    std::string command;
    for (const auto& [name, unsorted] : plot.series) {
      auto points = unsorted;
      std::sort(points.begin(), points.end());
      file << "$s" << number << " << EOD\n";
      for (const auto& [x, y] : points) file << x << ' ' << y << '\n';
      file << "EOD\n";
      command += (number ? ", " : "plot ") + ("$s" + std::to_string(number)) +
                 (plot.points_alone.count(name) ? " with points pt 4" : " with linespoints") + " title '" + name + "'";
      ++number;
    }
    file << command << '\n';
  }
  const bool drawn = std::system(("gnuplot '" + script + "' 2>&1").c_str()) == 0;
  std::remove(script.c_str());
  return drawn;
}

}  // namespace meshless::bench
