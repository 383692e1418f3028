// Whole scenes: a sound one holds, faulty ones do not, and a seed says it all.
#include "drive/drive.h"

#include <set>
#include <sstream>

#include "drive/drive_table.h"
#include "drive/known_breaks.h"
#include "meshless_surgery/io/scene.h"
#include "meshless_surgery/world/command_log.h"
#include "seen_support.h"

namespace meshless {
namespace {

BodyDef boxBody(double height) {
  BodyDef def;
  def.name = "organ_1";
  def.mesh = boxMesh(Vec3(0.1, 0.08, 0.06), 5, 4, 3);
  def.pose.translation.z() = 0.03 + height;
  def.material.mode = MatchMode::kLinear;
  def.material.alpha = 0.95;
  def.material.damping = 4.0;
  return def;
}

DriveScene sceneOf(BodyDef def) {
  DriveScene scene;
  scene.seed = 7;
  scene.support = "ground";
  scene.organs = {"box"};
  scene.def.bodies.push_back(std::move(def));
  return scene;
}

const Finding& of(const DriveReport& report, Law law) { return report.findings[static_cast<std::size_t>(law)]; }

std::string broke(const DriveReport& report) {
  std::ostringstream text;
  printRow(text, report);
  return text.str();
}

TEST(Drive, ASoundSceneHolds) {
  DriveOptions options;
  options.hands = false;
  const DriveReport report = drive(sceneOf(boxBody(0.02)), options);
  EXPECT_TRUE(report.holds()) << broke(report);
  EXPECT_DOUBLE_EQ(report.simulated, 5.0);
  EXPECT_GT(report.processor, 0.0);
}

TEST(Drive, FindsASceneThatNeverRests) {
  DriveScene scene = sceneOf(boxBody(0.3));
  scene.def.world.ground.reset();  // it falls for ever
  DriveOptions options;
  options.hands = false;
  const DriveReport report = drive(scene, options);
  EXPECT_TRUE(of(report, Law::kRest).broken()) << of(report, Law::kRest).text;
  EXPECT_TRUE(of(report, Law::kAsleep).broken());
  EXPECT_FALSE(report.holds());
}

TEST(Drive, FindsWhatFallsThroughEachOther) {
  DriveScene scene = sceneOf(boxBody(0.01));
  BodyDef other = boxBody(0.08);
  other.name = "organ_2";
  other.pose.translation += Vec3(0.013, 0.007, 0.0);
  scene.def.bodies.push_back(other);
  scene.def.world.contact = ContactMethod::kNone;
  DriveOptions options;
  options.hands = false;
  const DriveReport report = drive(scene, options);
  EXPECT_TRUE(of(report, Law::kDepth).broken()) << broke(report);
  EXPECT_TRUE(of(report, Law::kCrossings).broken()) << broke(report);
}

TEST(Drive, GivesUpWhatTakesTooLong) {
  DriveOptions options;
  options.budget = 1e-6;
  const DriveReport report = drive(sceneOf(boxBody(0.02)), options);
  EXPECT_FALSE(report.finished);
  EXPECT_FALSE(report.holds());
}

TEST(Drive, RefusesWhatCannotBePrepared) {
  BodyDef def = boxBody(0.02);
  def.spacing = -1.0;
  const DriveReport report = drive(sceneOf(def), {});
  EXPECT_NE(report.refused.find("spacing"), std::string::npos) << report.refused;
  EXPECT_FALSE(report.holds());
}

TEST(Drive, ASeedSaysItAllAndItsLogReplays) {
  DriveOptions options;
  options.record = true;
  const DriveScene scene = sceneOf(boxBody(0.02));
  const DriveReport first = drive(scene, options), second = drive(scene, options);
  ASSERT_TRUE(first.finished);
  EXPECT_GT(first.hand.pulls + first.hand.pushes + first.hand.cuts + first.hand.incisions, 0);
  EXPECT_EQ(first.hash, second.hash);
  EXPECT_EQ(first.log, second.log);
  std::istringstream log(first.log);
  const auto report = replay(log);
  ASSERT_TRUE(report.ok()) << report.error().detail;
  EXPECT_TRUE(report->ended);
  EXPECT_GT(report->checks, 5u);
  EXPECT_FALSE(report->difference.has_value());
  EXPECT_EQ(report->hash, first.hash);
  ASSERT_TRUE(first.state);
  EXPECT_TRUE(decode(encode(*first.state)).ok());
}

TEST(Hand, WaitsWhereItWouldCutAndLetsGo) {
  int cuts = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    for (const bool allowed : {false, true}) {
      World world{WorldSettings()};
      ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(*prepareBody(boxBody(0.0)))).ok());
      Hand hand(seed, allowed, [&](const Command& command) { return world.apply(command); });
      int steps = 0;
      while (hand.act(world)) {
        world.step();
        ASSERT_LT(++steps, 120 * 12);
      }
      EXPECT_TRUE(world.snapshot({}).picks.empty());
      EXPECT_FALSE(world.push().enabled);
      if (allowed)
        cuts += hand.counts().cuts + hand.counts().incisions;
      else
        EXPECT_EQ(hand.counts().cuts + hand.counts().incisions + hand.counts().undos, 0);
    }
  }
  EXPECT_GT(cuts, 3);
}

std::map<std::string, Material> shippedMaterials() {
  auto materials = readMaterials(std::string(SOURCE_DIR) + "/config/materials");
  EXPECT_TRUE(materials.ok());
  return *materials;
}

TEST(DriveScenes, AreOfTheirSeedAloneAndKeepTheirBounds_Long) {
  DriveChoices choices;
  choices.shipped = shippedMaterials();
  std::set<std::string> supports;
  std::set<bool> families;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const auto scene = makeDriveScene(seed, choices);
    const auto again = seed == 3 ? makeDriveScene(seed, choices) : scene;
    ASSERT_TRUE(scene.ok()) << scene.error().detail;
    ASSERT_GE(scene->def.bodies.size(), 1u);
    ASSERT_LE(scene->def.bodies.size(), 3u);
    supports.insert(scene->support);
    EXPECT_EQ(scene->def.obstacles.size(), scene->support == "tray" || scene->support == "bowl" ? 1u : 0u);
    std::vector<Box> boxes;
    for (std::size_t b = 0; b < scene->def.bodies.size(); ++b) {
      const BodyDef& body = scene->def.bodies[b];
      families.insert(body.material.elastic());
      EXPECT_TRUE(body.material.validate().ok());
      EXPECT_EQ(body.mesh.vertices, again->def.bodies[b].mesh.vertices);
      EXPECT_EQ(body.pose.translation, again->def.bodies[b].pose.translation);
      EXPECT_EQ(!body.fixed.empty(), scene->support == "hung");
      const Box own = boundsOf(body.mesh.vertices);
      const double size = (own.max - own.min).maxCoeff();
      EXPECT_GE(size, 0.0499);
      EXPECT_LE(size, 0.3001);
      Box placed;
      for (const Vec3& p : body.mesh.vertices) placed.extend(body.pose * p);
      EXPECT_GT(placed.min.z(), 0.0);
      for (const Box& other : boxes) EXPECT_FALSE(placed.overlaps(other)) << "seed " << seed;
      for (const ObstacleDef& obstacle : scene->def.obstacles) {
        EXPECT_GT(placed.min.z(), boundsOf(obstacle.mesh.vertices).max.z()) << "seed " << seed;
        EXPECT_GT(signedVolume(obstacle.mesh), 0.0);
      }
      boxes.push_back(placed);
    }
  }
  EXPECT_GE(supports.size(), 2u);
  EXPECT_EQ(families.size(), 2u);
}

TEST(DriveScenes, AreNarrowedAndRefuseWhatIsNotThere) {
  DriveChoices choices;
  choices.shipped = shippedMaterials();
  choices.most_organs = 1;
  for (const char* material : {"elastic", "looks", "fat"})
    for (std::uint64_t seed = 3; seed <= 3; ++seed) {
      choices.material = material;
      choices.support = "bowl";
      const auto scene = makeDriveScene(seed, choices);
      ASSERT_TRUE(scene.ok());
      EXPECT_EQ(scene->support, "bowl");
      for (const BodyDef& body : scene->def.bodies) {
        EXPECT_EQ(body.material.elastic(), choices.material == "elastic");
        if (choices.material == "fat") EXPECT_EQ(body.material.name, "fat");
      }
    }
  choices.material = "granite";
  auto refused = makeDriveScene(1, choices);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().detail.find("elastic_liver"), std::string::npos) << refused.error().detail;
  choices.material = "";
  choices.support = "air";
  refused = makeDriveScene(1, choices);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().detail.find("ground"), std::string::npos);
  choices.support = "";
  choices.most_triangles = 400.0;
  refused = makeDriveScene(1, choices);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().detail.find("400; accepted: 500 to 3e+04"), std::string::npos) << refused.error().detail;
  choices.most_triangles = 30000.0;
  choices.most_organs = 4;
  EXPECT_FALSE(makeDriveScene(1, choices).ok());
}

Result<std::vector<KnownBreak>> knownOf(const std::string& text) {
  std::istringstream in(text);
  return readKnownBreaks(in);
}

TEST(KnownBreaks, AreExpectedAndNoOthers) {
  std::vector<DriveReport> reports(3);
  for (std::size_t k = 0; k < reports.size(); ++k) {
    reports[k].seed = k + 1;
    reports[k].finished = k != 1;
  }
  reports[0].findings[static_cast<std::size_t>(Law::kDepth)].take(3.0, "2 s: deep");
  const auto known = knownOf("# seed | law | why\n\n1 | depth | a crumb below a blade\n");
  ASSERT_TRUE(known.ok());
  EXPECT_TRUE(unlikeKnown(reports, *known).empty()) << "what did not finish is no break";
  EXPECT_EQ(unlikeKnown(reports, {}).at(0), "seed 1 breaks depth: 2 s: deep");
  const auto other = knownOf("1 | depth | a\n 3 | rest | it swings");
  ASSERT_TRUE(other.ok());
  EXPECT_EQ(unlikeKnown(reports, *other).at(0), "seed 3 holds what it is known to break: take it off the list");
  const auto more = knownOf("1 | depth | a\n 1 | rest | it swings");
  ASSERT_TRUE(more.ok());
  EXPECT_TRUE(unlikeKnown(reports, *more).empty()) << "what a listed scene breaks may depend on how far it came";
  reports[1].refused = "no shape";
  EXPECT_EQ(unlikeKnown(reports, *known).at(0), "seed 2 was refused: no shape");
}

TEST(KnownBreaks, AreFewAndSaidInFull) {
  for (const char* text : {"1 | depth", "x | depth | why", "1 | deep | why", "1 | depth |  ", "| depth | why",
                           "1 | depth | a\n2 | depth | a\n3 | depth | a\n4 | depth | a\n5 | depth | a"}) {
    const auto known = knownOf(text);
    ASSERT_FALSE(known.ok()) << text;
    EXPECT_NE(known.error().detail.find("line "), std::string::npos) << known.error().detail;
  }
  EXPECT_NE(knownOf("7 | deep | why").error().detail.find("crossings"), std::string::npos);
}

TEST(DriveTable, SaysWhoIsWorstAndWhatBreaksWhere) {
  std::vector<DriveReport> reports(4);
  for (std::size_t k = 0; k < reports.size(); ++k) {
    reports[k].seed = k + 1;
    reports[k].finished = true;
    reports[k].family = k % 2 ? "elastic" : "looks";
    reports[k].support = "ground";
    reports[k].bodies = 1;
  }
  reports[1].findings[static_cast<std::size_t>(Law::kDepth)].take(3.0, "1 s: deep");
  reports[2].finished = false;
  reports[3].findings[static_cast<std::size_t>(Law::kDepth)].take(2.0, "1 s: deep");
  reports[3].findings[static_cast<std::size_t>(Law::kFolds)].take(2.0, "1 s: folded");
  const auto worst = worstOf(reports, 10);
  ASSERT_EQ(worst.size(), 3u);
  EXPECT_EQ(worst[0]->seed, 3u);
  EXPECT_EQ(worst[1]->seed, 4u);
  EXPECT_EQ(worst[2]->seed, 2u);
  EXPECT_EQ(worstOf(reports, 1).size(), 1u);
  std::ostringstream summary, csv;
  printSummary(summary, reports);
  EXPECT_NE(summary.str().find("1 of 4 hold"), std::string::npos) << summary.str();
  EXPECT_NE(summary.str().find("did not finish"), std::string::npos);
  EXPECT_NE(summary.str().find("1 s: folded"), std::string::npos);
  writeCsv(csv, reports);
  std::istringstream lines(csv.str());
  std::string line;
  int count = 0;
  while (std::getline(lines, line)) ++count;
  EXPECT_EQ(count, 5);
}

}  // namespace
}  // namespace meshless
