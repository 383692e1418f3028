#include "body_loader.h"

#include "border_check.h"

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

Result<Material> BodyLoader::material(const std::string& name) const {
  const auto found = materials_.find(name.empty() ? "default" : name);
  if (found != materials_.end()) return found->second;
  if (name.empty() || name == "default") return Material{};
  std::string known;
  for (const auto& [other, unused] : materials_) known += (known.empty() ? "" : ", ") + other;
  return Error{ErrorCode::kUnknownName,
               "material is '" + printable(name) + "'; accepted: " + (known.empty() ? "default" : known)};
}

std::function<Result<Material>(const Material& present)> BodyLoader::materialChange(
    const std::string& yaml, std::vector<std::string>& warnings) const {
  const auto images = std::make_shared<ImageFiles>(access_);
  // What is refused, it says where it is applied.
  (void)changeMaterial(Material(), yaml, *images, scene_folder_, warnings);
  return [yaml, images, folder = scene_folder_](const Material& present) {
    std::vector<std::string> said_before;
    return changeMaterial(present, yaml, *images, folder, said_before);
  };
}

Result<std::shared_ptr<const PreparedBody>> BodyLoader::load(const SpawnRequest& request, Progress* progress) const {
  const auto at = [&](Progress::Phase phase) {
    if (progress == nullptr) return;
    progress->enter(phase);
    progress->tell();
  };
  BodyDef def;
  def.pose = request.pose;
  def.thickness = request.thickness;

  auto chosen = material(request.material);
  if (!chosen.ok()) return chosen.error();
  def.material = std::move(*chosen);
  def.cavities = request.cavities;

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
    at(Progress::Phase::kReading);
    auto shape = loadShape(*path, request.scale, request.repair);
    if (!shape.ok()) return shape.error();
    def.mesh = std::move(shape->mesh);
    def.texture = std::move(shape->texture);
    def.solid = shape->solid;
    def.notes = std::move(shape->notes);
    def.warnings = std::move(shape->warnings);
    def.name = stem(*path);
  }
  if (!request.name.empty()) def.name = request.name;
  if (progress != nullptr && progress->cancelled()) {
    progress->end();
    return Error{ErrorCode::kFailed, "cancelled before it was prepared"};
  }
  at(Progress::Phase::kPreparing);
  auto body = prepareBody(std::move(def));
  if (!body.ok()) return body.error();
  return std::shared_ptr<const PreparedBody>(std::make_shared<PreparedBody>(std::move(*body)));
}

Result<std::shared_ptr<const PreparedBody>> BodyLoader::load(const CloudRequest& request, std::size_t& left) const {
  BodyDef def;
  def.name = request.name;
  auto chosen = material(request.material);
  if (!chosen.ok()) return chosen.error();
  def.material = std::move(*chosen);
  auto made = shapeOfCloud(request.points, request.filter);
  if (!made.ok()) return made.error();
  left = made->points;
  def.mesh = std::move(made->shape.mesh);
  def.notes = std::move(made->shape.notes);
  def.warnings = std::move(made->shape.warnings);
  Vec3 low = def.mesh.vertices[0], high = low;
  for (const Vec3& p : def.mesh.vertices) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  def.pose.translation = 0.5 * (low + high);
  for (Vec3& p : def.mesh.vertices) p -= def.pose.translation;
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
