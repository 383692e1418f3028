// Layout: magic (8 bytes), version of states (4), hash of the log's start (8), then records (records.h): kind (1),
// steps since the log's start (8), payload. States and scenes name the models that they need, which have records of
// their own.
#include "meshless_surgery/world/log_index.h"

#include <ctime>
#include <istream>

#include "records.h"

namespace meshless {
namespace {

constexpr double kMomentEvery = 0.1;                          // [s]
constexpr std::size_t kHead = kLogIndexMagic.size() + 4 + 8;  // bytes
constexpr std::size_t kRecordStart = 1 + 8;                   // bytes of kind and time
constexpr std::size_t kMostEntries = 10000000;                // of a kind

enum class EntryKind : std::uint8_t { kModel, kScene, kState, kMoment, kEvent, kEnd };

// Of this thread: what others do on the machine must not make the file larger.
double processorSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

Error badIndex(const std::string& why) {
  return {ErrorCode::kUnreadable, "this is no index of a log that can be read: " + why};
}

}  // namespace

template <class A>
void serialize(A& archive, LogTool& v) {
  auto& [kind, pick, position, force] = v;
  archive(choice(kind, ToolKind::kInstrument), pick, position, force);
}
template <class A>
void serialize(A& archive, Event& v) {
  // The last ones are for who hears it at once.
  auto& [type, step, sim_time, body, pick, text, cavity, removed, placed, taken_apart, instrument, force,
         command, task] = v;
  archive(choice(type, kLastEvent), step, sim_time, body, pick, text);
}

// --- writing

struct LogIndexWriter::Known {
  std::map<const BodyModel*, std::pair<std::weak_ptr<const BodyModel>, std::uint32_t>> models;
  std::uint32_t next_model = 0, next_scene = 0;
  std::vector<std::shared_ptr<const PreparedBody>> scene;
  std::vector<std::shared_ptr<const ObstacleDef>> obstacles;
};

LogIndexWriter::LogIndexWriter(const World& world, Sink sink, double state_every)
    : sink_(std::move(sink)), state_every_(state_every), known_(std::make_unique<Known>()) {
  std::string head;
  OutArchive archive(head);
  archive.put(kLogIndexMagic.data(), kLogIndexMagic.size());
  archive(kStateVersion, world.stateHash());
  sink_(std::move(head));
}

LogIndexWriter::~LogIndexWriter() = default;

void LogIndexWriter::write(std::string record) {
  bytes_ += record.size();
  sink_(std::move(record));
}

void LogIndexWriter::heard(const std::vector<Event>& events) {
  heard_.insert(heard_.end(), events.begin(), events.end());
}

void LogIndexWriter::stepped(World& world) {
  ++at_;
  const WorldSnapshot now = world.snapshot({});
  for (const Event& event : heard_) {
    write(recordOf(static_cast<std::uint8_t>(EntryKind::kEvent), at_, event));
    undone_ = undone_ || event.type == EventType::kUndone;
  }
  heard_.clear();
  since_moment_ += 1.0 / world.settings().step_rate;
  if (since_moment_ > kMomentEvery - 1e-9) {
    since_moment_ = 0.0;
    std::vector<LogTool> tools;
    for (const Pick& pick : now.picks) tools.push_back({ToolKind::kPick, pick.id, pick.position, pick.force.norm()});
    if (now.push.enabled) tools.push_back({ToolKind::kPush, 0, now.push.position, now.push.force.norm()});
    if (now.scissors.shown) tools.push_back({ToolKind::kScissors, 0, now.scissors.blades.origin, 0.0});
    for (const Instrument& one : now.instruments)
      tools.push_back({ToolKind::kInstrument, one.number, one.pose.translation, one.force.norm()});
    write(recordOf(static_cast<std::uint8_t>(EntryKind::kMoment), at_, tools));
  }
  const double clock = processorSeconds();
  since_state_ += clock - clock_.value_or(clock);
  clock_ = clock;
  const double every = state_every_ * std::pow(2.0, static_cast<double>(bytes_ / kThinAfter));
  // What a cut has taken away cannot be undone from a state that was kept between the two.
  if (since_state_ > every || undone_) keepState(world);
}

void LogIndexWriter::end() { write(recordOf(static_cast<std::uint8_t>(EntryKind::kEnd), at_)); }

void LogIndexWriter::keepState(const World& world) {
  since_state_ = 0.0;
  undone_ = false;
  Known& known = *known_;
  const SavedWorldPtr saved = world.capture();
  const auto placesOf = [&](const ModelTable& models) {
    std::vector<std::uint32_t> places;
    for (const BodyModelPtr& model : models.models()) {
      auto& [owner, place] = known.models[model.get()];
      if (owner.lock() != model) {
        owner = model;
        place = known.next_model++;
        write(recordOf(static_cast<std::uint8_t>(EntryKind::kModel), at_, *model));
      }
      places.push_back(place);
    }
    return places;
  };
  for (auto it = known.models.begin(); it != known.models.end();)
    it = it->second.first.expired() ? known.models.erase(it) : std::next(it);
  if (known.next_scene == 0 || known.scene != saved->scene || known.obstacles != saved->obstacles) {
    known.scene = saved->scene;
    known.obstacles = saved->obstacles;
    ModelTable models;
    std::string scene;
    OutArchive archive(scene);
    writeScene(archive, models, *saved);
    const std::vector<std::uint32_t> places = placesOf(models);
    ++known.next_scene;
    write(recordOf(static_cast<std::uint8_t>(EntryKind::kScene), at_, places, scene));
  }
  ModelTable models;
  std::string state;
  OutArchive archive(state);
  archive(saved->settings);
  writeBodies(archive, models, *saved);
  writeRest(archive, *saved);
  const std::vector<std::uint32_t> places = placesOf(models);
  write(recordOf(static_cast<std::uint8_t>(EntryKind::kState), at_, places, known.next_scene - 1, state));
}

// --- reading

struct LogIndex::Contents {
  struct Place {
    std::streamoff offset = 0;  // of the record
    std::uint64_t at = 0;
  };
  std::unique_ptr<std::istream> file;
  std::uint64_t start_hash = 0, end = 0;
  bool ended = false;
  std::vector<LogMoment> moments;
  std::vector<LogEvent> events;
  std::vector<Place> models, scenes, states;
  std::map<std::uint32_t, std::weak_ptr<const BodyModel>> loaded;
  SavedWorldPtr scene;  // the last one that was read
  std::uint32_t scene_number = kNoIndex;

  ReadRecord recordAt(const std::vector<Place>& places, std::size_t number) {
    if (number >= places.size()) throw ArchiveFault("it needs what is not there");
    file->clear();
    file->seekg(places[number].offset);
    ReadRecord record = readRecord(*file);
    if (record.body.empty()) throw ArchiveFault("it is no longer there");
    return record;
  }
  InArchive payloadOf(const ReadRecord& record) const {
    return InArchive(std::string_view(record.body).substr(kRecordStart));
  }

  ModelTable tableOf(const std::vector<std::uint32_t>& numbers) {
    ModelTable table;
    for (const std::uint32_t number : numbers) {
      BodyModelPtr model = loaded[number].lock();
      if (!model) {
        const ReadRecord record = recordAt(models, number);
        InArchive archive = payloadOf(record);
        ModelTable read;
        read.readOne(archive);
        loaded[number] = model = read.at(0);
      }
      table.add(model);
    }
    return table;
  }

  void needScene(std::uint32_t number) {
    if (scene && scene_number == number) return;
    const ReadRecord record = recordAt(scenes, number);
    InArchive archive = payloadOf(record);
    std::vector<std::uint32_t> numbers;
    std::string bytes;
    archive(numbers, bytes);
    auto read = std::make_shared<SavedWorld>();
    InArchive of_scene(bytes);
    readScene(of_scene, tableOf(numbers), *read);
    scene = std::move(read);
    scene_number = number;
  }

  SavedWorldPtr state(std::size_t k) {
    const ReadRecord record = recordAt(states, k);
    InArchive archive = payloadOf(record);
    std::vector<std::uint32_t> numbers;
    std::uint32_t of_scene = 0;
    std::string bytes;
    archive(numbers, of_scene, bytes);
    needScene(of_scene);
    auto world = std::make_shared<SavedWorld>();
    world->scene = scene->scene;
    world->obstacles = scene->obstacles;
    InArchive of_state(bytes);
    readSettings(of_state, *world);
    readBodies(of_state, tableOf(numbers), *world);
    readRest(of_state, *world);
    return world;
  }
};

LogIndex::LogIndex(std::unique_ptr<Contents> contents) : contents_(std::move(contents)) {}
LogIndex::LogIndex(LogIndex&&) noexcept = default;
LogIndex& LogIndex::operator=(LogIndex&&) noexcept = default;
LogIndex::~LogIndex() = default;

std::uint64_t LogIndex::startHash() const { return contents_->start_hash; }
std::uint64_t LogIndex::end() const { return contents_->end; }
bool LogIndex::ended() const { return contents_->ended; }
const std::vector<LogMoment>& LogIndex::moments() const { return contents_->moments; }
const std::vector<LogEvent>& LogIndex::events() const { return contents_->events; }

Result<LogIndex> LogIndex::read(std::unique_ptr<std::istream> file) {
  auto contents = std::make_unique<Contents>();
  try {
    const std::string head = readUpTo(*file, kHead);
    if (head.size() < kHead || std::string_view(head).substr(0, kLogIndexMagic.size()) != kLogIndexMagic)
      return badIndex("it does not begin with " + std::string(kLogIndexMagic) + ", as indices do");
    InArchive archive(std::string_view(head).substr(kLogIndexMagic.size()));
    std::uint32_t version = 0;
    archive(version, contents->start_hash);
    if (version != kStateVersion)
      return badIndex("it is of version " + std::to_string(version) + "; accepted: " + std::to_string(kStateVersion));
    std::streamoff offset = kHead;
    for (ReadRecord record = readRecord(*file);; record = readRecord(*file)) {
      if (!record.damage.empty()) return badIndex("a record of it is damaged: " + record.damage);
      if (record.body.empty()) break;
      std::uint8_t kind = 0;
      std::uint64_t at = 0;
      InArchive payload(record.body);
      payload(kind, at);
      if (at < contents->end || contents->ended) throw ArchiveFault("a record of it is not in its place");
      contents->end = at;
      switch (static_cast<EntryKind>(kind)) {
        case EntryKind::kModel:
          contents->models.push_back({offset, at});
          break;
        case EntryKind::kScene:
          contents->scenes.push_back({offset, at});
          break;
        case EntryKind::kState:
          contents->states.push_back({offset, at});
          break;
        case EntryKind::kMoment:
          contents->moments.push_back({at, {}});
          payload(contents->moments.back().tools);
          break;
        case EntryKind::kEvent:
          contents->events.push_back({at, {}});
          payload(contents->events.back().event);
          break;
        case EntryKind::kEnd:
          contents->ended = true;
          break;
        default:
          throw ArchiveFault("a record of it is of kind " + std::to_string(kind));
      }
      if (contents->moments.size() > kMostEntries || contents->events.size() > kMostEntries)
        return badIndex("it has more than " + std::to_string(kMostEntries) + " entries");
      offset += static_cast<std::streamoff>(kRecordHeader + record.body.size());
    }
  } catch (const ArchiveFault& fault) {
    return badIndex(fault.what());
  }
  contents->file = std::move(file);
  return LogIndex(std::move(contents));
}

LogIndex::Kept LogIndex::stateAt(std::uint64_t at, std::uint64_t above) {
  Contents& c = *contents_;
  for (std::size_t k = c.states.size(); k-- > 0 && c.states[k].at > above;) {
    if (c.states[k].at > at) continue;
    try {
      return {c.state(k), c.states[k].at};
    } catch (const ArchiveFault&) {  // the one before is as good
    }
  }
  return {};
}

}  // namespace meshless
