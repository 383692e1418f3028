// Scenes that nobody wrote, from a seed alone.
#pragma once

#include "meshless_surgery/world/world.h"

namespace meshless {

/// What a random scene is narrowed to; the other choices of a seed stay as they are.
struct DriveChoices {
  std::map<std::string, Material> shipped;  // materials to choose from besides random ones
  std::string material;                     // "elastic", "looks", or a name in `shipped`; empty: any
  std::string support;                      // one of kSupports; empty: any
  std::optional<ContactMethod> contact;     // none: the world's default
  int most_organs = 3;                      // 1..3
  double most_triangles = 30000.0;          // 500..30000 of a body; shipped shapes have what they have
};

constexpr std::array<const char*, 5> kSupports{"ground", "tray", "bowl", "hung", "stack"};

struct DriveScene {
  std::uint64_t seed = 0;
  SceneDef def;
  std::string support;
  std::vector<std::string> organs;  // one a body: its shape, in words
};

/// One to three organs: random implicit surfaces of genus 0 to 3, the shipped shapes of other seeds, or primitives, 5
/// to 30 cm, 500 to 30,000 triangles (shipped slabs and blocks as many as they have); shipped or random materials;
/// beside each other on the ground or on a tray, in a bowl, hung by their upper ends, or on each other. The world has
/// its defaults. Random elastic materials can carry their own weight: E is at least density times g times the body's
/// longest edge, and so large that the weight changes the volume by 4 % at most. Refuses (kUnknownName) a material or a
/// support that is not there, (kInvalidArgument) other choices out of range.
Result<DriveScene> makeDriveScene(std::uint64_t seed, const DriveChoices& choices);

}  // namespace meshless
