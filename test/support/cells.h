// Bodies of elastic cells: whole, filled in part, and with several copies of a cell at one place.
#pragma once

#include "meshless_surgery/dynamics/elastic_cells.h"
#include "support/random.h"

namespace meshless::test {

constexpr double kCellEdge = 0.01;       // [m]
constexpr double kCellDensity = 1000.0;  // [kg/m^3]

struct CellBody {
  Points rest;
  ElasticCells cells;
  std::vector<ClusterPose> poses;
};

// A cell's filled part: a box within it, from low to high in the cell's coordinates.
inline void fill(const Vec3& low, const Vec3& high, ElasticCell& cell) {
  const Vec3 size = high - low;
  cell.mass = kCellDensity * kCellEdge * kCellEdge * kCellEdge / 8.0 * size.prod();
  cell.centroid = (0.5 * (low + high)).cwiseMax(-0.9).cwiseMin(0.9);
  cell.variance = size.cwiseAbs2() / 12.0;
}

// Half of a cell's mass goes to the corners by their trilinear weights, half of it evenly.
inline void finish(CellBody& body) {
  body.cells.half_edge = 0.5 * kCellEdge;
  body.cells.masses.assign(body.rest.size(), 0.0);
  for (const ElasticCell& cell : body.cells.cells)
    for (int k = 0; k < 8; ++k) {
      double weight = 1.0;
      for (int axis = 0; axis < 3; ++axis) weight *= 0.5 * (1.0 + (k >> axis & 1 ? 1.0 : -1.0) * cell.centroid[axis]);
      body.cells.masses[cell.corners[k]] += cell.mass * (0.5 * weight + 0.0625);
    }
  body.poses.assign(body.cells.cells.size(), ClusterPose());
}

inline CellBody wholeCells(int nx, int ny, int nz) {
  CellBody body;
  for (int z = 0; z <= nz; ++z)
    for (int y = 0; y <= ny; ++y)
      for (int x = 0; x <= nx; ++x) body.rest.push_back(kCellEdge * Vec3(x, y, z));
  for (int z = 0; z < nz; ++z)
    for (int y = 0; y < ny; ++y)
      for (int x = 0; x < nx; ++x) {
        ElasticCell cell;
        for (int k = 0; k < 8; ++k)
          cell.corners[k] = static_cast<Index>(x + (k & 1) + (nx + 1) * (y + (k >> 1 & 1) + (ny + 1) * (z + (k >> 2))));
        fill(Vec3::Constant(-1.0), Vec3::Constant(1.0), cell);
        body.cells.cells.push_back(cell);
      }
  finish(body);
  return body;
}

// Any part of a cell from `least` of its width on; of every third cell two copies that share some corners.
inline CellBody cutCells(int nx, int ny, int nz, unsigned seed, double least = 0.02) {
  CellBody body = wholeCells(nx, ny, nz);
  Random random(seed);
  const auto fillSome = [&](ElasticCell& cell) {
    Vec3 low, high;
    for (int axis = 0; axis < 3; ++axis) {
      const double width = 2.0 * random.uniform(least, 1.0);
      low[axis] = random.uniform(-1.0, 1.0 - width);
      high[axis] = low[axis] + width;
    }
    fill(low, high, cell);
  };
  const std::size_t count = body.cells.cells.size();
  for (std::size_t c = 0; c < count; ++c) {
    fillSome(body.cells.cells[c]);
    if (c % 3 != 0) continue;
    ElasticCell copy = body.cells.cells[c];
    fillSome(copy);
    for (Index& corner : copy.corners)
      if (random.integer(0, 1) == 1) {
        const Vec3 place = body.rest[corner];
        corner = static_cast<Index>(body.rest.size());
        body.rest.push_back(place);
      }
    body.cells.cells.push_back(copy);
  }
  finish(body);
  return body;
}

// Other materials in some of the cells.
inline CellBody mixed(CellBody body, unsigned seed) {
  Random random(seed);
  for (std::size_t c = 0; c < body.cells.cells.size(); c += 2)
    body.cells.cells[c].mix = {random.uniform(0.0, 1.0), random.uniform(0.0, 4.0),  random.uniform(0.0, 9.0),
                               random.uniform(0.0, 9.0), random.uniform(0.0, 50.0), random.uniform(-9.0, 9.0)};
  return body;
}

}  // namespace meshless::test
