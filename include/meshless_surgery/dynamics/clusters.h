// Overlapping clusters of particles: who belongs to which, with what share, and the constants of their rest shapes.
#pragma once

#include <vector>

#include "meshless_surgery/base/types.h"

namespace meshless {

/// Undirected neighbours along the body (compressed rows). Distances along it keep parts apart that are near in space
/// only: two fingers, a hood and a shirt.
struct ParticleGraph {
  std::vector<Index> offsets;     // particles + 1
  std::vector<Index> neighbours;  // ascending in each row
  std::vector<double> lengths;    // [m]

  Index size() const { return offsets.empty() ? 0 : static_cast<Index>(offsets.size() - 1); }
};

/// Builds the graph from undirected edges (duplicates allowed) between n particles at the rest positions.
ParticleGraph makeGraph(const Points& rest, std::vector<std::array<Index, 2>> edges);

/// How a user wants a body divided. Cells are those of a cubic lattice of particles at the body's spacing; auto means
/// them for elastic materials.
struct ClusterOptions {
  enum class Kind { kAuto, kOne, kGrid, kCount, kCells };
  Kind kind = Kind::kAuto;
  std::array<int, 3> grid{{1, 1, 1}};  // cells along x, y, z of the rest bounds, each 1..1000, at most 100,000 together
  int count = 1;                       // >= 1
  double overlap = 0.3;                // 0..1, growth of a cluster beyond its share, relative to its radius
};

/// Members of each cluster as compressed rows. Every particle is in at least one.
struct ClusterSet {
  std::vector<Index> offsets;   // clusters + 1
  std::vector<Index> members;   // particle indices, ascending in each row
  std::vector<double> weights;  // w_ic > 0; over the clusters of a particle they add up to 1
  std::vector<Index> seeds;     // the particle that a cluster grew from
  std::vector<double> radii;    // [m] distance along the body that it may reach

  Index size() const { return offsets.empty() ? 0 : static_cast<Index>(offsets.size() - 1); }
};

/// Divides the body; the same input gives the same clusters. kCells is for those who have cells (clustersOfCells), and
/// means auto here.
ClusterSet makeClusters(const Points& rest, const ParticleGraph& graph, const ClusterOptions& options);

/// A cluster for each group of eight particles, whose masses [kg] are the sums of equal parts of the groups' masses.
ClusterSet clustersOfCells(const std::vector<std::array<Index, 8>>& cells, const std::vector<double>& cell_masses,
                           const std::vector<double>& particle_masses, double radius);

/// What becomes of a parent's clusters in a piece that holds the parent's particles `kept` (ascending parent indices):
/// clusters with all members in the piece stay; the others grow again from their remaining member nearest to the old
/// seed, along the piece's own graph and within their radius; particles left over get clusters in the same way.
struct PieceClusters {
  ClusterSet clusters;
  Index kept = 0;     // clusters taken over unchanged
  Index rebuilt = 0;  // grown again
  std::vector<Index> origin;  // one a cluster: the parent's that it was, or kNoIndex
};
/// torn: one a parent's cluster; those that grow again though all of their members are there. Empty: none.
PieceClusters splitClusters(const ClusterSet& parent, const Points& piece_rest, const ParticleGraph& piece_graph,
                            const std::vector<Index>& kept, const std::vector<bool>& torn = {});

/// The part of a graph between the kept particles (ascending), renumbered.
ParticleGraph subgraph(const ParticleGraph& parent, const std::vector<Index>& kept);

}  // namespace meshless
