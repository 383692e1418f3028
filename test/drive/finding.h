// What a law says.
#pragma once

#include <array>
#include <string>

namespace meshless {

enum class Law {
  kFinite,
  kMass,
  kMomentum,
  kVolume,
  kDepth,
  kCrossings,
  kFolds,
  kEnergy,
  kRest,
  kAsleep,
};
constexpr std::size_t kLaws = 10;
constexpr std::array<const char*, kLaws> kLawNames{"finite",    "mass",  "momentum", "volume", "depth",
                                                   "crossings", "folds", "energy",   "rest",   "asleep"};
inline const char* toString(Law law) { return kLawNames[static_cast<std::size_t>(law)]; }

/// The worst that was found; its text says where.
struct Finding {
  double score = 0.0;  // what was found in units of what is allowed: above 1 the law is broken
  std::string text;    // empty where there is nothing to say

  bool broken() const { return !(score <= 1.0); }  // NaN too
  /// Keeps the worse one.
  void take(double other_score, const std::string& other_text) {
    if (broken() && !(score == score)) return;
    if (!(other_score <= score)) {
      score = other_score;
      text = other_text;
    }
  }
  void take(const Finding& other) { take(other.score, other.text); }
};

}  // namespace meshless
