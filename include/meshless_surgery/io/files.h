// Which files may be read, and meshes and clouds from them.
#pragma once

#include <array>
#include <functional>
#include <utility>

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/mesh/mend.h"
#include "meshless_surgery/geometry/mesh/texture_map.h"

namespace meshless {

/// Folders below which files are read, links resolved; everything else is refused with kForbidden.
struct FileAccess {
  std::vector<std::string> folders;
  std::string more;  // what else could be allowed, in messages
  /// Folder of a package:// name, or empty where there is none. Not set: package:// is refused.
  std::function<std::string(const std::string& package)> find_package;

  /// `path` with package:// written out; a relative one is taken from `base_folder`. Looks at no file.
  Result<std::string> located(const std::string& path, const std::string& base_folder) const;
  /// The real path of an existing regular file below one of the folders. A relative path is taken from `base_folder`.
  /// What reads a file opens it once and refuses it where it does not lie at that very path any more.
  Result<std::string> resolve(const std::string& path, const std::string& base_folder) const;
};

/// The texture coordinates of a file: one a corner of its faces. Empty where there are none, or where something is
/// wrong with them: `fault` says what.
struct FileTexture {
  std::vector<TexturePoint> corners;
  std::string fault;
};

/// By the file's ending: PCD, which PCL reads; OBJ, STL, OFF, PLY, VTK's PolyData (.vtk, .vtp); of VTK's unstructured
/// grids
/// (.vtk, .vtu) and Gmsh's .msh the outer surface of the volumes, or without any their triangles and quads. Polygons
/// are split into triangles. A file without faces is a cloud: mesh.triangles is empty. `real_path` has no links in it,
/// as FileAccess::resolve gives it. `notes` gets a sentence where the surface was taken of volumes; `texture` the
/// coordinates of OBJ and PLY, three a triangle. Refuses kUnreadable (missing, replaced meanwhile, truncated, unknown
/// ending, more than 512 MiB) and kUnsuitableShape (no points, more than 2,000,000 points, 8,000,000 faces or cells or
/// 32,000,000 corners of them; a face of more than two volumes). Non-finite points are left to repairMesh to name, for
/// surfaces; in clouds they are dropped; volumes with such corners are refused.
/// `space` gets what a comment says of the coordinates: "SPACE=LPS", as Slicer writes it.
Result<TriangleMesh> readMeshFile(const std::string& real_path, std::vector<std::string>* notes = nullptr,
                                  FileTexture* texture = nullptr, std::string* space = nullptr);

/// Of the lengths of a file or primitive, as scenes and ~spawn name them; the first is what no word means.
constexpr std::array<std::pair<const char*, double>, 3> kLengthUnits{{{"m", 1.0}, {"cm", 0.01}, {"mm", 0.001}}};

/// A mesh or cloud from a file made into what a body needs: scaled, a cloud turned into a closed surface, repaired as
/// far as `repair` goes. notes say what was done, warnings what is most often not meant.
struct LoadedShape {
  TriangleMesh mesh;
  TextureMapPtr texture;  // of the mesh as it was read, scaled; null: none, or a note says why it is not used
  bool solid = true;
  std::string space;  // of the coordinates in the file, kSpaces, as a comment in it says; empty: it says nothing
  std::vector<std::string> notes, warnings;
};
/// What a patient's coordinates may run to: x to the left, y to the back and z up (DICOM, ITK), or x to the right, y to
/// the front and z up (Slicer, NIfTI).
constexpr std::array<const char*, 2> kSpaces{{"LPS", "RAS"}};
/// `space`: to which a file of the other one is turned, half a turn about z; empty: it stays as it is. y_up: the file's y
/// is up, and is made z by a quarter of a turn about x.
Result<LoadedShape> loadShape(const std::string& real_path, double scale, MeshRepair repair = MeshRepair::kMend,
                              const std::string& space = "", bool y_up = false);

/// OBJ with 17 significant digits; written beside the file and renamed. false where the disk refuses.
Status writeObj(const std::string& path, const TriangleMesh& mesh, const std::string& comment);

}  // namespace meshless
