#include <cerrno>
#include <cstdio>
#include <cstring>

#include "meshless_surgery/io/files.h"

namespace meshless {

Status writeObj(const std::string& path, const TriangleMesh& mesh, const std::string& comment) {
  const std::string temporary = path + ".part";
  const auto refused = [&] {
    const std::string why = std::strerror(errno);
    std::remove(temporary.c_str());
    return Error{ErrorCode::kFailed, "cannot write '" + path + "': " + why};
  };
  std::FILE* out = std::fopen(temporary.c_str(), "wb");
  if (!out) return refused();
  bool ok = true;
  if (!comment.empty()) {
    std::string line = comment;
    for (std::size_t at = 0; (at = line.find('\n', at)) != std::string::npos; at += 3) line.replace(at, 1, "\n# ");
    ok = std::fprintf(out, "# %s\n", line.c_str()) > 0;
  }
  for (const Vec3& p : mesh.vertices) ok = ok && std::fprintf(out, "v %.17g %.17g %.17g\n", p.x(), p.y(), p.z()) > 0;
  for (const Triangle& t : mesh.triangles)
    ok = ok && std::fprintf(out, "f %u %u %u\n", t[0] + 1, t[1] + 1, t[2] + 1) > 0;
  ok = std::fflush(out) == 0 && ok;
  ok = std::fclose(out) == 0 && ok;
  if (!ok) return refused();
  if (std::rename(temporary.c_str(), path.c_str()) != 0) return refused();
  return Done{};
}

}  // namespace meshless
