// Where the image of a file lies, whatever becomes of its surface.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/world/baked_colors.h"
#include "meshless_surgery/world/saved_world.h"
#include "support/bodies.h"
#include "support/textured.h"

namespace meshless {
namespace texture_test {

BodyDef textured(const test::TexturedCube& cube, bool elastic, const std::string& name = "cube") {
  BodyDef def = test::defOf(cube.mesh, name);
  def.texture = cube.map();
  def.pose = {Quat(0.8, 0.3, -0.4, 0.2).normalized(), Vec3(0.1, 0.2, 0.4)};
  def.material.appearance.outer = test::sixColors();
  if (elastic) {
    def.material.youngs_modulus = 20000.0;
    def.material.poissons_ratio = 0.4;
    def.spacing = 0.025;
  }
  return def;
}

World of(const BodyDef& def, bool weightless = true) {
  World world(weightless ? test::weightless() : WorldSettings());
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  return world;
}

/// The law: each triangle of the outer surface shows the part of its side, and each vertex that side's colour.
void expectSides(World& world, const test::TexturedCube& cube, std::size_t bodies, float within = 2e-6f) {
  const WorldSnapshot shot = world.snapshot({});
  EXPECT_EQ(bodies, shot.bodies.size());
  for (const BodySnapshot& body : shot.bodies) {
    const TriangleMesh& surface = body.model->surface;
    const VertexColors colors = bakeColors(*body.model, body.material);
    ASSERT_EQ(3 * surface.triangles.size(), colors.texture.size()) << body.name;
    Points own;
    for (const Vec3& v : surface.vertices) own.push_back(body.model->own * v);
    std::vector<std::set<int>> sides(own.size());
    std::size_t outer = 0;
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
      const Triangle& corners = surface.triangles[t];
      const Vec3 normal = test::TexturedCube::normal(own, corners);
      const int side = test::sideOf(normal);
      for (std::size_t k = 0; k < 3; ++k) {
        const TexturePoint& found = colors.texture[3 * t + k];
        if (isCutPatch(surface.patchOf(t))) {
          EXPECT_EQ((TexturePoint{0.0f, 0.0f}), found);
          continue;
        }
        sides[corners[k]].insert(side);
        if (normal.norm() > 1e-9 * cube.size * cube.size) {
          EXPECT_LT(test::apart(cube.at(side, own[corners[k]]), found), within) << body.name << " " << t;
        }
      }
      outer += !isCutPatch(surface.patchOf(t));
    }
    EXPECT_GT(outer, 10u);
    for (std::size_t v = 0; v < own.size(); ++v) {
      if (sides[v].empty()) continue;
      const auto shows = [&](int side) {
        const Color wanted = test::colorOfSide(side), found = colors.outer[v];
        return std::abs(wanted.r - found.r) + std::abs(wanted.g - found.g) + std::abs(wanted.b - found.b) < 1e-3f;
      };
      EXPECT_TRUE(std::any_of(sides[v].begin(), sides[v].end(), shows)) << body.name << " vertex " << v;
    }
  }
}

CutCommand cutAt(const Vec3& point, const Vec3& normal) {
  CutCommand cut;
  cut.blades.x_axis = normal.unitOrthogonal();
  cut.blades.y_axis = normal.normalized().cross(cut.blades.x_axis);
  cut.blades.origin = point - 10.0 * cut.blades.x_axis;
  return cut;
}

void run(World& world, int steps) {
  for (int k = 0; k < steps; ++k) world.step();
}

TEST(Texture, SidesKeepTheirPartThroughCutsUndoAndReset) {
  for (const bool elastic : {false, true})
    for (const bool mirrored : {false, true}) {
      const test::TexturedCube cube(0.1, 3, mirrored);
      World world = of(textured(cube, elastic));
      expectSides(world, cube, 1);
      ASSERT_TRUE(world.apply(cutAt(Vec3(0.11, 0.2, 0.4), Vec3(1, 0.3, 0.2))).ok());
      expectSides(world, cube, 2);
      ASSERT_TRUE(world.apply(cutAt(Vec3(0.1, 0.21, 0.4), Vec3(-0.2, 0.8, 0.5))).ok());
      expectSides(world, cube, 4);
      ASSERT_TRUE(world.apply(UndoCutCommand{}).ok());
      expectSides(world, cube, 2);
      world.reset();
      expectSides(world, cube, 1);
    }
}

TEST(Texture, SidesKeepTheirPartWhereADeformedBodyIsCut) {
  for (const bool elastic : {false, true}) {
    const test::TexturedCube cube(0.1);
    World world = of(textured(cube, elastic), false);
    run(world, 90);  // it falls on a corner
    const Vec3 centre =
        solidCentroid(world.snapshot({true}).bodies[0].surface, world.snapshot({}).bodies[0].model->surface.triangles);
    ASSERT_TRUE(world.apply(cutAt(centre, Vec3(0.4, 0.3, 0.8))).ok());
    expectSides(world, cube, 2, 1e-4f);
  }
}

TEST(Texture, SidesKeepTheirPartThroughAnIncision) {
  for (const bool elastic : {false, true}) {
    const test::TexturedCube cube(0.1, 4);
    BodyDef def = textured(cube, elastic);
    def.pose = Pose();
    World world = of(def);
    InciseCommand incise;
    incise.blade.origin = Vec3(-0.021, 0.004, 0.06);
    incise.blade.x_axis = Vec3::UnitX();
    incise.blade.y_axis = Vec3::UnitZ();
    incise.blade.length = 0.04;
    incise.blade.depth = 0.04;
    const auto done = world.apply(incise);
    ASSERT_TRUE(done.ok()) << done.error().detail;
    EXPECT_TRUE(world.snapshot({}).bodies[0].model->incised);
    expectSides(world, cube, 1, 1e-4f);
  }
}

TEST(Texture, WithoutAnImageOrAMapThereIsNone) {
  const test::TexturedCube cube(0.1);
  BodyDef plain = textured(cube, false), primitive = plain;
  plain.material.appearance.outer = Look();
  primitive.texture = nullptr;
  for (const BodyDef& def : {plain, primitive}) {
    World world = of(def);
    const BodySnapshot body = world.snapshot({}).bodies.at(0);
    EXPECT_TRUE(bakeColors(*body.model, body.material).texture.empty());
    EXPECT_EQ(!def.texture, bakeColors(*body.model, body.material).outer.size() > 0);  // along the axes
  }
}

World severalCut(std::size_t bodies, const TextureMapPtr& map, const test::TexturedCube& cube) {
  World world(test::weightless());
  for (std::size_t k = 0; k < bodies; ++k) {
    BodyDef def = textured(cube, k % 2 == 1, "cube_" + std::to_string(k));
    def.texture = map;
    def.pose.translation.x() = 0.3 * static_cast<double>(k);
    EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  }
  EXPECT_TRUE(world.apply(cutAt(Vec3(0, 0.2, 0.41), Vec3(0.1, 0.2, 1))).ok());
  return world;
}

TEST(Texture, ComesAlongWithASavedStateOnce) {
  const test::TexturedCube cube(0.1);
  World world = severalCut(4, cube.map(), cube);
  const auto bytes = encode(*world.capture(), "here");
  const std::size_t plain = encode(*severalCut(4, nullptr, cube).capture(), "here").size();
  const std::size_t once = sizeof(Vec3) * cube.mesh.vertices.size() +
                           (sizeof(Triangle) + 3 * sizeof(TexturePoint)) * cube.mesh.triangles.size();
  EXPECT_GT(bytes.size(), plain + once);
  EXPECT_LT(bytes.size(), plain + once + 200);
  const auto decoded = decode(bytes);
  ASSERT_TRUE(decoded.ok()) << decoded.error().detail;
  World again{WorldSettings()};
  again.restore(*decoded->world);
  EXPECT_EQ(world.stateHash(), again.stateHash());
  EXPECT_NE(severalCut(4, test::TexturedCube(0.1, 3, true).map(), cube).stateHash(), world.stateHash());
  const WorldSnapshot before = world.snapshot({}), after = again.snapshot({});
  for (std::size_t b = 0; b < before.bodies.size(); ++b) {
    EXPECT_EQ(after.bodies[0].model->texture, after.bodies[b].model->texture);
    const auto points = [](const BodySnapshot& body) { return bakeColors(*body.model, body.material).texture; };
    ASSERT_FALSE(points(before.bodies[b]).empty());
    EXPECT_EQ(points(before.bodies[b]), points(after.bodies[b])) << before.bodies[b].name;
  }
  again.reset();
  expectSides(again, cube, 4);
}

TEST(Texture, IsCountedOnceInMemory) {
  const test::TexturedCube cube(0.1, 20);
  const TextureMapPtr map = cube.map();
  const auto held = [](const World& world) { return world.memory().models + world.memory().kept; };
  const std::size_t with = held(severalCut(2, map, cube)), without = held(severalCut(2, nullptr, cube));
  EXPECT_GT(map->bytes(), std::size_t{100} * 1024);
  EXPECT_NEAR(static_cast<double>(map->bytes()), static_cast<double>(with) - static_cast<double>(without), 1000.0);
}

}  // namespace texture_test
}  // namespace meshless
