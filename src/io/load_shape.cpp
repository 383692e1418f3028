#include <cmath>
#include <filesystem>
#include <sstream>

#include "meshless_surgery/geometry/mesh/surface_from_points.h"
#include "meshless_surgery/io/cloud_shape.h"

namespace meshless {

Result<LoadedShape> loadShape(const std::string& real_path, double scale, MeshRepair repair, const std::string& space,
                              bool y_up) {
  if (!(scale > 0.0) || !std::isfinite(scale)) {
    std::ostringstream text;
    text << "scale is " << scale << "; accepted: above 0, finite";
    return Error{ErrorCode::kInvalidArgument, text.str()};
  }
  LoadedShape shape;
  FileTexture texture;
  Result<TriangleMesh> read = readMeshFile(real_path, &shape.notes, &texture, &shape.space);
  if (!read) return read.error();
  const std::string name = std::filesystem::path(real_path).filename().string();
  TriangleMesh mesh = std::move(*read);
  for (Vec3& p : mesh.vertices) p *= scale;
  const bool turned = !space.empty() && !shape.space.empty() && space != shape.space;
  if (turned)
    for (Vec3& p : mesh.vertices) p = Vec3(-p.x(), -p.y(), p.z());
  if (y_up)
    for (Vec3& p : mesh.vertices) p = Vec3(p.x(), -p.z(), p.y());
  if (!shape.space.empty())
    shape.notes.push_back(name + ": its coordinates are in " + shape.space + (turned ? ", turned to " + space : ""));
  if (!texture.corners.empty()) {
    Result<TextureMapPtr> map = TextureMap::make(mesh, std::move(texture.corners));
    if (map)
      shape.texture = std::move(*map);
    else
      texture.fault = map.error().detail;
  }
  if (!texture.fault.empty()) shape.notes.push_back(name + ": its texture coordinates are not used: " + texture.fault);
  if (mesh.triangles.empty()) {
    std::vector<std::string> strays;
    mesh.vertices = withoutStrays(mesh.vertices, strays);
    Result<SurfaceFromPoints> surface = surfaceFromPoints(mesh.vertices);
    if (!surface) return Error{surface.error().code, "'" + name + "': " + surface.error().detail};
    shape.notes.push_back(name + " is a cloud of " + std::to_string(mesh.vertices.size()) + " points; " +
                          surfaceInWords(*surface));
    for (const std::string& stray : strays) shape.notes.push_back(name + ": " + stray);
    mesh = std::move(surface->mesh);
  }
  Result<RepairedMesh> repaired = repairMesh(mesh, repair);
  if (!repaired) return Error{repaired.error().code, "'" + name + "': " + repaired.error().detail};
  shape.mesh = std::move(repaired->mesh);
  shape.solid = repaired->solid;
  for (const std::string& note : repaired->notes) shape.notes.push_back(name + ": " + note);
  for (const std::string& warning : repaired->warnings) shape.warnings.push_back(name + ": " + warning);
  return shape;
}

}  // namespace meshless
