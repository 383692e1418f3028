#include "meshless_surgery/io/session_folder.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>

#include "io/temporary_folder.h"

namespace meshless {
namespace session_folder_test {

namespace fs = std::filesystem;

class SessionFolderTest : public testing::Test {
 protected:
  std::vector<std::string> files(const std::string& folder) const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder)) names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return names;
  }
  const TemporaryFolder temporary_;
  const std::string base_ = temporary_.path();
};

TEST_F(SessionFolderTest, WhatIsWrittenIsRead) {
  const SessionFolder folder(base_ + "/made/here");
  ASSERT_TRUE(folder.write("a.state", std::string("one\0two", 7)).ok());
  EXPECT_EQ(std::string("one\0two", 7), *folder.read("a.state", 100));
  ASSERT_TRUE(folder.write("a.state", "three").ok());
  EXPECT_EQ("three", *folder.read("a.state", 100));
  EXPECT_EQ(std::vector<std::string>{"a.state"}, files(base_ + "/made/here"));  // nothing is left over
}

TEST_F(SessionFolderTest, OnlyNames) {
  const SessionFolder folder(base_);
  for (const std::string name :
       {"", ".", "..", "../a", "/etc/passwd", "a/b", ".hidden", "a b", "a\nb", "ä",
        "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"
        "aaaaaaaaaaaaaaaaaaaaaa"}) {
    const Status written = folder.write(name, "x");
    ASSERT_FALSE(written.ok()) << name;
    EXPECT_NE(std::string::npos, written.error().detail.find("accepted")) << written.error().detail;
    EXPECT_FALSE(folder.read(name, 100).ok()) << name;
    EXPECT_FALSE(folder.create(name).ok()) << name;
  }
  EXPECT_FALSE(folder.write(std::string("a\0b", 3), "x").ok());
  EXPECT_TRUE(files(base_).empty());
  EXPECT_LT(folder.write(std::string(10 << 20, 'a'), "x").error().detail.size(), 1000u);
}

TEST_F(SessionFolderTest, LinksDoNotLeadOut) {
  std::ofstream(base_ + "/secret") << "secret";
  fs::create_directory(base_ + "/session");
  fs::create_symlink(base_ + "/secret", base_ + "/session/link");
  const SessionFolder folder(base_ + "/session");
  const auto read = folder.read("link", 100);
  ASSERT_FALSE(read.ok());
  EXPECT_EQ(ErrorCode::kForbidden, read.error().code);
  // Saving replaces the link, not what it leads to.
  ASSERT_TRUE(folder.write("link", "mine").ok());
  EXPECT_FALSE(fs::is_symlink(base_ + "/session/link"));
  std::string text;
  std::ifstream(base_ + "/secret") >> text;
  EXPECT_EQ("secret", text);
  fs::create_symlink(base_ + "/elsewhere", base_ + "/session/log");
  const auto created = folder.create("log");
  ASSERT_TRUE(created.ok());
  close(created->descriptor);
  EXPECT_EQ("log.2", created->name);
  EXPECT_FALSE(fs::exists(base_ + "/elsewhere"));
}

TEST_F(SessionFolderTest, OnlyFilesOfASensibleSize) {
  const SessionFolder folder(base_);
  EXPECT_FALSE(folder.read("nothing", 100).ok());
  fs::create_directory(base_ + "/folder");
  EXPECT_FALSE(folder.read("folder", 100).ok());
  ASSERT_EQ(0, mkfifo((base_ + "/pipe").c_str(), 0600));
  EXPECT_FALSE(folder.read("pipe", 100).ok());
  std::ofstream(base_ + "/large") << "x";
  fs::resize_file(base_ + "/large", std::uintmax_t{1} << 40);  // a terabyte of nothing
  const auto large = folder.read("large", 1000);
  ASSERT_FALSE(large.ok());
  EXPECT_NE(std::string::npos, large.error().detail.find("1099511627776"));
}

TEST_F(SessionFolderTest, WhatItsBeginningSaysIsLookedAtFirst) {
  const SessionFolder folder(base_);
  std::ofstream(base_ + "/large") << "0123456789";
  fs::resize_file(base_ + "/large", std::uintmax_t{1} << 40);
  const auto refuses = [](std::string_view beginning, std::uint64_t bytes) -> Status {
    return Error{ErrorCode::kUnreadable, std::string(beginning) + " of " + std::to_string(bytes)};
  };
  const auto large = folder.read("large", ~std::size_t{0}, 4, refuses);  // more than there is memory for
  ASSERT_FALSE(large.ok());
  EXPECT_EQ("'large': 0123 of 1099511627776", large.error().detail);
  ASSERT_TRUE(folder.write("small", "01").ok());
  EXPECT_EQ("'small': 01 of 2", folder.read("small", 100, 4, refuses).error().detail);
  const auto accepts = [](std::string_view, std::uint64_t) -> Status { return Done{}; };
  for (const std::size_t beginning : {0u, 1u, 2u, 5u}) EXPECT_EQ("01", *folder.read("small", 100, beginning, accepts));
}

TEST_F(SessionFolderTest, HowAFileBegins) {
  const SessionFolder folder(base_);
  ASSERT_TRUE(folder.write("a", "begin and end").ok());
  ASSERT_TRUE(folder.write("short", "beg").ok());
  fs::create_symlink(base_ + "/a", base_ + "/link");
  ASSERT_EQ(0, mkfifo((base_ + "/pipe").c_str(), 0600));
  EXPECT_TRUE(folder.beginsWith("a", "begin"));
  for (const std::string name : {"short", "link", "pipe", "missing", "../a", "."})
    EXPECT_FALSE(folder.beginsWith(name, "begin")) << name;
  EXPECT_FALSE(folder.beginsWith("a", "end"));
}

// A limit on the size of files refuses as a full disk does, for anybody.
TEST_F(SessionFolderTest, AFullDiskLeavesWhatWasThere) {
  const SessionFolder folder(base_);
  ASSERT_TRUE(folder.write("a.state", "old").ok());
  rlimit before{};
  ASSERT_EQ(0, getrlimit(RLIMIT_FSIZE, &before));
  const auto ignored = std::signal(SIGXFSZ, SIG_IGN);
  rlimit small = before;
  small.rlim_cur = 4096;
  ASSERT_EQ(0, setrlimit(RLIMIT_FSIZE, &small));
  const Status written = folder.write("a.state", std::string(100000, 'x'));
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, ignored);
  ASSERT_FALSE(written.ok());
  EXPECT_NE(std::string::npos, written.error().detail.find("a.state"));
  EXPECT_EQ("old", *folder.read("a.state", 100));
  EXPECT_EQ(std::vector<std::string>{"a.state"}, files(base_));
}

TEST_F(SessionFolderTest, AFolderThatCannotBeMade) {
  std::ofstream(base_ + "/file") << "x";
  EXPECT_FALSE(SessionFolder(base_ + "/file/session").write("a", "x").ok());
  EXPECT_FALSE(SessionFolder(base_ + "/file").write("a", "x").ok());
  const Status nowhere = SessionFolder("").write("a", "x");
  ASSERT_FALSE(nowhere.ok());
  EXPECT_NE(std::string::npos, nowhere.error().detail.find("session_directory"));
}

TEST_F(SessionFolderTest, WhoeverReadsFindsTheWhole) {
  const SessionFolder folder(base_);
  const std::string a(300000, 'a'), b(200000, 'b');
  ASSERT_TRUE(folder.write("f", a).ok());
  std::thread writer([&] {
    for (int i = 0; i < 40; ++i) EXPECT_TRUE(folder.write("f", i % 2 ? a : b).ok());
  });
  for (int i = 0; i < 200; ++i) {
    const auto read = folder.read("f", 1 << 20);
    ASSERT_TRUE(read.ok()) << read.error().detail;
    ASSERT_TRUE(*read == a || *read == b);
  }
  writer.join();
}

TEST_F(SessionFolderTest, WhatTheKilledLeftIsRemoved) {
  const SessionFolder folder(base_);
  const pid_t dead = fork();
  if (dead == 0) _exit(0);
  ASSERT_GT(dead, 0);
  ASSERT_EQ(dead, waitpid(dead, nullptr, 0));
  const std::string own = ".a.state." + std::to_string(getpid()) + "-1.part";
  const std::string left = ".a.b-c.state." + std::to_string(dead) + "-17.part";
  const std::vector<std::string> others = {".1-1.part",          ".a.-1.part", ".a.99999999999-1.part", ".a.part",
                                           ".a.state.1x-1.part", ".part",      "a.99999-1.part",        "a.state"};
  for (const std::string& name : others) std::ofstream(base_ + "/" + name) << "x";
  for (const std::string& name : {own, left}) std::ofstream(base_ + "/" + name) << "x";
  folder.removeLeftovers();
  std::vector<std::string> kept = others;
  kept.push_back(own);
  std::sort(kept.begin(), kept.end());
  EXPECT_EQ(kept, files(base_));
  SessionFolder("").removeLeftovers();
  SessionFolder(base_ + "/missing").removeLeftovers();
  EXPECT_FALSE(fs::exists(base_ + "/missing"));
}

TEST_F(SessionFolderTest, NewFilesNeverReplaceOldOnes) {
  const SessionFolder folder(base_);
  for (const std::string expected : {"log", "log.2", "log.3"}) {
    const auto created = folder.create("log");
    ASSERT_TRUE(created.ok());
    EXPECT_EQ(expected, created->name);
    EXPECT_TRUE(writeAll(created->descriptor, expected).ok());
    close(created->descriptor);
    EXPECT_EQ(expected, *folder.read(expected, 100));
  }
}

}  // namespace session_folder_test
}  // namespace meshless
