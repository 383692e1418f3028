// Rows and their solver, without a world.
#include "meshless_surgery/contact/row_solver.h"

#include <gtest/gtest.h>

#include "meshless_surgery/contact/surface_contacts.h"
#include "meshless_surgery/geometry/primitives.h"
#include "support/random.h"

namespace meshless {
namespace {

constexpr double kH = 0.01;

/// Two blocks of particles that have moved into each other within a substep.
struct Clash {
  explicit Clash(double share, double friction) : mesh(boxMesh(Vec3(0.1, 0.1, 0.1), 2, 2, 2)) {
    const Index count = static_cast<Index>(mesh.vertices.size());
    surface = std::make_unique<ContactSurface>(mesh, ownSupports(count));
    test::Random random(7);
    std::vector<Index> members;
    std::vector<double> weights(count, 1.0);
    for (Index i = 0; i < count; ++i) members.push_back(i);
    for (int n = 0; n < 2; ++n) {
      for (Index i = 0; i < count; ++i) {
        masses[n].push_back(random.uniform(0.1, 0.5));
        inverse[n].push_back(1.0 / masses[n].back());
        Vec3 p = mesh.vertices[i];
        if (n == 1) p = Quat(Eigen::AngleAxisd(0.3, Vec3(0.1, 0.2, 1.0).normalized())) * p + Vec3(0.02, 0.03, 0.1035);
        before[n].push_back(p);
        velocities[n].push_back(Vec3(0.3, 0.1, n == 1 ? -0.8 : 0.0) +
                                Vec3(random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1)));
        after[n].push_back(p + kH * velocities[n].back());
      }
      groups[n] = std::make_unique<RigidGroups>(std::vector<Index>{0, count}, members, weights, masses[n]);
      Collider& c = colliders[static_cast<std::size_t>(n)];
      c.key = static_cast<std::uint64_t>(n + 1);
      for (const Vec3& p : before[n]) c.bounds.extend(p);
      for (const Vec3& p : after[n]) c.bounds.extend(p);
      c.edge_length = surface->edge_length;
      c.surface = surface.get();
      c.vertices = before[n].data();
      c.positions = after[n].data();
      c.velocities = velocities[n].data();
      c.inverse_masses = inverse[n].data();
      c.particles = count;
      c.groups = groups[n].get();
      c.rigid_share = share;
      c.friction = friction;
    }
  }

  void find(SurfaceContacts& contacts) {
    for (int n = 0; n < 2; ++n) colliders[static_cast<std::size_t>(n)].positions = before[n].data();
    SurfaceScene scene;
    scene.h = kH;
    ContactCounters counters;
    contacts.begin(colliders);
    contacts.findPairs(scene, colliders, counters);
    contacts.find(scene, colliders, counters);
  }

  Vec3 momentum() const {
    Vec3 sum = Vec3::Zero();
    for (int n = 0; n < 2; ++n)
      for (std::size_t i = 0; i < masses[n].size(); ++i) sum += masses[n][i] * (after[n][i] - before[n][i]);
    return sum;
  }
  Vec3 angular() const {
    Vec3 sum = Vec3::Zero();
    for (int n = 0; n < 2; ++n)
      for (std::size_t i = 0; i < masses[n].size(); ++i)
        sum += masses[n][i] * after[n][i].cross(after[n][i] - before[n][i]);
    return sum;
  }
  double energy() const {
    double sum = 0.0;
    for (int n = 0; n < 2; ++n)
      for (std::size_t i = 0; i < masses[n].size(); ++i)
        sum += masses[n][i] * (after[n][i] - before[n][i]).squaredNorm();
    return sum;
  }

  TriangleMesh mesh;
  std::unique_ptr<ContactSurface> surface;
  std::array<std::vector<double>, 2> masses, inverse;
  std::array<Points, 2> before, after, velocities;
  std::array<std::unique_ptr<RigidGroups>, 2> groups;
  std::vector<Collider> colliders{2};
};

/// Rows for the places before, solved for the places after.
SolverCounters solve(Clash& clash, SurfaceContacts& contacts) {
  clash.find(contacts);
  EXPECT_EQ(contacts.islands().size(), 1u);
  SolverScratch scratch;
  contacts.beginIsland(0, scratch);
  const Points moved[2] = {clash.after[0], clash.after[1]}, old[2] = {clash.before[0], clash.before[1]};
  // The colliders' arrays are those that are moved.
  for (int n = 0; n < 2; ++n) {
    clash.before[n] = moved[n];
    contacts.setPrevious(static_cast<Index>(n), old[n].data());
  }
  std::vector<SpringRow> springs;
  SolverCounters counters;
  SolverStep step;
  step.h = kH;
  contacts.solveIsland(0, step, true, springs, scratch, counters);
  for (int n = 0; n < 2; ++n) {
    clash.after[n] = clash.before[n];
    clash.before[n] = old[n];
  }
  return counters;
}

// Angular momentum: the limit of motion parts what would cross along normals of the substep's start, by points of its
// end. What that turns is bounded here; rows alone keep it to rounding.
TEST(RowSolver, KeepsMomentumWhateverShareIsRigidAndTakesEnergy) {
  for (const double share : {0.0, 0.4, 0.9, 1.0})
    for (const double friction : {0.0, 0.5, 5.0}) {
      SCOPED_TRACE(std::to_string(share) + " " + std::to_string(friction));
      Clash clash(share, friction);
      const Vec3 momentum = clash.momentum(), angular = clash.angular();
      const double energy = clash.energy();
      SurfaceContacts contacts;
      EXPECT_GT(solve(clash, contacts).active, 0u);
      EXPECT_LT((clash.momentum() - momentum).norm(), 1e-12 * momentum.norm());
      EXPECT_LT((clash.angular() - angular).norm(), 3e-3 * momentum.norm() * 0.1);
      EXPECT_LT(clash.energy(), energy * (1.0 - 1e-4));
    }
}

TEST(RowSolver, RowsPressAndNeverPull) {
  for (const double share : {0.0, 0.9}) {
    Clash clash(share, 0.5);
    SurfaceContacts contacts;
    solve(clash, contacts);
    for (const ContactRow& row : contacts.rows()) EXPECT_GE(row.normal.dot(row.impulse), -1e-12);
    contacts.finishIsland(0, kH);
    std::vector<LoadedSurfaces> loaded;
    contacts.loadedSurfaces(loaded);
    ASSERT_EQ(loaded.size(), 1u);
    EXPECT_EQ(loaded[0].a, 0u);
    EXPECT_EQ(loaded[0].b, 1u);
  }
}

TEST(RowSolver, FrictionStaysInItsCone) {
  for (const double friction : {0.0, 0.2, 0.7}) {
    Clash clash(0.5, friction);
    SurfaceContacts contacts;
    solve(clash, contacts);
    for (const ContactRow& row : contacts.rows()) {
      const double press = row.normal.dot(row.impulse);
      EXPECT_LE((row.impulse - press * row.normal).norm(), friction * press + 1e-15);
    }
  }
}

TEST(RowSolver, MemoryComesBackFromItsBytesAndForgetsWhatIsGone) {
  Clash clash(0.5, 0.5);
  SurfaceContacts contacts;
  solve(clash, contacts);
  contacts.finishIsland(0, kH);
  const ContactMemory memory = contacts.memory();
  EXPECT_FALSE(memory.forces.empty());
  EXPECT_FALSE(memory.sides.empty());
  EXPECT_EQ(memory.fault(), "");
  std::string bytes;
  OutArchive out(bytes);
  out(memory);
  ContactMemory read;
  InArchive in(bytes);
  in(read);
  ASSERT_EQ(read.forces.size(), memory.forces.size());
  EXPECT_EQ(read.forceOf(memory.forces[0].key), memory.forces[0].force);
  contacts.forget(1);
  EXPECT_TRUE(contacts.memory().forces.empty());
  read.forces[0].force.x() = std::nan("");
  EXPECT_NE(read.fault(), "");
}

}  // namespace
}  // namespace meshless
