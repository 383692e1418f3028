#include "meshless_surgery/io/autosave_file.h"

#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <thread>

#include "io/temporary_folder.h"
#include "meshless_surgery/world/world.h"
#include "support/bodies.h"
#include "support/forged.h"

namespace meshless {
namespace autosave_file_test {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

const std::string kOrigin = "scene here, launch 1";

TEST(AutosaveName, NoTwoNodesHaveTheSame) {
  EXPECT_EQ("autosave_deformer.state", autosaveNameOf("/deformer"));
  const std::string longest(90, 'a');
  std::set<std::string> names;
  const std::vector<std::string> nodes = {"/a_b",
                                          "/a/b",
                                          "/a__b",
                                          "/a/_b",
                                          "/a_/b",
                                          "/a//b",
                                          "/a-b",
                                          "/a.b",
                                          "/a.2d",
                                          "/a.2db",
                                          "/a2db",
                                          "//a_b",
                                          "",
                                          "/" + longest,
                                          "/" + longest + "a",
                                          "/" + longest + "b",
                                          "/" + longest.substr(0, 60) + "/a_b",
                                          "/" + longest.substr(0, 60) + "/a/b"};
  for (const std::string& node : nodes) {
    const std::string name = autosaveNameOf(node);
    EXPECT_TRUE(SessionFolder::checkName(name + ".9.before.9").ok()) << name;
    names.insert(name);
  }
  EXPECT_EQ(nodes.size(), names.size());
}

class AutosaveFileTest : public testing::Test {
 protected:
  AutosaveFileTest() {
    World world{WorldSettings()};
    EXPECT_TRUE(world.addSceneBody(test::shared(test::ball())).ok());
    for (int i = 0; i < 3; ++i) states_.push_back(encode(*world.capture(), kOrigin)), world.step();
    other_ = encode(*world.capture(), "elsewhere");
  }
  AutosaveFile file() const { return AutosaveFile(folder_, "autosave_a.state"); }
  /// Which of states_ it took up; -1: none.
  int claimed(AutosaveFile& file, milliseconds patience = milliseconds(0)) {
    said_.clear();
    const auto state = file.claim(kOrigin, patience, [this](const std::string& text) {
      said_ += text + "\n";
      has_spoken_ = true;
    });
    EXPECT_TRUE(state.ok()) << state.error().detail;
    if (!state.ok() || !*state) return -1;
    const std::string bytes = encode(**state, kOrigin);
    return static_cast<int>(std::find(states_.begin(), states_.end(), bytes) - states_.begin());
  }
  /// A process that was killed at work with the file.
  void leave(const std::string& bytes) {
    AutosaveFile dying = file();
    claimed(dying);
    dying.keep();
    EXPECT_TRUE(dying.write(bytes).ok());
  }
  std::vector<std::string> files() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(temporary_.path())) names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return names;
  }
  const TemporaryFolder temporary_;
  const SessionFolder folder_{temporary_.path()};
  std::vector<std::string> states_;
  std::string other_, said_;
  std::atomic<bool> has_spoken_{false};
};

TEST_F(AutosaveFileTest, WhatTheKilledLeftIsTakenUpAndRemovedInTheEnd) {
  AutosaveFile first = file();
  EXPECT_EQ(-1, claimed(first));
  first.remove();
  EXPECT_TRUE(files().empty());
  leave(states_[1]);
  AutosaveFile next = file();
  EXPECT_EQ(1, claimed(next));
  EXPECT_EQ("", said_);
  next.remove();
  EXPECT_TRUE(files().empty());
}

TEST_F(AutosaveFileTest, TheLockEndsWithItsProcess) {
  int ready[2];
  ASSERT_EQ(0, pipe(ready));
  const pid_t holder = fork();
  if (holder == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    AutosaveFile held = file();
    (void)held.claim(kOrigin, milliseconds(0), [](const std::string&) {});
    held.keep();
    (void)held.write(states_[2]);
    (void)!::write(ready[1], "x", 1);
    pause();
    _exit(0);
  }
  close(ready[1]);  // so that the end of the child ends the wait
  char byte = 0;
  ASSERT_EQ(1, ::read(ready[0], &byte, 1));
  AutosaveFile second = file();
  EXPECT_EQ(-1, claimed(second));
  EXPECT_NE(std::string::npos, said_.find("process " + std::to_string(holder))) << said_;
  EXPECT_NE(std::string::npos, said_.find("autosave_a.state.2")) << said_;
  second.remove();
  kill(holder, SIGKILL);
  ASSERT_EQ(holder, waitpid(holder, nullptr, 0));
  AutosaveFile third = file();
  EXPECT_EQ(2, claimed(third));
  close(ready[0]);
}

TEST_F(AutosaveFileTest, TwoOfOneNameDoNotTouchEachOthers) {
  AutosaveFile first = file(), second = file();
  claimed(first);
  ASSERT_TRUE(first.write(states_[0]).ok());
  EXPECT_EQ(-1, claimed(second));
  second.keep();
  ASSERT_TRUE(second.write(states_[1]).ok());
  EXPECT_EQ(states_[0], *folder_.read("autosave_a.state", kMostStateBytes));
  first.remove();
  EXPECT_EQ(states_[1], *folder_.read("autosave_a.state.2", kMostStateBytes));
  EXPECT_FALSE(folder_.has("autosave_a.state"));
}

// Names that others hold, and names whose lock cannot be taken, with an autosave or without.
TEST_F(AutosaveFileTest, TheFirstNameThatIsFreeIsTaken) {
  const auto block = [this](const std::string& name) {
    fs::create_directory(temporary_.path() + "/." + name + ".lock");
  };
  for (const bool base_is_held : {true, false}) {
    SCOPED_TRACE(base_is_held);
    AutosaveFile first = file(), third = file(), last = file();
    if (base_is_held) {
      EXPECT_EQ(-1, claimed(first));
      first.keep();
      ASSERT_TRUE(first.write(states_[0]).ok());
    } else {
      block("autosave_a.state");
    }
    block("autosave_a.state.2");
    ASSERT_TRUE(folder_.write("autosave_a.state.2", states_[1]).ok());
    EXPECT_EQ(-1, claimed(third));
    third.keep();
    ASSERT_TRUE(third.write(states_[2]).ok());
    EXPECT_EQ(states_[2], *folder_.read("autosave_a.state.3", kMostStateBytes));
    block("autosave_a.state.4");
    EXPECT_EQ(-1, claimed(last));
    EXPECT_NE(std::string::npos, said_.find("this node's autosave is autosave_a.state.5")) << said_;
    last.keep();
    ASSERT_TRUE(last.write(states_[0]).ok());
    EXPECT_EQ(states_[1], *folder_.read("autosave_a.state.2", kMostStateBytes));
    EXPECT_EQ(states_[2], *folder_.read("autosave_a.state.3", kMostStateBytes));
    EXPECT_EQ(states_[0], *folder_.read("autosave_a.state.5", kMostStateBytes));
    for (AutosaveFile* one : {&first, &third, &last}) one->remove();
    for (const std::string& name : files()) fs::remove_all(temporary_.path() + "/" + name);
  }
}

TEST_F(AutosaveFileTest, WhoWroteUnderAnotherNameFindsItThere) {
  AutosaveFile first = file();
  claimed(first);
  ASSERT_TRUE(first.write(other_).ok());
  leave(states_[2]);
  AutosaveFile again = file();
  EXPECT_EQ(2, claimed(again));
  EXPECT_EQ("", said_);
  EXPECT_EQ(other_, *folder_.read("autosave_a.state", kMostStateBytes));
}

TEST_F(AutosaveFileTest, WhoIsJustEndingIsWaitedFor) {
  auto first = std::make_unique<AutosaveFile>(folder_, "autosave_a.state");
  claimed(*first);
  ASSERT_TRUE(first->write(states_[0]).ok());
  has_spoken_ = false;
  std::thread ends([&] {
    while (!has_spoken_) std::this_thread::sleep_for(milliseconds(10));
    first->remove();
  });
  AutosaveFile second = file();
  EXPECT_EQ(-1, claimed(second, milliseconds(60000)));
  ends.join();
  EXPECT_NE(std::string::npos, said_.find("waiting")) << said_;
  ASSERT_TRUE(second.write(states_[1]).ok());
  EXPECT_EQ(states_[1], *folder_.read("autosave_a.state", kMostStateBytes));
}

TEST_F(AutosaveFileTest, OnlyWhatIsItsOwnIsRemoved) {
  AutosaveFile file = this->file();
  claimed(file);
  ASSERT_TRUE(file.write(states_[0]).ok());
  ASSERT_TRUE(folder_.write("autosave_a.state", "somebody else's").ok());
  file.remove();
  EXPECT_EQ("somebody else's", *folder_.read("autosave_a.state", 100));
}

TEST_F(AutosaveFileTest, AFolderThatWasClearedIsTakenAgain) {
  AutosaveFile first = file();
  claimed(first);
  fs::remove_all(temporary_.path());
  ASSERT_TRUE(first.write(states_[0]).ok());
  AutosaveFile second = file();
  EXPECT_EQ(-1, claimed(second));
  EXPECT_NE(std::string::npos, said_.find("process " + std::to_string(::getpid()))) << said_;
  fs::remove(temporary_.path() + "/.autosave_a.state.lock");
  AutosaveFile third = file();
  EXPECT_EQ(0, claimed(third));
  EXPECT_FALSE(first.write(states_[1]).ok());  // it is the third one's now
  first.remove();
  EXPECT_TRUE(folder_.has("autosave_a.state"));
}

TEST_F(AutosaveFileTest, SomeThatWereSetAsideAreKept) {
  std::vector<std::string> kept;
  for (int i = 0; i < 7; ++i) {
    ASSERT_TRUE(folder_.write("autosave_a.state", "no state " + std::to_string(i)).ok());
    AutosaveFile next = file();
    EXPECT_EQ(-1, claimed(next));
    EXPECT_NE(std::string::npos, said_.find("it is kept as autosave_a.state.before")) << said_;
    next.remove();
    std::this_thread::sleep_for(milliseconds(20));  // the time of a file is that of the last tick
  }
  for (const std::string& name : files()) kept.push_back(*folder_.read(name, 100));
  std::sort(kept.begin(), kept.end());
  EXPECT_EQ((std::vector<std::string>{"no state 2", "no state 3", "no state 4", "no state 5", "no state 6"}), kept);
}

TEST_F(AutosaveFileTest, AStateThatKillsIsNotTakenUpForEver) {
  leave(states_[0]);
  const auto die = [this] {
    AutosaveFile dying = file();
    const int state = claimed(dying);
    dying.keep();
    return state;
  };
  EXPECT_EQ(0, die());
  EXPECT_EQ(0, die());
  leave(states_[1]);  // the third time something comes of it
  for (int i = 0; i < 3; ++i) EXPECT_EQ(1, die());
  EXPECT_EQ(-1, die());
  EXPECT_NE(std::string::npos, said_.find("taken up 3 times")) << said_;
  EXPECT_EQ(states_[1], *folder_.read("autosave_a.state.before", kMostStateBytes));
}

// Whatever the note beside it says: a state is taken up three times at the most, then kept aside, and work goes on.
TEST_F(AutosaveFileTest, ForgedNotes) {
  const std::string lock = temporary_.path() + "/.autosave_a.state.lock";
  const std::vector<std::string> numbers = {"-1",  "-2147483648", "2147483647",           "4294967296", "2", "3",
                                            "nan", "1e9",         "99999999999999999999", "0x7",        "",  "3 3"};
  int taken_up = 0, refused = 0;
  for (int seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const test::TimeLimit limit("seed " + std::to_string(seed));
    test::Random random(static_cast<unsigned>(seed));
    leave(states_[0]);
    {
      AutosaveFile dying = file();
      EXPECT_EQ(0, claimed(dying));
      dying.keep();  // now the note names the file
    }
    std::string note;
    std::getline(std::ifstream(lock), note);
    std::istringstream in(note);
    std::vector<std::string> words;
    for (std::string word; in >> word;) words.push_back(word);
    ASSERT_EQ(4u, words.size()) << note;
    const int word = seed % 2 ? 1 : random.integer(0, 3);  // mostly the count
    words[static_cast<std::size_t>(word)] = numbers[static_cast<std::size_t>(seed / 2) % numbers.size()];
    note = words[0] + " " + words[1] + " " + words[2] + " " + words[3] + "\n";
    if (seed % 5 == 0) test::forgeNumber(random, note, 0);
    if (seed % 7 == 0) note.resize(static_cast<std::size_t>(random.integer(0, 300)), '\xff');
    std::ofstream(lock, std::ios::binary | std::ios::trunc) << note;
    for (int death = 0; death < 4 && folder_.has("autosave_a.state"); ++death) {
      AutosaveFile dying = file();
      const int state = claimed(dying);
      dying.keep();
      EXPECT_TRUE(state == 0 ? said_.empty() : said_.find("taken up") != std::string::npos) << said_;
      ++(state == 0 ? taken_up : refused);
    }
    ASSERT_FALSE(folder_.has("autosave_a.state")) << note;
    EXPECT_EQ(states_[0], *folder_.read("autosave_a.state.before", kMostStateBytes));
    leave(states_[1]);
    AutosaveFile next = file();
    EXPECT_EQ(1, claimed(next));
    next.remove();
    for (const std::string& name : files()) fs::remove(temporary_.path() + "/" + name);
  }
  EXPECT_GT(taken_up, 20);
  EXPECT_EQ(20, refused);
}

TEST_F(AutosaveFileTest, WhoDoesNotComeToStartDoesNotCount) {
  leave(states_[0]);
  for (int i = 0; i < 5; ++i) {
    AutosaveFile refused = file();
    EXPECT_EQ(0, claimed(refused));
  }
}

TEST_F(AutosaveFileTest, AFolderThatCannotBe) {
  for (const std::string path : {"/proc/x", "/dev/null", "/dev/null/x", ""}) {
    const SessionFolder folder(path);
    AutosaveFile file(folder, "autosave_a.state");
    const auto state = file.claim(kOrigin, milliseconds(0), [](const std::string&) {});
    ASSERT_FALSE(state.ok()) << path;
    EXPECT_NE(std::string::npos, state.error().detail.find(path)) << state.error().detail;
  }
}

}  // namespace autosave_file_test
}  // namespace meshless
