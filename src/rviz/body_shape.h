// One body, drawn with smooth normals over its outer surface and, on their own, over the faces of cuts.
#pragma once

#include <vector>

#include <OgreColourValue.h>
#include <OgreMaterial.h>
#include <meshless_surgery/Surface.h>

namespace Ogre {
class ManualObject;
class SceneManager;
class SceneNode;
}  // namespace Ogre

namespace meshless {

/// How a body's colours are chosen.
struct BodyLook {
  bool by_strain = false;    // by Surface.strain, where the message has it
  double full_strain = 0.3;  // shown red
  double opacity = 1.0;
  bool wire = false;  // edges of the triangles alone
};

class BodyShape {
 public:
  BodyShape(Ogre::SceneManager* scene_manager, Ogre::SceneNode* parent);
  ~BodyShape();
  BodyShape(const BodyShape&) = delete;
  BodyShape& operator=(const BodyShape&) = delete;

  void show(const meshless_surgery::Surface& surface, const BodyLook& look);

 private:
  struct Corner {
    std::uint32_t vertex = 0;
    Ogre::Vector3 normal;
    bool cut = false;
  };

  void findCorners(const meshless_surgery::Surface& surface);
  bool isSmooth(const meshless_surgery::Surface& surface, std::uint32_t v, bool cut) const;
  /// At a crease: of triangle t and of those around its vertex v that are nearly in its plane.
  Ogre::Vector3 creasedNormal(const meshless_surgery::Surface& surface, std::size_t t, std::uint32_t v) const;
  void applyLook(const meshless_surgery::Surface& surface, const BodyLook& look);

  Ogre::SceneManager* scene_manager_;
  Ogre::SceneNode* node_;
  Ogre::ManualObject* object_;
  Ogre::MaterialPtr material_;
  bool begun_ = false;  // the object has its section
  // kept, so that a frame allocates nothing
  std::vector<Ogre::Vector3> normals_[2];  // of the outer surface, and of cuts
  std::vector<std::uint32_t> place_[2];    // of a vertex among the corners, where one normal will do
  std::vector<Ogre::Vector3> faces_;       // normals, as long as twice the area
  std::vector<std::uint32_t> starts_, next_,
      around_;  // triangles around a vertex: around_[starts_[v] .. starts_[v + 1])
  std::vector<Corner> corners_;
  std::vector<std::uint32_t> indices_;
};

/// Blue at 0 over green to red at 1 and above.
Ogre::ColourValue heatColour(double share);

}  // namespace meshless
