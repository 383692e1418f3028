#include "meshless_surgery/world/log_player.h"

#include <functional>
#include <istream>
#include <limits>
#include <optional>

#include "log_records.h"

namespace meshless {
namespace {

// Of simulated time between records. World::step writes a hash every second, and nodes have always done so; a step more
// is what their sums of steps have come to.
constexpr double kMostSeconds = 2.0;

using Deed = std::function<void(World&)>;

template <std::size_t kind = 0>
Deed readCommand(InArchive& archive, std::uint8_t wanted) {
  if constexpr (kind == std::variant_size_v<Command>) {
    throw ArchiveFault("a command is of kind " + std::to_string(wanted));
  } else {
    if (kind != wanted) return readCommand<kind + 1>(archive, wanted);
    std::variant_alternative_t<kind, Command> command;
    archive(command);
    return [command](World& world) { (void)world.apply(command); };  // what was refused then is refused now
  }
}

Deed readMaterials(InArchive& archive) {
  std::vector<MaterialChange> changes;
  archive(changes);
  return [changes](World& world) {
    for (const MaterialChange& change : changes) {
      SetMaterialCommand command;
      command.body = change.body;
      command.change = [&change](const Material&) -> Result<Material> { return change.material; };
      (void)world.apply(command);
    }
  };
}

Deed readScissors(InArchive& archive) {
  ScissorBlades blades;
  double angle = 0.0;
  archive(blades, angle);
  return [blades, angle](World& world) { world.setScissors(blades, angle); };
}

SavedWorldPtr readState(InArchive& archive) {
  std::string bytes;
  archive(bytes);
  auto decoded = decode(bytes);
  if (!decoded.ok()) throw ArchiveFault(decoded.error().detail);
  return decoded->world;
}

Error noLog(const std::string& why) {
  return {ErrorCode::kUnreadable, "this is no log of commands that can be read: " + why};
}

}  // namespace

struct LogPlayer::Record {
  std::uint64_t step = 0;             // the world's
  std::uint64_t at = 0;               // steps since the log's start
  Deed deed;                          // or
  std::optional<std::uint64_t> hash;  // to compare
  bool undo = false;
  bool is_said = false;  // and no command
};

LogPlayer::LogPlayer() = default;
LogPlayer::LogPlayer(LogPlayer&&) noexcept = default;
LogPlayer& LogPlayer::operator=(LogPlayer&&) noexcept = default;
LogPlayer::~LogPlayer() = default;

Result<LogPlayer> LogPlayer::open(std::istream& log) {
  const std::string head = readUpTo(log, kCommandLogMagic.size() + sizeof kLogVersion);
  if (head.size() < kCommandLogMagic.size() + sizeof kLogVersion ||
      std::string_view(head).substr(0, kCommandLogMagic.size()) != kCommandLogMagic)
    return noLog("it does not begin with " + std::string(kCommandLogMagic) + ", as logs do");
  std::uint32_t version = 0;
  std::memcpy(&version, head.data() + kCommandLogMagic.size(), sizeof version);
  if (version != kLogVersion)
    return noLog("it is of version " + std::to_string(version) + "; accepted: " + std::to_string(kLogVersion));
  LogPlayer player;
  ReplayReport& report = player.report_;
  std::uint64_t step = 0;  // of the record before
  double most = 0.0;       // steps between two records
  while (true) {
    ReadRecord record = readRecord(log);
    try {
      if (!record.body.empty()) {
        player.add(record.body, step, most);
        continue;
      }
    } catch (const ArchiveFault& fault) {
      record.damage = fault.what();
      record.lost_bytes = kRecordHeader + record.body.size() + restOf(log);
    }
    report.lost_bytes = record.lost_bytes;
    if (record.lost_bytes > 0)
      report.damage = "record " + std::to_string(player.records_.size() + (player.start_ ? 1 : 0)) + ": " +
                      (record.damage.empty() ? "it is not whole" : record.damage);
    break;
  }
  if (!player.start_) return noLog(report.damage.empty() ? "it has no start" : report.damage);
  return player;
}

void LogPlayer::add(std::string_view body, std::uint64_t& step, double& most) {
  InArchive archive(body);
  std::uint8_t number = 0;
  Record record;
  archive(number, record.step);
  if (number > static_cast<std::uint8_t>(RecordKind::kTask))
    throw ArchiveFault("it is of kind " + std::to_string(number));
  const auto kind = static_cast<RecordKind>(number);
  if ((kind == RecordKind::kStart) == (start_ != nullptr))
    throw ArchiveFault(start_ ? "it starts again" : "it is not the start");
  if (start_) {
    if (record.step < step) throw ArchiveFault("it goes back to step " + std::to_string(record.step));
    if (static_cast<double>(record.step - step) > most)
      throw ArchiveFault("it is " + std::to_string(record.step - step) +
                         " steps after the one before; accepted: up to 2 s of them, " +
                         std::to_string(static_cast<std::uint64_t>(most)));
    record.at = end_ + record.step - step;
  }
  SavedWorldPtr state;
  switch (kind) {
    case RecordKind::kStart:
    case RecordKind::kState:
      state = readState(archive);
      record.deed = [state](World& world) { world.restore(*state); };
      break;
    case RecordKind::kCommand: {
      std::uint8_t command = 0;
      archive(command);
      record.deed = readCommand(archive, command);
      record.undo = command == Command(UndoCutCommand()).index();
      break;
    }
    case RecordKind::kMaterials:
      record.deed = readMaterials(archive);
      break;
    case RecordKind::kScissors:
      record.deed = readScissors(archive);
      break;
    case RecordKind::kHideScissors:
      record.deed = &World::hideScissors;
      break;
    case RecordKind::kReset:
      record.deed = &World::reset;
      break;
    case RecordKind::kHash:
    case RecordKind::kEnd:
      archive(record.hash.emplace());
      break;
    case RecordKind::kWallTime: {
      double seconds = 0.0;
      archive(seconds);
      if (!(seconds == kNobodyWatches || (seconds >= 0.0 && seconds <= kLastSecond)))
        throw ArchiveFault("its time on the wall is " + std::to_string(seconds));
      if (seconds == kNobodyWatches) seconds = std::numeric_limits<double>::quiet_NaN();
      record.deed = [seconds](World& world) { world.setWallTime(seconds); };
      record.is_said = true;
      break;
    }
    case RecordKind::kTask: {
      TaskNote note;
      archive(note);
      record.deed = [note](World& world) { world.noteTask(note); };
      record.is_said = true;
      break;
    }
  }
  if (archive.left() > 0) throw ArchiveFault("it is too long");
  step = state ? state->step : kind == RecordKind::kReset ? 0 : record.step;
  if (state) most = kMostSeconds * state->settings.step_rate;
  report_.ended = kind == RecordKind::kEnd;
  end_ = record.at;
  if (start_) {
    records_.push_back(std::move(record));
  } else {
    start_ = std::move(state);
    step_rate_ = start_->settings.step_rate;
  }
}

void LogPlayer::begin(World& world) {
  at_ = 0;
  next_ = 0;
  world.restore(*start_);
}

void LogPlayer::resume(World& world, const SavedWorld& state, std::uint64_t at) {
  at_ = at;
  // What came before that step was done is in the state.
  next_ = static_cast<std::size_t>(
      std::lower_bound(records_.begin(), records_.end(), at,
                       [](const Record& record, std::uint64_t when) { return record.at < when; }) -
      records_.begin());
  world.restore(state);
}

bool LogPlayer::undoesNext() const {
  for (std::size_t k = next_; k < records_.size() && records_[k].at <= at_; ++k)
    if (records_[k].undo) return true;
  return false;
}

bool LogPlayer::step(World& world) {
  for (; next_ < records_.size() && records_[next_].at <= at_; ++next_) {
    const Record& record = records_[next_];
    if (record.deed) {
      record.deed(world);
      report_.commands += !record.is_said;
      continue;
    }
    ++report_.checks;
    const std::uint64_t found = world.stateHash();
    if (found != *record.hash && !report_.difference) report_.difference = {record.step, *record.hash, found};
  }
  if (at_ >= end_) return false;
  world.step();
  ++at_;
  ++report_.steps;
  return true;
}

}  // namespace meshless
