// Layout of a log: magic (8 bytes), version (4), then records: length (4), checksum (4), and what they are about: kind
// (1), step (8), payload.
#include "meshless_surgery/world/command_log.h"

#include <istream>

#include "saved_world_impl.h"

namespace meshless {
namespace {

constexpr std::uint32_t kLogVersion = 4;  // of the hashes in it, too
constexpr std::size_t kRecordHeader = 8, kReadAtOnce = 1 << 20;
// Of simulated time between records. World::step writes a hash every second, and nodes have always done so; a step more
// is what their sums of steps have come to.
constexpr double kMostSeconds = 2.0;
constexpr std::uint32_t kMostRecord = 0x7fffffffu;

enum class RecordKind : std::uint8_t {
  kStart,
  kCommand,
  kMaterials,
  kScissors,
  kHideScissors,
  kReset,
  kState,
  kHash,
  kEnd
};

}  // namespace

// Commands as they are logged; those of materials and bodies have their own way.
template <class A>
void serialize(A& archive, PickCommand& v) {
  auto& [point, direction, body, max_distance, stiffness] = v;
  archive(point, direction, body, max_distance, stiffness);
}
template <class A>
void serialize(A& archive, MovePickCommand& v) {
  auto& [pick, target] = v;
  archive(pick, target);
}
template <class A>
void serialize(A& archive, LockCommand& v) {
  auto& [pick, target] = v;
  archive(pick, target);
}
template <class A>
void serialize(A& archive, ReleaseCommand& v) {
  auto& [pick] = v;
  archive(pick);
}
template <class A>
void serialize(A&, ClearPicksCommand&) {}
template <class A>
void serialize(A&, OpenScissorsCommand&) {}
template <class A>
void serialize(A&, UndoCutCommand&) {}
template <class A>
void serialize(A& archive, OpenBladesCommand& v) {
  auto& [ticket] = v;
  archive(ticket);
}
template <class A>
void serialize(A& archive, PushCommand& v) {
  auto& [enable, radius, position, speed, streamed] = v;
  archive(enable, radius, position, speed, streamed);
}
template <class A>
void serialize(A& archive, InciseCommand& v) {
  auto& [blade, bodies] = v;
  archive(blade, bodies);
}
template <class A>
void serialize(A& archive, LiftCommand& v) {
  auto& [tool, streamed_only, why] = v;
  archive(choice(tool, ToolKind::kScissors), streamed_only, why);
}
template <class A>
void serialize(A& archive, RemoveCommand& v) {
  auto& [body] = v;
  archive(body);
}
void save(OutArchive& archive, const SpawnCommand& v) {
  archive(*v.body->model);
  savePrepared(archive, *v.body, 0);
}
void load(InArchive& archive, SpawnCommand& v) {
  ModelTable models;
  models.readOne(archive);
  v.body = loadPrepared(archive, models);
}
// Materials are logged as they came out, see record().
void save(OutArchive&, const SetMaterialCommand&) { assert(false); }
void load(InArchive&, SetMaterialCommand&) { throw ArchiveFault("a material's change is no command of a log"); }
template <class A>
void serialize(A& archive, MaterialChange& v) {
  archive(v.body, v.material);
}

namespace {

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

/// Up to `count` bytes, as many as there are; memory is taken as they come.
std::string readUpTo(std::istream& log, std::size_t count) {
  std::string bytes;
  while (bytes.size() < count && log) {
    const std::size_t have = bytes.size(), want = std::min(kReadAtOnce, count - have);
    bytes.resize(have + want);
    log.read(bytes.data() + have, static_cast<std::streamsize>(want));
    bytes.resize(have + static_cast<std::size_t>(log.gcount()));
  }
  return bytes;
}

}  // namespace

// --- writing

namespace {

template <class... Parts>
void emit(const World::RecordSink& sink, RecordKind kind, std::uint64_t step, const Parts&... parts) {
  std::string record(kRecordHeader, '\0');
  OutArchive archive(record);
  archive(static_cast<std::uint8_t>(kind), step);
  if constexpr (sizeof...(parts) > 0) archive(parts...);
  const std::string_view body = std::string_view(record).substr(kRecordHeader);
  std::string header;
  OutArchive head(header);
  head(static_cast<std::uint32_t>(body.size()), checksum(body));
  record.replace(0, kRecordHeader, header);
  sink(std::move(record));
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

// --- reading

Result<ReplayReport> replay(std::istream& log, int threads, const std::function<void(World& world)>& after_step) {
  if (!(threads >= 1 && threads <= 64)) return outOfRange("threads", threads, "1 to 64");
  ReplayReport report;
  WorldSettings settings;
  settings.threads = threads;
  World world(settings);
  const std::string head = readUpTo(log, kCommandLogMagic.size() + sizeof kLogVersion);
  if (head.size() < kCommandLogMagic.size() + sizeof kLogVersion ||
      std::string_view(head).substr(0, kCommandLogMagic.size()) != kCommandLogMagic)
    return damaged("it does not begin with " + std::string(kCommandLogMagic) + ", as logs do");
  std::uint32_t version = 0;
  std::memcpy(&version, head.data() + kCommandLogMagic.size(), sizeof version);
  if (version != kLogVersion)
    return damaged("it is of version " + std::to_string(version) + "; accepted: " + std::to_string(kLogVersion));
  bool started = false;
  for (std::uint64_t number = 0;; ++number) {
    const std::string header = readUpTo(log, kRecordHeader);
    if (header.empty()) break;
    std::uint32_t length = 0, sum = 0;
    if (header.size() == kRecordHeader) {
      std::memcpy(&length, header.data(), sizeof length);
      std::memcpy(&sum, header.data() + sizeof length, sizeof sum);
      if (length > kMostRecord)
        return damaged("record " + std::to_string(number) + " claims " + std::to_string(length) + " bytes");
    }
    const std::string body = header.size() == kRecordHeader ? readUpTo(log, length) : std::string();
    if (header.size() < kRecordHeader || body.size() < length) {
      report.lost_bytes = header.size() + body.size();
      break;
    }
    if (checksum(body) != sum) return damaged("record " + std::to_string(number) + " has a wrong checksum");
    try {
      InArchive archive(body);
      std::uint8_t kind = 0;
      std::uint64_t step = 0;
      archive(kind, step);
      if ((kind == static_cast<std::uint8_t>(RecordKind::kStart)) == started)
        return damaged("record " + std::to_string(number) + (started ? " starts again" : " is not the start"));
      if (started && step < world.stepCount())
        return damaged("record " + std::to_string(number) + " goes back to step " + std::to_string(step));
      const double most = kMostSeconds * world.settings().step_rate;
      if (started && static_cast<double>(step - world.stepCount()) > most)
        return damaged("record " + std::to_string(number) + " is " + std::to_string(step - world.stepCount()) +
                       " steps after the one before; accepted: up to 2 s of them, " +
                       std::to_string(static_cast<std::uint64_t>(most)));
      for (; started && world.stepCount() < step; ++report.steps) {
        world.step();
        if (after_step) after_step(world);
        (void)world.takeEvents();
      }
      switch (static_cast<RecordKind>(kind)) {
        case RecordKind::kStart:
        case RecordKind::kState: {
          std::string bytes;
          archive(bytes);
          const auto decoded = decode(bytes);
          if (!decoded) return decoded.error();
          world.restore(*decoded->world);
          report.commands += started;
          started = true;
          break;
        }
        case RecordKind::kCommand: {
          std::uint8_t command = 0;
          archive(command);
          (void)world.apply(readCommand(archive, command));  // what was refused then is refused now
          ++report.commands;
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
          ++report.commands;
          break;
        }
        case RecordKind::kScissors: {
          ScissorBlades blades;
          double angle = 0.0;
          archive(blades, angle);
          world.setScissors(blades, angle);
          ++report.commands;
          break;
        }
        case RecordKind::kHideScissors:
          world.hideScissors();
          ++report.commands;
          break;
        case RecordKind::kReset:
          world.reset();
          ++report.commands;
          break;
        case RecordKind::kHash:
        case RecordKind::kEnd: {
          std::uint64_t recorded = 0;
          archive(recorded);
          ++report.checks;
          const std::uint64_t found = world.stateHash();
          if (found != recorded && !report.difference) report.difference = {step, recorded, found};
          report.ended = static_cast<RecordKind>(kind) == RecordKind::kEnd;
          break;
        }
        default:
          return damaged("record " + std::to_string(number) + " is of kind " + std::to_string(kind));
      }
      if (archive.left() > 0) return damaged("record " + std::to_string(number) + " is too long");
    } catch (const ArchiveFault& fault) {
      return damaged("record " + std::to_string(number) + ": " + fault.what());
    }
    if (!after_step) (void)world.takeEvents();
  }
  if (!started) return damaged("it has no start");
  report.last_step = world.stepCount();
  report.hash = world.stateHash();
  return report;
}

}  // namespace meshless
