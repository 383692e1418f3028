#include "meshless_surgery/body/body.h"

#include <cstdio>
#include <limits>
#include <tuple>

#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/bodies.h"

namespace meshless {
namespace body_test {

using test::defOf;
using test::prepared;

TEST(PrepareBody, KeepsTheSurfaceAndSharesTheMassForEveryShape_Long) {
  for (const shapes::Shape& shape : shapes::allShapes()) {
    for (const double spacings : {5.0, 12.0}) {
      SCOPED_TRACE(shape.name + ", " + std::to_string(spacings) + " spacings");
      BodyDef def = defOf(shape.mesh);
      const double size = boundsOf(shape.mesh.vertices).diagonal();
      def.spacing = std::min(size / spacings, 2.0 * signedVolume(shape.mesh) / surfaceArea(shape.mesh));
      const PreparedBody body = prepared(def);
      const BodyModel& m = *body.model;
      EXPECT_GE(m.surface.triangles.size(), shape.mesh.triangles.size());  // long edges are halved
      EXPECT_NEAR(m.rest_volume, signedVolume(shape.mesh), 1e-12 * size * size * size);
      EXPECT_NEAR(m.mass, def.material.density * m.rest_volume, 1e-9 * m.mass);
      double sum = 0.0;
      for (double mass : m.masses) {
        EXPECT_GT(mass, 0.0);
        sum += mass;
      }
      EXPECT_NEAR(sum, m.mass, 1e-12 * m.mass);
      EXPECT_EQ(m.graph.size(), m.rest.size());
      for (Index i = 0; i < m.graph.size() && m.rest.size() > 1; ++i)
        EXPECT_LT(m.graph.offsets[i], m.graph.offsets[i + 1]) << "particle " << i << " holds to nothing";
      ASSERT_GE(body.state.surface.size(), shape.mesh.vertices.size());
      for (std::size_t v = 0; v < shape.mesh.vertices.size(); ++v)
        EXPECT_LT((body.state.surface[v] - shape.mesh.vertices[v]).norm(), 1e-12 * size);
    }
  }
}

TEST(PrepareBody, SaysWhatIsTooLargeOrTooSmallForAnOrganAndWhatWouldMakeItOne) {
  const std::tuple<double, const char*> proposed[] = {{0.001, ""},
                                                      {0.1, ""},
                                                      {2.0, ""},
                                                      {100.0,
                                                       "it is 100 m long; organs are 0.001 to 2 m; units: mm, or "
                                                       "scale: 0.001 makes it 0.1 m long"},
                                                      {12.0, "units: cm, or scale: 0.01 makes it 0.12 m long"},
                                                      {1e-4, "it is 0.0001 m long"},
                                                      {2e-4, "scale: 100 makes it 0.02 m long"},
                                                      {1e5, "organs are 0.001 to 2 m"}};
  for (const auto& [size, expected] : proposed) {
    SCOPED_TRACE(size);
    BodyDef def = test::defOf(boxMesh(Vec3(size, 0.5 * size, 0.5 * size), 4, 2, 2));
    def.spacing = 0.25 * size;
    const std::vector<std::string> warnings = test::prepared(def).def.warnings;
    ASSERT_EQ(warnings.size(), *expected == 0 ? 0u : 1u);
    if (*expected != 0) EXPECT_NE(warnings[0].find(expected), std::string::npos) << warnings[0];
  }
}

/// Share of the mass [%] and middle [m] of each part that a warning names.
std::vector<std::pair<double, Vec3>> namedParts(const std::string& warning) {
  std::vector<std::pair<double, Vec3>> parts;
  for (std::size_t at = warning.find(" % of its mass"); at != std::string::npos;
       at = warning.find(" % of its mass", at + 1)) {
    std::pair<double, Vec3> part;
    part.first = std::stod(warning.substr(warning.rfind(' ', at - 1)));
    Vec3& p = part.second;
    EXPECT_EQ(3, std::sscanf(warning.c_str() + at, " %% of its mass around (%lf, %lf, %lf) m", &p.x(), &p.y(), &p.z()));
    parts.push_back(part);
  }
  return parts;
}

TEST(PrepareBody, WarnsOfPartsThatHangTogetherWithNothing) {
  for (const bool elastic : {false, true}) {
    SCOPED_TRACE(elastic);
    const auto warningOf = [&](const TriangleMesh& mesh) {
      BodyDef def = defOf(mesh);
      def.pose = shapes::anyPose();
      if (elastic) def.material.youngs_modulus = 1e4;
      const std::vector<std::string> warnings = prepared(def).def.warnings;
      for (const std::string& warning : warnings)
        if (warning.find("hang together") != std::string::npos) return warning;
      return std::string();
    };
    for (const shapes::Shape& shape : shapes::simpleShapes())
      if (!elastic || shape.name == "hollow sphere" || shape.name == "arch")
        EXPECT_EQ(shape.name == "two pieces", warningOf(shape.mesh) != "") << shape.name;
    const TriangleMesh large = sphereMesh(0.05, 0.015);
    const auto expectTwo = [&](const TriangleMesh& mesh, const TriangleMesh& small, const Vec3& at) {
      const std::string warning = warningOf(mesh);
      EXPECT_NE(std::string::npos, warning.find("it has 2 parts that hang together with nothing: ")) << warning;
      const auto parts = namedParts(warning);
      ASSERT_EQ(2u, parts.size());
      const double share = 100.0 * signedVolume(small) / signedVolume(mesh);
      EXPECT_NEAR(100.0, parts[0].first + parts[1].first, 0.2);
      EXPECT_NEAR(share, parts[1].first, 1.0 + 0.1 * share);
      EXPECT_LT((shapes::anyPose() * at - parts[1].second).norm(), 0.003);
      EXPECT_LT((shapes::anyPose() * Vec3(0, 0, 0) - parts[0].second).norm(), 0.003);
    };
    const TriangleMesh island = sphereMesh(0.02, 0.01);
    for (const Vec3& at : {Vec3(0.1, 0, 0.02), Vec3(0, -0.0701, 0)}) {
      TriangleMesh two = large;
      shapes::append(two, island, at);
      expectTwo(two, island, at);
    }
    TriangleMesh stone = shapes::hollowSphere();  // in its cavity
    shapes::append(stone, island, Vec3(0.01, 0, 0));
    expectTwo(stone, island, Vec3(0.01, 0, 0));
    TriangleMesh many = large;
    for (int k = 0; k < 6; ++k) shapes::append(many, island, Vec3(0.1 + 0.05 * k, 0, 0));
    const std::string warning = warningOf(many);
    EXPECT_NE(std::string::npos, warning.find("it has 7 parts")) << warning;
    EXPECT_EQ(5u, namedParts(warning).size());
    EXPECT_EQ(" ...", warning.substr(warning.size() - 4));
  }
}

// Millimetres taken for metres, with a wall or a clamp in metres: what is refused then is refused for its size.
TEST(PrepareBody, WhatIsRefusedAndHasNoSizeOfAnOrganIsRefusedWithThatSize) {
  TriangleMesh sheet;
  sheet.vertices = {Vec3(0, 0, 0), Vec3(180, 0, 0), Vec3(180, 180, 0), Vec3(0, 180, 0)};
  sheet.triangles = {{0, 1, 2}, {0, 2, 3}};
  BodyDef layer = test::defOf(sheet);
  layer.solid = false;
  layer.thickness = 0.05;
  layer.material.youngs_modulus = 4500.0;
  BodyDef held = test::defOf(boxMesh(Vec3(180.0, 90.0, 90.0), 4, 2, 2));
  held.fixed.push_back(HeldRegion(Vec3::Constant(200.0), Vec3::Constant(201.0)));
  BodyDef fine = test::defOf(boxMesh(Vec3(180.0, 90.0, 90.0), 4, 2, 2));
  fine.spacing = 0.01;
  for (const auto& [def, reason] :
       {std::pair(&layer, "its layer of 0.05 m takes a spacing of at most 0.175 m"),
        std::pair(&held, "holds nothing of it"), std::pair(&fine, "spacing 0.01 m would")}) {
    const Result<PreparedBody> refused = prepareBody(*def);
    ASSERT_FALSE(refused.ok()) << reason;
    EXPECT_NE(refused.error().detail.find(reason), std::string::npos) << refused.error().detail;
    EXPECT_NE(refused.error().detail.find("units: mm, or scale: 0.001 makes it 0.18 m long"), std::string::npos)
        << refused.error().detail;
  }
}

TEST(PrepareBody, AnOpenSurfaceIsNoSolidUnlessItBecomesALayer) {
  TriangleMesh sheet;
  sheet.vertices = {Vec3(0, 0, 0), Vec3(0.1, 0, 0), Vec3(0.1, 0.1, 0), Vec3(0, 0.1, 0)};
  sheet.triangles = {{0, 1, 2}, {0, 2, 3}};
  for (const double thickness : {0.0, 0.01}) {
    BodyDef def = test::defOf(sheet);
    def.solid = false;
    def.thickness = thickness;
    std::string notes;
    for (const std::string& note : test::prepared(def).def.notes) notes += note + "; ";
    EXPECT_EQ(notes.find("cannot be filled, given a volume or cut") == std::string::npos, thickness > 0.0) << notes;
    EXPECT_EQ(notes.find("is the middle of a layer") == std::string::npos, thickness == 0.0) << notes;
  }
}

TEST(PrepareBody, ABallHasItsCentreOfMassInTheMiddle) {
  const PreparedBody body = prepared(test::ball("ball", Vec3::Zero()));
  EXPECT_LT(measureBody(*body.model, body.state).centre_of_mass.norm(), 0.0005);
  const PreparedBody box = prepared(defOf(boxMesh(Vec3(0.1, 0.1, 0.1), 0.02)));
  EXPECT_LT(measureBody(*box.model, box.state).centre_of_mass.norm(), 0.0005);
  EXPECT_GT(body.model->rest.size(), body.model->surface.vertices.size()) << "no particles inside";
}

// Two legs a tenth of a metre apart, in cells as wide: their corners are their own.
TEST(PrepareBody, TheGraphGoesAlongTheBodyNotThroughTheAir) {
  BodyDef def = defOf(shapes::arch());
  def.spacing = 0.055;
  const PreparedBody body = prepared(def);
  const ParticleGraph& graph = body.model->graph;
  Index from = 0, to = 0;  // the legs' feet
  for (Index i = 0; i < graph.size(); ++i) {
    const auto off = [&](Index particle, double x) { return (body.state.positions[particle] - Vec3(x, 0, 0)).norm(); };
    if (off(i, -0.075) < off(from, -0.075)) from = i;
    if (off(i, 0.075) < off(to, 0.075)) to = i;
  }
  std::vector<double> way(graph.size(), 1e9);
  std::vector<Index> queue{from};
  way[from] = 0.0;
  for (std::size_t n = 0; n < queue.size(); ++n)
    for (Index k = graph.offsets[queue[n]]; k < graph.offsets[queue[n] + 1]; ++k)
      if (way[queue[n]] + graph.lengths[k] < way[graph.neighbours[k]]) {
        way[graph.neighbours[k]] = way[queue[n]] + graph.lengths[k];
        queue.push_back(graph.neighbours[k]);
      }
  EXPECT_GT(way[to], 0.15 + 0.05);
  EXPECT_LT(way[to], 1.0);
}

TEST(PrepareBody, AnOpenSurfaceIsAShellWithoutAVolume) {
  BodyDef def = test::ball();
  def.mesh.triangles.resize(def.mesh.triangles.size() - 40);
  def.solid = false;
  const PreparedBody body = prepared(def);
  EXPECT_FALSE(body.model->solid);
  EXPECT_EQ(body.model->rest_volume, 0.0);
  EXPECT_GT(body.model->mass, 0.0);
  EXPECT_EQ(body.model->rest, body.model->surface.vertices);
}

// Cells times the highest frequency [rad/s] is what a simulated second takes: at most twice as much for one organ as
// for another, of whatever size and stiffness. What is thin has cells no wider than it is thick, unless that takes very
// many. The next resolution takes five times as much.
// A membrane of a material with a modulus is tissue, and says where its cells are too wide for it: where it is curved.
TEST(PrepareBody, AThicknessMakesASolidLayerOfAnOpenSurface) {
  for (const double height : {0.0, 0.02}) {
    BodyDef def;
    def.name = "membrane";
    def.solid = false;
    def.mesh.vertices = {{0, 0, 0}, {0.04, 0, 0}, {0.04, 0.04, height}, {0, 0.04, 0}};
    def.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    def.material.youngs_modulus = 1e4;
    def.thickness = 0.0015;
    const PreparedBody body = prepared(def);
    EXPECT_TRUE(body.model->solid);
    if (height == 0.0) EXPECT_NEAR(body.model->rest_volume, 0.04 * 0.04 * 0.0015, 1e-15);
    EXPECT_TRUE(body.model->lattice);
    EXPECT_GT(body.model->spacing, def.thickness);
    ASSERT_EQ(body.def.warnings.size(), height > 0.0 ? 1u : 0u);
    if (height > 0.0)
      EXPECT_NE(body.def.warnings[0].find("spacing: 0.00075"), std::string::npos) << body.def.warnings[0];
    // Its cells are wider than it, and may hang together by corners.
    if (height > 0.0) EXPECT_NE(body.def.warnings[0].find("hinge"), std::string::npos) << body.def.warnings[0];
    // Cells that it fills do not.
    def.thickness = 0.006;
    const PreparedBody thick = prepared(def);
    EXPECT_LT(thick.model->spacing, def.thickness);
    for (const std::string& warning : thick.def.warnings)
      EXPECT_EQ(warning.find("hinge"), std::string::npos) << warning;
  }
}

TEST(PrepareBody, OrgansOfAnySizeAndStiffnessCostTheSameByDefault) {
  const auto made = [](const TriangleMesh& mesh, double youngs_modulus, Resolution resolution) {
    BodyDef def = defOf(mesh);
    def.material.youngs_modulus = youngs_modulus;
    def.material.poissons_ratio = 0.45;
    def.resolution = resolution;
    return prepared(def);
  };
  const auto cost = [](const PreparedBody& body) {
    return static_cast<double>(body.model->cells->cells.size()) * body.model->highest_frequency;
  };
  double least = 1e300, most = 0.0;
  for (const double radius : {0.01, 0.03, 0.1})
    for (const double youngs_modulus : {2e3, 2e4}) {
      const TriangleMesh ball = sphereMesh(radius, 0.2 * radius);
      const PreparedBody medium = made(ball, youngs_modulus, Resolution::kMedium);
      least = std::min(least, cost(medium));
      most = std::max(most, cost(medium));
      const PreparedBody fine = made(ball, youngs_modulus, Resolution::kFine);
      EXPECT_NEAR(medium.model->spacing / fine.model->spacing, 1.5, 1e-9);
      EXPECT_NEAR(made(ball, youngs_modulus, Resolution::kCoarse).model->spacing / medium.model->spacing, 1.5, 1e-9);
      EXPECT_NEAR(cost(fine) / cost(medium), 5.0, 1.5) << radius << " " << youngs_modulus;
    }
  EXPECT_LT(most, 2.0 * least);
  EXPECT_LT(most, 2e6) << "a tenth of a thread: two substeps of a tenth of a microsecond in each 2.2 radians";
  for (const double thickness : {0.02, 0.01, 0.006}) {
    const PreparedBody plate = made(boxMesh(Vec3(0.1, 0.1, thickness), 0.01), 1e5, Resolution::kMedium);
    EXPECT_LT(plate.model->spacing, thickness);
  }
  const PreparedBody foil = made(boxMesh(Vec3(0.1, 0.1, 0.0005), 0.01), 1e4, Resolution::kMedium);
  EXPECT_LT(foil.model->cells->cells.size(), 6400u) << "half a millimetre everywhere would take 40,000";
}

TEST(PrepareBody, WhatItsSpacingDoesNotSeeGetsAFinerOneAndIsTold) {
  BodyDef def = defOf(boxMesh(Vec3(0.1, 0.1, 0.002), 0.01));
  def.spacing = 0.05;
  const PreparedBody plate = prepared(def);
  EXPECT_LT(plate.model->spacing, 0.02);
  EXPECT_NEAR(plate.model->mass, def.material.density * 0.1 * 0.1 * 0.002, 1e-9);
  ASSERT_EQ(plate.def.warnings.size(), 1u);
  EXPECT_NE(plate.def.warnings[0].find("0.05 m"), std::string::npos) << plate.def.warnings[0];
  def.spacing = 0.001;
  EXPECT_TRUE(prepared(def).def.warnings.empty());
  EXPECT_EQ(prepared(def).model->spacing, def.spacing);
  def = defOf(boxMesh(Vec3(0.5, 0.5, 1e-5), 0.05));
  def.spacing = 0.05;
  const Result<PreparedBody> foil = prepareBody(def);
  ASSERT_FALSE(foil.ok());
  EXPECT_NE(foil.error().detail.find("spacing is 0.05 m"), std::string::npos) << foil.error().detail;
}

TEST(PrepareBody, RefusesBadChoicesByName) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](const BodyDef& def, const std::string& word) {
    const Result<PreparedBody> body = prepareBody(def);
    ASSERT_FALSE(body.ok()) << word;
    EXPECT_NE(body.error().detail.find(word), std::string::npos) << body.error().detail;
  };
  BodyDef def = test::ball();
  for (double spacing : {-1.0, nan, 1e9}) {
    def.spacing = spacing;
    refused(def, "spacing");
  }
  def.spacing = 1e-5;
  refused(def, "particles");
  def = test::ball();
  def.clusters.grid = {{0, 1, 1}};
  refused(def, "grid");
  def = test::ball();
  def.clusters.count = 0;
  refused(def, "count");
  def = test::ball();
  def.clusters.overlap = nan;
  refused(def, "overlap");
  def = test::ball();
  def.material.alpha = 2;
  refused(def, "alpha");
  def = test::ball();
  def.pose.translation.x() = nan;
  refused(def, "pose");
  def = test::ball();
  def.mesh = TriangleMesh();
  refused(def, "no triangles");
  def = test::ball();
  def.mesh = shapes::turnedInsideOut(def.mesh);
  refused(def, "volume");
}

TEST(PlacedCopy, IsTheBodyThatIsPreparedThere) {
  BodyDef def = test::ball();
  def.pose = shapes::anyPose();
  const PreparedBody first = prepared(def);
  const Pose there{Quat(Eigen::AngleAxisd(2.1, Vec3(0.5, 0.2, -0.9).normalized())), Vec3(-3.0, 2.0, 1.0)};
  const PreparedBody copy = placedCopy(first, "copy", there);
  def.name = "copy";
  def.pose = there;
  const PreparedBody expected = prepared(def);
  EXPECT_EQ(copy.def.name, "copy");
  EXPECT_EQ(copy.model, first.model);
  ASSERT_EQ(copy.state.positions.size(), first.state.positions.size());
  double farthest = 0.0;
  for (std::size_t v = 0; v < expected.state.surface.size(); ++v)
    farthest = std::max(farthest, (copy.state.surface[v] - expected.state.surface[v]).norm());
  EXPECT_LT(farthest, 1e-12);
  // Its clusters know how they are turned: nothing moves without forces.
  BodyState state = copy.state;
  StepScratch scratch;
  MatchCounters counters;
  for (int step = 0; step < 5; ++step)
    matchAndMove(*copy.model, copy.def.material, Vec3::Zero(), 0.01, state, scratch, counters);
  double moved = 0.0;
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    moved = std::max(moved, (state.positions[i] - copy.state.positions[i]).norm());
  EXPECT_LT(moved, 1e-12);
}

TEST(WithMaterial, DensityScalesMassAndTheRestStays) {
  const PreparedBody body = prepared(test::ball());
  Material after = body.def.material;
  after.density *= 2.5;
  const BodyModelPtr heavy = withMaterial(body.model, body.def.material, after);
  EXPECT_NEAR(heavy->mass, 2.5 * body.model->mass, 1e-12 * heavy->mass);
  EXPECT_EQ(heavy->rest, body.model->rest);
  EXPECT_TRUE(heavy->shape.quadratic.empty());
  after = body.def.material;
  after.mode = MatchMode::kQuadratic;
  EXPECT_EQ(withMaterial(body.model, body.def.material, after)->shape.quadratic.size(), body.model->clusters.size());
  EXPECT_EQ(withMaterial(body.model, body.def.material, body.def.material), body.model);
}

}  // namespace body_test
}  // namespace meshless
