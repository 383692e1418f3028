// The only place where time moves.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <sstream>
#include <utility>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/tools/grasp.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kCollapsed = 0.2;     // of its volume at rest: a body that has less is said to have collapsed
constexpr double kCollapseTime = 0.1;  // [s] between two looks at one

class Stopwatch {
 public:
  explicit Stopwatch(double& seconds) : seconds_(seconds), start_(std::chrono::steady_clock::now()) {}
  ~Stopwatch() { seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  double& seconds_;
  std::chrono::steady_clock::time_point start_;
};

}  // namespace

void World::step() {
  impl_->takeStep();
  // So that a replay never goes far without a record (command_log.cpp).
  const auto second = static_cast<std::uint64_t>(std::ceil(impl_->settings.step_rate));
  if (impl_->step % second == 0) recordHash();
}

void World::Impl::takeStep() {
  report = StepReport();
  const Stopwatch total(report.total);
  const double h_frame = 1.0 / settings.step_rate;
  closeBlades();
  cutByInstruments();
  wakePushed(h_frame);
  leadInstruments(h_frame);
  closeClips(h_frame);
  listFibres();
  wakeAttached();
  listAwake();
  leadClamps(h_frame);
  listForces();
  groupBatches();
  clearForces();
  int parts = 1;
  const bool touches = !awake.empty() || anyInstrumentGoes();
  if (touches) {
    const Stopwatch contact(report.contact);
    findNear(h_frame);
    parts = searchesOf(h_frame);
  }
  const double h = h_frame / parts;
  for (int part = 0; part < parts; ++part) {
    if (touches) {
      {
        const Stopwatch contact(report.contact);
        if (parts > 1) findNear(h, parts - part);
        findSurfaceContacts(h, parts - part);
      }
      stepSurfaces(h, parts, parts - part);
    }
    stepFreeInstruments(h, parts, parts - part);
    if (push.enabled) push.position += pushWay(h);
    // A target that jumps is followed evenly over the frame.
    for (Pick& pick : picks) pick.reached += (pick.target - pick.reached) / (parts - part);
  }
  report.substeps = std::max(report.substeps, static_cast<std::size_t>(settings.substeps));
  finishStep(h_frame);
}

void World::Impl::clearForces() {
  for (Pick& pick : picks)
    if (const WorldBody* body = find(pick.body); !body || !body->asleep)  // a body at rest is held as before
      pick.force.setZero();
  bool pressed = false, moved = false;  // what sleeps under the sphere is pressed as before
  for (const auto& body : bodies) {
    if (!body->touched_by_push) continue;
    pressed = true;
    moved = moved || !body->asleep;
  }
  if (pressed && !moved) return;
  push.force.setZero();
  push.touching = false;
}

void World::Impl::finishStep(double h_frame) {
  mendFaults();
  tearFibres();
  emptyCavities();
  findCollapsed();
  for (Pick& pick : picks)
    if (const WorldBody* body = find(pick.body)) pick.position = graspMean(pick, body->state.positions);
  finishInstruments(h_frame);
  fallAsleep(h_frame);
  endForces(h_frame);
  contacts_current = !awake.empty() || contacts_current;
  ++step;
  report.bodies = bodies.size();
  for (const auto& body : bodies) report.asleep += body->asleep;
  report.tetrahedralizations = tetrahedralizations;
}

// Each body in its turn: a volume takes the whole surface.
void World::Impl::findCollapsed() {
  const auto turns = static_cast<std::uint64_t>(std::max(1.0, kCollapseTime * settings.step_rate));
  for (WorldBody* body : awake) {
    if (!body->model->solid || (step + body->number) % turns != 0) continue;
    refreshSurface(*body);
    const double volume = signedVolume(body->state.surface, body->model->surface.triangles);
    const bool said = std::exchange(body->collapsed, volume < kCollapsed * body->model->rest_volume);
    if (!body->collapsed || said) continue;
    std::ostringstream text;
    text << body->name << " has " << std::max(0.0, volume / body->model->rest_volume) << " of its volume at rest";
    say(EventType::kCollapsed, body->name, 0, text.str());
  }
}

// What was opened and has no pressure left is filled no more.
void World::Impl::emptyCavities() {
  for (WorldBody* body : awake) {
    std::vector<FilledCavity>& cavities = body->state.cavities;
    if (cavities.empty()) continue;
    const auto gone = std::remove_if(cavities.begin(), cavities.end(),
                                     [](const FilledCavity& cavity) { return cavity.open_for >= cavity.leak; });
    for (auto cavity = gone; cavity != cavities.end(); ++cavity)
      say(EventType::kLeak, body->name, 0, "a cavity of " + body->name + " has leaked out");
    cavities.erase(gone, cavities.end());
  }
}

void World::Impl::matchAlone(WorldBody& body, double h, MatchCounters& counters, const ForEach& each) const {
  matchAndMove(*body.model, body.material, settings.gravity, h, body.state, body.scratch, counters, each);
}

// As many as the stiffest body needs.
double World::Impl::substepNow() const {
  const double h_frame = 1.0 / settings.step_rate;
  double needed = settings.substeps;
  for (const auto& body : bodies)  // not `awake`: a cut asks between steps
    if (!body->asleep) needed = std::max(needed, substepsNeeded(*body->model, body->state, h_frame));
  const int most = std::max(settings.substeps, settings.max_substeps);
  return h_frame / (needed < most ? needed : most);  // NaN: most
}

bool World::Impl::isHeld(const WorldBody& body) const {
  return std::any_of(picks.begin(), picks.end(), [&](const Pick& pick) { return pick.body == body.id; });
}

// Whom the sphere meets on its way in this frame.
void World::Impl::wakePushed(double h_frame) {
  if (!push.enabled || push.position == push.target) return;
  Box way;
  way.extend(push.position);
  const Vec3 to = push.target - push.position;
  const double length = std::min(to.norm(), push.speed * h_frame);
  way.extend(push.position + length * to.normalized());
  way.min.array() -= push.radius;
  way.max.array() += push.radius;
  wakeWithin(way);
}

}  // namespace meshless
