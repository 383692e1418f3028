#include "tissue_program.h"

#include <fstream>
#include <sstream>

#include <OgreException.h>
#include <OgreHighLevelGpuProgram.h>
#include <OgreHighLevelGpuProgramManager.h>
#include <OgreResourceGroupManager.h>
#include <ros/package.h>

namespace meshless {
namespace {

class Loader {
 public:
  /// The program's name; `refused` says where there is none. What is defined comes after the first line, the version.
  std::string load(const std::string& file, Ogre::GpuProgramType type, const std::string& name,
                   const std::string& defined = "") {
    if (!refused.empty()) return "";
    std::ifstream stream(ros::package::getPath("meshless_surgery") + "/media/" + file);
    std::string version;
    std::getline(stream, version);
    std::ostringstream source;
    source << version << "\n" << defined << stream.rdbuf();
    if (!stream) refused = "cannot read media/" + file;
    if (!refused.empty()) return "";
    try {
      const auto program = Ogre::HighLevelGpuProgramManager::getSingleton().createProgram(
          name, Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME, "glsl", type);
      program->setSource(source.str());
      program->load();
      if (!program->isSupported() || program->hasCompileError()) refused = "the driver does not take media/" + file;
    } catch (const Ogre::Exception& e) {
      refused = file + ": " + e.getDescription();
    }
    return name;
  }

  std::string refused;
};

TissueProgram loaded() {
  TissueProgram program;
  Loader loader;
  program.vertex = loader.load("tissue.vert", Ogre::GPT_VERTEX_PROGRAM, "meshless_tissue_vertex");
  const auto fragment = [&loader](int noise) {
    return loader.load("tissue.frag", Ogre::GPT_FRAGMENT_PROGRAM, "meshless_tissue_" + std::to_string(noise),
                       "#define NOISE " + std::to_string(noise) + "\n");
  };
  // Ogre's preprocessor knows no negative numbers.
  for (std::size_t noise = 0; noise < program.patterned.size(); ++noise)
    program.patterned[noise] = fragment(static_cast<int>(noise));
  program.even = fragment(static_cast<int>(program.patterned.size()));
  program.by_uv = fragment(static_cast<int>(program.patterned.size()) + 1);
  program.refused = loader.refused;
  return program;
}

}  // namespace

const TissueProgram& tissueProgram() {
  static const TissueProgram program = loaded();
  return program;
}

}  // namespace meshless
