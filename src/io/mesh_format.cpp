#include "mesh_format.h"

#include <filesystem>
#include <sstream>

#include "text_words.h"

namespace meshless {

Status checkCounts(const std::string& name, double points, double faces, double corners) {
  if (!(points >= 1.0)) return Error{ErrorCode::kUnsuitableShape, "'" + name + "' has no points"};
  const auto tooMany = [&](double n, const char* of, std::size_t most) {
    std::ostringstream text;
    text.precision(15);
    text << "'" << name << "' has " << n << " " << of << "; accepted: up to " << most;
    return Error{ErrorCode::kUnsuitableShape, text.str()};
  };
  if (!(points <= static_cast<double>(kMaxPoints))) return tooMany(points, "points", kMaxPoints);
  if (!(faces <= static_cast<double>(kMaxFaces))) return tooMany(faces, "faces", kMaxFaces);
  if (!(corners <= static_cast<double>(kMaxCorners))) return tooMany(corners, "corners of faces", kMaxCorners);
  return Done{};
}

Result<MeshFormat> meshFormatOf(const std::string& name) {
  const std::string ending = lowerCase(std::filesystem::path(name).extension().string());
  if (ending == ".pcd") return MeshFormat::kPcd;
  if (ending == ".ply") return MeshFormat::kPly;
  if (ending == ".obj") return MeshFormat::kObj;
  if (ending == ".stl") return MeshFormat::kStl;
  if (ending == ".vtk") return MeshFormat::kVtk;
  if (ending == ".off") return MeshFormat::kOff;
  if (ending == ".vtu" || ending == ".vtp") return MeshFormat::kVtkXml;
  if (ending == ".msh") return MeshFormat::kMsh;
  return unreadable(name,
                    "is of an unknown kind; accepted endings: .pcd, .ply, .obj, .stl, .vtk, .off, .vtu, .vtp, .msh");
}

}  // namespace meshless
