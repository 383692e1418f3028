// Materials in YAML.
#pragma once

#include <map>

#include "meshless_surgery/body/body_def.h"
#include "meshless_surgery/io/image_file.h"
#include "yaml_map.h"

namespace meshless {

/// Where a text of materials finds images: paths are taken from its folder.
struct ImageFolder {
  ImageFiles& files;
  std::string folder;
};

/// Changes `material` by the keys of a map; faults and warnings go to the source.
void readMaterial(YamlSource& source, const YAML::Node& node, const std::string& what, const ImageFolder& images,
                  Material& material);

/// A map of names to materials, into `materials`; each starts from the defaults.
void readMaterialMap(YamlSource& source, const YAML::Node& node, const ImageFolder& images,
                     std::map<std::string, Material>& materials);

/// What is read from several files of materials.
struct MaterialFiles {
  ImageFiles images;
  std::map<std::string, Material> materials{};
  std::vector<std::string> warnings{};

  /// A file with such a map: nothing but comments adds nothing. `name` is for messages.
  Status read(const std::string& real_path, const std::string& name);
  /// Every *.yaml of a folder, by name.
  Status readFolder(const std::string& folder);
};

/// Letters, digits, '_', '-' and '.', 1 to 64 of them: the names of bodies and materials.
bool isPlainName(const std::string& name);
extern const char* const kPlainName;  // that, in words

}  // namespace meshless
