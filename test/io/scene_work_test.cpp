// Nothing for nothing: which stages of a step do work in each of the scenes that are shipped, as they start.
#include <filesystem>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include "meshless_surgery/io/scene.h"
#include "meshless_surgery/world/world.h"

namespace meshless {
namespace scene_work_test {

constexpr int kSteps = 90;

using Names = std::set<std::string>;
using Work = std::map<std::string, std::size_t>;

void add(Work& work, const StepReport& r) {
  const MatchCounters& m = r.match_counters;
  const ContactCounters& c = r.contact_counters;
  const std::pair<const char*, std::size_t> parts[] = {{"clusters", m.clusters},
                                                       {"linear fits", m.linear_fits},
                                                       {"quadratic moments", m.quadratic_moments},
                                                       {"plastic flows", m.plastic_flows},
                                                       {"gradients", r.preserve_counters.gradients},
                                                       {"bounds tested", c.bounds_tested},
                                                       {"pairs", c.pairs},
                                                       {"queries", c.queries},
                                                       {"contacts", c.contacts},
                                                       {"corrected", c.corrected},
                                                       {"ground contacts", r.ground_contacts},
                                                       {"contact shapes", r.contact_shapes},
                                                       {"self points", c.self_points},
                                                       {"push contacts", r.push_contacts},
                                                       {"tetrahedra tests", c.tested},
                                                       {"tetrahedralizations", r.tetrahedralizations},
                                                       {"fibres", r.fibres},
                                                       {"mended", r.mended}};
  for (const auto& [name, count] : parts) work[name] += count;
}

Work workOf(const std::string& scene) {
  const std::string package = SOURCE_DIR;
  FileAccess access;
  access.folders = {package};
  access.find_package = [&](const std::string&) { return package; };
  Result<SceneDef> read = readScene(package + "/config/scenes/" + scene, access);
  EXPECT_TRUE(read.ok()) << (read.ok() ? "" : read.error().detail);
  Work work;
  if (!read.ok()) return work;
  World world(read->world);
  std::shared_ptr<const PreparedBody> first;  // of the copies that share its model
  for (BodyDef& def : read->bodies) {
    std::shared_ptr<const PreparedBody> ready;
    if (first && def.copy && def.fixed.empty()) {
      ready = std::make_shared<PreparedBody>(placedCopy(*first, def.name, def.pose));
    } else {
      Result<PreparedBody> body = prepareBody(std::move(def));
      EXPECT_TRUE(body.ok()) << (body.ok() ? "" : body.error().detail);
      if (!body.ok()) return work;
      ready = first = std::make_shared<PreparedBody>(std::move(*body));
    }
    EXPECT_TRUE(world.addSceneBody(ready).ok());
  }
  for (ObstacleDef& def : read->obstacles) EXPECT_TRUE(world.addObstacle(std::move(def)).ok());
  for (const AttachCommand& attachment : read->attachments)
    EXPECT_TRUE(world.addSceneAttachment(attachment).ok()) << attachment.name;
  for (int step = 0; step < kSteps; ++step) {
    world.step();
    add(work, world.snapshot({}).report);
  }
  return work;
}

std::vector<std::string> shippedScenes() {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(SOURCE_DIR) + "/config/scenes"))
    if (entry.path().extension() == ".yaml" && !entry.is_symlink())  // a link is another name of the same
      names.push_back(entry.path().filename().string());
  return names;
}

TEST(SceneWork, EachShippedSceneDoesWhatItUsesAndNothingElse) {
  const Names held{"clusters", "linear fits", "contact shapes"};
  Names on_ground = held;
  on_ground.insert({"contacts", "corrected", "ground contacts"});
  Names bending = held, bending_on_ground = on_ground;
  bending.insert("quadratic moments");
  bending_on_ground.insert("quadratic moments");
  Names piled = bending_on_ground;
  piled.insert({"bounds tested", "pairs", "queries"});
  Names sheet = held;
  sheet.insert("queries");  // one side faces the other
  Names organs = on_ground;
  organs.insert({"bounds tested", "pairs", "queries", "fibres"});
  Names layers = held;
  layers.insert({"bounds tested", "pairs", "queries"});
  Names on_pegs = on_ground;
  on_pegs.insert({"bounds tested", "pairs", "queries"});
  const std::map<std::string, Names> expected = {{"abdomen.yaml", organs},      {"block.yaml", bending_on_ground},
                                                 {"fish.yaml", bending},        {"incision.yaml", held},
                                                 {"liver.yaml", on_ground},     {"liver_looks.yaml", on_ground},
                                                 {"lump.yaml", held},           {"pile.yaml", piled},
                                                 {"resection.yaml", on_ground}, {"skin.yaml", sheet},
                                                 {"vessel.yaml", held},         {"blocks.yaml", on_ground},
                                                 {"gauze.yaml", layers},        {"peg_transfer.yaml", on_pegs},
                                                 {"camera.yaml", layers}};
  EXPECT_EQ(shippedScenes().size(), expected.size()) << "a scene has no line here";
  for (const std::string& scene : shippedScenes()) {
    SCOPED_TRACE(scene);
    const Work work = workOf(scene);
    Names found;
    std::string text;
    for (const auto& [name, count] : work)
      if (count > 0) {
        found.insert(name);
        text += name + " " + std::to_string(count / kSteps) + "; ";
      }
    RecordProperty(scene, text);
    const auto known = expected.find(scene);
    if (known == expected.end()) continue;
    EXPECT_EQ(found, known->second);
  }
}

}  // namespace scene_work_test
}  // namespace meshless
