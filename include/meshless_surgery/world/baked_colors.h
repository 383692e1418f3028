// The patterns of tissue as colours of vertices, and where its image lies: computed where a surface or its look is new,
// not in each frame.
#pragma once

#include <map>
#include <vector>

#include "meshless_surgery/world/world.h"

namespace meshless {

/// One a vertex, on the outer surface and on faces of cuts (of other vertices: nothing). Empty where there is one
/// colour: the material's.
struct VertexColors {
  std::vector<Color> outer, inside;
  /// One a corner of each triangle, on faces of cuts (0, 0); empty where the outer surface has no image, or its file
  /// no texture coordinates.
  std::vector<TexturePoint> texture;
};
VertexColors bakeColors(const BodyModel& model, const Material& material);

/// What the colours of a body come from.
struct BakedBody {
  std::uint32_t number;
  BodyModelPtr model;  // held, so that its address is not another one's
  Color color, inside_color;
  Appearance appearance;

  explicit BakedBody(const BodySnapshot& body);
  bool isOf(const BodySnapshot& body) const;
};

class BakedColors {
 public:
  /// Bakes what is new, and forgets what is gone.
  void update(const WorldSnapshot& snapshot);
  /// Of a body of the last update.
  const VertexColors& of(const BodySnapshot& body) const { return bodies_.at(body.number).second; }

 private:
  std::map<std::uint32_t, std::pair<BakedBody, VertexColors>> bodies_;  // by the body's number
};

}  // namespace meshless
