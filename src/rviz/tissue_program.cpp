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

/// Why it cannot be used; empty: it can.
std::string load(const std::string& name, Ogre::GpuProgramType type, const std::string& file) {
  std::ifstream stream(file);
  std::ostringstream source;
  source << stream.rdbuf();
  if (!stream) return "cannot read " + file;
  try {
    const auto program = Ogre::HighLevelGpuProgramManager::getSingleton().createProgram(
        name, Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME, "glsl", type);
    program->setSource(source.str());
    program->load();
    if (!program->isSupported() || program->hasCompileError()) return "the driver does not take " + file;
  } catch (const Ogre::Exception& e) {
    return file + ": " + e.getDescription();
  }
  return "";
}

TissueProgram loaded() {
  TissueProgram program{"meshless_tissue_vertex", "meshless_tissue_fragment", ""};
  const std::string folder = ros::package::getPath("meshless_surgery") + "/media/";
  program.refused = load(program.vertex, Ogre::GPT_VERTEX_PROGRAM, folder + "tissue.vert");
  if (program.usable()) program.refused = load(program.fragment, Ogre::GPT_FRAGMENT_PROGRAM, folder + "tissue.frag");
  return program;
}

}  // namespace

const TissueProgram& tissueProgram() {
  static const TissueProgram program = loaded();
  return program;
}

}  // namespace meshless
