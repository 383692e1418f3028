#include "meshless_surgery/geometry/lattice/fibre_directions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>

#include "meshless_surgery/geometry/query/union_find.h"

namespace meshless {
namespace {

constexpr int kIterations = 10;      // of the inverse power method, from the coordinate along the longest axis
constexpr double kTolerance = 1e-5;  // of each solution
constexpr double kShift = 1e-9;      // added to the Laplacian, which has a mode without slope for each part
constexpr double kLevel = 1e-9;      // of the steepest slope of a part: below it there is no direction

struct Edge {
  Index below, above;  // cells
  int axis;
};

// Cells that share a face.
std::vector<Edge> edgesOf(const CellLattice& lattice) {
  struct Face {
    std::array<Index, 4> corners;
    int axis, side;
    Index cell;
  };
  std::vector<Face> faces;
  for (Index c = 0; c < lattice.cells.size(); ++c)
    for (int axis = 0; axis < 3; ++axis)
      for (int side = 0; side < 2; ++side) {
        Face face{{}, axis, side, c};
        for (int k = 0, n = 0; k < 8; ++k)
          if ((k >> axis & 1) == side) face.corners[static_cast<std::size_t>(n++)] = lattice.cells[c].corners[k];
        std::sort(face.corners.begin(), face.corners.end());
        faces.push_back(face);
      }
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) {
    return std::tie(a.corners, a.side, a.cell) < std::tie(b.corners, b.side, b.cell);
  });
  std::vector<Edge> edges;
  for (auto from = faces.begin(); from != faces.end();) {
    const auto end = std::find_if(from, faces.end(), [from](const Face& f) { return f.corners != from->corners; });
    // The upper face of one is the lower one of the other; copies of a cell at one place may share both.
    for (auto upper = from; upper != end; ++upper)
      for (auto lower = from; lower != upper; ++lower)
        if (upper->side == 1 && lower->side == 0 && upper->axis == lower->axis)
          edges.push_back({upper->cell, lower->cell, upper->axis});
    from = end;
  }
  return edges;
}

// Parts that hang together, by their first cells.
class Parts {
 public:
  Parts(std::size_t cells, const std::vector<Edge>& edges) : sets_(cells) {
    for (const Edge& edge : edges) sets_.join(edge.below, edge.above);
  }
  Index of(Index cell) { return sets_.find(cell); }

 private:
  UnionFind sets_;
};

// Of each part without its mean, and of length 1.
void normalise(Parts& parts, Eigen::VectorXd& values) {
  std::vector<double> sums(static_cast<std::size_t>(values.size()), 0.0), counts(sums), squares(sums);
  for (Index c = 0; c < sums.size(); ++c) sums[parts.of(c)] += values[c], counts[parts.of(c)] += 1.0;
  for (Index c = 0; c < sums.size(); ++c) {
    values[c] -= sums[parts.of(c)] / counts[parts.of(c)];
    squares[parts.of(c)] += values[c] * values[c];
  }
  for (Index c = 0; c < sums.size(); ++c)
    if (squares[parts.of(c)] > 0.0) values[c] /= std::sqrt(squares[parts.of(c)]);
}

// The coordinate along the axis in which a part is longest.
Eigen::VectorXd start(const CellLattice& lattice, Parts& parts, std::vector<Vec3>& longest) {
  const std::size_t n = lattice.cells.size();
  std::vector<std::array<std::int32_t, 3>> low(n), high(n);
  for (Index c = 0; c < n; ++c) low[c] = high[c] = lattice.cells[c].place;
  for (Index c = 0; c < n; ++c)
    for (std::size_t k = 0; k < 3; ++k) {
      low[parts.of(c)][k] = std::min(low[parts.of(c)][k], lattice.cells[c].place[k]);
      high[parts.of(c)][k] = std::max(high[parts.of(c)][k], lattice.cells[c].place[k]);
    }
  Eigen::VectorXd values(n);
  longest.resize(n);
  for (Index c = 0; c < n; ++c) {
    std::size_t axis = 0;
    const Index part = parts.of(c);
    for (std::size_t k = 1; k < 3; ++k)
      if (high[part][k] - low[part][k] > high[part][axis] - low[part][axis]) axis = k;
    values[c] = lattice.cells[c].place[axis];
    longest[c] = Vec3::Unit(static_cast<Eigen::Index>(axis));
  }
  normalise(parts, values);
  return values;
}

Eigen::SparseMatrix<double> laplacian(std::size_t cells, const std::vector<Edge>& edges) {
  std::vector<Eigen::Triplet<double>> entries;
  for (Index c = 0; c < cells; ++c) entries.emplace_back(c, c, kShift);
  for (const Edge& e : edges) {
    entries.emplace_back(e.below, e.below, 1.0);
    entries.emplace_back(e.above, e.above, 1.0);
    entries.emplace_back(e.below, e.above, -1.0);
    entries.emplace_back(e.above, e.below, -1.0);
  }
  Eigen::SparseMatrix<double> matrix(static_cast<Eigen::Index>(cells), static_cast<Eigen::Index>(cells));
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

}  // namespace

std::vector<Vec3> fibreDirections(const CellLattice& lattice, const Vec3& direction) {
  const std::size_t n = lattice.cells.size();
  if (!direction.isZero(0.0)) return std::vector<Vec3>(n, direction.normalized());
  const std::vector<Edge> edges = edgesOf(lattice);
  Parts parts(n, edges);
  std::vector<Vec3> found;
  Eigen::VectorXd mode = start(lattice, parts, found);
  const Eigen::SparseMatrix<double> matrix = laplacian(n, edges);
  Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower | Eigen::Upper> solver(matrix);
  solver.setTolerance(kTolerance);
  for (int k = 0; k < kIterations; ++k) {
    mode = solver.solve(mode).eval();
    normalise(parts, mode);
  }
  // Its slope: the mean over the faces of each axis.
  std::vector<Vec3> slope(n, Vec3::Zero()), faces(n, Vec3::Zero());
  for (const Edge& e : edges)
    for (const Index c : {e.below, e.above}) {
      slope[c][e.axis] += mode[e.above] - mode[e.below];
      faces[c][e.axis] += 1.0;
    }
  std::vector<double> steepest(n, 0.0);
  for (Index c = 0; c < n; ++c) {
    slope[c] = slope[c].cwiseQuotient(faces[c].cwiseMax(1.0));
    steepest[parts.of(c)] = std::max(steepest[parts.of(c)], slope[c].norm());
  }
  for (Index c = 0; c < n; ++c)
    if (slope[c].norm() > kLevel * steepest[parts.of(c)]) found[c] = slope[c].normalized();
  return found;
}

}  // namespace meshless
