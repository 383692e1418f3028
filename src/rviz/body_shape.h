// One body, drawn with smooth normals over its outer surface and, on their own, over the faces of cuts. What stays
// while it deforms (triangles, which corners share a normal, colours) is uploaded where it changes; places and normals
// in each frame.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include <OgreColourValue.h>
#include <OgreHardwareVertexBuffer.h>
#include <OgreMaterial.h>
#include <OgreVector.h>
#include <meshless_surgery/BodyTopology.h>
#include <meshless_surgery/Surface.h>

#include "tissue_textures.h"

namespace Ogre {
class SceneManager;
class SceneNode;
class VertexData;
}  // namespace Ogre

namespace meshless {

/// How a body's colours are chosen.
struct BodyLook {
  bool by_strain = false;    // by Surface.strain, where the message has it
  double full_strain = 0.3;  // shown red
  double opacity = 1.0;
  bool wire = false;           // edges of the triangles alone
  bool shine = false;          // patterns for each pixel, lamps and a wet film: needs tissueProgram()
  std::uint32_t topology = 0;  // the number of the one that the patterns are of
  std::uint32_t images = 0;    // how often they have come

  bool operator==(const BodyLook& o) const {
    return by_strain == o.by_strain && full_strain == o.full_strain && opacity == o.opacity && wire == o.wire &&
           shine == o.shine && topology == o.topology && images == o.images;
  }
};

/// Tips of instruments whose shadow falls on tissue: x, y, z in the world, and how wide they are [m]; 0: none.
using ShadowTips = std::array<Ogre::Vector4, 4>;

class BodyPart;

class BodyShape {
 public:
  BodyShape(Ogre::SceneManager* scene_manager, Ogre::SceneNode* parent);
  ~BodyShape();
  BodyShape(const BodyShape&) = delete;
  BodyShape& operator=(const BodyShape&) = delete;

  /// `patterns` is of the same topology as the surface; null: plain colours. The surface is shown where it is at once;
  /// or it goes there by move(), if it has the same triangles as the one before.
  void show(const meshless_surgery::Surface& surface, const meshless_surgery::BodyTopology* patterns,
            const TissueTextures& textures, const BodyLook& look, bool at_once);
  /// 0..1: how far it is on its way from where it was at show(). Costs nothing where it has not moved.
  void move(float share);
  bool moving() const { return moving_; }
  /// After show(); nothing without shine.
  void shade(const ShadowTips& tips);

 private:
  /// A vertex where faces share a normal.
  struct Corner {
    std::uint32_t vertex = 0;
    std::uint32_t tissue = 0;   // 0: of the outer surface, 1: of cut faces, 2 ..: of those in the regions 1 ..
    std::array<float, 2> uv{};  // its place in the image; at a seam a vertex has several, all with the same normal:
    std::uint32_t next = 0;     // another of these; kNoCorner: it is the last
  };

  bool sameTriangles(const meshless_surgery::Surface& surface) const;
  void findFaces();
  void findCorners(const meshless_surgery::Surface& surface);
  std::uint32_t addCorner(std::uint32_t v, std::uint32_t tissue, const std::vector<std::uint32_t>& faces);
  void makeBuffers();
  void makeParts();
  void setColours(const meshless_surgery::Surface& surface, const meshless_surgery::BodyTopology* patterns,
                  const BodyLook& look);
  void setRest(const meshless_surgery::BodyTopology* patterns, const BodyLook& look);
  void setMaterials(const meshless_surgery::Surface& surface, const meshless_surgery::BodyTopology* patterns,
                    const TissueTextures& textures, const BodyLook& look);
  void place();
  bool pressedBy(const meshless_surgery::Surface& surface);

  Ogre::SceneManager* scene_manager_;
  Ogre::SceneNode* node_;
  std::string name_;
  std::unique_ptr<Ogre::VertexData> data_;  // of all parts
  Ogre::HardwareVertexBufferSharedPtr places_, colours_, rests_;
  std::vector<std::unique_ptr<BodyPart>> parts_;
  // of the topology that is shown
  std::vector<std::uint32_t> triangles_;
  std::vector<std::uint8_t> cut_, regions_;
  std::vector<float> uv_;                            // empty: the outer surface has no image, or no texture coordinates
  std::size_t coordinates_ = 0, region_colors_ = 0;  // how many
  std::vector<Corner> corners_;
  bool closed_ = false;                         // it has no edge, so its back side is never seen
  std::vector<std::uint32_t> starts_, around_;  // faces of a corner's normal: around_[starts_[c] .. starts_[c + 1])
  std::vector<std::vector<std::uint32_t>> indices_;  // of each part
  // and how
  bool patterned_ = false;
  std::vector<float> rest_areas_;  // around each corner, twice
  BodyLook look_;
  std_msgs::ColorRGBA color_, inside_color_;
  // and where: three numbers a vertex
  std::vector<float> at_, from_, to_;
  std::vector<float> pale_;  // one a vertex: 0 .. 1; empty: nothing presses
  bool moving_ = false;
  // kept, so that a frame allocates nothing
  std::vector<Ogre::Vector3> faces_;  // normals, as long as twice the area
  std::vector<float> floats_;
};

/// Blue at 0 over green to red at 1 and above.
Ogre::ColourValue heatColour(double share);

}  // namespace meshless
