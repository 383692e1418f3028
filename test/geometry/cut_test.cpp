#include "support/plane_cut.h"

#include <filesystem>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "meshless_surgery/tools/command.h"
#include "support/cut_cases.h"
#include "support/mesh_laws.h"

namespace meshless {
namespace cut_test {

bool bladesMeet(const TriangleMesh& mesh, const ScissorBlades& blades) { return meets(mesh, blades.blade()); }

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::vector<shapes::Shape> embeddedShapes() {
  std::vector<shapes::Shape> all = shapes::allShapes();
  for (const shapes::Shape& shape : shapes::hardShapes()) all.push_back(shape);
  return all;
}

std::size_t piecesOn(const CutSurface& cut, int side) {
  std::size_t count = 0;
  for (const CutPiece& piece : cut.pieces) count += piece.side == side;
  return count;
}

TriangleMesh unitVoxels(int nx, int ny, int nz) {
  return shapes::voxelMesh(nx, ny, nz, [](int, int, int) { return true; });
}

TEST(Cut, LawsHoldForEveryShape) {
  for (const shapes::Shape& shape : embeddedShapes()) {
    SCOPED_TRACE(shape.name);
    ASSERT_TRUE(laws::isClosedOriented(shape.mesh));
    std::mt19937 random(7);
    int cuts = 0;
    for (int i = 0; i < 25; ++i) {
      const Plane plane = shapes::hardPlane(shape.mesh, random);
      const Result<CutSurface> cut = cutByPlane(shape.mesh, plane);
      EXPECT_TRUE(laws::cutObeysLaws(shape.mesh, plane, {}, cut)) << "plane " << i;
      cuts += cut.ok();
    }
    EXPECT_GE(cuts, 5);
  }
}

TEST(Cut, HalvesACube) {
  const TriangleMesh cube = boxMesh(Vec3(2, 2, 2), 4, 4, 4);
  for (const double height : {0.0, 0.3}) {  // along edges of the mesh, and across its triangles
    const Result<CutSurface> cut = cutByPlane(cube, {Vec3::UnitZ(), Vec3(0, 0, height)});
    ASSERT_TRUE(cut.ok()) << cut.error().detail;
    ASSERT_EQ(cut->pieces.size(), 2u);
    EXPECT_NEAR(cut->cap_area, 4.0, 1e-12);
    EXPECT_NEAR(signedVolume(cut->pieces[0].mesh), 4.0 * (1.0 + height), 1e-12);
    EXPECT_NEAR(signedVolume(cut->pieces[1].mesh), 4.0 * (1.0 - height), 1e-12);
    EXPECT_NEAR(surfaceArea(cut->pieces[1].mesh), 8.0 + 8.0 * (1.0 - height), 1e-12);
  }
}

TEST(Cut, EveryPartComesOutByItself) {
  const TriangleMesh comb = shapes::voxelMesh(9, 4, 2, [](int x, int y, int) { return y == 0 || x % 2 == 0; });
  for (const double y : {2.0, 2.4, 1.0}) {  // through vertices, between them, and in the faces between the teeth
    const Result<CutSurface> cut = cutByPlane(comb, {Vec3::UnitY(), Vec3(0, y, 0)});
    ASSERT_TRUE(cut.ok()) << cut.error().detail;
    EXPECT_EQ(piecesOn(*cut, 1), 5u) << "at " << y;
    EXPECT_EQ(piecesOn(*cut, -1), 1u) << "at " << y;
    EXPECT_NEAR(cut->cap_area, 10.0, 1e-12);
  }
}

TEST(Cut, SectionsWithHolesAreOnePiece) {
  const TriangleMesh torus = torusMesh(0.1, 0.03, 0.01);
  const Result<CutSurface> across = cutByPlane(torus, {Vec3::UnitX(), Vec3(0.001, 0, 0)});
  ASSERT_TRUE(across.ok());
  EXPECT_EQ(across->pieces.size(), 2u);
  const Result<CutSurface> lengthwise = cutByPlane(torus, {Vec3::UnitZ(), Vec3(0, 0, 0.001)});
  ASSERT_TRUE(lengthwise.ok());
  EXPECT_EQ(lengthwise->pieces.size(), 2u);
}

TEST(Cut, CavitiesStayWithTheirSolid) {
  const TriangleMesh hollow = shapes::hollowSphere();  // radii 0.1 and 0.05
  const Result<CutSurface> beside = cutByPlane(hollow, {Vec3::UnitZ(), Vec3(0, 0, 0.07)});
  ASSERT_TRUE(beside.ok()) << beside.error().detail;
  ASSERT_EQ(beside->pieces.size(), 2u);
  EXPECT_EQ(beside->pieces[0].side, -1);
  EXPECT_LT(signedVolume(beside->pieces[0].mesh), 0.9 * signedVolume(sphereMesh(0.1, 0.02)));

  TriangleMesh nested = hollow;
  shapes::append(nested, sphereMesh(0.03, 0.01));
  shapes::append(nested, shapes::turnedInsideOut(sphereMesh(0.01, 0.005)));
  const Result<CutSurface> above_all = cutByPlane(nested, {Vec3::UnitZ(), Vec3(0, 0, 0.07)});
  ASSERT_TRUE(above_all.ok()) << above_all.error().detail;
  EXPECT_EQ(piecesOn(*above_all, -1), 2u);  // the shell with its cavity, the ball with its own
  for (const CutPiece& piece : above_all->pieces) EXPECT_GT(signedVolume(piece.mesh), 0.0);
  const double ball = signedVolume(sphereMesh(0.03, 0.01)) - signedVolume(sphereMesh(0.01, 0.005));
  double nearest = 1.0;
  for (const CutPiece& piece : above_all->pieces)
    nearest = std::min(nearest, std::abs(signedVolume(piece.mesh) - ball));
  EXPECT_LT(nearest, 1e-15);
}

TEST(Cut, ATouchingCavityStaysWithItsSolid) {
  const TriangleMesh box = shapes::voxelMesh(3, 3, 3, [](int x, int y, int z) { return x != 1 || y != 1 || z != 1; });
  const Plane plane = {Vec3(0, 1, 1).normalized(), Vec3(0, 2, 2)};  // along an edge of the cavity
  const Result<CutSurface> cut = cutByPlane(box, plane);
  EXPECT_TRUE(laws::cutObeysLaws(box, plane, {}, cut));
  ASSERT_TRUE(cut.ok());
  EXPECT_EQ(cut->pieces.size(), 2u);
}

TEST(Cut, FacesInThePlaneGoByTheirOrientation) {
  const TriangleMesh stairs = shapes::voxelMesh(4, 2, 4, [](int x, int, int z) { return x >= z; });
  for (int step = 1; step < 4; ++step) {
    const Result<CutSurface> cut = cutByPlane(stairs, {Vec3::UnitZ(), Vec3(0, 0, step)});
    ASSERT_TRUE(cut.ok()) << cut.error().detail;
    EXPECT_EQ(cut->pieces.size(), 2u);
    EXPECT_NEAR(cut->cap_area, 2.0 * (4 - step), 1e-12);  // the tread above which nothing is, is no cut
  }
}

TEST(Cut, SolidsThatTouchComeOutByThemselves) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (const shapes::Shape& shape : shapes::touchingShapes()) {
    SCOPED_TRACE(shape.name);
    for (int round = 0; round < 100; ++round) {
      Pose pose, back;  // turned they touch but for rounding
      if (round > 0) pose.rotation = Quat(1.0, normal(random), normal(random), normal(random)).normalized();
      back.rotation = pose.rotation.conjugate();
      const TriangleMesh mesh = shapes::moved(shape.mesh, pose);
      const Vec3 up = Vec3(0.2 * normal(random), 0.2 * normal(random), 1.0).normalized();
      const Plane plane = {pose.rotation * up, pose * Vec3(0.5, 0.4, 0.3)};
      const Result<CutSurface> cut = cutByPlane(mesh, plane);
      ASSERT_TRUE(cut.ok()) << cut.error().detail;
      EXPECT_TRUE(laws::cutObeysLaws(mesh, plane, {}, cut, false));
      for (const CutPiece& piece : cut->pieces) {
        const Box box = boundsOf(shapes::moved(piece.mesh, back).vertices);
        EXPECT_EQ(box.max.x() > 0.5 + 1e-9, box.min.x() > 0.5 - 1e-9) << "round " << round;
      }
    }
  }
}

TEST(Cut, SolidsThatCrossAreCappedLayerByLayer) {
  TriangleMesh crossing = sphereMesh(0.1, 0.02);
  const std::size_t one = crossing.vertices.size();
  shapes::append(crossing, sphereMesh(0.08, 0.02), Vec3(0.07, 0.013, 0.004));
  const double whole = signedVolume(crossing);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 40; ++i) {
    const Plane plane = {Vec3(normal(random), normal(random), normal(random)).normalized(), Vec3(0.05, 0, 0)};
    const Result<CutSurface> cut = cutByPlane(crossing, plane);
    ASSERT_TRUE(cut.ok()) << cut.error().detail;
    EXPECT_TRUE(laws::cutObeysLaws(crossing, plane, {}, cut, false));
    const laws::SectionOracle oracle = laws::sectionOracle(crossing, plane, 0.0);
    EXPECT_NEAR(cut->cap_area, oracle.area, 1e-9 * oracle.area);  // where both are, it counts twice
    EXPECT_NEAR(oracle.volume_above + oracle.volume_below, whole, 1e-12 * whole);
    // Where they are far from each other at rest, tissue lies in itself: what only overlaps is not joined.
    Points rest = crossing.vertices;
    for (std::size_t v = one; v < rest.size(); ++v) rest[v].z() += 1.0;
    CutOptions apart;
    apart.rest = &rest;
    apart.apart = 0.05;
    const Result<CutSurface> parted = cutByPlane(crossing, plane, apart);
    ASSERT_TRUE(parted.ok()) << parted.error().detail;
    EXPECT_TRUE(laws::cutObeysLaws(crossing, plane, apart, parted, false));
    EXPECT_NEAR(parted->cap_area, oracle.area, 1e-9 * oracle.area);
    EXPECT_EQ(parted->pieces.size(), 4u);
    // What lies in itself at rest, too, is one.
    apart.rest = &crossing.vertices;
    EXPECT_EQ(cutByPlane(crossing, plane, apart)->pieces.size(), cut->pieces.size());
  }
}

TEST(Cut, RealMeshesThatCrossThemselves) {
  bool any = false;
  for (const char* file : {"liver-smooth.obj", "liver2.obj", "torus2_for_collision.obj"}) {
    const TriangleMesh mesh = shapes::realMesh(file);
    if (mesh.empty()) continue;
    any = true;
    SCOPED_TRACE(file);
    std::mt19937 random(11);
    int tried = 0, refused = 0;
    for (int i = 0; i < 150; ++i) {
      const Plane plane = shapes::hardPlane(mesh, random);
      const Result<CutSurface> cut = cutByPlane(mesh, plane);
      EXPECT_TRUE(laws::cutObeysLaws(mesh, plane, {}, cut, false)) << "plane " << i;
      if (!cut && cut.error().code == ErrorCode::kMissed) continue;
      ++tried;
      refused += !cut;
    }
    EXPECT_LE(refused, 0.05 * tried);
    EXPECT_GE(tried, 75);
  }
  if (!any) GTEST_SKIP() << "the real meshes are not beside the checkout";
}

TEST(Cut, TurnedScaledAndMovedInputGivesTheSamePieces) {
  for (const shapes::Shape& shape : embeddedShapes()) {
    SCOPED_TRACE(shape.name);
    const Box box = boundsOf(shape.mesh.vertices);
    const Plane plane = {Vec3(0.31, -0.52, 0.79).normalized(), 0.45 * box.min + 0.55 * box.max};
    const Result<CutSurface> cut = cutByPlane(shape.mesh, plane);
    ASSERT_TRUE(cut.ok()) << cut.error().detail;
    const Pose pose = shapes::anyPose();
    for (const double scale : {1.0, 1e-3, 40.0}) {
      const Plane other = {pose.rotation * plane.normal, pose * (scale * plane.point)};
      const TriangleMesh moved = shapes::moved(shape.mesh, pose, scale);
      const Result<CutSurface> again = cutByPlane(moved, other);
      ASSERT_TRUE(again.ok()) << again.error().detail;
      ASSERT_EQ(again->pieces.size(), cut->pieces.size());
      EXPECT_NEAR(again->cap_area, scale * scale * cut->cap_area, 1e-9 * scale * scale * cut->cap_area);
      std::vector<std::size_t> triangles, triangles_again;
      for (std::size_t i = 0; i < cut->pieces.size(); ++i) {
        const double volume = std::pow(scale, 3) * signedVolume(cut->pieces[i].mesh);
        EXPECT_NEAR(signedVolume(again->pieces[i].mesh), volume, 1e-9 * volume);
        triangles.push_back(cut->pieces[i].mesh.triangles.size());
        triangles_again.push_back(again->pieces[i].mesh.triangles.size());
      }
      std::sort(triangles.begin(), triangles.end());
      std::sort(triangles_again.begin(), triangles_again.end());
      EXPECT_EQ(triangles, triangles_again);
    }
  }
}

TEST(Cut, TheSameCutGivesTheSameBits) {
  const TriangleMesh mesh = liverMesh();
  const Plane plane = {Vec3(0.3, 0.9, -0.2).normalized(), solidCentroid(mesh)};
  const Result<CutSurface> first = cutByPlane(mesh, plane);
  std::vector<std::vector<char>> elsewhere(50, std::vector<char>(777));  // other addresses the second time
  const Result<CutSurface> second = cutByPlane(mesh, plane);
  ASSERT_TRUE(first.ok() && second.ok());
  ASSERT_EQ(first->pieces.size(), second->pieces.size());
  for (std::size_t i = 0; i < first->pieces.size(); ++i) {
    EXPECT_EQ(first->pieces[i].mesh.triangles, second->pieces[i].mesh.triangles);
    EXPECT_EQ(first->pieces[i].mesh.vertices, second->pieces[i].mesh.vertices);
  }
}

TEST(Cut, BothSidesOfACutShareTheirPoints) {
  const TriangleMesh mesh = kidneyMesh();
  const Plane plane = {Vec3(0.3, 0.2, 0.9).normalized(), solidCentroid(mesh)};
  const Result<CutSurface> cut = cutByPlane(mesh, plane);
  ASSERT_TRUE(cut.ok());
  std::array<std::vector<std::array<double, 3>>, 2> made;
  for (const CutPiece& piece : cut->pieces)
    for (std::size_t v = 0; v < piece.origins.size(); ++v)
      if (piece.origins[v].parents[1] != kNoIndex)
        made[piece.side > 0].push_back(
            {piece.mesh.vertices[v].x(), piece.mesh.vertices[v].y(), piece.mesh.vertices[v].z()});
  for (auto& side : made) std::sort(side.begin(), side.end());
  EXPECT_GT(made[0].size(), 50u);
  EXPECT_EQ(made[0], made[1]);
}

TEST(Cut, PatchesAreKeptAndTheCapGetsItsOwn) {
  TriangleMesh cube = boxMesh(Vec3(1, 1, 1), 2, 2, 2);
  cube.patches.assign(cube.triangles.size(), 5);
  CutOptions options;
  options.cap_patch = 9;
  const Result<CutSurface> cut = cutByPlane(cube, {Vec3::UnitX(), Vec3(0.1, 0, 0)}, options);
  ASSERT_TRUE(cut.ok());
  for (const CutPiece& piece : cut->pieces) {
    EXPECT_NEAR(laws::patchArea(piece.mesh, 9), 1.0, 1e-12);
    EXPECT_NEAR(laws::patchArea(piece.mesh, 5), surfaceArea(piece.mesh) - 1.0, 1e-12);
  }
}

TEST(Cut, AFarPointOfThePlaneCostsNoDigits) {
  const TriangleMesh mesh = kidneyMesh();
  const Vec3 normal = Vec3(0.2, 0.5, 0.7).normalized();
  const Plane near = {normal, solidCentroid(mesh)};
  const Plane far = {normal, near.point + 1e3 * normal.unitOrthogonal()};
  const Result<CutSurface> a = cutByPlane(mesh, near), b = cutByPlane(mesh, far);
  ASSERT_TRUE(a.ok() && b.ok());
  EXPECT_EQ(a->pieces.size(), b->pieces.size());
  EXPECT_TRUE(laws::cutObeysLaws(mesh, near, {}, b));
}

TEST(Cut, HundredCutsIntoCrumbs) {
  const TriangleMesh sphere = sphereMesh(0.1, 0.015);
  std::vector<TriangleMesh> crumbs{sphere};
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 100; ++i) {
    const auto largest = std::max_element(
        crumbs.begin(), crumbs.end(),
        [](const TriangleMesh& a, const TriangleMesh& b) { return signedVolume(a) < signedVolume(b); });
    const TriangleMesh mesh = std::move(*largest);
    crumbs.erase(largest);
    const Plane plane = {Vec3(normal(random), normal(random), normal(random)).normalized(), solidCentroid(mesh)};
    CutOptions options;
    options.cap_patch = static_cast<std::uint32_t>(i + 1);
    const Result<CutSurface> cut = cutByPlane(mesh, plane, options);
    ASSERT_TRUE(laws::cutObeysLaws(mesh, plane, options, cut)) << "cut " << i;
    for (const CutPiece& piece : cut->pieces) crumbs.push_back(piece.mesh);
  }
  EXPECT_GE(crumbs.size(), 101u);
  double sum = 0.0;
  for (const TriangleMesh& mesh : crumbs) sum += signedVolume(mesh);
  EXPECT_NEAR(sum, signedVolume(sphere), 1e-12 * sum);
}

TEST(Cut, SaysWhyItRefuses) {
  const TriangleMesh cube = boxMesh(Vec3(1, 1, 1), 2, 2, 2);
  const auto refusal = [](const TriangleMesh& mesh, const Plane& plane, const CutOptions& options = {}) {
    const Result<CutSurface> cut = cutByPlane(mesh, plane, options);
    EXPECT_FALSE(cut.ok());
    return cut.ok() ? Error{ErrorCode::kFailed, ""} : cut.error();
  };
  const Plane through = {Vec3::UnitZ(), Vec3(0, 0, 0.1)};
  EXPECT_EQ(refusal(cube, {Vec3::UnitZ(), Vec3(0, 0, 2)}).code, ErrorCode::kMissed);
  EXPECT_EQ(refusal(cube, {Vec3::UnitZ(), Vec3(0, 0, 0.5)}).code, ErrorCode::kMissed);
  EXPECT_EQ(refusal(cube, {Vec3::UnitZ(), Vec3(0, 0, -0.5)}).code, ErrorCode::kMissed);
  EXPECT_EQ(refusal(cube, {Vec3::UnitZ(), Vec3(kNaN, 0, 0)}).code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(refusal(cube, {Vec3(0, kNaN, 1), Vec3::Zero()}).code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(refusal(cube, {Vec3::Zero(), Vec3::Zero()}).code, ErrorCode::kInvalidArgument);
  const Error long_normal = refusal(cube, {Vec3(0, 0, 2), Vec3::Zero()});
  EXPECT_EQ(long_normal.code, ErrorCode::kInvalidArgument);
  EXPECT_NE(long_normal.detail.find("2;"), std::string::npos) << long_normal.detail;
  CutOptions no_band;
  no_band.band = kNaN;
  EXPECT_EQ(refusal(cube, through, no_band).code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(refusal(TriangleMesh(), through).code, ErrorCode::kUnsuitableShape);

  TriangleMesh broken = cube;
  broken.triangles[0][0] = 1000;
  EXPECT_NE(refusal(broken, through).detail.find("1000"), std::string::npos);
  broken = cube;
  broken.vertices[3].x() = kNaN;
  EXPECT_EQ(refusal(broken, through).code, ErrorCode::kUnsuitableShape);
  broken = cube;
  broken.patches = {1, 2};
  EXPECT_EQ(refusal(broken, through).code, ErrorCode::kInvalidArgument);
  // Wherever it is open: at the plane, away from it, on either side.
  for (std::size_t t = 0; t < cube.triangles.size(); ++t) {
    broken = cube;
    broken.triangles.erase(broken.triangles.begin() + static_cast<std::ptrdiff_t>(t));
    EXPECT_EQ(refusal(broken, through).code, ErrorCode::kUnsuitableShape) << "without triangle " << t;
    broken = cube;
    std::swap(broken.triangles[t][0], broken.triangles[t][1]);
    EXPECT_EQ(refusal(broken, through).code, ErrorCode::kUnsuitableShape) << "with triangle " << t << " turned";
  }
}

TEST(Cut, CorpusOfOldFaults) {
  std::size_t cases = 0;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(SOURCE_DIR) + "/test/corpus")) {
    const std::string name = entry.path().filename().string();
    if (name.rfind("cut_", 0) != 0) continue;
    ++cases;
    const shapes::CutCase c = shapes::readCutCase(entry.path().string());
    ASSERT_FALSE(c.mesh.empty()) << name;
    EXPECT_TRUE(laws::cutObeysLaws(c.mesh, c.plane, {}, cutByPlane(c.mesh, c.plane), c.embedded, c.worn)) << name;
  }
  EXPECT_GT(cases, 0u);
}

TEST(BladesMeet, WhatIsWithinReach) {
  const TriangleMesh cube = boxMesh(Vec3(1, 1, 1), 3, 3, 3);
  ScissorBlades blades;
  blades.origin = Vec3(-2, 0, 0.1);
  EXPECT_TRUE(bladesMeet(cube, blades)) << "unbounded";
  blades.length = 1.4;
  EXPECT_FALSE(bladesMeet(cube, blades)) << "too short";
  blades.length = 1.6;
  EXPECT_TRUE(bladesMeet(cube, blades));
  blades.width = 0.01;
  EXPECT_TRUE(bladesMeet(cube, blades));
  blades.origin = Vec3(-2, 0.6, 0.1);
  EXPECT_FALSE(bladesMeet(cube, blades)) << "beside";
  blades.width = 0.3;
  EXPECT_TRUE(bladesMeet(cube, blades)) << "wide enough to reach in";
  blades.origin = Vec3(-2, 0.6, 0.6);
  EXPECT_FALSE(bladesMeet(cube, blades)) << "above";
  blades.origin = Vec3(2, 0, 0);
  blades.length = 0.0;
  EXPECT_FALSE(bladesMeet(cube, blades)) << "pointing away";
}

TEST(BladesMeet, ARectangleWithinTheSolidOrItsCavity) {
  const TriangleMesh hollow = shapes::hollowSphere();  // radii 0.1 and 0.05
  ScissorBlades blades;
  blades.length = 0.01;
  blades.width = 0.01;
  blades.origin = Vec3(0.07, 0, 0);
  EXPECT_TRUE(bladesMeet(hollow, blades)) << "in the flesh";
  blades.origin = Vec3(0.0, 0, 0);
  EXPECT_FALSE(bladesMeet(hollow, blades)) << "in the cavity";
  blades.origin = Vec3(0.2, 0, 0);
  EXPECT_FALSE(bladesMeet(hollow, blades)) << "outside";
}

TEST(BladesMeet, LiesInAFace) {
  const TriangleMesh cube = boxMesh(Vec3(1, 1, 1), 1, 1, 1);
  ScissorBlades blades;
  blades.length = 0.01;
  blades.width = 0.01;
  blades.origin = Vec3(0.1, 0.3, 0.5);
  EXPECT_TRUE(bladesMeet(cube, blades));
  blades.origin.x() = kNaN;
  EXPECT_FALSE(bladesMeet(cube, blades));
}

/// Against sampling: a grid of points of the rectangle, each inside or not by the winding number of the whole surface.
TEST(BladesMeet, AgreesWithSampling) {
  std::mt19937 random(9);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (const shapes::Shape& shape : shapes::simpleShapes()) {
    SCOPED_TRACE(shape.name);
    const Box box = boundsOf(shape.mesh.vertices);
    const double size = box.diagonal();
    int met = 0;
    for (int i = 0; i < 60; ++i) {
      ScissorBlades blades;
      blades.x_axis = Vec3(normal(random), normal(random), normal(random)).normalized();
      blades.y_axis = blades.x_axis.cross(Vec3(normal(random), normal(random), normal(random))).normalized();
      blades.origin = 0.5 * (box.min + box.max) + 0.5 * size * Vec3(unit(random), unit(random), unit(random));
      blades.length = 0.3 * size;
      blades.width = 0.2 * size;
      bool inside = false;
      for (int a = 0; a <= 4 && !inside; ++a) {
        for (int b = -2; b <= 2 && !inside; ++b) {
          const Vec3 p =
              blades.origin + a / 4.0 * blades.length * blades.x_axis + b / 4.0 * blades.width * blades.y_axis;
          double half_angle = 0.0;
          for (const Triangle& t : shape.mesh.triangles) {
            const Vec3 u = shape.mesh.vertices[t[0]] - p, v = shape.mesh.vertices[t[1]] - p,
                       w = shape.mesh.vertices[t[2]] - p;
            half_angle += std::atan2(u.dot(v.cross(w)), u.norm() * v.norm() * w.norm() + u.dot(v) * w.norm() +
                                                            v.dot(w) * u.norm() + w.dot(u) * v.norm());
          }
          inside = half_angle > M_PI;
        }
      }
      if (inside) {
        EXPECT_TRUE(bladesMeet(shape.mesh, blades)) << "blades " << i;
      }
      met += inside;
    }
    EXPECT_GT(met, 0);
  }
}

TEST(Cut, APlateOfOneLayerIsCutThroughItsGrid) {
  const TriangleMesh plate = unitVoxels(5, 4, 1);
  for (const Vec3& normal : {Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(1, 0, 1), Vec3(1, 1, 1)}) {
    const Plane plane = {normal.normalized(), Vec3(2, 2, 1)};  // through vertices, along edges and diagonals
    EXPECT_TRUE(laws::cutObeysLaws(plate, plane, {}, cutByPlane(plate, plane))) << normal.transpose();
  }
}

}  // namespace cut_test
}  // namespace meshless
