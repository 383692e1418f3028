#include "meshless_surgery/body/ease.h"

#include <map>

#include "meshless_surgery/body/deform.h"
#include "support/bodies.h"

namespace meshless {
namespace ease_test {

constexpr double kStep = 1.0 / 120;  // [s]

std::vector<BodyPiece> eased(const PreparedBody& body, bool held) {
  Result<CutBody> cut = cutBody(*body.model, body.state, {Vec3(1.0, 0.2, 0.1).normalized(), Vec3(0.01, 0, 0)});
  EXPECT_TRUE(cut.ok());
  std::vector<Index> particles;
  for (Index i = 0; held && i < body.model->rest.size(); ++i) particles.push_back(i);
  easeRelease(*body.model, body.state, body.def.material, kStep, particles, cut->pieces);
  return std::move(cut->pieces);
}

PreparedBody bent(bool elastic) {
  BodyDef def = test::block("b", Vec3::Zero());
  def.spacing = 0.02;
  if (elastic) def.material.youngs_modulus = 5000.0;
  PreparedBody body = test::prepared(def);
  for (Vec3& p : body.state.positions) p = Vec3(1.2 * p.x(), p.y() + 2.0 * p.x() * p.x(), 0.9 * p.z());
  updateSurface(*body.model, body.state);
  return body;
}

TEST(EaseRelease, OfAFreeBodyHasNoForceAndNoTorqueOnAnyPiece) {
  for (const BodyPiece& piece : eased(bent(false), false)) {
    ASSERT_EQ(piece.state.eased.size(), piece.model->rest.size());
    Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
    double size = 0.0;
    for (std::size_t i = 0; i < piece.state.eased.size(); ++i) {
      const Vec3 f = piece.model->masses[i] * piece.state.eased[i];
      force += f;
      torque += piece.state.positions[i].cross(f);
      size += f.norm();
    }
    EXPECT_GT(size, 0.0);
    EXPECT_LT(force.norm(), 1e-10 * size);
    EXPECT_LT(torque.norm(), 1e-10 * size);
  }
}

TEST(EaseRelease, OfAHeldBodyIsEqualAndOppositeOnBothSides) {
  Vec3 both = Vec3::Zero();
  double one = 0.0;
  for (const BodyPiece& piece : eased(bent(false), true)) {
    Vec3 force = Vec3::Zero();
    for (std::size_t i = 0; i < piece.state.eased.size(); ++i) force += piece.model->masses[i] * piece.state.eased[i];
    both += force;
    one = std::max(one, force.norm());
  }
  EXPECT_GT(one, 0.0);
  EXPECT_LT(both.norm(), 1e-9 * one);
}

using Corners = std::array<Index, 8>;

/// Particles of which no cell has been cut: they have all the cells that they had.
std::vector<bool> uncutParticles(const BodyPiece& piece, const CellLattice& parent) {
  std::map<Corners, const LatticeCell*> known;
  std::vector<int> had(parent.corners, 0);
  for (const LatticeCell& cell : parent.cells) {
    known[cell.corners] = &cell;
    for (const Index i : cell.corners) ++had[i];
  }
  std::vector<int> has(piece.model->rest.size(), 0);
  for (const LatticeCell& cell : piece.model->lattice->cells) {
    Corners was;
    for (int k = 0; k < 8; ++k) was[k] = piece.parent_particles[cell.corners[k]];
    const auto at = known.find(was);
    if (at == known.end() || at->second->filled != cell.filled || at->second->parted != cell.parted) continue;
    for (const Index i : cell.corners) ++has[i];
  }
  std::vector<bool> uncut(has.size(), false);
  for (std::size_t i = 0; i < has.size(); ++i) {
    const Index old = piece.parent_particles[i];
    uncut[i] = old != kNoIndex && has[i] == had[old];
  }
  return uncut;
}

// They need nothing eased: whoever has no cell that was cut is accelerated as in the whole.
TEST(EaseRelease, FilledCellsPullAsBeforeButForWhatWasCut) {
  const PreparedBody body = bent(true);
  const CellLattice& lattice = *body.model->lattice;
  for (const bool held : {false, true}) {
    const std::vector<BodyPiece> pieces = eased(body, held);
    double fastest = body.model->highest_frequency;
    for (const BodyPiece& piece : pieces) fastest = std::max(fastest, piece.model->highest_frequency);
    const double h = 0.5 / fastest;
    const auto stepped = [&](const BodyModel& model, BodyState state) {
      StepScratch scratch;
      MatchCounters counters;
      matchAndMove(model, body.def.material, Vec3::Zero(), h, state, scratch, counters);
      return state.velocities;
    };
    const Points whole = stepped(*body.model, body.state);
    double largest = 0.0;
    for (const Vec3& v : whole) largest = std::max(largest, v.norm());
    ASSERT_GT(largest, 0.01);
    std::size_t same = 0;
    for (const BodyPiece& piece : pieces) {
      EXPECT_TRUE(piece.state.eased.empty());
      const Points velocities = stepped(*piece.model, piece.state);
      const std::vector<bool> uncut = uncutParticles(piece, lattice);
      Vec3 momentum = Vec3::Zero(), angular = Vec3::Zero();
      double size = 0.0;
      for (std::size_t i = 0; i < velocities.size(); ++i) {
        const Vec3 p = piece.model->masses[i] * velocities[i];
        momentum += p;
        angular += piece.state.positions[i].cross(p);
        size += p.norm();
        if (!uncut[i]) continue;
        ++same;
        EXPECT_LT((velocities[i] - whole[piece.parent_particles[i]]).norm(), 1e-9 * largest);
      }
      EXPECT_LT(momentum.norm(), 1e-10 * size);
      EXPECT_LT(angular.norm(), 1e-10 * size);
    }
    EXPECT_GT(2 * same, whole.size());
  }
}

TEST(EaseRelease, FadesAndIsGone) {
  EXPECT_EQ(easedShare(0.0), 1.0);
  EXPECT_GT(easedShare(kStep), 0.98);
  EXPECT_EQ(easedShare(kEaseTime), 0.0);
  const PreparedBody body = bent(false);
  for (bool held : {false, true}) {
    BodyPiece piece = eased(body, held)[0];
    StepScratch scratch;
    MatchCounters counters;
    for (double t = 0.0; t < kEaseTime - 1.5 * kStep; t += kStep) {
      matchAndMove(*piece.model, body.def.material, Vec3::Zero(), kStep, piece.state, scratch, counters);
      EXPECT_FALSE(piece.state.eased.empty()) << t;
    }
    for (int k = 0; k < 2; ++k)
      matchAndMove(*piece.model, body.def.material, Vec3::Zero(), kStep, piece.state, scratch, counters);
    EXPECT_TRUE(piece.state.eased.empty());
    EXPECT_TRUE(test::allFinite(piece.state.positions));
  }
}

TEST(EaseRelease, ABodyAtRestHasNothingToEase) {
  const PreparedBody body = test::prepared(test::block("b", Vec3::Zero()));
  for (const BodyPiece& piece : eased(body, false)) EXPECT_TRUE(piece.state.eased.empty());
}

}  // namespace ease_test
}  // namespace meshless
