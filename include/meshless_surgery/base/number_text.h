// A number as people and files read it.
#pragma once

#include <cmath>
#include <cstdio>
#include <string>

namespace meshless {

/// As "%g" with so many significant digits, 1 to 17; nan, inf and -inf.
inline std::string numberText(double value, int digits = 6) {
  if (std::isnan(value)) return "nan";  // no "-nan"
  char text[40];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return text;
}

}  // namespace meshless
