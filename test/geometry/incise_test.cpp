#include "meshless_surgery/geometry/surgery/incise.h"

#include <limits>

#include <gtest/gtest.h>

#include "geometry/incise_laws.h"

namespace meshless {
namespace incise_test {

using shapes::bladeAt;

TriangleMesh ball() { return shapes::moved(sphereMesh(0.1, 0.02), shapes::anyPose()); }
Vec3 at(const Vec3& p) { return shapes::anyPose() * p; }
Vec3 turned(const Vec3& p) { return shapes::anyPose().rotation * p; }

/// From above (+z of the turned ball) down to `depth` below its top.
Blade slit(double length, double depth, const Vec3& along = Vec3::UnitX(), const Vec3& shift = Vec3::Zero()) {
  return bladeAt(at(Vec3(0, 0, 0.11) + shift), turned(-Vec3::UnitZ()), turned(along), length, 0.01 + depth);
}

TEST(Incise, OpensABallHalfThrough) {
  const TriangleMesh mesh = ball();
  const Blade blade = slit(0.5, 0.1);
  const Result<Incision> cut = incise(mesh, blade);
  ASSERT_TRUE(cut.ok()) << cut.error().detail;
  EXPECT_TRUE(laws::incisionObeysLaws(mesh, blade, {}, *cut, true));
  ASSERT_EQ(cut->pieces.size(), 1u);
  EXPECT_EQ(laws::eulerCharacteristic(cut->pieces[0].mesh), 2);
  EXPECT_NEAR(cut->opened_area, 0.5 * M_PI * 0.01, 0.02 * M_PI * 0.01);
}

TEST(Incise, OpensOnlyWhereTheBladeIs) {
  const TriangleMesh mesh = ball();
  for (const double length : {0.002, 0.02, 0.08})
    for (const double depth : {0.001, 0.03, 0.12}) {
      const Blade blade = slit(length, depth, Vec3(0.8, 0.6, 0.0), Vec3(0.003, 0.001, 0.0));
      const Result<Incision> cut = incise(mesh, blade);
      ASSERT_TRUE(cut.ok()) << cut.error().detail;
      EXPECT_TRUE(laws::incisionObeysLaws(mesh, blade, {}, *cut, true)) << length << " x " << depth;
      ASSERT_EQ(cut->pieces.size(), 1u);
      EXPECT_EQ(laws::eulerCharacteristic(cut->pieces[0].mesh), 2);
      // The blade's own plane is crossed only within the blade: nothing else was split.
      std::size_t kept = 0;
      for (const Triangle& t : mesh.triangles)
        for (const Triangle& u : cut->pieces[0].mesh.triangles) kept += t == u;
      EXPECT_GE(kept + static_cast<std::size_t>(2 + 8 * length / 0.02), mesh.triangles.size());
    }
}

TEST(Incise, FrontAndEndsStayJoinedAndTheRimIsDoubled) {
  const TriangleMesh mesh = ball();
  const Blade blade = slit(0.08, 0.05);
  const Result<Incision> cut = incise(mesh, blade);
  ASSERT_TRUE(cut.ok()) << cut.error().detail;
  const IncisedPiece& piece = cut->pieces[0];
  std::vector<int> sides(piece.mesh.vertices.size(), 0);
  for (std::size_t t = 0; t < piece.mesh.triangles.size(); ++t)
    if (piece.facing[t] != 0)
      for (const Index v : piece.mesh.triangles[t]) sides[v] |= piece.facing[t] > 0 ? 1 : 2;
  int ends = 0, doubled = 0, front = 0;
  for (std::size_t v = 0; v < sides.size(); ++v) {
    if (sides[v] == 0) continue;
    const Vec3 r = piece.mesh.vertices[v] - blade.origin;
    const double x = blade.x_axis.dot(r), y = blade.y_axis.dot(r);
    const bool on_border = x < 1e-7 || x > blade.length - 1e-7 || y < -blade.depth + 1e-7;
    const bool on_surface = piece.origins[v].parents[0] != kNoIndex;
    EXPECT_EQ(sides[v] == 3, on_border) << x << " " << y;
    ends += on_border && on_surface;
    front += on_border && !on_surface;
    doubled += !on_border && on_surface;
  }
  EXPECT_EQ(ends, 2);
  EXPECT_GT(doubled, 6);
  EXPECT_EQ(doubled % 2, 0);
  EXPECT_GT(front, 6);
}

TEST(Incise, ThatLeavesOnAllSidesIsAFullCut) {
  const TriangleMesh mesh = ball();
  const Blade blade = slit(1.0, 1.0, Vec3::UnitX(), Vec3(0.0, 0.02, 0.0));
  const Result<Incision> cut = incise(mesh, blade);
  ASSERT_TRUE(cut.ok()) << cut.error().detail;
  EXPECT_TRUE(laws::incisionObeysLaws(mesh, blade, {}, *cut, true));
  ASSERT_EQ(cut->pieces.size(), 2u);
  const Result<CutSurface> plane_cut = cutByPlane(mesh, blade.plane());
  ASSERT_TRUE(plane_cut.ok());
  EXPECT_NEAR(cut->opened_area, plane_cut->cap_area, 1e-9 * plane_cut->cap_area);
  for (int i = 0; i < 2; ++i) {
    const double expected = signedVolume(plane_cut->pieces[i].mesh);
    EXPECT_NEAR(signedVolume(cut->pieces[i].mesh), expected, 1e-9 * expected);
    EXPECT_EQ(laws::eulerCharacteristic(cut->pieces[i].mesh), 2);
  }
}

TEST(Incise, RefusalsNameTheReason) {
  const TriangleMesh mesh = ball();
  const auto refusal = [&](const TriangleMesh& m, const Blade& b, ErrorCode code, const std::string& words) {
    const Result<Incision> cut = incise(m, b);
    ASSERT_FALSE(cut.ok()) << words;
    EXPECT_EQ(cut.error().code, code) << cut.error().detail;
    EXPECT_NE(cut.error().detail.find(words), std::string::npos) << cut.error().detail;
  };
  refusal(mesh, bladeAt(at(Vec3(0, 0, 0.02)), turned(-Vec3::UnitZ()), turned(Vec3::UnitX()), 0.04, 0.04),
          ErrorCode::kMissed, "does not reach the surface");
  refusal(mesh, bladeAt(at(Vec3(0, 0, 0.2)), turned(-Vec3::UnitZ()), turned(Vec3::UnitX()), 0.04, 0.04),
          ErrorCode::kMissed, "meets no tissue");
  refusal(mesh, bladeAt(at(Vec3(0, 0.3, 0.2)), turned(-Vec3::UnitZ()), turned(Vec3::UnitX()), 0.04, 1.0),
          ErrorCode::kMissed, "meets no tissue");
  Blade bad = slit(0.1, 0.1);
  bad.length = 0.0;
  refusal(mesh, bad, ErrorCode::kInvalidArgument, "length is 0");
  bad = slit(0.1, 0.1);
  bad.depth = std::numeric_limits<double>::quiet_NaN();
  refusal(mesh, bad, ErrorCode::kInvalidArgument, "depth");
  bad = slit(0.1, 0.1);
  bad.x_axis *= 2.0;
  refusal(mesh, bad, ErrorCode::kInvalidArgument, "lengths 2");
  bad = slit(0.1, 0.1);
  bad.y_axis = bad.x_axis;
  refusal(mesh, bad, ErrorCode::kInvalidArgument, "dot product");
  TriangleMesh open = mesh;
  open.triangles.pop_back();
  refusal(open, slit(0.1, 0.1), ErrorCode::kUnsuitableShape, "open");
  refusal(TriangleMesh(), slit(0.1, 0.1), ErrorCode::kUnsuitableShape, "no triangles");
}

TEST(Incise, RepeatedOpensNothing) {
  const TriangleMesh mesh = ball();
  const Blade blade = slit(0.08, 0.05);
  const Result<Incision> cut = incise(mesh, blade);
  ASSERT_TRUE(cut.ok());
  const Result<Incision> again = incise(cut->pieces[0].mesh, blade);
  ASSERT_FALSE(again.ok());
  EXPECT_EQ(again.error().code, ErrorCode::kMissed);
  EXPECT_NE(again.error().detail.find("already open there"), std::string::npos) << again.error().detail;
}

TEST(Incise, ExtendsCollinearlyAndDeeper) {
  const TriangleMesh mesh = ball();
  const Blade first = slit(0.06, 0.05);
  const Result<Incision> one = incise(mesh, first);
  ASSERT_TRUE(one.ok());
  Blade second = slit(0.06, 0.07, Vec3::UnitX(), Vec3(0.03, 0.0, 0.0));
  const Result<Incision> two = incise(one->pieces[0].mesh, second);
  ASSERT_TRUE(two.ok()) << two.error().detail;
  EXPECT_TRUE(laws::incisionObeysLaws(one->pieces[0].mesh, second, {}, *two, false));
  ASSERT_EQ(two->pieces.size(), 1u);
  EXPECT_EQ(laws::eulerCharacteristic(two->pieces[0].mesh), 2);
  // Both together are as if the two rectangles had been opened at once; the overlap counts once.
  const Blade both = slit(0.03, 0.05, Vec3::UnitX(), Vec3(0.015, 0.0, 0.0));
  EXPECT_NEAR(
      one->opened_area + two->opened_area,
      laws::openedAreaOracle(mesh, first) + laws::openedAreaOracle(mesh, second) - laws::openedAreaOracle(mesh, both),
      1e-9);
}

TEST(Incise, CrossesAndStartsFromEarlierOnes) {
  const TriangleMesh mesh = ball();
  const Result<Incision> one = incise(mesh, slit(0.08, 0.05));
  ASSERT_TRUE(one.ok());
  std::vector<std::pair<std::string, Blade>> blades = {
      {"X", slit(0.08, 0.06, Vec3(0.3, 1.0, 0.0))},
      {"X at a right angle", slit(0.08, 0.05, Vec3::UnitY())},
      {"T", slit(0.05, 0.05, Vec3::UnitY(), Vec3(0.0, 0.025, 0.0))},
      {"from a wound face, under the surface",
       bladeAt(at(Vec3(0.0, 0.0, 0.07)), turned(Vec3::UnitY()), turned(Vec3::UnitX()), 0.03, 0.02)},
      {"across the front, under the surface",
       bladeAt(at(Vec3(0.0, -0.02, 0.05)), turned(Vec3::UnitY()), turned(Vec3::UnitZ()), 0.03, 0.04)}};
  for (const bool opened : {false, true}) {
    IncisedPiece piece = one->pieces[0];
    if (opened) shapes::spread(piece, slit(0.08, 0.05), 0.002);
    for (const auto& [name, blade] : blades) {
      const Result<Incision> two = incise(piece.mesh, blade);
      ASSERT_TRUE(two.ok()) << name << ": " << two.error().detail;
      EXPECT_TRUE(laws::incisionObeysLaws(piece.mesh, blade, {}, *two, opened)) << name << (opened ? ", opened" : "");
      EXPECT_EQ(two->pieces.size(), 1u) << name;
      EXPECT_EQ(laws::eulerCharacteristic(two->pieces[0].mesh), 2) << name;
    }
  }
}

TEST(Incise, BladesThatMeetCutOffACorner) {
  TriangleMesh mesh = shapes::moved(boxMesh(Vec3(0.1, 0.1, 0.1), 0.02), shapes::anyPose());
  const double whole = signedVolume(mesh);
  for (const bool opened : {false, true}) {
    mesh = shapes::moved(boxMesh(Vec3(0.1, 0.1, 0.1), 0.02), shapes::anyPose());
    // Three faces of a cube of 0.03 around the corner (+,+,+).
    const double s = 0.0211, reach = 0.0292;
    const Vec3 corner(s, s, s);
    std::size_t pieces = 0;
    double small = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3 u = Vec3::Unit((axis + 1) % 3), w = Vec3::Unit((axis + 2) % 3);
      Blade blade;
      blade.x_axis = turned(u);
      blade.y_axis = turned(w);
      blade.length = reach + 0.01;
      blade.depth = reach + 0.01;
      blade.origin = at(corner + (reach + 0.01) * w);
      const Result<Incision> cut = incise(mesh, blade);
      ASSERT_TRUE(cut.ok()) << axis << ": " << cut.error().detail;
      EXPECT_TRUE(laws::incisionObeysLaws(mesh, blade, {}, *cut, axis == 0));
      pieces = cut->pieces.size();
      EXPECT_EQ(pieces, axis == 2 ? 2u : 1u);
      IncisedPiece piece = cut->pieces[0];
      if (pieces == 2) small = signedVolume(cut->pieces[1].mesh);
      if (opened && axis < 2) {
        // The field is nothing where the next blades must meet this one: their planes stay those of the cube.
        Blade half = blade;
        half.origin += 0.3 * blade.length * blade.x_axis + 0.0 * blade.y_axis;
        half.length *= 0.6;
        half.depth *= 0.6;
        shapes::spread(piece, half, 0.0005);
      }
      mesh = piece.mesh;
    }
    EXPECT_EQ(pieces, 2u);
    if (!opened) {
      EXPECT_NEAR(small, std::pow(0.05 - s, 3), 1e-9 * whole);
    }
  }
}

TEST(Incise, EveryShape) {
  test::Random random(7);
  int opened = 0;
  for (const shapes::Shape& shape : shapes::allShapes()) {
    const int euler = laws::eulerCharacteristic(shape.mesh), shells = laws::shellCount(shape.mesh);
    for (int trial = 0; trial < 12; ++trial) {
      const Blade blade = shapes::anyBlade(shape.mesh, random);
      const Result<Incision> cut = incise(shape.mesh, blade);
      if (!cut) {
        EXPECT_EQ(cut.error().code, ErrorCode::kMissed) << shape.name << ": " << cut.error().detail;
        continue;
      }
      ++opened;
      EXPECT_TRUE(laws::incisionObeysLaws(shape.mesh, blade, {}, *cut, true)) << shape.name << " trial " << trial;
      for (const IncisedPiece& piece : cut->pieces) {
        EXPECT_EQ(laws::eulerCharacteristic(piece.mesh) % 2, 0);
        EXPECT_LE(laws::eulerCharacteristic(piece.mesh), 2 * laws::shellCount(piece.mesh));
      }
      if (shells == 1 && euler == 2 && cut->pieces.size() == 1) {
        EXPECT_LE(laws::eulerCharacteristic(cut->pieces[0].mesh), 2) << shape.name;
      }
    }
  }
  EXPECT_GT(opened, 180);
}

TEST(Incise, ThroughOneSideOfATorusMakesItABall) {
  const TriangleMesh mesh = torusMesh(0.1, 0.03, 0.01);
  EXPECT_EQ(laws::eulerCharacteristic(mesh), 0);
  const Blade part = bladeAt(Vec3(0.1, 0.001, 0.04), -Vec3::UnitZ(), Vec3::UnitX(), 0.08, 0.04);
  const Result<Incision> half = incise(mesh, part);
  ASSERT_TRUE(half.ok()) << half.error().detail;
  EXPECT_TRUE(laws::incisionObeysLaws(mesh, part, {}, *half, true));
  EXPECT_EQ(laws::eulerCharacteristic(half->pieces[0].mesh), 0);
  Blade through = part;
  through.depth = 0.08;
  const Result<Incision> all = incise(half->pieces[0].mesh, through);
  ASSERT_TRUE(all.ok()) << all.error().detail;
  EXPECT_TRUE(laws::incisionObeysLaws(half->pieces[0].mesh, through, {}, *all, false));
  ASSERT_EQ(all->pieces.size(), 1u);
  EXPECT_EQ(laws::eulerCharacteristic(all->pieces[0].mesh), 2);
}

TEST(Incise, IntoAHollowJoinsTheSurfaces) {
  const TriangleMesh mesh = shapes::hollowSphere();
  const Blade shallow = bladeAt(Vec3(0.001, 0.002, 0.11), -Vec3::UnitZ(), Vec3::UnitX(), 0.03, 0.03);
  const Result<Incision> above = incise(mesh, shallow);
  ASSERT_TRUE(above.ok()) << above.error().detail;
  EXPECT_TRUE(laws::incisionObeysLaws(mesh, shallow, {}, *above, true));
  ASSERT_EQ(above->pieces.size(), 1u);
  EXPECT_EQ(laws::shellCount(above->pieces[0].mesh), 2);
  Blade deep = shallow;
  deep.depth = 0.09;
  const Result<Incision> into = incise(mesh, deep);
  ASSERT_TRUE(into.ok()) << into.error().detail;
  EXPECT_TRUE(laws::incisionObeysLaws(mesh, deep, {}, *into, true));
  ASSERT_EQ(into->pieces.size(), 1u);
  EXPECT_EQ(laws::shellCount(into->pieces[0].mesh), 1);
  EXPECT_EQ(laws::eulerCharacteristic(into->pieces[0].mesh), 2);
}

TEST(Incise, ThroughVerticesAlongEdgesAndInFaces) {
  const TriangleMesh mesh = boxMesh(Vec3(0.1, 0.1, 0.1), 5, 5, 5);
  int opened = 0, missed = 0;
  // Borders and planes on the box's own lattice of 0.02.
  for (int plane = -5; plane <= 5; ++plane)
    for (int end = -5; end <= 4; ++end)
      for (int depth = 1; depth <= 6; ++depth) {
        Blade blade;
        blade.origin = Vec3(0.01 * end, 0.01 * plane, 0.05);
        blade.x_axis = Vec3::UnitX();
        blade.y_axis = Vec3::UnitZ();
        blade.length = 0.04;
        blade.depth = 0.02 * depth;
        const Result<Incision> cut = incise(mesh, blade);
        if (std::abs(plane) == 5) {
          EXPECT_FALSE(cut.ok()) << plane << " " << end << " " << depth;
          ++missed;
          continue;
        }
        ASSERT_TRUE(cut.ok()) << plane << " " << end << " " << depth << ": " << cut.error().detail;
        EXPECT_TRUE(laws::incisionObeysLaws(mesh, blade, {}, *cut, false)) << plane << " " << end << " " << depth;
        const double inside = std::min(0.05, 0.01 * end + 0.04) - 0.01 * end;
        EXPECT_NEAR(cut->opened_area, inside * std::min(blade.depth, 0.1), 1e-9);
        EXPECT_EQ(laws::eulerCharacteristic(cut->pieces[0].mesh), depth >= 5 && end > -5 && end < 1 ? 0 : 2)
            << plane << " " << end << " " << depth;
        ++opened;
      }
  EXPECT_EQ(opened, 9 * 60);
  EXPECT_EQ(missed, 120);
}

TEST(Incise, TurnedScaledAndRepeatedInputGivesTheSame) {
  const TriangleMesh mesh = sphereMesh(0.1, 0.02);
  const Blade blade = bladeAt(Vec3(0.013, 0.007, 0.11), -Vec3::UnitZ(), Vec3(0.8, 0.55, 0.1), 0.08, 0.06);
  const Result<Incision> cut = incise(mesh, blade), again = incise(mesh, blade);
  ASSERT_TRUE(cut.ok() && again.ok());
  EXPECT_EQ(cut->pieces[0].mesh.triangles, again->pieces[0].mesh.triangles);
  EXPECT_EQ(cut->pieces[0].mesh.vertices, again->pieces[0].mesh.vertices);
  for (const double scale : {1e-3, 1.0, 1e3}) {
    const Pose pose{shapes::anyPose().rotation, scale * shapes::anyPose().translation};
    Blade other = blade;
    other.origin = pose * (scale * blade.origin);
    other.x_axis = pose.rotation * blade.x_axis;
    other.y_axis = pose.rotation * blade.y_axis;
    other.length *= scale;
    other.depth *= scale;
    const Result<Incision> moved = incise(shapes::moved(mesh, pose, scale), other);
    ASSERT_TRUE(moved.ok());
    EXPECT_NEAR(moved->opened_area / (scale * scale), cut->opened_area, 1e-9 * cut->opened_area);
  }
}

TEST(Incise, WoundFacesHaveTheSpacingOfTheSurface) {
  const TriangleMesh mesh = sphereMesh(0.1, 0.01);
  const Blade blade = bladeAt(Vec3(0.0, 0.003, 0.11), -Vec3::UnitZ(), Vec3::UnitX(), 0.5, 0.11);
  const Result<Incision> cut = incise(mesh, blade);
  ASSERT_TRUE(cut.ok());
  std::vector<double> lengths, angles;
  const IncisedPiece& piece = cut->pieces[0];
  for (std::size_t t = 0; t < piece.mesh.triangles.size(); ++t) {
    if (piece.facing[t] != 1) continue;
    double least = M_PI;
    for (int k = 0; k < 3; ++k) {
      const Vec3 &a = piece.mesh.vertices[piece.mesh.triangles[t][k]],
                 &b = piece.mesh.vertices[piece.mesh.triangles[t][(k + 1) % 3]],
                 &c = piece.mesh.vertices[piece.mesh.triangles[t][(k + 2) % 3]];
      least = std::min(least, std::acos((b - a).normalized().dot((c - a).normalized())));
      lengths.push_back((b - a).norm());
    }
    angles.push_back(least * 180.0 / M_PI);
  }
  std::sort(lengths.begin(), lengths.end());
  std::sort(angles.begin(), angles.end());
  ASSERT_GT(angles.size(), 200u);
  const double h = meanEdgeLength(mesh);
  EXPECT_NEAR(lengths[lengths.size() / 2], h, 0.3 * h);
  EXPECT_GE(angles[angles.size() / 2], 30.0);
  RecordProperty("median_angle", std::to_string(angles[angles.size() / 2]));
  EXPECT_GE(angles[angles.size() / 20], 5.0);
}

TEST(Incise, RealLiver) {
  const TriangleMesh mesh = shapes::realMesh("liver-smooth.obj");
  if (mesh.empty())
    GTEST_SKIP() << "liver-smooth.obj is not beside the checkout, and not ours to ship; generated livers are always cut";
  test::Random random(3);
  int opened = 0, missed = 0, refused = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const Blade blade = shapes::anyBlade(mesh, random);
    const Result<Incision> cut = incise(mesh, blade);
    if (!cut) {
      ++(cut.error().code == ErrorCode::kMissed ? missed : refused);
      continue;
    }
    ++opened;
    EXPECT_TRUE(laws::incisionObeysLaws(mesh, blade, {}, *cut, false)) << trial;
  }
  EXPECT_GE(opened, 30) << missed << " missed, " << refused << " refused";
}

}  // namespace incise_test
}  // namespace meshless
