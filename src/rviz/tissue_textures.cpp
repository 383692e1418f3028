#include "tissue_textures.h"

#include <OgreImage.h>
#include <OgreResourceGroupManager.h>
#include <OgreTextureManager.h>

namespace meshless {

void TissueTextures::take(const meshless_surgery::TissueImages& images) {
  static int count = 0;
  std::map<std::uint64_t, Ogre::TexturePtr> now;
  for (const auto& image : images.images) {
    if (const auto known = textures_.extract(image.id)) {  // the same number, the same pixels
      now[image.id] = known.mapped();
      continue;
    }
    const std::uint64_t bytes = std::uint64_t{3} * image.width * image.height;
    if (bytes == 0 || image.rgb.size() != bytes) continue;
    Ogre::Image pixels;
    pixels.loadDynamicImage(const_cast<std::uint8_t*>(image.rgb.data()), image.width, image.height, 1,
                            Ogre::PF_BYTE_RGB);  // which it only reads
    now[image.id] = Ogre::TextureManager::getSingleton().loadImage(
        "meshless_image_" + std::to_string(count++), Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME, pixels,
        Ogre::TEX_TYPE_2D, Ogre::MIP_UNLIMITED);
  }
  clear();
  textures_ = std::move(now);
}

void TissueTextures::clear() {
  for (const auto& [id, texture] : textures_) Ogre::TextureManager::getSingleton().remove(texture);
  textures_.clear();
}

Ogre::TexturePtr TissueTextures::find(std::uint64_t id) const {
  const auto found = textures_.find(id);
  return found == textures_.end() ? Ogre::TexturePtr() : found->second;
}

}  // namespace meshless
