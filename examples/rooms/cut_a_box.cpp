// A soft box falls onto the ground, and is cut in two.
#include <cstdio>

#include <meshless_surgery/geometry/mesh/primitives.h>
#include <meshless_surgery/world/world.h>

int main() {
  using namespace meshless;
  BodyDef box;
  box.name = "box";
  box.mesh = boxMesh(Vec3(0.1, 0.1, 0.1), 4, 4, 4);
  box.pose.translation = Vec3(0.0, 0.0, 0.1);
  auto body = prepareBody(std::move(box));
  World world{WorldSettings{}};
  if (!body.ok() || !world.addSceneBody(std::make_shared<PreparedBody>(std::move(*body))).ok()) return 1;
  for (int i = 0; i < 120; ++i) world.step();

  CutCommand cut;  // in the plane x = 0, without end
  cut.blades.origin = Vec3(0.0, -1.0, 0.0);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3::UnitZ();
  const auto done = world.apply(cut);
  if (!done.ok()) {
    std::fprintf(stderr, "%s\n", done.error().detail.c_str());
    return 1;
  }
  SnapshotWants measures;
  measures.measures = true;
  for (const BodySnapshot& piece : world.snapshot(measures).bodies)
    std::printf("%s: %.1f ml\n", piece.name.c_str(), 1e6 * piece.measures.volume);
  return 0;
}
