// Parts of space in YAML files.
#pragma once

#include "meshless_surgery/geometry/query/region.h"
#include "yaml_map.h"

namespace meshless {

constexpr double kMaxLength = 1000.0;  // [m] of anything in a scene

inline NumberRange lengths(double from = -kMaxLength, bool open = false) { return {from, kMaxLength, open, "m"}; }

Box readBox(YamlSource& source, const YAML::Node& node);
Plane readPlane(YamlSource& source, const YAML::Node& node);
Region readSphere(YamlSource& source, const YAML::Node& node);

}  // namespace meshless
