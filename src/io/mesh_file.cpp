// PCL's readers. It is the only file that includes them.
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <string_view>
#include <utility>
#include <variant>

#include <pcl/PCLPointCloud2.h>
#include <pcl/PolygonMesh.h>
#include <pcl/console/print.h>
#include <pcl/io/obj_io.h>
#include <pcl/io/pcd_io.h>
#include <pcl/io/vtk_lib_io.h>

#include "cells_of_file.h"
#include "mesh_check_before.h"
#include "meshless_surgery/io/files.h"
#include "opened_file.h"

namespace meshless {
namespace {

/// PCL's complaints would stand in front of ours.
class QuietPcl {
 public:
  QuietPcl() : level_(pcl::console::getVerbosityLevel()), vtk_(vtkObject::GetGlobalWarningDisplay()) {
    pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
    vtkObject::GlobalWarningDisplayOff();
  }
  ~QuietPcl() {
    pcl::console::setVerbosityLevel(level_);
    vtkObject::SetGlobalWarningDisplay(vtk_);
  }
  QuietPcl(const QuietPcl&) = delete;
  QuietPcl& operator=(const QuietPcl&) = delete;

 private:
  pcl::console::VERBOSITY_LEVEL level_;
  int vtk_;
};

/// A text that only this process can open as a file, for readers that want a name.
class MemoryFile {
 public:
  explicit MemoryFile(std::string_view text) : descriptor_(memfd_create("mesh", MFD_CLOEXEC)) {
    std::size_t written = 0;
    while (descriptor_ >= 0 && written < text.size()) {
      const ssize_t n = write(descriptor_, text.data() + written, text.size() - written);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) break;
      written += static_cast<std::size_t>(n);
    }
    whole_ = descriptor_ >= 0 && written == text.size();
  }
  ~MemoryFile() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  MemoryFile(MemoryFile&& other) noexcept
      : descriptor_(std::exchange(other.descriptor_, -1)), whole_(std::exchange(other.whole_, false)) {}
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  bool ok() const { return whole_; }
  std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
  bool whole_ = false;
};

/// x, y, z as float or double; false where the cloud has no such fields.
bool copyPoints(const pcl::PCLPointCloud2& cloud, Points& points) {
  std::array<const pcl::PCLPointField*, 3> fields{};
  for (const pcl::PCLPointField& field : cloud.fields)
    for (int d = 0; d < 3; ++d)
      if (field.name == std::string(1, "xyz"[d])) fields[d] = &field;
  const std::size_t size = std::size_t{cloud.width} * cloud.height;
  for (const pcl::PCLPointField* field : fields) {
    if (!field) return false;
    const bool single = field->datatype == pcl::PCLPointField::FLOAT32;
    if (!single && field->datatype != pcl::PCLPointField::FLOAT64) return false;
    if (field->offset + (single ? 4u : 8u) > cloud.point_step) return false;
  }
  if (size * cloud.point_step > cloud.data.size()) return false;
  points.resize(size);
  for (std::size_t k = 0; k < size; ++k)
    for (int d = 0; d < 3; ++d) {
      const std::uint8_t* at = cloud.data.data() + k * cloud.point_step + fields[d]->offset;
      if (fields[d]->datatype == pcl::PCLPointField::FLOAT32) {
        float x;
        std::memcpy(&x, at, sizeof x);
        points[k][d] = x;
      } else {
        std::memcpy(&points[k][d], at, sizeof(double));
      }
    }
  return true;
}

/// Through PCL; false where it failed.
bool readWithPcl(const std::string& path, MeshFormat format, pcl::PolygonMesh& mesh) {
  const QuietPcl quiet;
  switch (format) {
    case MeshFormat::kPcd:
      return pcl::io::loadPCDFile(path, mesh.cloud) == 0;
    case MeshFormat::kObj:
    case MeshFormat::kOff:  // rewritten as OBJ
      return pcl::io::loadOBJFile(path, mesh) == 0;
    // These two return the number of polygons, 0 for a cloud and for a failure.
    case MeshFormat::kStl:
      return pcl::io::loadPolygonFileSTL(path, mesh) > 0;
    case MeshFormat::kVtk:
      return pcl::io::loadPolygonFileVTK(path, mesh) >= 0;
    case MeshFormat::kPly:  // not PCL's
    case MeshFormat::kVtu:
    case MeshFormat::kMsh:
      break;
  }
  return false;
}

/// Without the points of a cloud that are not finite.
Result<TriangleMesh> checked(const std::string& name, TriangleMesh&& mesh) {
  if (mesh.triangles.empty())
    mesh.vertices.erase(
        std::remove_if(mesh.vertices.begin(), mesh.vertices.end(), [](const Vec3& p) { return !p.allFinite(); }),
        mesh.vertices.end());
  if (mesh.vertices.empty())
    return Error{ErrorCode::kUnsuitableShape, "'" + name + "' has no points (or none that is finite)"};
  if (Status status = checkCounts(name, static_cast<double>(mesh.vertices.size()), 0.0, 0.0); !status)
    return status.error();
  return std::move(mesh);
}

/// `texture`: of the corners of the polygons, then of the triangles.
Result<TriangleMesh> convert(const pcl::PolygonMesh& read, const PromisedCounts& promised, const std::string& name,
                             FileTexture& texture) {
  TriangleMesh mesh;
  if (!copyPoints(read.cloud, mesh.vertices))
    return Error{ErrorCode::kUnreadable, "'" + name + "' has no points with x, y and z as float or double"};
  if (promised.points && *promised.points != mesh.vertices.size())
    return Error{ErrorCode::kUnreadable, "'" + name + "' is truncated: it holds " +
                                             std::to_string(mesh.vertices.size()) + " of " +
                                             std::to_string(*promised.points) + " points"};
  if (promised.faces && *promised.faces > read.polygons.size())
    return Error{ErrorCode::kUnreadable, "'" + name + "' is truncated: it holds " +
                                             std::to_string(read.polygons.size()) + " of " +
                                             std::to_string(*promised.faces) + " faces"};
  const std::vector<TexturePoint> points = std::move(texture.corners);
  texture.corners.clear();
  std::vector<Index> corners;
  std::size_t before = 0;
  for (const pcl::Vertices& polygon : read.polygons) {
    corners.clear();
    for (const auto corner : polygon.vertices) corners.push_back(static_cast<Index>(corner));
    const std::size_t first = std::exchange(before, before + corners.size());
    addPolygon(corners, before <= points.size() ? &points[first] : nullptr, mesh, texture);
  }
  return checked(name, std::move(mesh));
}

Result<TriangleMesh> surfaceOfCells(const std::string& name, CellsOfFile&& cells, std::vector<std::string>* notes,
                                    FileTexture& texture) {
  std::vector<std::string> said;
  Result<TriangleMesh> mesh = surfaceOf(name, std::move(cells), said, texture);
  if (!mesh) return mesh.error();
  if (notes) notes->insert(notes->end(), said.begin(), said.end());
  return checked(name, std::move(*mesh));
}

/// Whether it is of cells, which PCL does not read.
bool hasCells(std::string_view text, MeshFormat format) {
  return format == MeshFormat::kPly || format == MeshFormat::kVtu || format == MeshFormat::kMsh ||
         (format == MeshFormat::kVtk && isUnstructuredGrid(text));
}

Result<CellsOfFile> readCellsFile(const std::string& name, std::string_view text, MeshFormat format) {
  if (text.empty()) return Error{ErrorCode::kUnreadable, "'" + name + "' is empty"};
  return format == MeshFormat::kPly   ? readPlyCells(name, text)
         : format == MeshFormat::kVtu ? readVtuCells(name, text)
         : format == MeshFormat::kMsh ? readGmshCells(name, text)
                                      : readVtkCells(name, text);
}

/// What PCL is to read, in memory: the file as it is, or rewritten.
using Opened = std::variant<MemoryFile, CellsOfFile>;

/// What was read of the file is gone afterwards.
Result<Opened> openFile(const std::string& real_path, const std::string& name, MeshFormat format,
                        PromisedCounts& promised, FileTexture& texture) {
  const Result<FileBytes> read = readFile(real_path, kMaxMeshBytes);
  if (!read) return Error{read.error().code, "'" + name + "' " + read.error().detail};
  std::string_view text = read->text();
  if (hasCells(text, format)) {
    Result<CellsOfFile> cells = readCellsFile(name, text, format);
    if (!cells) return cells.error();
    return Opened(std::move(*cells));
  }
  const std::string lower = format == MeshFormat::kStl ? plainStl(text) : "";
  if (!lower.empty()) text = lower;
  const Result<PromisedCounts> header = checkBeforeReading(name, text, format);
  if (!header) return header.error();
  promised = *header;
  if (format == MeshFormat::kStl) return Opened(MemoryFile(text));
  const Result<std::string> plain = format == MeshFormat::kObj   ? plainObj(name, text, texture)
                                    : format == MeshFormat::kOff ? plainOff(name, text, promised)
                                    : format == MeshFormat::kVtk ? plainVtk(name, text, promised)
                                                                 : plainPcd(name, text, promised);
  if (!plain) return plain.error();
  return Opened(MemoryFile(*plain));
}

}  // namespace

Result<TriangleMesh> readMeshFile(const std::string& real_path, std::vector<std::string>* notes, FileTexture* texture) {
  const std::string name = std::filesystem::path(real_path).filename().string();
  const Result<MeshFormat> format = meshFormatOf(name);
  if (!format) return format.error();
  FileTexture found;
  if (!texture) texture = &found;
  // PCL and VTK throw for bad input, and for memory.
  try {
    PromisedCounts promised;
    Result<Opened> opened = openFile(real_path, name, *format, promised, *texture);
    if (!opened) return opened.error();
    if (auto* cells = std::get_if<CellsOfFile>(&*opened))
      return surfaceOfCells(name, std::move(*cells), notes, *texture);
    const auto* file = std::get_if<MemoryFile>(&*opened);
    if (!file->ok()) return Error{ErrorCode::kFailed, "there is no memory to read '" + name + "'"};
    pcl::PolygonMesh mesh;
    bool read = false;
    {
      // What PCL and VTK say, and which readers VTK has, is the whole process's.
      static std::mutex one_at_a_time;
      const std::lock_guard<std::mutex> lock(one_at_a_time);
      read = readWithPcl(file->path(), *format, mesh);
    }
    if (!read) return Error{ErrorCode::kUnreadable, "'" + name + "' cannot be read: it is truncated or damaged"};
    return convert(mesh, promised, name, *texture);
  } catch (const std::exception& e) {
    return Error{ErrorCode::kUnreadable, "'" + name + "' cannot be read: " + e.what()};
  }
}

}  // namespace meshless
