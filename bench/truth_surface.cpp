#include "truth_surface.h"

#include <cstdlib>
#include <fstream>
#include <sstream>

namespace meshless::bench {

Result<TriangleMesh> readSurface(const std::string& file) {
  std::ifstream in(file);
  if (!in) return Error{ErrorCode::kUnreadable, "cannot read '" + file + "'"};
  TriangleMesh mesh;
  std::string line, kind;
  while (std::getline(in, line)) {
    std::istringstream words(line);
    words >> kind;
    if (kind == "v") {
      Vec3 p;
      words >> p.x() >> p.y() >> p.z();
      mesh.vertices.push_back(p);
    } else if (kind == "f") {
      Triangle t;
      for (Index& corner : t) {
        std::string word;
        words >> word;
        corner = static_cast<Index>(std::strtoul(word.c_str(), nullptr, 10)) - 1;
      }
      mesh.triangles.push_back(t);
    }
  }
  return mesh;
}

}  // namespace meshless::bench
