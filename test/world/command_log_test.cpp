#include "meshless_surgery/world/command_log.h"

#include <cstdlib>
#include <cstring>
#include <sstream>

#include <zlib.h>

#include "meshless_surgery/world/saved_world.h"
#include "recorded_session.h"
#include "support/bodies.h"
#include "support/forged.h"
#include "support/random.h"

namespace meshless {
namespace command_log_test {

Result<ReplayReport> replayed(const std::string& log, int threads = 1) {
  std::istringstream stream(log);
  return replay(stream, threads);
}

TEST(CommandLog, ReplaysToTheSameHash) {
  const Session s = session();
  for (const int threads : {1, 2}) {
    const auto report = replayed(s.log, threads);
    ASSERT_TRUE(report.ok()) << report.error().detail;
    EXPECT_FALSE(report->difference.has_value());
    EXPECT_EQ(s.hash, report->hash);
    EXPECT_EQ(s.steps, report->last_step);
    EXPECT_EQ(6u, report->checks);  // one of a whole second
    EXPECT_GE(report->commands, 20u);
    EXPECT_TRUE(report->ended);
    EXPECT_EQ(0u, report->lost_bytes);
  }
}

// The first body alone would take the material.
TEST(CommandLog, AMaterialThatWasRefusedChangesNobodyInAReplay) {
  World world{WorldSettings()};
  ASSERT_TRUE(world.addSceneBody(test::shared(test::ball())).ok());
  BodyDef mixed = test::block("mixed", Vec3(0.4, 0, 0.2));
  mixed.spacing = 0.05;
  mixed.material.youngs_modulus = 1e4;
  mixed.regions = {{Region::sphere(Vec3(0.05, 0, 0), 0.04), mixed.material}};
  ASSERT_TRUE(world.addSceneBody(test::shared(mixed)).ok());
  std::string log;
  world.record([&log](std::string bytes) { log += bytes; });
  SetMaterialCommand refused;
  refused.change = [](const Material&) {
    Material other;  // an appearance material
    other.density = 500.0;
    return Result<Material>(other);
  };
  const auto reply = world.apply(refused);
  ASSERT_FALSE(reply.ok());
  EXPECT_NE(reply.error().detail.find("regions"), std::string::npos);
  run(world, 5);
  world.record(nullptr);
  const auto report = replayed(log);
  ASSERT_TRUE(report.ok());
  EXPECT_FALSE(report->difference.has_value());
}

TEST(CommandLog, TheLogDoesNotChangeTheWorldAndIsTheSameAgain) {
  const Session once = session(), again = session(true, 2);
  EXPECT_EQ(once.hash, again.hash);
  // The state at the start says how many threads there were, and that alone differs.
  EXPECT_EQ(once.log.size(), again.log.size());
}

// A process that was killed leaves the pieces that were written, and maybe half of one.
TEST(CommandLog, WhatWasWrittenBeforeAKillIsReplayed) {
  const Session s = session(false);
  const auto whole = replayed(s.log);
  ASSERT_TRUE(whole.ok());
  EXPECT_FALSE(whole->ended);
  EXPECT_EQ(s.hash, whole->hash);
  std::uint64_t before = 0;
  for (std::size_t n = 1; n + 1 < s.ends.size(); n += 4) {
    const auto part = replayed(s.log.substr(0, s.ends[n]));
    ASSERT_TRUE(part.ok()) << part.error().detail;
    EXPECT_FALSE(part->difference.has_value());
    EXPECT_GE(part->commands, before);
    before = part->commands;
    const auto torn = replayed(s.log.substr(0, s.ends[n] + 5));
    ASSERT_TRUE(torn.ok()) << torn.error().detail;
    EXPECT_EQ(part->hash, torn->hash);
    EXPECT_EQ(5u, torn->lost_bytes);
  }
}

TEST(CommandLog, ADifferenceIsFound) {
  Session s = session(false);
  // Another command in the middle, with the right checksum: taken from a session that goes on differently.
  World world{WorldSettings()};
  EXPECT_TRUE(world.addSceneBody(test::shared(test::ball())).ok());
  std::string log;
  world.record([&log](std::string bytes) { log += bytes; });
  run(world, 10);
  world.recordHash();
  World other{WorldSettings()};
  EXPECT_TRUE(other.addSceneBody(test::shared(test::ball())).ok());
  std::vector<std::string> pieces;
  other.record([&pieces](std::string bytes) { pieces.push_back(std::move(bytes)); });
  PushCommand push;
  push.position = Vec3(0, 0, 0.3);
  EXPECT_TRUE(other.apply(push).ok());
  run(other, 10);
  other.recordHash();
  ASSERT_EQ(4u, pieces.size());
  const auto same = replayed(pieces[0] + pieces[1] + pieces[2] + pieces[3]);
  ASSERT_TRUE(same.ok());
  EXPECT_FALSE(same->difference.has_value());
  const auto without = replayed(pieces[0] + pieces[1] + pieces[3]);
  ASSERT_TRUE(without.ok());
  ASSERT_TRUE(without->difference.has_value());
  EXPECT_EQ(10u, without->difference->step);
  EXPECT_EQ(other.stateHash(), without->difference->recorded);
  EXPECT_EQ(world.stateHash(), without->difference->found);
}

TEST(CommandLog, OtherFilesAreRefused) {
  const Session s = session();
  for (const std::string& text :
       {std::string(), std::string("MLSCOMN"), std::string("solid ball\n0 0 0\n0 0 0"), s.log.substr(0, 12)}) {
    const auto report = replayed(text);
    ASSERT_FALSE(report.ok());
    EXPECT_NE(std::string::npos, report.error().detail.find("no log of commands"));
  }
  std::string newer = s.log;
  newer[8] = 99;
  EXPECT_NE(std::string::npos, replayed(newer).error().detail.find("version 99"));
}

std::uint32_t wordAt(const std::string& bytes, std::size_t at) {
  std::uint32_t word = 0;
  std::memcpy(&word, bytes.data() + at, sizeof word);
  return word;
}

/// Where the records of a log begin.
std::vector<std::size_t> recordsOf(const std::string& log) {
  std::vector<std::size_t> records;
  for (std::size_t at = 12; at < log.size(); at += 8 + wordAt(log, at)) records.push_back(at);
  return records;
}

std::uint64_t stepOf(const std::string& log, std::size_t record) {
  std::uint64_t step = 0;
  std::memcpy(&step, log.data() + record + 9, sizeof step);
  return step;
}

/// The log with another body of the record, its checksum right.
std::string withBody(std::string log, std::size_t record, const std::string& body) {
  const auto sum = static_cast<std::uint32_t>(
      crc32_z(crc32_z(0, nullptr, 0), reinterpret_cast<const Bytef*>(body.data()), body.size()));
  log.replace(record + 8, body.size(), body);
  std::memcpy(&log[record + 4], &sum, sizeof sum);
  return log;
}

/// What a disk, or a loss of power, may do to a file from the byte `begin` on, within the `length` bytes there.
std::string damagedLog(test::Random& random, std::string log, std::size_t begin, std::size_t length) {
  const std::size_t at = begin + static_cast<std::size_t>(random.integer(0, static_cast<int>(length) - 1));
  switch (random.integer(0, 4)) {
    case 0:
      return log.replace(begin, std::string::npos, log.size() - begin, '\0');
    case 1:
      return log.replace(at, log.size() - at, log.size() - at, '\0');
    case 2:
      return log.substr(0, at);
    case 3:  // in its head
      log[begin + at % 8] = static_cast<char>(log[begin + at % 8] ^ (1 << random.integer(0, 7)));
      return log;
    default:
      log[at] = static_cast<char>(log[at] ^ (1 << random.integer(0, 7)));
      return log;
  }
}

// Whatever record it is in.
TEST(CommandLog, WhatIsWholeBeforeTheDamageIsReplayed) {
  const Session s = session();
  std::vector<std::size_t> records = recordsOf(s.log);
  records.push_back(s.log.size());
  test::Random random(3);
  for (std::size_t k = 0; k + 1 < records.size(); ++k) {
    SCOPED_TRACE(k);
    const std::size_t begin = records[k];
    const std::string damaged = damagedLog(random, s.log, begin, records[k + 1] - begin);
    const auto report = replayed(damaged);
    if (k == 0) {
      ASSERT_FALSE(report.ok());
      continue;
    }
    ASSERT_TRUE(report.ok()) << report.error().detail;
    const auto whole = replayed(s.log.substr(0, begin));
    ASSERT_TRUE(whole.ok());
    EXPECT_EQ(whole->hash, report->hash);
    EXPECT_EQ(whole->steps, report->steps);
    EXPECT_EQ(whole->commands, report->commands);
    EXPECT_EQ(whole->checks, report->checks);
    EXPECT_FALSE(report->difference.has_value());
    EXPECT_EQ(damaged.size() - begin, report->lost_bytes);
    EXPECT_NE("", report->whatIsLost());
  }
}

TEST(CommandLog, ZerosAtTheEndAreSaidAndTakeNothing) {
  const Session s = session();
  const auto whole = replayed(s.log);
  ASSERT_TRUE(whole.ok());
  EXPECT_EQ("", whole->whatIsLost());
  for (const std::size_t zeros : {1, 7, 8, 9, 4096}) {
    const auto report = replayed(s.log + std::string(zeros, '\0'));
    ASSERT_TRUE(report.ok()) << report.error().detail;
    EXPECT_EQ(whole->hash, report->hash);
    EXPECT_EQ(whole->commands, report->commands);
    EXPECT_TRUE(report->ended);
    EXPECT_EQ(zeros, report->lost_bytes);
    EXPECT_NE(std::string::npos, report->whatIsLost().find("breaks off at record")) << report->whatIsLost();
  }
}

// A forged step would have a replay run for minutes. A log of nothing but steps has records all the same.
TEST(CommandLog, NoRecordIsFarFromTheOneBefore) {
  for (const double rate : {1.0, 1.5, 120.0, 10000.0}) {
    SCOPED_TRACE(rate);
    WorldSettings settings;
    settings.step_rate = rate;
    World world(settings);
    std::string log;
    run(world, 3);
    world.record([&log](std::string bytes) { log += bytes; });
    const std::uint64_t steps = static_cast<std::uint64_t>(2.5 * rate) + 3;
    run(world, static_cast<int>(steps));
    world.record(nullptr);
    const std::vector<std::size_t> records = recordsOf(log);
    for (std::size_t k = 1; k < records.size(); ++k)
      EXPECT_LE(static_cast<double>(stepOf(log, records[k]) - stepOf(log, records[k - 1])), std::ceil(rate));
    const auto report = replayed(log);
    ASSERT_TRUE(report.ok()) << report.error().detail;
    EXPECT_EQ(steps, report->steps);
    EXPECT_FALSE(report->difference.has_value());
    const std::size_t last = records.back(), before = records[records.size() - 2];
    for (const std::uint64_t ahead :
         {static_cast<std::uint64_t>(2.0 * rate), static_cast<std::uint64_t>(2.0 * rate) + 1}) {
      std::string body = log.substr(last + 8);
      const std::uint64_t step = stepOf(log, before) + ahead;
      std::memcpy(&body[1], &step, sizeof step);
      const auto forged = replayed(withBody(log, last, body));
      ASSERT_TRUE(forged.ok()) << forged.error().detail;
      const bool near = static_cast<double>(ahead) <= 2.0 * rate;
      EXPECT_EQ(near ? stepOf(log, before) - 3 + ahead : stepOf(log, before) - 3, forged->steps);
      EXPECT_EQ(!near, forged->damage.find("accepted: up to 2 s") != std::string::npos) << forged->damage;
    }
  }
}

// A record with a number that no hand gives, checksum and all.
TEST(CommandLog, ForgedAtRandom) {
  const char* text = std::getenv("MESHLESS_SURGERY_FORGED");
  const Session s = session();
  const std::vector<std::size_t> records = recordsOf(s.log);
  ASSERT_GT(records.size(), 20u);
  for (int seed = 1; seed <= (text ? std::atoi(text) : 20); ++seed) {
    const test::TimeLimit limit("seed " + std::to_string(seed));
    test::Random random(static_cast<unsigned>(seed));
    const std::size_t at = records[static_cast<std::size_t>(random.integer(1, static_cast<int>(records.size()) - 1))];
    const std::size_t length = wordAt(s.log, at);
    std::string body = s.log.substr(at + 8, length);
    test::forgeNumber(random, body, random.integer(0, 9) ? 9 : 1);  // the step now and then
    (void)replayed(withBody(s.log, at, body));
  }
}

}  // namespace command_log_test
}  // namespace meshless
