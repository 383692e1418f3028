// Overlapping clusters of particles: who belongs to which, with what share, and the constants of their rest shapes.
#pragma once

#include <limits>
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

/// A particle, and how far it is along the graph [m].
struct Reached {
  Index particle;
  double distance;
};
/// Lowers distances, one a particle, to those from `start` where these are less: out to a radius [m], over particles
/// that are allowed (empty: all). Returns what was lowered, the nearest first.
std::vector<Reached> lowerDistances(const ParticleGraph& graph, Index start, double radius,
                                    const std::vector<char>& allowed, std::vector<double>& distances);
/// One search after another, each on its own, from infinite distances.
class GraphSearch {
 public:
  explicit GraphSearch(const ParticleGraph& graph)
      : graph_(graph), distances_(graph.size(), std::numeric_limits<double>::infinity()) {}
  std::vector<Reached> from(Index start, double radius, const std::vector<char>& allowed = {});

 private:
  const ParticleGraph& graph_;
  std::vector<double> distances_;
};

/// How a user wants a body of an appearance material divided.
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
  std::vector<Index> seeds;     // the member in the middle of a cluster
  std::vector<double> radii;    // [m] of the member that is farthest from it, along links within the cluster

  Index size() const { return offsets.empty() ? 0 : static_cast<Index>(offsets.size() - 1); }
};

/// Divides the body; the same input gives the same clusters.
ClusterSet makeClusters(const Points& rest, const ParticleGraph& graph, const ClusterOptions& options);

/// A cluster for each group of eight particles, whose masses [kg] are the sums of equal parts of the groups' masses.
ClusterSet clustersOfCells(const std::vector<std::array<Index, 8>>& cells, const std::vector<double>& cell_masses,
                           const std::vector<double>& particle_masses);

/// What becomes of a parent's clusters in a piece. Of each its members that are there, as one cluster for each part of
/// them that hangs together within its radius, along the piece's links: where a wound parts it, its sides are two.
/// Weights stay. parent_particle: of each of the piece's particles, the parent's that it is or is a copy of.
struct PieceClusters {
  ClusterSet clusters;
  std::vector<Index> origin;  // one a cluster: the parent's that it is a part of
  Index kept = 0;             // clusters that are as they were
};
PieceClusters splitClusters(const ClusterSet& parent, const Points& piece_rest, const ParticleGraph& piece_graph,
                            const std::vector<Index>& parent_particle);

}  // namespace meshless
