// The Truth Cube (Kerdok et al. 2003): beads in a cube of gel that a plate presses, where CT saw them, beside where the
// package has them. The beads of the lowest and the highest layer are led as they were measured; nobody needs to know
// how stiff the gel is.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/base/types.h"
#include "meshless_surgery/body/body_def.h"

namespace meshless::bench {

constexpr int kBeadsASide = 7;
constexpr int kCompressions = 3;
constexpr std::array<double, kCompressions> kNominal = {0.05, 0.125, 0.1825};

struct Bead {
  std::array<int, 3> place{};            // 1..7 in the grid; the third is the layer, 1 at the base
  Vec3 rest = Vec3::Zero();              // [m] about the middle of the cube, z up
  std::array<Vec3, kCompressions> then;  // [m] pressed
};
Result<std::vector<Bead>> readTruthCube(const std::string& file);

struct CubeRow {
  std::size_t cells = 0;
  double led = 0.0;               // [m] rms by which the led beads are not where they were measured
  double largest = 0.0;           // [m] of the displacements that were measured
  double rms = 0.0, worst = 0.0;  // [m] of the distances of the 245 beads between the led layers
  double uniform = 0.0;           // [m] the rms where each would go along evenly between the led layers
  std::array<double, kBeadsASide> measured{}, ours{};  // lateral stretch of each layer
};
/// In the world, without weight, under which the gel lay in both pictures. spacing [m]: 0.01 over a whole number, so
/// that particles lie where the grid has the beads.
Result<CubeRow> pressCube(const std::vector<Bead>& beads, int compression, double poissons_ratio,
                          double spacing = 0.01);

}  // namespace meshless::bench
