#include "meshless_surgery/body/cavities.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <sstream>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/nearest.h"
#include "meshless_surgery/geometry/query/union_find.h"

namespace meshless {
namespace {

constexpr double kFillTime = 0.2;                           // [s] in which what fills a cavity comes in
constexpr double kLeastContent = 0.1, kMostContent = 10.0;  // of the volume at rest

// Which part of the surface each triangle is of: what hangs together by edges.
std::vector<Index> partsOf(const std::vector<Triangle>& triangles) {
  std::vector<std::array<Index, 3>> half;
  half.reserve(3 * triangles.size());
  for (Index t = 0; t < triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax(triangles[t][k], triangles[t][(k + 1) % 3]);
      half.push_back({a, b, t});
    }
  std::sort(half.begin(), half.end());
  UnionFind parts(triangles.size());
  for (std::size_t n = 1; n < half.size(); ++n)
    if (half[n][0] == half[n - 1][0] && half[n][1] == half[n - 1][1]) parts.join(half[n][2], half[n - 1][2]);
  std::vector<Index> part;
  for (Index t = 0; t < triangles.size(); ++t) part.push_back(parts.find(t));
  return part;
}

std::vector<Triangle> chosen(const std::vector<Triangle>& triangles, const std::vector<Index>& which) {
  std::vector<Triangle> some;
  for (const Index t : which) some.push_back(triangles[t]);
  return some;
}

// The walls of a cavity, outwards of it, with a lid over each hole: a fan about the middle of its rim.
struct Closed {
  std::vector<Triangle> triangles;       // vertices from the mesh's count on are middles
  std::vector<std::vector<Index>> rims;  // of each lid
};

Closed closedWalls(const TriangleMesh& mesh, std::uint32_t patch) {
  Closed closed;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (mesh.patchOf(t) == patch)
      closed.triangles.push_back({mesh.triangles[t][0], mesh.triangles[t][2], mesh.triangles[t][1]});
  std::map<std::array<Index, 2>, int> edges;  // how often from the lower to the higher, less the other way round
  for (const Triangle& t : closed.triangles)
    for (int k = 0; k < 3; ++k) {
      const Index a = t[k], b = t[(k + 1) % 3];
      edges[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
    }
  UnionFind rims(mesh.vertices.size());
  for (const auto& [edge, count] : edges)
    if (count != 0) rims.join(edge[0], edge[1]);
  std::map<Index, Index> lid_of;  // of a rim
  for (const auto& [edge, count] : edges) {
    if (count == 0) continue;
    const Index lid = lid_of.emplace(rims.find(edge[0]), static_cast<Index>(lid_of.size())).first->second;
    if (lid == closed.rims.size()) closed.rims.emplace_back();
    closed.rims[lid].insert(closed.rims[lid].end(), edge.begin(), edge.end());
    const Index middle = static_cast<Index>(mesh.vertices.size()) + lid;
    for (int n = 0; n < std::abs(count); ++n)
      closed.triangles.push_back(count > 0 ? Triangle{edge[1], edge[0], middle} : Triangle{edge[0], edge[1], middle});
  }
  for (std::vector<Index>& rim : closed.rims) {
    std::sort(rim.begin(), rim.end());
    rim.erase(std::unique(rim.begin(), rim.end()), rim.end());
  }
  return closed;
}

double volumeWithin(const TriangleMesh& mesh, const Closed& closed) {
  Points places = mesh.vertices;
  for (const std::vector<Index>& rim : closed.rims) {
    places.push_back(Vec3::Zero());
    for (const Index v : rim) places.back() += mesh.vertices[v] / static_cast<double>(rim.size());
  }
  return signedVolume(places, closed.triangles);
}

// Vertices of walls, bound as those of a surface are, and then the middles of lids.
class WallBinder {
 public:
  WallBinder(const SurfaceBinding& surface, std::size_t vertices) : surface_(surface), number_(vertices, kNoIndex) {
    walls_.offsets.push_back(0);
  }

  /// Vertices from kMiddle on are middles.
  std::vector<Triangle> add(const Closed& closed) {
    std::vector<Triangle> triangles = closed.triangles;
    const Index vertices = static_cast<Index>(number_.size()), middles = static_cast<Index>(rims_.size());
    for (Triangle& t : triangles)
      for (Index& v : t) v = v < vertices ? numberOf(v) : kMiddle + middles + (v - vertices);
    for (std::vector<Index> rim : closed.rims) {
      for (Index& v : rim) v = numberOf(v);
      rims_.push_back(std::move(rim));
    }
    return triangles;
  }

  SurfaceBinding finish(const Points& rest, double spacing, std::vector<Cavities::Shell>& shells) {
    // A middle is the mean of its rim, however many particles carry that.
    SurfaceBinding binding = fewerCarriers(walls_, rest, spacing);
    const SurfaceBinding walls = binding;
    for (const std::vector<Index>& rim : rims_) {
      std::map<Index, double> weights;
      const double share = 1.0 / static_cast<double>(rim.size());
      for (const Index v : rim)
        for (Index k = walls.offsets[v]; k < walls.offsets[v + 1]; ++k)
          weights[walls.carriers[k]] += share * walls.weights[k];
      for (const auto& [particle, weight] : weights) {
        binding.carriers.push_back(particle);
        binding.weights.push_back(weight);
      }
      binding.offsets.push_back(static_cast<Index>(binding.carriers.size()));
    }
    for (Cavities::Shell& shell : shells)
      for (Triangle& t : shell.triangles)
        for (Index& v : t)
          if (v >= kMiddle) v = walls.size() + (v - kMiddle);
    return binding;
  }

 private:
  static constexpr Index kMiddle = Index{1} << 31;

  Index numberOf(Index v) {
    if (number_[v] != kNoIndex) return number_[v];
    number_[v] = walls_.size();
    for (Index k = surface_.offsets[v]; k < surface_.offsets[v + 1]; ++k) {
      walls_.carriers.push_back(surface_.carriers[k]);
      walls_.weights.push_back(surface_.weights[k]);
    }
    walls_.offsets.push_back(static_cast<Index>(walls_.carriers.size()));
    return number_[v];
  }

  const SurfaceBinding& surface_;
  std::vector<Index> number_;
  SurfaceBinding walls_;
  std::vector<std::vector<Index>> rims_;
};

std::set<std::uint32_t> cavityPatches(const TriangleMesh& mesh) {
  std::set<std::uint32_t> patches;
  for (const std::uint32_t patch : mesh.patches)
    if (isCavityPatch(patch)) patches.insert(patch);
  return patches;
}

// 0..1 of what is to come in.
double filledShare(const FilledCavity& cavity) {
  return cavity.filled_for < kFillTime ? 0.5 - 0.5 * std::cos(M_PI * cavity.filled_for / kFillTime) : 1.0;
}

}  // namespace

Status CavityFill::validate() const {
  const auto outOfRange = [](const std::string& key, double value, const std::string& accepted) {
    std::ostringstream text;
    text << "cavities: " << key << " is " << value << "; accepted: " << accepted;
    return Error{ErrorCode::kInvalidArgument, text.str()};
  };
  if (!(pressure >= 0.0 && pressure <= 1e6)) return outOfRange("pressure", pressure, "0 to 1e6 Pa");
  if (!(volume >= 0.0 && volume <= 1e3)) return outOfRange("volume", volume, "above 0 to 1e3 m^3");
  if (!(compliance >= 0.0 && compliance <= 1.0)) return outOfRange("compliance", compliance, "above 0 to 1 m^3/Pa");
  if (!(leak > 0.0 && leak <= 3600.0)) return outOfRange("leak", leak, "above 0 to 3600 s");
  return Done{};
}

std::vector<std::vector<Index>> cavitiesOf(const TriangleMesh& mesh) {
  const std::vector<Index> part = partsOf(mesh.triangles);
  std::map<Index, std::vector<Index>> triangles;  // a part's number is its first triangle
  for (Index t = 0; t < part.size(); ++t) triangles[part[t]].push_back(t);
  std::vector<std::vector<Index>> cavities;
  if (triangles.size() < 2) return cavities;
  for (auto& [first, all] : triangles)
    if (signedVolume(mesh.vertices, chosen(mesh.triangles, all)) < 0.0) cavities.push_back(std::move(all));
  return cavities;
}

std::vector<double> markCavities(TriangleMesh& mesh) {
  std::vector<double> volumes;
  mesh.patches.resize(mesh.triangles.size(), kOuterPatch);
  for (const std::vector<Index>& cavity : cavitiesOf(mesh)) {
    for (const Index t : cavity) mesh.patches[t] = kCavityPatch + static_cast<std::uint32_t>(volumes.size());
    volumes.push_back(-signedVolume(mesh.vertices, chosen(mesh.triangles, cavity)));
  }
  return volumes;
}

bool markCavities(const TriangleMesh& visual, TriangleMesh& collision) {
  const std::vector<std::vector<Index>> cavities = cavitiesOf(collision);
  const std::set<std::uint32_t> patches = cavityPatches(visual);
  if (cavities.size() != patches.size()) return false;
  Points walls;
  std::vector<std::uint32_t> patch_of;
  for (std::size_t t = 0; t < visual.triangles.size(); ++t)
    if (isCavityPatch(visual.patches[t]))
      for (const Index v : visual.triangles[t]) {
        walls.push_back(visual.vertices[v]);
        patch_of.push_back(visual.patches[t]);
      }
  const NearestPoints nearest(walls);
  std::vector<std::uint32_t> marks(collision.triangles.size(), kOuterPatch);
  std::set<std::uint32_t> found;
  for (const std::vector<Index>& cavity : cavities) {
    std::map<std::uint32_t, std::size_t> votes;
    for (const Index t : cavity)
      ++votes[patch_of[nearest.nearest(collision.vertices[collision.triangles[t][0]], 1)[0]]];
    const auto most =
        std::max_element(votes.begin(), votes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
    for (const Index t : cavity) marks[t] = most->first;
    found.insert(most->first);
  }
  if (found != patches) return false;
  collision.patches = std::move(marks);
  return true;
}

void makeCavities(BodyModel& model) {
  model.cavities.reset();
  const std::set<std::uint32_t> made = cavityPatches(model.surface);
  if (made.empty()) return;
  const std::vector<Index> part = partsOf(model.surface.triangles);
  std::map<Index, std::vector<Index>> triangles;
  std::set<Index> outside;  // parts with faces that no cavity and no blade has made
  for (Index t = 0; t < part.size(); ++t) {
    triangles[part[t]].push_back(t);
    if (model.surface.patches[t] == kOuterPatch) outside.insert(part[t]);
  }
  // A fold of the wall that a blade has taken off, with no face of the outside, is tissue and encloses nothing.
  std::set<std::uint32_t> patches, open;
  for (const auto& [first, all] : triangles) {
    const bool is_outside = outside.count(first) > 0;
    if (!is_outside && signedVolume(model.surface.vertices, chosen(model.surface.triangles, all)) > 0.0) continue;
    for (const Index t : all) {
      if (!isCavityPatch(model.surface.patches[t])) continue;
      patches.insert(model.surface.patches[t]);
      if (is_outside) open.insert(model.surface.patches[t]);
    }
  }
  if (patches.empty()) return;

  const bool by_contact = model.collision && cavityPatches(model.collision->mesh) == made;
  const TriangleMesh& carrier = by_contact ? model.collision->mesh : model.surface;
  WallBinder binder(by_contact ? model.collision->binding : model.binding, carrier.vertices.size());
  auto cavities = std::make_shared<Cavities>();
  for (const std::uint32_t patch : patches) {
    const Closed walls = closedWalls(carrier, patch);
    Cavities::Shell shell;
    shell.patch = patch;
    shell.open = open.count(patch) > 0;
    const double carried = volumeWithin(carrier, walls);
    shell.rest_volume = by_contact ? volumeWithin(model.surface, closedWalls(model.surface, patch)) : carried;
    const double share = shell.rest_volume / carried;
    if (share > 0.5 && share < 2.0) shell.share = share;
    shell.triangles = binder.add(walls);
    cavities->shells.push_back(std::move(shell));
  }
  cavities->binding = binder.finish(model.rest, model.spacing, cavities->shells);
  model.cavities = std::move(cavities);
}

const Cavities::Shell* shellOf(const BodyModel& model, std::uint32_t patch) {
  if (!model.cavities) return nullptr;
  for (const Cavities::Shell& shell : model.cavities->shells)
    if (shell.patch == patch) return &shell;
  return nullptr;
}

Result<std::vector<FilledCavity>> filledCavities(const BodyModel& model, const CavityFill& fill) {
  std::vector<FilledCavity> filled;
  if (fill.empty() || !model.cavities) return filled;
  double all = 0.0;
  for (const Cavities::Shell& shell : model.cavities->shells) all += shell.rest_volume;
  const double wanted = fill.volume > 0.0 ? fill.volume / all : 1.0;
  if (!(wanted >= kLeastContent && wanted <= kMostContent)) {
    std::ostringstream text;
    text << "cavities: volume is " << 1e6 * fill.volume << " ml; accepted: " << 1e6 * kLeastContent * all << " to "
         << 1e6 * kMostContent * all << " ml, for they hold " << 1e6 * all << " ml at rest";
    return Error{ErrorCode::kInvalidArgument, text.str()};
  }
  for (const Cavities::Shell& shell : model.cavities->shells) {
    FilledCavity cavity;
    cavity.patch = shell.patch;
    cavity.leak = fill.leak;
    if (fill.kind == CavityFill::Kind::kPressure) {
      cavity.pressure = fill.pressure;
    } else {
      cavity.content = wanted * shell.rest_volume;
      cavity.compliance = fill.compliance > 0.0 ? fill.compliance : kCavityCompliance * shell.rest_volume;
    }
    filled.push_back(cavity);
  }
  return filled;
}

std::vector<FilledCavity> inheritedCavities(const std::vector<FilledCavity>& parent, const BodyModel& piece,
                                            const Points& positions) {
  std::vector<FilledCavity> filled;
  for (FilledCavity cavity : parent) {
    const Cavities::Shell* shell = shellOf(piece, cavity.patch);
    if (!shell) continue;
    if (shell->open) {
      Points places;
      carriedPlaces(piece.cavities->binding, positions, places);
      cavity.content = shell->share * signedVolume(places, shell->triangles);
      if (!(cavity.open_for > 0.0)) cavity.pressure = cavity.acting;
      cavity.compliance = 0.0;
      cavity.filled_for = kFillTime;
    }
    filled.push_back(cavity);
  }
  return filled;
}

void pressCavities(const BodyModel& model, double factor, double h, BodyState& state, StepScratch& scratch) {
  const Points& before = scratch.previous;
  Points& x = state.positions;
  Points& pull = scratch.cavity_pull;
  carriedPlaces(model.cavities->binding, before, scratch.cavity);
  for (FilledCavity& cavity : state.cavities) {
    const Cavities::Shell& shell = *shellOf(model, cavity.patch);
    pull.assign(x.size(), Vec3::Zero());
    addToParticles(model.cavities->binding, volumeGradient(scratch.cavity, shell.triangles), pull);
    if (cavity.filled_for < kFillTime) cavity.filled_for += h;
    if (shell.open) cavity.open_for += h;
    double volume = signedVolume(scratch.cavity, shell.triangles), mobility = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (pull[i].isZero(0.0)) continue;
      volume += pull[i].dot(x[i] - before[i]);
      if (!model.fixed[i]) mobility += pull[i].squaredNorm() / model.masses[i];
    }
    volume *= shell.share;  // where the substep leads without pressure
    mobility *= factor * h * h * shell.share;
    if (!(mobility > 0.0)) continue;
    if (cavity.compliance > 0.0) {
      const double content = shell.rest_volume + filledShare(cavity) * (cavity.content - shell.rest_volume);
      cavity.acting = (content - volume) / (cavity.compliance + mobility);
    } else {
      // A wall that gives way without end is held. What is open lets out, and so takes no more in.
      const double most = shell.open ? cavity.content : kMostContent * shell.rest_volume;
      const double wanted = cavity.pressure * filledShare(cavity) * std::max(0.0, 1.0 - cavity.open_for / cavity.leak);
      const double bound = (most - volume) / mobility;
      cavity.acting = wanted > 0.0 ? std::min(wanted, std::max(0.0, bound)) : std::max(wanted, std::min(0.0, bound));
    }
    const double rate = factor * h * cavity.acting;
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (model.fixed[i] || pull[i].isZero(0.0)) continue;
      const Vec3 faster = rate / model.masses[i] * pull[i];
      state.velocities[i] += faster;
      x[i] += h * faster;
    }
  }
}

std::vector<BodyMeasures::Cavity> measureCavities(const BodyModel& model, const std::vector<FilledCavity>& filled,
                                                  const Points& positions) {
  std::vector<BodyMeasures::Cavity> measures;
  if (!model.cavities) return measures;
  Points places;
  carriedPlaces(model.cavities->binding, positions, places);
  for (const Cavities::Shell& shell : model.cavities->shells) {
    measures.push_back({shell.share * signedVolume(places, shell.triangles), 0.0, shell.open});
    for (const FilledCavity& cavity : filled)
      if (cavity.patch == shell.patch) measures.back().pressure = cavity.acting;
  }
  return measures;
}

}  // namespace meshless
