// How tissue looks: two colours mixed by a pattern that fills space, or an image seen along the three axes. Both are
// functions of the place at rest, so they are the same on every mesh, need no texture coordinates, and go on across
// cuts. Where a file has texture coordinates, its image lies as they say.
#pragma once

#include "meshless_surgery/appearance/image.h"

namespace meshless {

/// kPlain: one colour. The others: thin branching lines, cells of a tint each, globules with walls between, strands
/// along x, a hard ground with pits. kImage: the look's image.
enum class Noise { kPlain, kVeins, kLobules, kFat, kFibres, kBone, kImage };
/// Those that a name is enough for.
constexpr std::array<Noise, 6> kNoises{Noise::kPlain, Noise::kVeins,  Noise::kLobules,
                                       Noise::kFat,   Noise::kFibres, Noise::kBone};

const char* toString(Noise noise);

struct Look {
  Noise noise = Noise::kPlain;
  Color second{0.5f, 0.15f, 0.12f, 1.0f};  // where the pattern is full; its opacity does not count
  ImagePtr image;                          // of kImage, and of no other
  double scale = 0.004;  // [m] 1e-5..1, of a cell of the pattern, or of the image's width along the axes
  double wetness = 0.5;  // 0..1: how bright and how sharp lamps are mirrored
  double bump = 0.0;     // 0..1: how uneven it is to light

  /// Why it is not usable, naming key, value and range; else Done.
  Status validate(const std::string& of) const;
};
bool operator==(const Look& one, const Look& other);
inline bool operator!=(const Look& one, const Look& other) { return !(one == other); }

struct Appearance {
  Look outer;  // over the material's color
  Look inner;  // of the faces of cuts, over its inside_color
};
bool operator==(const Appearance& one, const Appearance& other);
inline bool operator!=(const Appearance& one, const Appearance& other) { return !(one == other); }

/// It looks different at different places.
inline bool needsPlace(const Look& look) { return look.noise != Noise::kPlain || look.bump > 0.0; }

/// 0..1: how full the pattern is at a place [m] of the body's own frame; 0 of an image. It repeats after 289 cells. The
/// display's shader (media/tissue.frag) has the same functions.
double patternAt(const Look& look, const Vec3& place);

/// Between `base` and the look's second colour in each channel; or the image's, as seen along the axes, by how far the
/// surface is turned to each. `normal`: of the surface at rest in the body's own frame, outwards or inwards; of any
/// length, zero where there is none. The base's opacity.
Color colorAt(const Look& look, const Color& base, const Vec3& place, const Vec3& normal);
/// Of the look's image, so far to the right and up from its lower left corner; it is one wide and one high.
Color colorAt(const Look& look, const Color& base, const std::array<float, 2>& at);

}  // namespace meshless
