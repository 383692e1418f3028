#include "drive/drive.h"

#include <ctime>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "drive/crossing_law.h"
#include "drive/depth_law.h"
#include "drive/energy_law.h"
#include "drive/finite_law.h"
#include "drive/fold_law.h"
#include "drive/mass_law.h"
#include "drive/momentum_law.h"
#include "drive/rest_law.h"
#include "drive/volume_law.h"
#include "drive/words.h"

namespace meshless {
namespace {

constexpr double kShortest = 5.0, kLongestAlone = 20.0;  // [s] alone
constexpr double kRelaxes = 8.0;  // times of the slowest branch, for what relaxes: it creeps more slowly than that
constexpr double kDecays = 20.0;  // so many times the energy of what damps least falls to 1/e until then
constexpr int kLooksASecond = 12;

double wallSeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Of this thread: several scenes may be played side by side.
double processorSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// One scene played once.
class Run {
 public:
  Run(const DriveScene& scene, const DriveOptions& options, bool cuts, DriveReport& report)
      : options_(options),
        report_(report),
        world_(scene.def.world),
        hand_(scene.seed, cuts, [this](const Command& command) { return apply(command); }) {}

  Status setUp(const DriveScene& scene) {
    for (const BodyDef& def : scene.def.bodies) {
      double settles = std::min(kDecays / def.material.damping, kLongestAlone);
      for (const Relaxation& branch : def.material.relaxation) settles = std::max(settles, kRelaxes * branch.time);
      alone_for_ = std::max(alone_for_, settles);
      Result<PreparedBody> body = prepareBody(def);
      if (!body) return body.error();
      const auto added = world_.addSceneBody(std::make_shared<const PreparedBody>(std::move(*body)));
      if (!added) return added.error();
      report_.triangles += added->triangles;
      report_.particles += added->particles;
    }
    for (const ObstacleDef& def : scene.def.obstacles)
      if (Status added = world_.addObstacle(def); !added) return added.error();
    for (const AttachCommand& attachment : scene.def.attachments)
      if (const auto added = world_.addSceneAttachment(attachment); !added) return added.error();
    report_.bodies = world_.bodyCount();
    if (options_.record) world_.record([this](std::string bytes) { report_.log += bytes; });
    start_ = booksOf(see(world_, false));
    return Done{};
  }

  void play() {
    began_ = processorSeconds();
    while (options_.hands && withinBudget() && hand_.act(world_)) step(false);
    report_.hand = hand_.counts();
    const double alone_from = world_.simTime();
    while (withinBudget() && world_.simTime() < alone_from + alone_for_ - 1e-9) step(true);
    report_.finished = withinBudget();
    report_.simulated = world_.simTime();
    report_.pieces = world_.bodyCount();
    const Seen end = see(world_, true);
    look(end);
    if (report_.finished) {
      note(Law::kRest, end.time, restLaw(end));
      if (world_.settings().sleep) note(Law::kAsleep, end.time, asleepLaw(end));
    }
    note(Law::kEnergy, end.time, energyLaw(alone_, world_.settings().gravity.norm()));
    report_.hash = world_.stateHash();
    if (!options_.record) return;
    world_.record(nullptr);
    if (!report_.state) keepState();
  }

  const std::vector<PieceVolume>& volumes() const { return volumes_; }

 private:
  bool withinBudget() const { return processorSeconds() - began_ <= options_.budget; }

  void step(bool alone_now) {
    const double wall = wallSeconds(), processor = processorSeconds();
    world_.step();
    const double took = processorSeconds() - processor;
    report_.wall += wallSeconds() - wall;
    report_.processor += took;
    report_.worst_step = std::max(report_.worst_step, took);
    const double rate = world_.settings().step_rate;
    const std::uint64_t stride = static_cast<std::uint64_t>(std::max(1.0, std::round(rate / kLooksASecond)));
    const std::uint64_t second = static_cast<std::uint64_t>(std::round(rate));
    if (world_.stepCount() % stride == 0) glance(alone_now, static_cast<double>(stride) / rate);
    if (world_.stepCount() % second == 0) look(see(world_, true));
    (void)world_.takeEvents();
  }

  /// At masses, momenta and energies.
  void glance(bool alone_now, double interval) {
    const bool may_fall = falling_ || world_.stepCount() * interval < 2.0;
    Seen seen = see(world_, may_fall);  // surfaces say how far below the ground is
    if (seen.mended > 0) note(Law::kFinite, seen.time, finiteLaw(seen));
    note(Law::kMass, seen.time, massLaw(start_, seen));
    if (falling_) note(Law::kMomentum, seen.time, freeFallLaw(*falling_, seen));
    falling_.reset();
    if (alone_now) alone_.push_back(alone(seen));
    if (may_fall && fallsFreely(seen, interval)) falling_ = std::move(seen);
  }

  void look(const Seen& seen) {
    note(Law::kFinite, seen.time, finiteLaw(seen));
    if (report_.findings[static_cast<std::size_t>(Law::kFinite)].broken()) return;  // the others would say so again
    note(Law::kMass, seen.time, massLaw(start_, seen));
    for (PieceVolume& piece : volumesOf(seen)) {
      if (piece.elastic) note(Law::kVolume, volumeLaw({piece}, {}));
      volumes_.push_back(std::move(piece));
    }
    note(Law::kDepth, seen.time, depthLaw(seen));
    note(Law::kCrossings, seen.time, crossingLaw(seen));
    note(Law::kFolds, seen.time, foldLaw(seen));
  }

  Result<Reply> apply(const Command& command) {
    const auto* cut = std::get_if<CutCommand>(&command);
    const bool at_once = (cut && cut->close_time == 0.0) || std::holds_alternative<InciseCommand>(command);
    if (!at_once) {
      if (std::holds_alternative<UndoCutCommand>(command)) falling_.reset();
      if (std::holds_alternative<PickCommand>(command) || std::holds_alternative<PushCommand>(command))
        falling_.reset();
      return world_.apply(command);
    }
    const Seen before = see(world_, false);
    Result<Reply> reply = world_.apply(command);
    const Seen after = see(world_, false);
    note(Law::kMomentum, after.time, cutMomentumLaw(before, after));
    note(Law::kMass, after.time, massLaw(start_, after));
    return reply;
  }

  void note(Law law, double time, const Finding& finding) {
    note(law, {finding.score, words(time, " s: ", finding.text)});
  }
  void note(Law law, const Finding& finding) {
    const bool first = finding.broken() && report_.broken() == 0;
    report_.findings[static_cast<std::size_t>(law)].take(finding);
    if (first && options_.record) keepState();
  }

  void keepState() {
    report_.state = world_.capture();
    report_.state_time = world_.simTime();
  }

  const DriveOptions& options_;
  DriveReport& report_;
  World world_;
  Hand hand_;
  double began_ = 0.0;
  MassBooks start_;
  std::vector<PieceVolume> volumes_;
  std::optional<Seen> falling_;  // since then, freely
  std::vector<AloneLook> alone_;
  double alone_for_ = kShortest;  // [s]
};

std::vector<PieceVolume> ofAppearance(std::vector<PieceVolume> pieces) {
  pieces.erase(std::remove_if(pieces.begin(), pieces.end(), [](const PieceVolume& piece) { return piece.elastic; }),
               pieces.end());
  return pieces;
}

}  // namespace

std::size_t DriveReport::broken() const {
  return static_cast<std::size_t>(
      std::count_if(findings.begin(), findings.end(), [](const Finding& f) { return f.broken(); }));
}

double DriveReport::badness() const {
  double sum = finished ? 0.0 : 1000.0;
  if (!refused.empty()) sum += 1000.0;
  for (const Finding& f : findings)
    if (f.broken()) sum += 100.0 + std::min(9.0, std::log10(std::min(1e9, std::max(1.0, f.score))));
  return sum;
}

DriveReport drive(const DriveScene& scene, const DriveOptions& options) {
  DriveReport report;
  report.seed = scene.seed;
  report.support = scene.support;
  bool any_appearance = false, any_elastic = false;
  for (const std::string& organ : scene.organs) report.organs += (report.organs.empty() ? "" : " + ") + organ;
  for (const BodyDef& body : scene.def.bodies) {
    report.materials += (report.materials.empty() ? "" : " + ") + body.material.name;
    (body.material.elastic() ? any_elastic : any_appearance) = true;
  }
  report.family = any_elastic && any_appearance ? "mixed" : any_elastic ? "elastic" : "looks";

  Run run(scene, options, options.cuts, report);
  if (Status status = run.setUp(scene); !status) {
    report.refused = status.error().detail;
    return report;
  }
  run.play();
  const std::vector<PieceVolume> appearance = ofAppearance(run.volumes());
  if (!report.finished || !options.cuts || !volumeLaw(appearance, {}).broken()) return report;

  // Appearance materials may do what they do uncut.
  DriveReport uncut;
  DriveOptions without = options;
  without.record = false;
  Run other(scene, without, false, uncut);
  VolumeBands bands;
  if (other.setUp(scene)) {
    other.play();
    widenBands(ofAppearance(other.volumes()), bands);
  }
  report.findings[static_cast<std::size_t>(Law::kVolume)].take(volumeLaw(appearance, bands));
  return report;
}

}  // namespace meshless
