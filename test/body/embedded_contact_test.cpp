#include "meshless_surgery/body/embedded_contact.h"

#include <algorithm>

#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/geometry/measures.h"
#include "support/bodies.h"

namespace meshless {
namespace {

using test::prepared;

TEST(PushEmbedded, LeaveTheObstacleAndMoveTheBodyByTheImpulseGiven) {
  PreparedBody body = prepared(test::ball("b", Vec3::Zero()));
  const Result<CutBody> cut = cutBody(*body.model, body.state, {Vec3::UnitZ(), Vec3(0, 0, 0.001)});
  ASSERT_TRUE(cut.ok());
  for (const BodyPiece& piece : cut->pieces) {
    ASSERT_FALSE(piece.model->binding.embedded.empty());
    // A floor a little above the cut (for the upper half), a ceiling a little below it (for the lower).
    const bool upper = solidCentroid(piece.state.surface, piece.model->surface.triangles).z() > 0;
    const double level = upper ? 0.003 : -0.001;
    const Obstacle obstacle = [&](const Vec3& p) -> Vec3 {
      const double depth = upper ? level - p.z() : p.z() - level;
      return depth > 0 ? Vec3(0, 0, upper ? depth : -depth) : Vec3::Zero();
    };
    BodyState state = piece.state;
    const Vec3 before = measureBody(*piece.model, state).centre_of_mass;
    Vec3 impulse = Vec3::Zero();
    const auto moved = [&](Index i, const Vec3& shift) { impulse += piece.model->masses[i] * shift; };
    EXPECT_GT(pushEmbedded(*piece.model, obstacle, state, moved), 10u);
    const Vec3 after = measureBody(*piece.model, state).centre_of_mass;
    EXPECT_LT((piece.model->mass * (after - before) - impulse).norm(), 1e-12);
    EXPECT_GT(upper ? impulse.z() : -impulse.z(), 0.0);
    EXPECT_LT((after - before).norm(), 0.004) << "the push overshot";
    updateSurface(*piece.model, state);
    for (Index v : piece.model->binding.embedded) EXPECT_LT(obstacle(state.surface[v]).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace meshless
