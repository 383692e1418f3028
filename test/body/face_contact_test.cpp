#include "meshless_surgery/body/face_contact.h"

#include "meshless_surgery/geometry/nearest_on_triangle.h"
#include "support/bodies.h"

namespace meshless {
namespace {

using test::prepared;

double deepest(const BodyModel& model, const BodyState& state, const Vec3& centre, double radius) {
  double depth = 0.0;
  for (const Triangle& t : model.surface.triangles) {
    const auto at = [&](int k) { return state.positions[model.binding.particle[t[k]]]; };
    depth = std::max(depth, radius - (nearestOnTriangle(centre, at(0), at(1), at(2)) - centre).norm());
  }
  return depth;
}

TEST(PushFaces, ASphereSmallerThanTheTrianglesIsPushedOutWithTheImpulseThatIsReported) {
  // Triangles of 3 cm; the sphere of 5 mm meets none of their corners.
  const PreparedBody body = prepared(test::defOf(boxMesh(Vec3(0.09, 0.09, 0.09), 3, 3, 3)));
  const BodyModel& model = *body.model;
  BodyState state = body.state;
  const double radius = 0.005;
  const Vec3 centre(0.007, 0.006, 0.045 + 0.6 * radius);
  EXPECT_NEAR(deepest(model, state, centre, radius), 0.4 * radius, 1e-12);
  Vec3 impulse = Vec3::Zero();
  const auto moved = [&](Index i, const Vec3& shift) { impulse += model.masses[i] * shift; };
  EXPECT_GT(pushFaces(model, centre, radius, state, moved), 0u);
  for (int sweep = 0; sweep < 20; ++sweep) pushFaces(model, centre, radius, state, moved);
  EXPECT_LT(deepest(model, state, centre, radius), 0.01 * radius);
  EXPECT_LT(impulse.z(), 0.0) << "down, away from the sphere";
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    sum += model.masses[i] * (state.positions[i] - body.state.positions[i]);
  EXPECT_LT((sum - impulse).norm(), 1e-15);
  BodyState still = state;
  EXPECT_EQ(pushFaces(model, centre + Vec3(0, 0, 0.1), radius, still, moved), 0u);
  EXPECT_EQ(still.positions, state.positions);
}

TEST(PushFaces, FixedCornersStay) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.09, 0.09, 0.09), 3, 3, 3));
  Box all;
  all.extend(Vec3(-1, -1, -1));
  all.extend(Vec3(1, 1, 1));
  def.fixed.push_back(all);
  const PreparedBody body = prepared(def);
  BodyState state = body.state;
  EXPECT_EQ(pushFaces(*body.model, Vec3(0, 0, 0.045), 0.02, state, [](Index, const Vec3&) {}), 0u);
  EXPECT_EQ(state.positions, body.state.positions);
}

}  // namespace
}  // namespace meshless
