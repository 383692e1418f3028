// Laws of what holds organs together.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>

#include "meshless_surgery/world/command_log.h"
#include "meshless_surgery/world/saved_world.h"
#include "support/bodies.h"

namespace meshless {
namespace {

constexpr double kGravity = 9.81;  // [m/s^2]

Material looks(double alpha = 1.0) {
  Material material;
  material.mode = MatchMode::kRigid;
  material.alpha = alpha;
  material.beta = 0.0;
  material.density = 1000.0;
  material.damping = 4.0;
  return material;
}

Material elastic(double youngs_modulus = 1e5) {
  Material material;
  material.youngs_modulus = youngs_modulus;
  material.poissons_ratio = 0.45;
  material.density = 1000.0;
  material.damping = 10.0;
  return material;
}

BodyDef boxOf(const std::string& name, const Vec3& size, const Vec3& at, const Material& material,
              double spacing = 0.02) {
  BodyDef def;
  def.name = name;
  const auto cells = [&](double length) { return std::max(1, static_cast<int>(std::lround(length / spacing))); };
  def.mesh = boxMesh(size, cells(size.x()), cells(size.y()), cells(size.z()));
  def.pose.translation = at;
  def.material = material;
  def.spacing = spacing;
  return def;
}

BodyDef held(BodyDef def) {
  def.fixed.push_back(HeldRegion(Vec3::Constant(-100.0), Vec3::Constant(100.0)));
  return def;
}

void add(World& world, const BodyDef& def) {
  const auto added = world.addSceneBody(test::shared(def));
  ASSERT_TRUE(added.ok()) << added.error().detail;
}

AttachCommand attachment(const std::string& body, const std::string& other, double distance, double stiffness,
                         std::optional<double> strength = {}) {
  AttachCommand command;
  command.body = body;
  command.other = other;
  command.distance = distance;
  command.stiffness = stiffness;
  command.strength = strength;
  return command;
}

AttachReply attach(World& world, const AttachCommand& command) {
  return test::replyOf<AttachReply>(world.apply(command));
}

WorldSnapshot seen(World& world) {
  SnapshotWants wants;
  wants.surfaces = wants.measures = true;
  return world.snapshot(wants);
}

const BodySnapshot& bodyOf(const WorldSnapshot& shot, const std::string& name) {
  for (const BodySnapshot& body : shot.bodies)
    if (body.name == name) return body;
  throw std::runtime_error("no body " + name);
}

void live(World& world, double seconds) {
  const int steps = static_cast<int>(std::lround(seconds * world.settings().step_rate));
  for (int n = 0; n < steps; ++n) world.step();
}

WorldSettings noGround(bool gravity = true) {
  WorldSettings settings;
  settings.ground.reset();
  if (!gravity) settings.gravity.setZero();
  return settings;
}

struct Hung {
  double gap = 0.0;  // [m] between the two
  double mass = 0.0, area = 0.0, force = 0.0;
  bool asleep = false;
};

/// A block that hangs under one that is held.
Hung hang(const Material& material, double stiffness, double spacing, double seconds) {
  World world(noGround());
  add(world, held(boxOf("above", Vec3(0.1, 0.1, 0.04), Vec3(0, 0, 0.2), elastic(1e6), spacing)));
  add(world, boxOf("below", Vec3(0.06, 0.06, 0.04), Vec3(0.01, 0.005, 0.2 - 0.04 - 0.002), material, spacing));
  const AttachReply made = attach(world, attachment("below", "above", 0.004, stiffness));
  live(world, seconds);
  const WorldSnapshot shot = seen(world);
  Hung hung;
  hung.mass = bodyOf(shot, "below").model->mass;
  hung.area = made.area;
  hung.force = shot.attachments[0].force;
  hung.asleep = bodyOf(shot, "below").asleep;
  for (const auto& line : shot.attachments[0].lines)
    hung.gap += (line[0] - line[1]).norm() / static_cast<double>(shot.attachments[0].lines.size());
  return hung;
}

TEST(Attachment, SaysWhatItJoinedAndWhere) {
  for (const double spacing : {0.008, 0.02, 0.04}) {
    SCOPED_TRACE(spacing);
    World world(noGround());
    add(world, held(boxOf("above", Vec3(0.1, 0.1, 0.04), Vec3(0, 0, 0.2), elastic(1e6), spacing)));
    add(world, boxOf("below", Vec3(0.06, 0.06, 0.04), Vec3(0.01, 0.005, 0.2 - 0.04 - 0.002), elastic(), spacing));
    const AttachReply made = attach(world, attachment("below", "above", 0.004, 1e5));
    ASSERT_EQ(1u, made.patches.size());
    EXPECT_DOUBLE_EQ(made.area, made.patches[0].area);
    EXPECT_LT((made.patches[0].middle - Vec3(0.01, 0.005, 0.178)).norm(), 1e-3);
    EXPECT_NE(std::string::npos, made.text().find(" cm^2, in 1 patch: ")) << made.text();
  }
  // The feet of an arch, whose one leg is shorter; and all of it.
  World world(noGround());
  BodyDef arch = test::defOf(shapes::arch(), "arch");
  arch.pose.rotation = Quat(Eigen::AngleAxisd(0.05, Vec3::UnitY()));
  arch.spacing = 0.015;
  add(world, arch);
  AttachCommand feet = attachment("arch", "world", 0.0, 1e5);
  feet.region = Region::below(Plane{Vec3::UnitZ(), Vec3(0, 0, 0.015)});
  const AttachReply made = attach(world, feet);
  ASSERT_EQ(2u, made.patches.size());
  EXPECT_NEAR(made.area, made.patches[0].area + made.patches[1].area, 1e-12);
  EXPECT_GE(made.patches[0].area, made.patches[1].area);
  EXPECT_GT(made.patches[1].area, 0.0025);  // 5 by 6 cm
  const double x[] = {made.patches[0].middle.x(), made.patches[1].middle.x()};
  EXPECT_NEAR(-0.075, std::min(x[0], x[1]), 0.01);
  EXPECT_NEAR(0.075, std::max(x[0], x[1]), 0.01);
  EXPECT_NE(std::string::npos, made.text().find(" cm^2, in 2 patches: ")) << made.text();
  EXPECT_EQ(1u, attach(world, attachment("arch", "world", 0.0, 1e5)).patches.size());
}

TEST(Attachment, ABlockHangsLowerByItsWeightOverStiffnessAndArea) {
  for (const bool is_elastic : {false, true})
    for (const double stiffness : {2e5, 2e6}) {
      for (const double spacing : {0.01, 0.02}) {
        SCOPED_TRACE(std::to_string(is_elastic) + " " + std::to_string(stiffness) + " " + std::to_string(spacing));
        const Hung hung = hang(is_elastic ? elastic(3e5) : looks(), stiffness, spacing, 4.0);
        const double stretch = hung.mass * kGravity / (stiffness * hung.area);
        EXPECT_NEAR(hung.area, 0.06 * 0.06, 1e-9);
        EXPECT_NEAR(hung.gap - 0.002, stretch, 0.03 * stretch) << hung.gap;
        EXPECT_NEAR(hung.force, hung.mass * kGravity, 0.025 * hung.mass * kGravity);  // what sleep leaves of a swing
        EXPECT_TRUE(hung.asleep);
      }
    }
}

Vec3 momentum(const WorldSnapshot& shot) {
  Vec3 sum = Vec3::Zero();
  for (const BodySnapshot& b : shot.bodies) sum += b.measures.linear_momentum;
  return sum;
}
Vec3 angularMomentum(const WorldSnapshot& shot) {
  Vec3 sum = Vec3::Zero();
  for (const BodySnapshot& b : shot.bodies)
    sum += b.measures.angular_momentum + b.measures.centre_of_mass.cross(b.measures.linear_momentum);
  return sum;
}

std::shared_ptr<const PreparedBody> moving(const BodyDef& def, const Vec3& velocity, const Vec3& spin) {
  PreparedBody body = test::prepared(def);
  for (std::size_t i = 0; i < body.state.positions.size(); ++i)
    body.state.velocities[i] = velocity + spin.cross(body.state.positions[i] - def.pose.translation);
  return std::make_shared<const PreparedBody>(std::move(body));
}

TEST(Attachment, TwoFreeBodiesKeepTheirMomentum) {
  for (const bool is_elastic : {false, true})
    for (const double stiffness : {1e4, 1e6, 1e9, 1e12})
      for (const double gap : {0.001, 0.02}) {
        SCOPED_TRACE(std::to_string(is_elastic) + " " + std::to_string(stiffness) + " " + std::to_string(gap));
        World world(noGround(false));
        const Material material = is_elastic ? elastic(1e5) : looks(0.9);
        ASSERT_TRUE(world
                        .addSceneBody(moving(boxOf("one", Vec3(0.08, 0.06, 0.04), Vec3(0, 0, 0), material),
                                             Vec3(0.3, 0.1, -0.2), Vec3(2, 5, 1)))
                        .ok());
        ASSERT_TRUE(world
                        .addSceneBody(moving(boxOf("two", Vec3(0.04, 0.04, 0.04), Vec3(0.01, 0, 0.04 + gap), material),
                                             Vec3(-0.2, 0.1, 0.4), Vec3(-3, 1, 2)))
                        .ok());
        attach(world, attachment("two", "one", 1.5 * gap, stiffness));
        const WorldSnapshot before = seen(world);
        const Vec3 p = momentum(before), l = angularMomentum(before);
        double energy = 0.0;
        for (const BodySnapshot& b : before.bodies) energy += b.measures.kinetic_energy;
        live(world, 3.0);
        const WorldSnapshot after = seen(world);
        EXPECT_EQ(after.report.fibres > 0, true);
        EXPECT_LE((momentum(after) - p).norm(), 1e-9 * p.norm());
        EXPECT_LE((angularMomentum(after) - l).norm(), 3e-9 * l.norm());
        double left = 0.0;
        for (const BodySnapshot& b : after.bodies) left += b.measures.kinetic_energy;
        EXPECT_LE(left, energy * (1.0 + 1e-9));
        EXPECT_LT((bodyOf(after, "two").measures.centre_of_mass - bodyOf(after, "one").measures.centre_of_mass).norm(),
                  0.15);
      }
}

/// A strip on a plate that is held; its end at the least x is drawn along `along`, without weight. Forces [N] of the
/// pick and fibres that are left, each step.
struct Peeled {
  AttachReply made;
  std::vector<std::array<Vec3, 2>> lines;  // at the start
  std::vector<double> forces;
  std::vector<std::size_t> left;
  double tilt = 0.0;
};
Peeled peel(const BodyDef& strip, double plate_spacing, double stiffness, double strength, double way, double speed,
            double patch, const Vec3& along, double pull) {
  WorldSettings settings = noGround(false);
  settings.pick_radius = patch;
  World world(settings);
  add(world, held(boxOf("plate", Vec3(0.2, 0.06, 0.02), Vec3::Zero(), elastic(1e6), plate_spacing)));
  add(world, strip);
  Peeled peeled;
  peeled.made = attach(world, attachment("strip", "plate", 0.002, stiffness, strength));
  const WorldSnapshot start = seen(world);
  peeled.lines = start.attachments[0].lines;
  const Box box = [&] {
    Box all;
    for (const Vec3& p : bodyOf(start, "strip").surface) all.extend(p);
    return all;
  }();
  PickCommand pick;
  pick.point = Vec3(box.min.x(), 0.0, box.min.z());
  pick.max_distance = 0.05;
  pick.stiffness = pull;
  pick.body = "strip";
  const PickReply picked = test::replyOf<PickReply>(world.apply(pick));
  const double each = speed / settings.step_rate;
  for (double gone = 0.0; gone < way; gone += each) {
    MovePickCommand move;
    move.pick = picked.pick;
    move.target = picked.position + gone * along;
    EXPECT_TRUE(world.apply(move).ok());
    world.step();
    const WorldSnapshot shot = world.snapshot({});
    peeled.forces.push_back(shot.picks[0].force.z());
    peeled.left.push_back(shot.attachments[0].fibres);
    if (peeled.left.back() == 0) break;
  }
  return peeled;
}

TEST(Attachment, AStiffStripIsPeeledByTheForceOfALever) {
  for (const double spacing : {0.01, 0.02})
    for (const double stiffness : {1e6, 1e7})
      for (const double strength : {2e3, 5e3}) {
        SCOPED_TRACE(std::to_string(spacing) + " " + std::to_string(stiffness) + " " + std::to_string(strength));
        const double length = 0.12, width = 0.04;
        BodyDef strip =
            boxOf("strip", Vec3(length, width, 0.02), Vec3(0, 0, 0.02 + 0.0101 * spacing), looks(1.0), spacing);
        strip.clusters.kind = ClusterOptions::Kind::kOne;
        const double tears_at = strength / stiffness;
        const Peeled peeled =
            peel(strip, 0.02, stiffness, strength, 3.0 * tears_at, tears_at, 0.001, Vec3::UnitZ(), 1e7);
        // It turns about its far end; the fibres next to the near end tear first.
        double first = 0.0, sum = 0.0;
        for (const auto& line : peeled.lines) {
          const double lever = 0.5 * length - line[0].x();
          first = std::max(first, lever);
          sum += peeled.made.area / static_cast<double>(peeled.lines.size()) * lever * lever;
        }
        const double theory = strength * sum / (first * length);
        const double most = *std::max_element(peeled.forces.begin(), peeled.forces.end());
        EXPECT_NEAR(most, theory, 0.06 * theory);  // contact keeps a skin between the two
        EXPECT_LT(peeled.left.back(), peeled.made.fibres) << "none tore";
      }
}

/// Two soft beams that are attached face to face, and whose ends are drawn apart: the force [N] at which the first
/// fibre tears, and how far that fibre is from the ends.
std::pair<double, double> drawApart(double spacing, double youngs_modulus, double stiffness, double strength) {
  WorldSettings settings = noGround(false);
  settings.pick_radius = 0.5 * spacing;
  World world(settings);
  for (const double side : {-1.0, 1.0})
    add(world, boxOf(side < 0.0 ? "lower" : "upper", Vec3(0.12, 0.012, 0.008), Vec3(0, 0, side * 0.0042),
                     elastic(youngs_modulus), spacing));
  const std::size_t made = attach(world, attachment("lower", "upper", 0.001, stiffness, strength)).fibres;
  double nearest = 1.0;
  const WorldSnapshot start = seen(world);
  for (const auto& line : start.attachments[0].lines) nearest = std::min(nearest, line[0].x() + 0.06);
  std::vector<PickReply> picked;
  for (const double side : {-1.0, 1.0}) {
    PickCommand pick;
    pick.point = Vec3(-0.06, 0.0, side * 0.0042);
    pick.max_distance = 0.05;
    pick.stiffness = 1e3;
    pick.body = side < 0.0 ? "lower" : "upper";
    picked.push_back(test::replyOf<PickReply>(world.apply(pick)));
  }
  double most = 0.0;
  for (int step = 0; step < 2400; ++step) {
    for (int k = 0; k < 2; ++k) {
      MovePickCommand move;
      move.pick = picked[k].pick;
      move.target = picked[k].position + Vec3(0, 0, (k == 0 ? -1e-5 : 1e-5) * step);
      EXPECT_TRUE(world.apply(move).ok());
    }
    world.step();
    const WorldSnapshot shot = world.snapshot({});
    if (shot.attachments[0].fibres < made) return {most, nearest};
    most = 0.5 * (shot.picks[1].force.z() - shot.picks[0].force.z());
  }
  ADD_FAILURE() << "none tore";
  return {most, nearest};
}

TEST(Attachment, SoftBeamsComeApartAsBeamsOnElasticGroundDo) {
  const double youngs_modulus = 1e5, stiffness = 5e4, strength = 100.0, width = 0.012, thick = 0.008;
  for (const auto& [spacing, within] : {std::pair(0.003, 0.1), std::pair(0.004, 0.2)}) {
    SCOPED_TRACE(spacing);
    const auto [force, nearest] = drawApart(spacing, youngs_modulus, stiffness, strength);
    // Hetenyi 1946: drawn at its end by P, a long beam is drawn out by 2 P beta / k there, and less farther on. Half of
    // a fibre's length is each beam's.
    const double k = 2.0 * stiffness * width, flexural = youngs_modulus * width * std::pow(thick, 3) / 12.0;
    const double beta = std::pow(k / (4.0 * flexural), 0.25);
    const double there = std::exp(-beta * nearest) * std::cos(beta * nearest);
    const double theory = strength * width / (2.0 * beta * there);
    EXPECT_NEAR(force, theory, within * theory);
  }
}

TEST(Attachment, ABlockIsPulledOffByStrengthTimesArea) {
  for (const bool is_elastic : {false, true})
    for (const double stiffness : {1e6, 1e8}) {
      SCOPED_TRACE(std::to_string(is_elastic) + " " + std::to_string(stiffness));
      const double strength = 1e3;
      World world(noGround(false));
      add(world, held(boxOf("plate", Vec3(0.1, 0.1, 0.02), Vec3::Zero(), elastic(1e6))));
      BodyDef block = boxOf("block", Vec3(0.04, 0.04, 0.04), Vec3(0, 0, 0.032), is_elastic ? elastic(1e6) : looks());
      add(world, block);
      const AttachReply made = attach(world, attachment("block", "plate", 0.004, stiffness, strength));
      PickCommand pick;
      pick.point = Vec3(0, 0, 0.052);
      pick.stiffness = 1e4;
      pick.body = "block";
      const PickReply picked = test::replyOf<PickReply>(world.apply(pick));
      double most = 0.0;
      for (int step = 0; step < 1200 && seen(world).attachments[0].fibres > 0; ++step) {
        MovePickCommand move;
        move.pick = picked.pick;
        move.target = picked.position + Vec3(0, 0, 2e-6 * step);
        ASSERT_TRUE(world.apply(move).ok());
        world.step();
        most = std::max(most, seen(world).picks[0].force.z());
      }
      EXPECT_EQ(seen(world).attachments[0].fibres, 0u);
      // Soft tissue is drawn from its middle: there it tears before the border has its share.
      EXPECT_LE(most, 1.03 * strength * made.area);
      EXPECT_GE(most, (is_elastic ? 0.6 : 0.97) * strength * made.area);
    }
}

TEST(Attachment, TearsGoFromTheBorderInwardsWithTwoEvents) {
  World world(noGround(false));
  add(world, held(boxOf("plate", Vec3(0.2, 0.06, 0.02), Vec3::Zero(), elastic(1e6))));
  BodyDef strip = boxOf("strip", Vec3(0.12, 0.04, 0.02), Vec3(0, 0, 0.0211), looks(), 0.01);
  strip.clusters.kind = ClusterOptions::Kind::kOne;
  add(world, strip);
  attach(world, attachment("strip", "plate", 0.002, 1e6, 2e3));
  PickCommand pick;
  pick.point = Vec3(-0.06, 0, 0.02);
  pick.stiffness = 1e4;
  pick.body = "strip";
  const PickReply picked = test::replyOf<PickReply>(world.apply(pick));
  (void)world.takeEvents();
  double front = -1.0;  // [m] x of the fibre that is nearest to the end that is lifted
  std::size_t before = seen(world).attachments[0].fibres, times = 0;
  std::vector<std::string> torn;
  for (int step = 0; step < 2400; ++step) {
    MovePickCommand move;
    move.pick = picked.pick;
    move.target = picked.position + Vec3(0, 0, 1e-4 * step);
    ASSERT_TRUE(world.apply(move).ok());
    const auto lines = seen(world).attachments[0].lines;
    world.step();
    for (const Event& event : world.takeEvents())
      if (event.type == EventType::kTorn) torn.push_back(event.text);
    const auto left = seen(world).attachments[0].lines;
    if (left.size() < before) {
      ++times;
      double least = 1.0;
      for (const auto& line : left) least = std::min(least, line[1].x());
      EXPECT_GE(least, front - 1e-9);
      for (const auto& line : lines) {
        const bool is_left =
            std::any_of(left.begin(), left.end(), [&](const auto& other) { return other[1] == line[1]; });
        if (!is_left) EXPECT_LE(line[1].x(), least + 0.011) << "beyond the next row";
      }
      front = least;
      before = left.size();
    }
    if (left.empty()) break;
  }
  EXPECT_EQ(before, 0u);
  EXPECT_GT(times, 3u) << "it came off at once";
  ASSERT_EQ(torn.size(), 2u);
  EXPECT_NE(torn[0].find("begins"), std::string::npos);
  EXPECT_NE(torn[1].find("no fibre is left"), std::string::npos);
}

/// A slab, held, over another; joined.
void addSlabs(World& world, const Material& material, double stiffness, std::optional<double> strength = {}) {
  BodyDef above = boxOf("above", Vec3(0.12, 0.06, 0.03), Vec3(0, 0, 0.2), material, 0.01);
  above.fixed.push_back(HeldRegion(Vec3(-1, -1, 0.209), Vec3(1, 1, 1)));
  add(world, above);
  add(world, boxOf("below", Vec3(0.12, 0.06, 0.03), Vec3(0, 0, 0.2 - 0.03 - 0.003), material, 0.01));
  attach(world, attachment("below", "above", 0.005, stiffness, strength));
}

CutCommand blades(const Vec3& origin, const Vec3& x, const Vec3& y, double length = 0.0, double width = 0.0) {
  CutCommand cut;
  cut.blades.origin = origin;
  cut.blades.x_axis = x;
  cut.blades.y_axis = y;
  cut.blades.length = length;
  cut.blades.width = width;
  return cut;
}

TEST(Attachment, TheBladeBetweenTwoBodiesCutsFibresAlone) {
  World world(noGround());
  addSlabs(world, elastic(), 1e6);
  live(world, 0.5);
  const WorldSnapshot before = seen(world);
  double between = 0.0;
  for (const auto& line : before.attachments[0].lines)
    between += 0.5 * (line[0].z() + line[1].z()) / static_cast<double>(before.attachments[0].lines.size());
  // To half of their length.
  const CutReply reply =
      test::replyOf<CutReply>(world.apply(blades(Vec3(-0.1, 0, between), Vec3::UnitX(), Vec3::UnitY(), 0.1, 0.2)));
  EXPECT_TRUE(reply.new_bodies.empty());
  EXPECT_EQ(reply.notes.size(), 1u);
  const WorldSnapshot after = seen(world);
  EXPECT_NEAR(static_cast<double>(after.attachments[0].fibres), 0.5 * before.attachments[0].fibres,
              0.1 * before.attachments[0].fibres);
  for (const auto& line : after.attachments[0].lines) EXPECT_GT(0.5 * (line[0].x() + line[1].x()), 0.0);
  EXPECT_FALSE(world.apply(blades(Vec3(-0.1, 0, between), Vec3::UnitX(), Vec3::UnitY(), 0.1, 0.2)).ok())
      << "nothing is left there";
  EXPECT_TRUE(world.apply(UndoCutCommand{}).ok());
  const WorldSnapshot undone = seen(world);
  ASSERT_EQ(undone.attachments[0].fibres, before.attachments[0].fibres);
  EXPECT_EQ(undone.attachments[0].force, before.attachments[0].force);
  for (std::size_t n = 0; n < before.attachments[0].lines.size(); ++n)
    EXPECT_EQ(undone.attachments[0].lines[n], before.attachments[0].lines[n]);
  InciseCommand incise;
  incise.blade.origin = Vec3(-0.1, 0.1, between);
  incise.blade.length = 0.1;
  incise.blade.depth = 0.2;
  EXPECT_TRUE(world.apply(incise).ok());
  EXPECT_EQ(seen(world).attachments[0].fibres, after.attachments[0].fibres);
}

TEST(Attachment, PiecesKeepTheirFibresWithoutAJump) {
  for (const bool is_elastic : {false, true})
    for (const bool both : {false, true}) {
      SCOPED_TRACE(std::to_string(is_elastic) + " " + std::to_string(both));
      World world(noGround());
      addSlabs(world, is_elastic ? elastic() : looks(0.8), 1e6);
      live(world, 2.0);
      const WorldSnapshot before = seen(world);
      CutCommand cut = blades(Vec3(0.013, -0.5, 0.2), Vec3::UnitY(), Vec3::UnitZ());
      if (!both) cut.bodies = {"below"};
      const CutReply reply = test::replyOf<CutReply>(world.apply(cut));
      EXPECT_EQ(reply.new_bodies.size(), both ? 4u : 2u);
      const WorldSnapshot after = seen(world);
      ASSERT_EQ(after.attachments.size(), 1u);
      EXPECT_LE(after.attachments[0].fibres, before.attachments[0].fibres);
      EXPECT_GE(after.attachments[0].fibres, before.attachments[0].fibres - 12);
      EXPECT_EQ(after.attachments[0].ends.size(), both ? 4u : 3u);
      EXPECT_NEAR(after.attachments[0].force, before.attachments[0].force, 0.15 * before.attachments[0].force);
      for (const auto& line : after.attachments[0].lines) EXPECT_GT((line[0].x() - 0.013) * (line[1].x() - 0.013), 0.0);
      world.step();
      for (const BodySnapshot& body : seen(world).bodies)
        EXPECT_LT(body.measures.velocity.norm(), 2.0 * kGravity / 120.0) << body.name;
      live(world, 3.0);
      double weight = 0.0;
      const WorldSnapshot rested = seen(world);
      for (const BodySnapshot& body : rested.bodies)
        if (body.name.compare(0, 5, "below") == 0) {
          weight += body.model->mass * kGravity;
          EXPECT_GT(body.measures.centre_of_mass.z(), 0.145) << "it fell off";
        }
      EXPECT_NEAR(rested.attachments[0].force, weight, 0.1 * weight);
      EXPECT_TRUE(world.apply(UndoCutCommand{}).ok());
      EXPECT_EQ(seen(world).attachments[0].fibres, before.attachments[0].fibres);
    }
}

TEST(Attachment, AnIncisionOfAnAttachedBodyKeepsItsFibres) {
  World world(noGround());
  addSlabs(world, elastic(), 1e6);
  live(world, 1.0);
  const WorldSnapshot before = seen(world);
  InciseCommand incise;  // from below, not through
  incise.blade.origin = Vec3(-0.03, 0.005, 0.14);
  incise.blade.x_axis = Vec3::UnitX();
  incise.blade.y_axis = -Vec3::UnitZ();
  incise.blade.length = 0.05;
  incise.blade.depth = 0.03;
  ASSERT_TRUE(world.apply(incise).ok());
  const WorldSnapshot after = seen(world);
  EXPECT_EQ(after.attachments[0].fibres, before.attachments[0].fibres);
  for (std::size_t n = 0; n < after.attachments[0].lines.size(); ++n)
    for (int k = 0; k < 2; ++k)
      EXPECT_LT((after.attachments[0].lines[n][k] - before.attachments[0].lines[n][k]).norm(), 1e-3);
  live(world, 1.0);
  EXPECT_GT(bodyOf(seen(world), "below").measures.centre_of_mass.z(), 0.15);
}

TEST(Attachment, SavedAndReplayedWorldsGoOnAlike) {
  WorldSettings settings = noGround();
  World world(settings);
  std::string log;
  addSlabs(world, elastic(), 1e6, 600.0);
  AttachCommand more = attachment("below", "world", 0.0, 1e5);
  more.region = Region::sphere(Vec3(0.05, 0, 0.16), 0.02);
  ASSERT_TRUE(world.addSceneAttachment(more).ok());
  world.record([&](std::string bytes) { log += bytes; });
  live(world, 0.25);
  const AttachReply third = attach(world, attachment("above", "below", 0.01, 1e4));
  live(world, 0.25);
  const auto saved = world.capture();
  const auto decoded = decode(encode(*saved));
  ASSERT_TRUE(decoded.ok()) << decoded.error().detail;
  World other(settings);
  other.restore(*decoded->world);
  EXPECT_EQ(other.stateHash(), world.stateHash());
  const auto act = [&](World& of) {
    DetachCommand detach;
    detach.name = third.name;
    detach.region = Region::sphere(Vec3(-0.05, 0, 0.18), 0.03);
    ASSERT_TRUE(of.apply(detach).ok());
    live(of, 0.1);
    ASSERT_TRUE(of.apply(blades(Vec3(0.013, -0.5, 0.2), Vec3::UnitY(), Vec3::UnitZ())).ok());
    live(of, 0.2);
    ASSERT_TRUE(of.apply(UndoCutCommand{}).ok());
    live(of, 0.1);
    detach.region.reset();
    ASSERT_TRUE(of.apply(detach).ok());
    live(of, 0.2);
  };
  act(world);
  act(other);
  EXPECT_EQ(other.stateHash(), world.stateHash());
  world.reset();
  live(world, 0.2);
  EXPECT_EQ(seen(world).attachments.size(), 1u) << "of the scene";
  world.record({});
  for (const int threads : {1, 2}) {
    std::istringstream stream(log);
    const auto replayed = replay(stream, threads);
    ASSERT_TRUE(replayed.ok()) << replayed.error().detail;
    EXPECT_FALSE(replayed->difference.has_value());
    EXPECT_EQ(replayed->hash, world.stateHash());
    EXPECT_GT(replayed->checks, 0u);
  }
}

TEST(Attachment, ResetMakesThoseOfTheSceneAnew) {
  World world(noGround());
  add(world, held(boxOf("above", Vec3(0.1, 0.1, 0.04), Vec3(0, 0, 0.2), elastic(1e6))));
  add(world, boxOf("below", Vec3(0.06, 0.06, 0.04), Vec3(0, 0, 0.158), elastic()));
  ASSERT_TRUE(world.addSceneAttachment(attachment("below", "above", 0.004, 1e6)).ok());
  const std::uint64_t hash = world.stateHash();
  ASSERT_TRUE(world.apply(DetachCommand{"below-above", {}}).ok());
  live(world, 0.5);
  EXPECT_TRUE(seen(world).attachments.empty());
  world.reset();
  EXPECT_EQ(world.stateHash(), hash);
  live(world, 0.5);
  EXPECT_GT(bodyOf(seen(world), "below").measures.centre_of_mass.z(), 0.15);
}

TEST(Attachment, NamesThatAreChosenAreNeverUsedAgainAndOthersOnceTheirAttachmentIsGone) {
  World world(noGround());
  addSlabs(world, elastic(), 1e6);
  EXPECT_EQ(seen(world).attachments[0].name, "below-above");
  EXPECT_EQ(attach(world, attachment("below", "above", 0.005, 1e6)).name, "below-above_2");
  ASSERT_TRUE(world.apply(DetachCommand{"below-above", {}}).ok());
  EXPECT_EQ(attach(world, attachment("below", "above", 0.005, 1e6)).name, "below-above_3");
  AttachCommand again = attachment("below", "above", 0.005, 1e6);
  again.name = "below-above";
  EXPECT_EQ(attach(world, again).name, "below-above");
  const auto refused = world.apply(again);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kDuplicateName);
}

TEST(Attachment, ARemovedBodyTakesItsFibresAlong) {
  World world(noGround());
  addSlabs(world, elastic(), 1e6);
  live(world, 0.2);
  (void)world.takeEvents();
  ASSERT_TRUE(world.apply(RemoveCommand{"below"}).ok());
  EXPECT_TRUE(seen(world).attachments.empty());
  std::size_t said = 0;
  for (const Event& event : world.takeEvents()) said += event.type == EventType::kDetached;
  EXPECT_EQ(said, 1u);
  live(world, 0.2);
  ASSERT_TRUE(decode(encode(*world.capture())).ok());
}

TEST(Attachment, ObstaclesAndPlacesOfTheWorldHold) {
  for (const bool to_world : {false, true}) {
    World world(noGround());
    if (!to_world) {
      ObstacleDef beam;
      beam.name = "beam";
      beam.mesh = boxMesh(Vec3(0.1, 0.1, 0.04), 1, 1, 1);
      for (Vec3& p : beam.mesh.vertices) p.z() += 0.042;
      ASSERT_TRUE(world.addObstacle(beam).ok());
    }
    add(world, boxOf("hung", Vec3(0.06, 0.06, 0.04), Vec3::Zero(), elastic(3e5)));
    AttachCommand command = to_world ? attachment("world", "hung", 0.0, 1e6) : attachment("beam", "hung", 0.004, 1e6);
    command.region = Region(Vec3(-1, -1, 0.019), Vec3(1, 1, 1));
    const AttachReply made = attach(world, command);
    EXPECT_NEAR(made.area, 0.0036, 1e-9);
    live(world, 3.0);
    const WorldSnapshot shot = seen(world);
    const double weight = bodyOf(shot, "hung").model->mass * kGravity;
    EXPECT_NEAR(shot.attachments[0].force, weight, 0.02 * weight);
    EXPECT_EQ(shot.attachments[0].ends, (std::vector<std::string>{"hung", to_world ? "world" : "beam"}));
    EXPECT_TRUE(bodyOf(shot, "hung").asleep);
    // Asleep it costs nothing, and what lets go of it wakes it.
    world.step();
    EXPECT_EQ(seen(world).report.fibres, 0u);
    ASSERT_TRUE(world.apply(DetachCommand{made.name, {}}).ok());
    live(world, 0.3);
    EXPECT_LT(bodyOf(seen(world), "hung").measures.centre_of_mass.z(), -0.1);
  }
}

TEST(Attachment, WhoIsJoinedSleepsAndWakesTogether) {
  World world(noGround());
  addSlabs(world, elastic(), 1e6);
  for (int n = 0; n < 10 && !bodyOf(seen(world), "below").asleep; ++n) live(world, 0.5);
  EXPECT_TRUE(bodyOf(seen(world), "below").asleep);
  EXPECT_TRUE(bodyOf(seen(world), "above").asleep);
  PickCommand pick;
  pick.point = Vec3(0, 0, 0.16);
  pick.body = "below";
  ASSERT_TRUE(world.apply(pick).ok());
  world.step();
  EXPECT_FALSE(bodyOf(seen(world), "below").asleep);
  EXPECT_FALSE(bodyOf(seen(world), "above").asleep);
}

TEST(Attachment, TheSphereBetweenTwoBodiesPeelsThemApart) {
  World world(noGround());
  BodyDef above = boxOf("above", Vec3(0.12, 0.06, 0.03), Vec3(0, 0, 0.2), elastic(2e4), 0.01);
  above.fixed.push_back(HeldRegion(Vec3(-1, -1, 0.209), Vec3(1, 1, 1)));
  add(world, above);
  BodyDef below = boxOf("below", Vec3(0.12, 0.06, 0.03), Vec3(0, 0, 0.167), elastic(2e4), 0.01);
  below.fixed.push_back(HeldRegion(Vec3(0.05, -1, -1), Vec3(1, 1, 1)));
  add(world, below);
  attach(world, attachment("below", "above", 0.005, 1e6, 2000.0));
  live(world, 1.0);
  const std::size_t made = seen(world).attachments[0].fibres;
  PushCommand push;
  push.radius = 0.012;
  push.position = Vec3(-0.09, 0, 0.1835);
  ASSERT_TRUE(world.apply(push).ok());
  push.position = Vec3(0.0, 0, 0.1835);
  push.speed = 0.05;
  ASSERT_TRUE(world.apply(push).ok());
  live(world, 2.0);
  const WorldSnapshot shot = seen(world);
  EXPECT_LT(shot.attachments[0].fibres, made);
  EXPECT_GT(shot.attachments[0].fibres, 0u);
  for (const auto& line : shot.attachments[0].lines)
    EXPECT_GT((0.5 * (line[0] + line[1]) - push.position).norm(), 0.4 * push.radius) << "it goes through the sphere";
}

TEST(Attachment, RefusesWhatIsWrongAndChangesNothing) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInf = std::numeric_limits<double>::infinity();
  World world(noGround());
  addSlabs(world, elastic(), 1e6);
  add(world, boxOf("far", Vec3::Constant(0.04), Vec3(1.0, 0, 0.2), elastic()));
  const std::uint64_t hash = world.stateHash();
  const auto refuses = [&](AttachCommand command, ErrorCode code, const std::string& word) {
    const auto reply = world.apply(command);
    ASSERT_FALSE(reply.ok()) << word;
    EXPECT_EQ(reply.error().code, code) << reply.error().detail;
    EXPECT_NE(reply.error().detail.find(word), std::string::npos) << reply.error().detail;
    EXPECT_EQ(world.stateHash(), hash) << word;
  };
  for (const double bad : {-1.0, 0.0, kNan, kInf, 1e16}) {
    refuses(attachment("below", "above", 0.005, bad), ErrorCode::kInvalidArgument, "stiffness");
    refuses(attachment("below", "above", 0.005, 1e6, bad), ErrorCode::kInvalidArgument, "strength");
    refuses(attachment("below", "above", bad, 1e6), ErrorCode::kInvalidArgument, "distance");
  }
  refuses(attachment("spleen", "above", 0.005, 1e6), ErrorCode::kUnknownName, "spleen");
  refuses(attachment("below", "", 0.005, 1e6), ErrorCode::kUnknownName, "bodies are");
  refuses(attachment("below", "below", 0.005, 1e6), ErrorCode::kInvalidArgument, "itself");
  refuses(attachment("world", "world", 0.005, 1e6), ErrorCode::kInvalidArgument, "itself");
  refuses(attachment("below", "far", 0.005, 1e6), ErrorCode::kMissed, "0.92000");
  AttachCommand nowhere = attachment("below", "above", 0.005, 1e6);
  nowhere.region = Region::sphere(Vec3(5, 5, 5), 0.1);
  refuses(nowhere, ErrorCode::kMissed, "sphere");
  nowhere.region = Region::sphere(Vec3(kNan, 5, 5), 0.1);
  refuses(nowhere, ErrorCode::kInvalidArgument, "region");
  nowhere.region = Region::sphere(Vec3(0, 0, 0), -1.0);
  refuses(nowhere, ErrorCode::kInvalidArgument, "radius");
  nowhere.region = Region::within(boxMesh(Vec3::Ones(), 1, 1, 1), "box.obj");
  refuses(nowhere, ErrorCode::kUnsupported, "box.obj");
  const auto unknown = world.apply(DetachCommand{"ligament", {}});
  ASSERT_FALSE(unknown.ok());
  EXPECT_EQ(unknown.error().code, ErrorCode::kUnknownName);
  EXPECT_NE(unknown.error().detail.find("below-above"), std::string::npos);
  EXPECT_FALSE(world.apply(DetachCommand{"below-above", Region::sphere(Vec3(5, 5, 5), 0.1)}).ok());
  EXPECT_EQ(world.stateHash(), hash);
}

TEST(Attachment, NothingIsPaidWhereThereAreNone) {
  World world(noGround());
  add(world, boxOf("one", Vec3::Constant(0.04), Vec3::Zero(), elastic()));
  add(world, boxOf("two", Vec3::Constant(0.04), Vec3(0, 0, 0.05), elastic()));
  live(world, 0.1);
  const WorldSnapshot shot = seen(world);
  EXPECT_EQ(shot.report.fibres, 0u);
  EXPECT_EQ(shot.report.contact_shapes, 0u) << "no surface was prepared";
  EXPECT_EQ(shot.report.torn, 0u);
}

}  // namespace
}  // namespace meshless
