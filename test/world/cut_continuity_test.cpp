// In the step after a cut, tissue moves as it would have without it, but for what the released forces explain.
#include <algorithm>

#include <Eigen/Dense>

#include "support/bodies.h"
#include "support/random.h"

namespace meshless {
namespace cut_continuity_test {

/// A motion of points as a whole: the rigid one nearest to it in the least squares, and what it leaves.
struct Rest {
  double rigid = 0.0;      // [m] the largest share of the rigid motion
  double deforming = 0.0;  // [m]
};

Rest splitMotion(const Points& at, const Points& moves) {
  Vec3 centre = Vec3::Zero(), mean = Vec3::Zero();
  const double n = static_cast<double>(at.size());
  for (std::size_t i = 0; i < at.size(); ++i) {
    centre += at[i] / n;
    mean += moves[i] / n;
  }
  Mat3 inertia = Mat3::Zero();
  Vec3 momentum = Vec3::Zero();
  for (std::size_t i = 0; i < at.size(); ++i) {
    const Vec3 r = at[i] - centre;
    inertia += r.squaredNorm() * Mat3::Identity() - r * r.transpose();
    momentum += r.cross(moves[i] - mean);
  }
  const Vec3 spin = inertia.ldlt().solve(momentum);
  Rest rest;
  for (std::size_t i = 0; i < at.size(); ++i) {
    const Vec3 rigid = mean + spin.cross(at[i] - centre);
    rest.rigid = std::max(rest.rigid, rigid.norm());
    rest.deforming = std::max(rest.deforming, (moves[i] - rigid).norm());
  }
  return rest;
}

constexpr double kRate = 1440.0;    // [1/s] of elastic worlds
constexpr double kSpacing = 0.012;  // [m]
constexpr double kSeen = 0.3;       // of it, in a step

struct Scenario {
  const char* name;
  bool elastic, spinning, picked, loaded;
  double deforms;  // of the largest move in the step: by how much the pieces may deform otherwise than uncut
};

World worldOf(const Scenario& s) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.2, 0.08, 0.08), 16, 6, 6), "bar");
  def.pose.translation = Vec3(0, 0, 0.2);
  def.spacing = kSpacing;
  def.material.damping = 2.0;
  if (s.elastic) {
    def.material.youngs_modulus = 5000.0;
    def.material.poissons_ratio = 0.4;
  }
  PreparedBody body = test::prepared(def);
  if (s.spinning)
    for (std::size_t i = 0; i < body.state.positions.size(); ++i)
      body.state.velocities[i] =
          Vec3(2, 3, 4).cross(body.state.positions[i] - def.pose.translation) + Vec3(0.1, 0, 0.2);
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kNone;
  // A step is a substep, of the whole and of its pieces.
  if (s.elastic) settings.step_rate = kRate;
  World world(settings);
  EXPECT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(body)).ok());
  for (int side : {-1, 1}) {
    if (!s.picked && !s.loaded) continue;
    if (!s.loaded && side < 0) continue;
    PickCommand pick;
    pick.point = Vec3(0.1 * side, 0, 0.2);
    pick.stiffness = s.loaded ? 2000.0 : 100.0;
    const PickReply grabbed = test::replyOf<PickReply>(world.apply(pick));
    MovePickCommand move;
    move.pick = grabbed.pick;
    move.target = pick.point + (s.loaded ? Vec3(0.06 * side, 0, 0.06) : Vec3(0.03, 0.02, 0.04));
    test::replyOf<Done>(world.apply(move));
  }
  const double seconds = 0.5;
  for (int k = 0; k < seconds * settings.step_rate; ++k) world.step();
  EXPECT_TRUE(!s.elastic || world.snapshot({}).report.substeps == 1u);
  return world;
}

/// Askew through the middle.
CutCommand cutOf(const BodySnapshot& body) {
  CutCommand cut;
  const Vec3 normal = Vec3(1.0, 0.3, 0.2).normalized();
  cut.blades.x_axis = normal.unitOrthogonal();
  cut.blades.y_axis = normal.cross(cut.blades.x_axis);
  cut.blades.origin = body.measures.centre_of_mass - 10.0 * cut.blades.x_axis + Vec3(0.01, 0, 0);
  return cut;
}

Vec3 angularMomentumOf(const BodySnapshot& body) {
  return body.measures.angular_momentum + body.measures.centre_of_mass.cross(body.measures.linear_momentum);
}

/// Nothing is lent from one piece to the other.
void expectKept(World& cut, const BodySnapshot& whole) {
  for (int step = 0; step < 40; ++step) {
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
    for (const BodySnapshot& piece : cut.snapshot({false, false, true}).bodies) {
      linear += piece.measures.linear_momentum;
      angular += angularMomentumOf(piece);
    }
    EXPECT_LT((linear - whole.measures.linear_momentum).norm(), 1e-11 * linear.norm()) << step;
    EXPECT_LT((angular - angularMomentumOf(whole)).norm(), 1e-11 * angular.norm()) << step;
    cut.step();
  }
}

// What a cut releases begins at its cells, and goes from there through the tissue.
TEST(CutContinuity, TheNextStepOfFilledCellsIsAnotherBesideTheCutAlone) {
  const SnapshotWants wants{true, true, true};
  // A free body gives back as a spin what its viscosity leaks of its angular momentum: pieces each their own.
  const struct {
    Scenario scenario;
    double far;  // of the largest move in the step, likewise, of tissue that is not beside the cut
  } cases[] = {{{"spinning", true, true, false, false, 0.05}, 1e-4},
               {{"spinning and picked", true, true, true, false, 0.6}, 0.01},
               {{"stretched and bent", true, false, false, true, 0.5}, 1e-3}};
  for (const auto& [scenario, far] : cases) {
    SCOPED_TRACE(scenario.name);
    World uncut = worldOf(scenario), cut = worldOf(scenario);
    const BodySnapshot start = uncut.snapshot(wants).bodies[0];
    const CutCommand command = cutOf(start);
    test::replyOf<CutReply>(cut.apply(command));
    const std::vector<BodySnapshot> fresh = cut.snapshot(wants).bodies;
    ASSERT_EQ(fresh.size(), 2u);
    uncut.step();
    cut.step();
    const BodySnapshot whole = uncut.snapshot(wants).bodies[0];
    const std::vector<BodySnapshot> pieces = cut.snapshot(wants).bodies;
    const Vec3 normal = command.blades.x_axis.cross(command.blades.y_axis);
    double move = 0.0, most_beside = 0.0, most_far = 0.0;
    for (std::size_t i = 0; i < start.particles.size(); ++i)
      move = std::max(move, (whole.particles[i] - start.particles[i]).norm());
    ASSERT_GT(move, 4e-4);
    std::size_t far_away = 0;
    for (std::size_t p = 0; p < 2; ++p)
      for (std::size_t i = 0; i < fresh[p].particles.size(); ++i) {
        const Vec3& was = fresh[p].particles[i];
        const auto at = std::find(start.particles.begin(), start.particles.end(), was);
        ASSERT_NE(at, start.particles.end());
        const double differs = (pieces[p].particles[i] - whole.particles[at - start.particles.begin()]).norm();
        const bool beside = std::abs(normal.dot(was - command.blades.origin)) < 3.0 * kSpacing;
        far_away += !beside;
        double& most = beside ? most_beside : most_far;
        most = std::max(most, differs);
      }
    EXPECT_GT(5 * far_away, start.particles.size());
    EXPECT_LE(most_beside, scenario.deforms * move);
    EXPECT_LE(most_far, far * move);
    if (scenario.picked || scenario.loaded) continue;
    expectKept(cut, whole);
  }
}

}  // namespace cut_continuity_test
}  // namespace meshless
