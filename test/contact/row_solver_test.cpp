// Rows and their solver, without a world.
#include "meshless_surgery/contact/row_solver.h"

#include <gtest/gtest.h>

#include "meshless_surgery/contact/surface_contacts.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "support/random.h"

namespace meshless {
namespace row_solver_test {

constexpr double kH = 0.01;

/// Two blocks of particles that have moved into each other within a substep.
struct Clash {
  explicit Clash(double share, double friction) : mesh(boxMesh(Vec3(0.1, 0.1, 0.1), 2, 2, 2)) {
    const Index count = static_cast<Index>(mesh.vertices.size());
    surface = std::make_unique<ContactSurface>(mesh, ownSupports(count));
    test::Random random(7);
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
      rigid_share = share;
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
      c.friction = friction;
    }
  }

  /// Rows for the places before.
  ContactCounters find(SurfaceContacts& contacts) {
    for (int n = 0; n < 2; ++n) {
      places[n] = before[n];
      colliders[static_cast<std::size_t>(n)].positions = places[n].data();
    }
    scene.h = kH;
    ContactCounters counters;
    contacts.findPairs(scene, colliders, counters);
    contacts.findMoved(scene, colliders);
    contacts.find(scene, colliders, counters);
    for (Index n = 0; n < 2; ++n) contacts.setRigidShare(n, rigid_share);
    return counters;
  }
  /// The bodies would be at `after`; where they come to be is written there.
  SolverCounters move(SurfaceContacts& contacts) {
    for (int n = 0; n < 2; ++n) std::copy(after[n].begin(), after[n].end(), places[n].begin());
    std::vector<SpringRow> springs;
    std::vector<FibreRow> fibres;
    SolverScratch scratch;
    SolverCounters counters;
    SolverStep step;
    step.h = kH;
    contacts.solveIsland(0, step, 0, colliders, {before[0].data(), before[1].data()}, springs, fibres, scratch,
                         counters);
    for (int n = 0; n < 2; ++n) after[n] = places[n];
    return counters;
  }
  /// Nobody has moved yet, and nobody is seen to.
  void stand() {
    for (int n = 0; n < 2; ++n) std::fill(velocities[n].begin(), velocities[n].end(), Vec3::Zero());
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
  std::array<Points, 2> before, after, velocities, places;
  double rigid_share = 0.0;
  SurfaceScene scene;
  std::vector<Collider> colliders{2};
};

SolverCounters solve(Clash& clash, SurfaceContacts& contacts) {
  clash.find(contacts);
  EXPECT_EQ(contacts.islands().size(), 1u);
  return clash.move(contacts);
}

std::vector<ContactRow> rowsOf(const SurfaceContacts& contacts) {
  std::vector<ContactRow> rows;
  const SurfaceMemory memory = contacts.memory();
  for (const KeptPair& pair : memory.pairs) rows.insert(rows.end(), pair.set.rows.begin(), pair.set.rows.end());
  return rows;
}

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
      EXPECT_LT((clash.angular() - angular).norm(), 1e-12 * momentum.norm() * 0.1);
      EXPECT_LT(clash.energy(), energy * (1.0 - 1e-4));
    }
}

TEST(RowSolver, WhoIsHeldStaysAndTheOtherIsStopped) {
  Clash clash(0.0, 0.5);
  std::fill(clash.inverse[0].begin(), clash.inverse[0].end(), 0.0);
  clash.colliders[0].held = true;
  clash.after[0] = clash.before[0];
  SurfaceContacts contacts;
  EXPECT_GT(solve(clash, contacts).active, 0u);
  EXPECT_TRUE(contacts.islands()[0].held);
  for (std::size_t i = 0; i < clash.before[0].size(); ++i) EXPECT_EQ(clash.after[0][i], clash.before[0][i]);
  for (const Vec3& p : clash.after[1]) EXPECT_GT(p.z(), 0.045);
}

// A spring on the corner of a body: what does not move the body as a whole moves the corner, by a tenth of its mass'
// way.
TEST(RowSolver, ASpringMovesTheBodyAsAWholeAndTheRestByItsShare) {
  const std::vector<double> masses = {0.1, 0.2, 0.3, 0.4};
  const Points places = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)};
  for (const bool held : {false, true}) {
    std::vector<Slot> now(4), before(4);
    for (std::size_t i = 0; i < 4; ++i)
      now[i] = before[i] = {places[i].x(), places[i].y(), places[i].z(), 1.0 / masses[i]};
    std::vector<SolverBody> bodies(1);
    bodies[0].now = now.data();
    bodies[0].before = before.data();
    bodies[0].particles = 4;
    bodies[0].edge_length = 1.0;
    bodies[0].rigid_share = 0.9;
    bodies[0].held = held;
    const std::vector<Index> patch = {1, 3};
    const std::vector<double> weights = {0.75, 0.25};
    std::vector<SpringRow> springs(1);
    std::vector<FibreRow> fibres;
    springs[0].patch = &patch;
    springs[0].weights = &weights;
    springs[0].end = Vec3(0.8, 0.3, 0.2);
    springs[0].stiffness = 50.0;
    SolverStep step;
    step.h = 0.1;
    SolverScratch scratch;
    SolverCounters counters;
    std::vector<SolverRows> none;
    solveRows(none, springs, fibres, bodies, step, {}, scratch, counters);
    Vec3 impulse = Vec3::Zero(), couple = Vec3::Zero(), mean = Vec3::Zero();
    for (std::size_t i = 0; i < 4; ++i) {
      const Vec3 way = Vec3(now[i].x, now[i].y, now[i].z) - places[i];
      impulse += masses[i] * way;
      couple += masses[i] * places[i].cross(way);
      if (held) EXPECT_EQ(i == 1 || i == 3, !way.isZero(0.0));
    }
    for (std::size_t k = 0; k < 2; ++k) mean += weights[k] * Vec3(now[patch[k]].x, now[patch[k]].y, now[patch[k]].z);
    const Vec3 given = springs[0].impulse;
    EXPECT_LT((given - 50.0 * 0.01 * (springs[0].end - mean)).norm(), 1e-12) << "the force of its stretch";
    const Vec3 at = 0.75 * places[1] + 0.25 * places[3];
    EXPECT_LT((impulse - (held ? 0.1 : 1.0) * given).norm(), 1e-12);
    EXPECT_LT((couple - (held ? 0.1 : 1.0) * at.cross(given)).norm(), 1e-12);
  }
}

// A point on what is held, but for a share that is rounding: what is free of it would have to go to the moon.
TEST(RowSolver, AGapThatAlmostAllHeldParticlesLackThrowsNobody) {
  for (const double share : {1e-8, 1e-3}) {
    RowSet set;
    ContactRow row;
    row.constant = -0.01;
    row.middle = row.end = 2;
    set.entries = {{1.0 - share, 0}, {share, 1}};
    set.rows.push_back(row);
    std::vector<Slot> now(2), before(2);
    now[1].inverse_mass = 1.0;
    std::vector<SolverBody> bodies(1);
    bodies[0].now = now.data();
    bodies[0].before = before.data();
    bodies[0].particles = 2;
    bodies[0].edge_length = 0.01;
    std::vector<SpringRow> springs;
    std::vector<FibreRow> fibres;
    SolverStep step;
    step.h = kH;
    SolverScratch scratch;
    SolverCounters counters;
    solveRows({{&set, 0, kNoIndex}}, springs, fibres, bodies, step, {}, scratch, counters);
    EXPECT_EQ(counters.active, 0u);
    EXPECT_EQ(now[1].z, 0.0);
  }
}

// Tissue that hangs on held particles but for a rounding: who sleeps there would be woken by who does not, for ever.
TEST(SurfaceContacts, WhoIsHeldIsNotWokenThere) {
  for (const double share : {1e-12, 0.5}) {
    Clash clash(0.0, 0.5);
    const Index count = static_cast<Index>(clash.mesh.vertices.size());
    VertexSupports supports = ownSupports(count);
    for (Index v = count; v-- > 0;) {
      supports.weights[v] = 1.0 - share;
      supports.particles.insert(supports.particles.begin() + v + 1, count);
      supports.weights.insert(supports.weights.begin() + v + 1, share);
    }
    for (Index v = 0; v <= count; ++v) supports.offsets[v] = 2 * v;
    const ContactSurface surface(clash.mesh, supports);
    for (int n = 0; n < 2; ++n) {
      clash.inverse[n].assign(count, 0.0);
      clash.inverse[n].push_back(1.0);
      for (Points* points : {&clash.before[n], &clash.after[n], &clash.velocities[n]})
        points->push_back(points->front());
      Collider& c = clash.colliders[static_cast<std::size_t>(n)];
      c.surface = &surface;
      c.inverse_masses = clash.inverse[n].data();
      c.vertices = clash.before[n].data();
      c.velocities = clash.velocities[n].data();
      c.particles = count + 1;
    }
    clash.colliders[0].moves = false;
    SurfaceContacts contacts;
    clash.find(contacts);
    EXPECT_EQ(contacts.reached().empty(), share < 0.1);
  }
}

// One overlap fades at no speed; where two push against each other nobody goes beyond either, and no impulse builds up
// that would throw who is between them once they part.
TEST(RowSolver, OverlapsFadeWithoutSpeedAndBuildNothingUp) {
  for (const bool jammed : {false, true}) {
    RowSet set;
    for (int n = 0; n < (jammed ? 2 : 1); ++n) {
      ContactRow row;
      row.normal = n == 0 ? Vec3(Vec3::UnitZ()) : Vec3(-Vec3::UnitZ());
      row.constant = -1e-3;
      row.begin = static_cast<Index>(n);
      row.middle = row.end = row.begin + 1;
      set.entries.push_back({1.0, 0});
      set.rows.push_back(row);
    }
    std::vector<Slot> now(1), before(1);
    now[0].inverse_mass = before[0].inverse_mass = 1.0;
    std::vector<SolverBody> bodies(1);
    bodies[0].now = now.data();
    bodies[0].before = before.data();
    bodies[0].particles = 1;
    bodies[0].edge_length = 0.01;
    std::vector<SpringRow> springs;
    std::vector<FibreRow> fibres;
    SolverStep step;
    step.h = step.frame = 1e-3;
    SolverScratch scratch;
    SolverCounters counters;
    double last = 0.0;
    for (int n = 0; n < 600; ++n) {
      solveRows({{&set, 0, kNoIndex}}, springs, fibres, bodies, step, {}, scratch, counters);
      EXPECT_EQ(now[0].z, before[0].z);  // no speed
      for (const ContactRow& row : set.rows) EXPECT_LT(row.impulse.norm(), 1e-12);
      EXPECT_LE(now[0].z - last, 0.5 * 0.01 * step.h * (1.0 + 1e-12));
      last = now[0].z;
    }
    if (jammed)
      EXPECT_LE(std::abs(last), 1e-3);
    else
      EXPECT_NEAR(last, 1e-3, 0.011 * 0.01) << "but for the slop, and no farther";
  }
}

void put(Slot& slot, const Vec3& at) {
  slot.x = at.x();
  slot.y = at.y();
  slot.z = at.z();
}

// Shreds of one body in a tangle, of masses that differ a thousandfold: rows that come and go bring impulses of
// substeps in which all was otherwise, and those must not throw anybody.
TEST(RowSolver, LastImpulsesGiveATangleNoEnergy) {
  for (std::uint64_t seed = 1; seed < 101; ++seed) {
    SCOPED_TRACE(seed);
    test::Random random(seed);
    constexpr Index kParticles = 60;
    std::vector<Slot> now(kParticles), before(kParticles);
    const bool still = seed % 2 == 0;
    double energy = 0.0;  // [kg m^2] times h^-2
    for (Index i = 0; i < kParticles; ++i) {
      now[i].inverse_mass = before[i].inverse_mass = std::pow(10.0, random.uniform(4.0, 7.0));
      put(before[i], Vec3(random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05)));
      const Vec3 way(random.uniform(-1e-4, 1e-4), random.uniform(-1e-4, 1e-4), random.uniform(-1e-4, 1e-4));
      put(now[i], before[i].place() + (still ? Vec3(Vec3::Zero()) : way));
      energy += 0.5 / now[i].inverse_mass * (now[i].place() - before[i].place()).squaredNorm();
    }
    RowSet set;
    for (int n = 0; n < 40; ++n) {
      ContactRow row;
      row.normal = Vec3(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)).normalized();
      row.friction = seed % 3 == 0 ? 0.5 : 0.0;
      row.begin = static_cast<Index>(set.entries.size());
      Vec3 sum = Vec3::Zero();
      for (int k = 0; k < 8; ++k) {
        const Index particle = static_cast<Index>(random.uniform(0.0, kParticles - 1e-9));
        set.entries.push_back({k < 4 ? 0.25 : -0.25, particle});
        sum += set.entries.back().coefficient * before[particle].place();
      }
      row.middle = row.end = static_cast<Index>(set.entries.size());
      row.constant = -row.normal.dot(sum);  // it just touches
      row.impulse = random.uniform(0.0, 1e-9) * row.normal;
      set.rows.push_back(row);
    }
    std::vector<SolverBody> bodies(1);
    bodies[0].now = now.data();
    bodies[0].before = before.data();
    bodies[0].particles = kParticles;
    bodies[0].edge_length = 0.01;
    std::vector<SpringRow> springs;
    std::vector<FibreRow> fibres;
    SolverStep step;
    step.h = step.frame = 1e-3;
    SolverScratch scratch;
    SolverCounters counters;
    solveRows({{&set, 0, 0}}, springs, fibres, bodies, step, {}, scratch, counters);
    double then = 0.0;
    for (Index i = 0; i < kParticles; ++i)
      then += 0.5 / now[i].inverse_mass * (now[i].place() - before[i].place()).squaredNorm();
    EXPECT_LE(then, energy * (1.0 + 1e-9) + 1e-30);
    EXPECT_GT(counters.active, 0u);
  }
}

TEST(RowSolver, RowsPressAndNeverPull) {
  for (const double share : {0.0, 0.9}) {
    Clash clash(share, 0.5);
    SurfaceContacts contacts;
    solve(clash, contacts);
    EXPECT_FALSE(rowsOf(contacts).empty());
    for (const ContactRow& row : rowsOf(contacts)) EXPECT_GE(row.normal.dot(row.impulse), -1e-12);
    contacts.finishIsland(0, kH);
    std::vector<std::pair<Index, Index>> loaded;
    contacts.loadedSurfaces(loaded);
    ASSERT_EQ(loaded.size(), 1u);
    EXPECT_EQ(loaded[0].first, 0u);
    EXPECT_EQ(loaded[0].second, 1u);
  }
}

// What parts is left alone: rows that would have to pull do nothing.
TEST(RowSolver, BodiesThatPartAreLeftAlone) {
  Clash clash(0.4, 0.5);
  for (Vec3& p : clash.after[1]) p.z() += 0.02;
  const std::array<Points, 2> wanted = clash.after;
  SurfaceContacts contacts;
  EXPECT_EQ(solve(clash, contacts).active, 0u);
  for (int n = 0; n < 2; ++n)
    for (std::size_t i = 0; i < wanted[n].size(); ++i) EXPECT_EQ(clash.after[n][i], wanted[n][i]);
}

TEST(RowSolver, FrictionStaysInItsCone) {
  for (const double friction : {0.0, 0.2, 0.7}) {
    Clash clash(0.5, friction);
    SurfaceContacts contacts;
    solve(clash, contacts);
    double across = 0.0;
    for (const ContactRow& row : rowsOf(contacts)) {
      const double press = row.normal.dot(row.impulse);
      EXPECT_LE((row.impulse - press * row.normal).norm(), friction * press + 1e-15);
      across += (row.impulse - press * row.normal).norm();
    }
    EXPECT_EQ(across > 1e-9, friction > 0.0);
  }
}

TEST(SurfaceContacts, RowsThatAreKeptDoTheSameAsRowsFoundAnew) {
  Clash clash(0.4, 0.5), anew(0.4, 0.5);
  for (Clash* each : {&clash, &anew}) each->stand();
  SurfaceContacts contacts, fresh;
  const ContactCounters first = clash.find(contacts);
  EXPECT_GT(first.queries, 0u);
  EXPECT_LE(first.queries, clash.before[0].size() + clash.before[1].size()) << "each vertex once";
  const ContactCounters second = clash.find(contacts);
  EXPECT_EQ(second.queries, 0u);
  EXPECT_EQ(second.contacts, first.contacts);
  clash.move(contacts);
  solve(anew, fresh);
  for (int n = 0; n < 2; ++n)
    for (std::size_t i = 0; i < anew.after[n].size(); ++i) EXPECT_EQ(clash.after[n][i], anew.after[n][i]);
  const std::vector<ContactRow> kept = rowsOf(contacts), found = rowsOf(fresh);
  ASSERT_EQ(kept.size(), found.size());
  for (std::size_t n = 0; n < kept.size(); ++n) EXPECT_EQ(kept[n].impulse, found[n].impulse);
}

TEST(SurfaceContacts, WhoHasMovedIsFoundAnew) {
  Clash clash(0.4, 0.5);
  clash.stand();
  SurfaceContacts contacts;
  clash.find(contacts);
  for (Vec3& p : clash.before[1]) p.x() += 0.02;
  EXPECT_GT(clash.find(contacts).queries, 0u);
}

TEST(SurfaceContacts, WhoSleepsKeepsTheRowsWithTheirForces) {
  Clash clash(0.4, 0.5);
  clash.stand();
  SurfaceContacts contacts;
  solve(clash, contacts);
  contacts.finishIsland(0, kH);
  const std::vector<ContactRow> before = rowsOf(contacts);
  for (Collider& c : clash.colliders) c.moves = false;
  for (int frame = 0; frame < 3; ++frame) {
    const ContactCounters counters = clash.find(contacts);
    EXPECT_EQ(counters.queries, 0u);
    EXPECT_TRUE(contacts.islands().empty());
  }
  for (Collider& c : clash.colliders) c.moves = true;
  EXPECT_EQ(clash.find(contacts).queries, 0u);
  const std::vector<ContactRow> after = rowsOf(contacts);
  ASSERT_EQ(after.size(), before.size());
  double force = 0.0;
  for (std::size_t n = 0; n < after.size(); ++n) {
    EXPECT_EQ(after[n].impulse, before[n].impulse);
    force += after[n].impulse.norm();
  }
  EXPECT_GT(force, 0.0);
}

// Whatever way they had gone before they slept.
TEST(SurfaceContacts, WhoWakesAndMovesIsFoundAnew) {
  Clash clash(0.4, 0.5);
  clash.stand();
  SurfaceContacts contacts;
  clash.find(contacts);
  for (int frame = 0; frame < 10; ++frame) {  // together
    for (Points& points : clash.before)
      for (Vec3& p : points) p.x() += 0.02;
    for (Collider& c : clash.colliders) {
      c.bounds.min.x() += 0.02;
      c.bounds.max.x() += 0.02;
    }
    clash.find(contacts);
  }
  for (Collider& c : clash.colliders) c.moves = false;
  clash.find(contacts);
  for (Collider& c : clash.colliders) c.moves = true;
  clash.find(contacts);
  for (Vec3& p : clash.before[1]) p.x() += 0.03;
  EXPECT_GT(clash.find(contacts).queries, 0u);
}

TEST(SurfaceContacts, WhatIsForgottenIsFoundAnewWithoutForces) {
  Clash clash(0.4, 0.5);
  clash.stand();
  SurfaceContacts contacts;
  solve(clash, contacts);
  contacts.finishIsland(0, kH);
  contacts.forget(1);
  EXPECT_TRUE(rowsOf(contacts).empty());
  EXPECT_GT(clash.find(contacts).queries, 0u);
  for (const ContactRow& row : rowsOf(contacts)) EXPECT_EQ(row.impulse, Vec3::Zero());
}

}  // namespace row_solver_test
}  // namespace meshless
