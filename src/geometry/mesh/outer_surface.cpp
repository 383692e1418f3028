#include "meshless_surgery/geometry/mesh/outer_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

namespace meshless {
namespace {

constexpr double kFlatCell = 1e-12;  // of the cube of its bounds' diagonal

/// Counter-clockwise seen from outside where the first face is counter-clockwise seen from the corners over it; a
/// triangle has its last corner twice.
struct FacesOfShape {
  std::size_t corners, faces;
  std::array<std::array<std::uint8_t, 4>, 6> face;
};
constexpr std::array<FacesOfShape, kCellShapes> kFacesOfShapes = {{
    {4, 4, {{{{1, 2, 3, 3}}, {{0, 3, 2, 2}}, {{0, 1, 3, 3}}, {{0, 2, 1, 1}}}}},
    {8, 6, {{{{0, 3, 2, 1}}, {{4, 5, 6, 7}}, {{0, 1, 5, 4}}, {{1, 2, 6, 5}}, {{2, 3, 7, 6}}, {{3, 0, 4, 7}}}}},
    {6, 5, {{{{0, 2, 1, 1}}, {{3, 4, 5, 5}}, {{0, 1, 4, 3}}, {{1, 2, 5, 4}}, {{2, 0, 3, 5}}}}},
    {5, 5, {{{{0, 3, 2, 1}}, {{0, 1, 4, 4}}, {{1, 2, 4, 4}}, {{2, 3, 4, 4}}, {{3, 0, 4, 4}}}}},
}};

const FacesOfShape& facesOf(CellShape shape) { return kFacesOfShapes[static_cast<std::size_t>(shape)]; }

/// A triangle by its sorted corners, and which way it turns: 16 bytes, as there are 96 million of them at most.
struct CellFace {
  Triangle corners;
  bool odd;

  explicit CellFace(Triangle t) : corners(t), odd(false) {
    for (const auto& [a, b] : {std::pair<int, int>{0, 1}, {1, 2}, {0, 1}})
      if (corners[a] > corners[b]) {
        std::swap(corners[a], corners[b]);
        odd = !odd;
      }
  }
  bool operator<(const CellFace& o) const { return corners != o.corners ? corners < o.corners : odd < o.odd; }
};

/// Corners of a face, equal neighbours taken as one; a face that has collapsed has none.
struct Face {
  std::array<Index, 4> corner;
  std::size_t size = 0;
};

Face faceOf(const Index* cell, const std::array<std::uint8_t, 4>& at) {
  Face face;
  for (const std::uint8_t k : at)
    if (std::find(face.corner.begin(), face.corner.begin() + face.size, cell[k]) == face.corner.begin() + face.size)
      face.corner[face.size++] = cell[k];
  // A quad whose opposite corners are one has no area.
  if (face.size < 3 ||
      (face.size == 3 && (cell[at[0]] == cell[at[2]] || (at[2] != at[3] && cell[at[1]] == cell[at[3]]))))
    face.size = 0;
  return face;
}

/// Splits quads, for the cells on both sides alike.
class QuadSplit {
 public:
  explicit QuadSplit(const VolumeCells& cells) {
    bool quads = false, triangles = false;
    for (const CellShape shape : cells.shapes) {
      quads |= shape != CellShape::kTetrahedron;
      triangles |= shape != CellShape::kHexahedron;
    }
    if (!quads || !triangles) return;
    const Index* cell = cells.corners.data();
    for (const CellShape shape : cells.shapes) {
      const FacesOfShape& of = facesOf(shape);
      for (std::size_t f = 0; f < of.faces; ++f) {
        const Face face = faceOf(cell, of.face[f]);
        if (face.size == 3) triangles_.push_back(sorted(face.corner[0], face.corner[1], face.corner[2]));
      }
      cell += of.corners;
    }
    std::sort(triangles_.begin(), triangles_.end());
  }

  /// Calls use(triangle) for each triangle of the face.
  template <class Use>
  void triangles(const Face& face, const Use& use) const {
    const auto& c = face.corner;
    if (face.size == 3) use(Triangle{c[0], c[1], c[2]});
    if (face.size != 4) return;
    std::size_t s = static_cast<std::size_t>(std::min_element(c.begin(), c.end()) - c.begin());
    // A quad beside two tetrahedra has the diagonal that they have.
    if (!has(c, s) && has(c, s + 1)) ++s;
    use(Triangle{c[s % 4], c[(s + 1) % 4], c[(s + 2) % 4]});
    use(Triangle{c[s % 4], c[(s + 2) % 4], c[(s + 3) % 4]});
  }

 private:
  static Triangle sorted(Index a, Index b, Index c) {
    Triangle t{a, b, c};
    std::sort(t.begin(), t.end());
    return t;
  }
  bool has(const std::array<Index, 4>& c, std::size_t s) const {
    const auto is = [&](Index a, Index b, Index d) {
      return std::binary_search(triangles_.begin(), triangles_.end(), sorted(a, b, d));
    };
    return !triangles_.empty() && is(c[s % 4], c[(s + 1) % 4], c[(s + 2) % 4]) &&
           is(c[s % 4], c[(s + 2) % 4], c[(s + 3) % 4]);
  }

  std::vector<Triangle> triangles_;  // of cells, sorted
};

double volumeOf(const Points& points, const Index* cell, const FacesOfShape& of, const QuadSplit& split) {
  const Vec3& origin = points[cell[0]];
  double sixfold = 0.0;
  for (std::size_t f = 0; f < of.faces; ++f)
    split.triangles(faceOf(cell, of.face[f]), [&](const Triangle& t) {
      sixfold += (points[t[0]] - origin).cross(points[t[1]] - origin).dot(points[t[2]] - origin);
    });
  return sixfold / 6.0;
}

std::vector<double> volumesOf(const Points& points, const VolumeCells& cells, const QuadSplit& split) {
  std::vector<double> volumes;
  volumes.reserve(cells.size());
  const Index* cell = cells.corners.data();
  for (const CellShape shape : cells.shapes) {
    const FacesOfShape& of = facesOf(shape);
    volumes.push_back(volumeOf(points, cell, of, split));
    cell += of.corners;
  }
  return volumes;
}

Status checkCorners(const Points& points, const VolumeCells& cells) {
  const Index* cell = cells.corners.data();
  for (std::size_t k = 0; k < cells.size(); ++k) {
    const std::size_t corners = cornersOf(cells.shapes[k]);
    for (std::size_t c = 0; c < corners; ++c) {
      const auto bad = [&](const std::string& what) {
        return Error{ErrorCode::kUnsuitableShape,
                     "cell " + std::to_string(k) + " has the corner " + std::to_string(cell[c]) + what};
      };
      if (cell[c] >= points.size()) return bad("; accepted: 0 to " + std::to_string(points.size()) + " exclusive");
      if (!points[cell[c]].allFinite()) return bad(", which is not finite");
    }
    cell += corners;
  }
  return Done{};
}

/// Which cells are written inside out.
std::vector<bool> invertedCells(const Points& points, const VolumeCells& cells, const QuadSplit& split) {
  const std::vector<double> volumes = volumesOf(points, cells, split);
  std::vector<bool> inverted(cells.size()), flat(cells.size());
  std::array<long, kCellShapes> balance{};
  const Index* cell = cells.corners.data();
  for (std::size_t k = 0; k < cells.size(); ++k) {
    const std::size_t corners = cornersOf(cells.shapes[k]);
    Box box;
    for (std::size_t c = 0; c < corners; ++c) box.extend(points[cell[c]]);
    flat[k] = !(std::abs(volumes[k]) > kFlatCell * std::pow(box.diagonal(), 3));
    inverted[k] = volumes[k] < 0.0;
    if (!flat[k]) balance[static_cast<std::size_t>(cells.shapes[k])] += inverted[k] ? -1 : 1;
    cell += corners;
  }
  for (std::size_t k = 0; k < cells.size(); ++k)
    if (flat[k]) inverted[k] = balance[static_cast<std::size_t>(cells.shapes[k])] < 0;
  return inverted;
}

/// The triangles in `faces`, with the points that they have.
TriangleMesh meshOf(const Points& points, const std::vector<CellFace>& faces) {
  TriangleMesh mesh;
  std::vector<Index> number(points.size(), kNoIndex);
  for (const CellFace& face : faces)
    for (const Index k : face.corners) number[k] = 0;
  for (std::size_t k = 0; k < points.size(); ++k)
    if (number[k] != kNoIndex) {
      number[k] = static_cast<Index>(mesh.vertices.size());
      mesh.vertices.push_back(points[k]);
    }
  mesh.triangles.reserve(faces.size());
  for (const CellFace& face : faces) {
    const Triangle& t = face.corners;
    mesh.triangles.push_back({number[t[0]], number[t[face.odd ? 2 : 1]], number[t[face.odd ? 1 : 2]]});
  }
  return mesh;
}

}  // namespace

std::size_t cornersOf(CellShape shape) { return facesOf(shape).corners; }

std::vector<double> cellVolumes(const Points& points, const VolumeCells& cells) {
  return volumesOf(points, cells, QuadSplit(cells));
}

Result<TriangleMesh> outerSurface(const Points& points, const VolumeCells& cells) {
  if (Status status = checkCorners(points, cells); !status) return status.error();
  std::vector<CellFace> faces;
  {
    const QuadSplit split(cells);
    const std::vector<bool> inverted = invertedCells(points, cells, split);
    std::size_t most = 0;
    for (const CellShape shape : cells.shapes) most += shape == CellShape::kHexahedron ? 12 : 2 * cornersOf(shape) - 4;
    faces.reserve(most);
    const Index* cell = cells.corners.data();
    for (std::size_t k = 0; k < cells.size(); ++k) {
      const FacesOfShape& of = facesOf(cells.shapes[k]);
      for (std::size_t f = 0; f < of.faces; ++f)
        split.triangles(faceOf(cell, of.face[f]), [&](const Triangle& t) {
          faces.emplace_back(inverted[k] ? Triangle{t[0], t[2], t[1]} : t);
        });
      cell += of.corners;
    }
  }
  std::sort(faces.begin(), faces.end());
  std::size_t kept = 0;
  for (std::size_t k = 0; k < faces.size();) {
    std::size_t end = k + 1;
    while (end < faces.size() && faces[end].corners == faces[k].corners) ++end;
    if (end - k > 2) {
      const Triangle& t = faces[k].corners;
      return Error{ErrorCode::kUnsuitableShape, "the face of the points " + std::to_string(t[0]) + ", " +
                                                    std::to_string(t[1]) + " and " + std::to_string(t[2]) +
                                                    " belongs to " + std::to_string(end - k) +
                                                    " cells; accepted: one or two"};
    }
    if (end - k == 1) faces[kept++] = faces[k];
    k = end;
  }
  faces.erase(faces.begin() + static_cast<std::ptrdiff_t>(kept), faces.end());
  if (faces.empty())
    return Error{ErrorCode::kUnsuitableShape, "its " + std::to_string(cells.size()) +
                                                  " cells have no outer surface: none of their faces belongs to one "
                                                  "cell alone"};
  return meshOf(points, faces);
}

}  // namespace meshless
