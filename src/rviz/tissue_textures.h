// Ogre's textures of a node's images.
#pragma once

#include <map>
#include <string>

#include <OgreTexture.h>
#include <meshless_surgery/TissueImages.h>

namespace meshless {

class TissueTextures {
 public:
  TissueTextures() = default;
  ~TissueTextures() { clear(); }
  TissueTextures(const TissueTextures&) = delete;
  TissueTextures& operator=(const TissueTextures&) = delete;

  /// In place of those that were there. Images with a wrong size are left out.
  void take(const meshless_surgery::TissueImages& images);
  void clear();
  /// Null where it has not come.
  Ogre::TexturePtr find(std::uint64_t id) const;

 private:
  std::map<std::uint64_t, Ogre::TexturePtr> textures_;
};

}  // namespace meshless
