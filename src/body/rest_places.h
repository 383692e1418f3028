// Where points that a blade has put inside a deformed body lie in its rest shape.
#pragma once

#include <array>
#include <functional>
#include <memory>

#include "meshless_surgery/body/body.h"

namespace meshless {

/// A point known in both shapes.
struct KnownPlace {
  Vec3 present;  // [m]
  Vec3 rest;     // [m]
};

/// What RestPlaces::of finds of every point.
struct FoundPlaces {
  static constexpr std::size_t kNear = 4;
  Points rest;                                    // [m]
  std::vector<std::array<Index, kNear>> nearest;  // particles in the present shape, the nearest first; kNoIndex: none
};

/// Rest places of points in the present shape: the affine maps of 16 particles each from present to rest, blended
/// over the nearest four, plus what they miss at the known places near by (the rim of a cut), spread inwards by inverse
/// squared distance. Where the particles do not span space, the map follows what they span and keeps lengths across.
/// Neither side of a cut is asked: both get the same places.
class RestPlaces {
 public:
  /// Both must outlive it.
  RestPlaces(const BodyModel& model, const BodyState& state);
  ~RestPlaces();
  RestPlaces(RestPlaces&&) noexcept;

  /// Makes the maps around particles that are likely to be wanted, while others still look for the points.
  void foresee(const std::function<bool(const Vec3& position)>& likely);
  FoundPlaces of(const Points& present, const std::vector<KnownPlace>& known);

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

}  // namespace meshless
