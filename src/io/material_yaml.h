// Materials in YAML.
#pragma once

#include <map>

#include "meshless_surgery/body/body_def.h"
#include "yaml_map.h"

namespace meshless {

/// Changes `material` by the keys of a map; faults go to the source.
void readMaterial(YamlSource& source, const YAML::Node& node, const std::string& what, Material& material);

/// A map of names to materials, into `materials`; each starts from the defaults.
void readMaterialMap(YamlSource& source, const YAML::Node& node, std::map<std::string, Material>& materials);

/// The same from a file: nothing but comments adds nothing. `name` is for messages.
Status readMaterialFile(const std::string& real_path, const std::string& name,
                        std::map<std::string, Material>& materials);

/// Letters, digits, '_', '-' and '.', 1 to 64 of them: the names of bodies and materials.
bool isPlainName(const std::string& name);
extern const char* const kPlainName;  // that, in words

}  // namespace meshless
