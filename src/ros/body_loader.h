// Bodies for ~spawn: from a file or a primitive to what the world admits. Thread-safe; takes up to seconds.
#pragma once

#include <functional>
#include <map>
#include <memory>

#include "meshless_surgery/io/cloud_shape.h"
#include "meshless_surgery/io/scene.h"
#include "progress.h"

namespace meshless {

struct SpawnRequest {
  std::string name;           // empty: the file's or primitive's name, with _2, _3 ... where it is taken
  std::string file;           // empty: the primitive
  std::string primitive;      // box, sphere, cylinder; see primitiveMesh
  std::vector<double> sizes;  // [m] box: x y z; sphere: radius; cylinder: height radius; before scaling
  double scale = 1.0;         // > 0
  Pose pose;
  std::string material;                   // empty: "default"
  MeshRepair repair = MeshRepair::kMend;  // of a file's surface
  double thickness = 0.0;                 // [m] of BodyDef
  CavityFill cavities;
};

struct CloudRequest {
  std::string name = "cloud";
  Points points;  // [m] world frame
  CloudFilter filter;
  std::string material;  // empty: "default"
};

class BodyLoader {
 public:
  /// Relative files are taken from `scene_folder`. Materials by name.
  BodyLoader(FileAccess access, std::string scene_folder, std::map<std::string, Material> materials);

  /// Refuses what io and body refuse, and kUnknownName for a material. Where `progress` is cancelled it ends after what
  /// it is at, with kFailed.
  Result<std::shared_ptr<const PreparedBody>> load(const SpawnRequest& request, Progress* progress = nullptr) const;

  /// Its frame is the world's, at the middle of the cloud's surface. `left`: the points that were not filtered away.
  Result<std::shared_ptr<const PreparedBody>> load(const CloudRequest& request, std::size_t& left) const;

  /// What changes a material by a YAML map. The images that the map names are read now, not where it is applied;
  /// `warnings` gets what could be done without.
  std::function<Result<Material>(const Material& present)> materialChange(const std::string& yaml,
                                                                          std::vector<std::string>& warnings) const;

 private:
  Result<Material> material(const std::string& name) const;

  FileAccess access_;
  std::string scene_folder_;
  std::map<std::string, Material> materials_;
};

/// The same body under another name; nothing is built again.
std::shared_ptr<const PreparedBody> renamed(const PreparedBody& body, const std::string& name);

}  // namespace meshless
