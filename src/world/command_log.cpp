#include "meshless_surgery/world/command_log.h"

#include <cmath>
#include <istream>

#include "log_records.h"
#include "meshless_surgery/world/log_player.h"

namespace meshless {
namespace {

template <class... Parts>
void emit(const World::RecordSink& sink, RecordKind kind, std::uint64_t step, const Parts&... parts) {
  sink(recordOf(static_cast<std::uint8_t>(kind), step, parts...));
}

}  // namespace

void World::record(RecordSink sink) {
  Impl& w = *impl_;
  if (w.record_sink) emit(w.record_sink, RecordKind::kEnd, w.step, stateHash());
  w.record_sink = std::move(sink);
  if (!w.record_sink) return;
  std::string head;
  OutArchive archive(head);
  archive.put(kCommandLogMagic.data(), kCommandLogMagic.size());
  archive(kLogVersion);
  w.record_sink(std::move(head));
  emit(w.record_sink, RecordKind::kStart, w.step, encode(*capture()));
}

void World::recordHash() const {
  if (impl_->record_sink) emit(impl_->record_sink, RecordKind::kHash, impl_->step, stateHash());
}

void World::setWallTime(double seconds) {
  impl_->wall_time = seconds;
  // Archives hold finite numbers alone.
  if (impl_->record_sink)
    emit(impl_->record_sink, RecordKind::kWallTime, impl_->step, std::isnan(seconds) ? kNobodyWatches : seconds);
}

void World::noteTask(TaskNote note) {
  if (impl_->record_sink) emit(impl_->record_sink, RecordKind::kTask, impl_->step, note);
  impl_->say(EventType::kTask, "", 0,
             "the task " + note.task + (note.begins ? " begins" : " was stopped") +
                 (note.trainee.empty() ? "" : ", of " + note.trainee));
  impl_->events.back().task = std::make_shared<const TaskNote>(std::move(note));
}

void World::Impl::record(const Command& command) const {
  if (!record_sink) return;
  if (const auto* change = std::get_if<SetMaterialCommand>(&command)) {
    const Result<std::vector<MaterialChange>> changes = changesOf(*change);
    if (changes) emit(record_sink, RecordKind::kMaterials, step, *changes);
    return;
  }
  std::visit(
      [&](const auto& c) {
        emit(record_sink, RecordKind::kCommand, step, static_cast<std::uint8_t>(command.index()), c);
      },
      command);
}

void World::Impl::recordScissors() const {
  if (!record_sink) return;
  if (scissors.shown)
    emit(record_sink, RecordKind::kScissors, step, scissors.blades, scissors.angle);
  else
    emit(record_sink, RecordKind::kHideScissors, step);
}

void World::Impl::recordReset() const {
  if (record_sink) emit(record_sink, RecordKind::kReset, step);
}

void World::Impl::recordState(const SavedWorld& saved) const {
  if (record_sink) emit(record_sink, RecordKind::kState, step, encode(saved));
}

std::string ReplayReport::whatIsLost() const {
  if (damage.empty()) return ended ? "" : "the log breaks off: the node was killed, or its disk was full";
  return "the log breaks off at " + damage + "; what comes before is whole, " + std::to_string(lost_bytes) +
         " bytes are lost";
}

Result<ReplayReport> replay(std::istream& log, int threads, const std::function<void(World& world)>& after_step) {
  if (!(threads >= 1 && threads <= 64)) return outOfRange("threads", threads, "1 to 64");
  auto player = LogPlayer::open(log);
  if (!player.ok()) return player.error();
  WorldSettings settings;
  settings.threads = threads;
  World world(settings);
  player->begin(world);
  while (player->step(world)) {
    if (after_step) after_step(world);
    (void)world.takeEvents();
  }
  ReplayReport report = player->report();
  report.last_step = world.stepCount();
  report.hash = world.stateHash();
  return report;
}

}  // namespace meshless
