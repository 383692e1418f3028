#include "meshless_surgery/dynamics/clusters.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "support/random.h"

namespace meshless {
namespace clusters_test {

// A lattice of nx x ny x nz points at distance 1; `linked` says which neighbours hold together.
struct Lattice {
  Points rest;
  ParticleGraph graph;
};
template <class Linked>
Lattice lattice(int nx, int ny, int nz, const Linked& linked) {
  Lattice l;
  std::vector<std::array<Index, 2>> edges;
  const auto at = [&](int x, int y, int z) { return static_cast<Index>((z * ny + y) * nx + x); };
  for (int z = 0; z < nz; ++z)
    for (int y = 0; y < ny; ++y)
      for (int x = 0; x < nx; ++x) {
        l.rest.push_back(Vec3(x, y, z));
        if (x > 0 && linked(Vec3(x - 1, y, z), Vec3(x, y, z))) edges.push_back({at(x - 1, y, z), at(x, y, z)});
        if (y > 0 && linked(Vec3(x, y - 1, z), Vec3(x, y, z))) edges.push_back({at(x, y - 1, z), at(x, y, z)});
        if (z > 0 && linked(Vec3(x, y, z - 1), Vec3(x, y, z))) edges.push_back({at(x, y, z - 1), at(x, y, z)});
      }
  l.graph = makeGraph(l.rest, edges);
  return l;
}
Lattice solidLattice(int nx, int ny, int nz) {
  return lattice(nx, ny, nz, [](const Vec3&, const Vec3&) { return true; });
}
// Two fingers along x that are joined at their first column only: neighbours in space, far along the body.
Lattice twoFingers(int length) {
  return lattice(length, 4, 2, [](const Vec3& a, const Vec3& b) {
    const bool across = (a.y() < 1.5) != (b.y() < 1.5);
    return !across || a.x() < 0.5;
  });
}

// The part of a graph between the kept particles (ascending), renumbered.
ParticleGraph subgraph(const Points& rest, const ParticleGraph& parent, const std::vector<Index>& kept) {
  std::vector<std::array<Index, 2>> edges;
  Points kept_rest;
  for (Index a = 0; a < kept.size(); ++a) {
    kept_rest.push_back(rest[kept[a]]);
    for (Index b = 0; b < a; ++b)
      for (Index k = parent.offsets[kept[a]]; k < parent.offsets[kept[a] + 1]; ++k)
        if (parent.neighbours[k] == kept[b]) edges.push_back({b, a});
  }
  return makeGraph(kept_rest, edges);
}

void expectCover(const ClusterSet& set, std::size_t particles) {
  std::vector<double> share(particles, 0.0);
  for (Index c = 0; c < set.size(); ++c) {
    ASSERT_LT(set.offsets[c], set.offsets[c + 1]);
    for (Index k = set.offsets[c]; k < set.offsets[c + 1]; ++k) {
      ASSERT_LT(set.members[k], particles);
      if (k > set.offsets[c]) {
        EXPECT_LT(set.members[k - 1], set.members[k]);
      }
      EXPECT_GT(set.weights[k], 0.0);
      share[set.members[k]] += set.weights[k];
    }
  }
  for (double s : share) EXPECT_NEAR(s, 1.0, 1e-12);
}

bool sharesCluster(const ClusterSet& set, Index a, Index b) {
  for (Index c = 0; c < set.size(); ++c) {
    const auto begin = set.members.begin() + set.offsets[c], end = set.members.begin() + set.offsets[c + 1];
    if (std::binary_search(begin, end, a) && std::binary_search(begin, end, b)) return true;
  }
  return false;
}

TEST(Clusters, CoverEveryParticleWithSharesThatAddUpToOne) {
  const Lattice l = solidLattice(12, 5, 4);
  ClusterOptions options;
  expectCover(makeClusters(l.rest, l.graph, options), l.rest.size());
  EXPECT_GT(makeClusters(l.rest, l.graph, options).size(), 1u);
  options.kind = ClusterOptions::Kind::kOne;
  EXPECT_EQ(makeClusters(l.rest, l.graph, options).size(), 1u);
  expectCover(makeClusters(l.rest, l.graph, options), l.rest.size());
  options.kind = ClusterOptions::Kind::kGrid;
  options.grid = {{3, 2, 1}};
  expectCover(makeClusters(l.rest, l.graph, options), l.rest.size());
  EXPECT_EQ(makeClusters(l.rest, l.graph, options).size(), 6u);
  options.kind = ClusterOptions::Kind::kCount;
  for (int count : {1, 2, 7, 20}) {
    options.count = count;
    const ClusterSet set = makeClusters(l.rest, l.graph, options);
    EXPECT_EQ(set.size(), static_cast<Index>(count));
    expectCover(set, l.rest.size());
  }
}

TEST(Clusters, AreTheSameForTheSameInput) {
  const Lattice l = solidLattice(9, 7, 4);
  const ClusterSet a = makeClusters(l.rest, l.graph, {}), b = makeClusters(l.rest, l.graph, {});
  EXPECT_EQ(a.members, b.members);
  EXPECT_EQ(a.weights, b.weights);
}

TEST(Clusters, PartsNearInSpaceButFarAlongTheBodyDoNotShareOne) {
  const Lattice l = twoFingers(30);
  ClusterOptions options;
  std::vector<ClusterSet> sets{makeClusters(l.rest, l.graph, options)};
  options.kind = ClusterOptions::Kind::kGrid;
  options.grid = {{6, 1, 1}};
  sets.push_back(makeClusters(l.rest, l.graph, options));
  options.kind = ClusterOptions::Kind::kCount;
  options.count = 12;
  sets.push_back(makeClusters(l.rest, l.graph, options));
  const auto at = [](int x, int y) { return static_cast<Index>(y * 30 + x); };
  for (const ClusterSet& set : sets) {
    expectCover(set, l.rest.size());
    for (int x = 15; x < 30; ++x) EXPECT_FALSE(sharesCluster(set, at(x, 1), at(x, 2))) << "column " << x;
    EXPECT_TRUE(sharesCluster(set, at(20, 0), at(20, 1)));
  }
}

TEST(Clusters, PartsWithoutAnyLinkGetTheirOwn) {
  Points rest{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(5, 0, 0)};
  ParticleGraph graph = makeGraph(rest, {{0, 1}});
  for (int count : {1, 2, 3}) {
    ClusterOptions options;
    options.kind = ClusterOptions::Kind::kCount;
    options.count = std::max(2, count);
    expectCover(makeClusters(rest, graph, options), 3);
  }
}

TEST(SplitClusters, KeepsTheUntouchedAndCoversThePiece) {
  const Lattice l = solidLattice(24, 4, 3);
  const ClusterSet whole = makeClusters(l.rest, l.graph, {});
  ASSERT_GT(whole.size(), 3u);
  std::vector<Index> left;
  Points left_rest;
  for (Index i = 0; i < l.rest.size(); ++i)
    if (l.rest[i].x() < 13.5) {
      left.push_back(i);
      left_rest.push_back(l.rest[i]);
    }
  const ParticleGraph graph = subgraph(l.rest, l.graph, left);
  EXPECT_EQ(graph.size(), left.size());
  const PieceClusters piece = splitClusters(whole, left_rest, graph, left);
  expectCover(piece.clusters, left.size());
  EXPECT_GT(piece.kept, 0u);
  EXPECT_LT(piece.kept, piece.clusters.size());
  ASSERT_EQ(piece.origin.size(), piece.clusters.size());
  // A kept cluster has the members that it had.
  std::set<std::vector<Index>> before;
  for (Index c = 0; c < whole.size(); ++c)
    before.insert({whole.members.begin() + whole.offsets[c], whole.members.begin() + whole.offsets[c + 1]});
  Index same = 0;
  for (Index c = 0; c < piece.clusters.size(); ++c) {
    std::vector<Index> members;
    for (Index k = piece.clusters.offsets[c]; k < piece.clusters.offsets[c + 1]; ++k)
      members.push_back(left[piece.clusters.members[k]]);
    same += before.count(members) ? 1 : 0;
  }
  EXPECT_GE(same, piece.kept);
  // What is left of one has its members there, and their weights.
  for (Index c = 0; c < piece.clusters.size(); ++c)
    for (Index k = piece.clusters.offsets[c]; k < piece.clusters.offsets[c + 1]; ++k) {
      const Index parent = piece.origin[c];
      const auto begin = whole.members.begin() + whole.offsets[parent], end = whole.members.begin() + whole.offsets[parent + 1];
      const auto at = std::lower_bound(begin, end, left[piece.clusters.members[k]]);
      ASSERT_TRUE(at != end && *at == left[piece.clusters.members[k]]);
      EXPECT_EQ(piece.clusters.weights[k], whole.weights[at - whole.members.begin()]);
    }
}

TEST(SplitClusters, WhatHangsTogetherNoLongerIsTwoAndCopiesBelongToBoth) {
  // Four particles in a row, one cluster; cut in the middle of a cell: both inner ones are there twice.
  const Points rest{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(2, 0, 0), Vec3(3, 0, 0)};
  ClusterSet whole;
  whole.offsets = {0, 4};
  whole.members = {0, 1, 2, 3};
  whole.weights = {1, 1, 1, 1};
  whole.seeds = {1};
  whole.radii = {2.0};
  const Points cut_rest{rest[0], rest[1], rest[2], rest[3], rest[1], rest[2]};
  const ParticleGraph graph = makeGraph(cut_rest, {{0, 1}, {1, 5}, {4, 2}, {2, 3}});
  const PieceClusters pieces = splitClusters(whole, cut_rest, graph, {0, 1, 2, 3, 1, 2});
  expectCover(pieces.clusters, 6);
  EXPECT_EQ(pieces.clusters.offsets, (std::vector<Index>{0, 3, 6}));
  EXPECT_EQ(pieces.clusters.members, (std::vector<Index>{0, 1, 5, 2, 3, 4}));
  EXPECT_EQ(pieces.origin, (std::vector<Index>{0, 0}));
  EXPECT_EQ(pieces.kept, 0u);
}

// A strip that is slit along its middle from one end: its sides are joined at the other end alone.
TEST(SplitClusters, AWoundPartsAClusterThatHangsTogetherAroundIt) {
  const Lattice strip = twoFingers(20);
  const Lattice whole = solidLattice(20, 4, 2);
  ClusterOptions options;
  options.kind = ClusterOptions::Kind::kGrid;
  options.grid = {{4, 1, 1}};
  const ClusterSet clusters = makeClusters(whole.rest, whole.graph, options);
  std::vector<Index> same(whole.rest.size());
  for (Index i = 0; i < same.size(); ++i) same[i] = i;
  const PieceClusters slit = splitClusters(clusters, whole.rest, strip.graph, same);
  expectCover(slit.clusters, same.size());
  const auto at = [](int x, int y) { return static_cast<Index>(y * 20 + x); };
  for (int x = 12; x < 20; ++x) EXPECT_FALSE(sharesCluster(slit.clusters, at(x, 1), at(x, 2))) << x;
  EXPECT_TRUE(sharesCluster(slit.clusters, at(18, 0), at(18, 1)));
  const PieceClusters uncut = splitClusters(clusters, whole.rest, whole.graph, same);
  EXPECT_EQ(uncut.kept, clusters.size());
  EXPECT_EQ(uncut.clusters.members, clusters.members);
  EXPECT_EQ(uncut.clusters.weights, clusters.weights);
}

TEST(SplitClusters, SplittingAgainAndAgainDoesNotBreedClusters) {
  test::Random random(5);
  const Lattice l = solidLattice(10, 10, 4);
  ClusterSet clusters = makeClusters(l.rest, l.graph, {});
  const Index most = clusters.size();
  Points rest = l.rest;
  ParticleGraph graph = l.graph;
  while (rest.size() > 3) {
    const Vec3 normal = random.unit();
    std::vector<double> heights;
    for (const Vec3& p : rest) heights.push_back(normal.dot(p));
    std::vector<double> sorted = heights;
    std::sort(sorted.begin(), sorted.end());
    std::vector<Index> kept;
    Points kept_rest;
    for (Index i = 0; i < rest.size(); ++i)
      if (heights[i] >= sorted[sorted.size() / 4]) {
        kept.push_back(i);
        kept_rest.push_back(rest[i]);
      }
    if (kept.size() == rest.size()) break;
    graph = subgraph(rest, graph, kept);
    clusters = splitClusters(clusters, kept_rest, graph, kept).clusters;
    rest = kept_rest;
    expectCover(clusters, rest.size());
    EXPECT_LE(clusters.size(), 3 * most);
  }
  EXPECT_LE(rest.size(), 3u);
}

}  // namespace clusters_test
}  // namespace meshless
