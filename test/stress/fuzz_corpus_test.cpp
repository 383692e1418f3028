// What the fuzzers were started from and what they found (test/corpus/fuzz): none breaks a law any more.
#include <iterator>

#include <gtest/gtest.h>

#include "fuzz/targets.h"

namespace meshless {
namespace fuzz_corpus_test {

using Target = void (*)(const std::uint8_t*, std::size_t);

std::size_t replay(const std::string& name, Target target) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(SOURCE_DIR) + "/test/corpus/fuzz/" + name))
    files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  for (const auto& file : files) {
    SCOPED_TRACE(file.string());
    std::ifstream in(file, std::ios::binary);
    const std::vector<char> bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
    target(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  }
  return files.size();
}

TEST(FuzzCorpus, MeshFiles) { EXPECT_GE(replay("mesh_file", fuzz::meshFile), 5u); }
TEST(FuzzCorpus, SceneFiles) { EXPECT_GE(replay("scene_file", fuzz::sceneFile), 3u); }
TEST(FuzzCorpus, Cuts) { EXPECT_GE(replay("cut_plane", fuzz::cutPlane), 3u); }

}  // namespace fuzz_corpus_test
}  // namespace meshless
