// examples/substep.py is docs/method.md as a script: from the same state it goes where the package goes.
#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include "io/temporary_folder.h"
#include "meshless_surgery/body/deform.h"
#include "support/bodies.h"
#include "support/random.h"

namespace meshless {
namespace substep_test {

constexpr int kSteps = 2;  // the second one shows what the first has left of velocities, stretch and pace

// Writes JSON.
class Json {
 public:
  template <class T>
  Json& put(const std::string& name, const T& value) {
    text_ += (text_.empty() ? "{\"" : ", \"") + name + "\": ";
    write(value);
    return *this;
  }
  std::string text() const { return text_ + "}"; }

 private:
  void write(double value) {
    char digits[32];
    std::snprintf(digits, sizeof digits, "%.17g", value);
    text_ += digits;
  }
  void write(Index value) { text_ += std::to_string(value); }
  void write(const Vec3& p) { write(std::array<double, 3>{p.x(), p.y(), p.z()}); }
  void write(const Json& object) { text_ += object.text(); }
  template <class List>
  void write(const List& list) {
    text_ += "[";
    bool first = true;
    for (const auto& value : list) {
      if (!first) text_ += ", ";
      write(value);
      first = false;
    }
    text_ += "]";
  }

  std::string text_;
};

struct Case {
  std::string name;
  BodyDef def;
  double step_rate = 2000.0;  // [Hz]
};

Case heldBar() {  // whose cells its end crosses, with a core of another material
  Case bar{"held", test::defOf(boxMesh(Vec3(0.043, 0.018, 0.021), 6, 3, 3), "bar"), 2000.0};
  bar.def.pose = {Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized())), Vec3(0.1, -0.2, 0.3)};
  bar.def.fixed.push_back({Region(Vec3(-1, -1, -1), Vec3(-0.0137, 1, 1)), false});
  TissueRegion core{Region(Vec3(-0.005, -0.02, -0.02), Vec3(0.006, 0.02, 0.02)), Material()};
  core.material.youngs_modulus = 9000.0;
  core.material.poissons_ratio = 0.3;
  core.material.density = 1300.0;
  bar.def.regions.push_back(core);
  return bar;
}

Case freeBall(const std::string& name, double step_rate) {
  Case ball{name, test::defOf(sphereMesh(0.016, 0.006), "ball"), step_rate};
  ball.def.pose.translation = Vec3(0.05, 0.0, 0.2);
  return ball;
}

std::vector<Case> cases() {
  Case slowed_bar = heldBar();
  slowed_bar.name = "held_slowed";
  slowed_bar.step_rate = 150.0;
  return {heldBar(), slowed_bar, freeBall("free", 2000.0), freeBall("free_slowed", 150.0)};
}

PreparedBody inMotion(BodyDef def) {
  def.spacing = 0.01;
  def.material.youngs_modulus = 5000.0;
  def.material.poissons_ratio = 0.42;
  def.material.density = 1060.0;
  def.material.damping = 7.0;
  PreparedBody body = test::prepared(def);
  BodyState& state = body.state;
  test::Random random(5);
  const Vec3 middle = def.pose.translation;
  for (std::size_t i = 0; i < state.positions.size(); ++i) {
    if (body.model->fixed[i]) continue;
    const Vec3 r = state.positions[i] - middle;
    state.velocities[i] = Vec3(0.1, -0.2, 0.05) + Vec3(3, 5, 20).cross(r) + random.vector(0.02);
    state.positions[i] += Vec3(0.1 * r.x(), -0.1 * r.y(), 5.0 * r.x() * r.x()) + random.vector(0.0015);
  }
  // One corner is drawn out far, one is pushed through its cells: the law has to hold there, too.
  std::size_t at = state.positions.size();
  for (const double way : {6.0, -2.5}) {
    do --at;
    while (body.model->fixed[at]);
    state.positions[at] += way * (state.positions[at] - middle);
  }
  state.stretch = 1.3;
  state.pace = 0.8;
  return body;
}

Json cellsAndParticles(const PreparedBody& body, const Pick& pick, const WorldSettings& settings) {
  const BodyModel& model = *body.model;
  const ElasticParameters own =
      elasticParameters(body.def.material.youngs_modulus, body.def.material.poissons_ratio, body.def.material.density);
  std::vector<std::array<Index, 8>> corners;
  std::vector<double> volumes, mu, lambda, areas;
  Points centroids, variances, at, placed;
  std::vector<Index> fixed, clamp_cells;
  for (const ElasticCell& cell : model.cells->cells) {
    corners.push_back(cell.corners);
    volumes.push_back(cell.mass / own.density);
    mu.push_back(cell.mix.of(own).mu);
    lambda.push_back(cell.mix.of(own).lambda);
    centroids.push_back(cell.centroid);
    variances.push_back(cell.variance);
  }
  for (const ClampPoint& point : model.clamp_points) {
    clamp_cells.push_back(point.cell);
    at.push_back(point.at);
    areas.push_back(point.area);
  }
  for (Index i = 0; i < model.rest.size(); ++i) {
    placed.push_back(body.state.placed * model.rest[i]);
    if (model.fixed[i]) fixed.push_back(i);
  }
  Json json;
  json.put("s", model.spacing).put("m0", model.cell_mass).put("omega", model.highest_frequency);
  json.put("d", body.def.material.damping).put("h", 1.0 / settings.step_rate).put("g", settings.gravity);
  json.put("m", model.masses).put("X", placed).put("fixed", fixed);
  json.put("corners", corners).put("vol", volumes).put("mu", mu).put("lam", lambda);
  json.put("xi", centroids).put("sigma", variances);
  json.put("clamp_cell", clamp_cells).put("clamp_at", at).put("clamp_area", areas);
  return json.put("grasp", pick.patch).put("w", pick.weights).put("K", pick.stiffness);
}

struct Played {
  Json body, state;
  std::vector<Vec3> ends;
  std::vector<Points> after;

  std::string text() const {
    Json json;
    return json.put("body", body).put("state", state).put("u", ends).put("x_after", after).text();
  }
};

Played play(const Case& of) {
  const auto body = std::make_shared<const PreparedBody>(inMotion(of.def));
  WorldSettings settings;
  settings.ground.reset();
  settings.contact = ContactMethod::kNone;
  settings.sleep = false;
  settings.step_rate = of.step_rate;
  settings.max_substeps = 1;
  World world(settings);
  test::replyOf<SpawnReply>(world.apply(SpawnCommand{body}));
  PickCommand grab;
  Index far = 0;  // from what is held
  for (Index i = 0; i < body->model->rest.size(); ++i)
    if (body->model->isTissue(i) && body->model->rest[i].x() > body->model->rest[far].x()) far = i;
  grab.point = body->state.positions[far];
  grab.stiffness = 800.0;
  const PickReply picked = test::replyOf<PickReply>(world.apply(grab));
  MovePickCommand move;
  move.pick = picked.pick;
  move.target = picked.position + Vec3(0.004, -0.01, 0.006);
  EXPECT_TRUE(world.apply(move).ok());

  const Pick pick = world.snapshot({}).picks.at(0);
  Played played;
  played.body = cellsAndParticles(*body, pick, settings);
  const double pace = body->state.pace;
  played.state.put("x", body->state.positions).put("v", body->state.velocities);
  played.state.put("z", body->state.stretch).put("f_last", pace * pace);
  for (int step = 0; step < kSteps; ++step) {
    world.step();
    EXPECT_EQ(world.snapshot({}).report.substeps, 1u);
    Result<BodySnapshot> now = world.inspect(body->def.name, false);
    played.after.push_back(now->particles);
    played.ends.push_back(pick.target);
  }
  return played;
}

// What the script says, and whether it agrees.
std::pair<std::string, bool> script(const std::string& arguments) {
  const std::string command = "OPENBLAS_NUM_THREADS=1 /usr/bin/python3 -B " + std::string(SOURCE_DIR) +
                              "/examples/substep.py " + arguments + " 2>&1";
  std::string said;
  FILE* const pipe = popen(command.c_str(), "r");
  if (!pipe) return {"cannot run " + command, false};
  for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) said += static_cast<char>(c);
  return {said, pclose(pipe) == 0};
}

TEST(SubstepScript, GoesWhereThePackageGoes) {
  const TemporaryFolder folder;
  std::string files;
  for (const Case& of : cases()) files += " " + folder.write(of.name + ".json", play(of).text());
  const auto [said, agrees] = script(files);
  EXPECT_TRUE(agrees) << said;
  std::printf("%s", said.c_str());
}

// MESHLESS_SURGERY_HELD=FILE writes it anew.
TEST(SubstepScript, RunsOnTheFileThatShips) {
  if (const char* const file = std::getenv("MESHLESS_SURGERY_HELD"))
    std::ofstream(file) << play(heldBar()).text() << '\n';
  const auto [said, agrees] = script(std::string(SOURCE_DIR) + "/examples/held.json");
  EXPECT_TRUE(agrees) << said;
}

TEST(SubstepScript, SeesWhenSomebodyElseWentThere) {
  const TemporaryFolder folder;
  Played played = play(heldBar());
  played.after[1][played.after[1].size() / 2].x() += 1e-8;  // [m] nobody goes farther than a metre
  const auto [said, agrees] = script(folder.write("moved.json", played.text()));
  EXPECT_FALSE(agrees) << said;
  EXPECT_NE(said.find("apart"), std::string::npos) << said;
}

}  // namespace substep_test
}  // namespace meshless
