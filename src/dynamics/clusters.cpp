#include "meshless_surgery/dynamics/clusters.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>
#include <utility>

#include "meshless_surgery/base/compressed_rows.h"

namespace meshless {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr Index kOneClusterBelow = 65;     // particles; smaller bodies are one cluster by themselves
constexpr double kAutoRadiusEdges = 3.0;   // reach of an automatic cluster in mean graph edges ...
constexpr double kAutoRadiusOfSize = 0.2;  // ... or as a share of the bounds' diagonal, whichever is more
constexpr double kLeastShare = 0.02;       // of a member at the border of a cluster

// A cluster under construction; `share` is not yet normalised over the clusters of a particle.
struct Draft {
  Index seed = 0;
  std::vector<std::pair<Index, double>> members;  // particle, share
};

double shareAt(double distance, double radius) {
  // Flat in the middle: a peaked share makes a cluster act as if it were small, and small clusters are soft.
  const double s = radius > 0.0 ? std::min(1.0, distance / radius) : 0.0;
  return std::max(kLeastShare, 1.0 - s * s);
}

Draft grow(GraphSearch& search, Index seed, double radius) {
  Draft draft;
  draft.seed = seed;
  for (const Reached& r : search.from(seed, radius))
    draft.members.emplace_back(r.particle, shareAt(r.distance, radius));
  std::sort(draft.members.begin(), draft.members.end());
  return draft;
}

ClusterSet assemble(std::vector<Draft> drafts, const ParticleGraph& graph) {
  std::vector<double> total(graph.size(), 0.0);
  std::vector<char> within(graph.size(), 0);
  GraphSearch search(graph);
  for (const Draft& d : drafts)
    for (const auto& [i, share] : d.members) total[i] += share;
  ClusterSet set;
  set.offsets.push_back(0);
  for (const Draft& d : drafts) {
    for (const auto& [i, share] : d.members) {
      set.members.push_back(i);
      set.weights.push_back(share / total[i]);
    }
    set.offsets.push_back(static_cast<Index>(set.members.size()));
    set.seeds.push_back(d.seed);
    for (const auto& member : d.members) within[member.first] = 1;
    const std::vector<Reached> reached = search.from(d.seed, kInfinity, within);
    for (const auto& member : d.members) within[member.first] = 0;
    // One that does not hang together keeps to itself whatever is cut.
    set.radii.push_back(reached.size() == d.members.size() ? reached.back().distance : kInfinity);
  }
  return set;
}

Index nearestTo(const Points& rest, const Vec3& place) {
  Index best = 0;
  for (Index i = 1; i < rest.size(); ++i)
    if ((rest[i] - place).squaredNorm() < (rest[best] - place).squaredNorm()) best = i;
  return best;
}

Vec3 meanOf(const Points& rest) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& p : rest) sum += p - rest[0];
  return rest[0] + sum / static_cast<double>(rest.size());
}

ClusterSet oneCluster(const Points& rest, const ParticleGraph& graph) {
  Draft draft;
  draft.seed = nearestTo(rest, meanOf(rest));
  for (Index i = 0; i < rest.size(); ++i) draft.members.emplace_back(i, 1.0);
  return assemble({draft}, graph);
}

// Seeds that are farthest from each other along the body, until `count` of them or until every particle is within
// `cover` of one. Returns them with the reach that covers the body.
struct SeedSet {
  std::vector<Index> seeds;
  double cover = 0.0;  // [m] largest distance of a particle from its nearest seed
};
SeedSet farthestSeeds(const Points& rest, const ParticleGraph& graph, std::size_t count, double cover) {
  std::vector<double> distance(rest.size(), kInfinity);
  SeedSet set;
  // The first is the particle farthest from the middle: ends of a body, not its middle, are what a second seed misses.
  const Vec3 middle = meanOf(rest);
  Index next = 0;
  for (Index i = 1; i < rest.size(); ++i)
    if ((rest[i] - middle).squaredNorm() > (rest[next] - middle).squaredNorm()) next = i;
  while (true) {
    set.seeds.push_back(next);
    lowerDistances(graph, next, kInfinity, {}, distance);
    next = static_cast<Index>(std::max_element(distance.begin(), distance.end()) - distance.begin());
    set.cover = distance[next];
    // Parts without any path to a seed get one however many were asked for: every particle needs a cluster.
    if (set.cover == kInfinity) continue;
    if (set.seeds.size() >= count || set.cover <= cover) return set;
  }
}

ClusterSet clustersAround(const SeedSet& set, const ParticleGraph& graph, double radius) {
  GraphSearch search(graph);
  std::vector<Draft> drafts;
  for (Index seed : set.seeds) drafts.push_back(grow(search, seed, radius));
  return assemble(std::move(drafts), graph);
}

ClusterSet gridClusters(const Points& rest, const ParticleGraph& graph, const ClusterOptions& options) {
  Box bounds;
  for (const Vec3& p : rest) bounds.extend(p);
  const Vec3 cell = (bounds.max - bounds.min).cwiseQuotient(Vec3(options.grid[0], options.grid[1], options.grid[2]));
  std::vector<Draft> drafts;
  std::vector<int> part(rest.size(), -1);
  for (int z = 0; z < options.grid[2]; ++z)
    for (int y = 0; y < options.grid[1]; ++y)
      for (int x = 0; x < options.grid[0]; ++x) {
        const Vec3 low = bounds.min + cell.cwiseProduct(Vec3(x, y, z));
        const Vec3 centre = low + 0.5 * cell;
        const Vec3 reach = cell * (0.5 + options.overlap) + Vec3::Constant(1e-9 * bounds.diagonal());
        const Vec3 core = cell * 0.5 + Vec3::Constant(1e-9 * bounds.diagonal());
        std::vector<Index> inside;
        for (Index i = 0; i < rest.size(); ++i)
          if (((rest[i] - centre).cwiseAbs().array() <= reach.array()).all()) inside.push_back(i);
        // Parts of the cell that hang together along the body are clusters of their own.
        for (Index i : inside) part[i] = 0;
        int parts = 0;
        for (Index first : inside) {
          if (part[first] != 0) continue;
          part[first] = ++parts;
          Draft draft;
          bool has_core = false;
          std::vector<Index> stack{first};
          while (!stack.empty()) {
            const Index i = stack.back();
            stack.pop_back();
            const Vec3 away = (rest[i] - centre).cwiseAbs();
            has_core = has_core || (away.array() <= core.array()).all();
            const double relative = (away.array() / reach.array()).maxCoeff();
            draft.members.emplace_back(i, shareAt(relative, 1.0));
            for (Index k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k)
              if (part[graph.neighbours[k]] == 0) {
                part[graph.neighbours[k]] = parts;
                stack.push_back(graph.neighbours[k]);
              }
          }
          if (!has_core) continue;
          std::sort(draft.members.begin(), draft.members.end());
          draft.seed = draft.members[0].first;
          for (const auto& member : draft.members)
            if ((rest[member.first] - centre).squaredNorm() < (rest[draft.seed] - centre).squaredNorm())
              draft.seed = member.first;
          drafts.push_back(std::move(draft));
        }
        for (Index i : inside) part[i] = -1;
      }
  return assemble(std::move(drafts), graph);
}

double meanLength(const ParticleGraph& graph) {
  if (graph.lengths.empty()) return 0.0;
  double sum = 0.0;
  for (double l : graph.lengths) sum += l;
  return sum / static_cast<double>(graph.lengths.size());
}

}  // namespace

ParticleGraph makeGraph(const Points& rest, std::vector<std::array<Index, 2>> edges) {
  const std::size_t given = edges.size();
  edges.reserve(2 * given);
  for (std::size_t e = 0; e < given; ++e) edges.push_back({edges[e][1], edges[e][0]});
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  ParticleGraph graph;
  graph.offsets.assign(rest.size() + 1, 0);
  for (const auto& e : edges)
    if (e[0] != e[1]) {
      ++graph.offsets[e[0] + 1];
      graph.neighbours.push_back(e[1]);
      graph.lengths.push_back((rest[e[0]] - rest[e[1]]).norm());
    }
  for (std::size_t i = 0; i < rest.size(); ++i) graph.offsets[i + 1] += graph.offsets[i];
  return graph;
}

std::vector<Reached> lowerDistances(const ParticleGraph& graph, Index start, double radius,
                                    const std::vector<char>& allowed, std::vector<double>& distances) {
  using Entry = std::pair<double, Index>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue;
  std::vector<Reached> reached;
  distances[start] = 0.0;
  queue.push({0.0, start});
  while (!queue.empty()) {
    const auto [d, i] = queue.top();
    queue.pop();
    if (d > distances[i]) continue;
    reached.push_back({i, d});
    for (Index k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k) {
      const Index j = graph.neighbours[k];
      const double there = d + graph.lengths[k];
      if (there > radius || !(there < distances[j]) || !(allowed.empty() || allowed[j])) continue;
      distances[j] = there;
      queue.push({there, j});
    }
  }
  return reached;
}

std::vector<Reached> GraphSearch::from(Index start, double radius, const std::vector<char>& allowed) {
  std::vector<Reached> reached = lowerDistances(graph_, start, radius, allowed, distances_);
  for (const Reached& r : reached) distances_[r.particle] = kInfinity;
  return reached;
}

ClusterSet makeClusters(const Points& rest, const ParticleGraph& graph, const ClusterOptions& options) {
  const Index particles = graph.size();
  switch (options.kind) {
    case ClusterOptions::Kind::kOne:
      return oneCluster(rest, graph);
    case ClusterOptions::Kind::kGrid:
      return gridClusters(rest, graph, options);
    case ClusterOptions::Kind::kCount: {
      if (options.count <= 1) return oneCluster(rest, graph);
      const SeedSet set = farthestSeeds(rest, graph, static_cast<std::size_t>(options.count), 0.0);
      return clustersAround(set, graph, (1.0 + options.overlap) * set.cover + 1e-12);
    }
    case ClusterOptions::Kind::kCells:
    case ClusterOptions::Kind::kAuto:
      break;
  }
  if (particles < kOneClusterBelow) return oneCluster(rest, graph);
  Box bounds;
  for (const Vec3& p : rest) bounds.extend(p);
  const double cover = std::max(kAutoRadiusEdges * meanLength(graph), kAutoRadiusOfSize * bounds.diagonal());
  const SeedSet set = farthestSeeds(rest, graph, particles, cover);
  return clustersAround(set, graph, (1.2 + options.overlap) * cover);
}

ClusterSet clustersOfCells(const std::vector<std::array<Index, 8>>& cells, const std::vector<double>& cell_masses,
                           const std::vector<double>& particle_masses) {
  ClusterSet set;
  set.offsets.push_back(0);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    std::array<Index, 8> members = cells[c];
    std::sort(members.begin(), members.end());
    for (Index i : members) {
      set.members.push_back(i);
      set.weights.push_back(cell_masses[c] / 8.0 / particle_masses[i]);
    }
    set.offsets.push_back(static_cast<Index>(set.members.size()));
    set.seeds.push_back(members[0]);
    set.radii.push_back(kInfinity);
  }
  return set;
}

PieceClusters splitClusters(const ClusterSet& parent, const Points& piece_rest, const ParticleGraph& piece_graph,
                            const std::vector<Index>& parent_particle) {
  std::vector<Index> offsets, copies;  // of each of the parent's particles, those that the piece has of it
  Index particles = 0;
  for (const Index i : parent.members) particles = std::max(particles, i + 1);
  compressRows(
      particles,
      [&](const auto& visit) {
        for (Index i = 0; i < parent_particle.size(); ++i) visit(parent_particle[i], i);
      },
      offsets, copies);
  PieceClusters piece;
  piece.clusters.offsets.push_back(0);
  GraphSearch search(piece_graph);
  std::vector<char> left(parent_particle.size(), 0);
  std::vector<std::pair<Index, double>> members;  // of one of the parent's
  for (Index c = 0; c < parent.size(); ++c) {
    members.clear();
    Vec3 middle = Vec3::Zero();
    for (Index k = parent.offsets[c]; k < parent.offsets[c + 1]; ++k)
      for (Index n = offsets[parent.members[k]]; n < offsets[parent.members[k] + 1]; ++n) {
        members.emplace_back(copies[n], parent.weights[k]);
        left[copies[n]] = 1;
        middle += piece_rest[copies[n]];
      }
    std::sort(members.begin(), members.end());
    middle /= static_cast<double>(members.size());
    // From its seed where that is there, else from what is left around its middle.
    if (const Index seed = parent.seeds[c]; seed < particles && offsets[seed] < offsets[seed + 1])
      middle = piece_rest[copies[offsets[seed]]];
    std::size_t of_it = 0, parts = 0;
    while (of_it < members.size()) {
      Index seed = kNoIndex;
      for (const auto& [i, weight] : members)
        if (left[i] &&
            (seed == kNoIndex || (piece_rest[i] - middle).squaredNorm() < (piece_rest[seed] - middle).squaredNorm()))
          seed = i;
      const std::vector<Reached> reached = search.from(seed, parent.radii[c] * (1.0 + 1e-9), left);
      for (const Reached& r : reached) left[r.particle] = 2;
      for (const auto& [i, weight] : members) {
        if (left[i] != 2) continue;
        piece.clusters.members.push_back(i);
        piece.clusters.weights.push_back(weight);
        left[i] = 0;
      }
      piece.clusters.offsets.push_back(static_cast<Index>(piece.clusters.members.size()));
      piece.clusters.seeds.push_back(seed);
      piece.clusters.radii.push_back(parent.radii[c]);
      piece.origin.push_back(c);
      of_it += reached.size();
      ++parts;
    }
    piece.kept += parts == 1 && members.size() == parent.offsets[c + 1] - parent.offsets[c];
  }
  return piece;
}

}  // namespace meshless
