// A mesh or cloud from a file, by the reader of its kind. PCL reads clouds; this is the only file that includes it.
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

#include <pcl/PCLPointCloud2.h>
#include <pcl/console/print.h>
#include <pcl/io/pcd_io.h>

#include "cells_of_file.h"
#include "mesh_format.h"
#include "meshless_surgery/io/files.h"
#include "opened_file.h"
#include "text_words.h"

namespace meshless {
namespace {

/// PCL's complaints would stand in front of ours.
class QuietPcl {
 public:
  QuietPcl() : level_(pcl::console::getVerbosityLevel()) { pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS); }
  ~QuietPcl() { pcl::console::setVerbosityLevel(level_); }
  QuietPcl(const QuietPcl&) = delete;
  QuietPcl& operator=(const QuietPcl&) = delete;

 private:
  pcl::console::VERBOSITY_LEVEL level_;
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

Result<TriangleMesh> surfaceOfCells(const std::string& name, CellsOfFile&& cells, std::vector<std::string>* notes,
                                    FileTexture& texture) {
  std::vector<std::string> said;
  Result<TriangleMesh> mesh = surfaceOf(name, std::move(cells), said, texture);
  if (!mesh) return mesh.error();
  if (notes) notes->insert(notes->end(), said.begin(), said.end());
  return checked(name, std::move(*mesh));
}

/// In the head of a file, where comments and titles are.
std::string spaceIn(std::string_view text) {
  constexpr std::size_t kHead = 4096;
  const std::string head(text.substr(0, kHead));
  for (const char* space : kSpaces)
    if (head.find(std::string("SPACE=") + space) != std::string::npos) return space;
  return "";
}

Result<CellsOfFile> readCells(const std::string& name, std::string_view text, MeshFormat format) {
  switch (format) {
    case MeshFormat::kPly:
      return readPlyCells(name, text);
    case MeshFormat::kObj:
      return readObjCells(name, text);
    case MeshFormat::kStl:
      return readStlCells(name, text);
    case MeshFormat::kVtk:
      return readVtkCells(name, text);
    case MeshFormat::kOff:
      return readOffCells(name, text);
    case MeshFormat::kVtkXml:
      return readVtkXmlCells(name, text);
    case MeshFormat::kMsh:
      return readGmshCells(name, text);
    case MeshFormat::kPcd:
      break;
  }
  return Error{ErrorCode::kFailed, "'" + name + "' is a cloud"};
}

/// By PCL, of a file in memory that holds checked numbers alone.
Result<TriangleMesh> readCloud(const std::string& name, std::string_view text) {
  std::optional<std::size_t> promised;
  const Result<std::string> plain = plainPcd(name, text, promised);
  if (!plain) return plain.error();
  const MemoryFile file(*plain);
  if (!file.ok()) return Error{ErrorCode::kFailed, "there is no memory to read '" + name + "'"};
  pcl::PCLPointCloud2 cloud;
  {
    // What PCL says is the whole process's.
    static std::mutex one_at_a_time;
    const std::lock_guard<std::mutex> lock(one_at_a_time);
    const QuietPcl quiet;
    if (pcl::io::loadPCDFile(file.path(), cloud) != 0)
      return Error{ErrorCode::kUnreadable, "'" + name + "' cannot be read: its compressed points are damaged"};
  }
  TriangleMesh mesh;
  if (!copyPoints(cloud, mesh.vertices))
    return Error{ErrorCode::kUnreadable, "'" + name + "' has no points with x, y and z as float or double"};
  if (promised && *promised != mesh.vertices.size())
    return Error{ErrorCode::kUnreadable, "'" + name + "' is truncated: it holds " +
                                             std::to_string(mesh.vertices.size()) + " of " + std::to_string(*promised) +
                                             " points"};
  return checked(name, std::move(mesh));
}

}  // namespace

Result<TriangleMesh> readMeshFile(const std::string& real_path, std::vector<std::string>* notes, FileTexture* texture,
                                  std::string* space) {
  const std::string name = std::filesystem::path(real_path).filename().string();
  const Result<MeshFormat> format = meshFormatOf(name);
  if (!format) return format.error();
  FileTexture found;
  if (!texture) texture = &found;
  // PCL throws for bad input, and everything for memory.
  try {
    const Result<FileBytes> read = readFile(real_path, kMaxMeshBytes);
    if (!read) return Error{read.error().code, "'" + name + "' " + read.error().detail};
    const std::string_view text = withoutMark(read->text());
    if (text.empty()) return Error{ErrorCode::kUnreadable, "'" + name + "' is empty"};
    if (space) *space = spaceIn(text);
    if (*format == MeshFormat::kPcd) return readCloud(name, text);
    Result<CellsOfFile> cells = readCells(name, text, *format);
    if (!cells) return cells.error();
    return surfaceOfCells(name, std::move(*cells), notes, *texture);
  } catch (const std::exception& e) {
    return Error{ErrorCode::kUnreadable, "'" + name + "' cannot be read: " + e.what()};
  }
}

}  // namespace meshless
