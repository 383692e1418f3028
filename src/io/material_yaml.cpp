#include "material_yaml.h"

#include <algorithm>
#include <filesystem>

#include "meshless_surgery/io/scene.h"

namespace meshless {
namespace {

void readColor(YamlMap& map, const std::string& key, Color& color) {
  const YAML::Node node = map.get(key);
  if (!node.IsDefined()) return;
  if (!node.IsSequence() || (node.size() != 3 && node.size() != 4)) {
    map.source().fail(node, key + " is " + shown(node), "[red, green, blue] or with opacity, each 0 to 1");
    return;
  }
  double channels[4] = {0.0, 0.0, 0.0, 1.0};
  for (std::size_t k = 0; k < node.size(); ++k)
    readNumber(map.source(), node[k], key + "[" + std::to_string(k) + "]", {0.0, 1.0}, channels[k]);
  color = {static_cast<float>(channels[0]), static_cast<float>(channels[1]), static_cast<float>(channels[2]),
           static_cast<float>(channels[3])};
}

// A share for every error, or a table of [relative error, share].
void readCurve(YamlMap& map, const std::string& key, ResponseCurve& curve) {
  const YAML::Node node = map.get(key);
  if (!node.IsDefined()) return;
  const std::string accepted = "a share 0 to 1, a list of up to 100 pairs [relative error, share], or none";
  curve.points.clear();
  if (node.IsNull() || (node.IsScalar() && node.Scalar() == "none")) return;
  if (node.IsScalar()) {
    double share = 0.0;
    if (readNumber(map.source(), node, key, {0.0, 1.0}, share)) curve.points.push_back({0.0, share});
    return;
  }
  if (!node.IsSequence() || node.size() > 100) {
    map.source().fail(node, key + " is " + shown(node), accepted);
    return;
  }
  for (std::size_t k = 0; k < node.size(); ++k) {
    if (!node[k].IsSequence() || node[k].size() != 2) {
      map.source().fail(node[k], key + "[" + std::to_string(k) + "] is " + shown(node[k]), "[relative error, share]");
      return;
    }
    std::array<double, 2> point{};
    for (std::size_t c = 0; c < 2; ++c)
      readNumber(map.source(), node[k][c], key + "[" + std::to_string(k) + "][" + std::to_string(c) + "]", {0.0, 100.0},
                 point[c]);
    curve.points.push_back(point);
  }
}

void readPlasticity(YamlMap& map, Plasticity& plasticity) {
  const YAML::Node node = map.get("plasticity");
  if (!node.IsDefined()) return;
  if (node.IsNull() || (node.IsScalar() && node.Scalar() == "none")) {
    plasticity = Plasticity();
    return;
  }
  if (!node.IsMap()) {
    map.source().fail(node, "plasticity is " + shown(node), "{yield: , creep: , maximum: } or none");
    return;
  }
  YamlMap inner(map.source(), node, "plasticity");
  inner.number("yield", {0.0, 10.0}, plasticity.yield);
  inner.number("creep", {0.0, 1e6, false, "1/s"}, plasticity.creep);
  inner.number("maximum", {0.0, 3.0}, plasticity.maximum);
  inner.finish();
}

void readRelaxation(YamlMap& map, std::vector<Relaxation>& relaxation) {
  const YAML::Node node = map.get("relaxation");
  if (!node.IsDefined()) return;
  relaxation.clear();
  if (node.IsNull() || (node.IsScalar() && node.Scalar() == "none")) return;
  if (!node.IsSequence() || node.size() > kMostRelaxations) {
    map.source().fail(node, "relaxation is " + shown(node), "a list of up to 3 of {share: , time: }, or none");
    return;
  }
  for (const YAML::Node& entry : node) {
    Relaxation branch;
    YamlMap inner(map.source(), entry, "relaxation");
    inner.number("share", {0.0, 0.99, true}, branch.share);
    inner.number("time", {1e-4, 1e6, false, "s"}, branch.time);
    inner.finish();
    if (!inner.has("share")) map.source().fail(entry, "an entry of relaxation has no share", "{share: , time: }");
    if (!inner.has("time")) map.source().fail(entry, "an entry of relaxation has no time", "{share: , time: }");
    if (map.source().fault) return;
    relaxation.push_back(branch);
  }
}

void readFibres(YamlMap& map, Fibres& fibres) {
  const YAML::Node node = map.get("fibres");
  if (!node.IsDefined()) return;
  if (node.IsNull() || (node.IsScalar() && node.Scalar() == "none")) {
    fibres = Fibres();
    return;
  }
  if (!node.IsMap()) {
    map.source().fail(node, "fibres is " + shown(node), "{stiffness: Pa, stiffening: } or none");
    return;
  }
  YamlMap inner(map.source(), node, "fibres");
  inner.number("stiffness", {0.0, 1e12, false, "Pa"}, fibres.stiffness);
  inner.number("stiffening", {0.0, 1000.0}, fibres.stiffening);
  inner.finish();
}

void readNoise(YamlMap& map, Look& look) {
  std::string wanted;
  map.text("noise", wanted);
  if (!map.has("noise") || map.source().fault) return;
  look.noise = Noise::kPlain;
  look.image.reset();
  std::vector<std::string> names;
  std::string accepted;
  for (const Noise noise : kNoises) {
    names.push_back(toString(noise));
    accepted += (accepted.empty() ? "" : ", ") + names.back();
    if (names.back() == wanted) look.noise = noise;
  }
  if (look.noise == Noise::kPlain && wanted != names.front())
    map.source().warn(map.get("noise"), "unknown noise " + shown(map.get("noise")) + " of " + map.what() +
                                            ", did you mean '" + nearestWord(wanted, names) +
                                            "'? The plain colour is used; accepted: " + accepted);
}

void readImage(YamlMap& map, const ImageFolder& images, Look& look) {
  std::string path;
  map.text("image", path);
  if (!map.has("image") || map.source().fault) return;
  const YAML::Node node = map.get("image");
  if (map.has("noise")) return map.source().fail(node, map.what() + " has an image and a noise", "one of them");
  const Result<ImagePtr> image = images.files.read(path, images.folder);
  look.noise = image ? Noise::kImage : Noise::kPlain;
  look.image = image ? *image : nullptr;
  if (!image)
    map.source().warn(node, "image of " + map.what() + ": " + image.error().detail + ". The plain colour is used");
}

// What cannot be had of a look ends no training: the plain colour is used.
void readLook(YamlMap& map, const ImageFolder& images, Look& look) {
  readNoise(map, look);
  readImage(map, images, look);
  readColor(map, "second", look.second);
  map.number("scale", {1e-5, 1.0, false, "m"}, look.scale);
  map.number("wetness", {0.0, 1.0}, look.wetness);
  map.number("bump", {0.0, 1.0}, look.bump);
  map.finish();
}

void readAppearance(YamlMap& map, const ImageFolder& images, Appearance& appearance) {
  const YAML::Node node = map.get("appearance");
  if (!node.IsDefined()) return;
  if (node.IsNull() || (node.IsScalar() && node.Scalar() == "none")) {
    appearance = Appearance();
    return;
  }
  if (!node.IsMap()) {
    map.source().fail(node, "appearance is " + shown(node), "{outer: {}, inner: {}} or none");
    return;
  }
  YamlMap sides(map.source(), node, "appearance");
  if (const YAML::Node of = sides.get("outer"); of.IsDefined()) {
    YamlMap outer(map.source(), of, "outer");
    readLook(outer, images, appearance.outer);
  }
  if (const YAML::Node of = sides.get("inner"); of.IsDefined()) {
    YamlMap inner(map.source(), of, "inner");
    readLook(inner, images, appearance.inner);
  }
  sides.finish();
}

}  // namespace

const char* const kPlainName = "1 to 64 letters, digits, '_', '-' or '.'";

bool isPlainName(const std::string& name) {
  return !name.empty() && name.size() <= 64 && std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == '.';
  });
}

void readMaterial(YamlSource& source, const YAML::Node& node, const std::string& what, const ImageFolder& images,
                  Material& material) {
  YamlMap map(source, node, what);
  const int mode = map.choice("mode", {"rigid", "linear", "quadratic"});
  if (mode == 0) material.mode = MatchMode::kRigid;
  if (mode == 1) material.mode = MatchMode::kLinear;
  if (mode == 2) material.mode = MatchMode::kQuadratic;
  if (map.has("young") && map.has("youngs_modulus"))
    source.fail(map.get("young"), what + " has young and youngs_modulus, which are the same", "one of them");
  const std::string youngs = map.has("young") ? "young" : "youngs_modulus";
  const double before = material.youngs_modulus;
  material.youngs_modulus = 0.0;
  map.number(youngs, {0.0, 1e12, false, "Pa"}, material.youngs_modulus);
  if (map.has("alpha") && material.youngs_modulus > 0.0)
    source.fail(map.get("alpha"), what + " has alpha beside " + youngs + ", which takes its place",
                "alpha, of an appearance material, or youngs_modulus, of an elastic one");
  if (!map.has(youngs)) material.youngs_modulus = before;
  map.number("poissons_ratio", {0.0, 0.49}, material.poissons_ratio);
  map.number("stiffening", {0.0, 1000.0}, material.stiffening);
  map.number("asymmetry", {-30.0, 30.0}, material.asymmetry);
  map.number("alpha", {0.0, 1.0}, material.alpha);
  map.number("beta", {0.0, 1.0}, material.beta);
  map.number("density", {0.0, 1e6, true, "kg/m^3"}, material.density);
  map.number("damping", {0.0, 1e6, false, "1/s"}, material.damping);
  map.number("friction", {0.0, 10.0}, material.friction);
  map.number("restitution", {0.0, 1.0}, material.restitution);
  map.number("toughness", {0.0, 1e6, false, "J/m^2"}, material.toughness);
  const int self_contact = map.choice("self_contact", {"none", "lips", "all"});
  if (self_contact >= 0) material.self_contact = static_cast<SelfContact>(self_contact);
  readCurve(map, "volume", material.volume);
  readCurve(map, "area", material.area);
  readPlasticity(map, material.plasticity);
  readRelaxation(map, material.relaxation);
  readFibres(map, material.fibres);
  readColor(map, "color", material.color);
  readColor(map, "inside_color", material.inside_color);
  readAppearance(map, images, material.appearance);
  map.finish();
  if (source.fault) return;
  // The ranges above are the material's own; this keeps them so.
  if (const Status status = material.validate(); !status) source.fail(node, what + ": " + status.error().detail, "");
}

void readMaterialMap(YamlSource& source, const YAML::Node& node, const ImageFolder& images,
                     std::map<std::string, Material>& materials) {
  YamlMap map(source, node, "materials");
  if (!node.IsMap()) return;
  for (const auto& entry : node) {
    if (!entry.first.IsScalar()) continue;  // the map has said so
    const std::string& name = entry.first.Scalar();
    if (!isPlainName(name)) source.fail(entry.first, "the material's name is " + shown(entry.first), kPlainName);
    Material material;
    material.name = name;
    readMaterial(source, entry.second, "material '" + name + "'", images, material);
    if (source.fault) return;
    materials[name] = material;
  }
}

Status MaterialFiles::readFolder(const std::string& folder) {
  namespace fs = std::filesystem;
  std::vector<fs::path> files;
  std::error_code failed;
  for (fs::directory_iterator at(folder, failed), end; !failed && at != end; at.increment(failed))
    if (at->path().extension() == ".yaml" && at->is_regular_file(failed)) files.push_back(at->path());
  if (failed)
    return Error{ErrorCode::kUnreadable, "cannot read the materials in '" + folder + "': " + failed.message()};
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files) {
    const fs::path real = fs::canonical(file, failed);
    const Status done =
        failed ? Error{ErrorCode::kUnreadable, file.string() + ": is missing"} : read(real.string(), file.string());
    if (!done) return done;
  }
  return Done{};
}

Result<std::map<std::string, Material>> readMaterials(const std::string& folder) {
  MaterialFiles files{ImageFiles(FileAccess())};
  if (const Status read = files.readFolder(folder); !read) return read.error();
  return std::move(files.materials);
}

Status MaterialFiles::read(const std::string& real_path, const std::string& name) {
  const Result<YAML::Node> root = readYamlFile(real_path, name);
  if (!root) return root.error();
  if (root->IsNull()) return Done{};  // only comments
  YamlSource source{name, {}};
  try {
    readMaterialMap(source, *root, {images, std::filesystem::path(real_path).parent_path().string()}, materials);
  } catch (const YAML::Exception& e) {
    source.fail(*root, e.what(), "YAML");
  }
  if (source.fault) return *source.fault;
  warnings.insert(warnings.end(), source.warnings.begin(), source.warnings.end());
  return Done{};
}

Result<Material> changeMaterial(const Material& base, const std::string& yaml, ImageFiles& images,
                                const std::string& folder, std::vector<std::string>& warnings) {
  const Result<YAML::Node> root = parseYaml(yaml, "material");
  if (!root) return root.error();
  YamlSource source{"material", {}};
  if (root->IsNull() || (root->IsMap() && root->size() == 0)) {
    source.fail(*root, "the material has no key, which would change nothing",
                "a key and its value, such as {density: 900}");
    return *source.fault;
  }
  Material changed = base;
  try {
    readMaterial(source, *root, "the material", {images, folder}, changed);
  } catch (const YAML::Exception& e) {
    source.fail(*root, e.what(), "YAML");
  }
  if (source.fault) return *source.fault;
  warnings.insert(warnings.end(), source.warnings.begin(), source.warnings.end());
  const bool elastic = changed.elastic();
  const std::vector<std::string> of_looks = {"alpha", "beta", "mode"},
                                 of_elastic = {"poissons_ratio", "stiffening", "asymmetry", "relaxation",
                                               "fibres"};
  for (const std::string& key : elastic ? of_looks : of_elastic)
    if (const YAML::Node node = (*root)[key]; node.IsDefined())
      source.fail(node,
                  key + " is " + shown(node) + ", which " + (elastic ? "an elastic" : "an appearance") +
                      " material like '" + changed.name + "' does not use",
                  elastic ? "youngs_modulus, poissons_ratio, stiffening, asymmetry, relaxation, fibres and what both kinds have"
                          : "alpha, beta, mode and what both kinds have");
  if (source.fault) return *source.fault;
  return changed;
}

}  // namespace meshless
