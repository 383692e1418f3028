// Surfaces of random organs in the world at its defaults: how many triangles contact takes, how far they are from what
// is seen, what is folded after cuts and incisions, and what it costs. A row for each organ and support, as CSV.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <fstream>

#include <CLI/CLI.hpp>

#include "meshless_surgery/base/random.h"
#include "drive/crossing_law.h"
#include "drive/depth_law.h"
#include "drive/fold_law.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/random_organ.h"
#include "meshless_surgery/world/world.h"

namespace meshless::bench {
namespace {

double seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

struct Row {
  Folds folds;
  double uncut = 0.0, after = 0.0;  // [s] of the processor for a simulated second
  double prepare = 0.0, cut = 0.0;  // [s] the longest
  std::size_t pieces = 0, without = 0, refused = 0;
  double least_volume = 1.0;            // of pieces above a hundredth of the mass
  double depth = 0.0, crossings = 0.0;  // as the laws of the drive have them: above 1 is too much
};

CutCommand across(const Vec3& at, const Vec3& normal) {
  CutCommand cut;
  cut.blades.x_axis = normal.unitOrthogonal();
  cut.blades.y_axis = normal.cross(cut.blades.x_axis);
  cut.blades.origin = at - 10.0 * cut.blades.x_axis;
  return cut;
}

// Above the highest vertex, down to a third of the height.
InciseCommand incision(const Points& surface, Random& random) {
  const Box bounds = boundsOf(surface);
  const Vec3 top =
      *std::max_element(surface.begin(), surface.end(), [](const Vec3& a, const Vec3& b) { return a.z() < b.z(); });
  InciseCommand incise;
  const double angle = random.between(0.0, 3.0);
  incise.blade.x_axis = Vec3(std::cos(angle), std::sin(angle), 0.0);
  incise.blade.y_axis = Vec3::UnitZ();
  incise.blade.length = 0.3 * bounds.diagonal();
  incise.blade.depth = 0.35 * (bounds.max.z() - bounds.min.z());
  incise.blade.origin = top - 0.5 * incise.blade.length * incise.blade.x_axis + Vec3(0.0013, 0.0007, 0.004);
  return incise;
}

class Scene {
 public:
  Scene(std::uint64_t seed, std::size_t triangles, const std::string& support, CollisionChoice::Kind kind)
      : random_(1000 * seed + support.size()), support_(support), world_(WorldSettings()) {
    BodyDef def;
    def.name = "organ";
    def.mesh = *randomOrgan(seed, 0, 0.2, triangles);
    const Box bounds = boundsOf(def.mesh.vertices);
    def.material.youngs_modulus = 4500.0;
    def.material.poissons_ratio = 0.45;
    def.material.density = 1060.0;
    def.material.damping = 4.0;
    def.material.friction = 0.3;
    def.collision.kind = kind;
    def.pose.translation.z() = 0.002 - bounds.min.z();
    if (support == "held") {
      def.pose.translation.z() += 0.1;
      Box side = bounds;
      side.max.x() = bounds.min.x() + 0.15 * (bounds.max.x() - bounds.min.x());
      def.fixed = {HeldRegion(Region(side), false)};
    }
    if (support == "hung") def.pose.translation.z() += 0.2;
    const auto start = seconds();
    Result<PreparedBody> body = prepareBody(std::move(def));
    row.prepare = seconds() - start;
    if (!body || !world_.addSceneBody(std::make_shared<const PreparedBody>(std::move(*body))).ok()) {
      made = false;
      return;
    }
    if (support == "hung") pick(3, 0.0);
    row.uncut = run(0.5);
    look();
  }

  void cut() {
    const WorldSnapshot shot = world_.snapshot({false, false, true});
    std::size_t largest = 0;
    for (std::size_t b = 0; b < shot.bodies.size(); ++b)
      if (shot.bodies[b].model->mass > shot.bodies[largest].model->mass) largest = b;
    apply(across(shot.bodies[largest].measures.centre_of_mass, random_.direction()));
  }
  void incise() { apply(incision(world_.snapshot({true, false, false}).bodies[0].surface, random_)); }
  void spread() {
    pick(2 + 2 * static_cast<int>(random_.between(0.0, 2.9)), 0.02);
    row.after = std::max(row.after, run(0.5));
    look();
  }

  bool made = true;
  Row row;
  std::size_t collision_triangles = 0;
  double distance = 0.0;  // [spacing]

 private:
  void apply(const Command& command) {
    const double start = seconds();
    const bool done = world_.apply(command).ok();
    if (!done) {
      ++row.refused;
      return;
    }
    row.cut = std::max(row.cut, seconds() - start);
    row.after = std::max(row.after, run(0.5));
    look();
  }

  // By places of the surface, the first of them on top, and locked so far above or beside where they are.
  void pick(int count, double by) {
    const WorldSnapshot shot = world_.snapshot({true, false, false});
    Points places = shot.bodies[0].surface;
    std::sort(places.begin(), places.end(), [](const Vec3& a, const Vec3& b) { return a.z() > b.z(); });
    places.resize(std::max<std::size_t>(places.size() / 20, 1));
    const Vec3 middle = 0.5 * (boundsOf(places).min + boundsOf(places).max);
    for (int k = 0; k < count; ++k) {
      PickCommand pick;
      pick.point = places[static_cast<std::size_t>(random_.between(0.0, 0.999) * static_cast<double>(places.size()))];
      pick.max_distance = 0.03;
      const Result<Reply> reply = world_.apply(pick);
      if (!reply) continue;
      LockCommand lock;
      lock.pick = std::get<PickReply>(*reply).pick;
      lock.target = Vec3(pick.point + by * (pick.point - middle).normalized());
      (void)world_.apply(lock);
    }
  }

  double run(double time) {
    const int steps = static_cast<int>(time * world_.settings().step_rate);
    const double start = seconds();
    for (int n = 0; n < steps; ++n) world_.step();
    return (seconds() - start) / time;
  }

  void look() {
    const Seen seen = see(world_, true);
    row.pieces = seen.bodies.size();
    row.without = 0;
    double mass = 0.0;
    for (const SeenBody& body : seen.bodies) mass += body.mass;
    for (const SeenBody& body : seen.bodies) {
      const Folds folds = foldsOf(body);
      row.folds.of_surface += folds.of_surface;
      row.folds.of_tissue += folds.of_tissue;
      row.without += !body.collision;
      if (body.mass > 0.01 * mass)
        row.least_volume = std::min(row.least_volume, signedVolume(body.surface) / body.rest_volume);
      if (seen.bodies.size() > 1 || !body.collision) continue;
      collision_triangles = body.collision->triangles.size();
      distance = body.model->collision->distance / body.model->spacing;
    }
    row.depth = std::max(row.depth, depthLaw(seen).score);
    row.crossings = std::max(row.crossings, crossingLaw(seen).score);
  }

  Random random_;
  std::string support_;
  World world_;
};

}  // namespace
}  // namespace meshless::bench

int main(int argc, char** argv) {
  using namespace meshless;
  CLI::App app{"Surfaces of random organs: folds, contact, time"};
  std::vector<std::size_t> triangles{4000, 20000, 60000};
  std::uint64_t first = 1, count = 20;
  std::string out, collision = "auto";
  app.add_option("--triangles", triangles, "of the organs");
  app.add_option("--first", first, "seed");
  app.add_option("--seeds", count, "how many");
  app.add_option("--collision", collision)->check(CLI::IsMember({"auto", "visual"}));
  app.add_option("--out", out, "a CSV file");
  CLI11_PARSE(app, argc, argv);
  std::ofstream file(out);
  const char* head =
      "triangles,seed,support,collision_triangles,distance_spacings,folds_surface,folds_tissue,pieces,without,refused,"
      "least_volume,depth,crossings,prepare_s,cut_s,uncut_s_per_s,after_s_per_s";
  file << head << "\n";
  std::printf("%s\n", head);
  const auto kind = collision == "auto" ? CollisionChoice::Kind::kAuto : CollisionChoice::Kind::kVisual;
  for (const std::size_t fine : triangles)
    for (std::uint64_t seed = first; seed < first + count; ++seed) {
      const char* supports[] = {"lies", "held", "hung", "incised"};
      const std::string support = supports[seed % 4];
      bench::Scene scene(seed, fine, support, kind);
      if (!scene.made) continue;
      if (support == "incised") {
        scene.incise();
        scene.spread();
      } else {
        for (std::uint64_t cuts = 0; cuts < 1 + seed / 4 % 4; ++cuts) scene.cut();
      }
      const bench::Row& row = scene.row;
      char line[400];
      std::snprintf(line, sizeof line, "%zu,%lu,%s,%zu,%.3f,%zu,%zu,%zu,%zu,%zu,%.3f,%.2f,%.0f,%.2f,%.3f,%.2f,%.2f",
                    fine, static_cast<unsigned long>(seed), support.c_str(), scene.collision_triangles, scene.distance,
                    row.folds.of_surface, row.folds.of_tissue, row.pieces, row.without, row.refused, row.least_volume,
                    row.depth, row.crossings, row.prepare, row.cut, row.uncut, row.after);
      std::printf("%s\n", line);
      std::fflush(stdout);
      file << line << "\n";
    }
}
