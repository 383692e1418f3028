// Sequences of four blades. Wound faces lie on each other, or have opened in between. The environment variable
// MESHLESS_SURGERY_INCISE_FUZZ gives the number of further sequences on each shape.
#include <cstdlib>
#include <map>

#include <gtest/gtest.h>

#include "geometry/incise_laws.h"

namespace meshless {
namespace incise_sequence_test {

struct Tally {
  int sequences = 0, blades = 0, opened = 0, missed = 0, refused = 0, apart = 0;
  std::map<std::string, int> reasons;
  std::map<std::string, std::array<int, 2>> kinds;  // tried, refused
};

Blade extended(Blade blade, test::Random& random) {
  if (random.integer(0, 1) == 0) {
    blade.origin += random.uniform(-0.9, 0.9) * blade.length * blade.x_axis;
  } else {
    blade.depth *= random.uniform(1.1, 2.0);
  }
  return blade;
}

Blade crossing(const Blade& blade, test::Random& random) {
  const Vec3 middle = blade.origin + random.uniform(0.2, 0.8) * blade.length * blade.x_axis;
  const Vec3 along = Eigen::AngleAxisd(random.uniform(0.3, 2.8), blade.y_axis) * blade.x_axis;
  return shapes::bladeAt(middle, -blade.y_axis + 0.3 * random.unit(), along, random.uniform(0.4, 1.5) * blade.length,
                         random.uniform(0.4, 1.5) * blade.depth);
}

/// Starts in the earlier blade and leads away from it.
Blade branching(const Blade& blade, test::Random& random) {
  Blade other = blade;
  other.x_axis = (Eigen::AngleAxisd(random.uniform(0.5, 2.6), blade.y_axis) * blade.x_axis).normalized();
  other.origin = blade.origin + random.uniform(0.1, 0.9) * blade.length * blade.x_axis;
  if (random.integer(0, 1) == 0) other.origin -= 0.05 * blade.length * other.x_axis;
  other.depth *= random.uniform(0.5, 1.4);
  return other;
}

/// From inside the earlier blade's opening, below the surface.
Blade fromInside(const Blade& blade, test::Random& random) {
  const Vec3 start = blade.origin + random.uniform(0.2, 0.8) * blade.length * blade.x_axis -
                     random.uniform(0.2, 0.8) * blade.depth * blade.y_axis;
  const Vec3 normal = blade.plane().normal;
  const Vec3 down = (random.integer(0, 1) == 0 ? 1.0 : -1.0) * normal + 0.5 * random.unit();
  return shapes::bladeAt(start - 0.02 * blade.depth * down, down, random.unit(),
                         random.uniform(0.1, 0.6) * blade.length, random.uniform(0.1, 0.8) * blade.depth);
}

void runSequence(const TriangleMesh& start, unsigned seed, double edge, Tally& tally) {
  test::Random random(seed);
  TriangleMesh mesh = start;
  const bool opens = seed % 2 == 1;
  Blade last;
  bool fresh = true;
  ++tally.sequences;
  for (int step = 0; step < 4; ++step) {
    Blade blade = shapes::anyBlade(mesh, random);
    std::string kind = "any";
    if (!fresh) {
      switch (random.integer(0, 5)) {
        case 0:
          blade = last, kind = "repeated";
          break;
        case 1:
          blade = extended(last, random), kind = "extended";
          break;
        case 2:
          blade = crossing(last, random), kind = "crossing";
          break;
        case 3:
          blade = branching(last, random), kind = "branching";
          break;
        case 4:
          blade = fromInside(last, random), kind = "from inside";
          break;
        default:
          break;
      }
    }
    InciseOptions options;
    options.patch = static_cast<std::uint32_t>(step + 1);
    const TriangleMesh before = mesh;
    Result<Incision> cut = incise(mesh, blade, options);
    ++tally.blades;
    ++tally.kinds[kind + (opens ? ", opened" : "")][0];
    ASSERT_EQ(mesh.vertices, before.vertices);
    if (!cut) {
      if (cut.error().code == ErrorCode::kMissed) {
        ++tally.missed;
      } else {
        ++tally.refused;
        ++tally.reasons[cut.error().detail.substr(0, 60)];
        ++tally.kinds[kind + (opens ? ", opened" : "")][1];
        if (std::getenv("MESHLESS_SURGERY_INCISE_TALK"))
          std::printf("seed %u step %d %s: %s\n", seed, step, kind.c_str(), cut.error().detail.c_str());
      }
      continue;
    }
    ++tally.opened;
    tally.apart += cut->pieces.size() > 1;
    ASSERT_TRUE(laws::incisionObeysLaws(mesh, blade, options, *cut, fresh))
        << "seed " << seed << " step " << step << " " << kind;
    for (const IncisedPiece& piece : cut->pieces)
      ASSERT_EQ(laws::eulerCharacteristic(piece.mesh) % 2, 0) << "seed " << seed << " step " << step;
    if (opens) shapes::spread(cut->pieces[0], blade, random.uniform(0.02, 0.3) * edge);
    mesh = cut->pieces[0].mesh;
    last = blade;
    fresh = false;
  }
}

Tally runSequences(const TriangleMesh& mesh, int count, unsigned first_seed) {
  if (const char* more = std::getenv("MESHLESS_SURGERY_INCISE_FUZZ")) count += std::atoi(more);
  Tally tally;
  const double edge = meanEdgeLength(mesh);
  for (int i = 0; i < count && !testing::Test::HasFatalFailure(); ++i)
    runSequence(mesh, first_seed + static_cast<unsigned>(i), edge, tally);
  std::printf("%d sequences: %d blades, %d opened, %d missed, %d refused, %d fell apart\n", tally.sequences,
              tally.blades, tally.opened, tally.missed, tally.refused, tally.apart);
  for (const auto& [reason, times] : tally.reasons) std::printf("  %d x %s\n", times, reason.c_str());
  for (const auto& [kind, times] : tally.kinds)
    std::printf("  %s: %d of %d refused\n", kind.c_str(), times[1], times[0]);
  return tally;
}

void expectFewRefused(const Tally& tally) {
  EXPECT_LE(tally.refused, tally.blades / 20);
  EXPECT_GE(tally.opened, tally.blades / 2);
  EXPECT_GT(tally.apart, 0);
}

/// A box of unit cells; blades on the cells' faces part neighbours from each other.
class Cells {
 public:
  explicit Cells(int n) : n_(n), parted_(3 * n * n * n, false) {}

  void part(int axis, int plane, const std::array<int, 3>& low, const std::array<int, 3>& high) {
    std::array<int, 3> c = low;
    for (c[(axis + 1) % 3] = low[(axis + 1) % 3]; c[(axis + 1) % 3] < high[(axis + 1) % 3]; ++c[(axis + 1) % 3])
      for (c[(axis + 2) % 3] = low[(axis + 2) % 3]; c[(axis + 2) % 3] < high[(axis + 2) % 3]; ++c[(axis + 2) % 3]) {
        c[axis] = plane - 1;
        parted_[3 * at(c) + axis] = true;
      }
  }
  bool parted(int axis, std::array<int, 3> c) const { return parted_[3 * at(c) + axis]; }
  /// Cells of each connected part, the largest first.
  std::vector<int> parts() const {
    std::vector<int> sizes;
    std::vector<bool> reached(n_ * n_ * n_, false);
    for (int start = 0; start < n_ * n_ * n_; ++start) {
      if (reached[start]) continue;
      std::vector<std::array<int, 3>> open{{start % n_, start / n_ % n_, start / n_ / n_}};
      reached[start] = true;
      for (std::size_t i = 0; i < open.size(); ++i)
        for (int axis = 0; axis < 3; ++axis)
          for (const int step : {-1, 1}) {
            std::array<int, 3> c = open[i];
            c[axis] += step;
            if (c[axis] < 0 || c[axis] >= n_ || reached[at(c)] || parted(axis, step > 0 ? open[i] : c)) continue;
            reached[at(c)] = true;
            open.push_back(c);
          }
      sizes.push_back(static_cast<int>(open.size()));
    }
    std::sort(sizes.rbegin(), sizes.rend());
    return sizes;
  }

 private:
  int at(const std::array<int, 3>& c) const { return c[0] + n_ * (c[1] + n_ * c[2]); }
  int n_;
  std::vector<bool> parted_;
};

// Fronts, borders, rims, edges and vertices all in the same places, on purpose.
TEST(InciseSequences, OnALattice) {
  constexpr int kCells = 6;
  int opened = 0, refused = 0, apart = 0, hanging = 0, count = 150;
  if (const char* more = std::getenv("MESHLESS_SURGERY_INCISE_FUZZ")) count += std::atoi(more);
  for (int seed = 0; seed < count; ++seed) {
    test::Random random(static_cast<unsigned>(seed));
    TriangleMesh mesh = boxMesh(Vec3::Constant(kCells), seed % 2 ? 3 : 6, seed % 2 ? 3 : 6, seed % 2 ? 3 : 6);
    for (Vec3& p : mesh.vertices) p += Vec3::Constant(0.5 * kCells);
    Cells cells(kCells);
    for (int step = 0; step < 6; ++step) {
      const int axis = random.integer(0, 2), plane = random.integer(1, kCells - 1), u = (axis + 1) % 3,
                w = (axis + 2) % 3;
      std::array<int, 3> low{}, high{};
      low[u] = random.integer(-1, kCells - 2);
      high[u] = random.integer(low[u] + 1, kCells + 1);
      high[w] = kCells + 1;
      low[w] = random.integer(-1, kCells - 1);
      Blade blade;
      blade.x_axis = Vec3::Unit(u);
      blade.y_axis = Vec3::Unit(w);
      blade.origin[axis] = plane;
      blade.origin[u] = low[u];
      blade.origin[w] = high[w];
      blade.length = high[u] - low[u];
      blade.depth = high[w] - low[w];
      InciseOptions options;
      options.patch = static_cast<std::uint32_t>(step + 1);
      const Result<Incision> cut = incise(mesh, blade, options);
      for (int k = 0; k < 3; ++k) {
        low[k] = std::max(low[k], 0);
        high[k] = std::min(high[k], kCells);
      }
      int fresh = 0;
      for (std::array<int, 3> c = low; c[u] < high[u]; ++c[u])
        for (c[w] = low[w]; c[w] < high[w]; ++c[w]) {
          c[axis] = plane - 1;
          fresh += !cells.parted(axis, c);
        }
      if (!cut) {
        if (cut.error().code != ErrorCode::kMissed) {
          ++refused;
          if (std::getenv("MESHLESS_SURGERY_INCISE_TALK"))
            std::printf("seed %d step %d: %s\n", seed, step, cut.error().detail.c_str());
          continue;
        }
        ASSERT_EQ(fresh, 0) << "seed " << seed << " step " << step << ": " << cut.error().detail;
        continue;
      }
      ++opened;
      ASSERT_TRUE(laws::incisionObeysLaws(mesh, blade, options, *cut, false)) << "seed " << seed << " step " << step;
      cells.part(axis, plane, low, high);
      ASSERT_NEAR(cut->opened_area, fresh, 1e-5) << "seed " << seed << " step " << step;
      const std::vector<int> parts = cells.parts();
      if (cut->pieces.size() < parts.size()) {  // they still hang together in a vertex
        ++hanging;
        break;
      }
      ASSERT_EQ(cut->pieces.size(), parts.size()) << "seed " << seed << " step " << step;
      for (std::size_t i = 0; i < parts.size(); ++i) ASSERT_NEAR(signedVolume(cut->pieces[i].mesh), parts[i], 1e-4);
      if (parts.size() > 1) {
        ++apart;
        break;
      }
      mesh = cut->pieces[0].mesh;
    }
  }
  std::printf("%d opened, %d refused, %d fell apart, %d hang together in a vertex\n", opened, refused, apart, hanging);
  EXPECT_LE(refused, opened / 1000);
  EXPECT_LE(hanging, opened / 5000);
  EXPECT_GT(apart, 20);
}

TEST(InciseSequences, Sphere) {
  expectFewRefused(runSequences(shapes::moved(sphereMesh(0.1, 0.025), shapes::anyPose()), 500, 1000));
}
TEST(InciseSequences, Box) { expectFewRefused(runSequences(boxMesh(Vec3(0.2, 0.12, 0.08), 0.02), 150, 20000)); }
TEST(InciseSequences, Torus) { expectFewRefused(runSequences(torusMesh(0.1, 0.03, 0.015), 100, 30000)); }
TEST(InciseSequences, ThinSlab) { expectFewRefused(runSequences(boxMesh(Vec3(0.2, 0.2, 0.004), 0.02), 100, 40000)); }
TEST(InciseSequences, Liver) { expectFewRefused(runSequences(liverMesh(), 150, 50000)); }

}  // namespace incise_sequence_test
}  // namespace meshless
