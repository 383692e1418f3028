// A case of the finite-element truth (bench/truth), as its file says it.
#pragma once

#include <map>
#include <string>

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/base/types.h"

namespace meshless::bench {

struct TruthCase {
  std::map<std::string, std::string> keys;
  Points rest;          // [m] of the samples
  Points displacement;  // [m]

  double number(const std::string& key) const;  // NaN where missing
  Vec3 vector(const std::string& key) const;
  std::string text(const std::string& key) const;
  bool has(const std::string& key) const { return keys.count(key) > 0; }
};

/// Refuses (kUnreadable) a missing file, a row that is not six numbers, and a file without rows.
Result<TruthCase> readTruthCase(const std::string& file);

}  // namespace meshless::bench
