#include "meshless_surgery/world/baked_colors.h"

#include <map>

#include "ros/markers.h"
#include "ros/moving_surfaces.h"
#include "ros/scene_support.h"
#include "support/images.h"
#include "support/textured.h"

namespace meshless {
namespace baked_colors_test {

SnapshotWants surfaces() {
  SnapshotWants wants;
  wants.surfaces = true;
  return wants;
}

void setLooks(World& world, const std::string& body, double scale) {
  SetMaterialCommand command;
  command.body = body;
  command.change = [scale](const Material& present) {
    Material other = present;
    other.appearance.outer.noise = Noise::kLobules;
    other.appearance.outer.second = {0.1f, 0.9f, 0.1f, 1.0f};
    other.appearance.outer.scale = scale;
    other.appearance.outer.wetness = 0.75;
    other.appearance.inner.noise = Noise::kFat;
    other.appearance.inner.second = {0.1f, 0.1f, 0.9f, 1.0f};
    other.appearance.inner.bump = 0.25;
    return Result<Material>(other);
  };
  ASSERT_TRUE(world.apply(command).ok());
}

TEST(BakedColors, AreTheLooksAtTheVertices) {
  const auto world = twoBoxes();
  setLooks(*world, "b", 0.02);  // which is not at the origin
  ASSERT_TRUE(world->apply(cutAcross(0.51)).ok());
  std::size_t patterned = 0;
  for (const BodySnapshot& body : world->snapshot(surfaces()).bodies) {
    const VertexColors colors = bakeColors(*body.model, body.material);
    const Points& rest = body.model->surface.vertices;
    if (body.name == "a") {
      EXPECT_TRUE(colors.outer.empty() && colors.inside.empty());
      continue;
    }
    ++patterned;
    ASSERT_EQ(rest.size(), colors.outer.size());
    ASSERT_EQ(rest.size(), colors.inside.size());
    std::vector<bool> on_cut(rest.size(), false);
    for (std::size_t t = 0; t < body.model->surface.triangles.size(); ++t)
      for (const Index v : body.model->surface.triangles[t])
        if (isCutPatch(body.model->surface.patchOf(t))) on_cut[v] = true;
    for (std::size_t v = 0; v < rest.size(); ++v) {
      const Vec3 place = body.model->own * rest[v];
      const Vec3 none = Vec3::Zero();
      const Color out = colorAt(body.material.appearance.outer, body.material.color, place, none),
                  in = colorAt(body.material.appearance.inner, body.material.inside_color, place, none);
      EXPECT_EQ(out.g, colors.outer[v].g);
      EXPECT_EQ(on_cut[v] ? in.b : 0.0f, colors.inside[v].b);
    }
  }
  EXPECT_EQ(2u, patterned);
}

TEST(BakedColors, AreBakedWhereSomethingIsNewAlone) {
  const auto world = twoBoxes();
  setLooks(*world, "", 0.02);
  BakedColors baked;
  const auto addresses = [&] {
    const WorldSnapshot snapshot = world->snapshot(surfaces());
    baked.update(snapshot);
    std::map<std::string, const Color*> found;
    for (const BodySnapshot& body : snapshot.bodies) found[body.name] = baked.of(body).outer.data();
    return found;
  };
  const auto first = addresses();
  world->step();
  EXPECT_EQ(first, addresses());
  setLooks(*world, "a", 0.01);
  const auto other = addresses();
  EXPECT_NE(first.at("a"), other.at("a"));
  EXPECT_EQ(first.at("b"), other.at("b"));
  ASSERT_TRUE(world->apply(cutAcross(0.01)).ok());
  const auto cut = addresses();
  EXPECT_EQ(3u, cut.size());
  EXPECT_EQ(first.at("b"), cut.at("b"));
}

TEST(BakedColors, MarkersHaveThemInTheLightThereIs) {
  const auto world = twoBoxes();
  setLooks(*world, "a", 0.02);
  ASSERT_TRUE(world->apply(cutAcross(0.01)).ok());
  const WorldSnapshot snapshot = world->snapshot(surfaces());
  MarkerBuilder builder("world");
  const auto array = builder.build(snapshot, ros::Time(), false);
  for (const BodySnapshot& body : snapshot.bodies) {
    const auto marker = std::find_if(array.markers.begin(), array.markers.end(), [&](const auto& m) {
      return m.ns == "bodies" && m.action == 0 && m.id == static_cast<int>(body.number);
    });
    ASSERT_NE(array.markers.end(), marker);
    ASSERT_EQ(3 * body.model->surface.triangles.size(), marker->colors.size());
    const VertexColors colors = bakeColors(*body.model, body.material);
    for (std::size_t c = 0; c < marker->colors.size(); ++c) {
      const std::size_t t = c / 3;
      const Index v = body.model->surface.triangles[t][c % 3];
      const bool cut = isCutPatch(body.model->surface.patchOf(t));
      const Color plain = cut ? body.material.inside_color : body.material.color;
      const std::vector<Color>& baked = cut ? colors.inside : colors.outer;
      const Color wanted = baked.empty() ? plain : baked[v];
      const Vec3 shade(marker->colors[c].r, marker->colors[c].g, marker->colors[c].b);
      ASSERT_LT(shade.cross(Vec3(wanted.r, wanted.g, wanted.b)).norm(), 1e-5) << body.name << " " << c;
    }
  }
}

TEST(BakedColors, TheTopologyHasThemAndIsNewWhereALookIs) {
  const auto world = twoBoxes();
  MovingSurfaces moving;
  const auto plain = moving.change(world->snapshot(surfaces()), {});
  ASSERT_TRUE(plain);
  ASSERT_EQ(2u, plain->bodies[0].looks.size());
  EXPECT_TRUE(plain->bodies[0].rest.empty() && plain->bodies[0].colors.empty());
  setLooks(*world, "a", 0.02);
  const WorldSnapshot snapshot = world->snapshot(surfaces());
  const auto patterned = moving.change(snapshot, {});
  ASSERT_TRUE(patterned);
  EXPECT_EQ(patterned->topology, moving.topology());
  const auto& body = patterned->bodies[0];
  EXPECT_EQ(static_cast<std::uint8_t>(meshless_surgery::Look::LOBULES), body.looks[0].noise);
  EXPECT_EQ(static_cast<std::uint8_t>(meshless_surgery::Look::FAT), body.looks[1].noise);
  EXPECT_FLOAT_EQ(0.02f, body.looks[0].scale);
  EXPECT_FLOAT_EQ(0.75f, body.looks[0].wetness);
  EXPECT_FLOAT_EQ(0.25f, body.looks[1].bump);
  EXPECT_TRUE(patterned->bodies[1].rest.empty());
  const BodyModel& model = *snapshot.bodies[0].model;
  const VertexColors colors = bakeColors(model, snapshot.bodies[0].material);
  ASSERT_EQ(3 * colors.outer.size(), body.colors.size());
  ASSERT_EQ(3 * colors.outer.size(), body.rest.size());
  EXPECT_TRUE(body.inside_colors.empty());  // nothing is cut
  for (std::size_t v = 0; v < colors.outer.size(); ++v) {
    EXPECT_NEAR(255.0f * colors.outer[v].g, body.colors[3 * v + 1], 0.5001f);
    EXPECT_NEAR((model.own * model.surface.vertices[v]).z(), body.rest[3 * v + 2], 1e-6);
  }
  EXPECT_FALSE(moving.change(world->snapshot(surfaces()), {}));
}

TEST(BakedColors, AnImageIsSeenFromTheSideThatASurfaceIsTurnedTo) {
  const auto world = twoBoxes();
  SetMaterialCommand command;  // of both
  command.change = [](const Material& present) {
    Material other = present;
    other.appearance.outer = test::chequered(0.13);
    return Result<Material>(other);
  };
  ASSERT_TRUE(world->apply(command).ok());
  const WorldSnapshot snapshot = world->snapshot(surfaces());
  const BodySnapshot& body = snapshot.bodies[0];
  const VertexColors colors = bakeColors(*body.model, body.material);
  Points places;
  Box box;
  for (const Vec3& v : body.model->surface.vertices) {
    places.push_back(body.model->own * v);
    box.extend(places.back());
  }
  std::size_t looked_at = 0;
  for (std::size_t v = 0; v < places.size(); ++v) {
    const Vec3 from_side = (places[v] - box.min).cwiseMin(box.max - places[v]);
    Vec3 normal = Vec3::Zero();
    for (int axis = 0; axis < 3; ++axis) normal[axis] = from_side[axis] < 1e-9 ? 1.0 : 0.0;
    if (normal.sum() != 1.0) continue;  // on an edge
    ++looked_at;
    EXPECT_NEAR(colorAt(test::chequered(0.13), Color(), places[v], normal).r, colors.outer[v].r, 1e-5);
  }
  EXPECT_GT(looked_at, 5u);
}

TEST(BakedColors, TheTopologySaysWhereTheImageOfAFileLies) {
  const test::TexturedCube cube(0.1);
  World world((WorldSettings()));
  for (const bool mapped : {false, true}) {
    BodyDef def;
    def.name = mapped ? "mapped" : "plain";
    def.mesh = cube.mesh;
    if (mapped) def.texture = cube.map();
    def.pose.translation.x() = mapped ? 0.0 : 1.0;
    def.material.appearance.outer = test::sixColors();
    ASSERT_TRUE(world.addSceneBody(std::make_shared<PreparedBody>(*prepareBody(def))).ok());
  }
  ASSERT_TRUE(world.apply(cutAcross(0.013)).ok());
  MovingSurfaces moving;
  const auto topology = moving.change(world.snapshot(surfaces()), {});
  ASSERT_TRUE(topology);
  ASSERT_EQ(3u, topology->bodies.size());
  for (const auto& body : topology->bodies) {
    EXPECT_EQ(body.vertices, body.colors.size() / 3);
    if (body.name == "plain") {
      EXPECT_TRUE(body.uv.empty());
      continue;
    }
    ASSERT_EQ(2 * body.triangles.size(), body.uv.size());
    Points rest;
    for (std::size_t v = 0; v < body.vertices; ++v)
      rest.emplace_back(body.rest[3 * v], body.rest[3 * v + 1], body.rest[3 * v + 2]);
    for (std::size_t c = 0; c < body.triangles.size(); ++c) {
      const std::size_t t = c / 3;
      const Vec3 normal = test::TexturedCube::normal(
          rest, {body.triangles[3 * t], body.triangles[3 * t + 1], body.triangles[3 * t + 2]});
      const TexturePoint said{body.uv[2 * c], body.uv[2 * c + 1]};
      if (body.cut[t] != 0)
        EXPECT_EQ((TexturePoint{0.0f, 0.0f}), said);
      else if (normal.norm() > 1e-8)
        EXPECT_LT(test::apart(cube.at(test::sideOf(normal), rest[body.triangles[c]]), said), 1e-5f);
    }
  }
}

TEST(MovingSurfaces, SayAnImageOnceHoweverManyShowIt) {
  const auto world = twoBoxes();
  MovingSurfaces moving;
  EXPECT_FALSE(moving.newImages(world->snapshot(surfaces()), {}));
  const auto show = [&](const std::string& body, const Look& look) {
    SetMaterialCommand command;
    command.body = body;
    command.change = [look](const Material& present) {
      Material other = present;
      other.appearance.outer = look;
      return Result<Material>(other);
    };
    ASSERT_TRUE(world->apply(command).ok());
  };
  show("a", test::chequered(0.02));
  show("b", test::chequered(0.04));  // read anew, the same pixels
  const auto images = moving.newImages(world->snapshot(surfaces()), {});
  ASSERT_TRUE(images);
  ASSERT_EQ(1u, images->images.size());
  EXPECT_EQ(2u, images->images[0].width);
  EXPECT_EQ(test::chequered(0.02).image->rgb(), images->images[0].rgb);
  const auto topology = moving.change(world->snapshot(surfaces()), {});
  ASSERT_TRUE(topology);
  for (const auto& body : topology->bodies) {
    EXPECT_EQ(static_cast<std::uint8_t>(meshless_surgery::Look::IMAGE), body.looks[0].noise);
    EXPECT_EQ(images->images[0].id, body.looks[0].image);
    EXPECT_EQ(0u, body.looks[1].image);
    EXPECT_FALSE(body.rest.empty());
  }
  EXPECT_FALSE(moving.newImages(world->snapshot(surfaces()), {}));
  show("a", Look());
  EXPECT_FALSE(moving.newImages(world->snapshot(surfaces()), {}));  // one still shows it
  show("b", Look());
  const auto none = moving.newImages(world->snapshot(surfaces()), {});
  ASSERT_TRUE(none);
  EXPECT_TRUE(none->images.empty());
}

}  // namespace baked_colors_test
}  // namespace meshless
