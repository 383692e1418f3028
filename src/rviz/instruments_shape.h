// Draws the rigid parts of instruments, as messages and tools name them.
#pragma once

#include <memory>
#include <vector>

#include <OgreMaterial.h>
#include <OgreQuaternion.h>
#include <OgreVector.h>
#include <meshless_surgery/InstrumentPart.h>

namespace Ogre {
class Entity;
class SceneManager;
class SceneNode;
}  // namespace Ogre

namespace meshless {

class InstrumentsShape {
 public:
  InstrumentsShape(Ogre::SceneManager* scene_manager, Ogre::SceneNode* parent);
  ~InstrumentsShape();
  InstrumentsShape(const InstrumentsShape&) = delete;
  InstrumentsShape& operator=(const InstrumentsShape&) = delete;

  /// A part whose mesh cannot be loaded is left out; rviz logs why.
  void show(const std::vector<meshless_surgery::InstrumentPart>& parts);

 private:
  struct Shown {
    std::string mesh;
    Ogre::SceneNode* node = nullptr;
    Ogre::Entity* entity = nullptr;  // null: it could not be loaded
    Ogre::MaterialPtr steel;
  };
  void load(Shown& shown, const std::string& mesh);
  void clear(Shown& shown);

  Ogre::SceneManager* scene_manager_;
  Ogre::SceneNode* node_;
  std::vector<Shown> parts_;
};

/// A grasper whose jaws are open by `angle` [rad] around `grip`; it reaches along x of `turn`.
std::vector<meshless_surgery::InstrumentPart> grasperParts(const Ogre::Vector3& grip, const Ogre::Quaternion& turn,
                                                           float angle);
/// A scalpel with its tip at `tip`, its edge along -y of `turn`.
std::vector<meshless_surgery::InstrumentPart> scalpelParts(const Ogre::Vector3& tip, const Ogre::Quaternion& turn);

}  // namespace meshless
