#include "meshless_surgery/ros/body_loader.h"

#include "meshless_surgery/ros/border_check.h"

namespace meshless {
namespace {

std::string stem(const std::string& path) {
  const std::size_t slash = path.find_last_of('/');
  const std::string file = slash == std::string::npos ? path : path.substr(slash + 1);
  std::string name = file.substr(0, file.find_last_of('.'));
  // A file may be called anything, a body may not.
  for (char& c : name) {
    const bool plain =
        (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' || c == '.';
    if (!plain) c = '_';
  }
  return name.substr(0, 90);
}

}  // namespace

BodyLoader::BodyLoader(FileAccess access, std::string scene_folder, std::map<std::string, Material> materials)
    : access_(std::move(access)), scene_folder_(std::move(scene_folder)), materials_(std::move(materials)) {}

Result<std::shared_ptr<const PreparedBody>> BodyLoader::load(const SpawnRequest& request) const {
  BodyDef def;
  def.pose = request.pose;

  const std::string material = request.material.empty() ? "default" : request.material;
  const auto found = materials_.find(material);
  if (found != materials_.end()) {
    def.material = found->second;
  } else if (!request.material.empty() && request.material != "default") {
    std::string known;
    for (const auto& [name, unused] : materials_) known += (known.empty() ? "" : ", ") + name;
    return Error{ErrorCode::kUnknownName,
                 "material is '" + printable(request.material) + "'; accepted: " + (known.empty() ? "default" : known)};
  }

  if (request.file.empty()) {
    std::vector<double> sizes = request.sizes;
    for (double& size : sizes) size *= request.scale;
    auto mesh = primitiveMesh(request.primitive, sizes);
    if (!mesh.ok()) return Error{mesh.error().code, "primitive.dimensions: " + mesh.error().detail};
    def.mesh = std::move(*mesh);
    def.name = request.primitive;
  } else {
    const auto path = access_.resolve(request.file, scene_folder_);
    if (!path.ok()) return path.error();
    auto shape = loadShape(*path, request.scale, request.repair);
    if (!shape.ok()) return shape.error();
    def.mesh = std::move(shape->mesh);
    def.solid = shape->solid;
    def.notes = std::move(shape->notes);
    def.name = stem(*path);
  }
  if (!request.name.empty()) def.name = request.name;
  auto body = prepareBody(std::move(def));
  if (!body.ok()) return body.error();
  return std::shared_ptr<const PreparedBody>(std::make_shared<PreparedBody>(std::move(*body)));
}

std::shared_ptr<const PreparedBody> renamed(const PreparedBody& body, const std::string& name) {
  auto copy = std::make_shared<PreparedBody>(body);
  copy->def.name = name;
  return copy;
}

}  // namespace meshless
