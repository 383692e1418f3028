// What a cut leaves pulls as before but for what was cut.
#include <map>

#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/body/deform.h"
#include "support/bodies.h"

namespace meshless {
namespace cut_release_test {

PreparedBody bent() {
  BodyDef def = test::block("b", Vec3::Zero());
  def.spacing = 0.02;
  def.material.youngs_modulus = 5000.0;
  PreparedBody body = test::prepared(def);
  for (Vec3& p : body.state.positions) p = Vec3(1.2 * p.x(), p.y() + 2.0 * p.x() * p.x(), 0.9 * p.z());
  updateSurface(*body.model, body.state);
  return body;
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

// Whoever has no cell that was cut is accelerated as in the whole.
TEST(CutRelease, CellsPullAsBeforeButForWhatWasCut) {
  const PreparedBody body = bent();
  const CellLattice& lattice = *body.model->lattice;
  {
    const Result<CutBody> cut =
        cutBody(*body.model, body.state, Blade::through({Vec3(1.0, 0.2, 0.1).normalized(), Vec3(0.01, 0, 0)}));
    ASSERT_TRUE(cut.ok());
    const std::vector<BodyPiece>& pieces = cut->pieces;
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

}  // namespace cut_release_test
}  // namespace meshless
