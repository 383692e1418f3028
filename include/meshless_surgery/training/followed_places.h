// Where places of the tissue at rest are now, however it has moved and whatever was cut.
#pragma once

#include "meshless_surgery/body/body.h"
#include "meshless_surgery/world/world.h"

namespace meshless {

class FollowedPlaces {
 public:
  FollowedPlaces() = default;
  /// `rest`: [m] in or on the body, in its rest shape where the scene puts it. `side`: a unit vector; where a cut goes
  /// through a place, it follows the tissue on that side. Zero: on either.
  FollowedPlaces(std::string body, Points rest, const Vec3& side)
      : body_(std::move(body)), rest_(std::move(rest)), side_(side) {}

  /// [m] of each; NaN where its tissue is gone. The snapshot has particles.
  Points now(const WorldSnapshot& shot);

 private:
  struct Piece {
    std::uint32_t number = 0;
    BodyModelPtr model;
    SurfaceBinding binding;    // of the places that it has
    std::vector<Index> which;  // of all places
  };
  void bind(const std::vector<const BodySnapshot*>& bodies);

  std::string body_;
  Points rest_;
  Vec3 side_ = Vec3::Zero();
  std::vector<Piece> pieces_;
};

}  // namespace meshless
