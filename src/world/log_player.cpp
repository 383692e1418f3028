#include "meshless_surgery/world/log_player.h"

#include <istream>

#include "log_records.h"

namespace meshless {
namespace {

// Of simulated time between records. World::step writes a hash every second, and nodes have always done so; a step more
// is what their sums of steps have come to.
constexpr double kMostSeconds = 2.0;

template <std::size_t kind = 0>
Command readCommand(InArchive& archive, std::uint8_t wanted) {
  if constexpr (kind == std::variant_size_v<Command>) {
    throw ArchiveFault("a command is of kind " + std::to_string(wanted));
  } else {
    if (kind != wanted) return readCommand<kind + 1>(archive, wanted);
    std::variant_alternative_t<kind, Command> command;
    archive(command);
    return command;
  }
}

Error damaged(const std::string& why) {
  return {ErrorCode::kUnreadable, "this is no log of commands that can be read: " + why};
}

Error damaged(std::uint64_t number, const std::string& why) {
  return damaged("record " + std::to_string(number) + " " + why);
}

}  // namespace

struct LogPlayer::Record {
  RecordKind kind = RecordKind::kEnd;
  std::uint64_t number = 0;  // in the file
  std::uint64_t step = 0;    // the world's
  std::uint64_t at = 0;      // steps since the log's start
  bool undo = false;
  std::string payload;
  SavedWorldPtr state;  // instead of the payload
};

LogPlayer::LogPlayer() = default;
LogPlayer::LogPlayer(LogPlayer&&) noexcept = default;
LogPlayer& LogPlayer::operator=(LogPlayer&&) noexcept = default;
LogPlayer::~LogPlayer() = default;

Result<LogPlayer> LogPlayer::open(std::istream& log) {
  const std::string head = readUpTo(log, kCommandLogMagic.size() + sizeof kLogVersion);
  if (head.size() < kCommandLogMagic.size() + sizeof kLogVersion ||
      std::string_view(head).substr(0, kCommandLogMagic.size()) != kCommandLogMagic)
    return damaged("it does not begin with " + std::string(kCommandLogMagic) + ", as logs do");
  std::uint32_t version = 0;
  std::memcpy(&version, head.data() + kCommandLogMagic.size(), sizeof version);
  if (version != kLogVersion)
    return damaged("it is of version " + std::to_string(version) + "; accepted: " + std::to_string(kLogVersion));
  LogPlayer player;
  std::uint64_t step = 0, at = 0;
  double most = 0.0;  // steps between two records
  for (std::uint64_t number = 0;; ++number) {
    try {
      ReadRecord read = readRecord(log);
      if (!read.there) {
        player.report_.lost_bytes = read.lost_bytes;
        break;
      }
      InArchive archive(read.body);
      std::uint8_t kind = 0;
      Record record;
      archive(kind, record.step);
      if (kind > static_cast<std::uint8_t>(RecordKind::kEnd))
        return damaged(number, "is of kind " + std::to_string(kind));
      record.kind = static_cast<RecordKind>(kind);
      record.number = number;
      if ((record.kind == RecordKind::kStart) == (number > 0))
        return damaged(number, number > 0 ? "starts again" : "is not the start");
      if (number > 0) {
        if (record.step < step) return damaged(number, "goes back to step " + std::to_string(record.step));
        if (static_cast<double>(record.step - step) > most)
          return damaged(number, "is " + std::to_string(record.step - step) +
                                     " steps after the one before; accepted: up to 2 s of them, " +
                                     std::to_string(static_cast<std::uint64_t>(most)));
        at += record.step - step;
        step = record.step;
      }
      record.at = at;
      if (record.kind == RecordKind::kStart || record.kind == RecordKind::kState) {
        std::string bytes;
        archive(bytes);
        if (archive.left() > 0) return damaged(number, "is too long");
        auto decoded = decode(bytes);
        if (!decoded.ok()) return decoded.error();
        record.state = std::move(decoded->world);
        step = record.state->step;
        most = kMostSeconds * record.state->settings.step_rate;
        if (record.kind == RecordKind::kStart) player.step_rate_ = record.state->settings.step_rate;
      } else {
        record.payload = read.body.substr(read.body.size() - archive.left());
        record.undo = record.kind == RecordKind::kCommand && !record.payload.empty() &&
                      static_cast<std::uint8_t>(record.payload[0]) == Command(UndoCutCommand()).index();
      }
      if (record.kind == RecordKind::kReset) step = 0;
      player.records_.push_back(std::move(record));
    } catch (const ArchiveFault& fault) {
      return damaged("record " + std::to_string(number) + ": " + fault.what());
    }
  }
  if (player.records_.empty()) return damaged("it has no start");
  player.end_ = at;
  return player;
}

void LogPlayer::begin(World& world) {
  at_ = 0;
  next_ = 1;
  world.restore(*records_.front().state);
}

void LogPlayer::resume(World& world, const SavedWorld& state, std::uint64_t at) {
  at_ = at;
  // What came before that step was done is in the state.
  next_ = static_cast<std::size_t>(
      std::lower_bound(records_.begin() + 1, records_.end(), at,
                       [](const Record& record, std::uint64_t when) { return record.at < when; }) -
      records_.begin());
  world.restore(state);
}

bool LogPlayer::undoesNext() const {
  for (std::size_t k = next_; k < records_.size() && records_[k].at <= at_; ++k)
    if (records_[k].undo) return true;
  return false;
}

Result<bool> LogPlayer::step(World& world) {
  for (; next_ < records_.size() && records_[next_].at <= at_; ++next_) {
    const Record& record = records_[next_];
    try {
      if (const Status done = apply(world, record); !done.ok()) return done.error();
    } catch (const ArchiveFault& fault) {
      return damaged(record.number, std::string("cannot be read: ") + fault.what());
    }
  }
  if (at_ >= end_) return false;
  world.step();
  ++at_;
  ++report_.steps;
  return true;
}

Status LogPlayer::apply(World& world, const Record& record) {
  InArchive archive(record.payload);
  switch (record.kind) {
    case RecordKind::kStart:
      break;
    case RecordKind::kState:
      world.restore(*record.state);
      ++report_.commands;
      break;
    case RecordKind::kCommand: {
      std::uint8_t command = 0;
      archive(command);
      (void)world.apply(readCommand(archive, command));  // what was refused then is refused now
      ++report_.commands;
      break;
    }
    case RecordKind::kMaterials: {
      std::vector<MaterialChange> changes;
      archive(changes);
      for (const MaterialChange& change : changes) {
        SetMaterialCommand command;
        command.body = change.body;
        command.change = [&change](const Material&) -> Result<Material> { return change.material; };
        (void)world.apply(command);
      }
      ++report_.commands;
      break;
    }
    case RecordKind::kScissors: {
      ScissorBlades blades;
      double angle = 0.0;
      archive(blades, angle);
      world.setScissors(blades, angle);
      ++report_.commands;
      break;
    }
    case RecordKind::kHideScissors:
      world.hideScissors();
      ++report_.commands;
      break;
    case RecordKind::kReset:
      world.reset();
      ++report_.commands;
      break;
    case RecordKind::kHash:
    case RecordKind::kEnd: {
      std::uint64_t recorded = 0;
      archive(recorded);
      ++report_.checks;
      const std::uint64_t found = world.stateHash();
      if (found != recorded && !report_.difference) report_.difference = {record.step, recorded, found};
      report_.ended = record.kind == RecordKind::kEnd;
      break;
    }
  }
  if (archive.left() > 0) return damaged(record.number, "is too long");
  return Done{};
}

}  // namespace meshless
