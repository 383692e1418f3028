#include "truth_case.h"

#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>

namespace meshless::bench {

double TruthCase::number(const std::string& key) const {
  const auto at = keys.find(key);
  if (at == keys.end()) return std::numeric_limits<double>::quiet_NaN();
  return std::strtod(at->second.c_str(), nullptr);
}

Vec3 TruthCase::vector(const std::string& key) const {
  Vec3 v = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
  const auto at = keys.find(key);
  if (at == keys.end()) return v;
  std::istringstream words(at->second);
  words >> v.x() >> v.y() >> v.z();
  return v;
}

std::string TruthCase::text(const std::string& key) const {
  const auto at = keys.find(key);
  return at == keys.end() ? "" : at->second;
}

Result<TruthCase> readTruthCase(const std::string& file) {
  std::ifstream in(file);
  if (!in) return Error{ErrorCode::kUnreadable, "cannot read '" + file + "'"};
  TruthCase read;
  std::string line;
  while (std::getline(in, line)) {
    if (line.rfind("# ", 0) == 0) {
      const std::size_t colon = line.find(": ");
      if (colon != std::string::npos) read.keys[line.substr(2, colon - 2)] = line.substr(colon + 2);
      continue;
    }
    if (line.empty() || line[0] == 'x') continue;
    Vec3 p, u;
    char comma;
    std::istringstream words(line);
    if (!(words >> p.x() >> comma >> p.y() >> comma >> p.z() >> comma >> u.x() >> comma >> u.y() >> comma >> u.z()))
      return Error{ErrorCode::kUnreadable, "'" + file + "' has the row '" + line + "'; accepted: six numbers"};
    read.rest.push_back(p);
    read.displacement.push_back(u);
  }
  if (read.rest.empty()) return Error{ErrorCode::kUnreadable, "'" + file + "' has no rows"};
  return read;
}

}  // namespace meshless::bench
