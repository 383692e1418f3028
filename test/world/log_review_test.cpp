#include "meshless_surgery/world/log_review.h"

#include <sstream>

#include "recorded_session.h"
#include "support/random.h"

namespace meshless {
namespace log_review_test {

using command_log_test::session;

LogPlayer playerOf(const std::string& log) {
  std::istringstream stream(log);
  auto player = LogPlayer::open(stream);
  EXPECT_TRUE(player.ok()) << player.error().detail;
  return std::move(*player);
}

/// As the running node writes it, with a state after each `state_every` seconds of work.
std::string indexOf(const std::string& log, double state_every) {
  LogPlayer player = playerOf(log);
  World world{WorldSettings()};
  player.begin(world);
  std::string bytes;
  LogIndexWriter writer(
      world, [&](std::string piece) { bytes += piece; }, state_every);
  while (player.step(world)) {
    writer.heard(world.takeEvents());
    writer.stepped(world);
  }
  writer.end();
  return bytes;
}

Result<LogIndex> read(const std::string& bytes) { return LogIndex::read(std::make_unique<std::istringstream>(bytes)); }

/// The hash after each number of steps, as they come.
std::vector<std::uint64_t> hashesOf(const std::string& log) {
  LogPlayer player = playerOf(log);
  World world{WorldSettings()};
  player.begin(world);
  std::vector<std::uint64_t> hashes{world.stateHash()};
  while (player.step(world)) hashes.push_back(world.stateHash());
  return hashes;
}

constexpr double kEachStep = 1e-12, kNever = 1e9;

void expectEveryMoment(const std::string& log, const std::string& index, unsigned seed) {
  const std::vector<std::uint64_t> hashes = hashesOf(log);
  auto opened = read(index);
  ASSERT_TRUE(opened.ok()) << opened.error().detail;
  LogReview review(playerOf(log), std::move(*opened));
  World world{WorldSettings()};
  review.begin(world);
  EXPECT_EQ(review.index().startHash(), world.stateHash());
  test::Random random(seed);
  for (int k = 0; k < 60; ++k) {
    const auto at = static_cast<std::uint64_t>(random.integer(0, static_cast<int>(hashes.size()) - 1));
    const auto found = review.seek(world, at);
    ASSERT_TRUE(found.ok()) << found.error().detail;
    ASSERT_EQ(at, review.player().at());
    ASSERT_EQ(hashes[at], world.stateHash()) << at;
    for (std::uint64_t next = at + 1; next < std::min<std::uint64_t>(at + 4, hashes.size()); ++next) {
      ASSERT_TRUE(review.step(world));
      ASSERT_EQ(hashes[next], world.stateHash()) << next << " on from " << at;
    }
  }
  ASSERT_TRUE(review.seek(world, review.player().end()).ok());
  EXPECT_FALSE(review.step(world));
}

TEST(LogReview, FindsEveryMomentAsItWas) {
  const auto s = session();
  expectEveryMoment(s.log, indexOf(s.log, kEachStep), 1);
  expectEveryMoment(s.log, indexOf(s.log, 2e-3), 2);
  expectEveryMoment(s.log, indexOf(s.log, kNever), 3);  // states after what was undone alone
}

TEST(LogReview, ComputesNoMoreThanSinceTheStateThatWasKept) {
  const auto s = session();
  auto index = read(indexOf(s.log, kEachStep));
  ASSERT_TRUE(index.ok());
  LogReview review(playerOf(s.log), std::move(*index));
  World world{WorldSettings()};
  review.begin(world);
  for (const std::uint64_t at : {100, 20, 60, 61, 5}) {
    const auto computed = review.seek(world, at);
    ASSERT_TRUE(computed.ok());
    EXPECT_LE(*computed, 1u) << at;
  }
  // Nor where the present is nearer than any that was kept.
  auto bare = read(indexOf(s.log, kNever));
  LogReview far(playerOf(s.log), std::move(*bare));
  far.begin(world);
  EXPECT_EQ(10u, *far.seek(world, 10));
  EXPECT_EQ(5u, *far.seek(world, 15));
  EXPECT_EQ(0u, *far.seek(world, 0));
}

TEST(LogReview, WhatWasLostWhenTheWriterWasKilledIsComputed) {
  const auto s = session();
  const std::string index = indexOf(s.log, 1e-3);
  test::Random random(5);
  for (int k = 0; k < 6; ++k) {
    const auto kept = static_cast<std::size_t>(random.integer(20, static_cast<int>(index.size()) - 1));
    expectEveryMoment(s.log, index.substr(0, kept), 10 + static_cast<unsigned>(k));
    EXPECT_FALSE(read(index.substr(0, kept))->ended());
  }
  auto whole = read(index);
  EXPECT_TRUE(whole->ended());
  EXPECT_EQ(playerOf(s.log).end(), whole->end());
}

// A damage is noticed when the index is read, not when somebody asks for that moment.
TEST(LogReview, RefusesAnIndexThatWasDamaged) {
  const auto s = session();
  const std::string index = indexOf(s.log, kEachStep);
  EXPECT_FALSE(read("").ok());
  EXPECT_FALSE(read("MLSSTATE" + index.substr(8)).ok());
  std::string version = index;
  version[8] = static_cast<char>(version[8] + 1);
  EXPECT_FALSE(read(version).ok());
  test::Random random(7);
  for (int k = 0; k < 30; ++k) {
    std::string damaged = index;
    const auto place = static_cast<std::size_t>(random.integer(20, static_cast<int>(index.size()) - 1));
    damaged[place] = static_cast<char>(damaged[place] ^ (1 << random.integer(0, 7)));
    for (const std::string& bytes : {damaged, index.substr(0, place) + std::string(4096, '\0')}) {
      const auto opened = read(bytes);
      EXPECT_FALSE(opened.ok() && opened->ended()) << place;  // a length may reach beyond the end
    }
  }
}

TEST(LogReview, AFileThatChangesUnderItCostsTimeAlone) {
  const auto s = session();
  const std::string index = indexOf(s.log, kEachStep);
  const std::vector<std::uint64_t> hashes = hashesOf(s.log);
  auto file = std::make_unique<std::stringstream>(index);
  std::stringstream& changing = *file;
  auto opened = LogIndex::read(std::move(file));
  ASSERT_TRUE(opened.ok()) << opened.error().detail;
  LogReview review(playerOf(s.log), std::move(*opened));
  World world{WorldSettings()};
  review.begin(world);
  changing.str(index.substr(0, index.size() / 3) + std::string(2 * index.size() / 3, '\x55'));
  for (const std::uint64_t at : {90, 40, 140, 139}) {
    ASSERT_TRUE(review.seek(world, at).ok());
    EXPECT_EQ(hashes[at], world.stateHash()) << at;
  }
}

TEST(LogReview, SaysWhatToolsDidAndWhatHappened) {
  const auto s = session();
  auto index = read(indexOf(s.log, kNever));
  ASSERT_TRUE(index.ok());
  std::map<EventType, int> events;
  for (const LogEvent& event : index->events()) ++events[event.event.type];
  EXPECT_GT(events[EventType::kCut], 0);
  EXPECT_EQ(1, events[EventType::kUndone]);
  EXPECT_EQ(1, events[EventType::kReset]);
  LogReview review(playerOf(s.log), std::move(*index));
  World world{WorldSettings()};
  review.begin(world);
  std::size_t picks = 0, pushes = 0, gone = 0;
  for (const LogMoment& moment : review.index().moments()) {
    ASSERT_TRUE(review.seek(world, moment.at).ok());
    const WorldSnapshot now = world.snapshot({});
    ASSERT_EQ(now.picks.size() + now.push.enabled + now.scissors.shown + now.instruments.size(), moment.tools.size())
        << moment.at;
    gone += moment.tools.empty();
    for (const LogTool& tool : moment.tools) {
      if (tool.kind == ToolKind::kPick) {
        ++picks;
        EXPECT_EQ(now.picks[0].position, tool.position);
        EXPECT_EQ(now.picks[0].force.norm(), tool.force);
      } else if (tool.kind == ToolKind::kPush) {
        ++pushes;
        EXPECT_EQ(now.push.position, tool.position);
      }
    }
  }
  EXPECT_GT(picks, 2u);
  EXPECT_GT(pushes, 2u);
  EXPECT_GT(gone, 0u);  // where a tool was taken away, its path ends
}

TEST(LogReview, HasTheWaysOfTheTipsOfInstruments) {
  World world{WorldSettings()};
  ASSERT_TRUE(world.addSceneBody(test::shared(test::ball())).ok());
  std::string log;
  world.record([&](const std::string& bytes) { log += bytes; });
  for (const char* name : {"left", "right"}) {
    AttachInstrumentCommand taken;
    taken.def.name = name;
    taken.def.pose.translation = Vec3(name == std::string("left") ? -1 : 1, -1, 1);
    test::replyOf<Done>(world.apply(taken));
  }
  for (int k = 0; k < 60; ++k) {
    test::replyOf<Done>(
        world.apply(LeadInstrumentCommand{"right", Pose{Quat::Identity(), Vec3(1, -1, 1 + 0.005 * k)}, {}}));
    world.step();
  }
  world.record(nullptr);
  auto index = read(indexOf(log, kNever));
  ASSERT_TRUE(index.ok()) << index.error().detail;
  LogReview review(playerOf(log), std::move(*index));
  World again{WorldSettings()};
  review.begin(again);
  ASSERT_GE(review.index().moments().size(), 4u);
  for (const LogMoment& moment : review.index().moments()) {
    ASSERT_TRUE(review.seek(again, moment.at).ok());
    const std::vector<Instrument> now = again.snapshot({}).instruments;
    ASSERT_EQ(2u, moment.tools.size());
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_EQ(ToolKind::kInstrument, moment.tools[k].kind);
      EXPECT_EQ(now[k].number, moment.tools[k].pick);
      EXPECT_EQ(now[k].pose.translation, moment.tools[k].position);
    }
  }
  const auto &first = review.index().moments().front(), &last = review.index().moments().back();
  EXPECT_EQ(first.tools[0].position, last.tools[0].position);
  EXPECT_GT(last.tools[1].position.z(), first.tools[1].position.z() + 0.1);
}

TEST(LogReview, AnIndexIsMadeOfALogAfterwards) {
  const auto s = session();
  LogPlayer player = playerOf(s.log);
  std::string bytes;
  writeLogIndex(player, 1, [&](std::string piece) { bytes += piece; });
  EXPECT_FALSE(player.report().difference.has_value());
  expectEveryMoment(s.log, bytes, 4);
}

TEST(LogReview, RefusesAMomentBeyondTheEnd) {
  const auto s = session();
  auto index = read(indexOf(s.log, kNever));
  LogReview review(playerOf(s.log), std::move(*index));
  World world{WorldSettings()};
  review.begin(world);
  const std::uint64_t hash = world.stateHash();
  const auto found = review.seek(world, review.player().end() + 1);
  ASSERT_FALSE(found.ok());
  EXPECT_NE(std::string::npos, found.error().detail.find("accepted: 0 to " + std::to_string(review.player().end())));
  EXPECT_EQ(hash, world.stateHash());
}

}  // namespace log_review_test
}  // namespace meshless
