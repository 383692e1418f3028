#include "body_shape.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include <OgreAxisAlignedBox.h>
#include <OgreGpuProgramParams.h>
#include <OgreHardwareBufferManager.h>
#include <OgreMaterialManager.h>
#include <OgreResourceGroupManager.h>
#include <OgreSceneManager.h>
#include <OgreSceneNode.h>
#include <OgreSimpleRenderable.h>
#include <OgreTechnique.h>
#include <OgreTextureUnitState.h>

#include "ogre_convert.h"
#include "rim_distance.h"
#include "tissue_program.h"

namespace meshless {
namespace {

constexpr float kSmoothUpTo = 0.8f;  // cosine between faces that share a normal: the edges of a box stay sharp
constexpr float kSelfLight =
    0.25f;                      // share of the colour that is there without a light: rviz has a lamp and no daylight
constexpr float kLamp = 0.85f;  // share of the colour that the lamp adds
constexpr double kSeenThrough = 0.6;  // opacity up to which what is inside of a body shows, whatever is drawn first
constexpr float kDry = 0.1f;          // wetness of what is shown by strain
constexpr float kFarFromRim = 0.02f;  // [m] beyond what the shader asks for, in large triangles too
constexpr float kVenous = 1600.0f, kArterial = 4300.0f;  // [Pa] in capillaries
constexpr std::uint32_t kNoCorner = std::numeric_limits<std::uint32_t>::max();

Ogre::ColourValue toColour(const std_msgs::ColorRGBA& c) { return Ogre::ColourValue(c.r, c.g, c.b, c.a); }

/// Each edge is met as often one way as the other.
bool isClosed(const std::vector<std::uint32_t>& triangles) {
  std::vector<std::uint64_t> there, back;
  there.reserve(triangles.size());
  back.reserve(triangles.size());
  for (std::size_t c = 0; c < triangles.size(); ++c) {
    const std::uint64_t a = triangles[c], b = triangles[c % 3 == 2 ? c - 2 : c + 1];
    there.push_back(a << 32 | b);
    back.push_back(b << 32 | a);
  }
  std::sort(there.begin(), there.end());
  std::sort(back.begin(), back.end());
  return there == back;
}

const meshless_surgery::Look& plainLook() {
  static const meshless_surgery::Look look = [] {
    meshless_surgery::Look plain;
    plain.scale = 1.0f;
    plain.wetness = 0.5f;
    return plain;
  }();
  return look;
}

}  // namespace

/// Triangles of one material over the vertices of a body.
class BodyPart : public Ogre::SimpleRenderable {
 public:
  BodyPart(const std::string& name, Ogre::VertexData* vertices) : Ogre::SimpleRenderable(name) {
    mRenderOp.operationType = Ogre::RenderOperation::OT_TRIANGLE_LIST;
    mRenderOp.useIndexes = true;
    mRenderOp.vertexData = vertices;
    mRenderOp.indexData = &indices_;
    mMaterial =
        Ogre::MaterialManager::getSingleton().create(name, Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME);
    mMaterial->setReceiveShadows(false);
  }
  ~BodyPart() override {
    detachFromParent();
    Ogre::MaterialManager::getSingleton().remove(mMaterial);
  }

  void setTriangles(const std::vector<std::uint32_t>& corners) {
    indices_.indexStart = 0;
    indices_.indexCount = corners.size();
    indices_.indexBuffer = Ogre::HardwareBufferManager::getSingleton().createIndexBuffer(
        Ogre::HardwareIndexBuffer::IT_32BIT, corners.size(), Ogre::HardwareBuffer::HBU_STATIC_WRITE_ONLY);
    indices_.indexBuffer->writeData(0, corners.size() * sizeof corners[0], corners.data(), true);
  }
  void setBounds(const Ogre::AxisAlignedBox& box) {
    setBoundingBox(box);
    radius_ = std::max(box.getMinimum().length(), box.getMaximum().length());
    if (getParentSceneNode()) getParentSceneNode()->needUpdate();
  }
  Ogre::Pass* pass() { return mMaterial->getTechnique(0)->getPass(0); }

  Ogre::Real getBoundingRadius() const override { return radius_; }
  Ogre::Real getSquaredViewDepth(const Ogre::Camera* camera) const override {
    return getParentSceneNode()->getSquaredViewDepth(camera);
  }

 private:
  Ogre::IndexData indices_;
  Ogre::Real radius_ = 0.0f;
};

Ogre::ColourValue heatColour(double share) {
  const auto s = static_cast<float>(std::clamp(share, 0.0, 1.0));
  if (s < 0.5f) return Ogre::ColourValue(0.15f, 0.25f + 1.1f * s, 0.85f - 1.4f * s);
  return Ogre::ColourValue(0.15f + 1.5f * (s - 0.5f), 0.8f - 1.4f * (s - 0.5f), 0.15f);
}

BodyShape::BodyShape(Ogre::SceneManager* scene_manager, Ogre::SceneNode* parent)
    : scene_manager_(scene_manager), node_(parent->createChildSceneNode()) {
  static int count = 0;
  name_ = "meshless_body_" + std::to_string(count++);
}

BodyShape::~BodyShape() {
  parts_.clear();
  scene_manager_->destroySceneNode(node_);
}

bool BodyShape::sameTriangles(const meshless_surgery::Surface& surface) const {
  return data_ && surface.vertices.size() == coordinates_ && surface.triangles == triangles_ && surface.cut == cut_ &&
         surface.regions == regions_ && surface.region_colors.size() == region_colors_;
}

void BodyShape::findFaces() {
  faces_.resize(cut_.size());
  for (std::size_t t = 0; t < faces_.size(); ++t) {
    const std::uint32_t* corner = &triangles_[3 * t];
    const Ogre::Vector3 a = vertexOf(at_, corner[0]);
    faces_[t] = (vertexOf(at_, corner[1]) - a).crossProduct(vertexOf(at_, corner[2]) - a);  // by its area
  }
}

std::uint32_t BodyShape::addCorner(std::uint32_t v, std::uint32_t tissue, const std::vector<std::uint32_t>& faces) {
  corners_.push_back({v, tissue, {}, kNoCorner});
  around_.insert(around_.end(), faces.begin(), faces.end());
  starts_.push_back(static_cast<std::uint32_t>(around_.size()));
  return static_cast<std::uint32_t>(corners_.size() - 1);
}

// Which faces share a normal is found where the triangles are new, and kept while they deform.
void BodyShape::findCorners(const meshless_surgery::Surface& surface) {
  triangles_ = surface.triangles;
  cut_ = surface.cut;
  regions_ = surface.regions;
  coordinates_ = surface.vertices.size();
  at_ = to_ = surface.vertices;
  moving_ = false;
  findFaces();
  region_colors_ = surface.region_colors.size();
  const std::size_t vertices = surface.vertices.size() / 3, triangles = cut_.size();
  const bool regional = regions_.size() == vertices &&
                        std::all_of(regions_.begin(), regions_.end(),
                                    [&](std::uint8_t region) { return region <= surface.region_colors.size(); });
  // Triangles around a vertex: fan[first[v] .. first[v + 1])
  std::vector<std::uint32_t> first(vertices + 1, 0), fan(3 * triangles);
  for (const std::uint32_t v : triangles_) ++first[v + 1];
  for (std::size_t v = 0; v < vertices; ++v) first[v + 1] += first[v];
  std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
  for (std::size_t c = 0; c < 3 * triangles; ++c) fan[next[triangles_[c]]++] = static_cast<std::uint32_t>(c / 3);

  closed_ = isClosed(triangles_);
  const auto tissueOf = [&](std::size_t t, std::uint32_t v) -> std::uint32_t {
    return cut_[t] == 0 ? 0u : regional ? 1u + regions_[v] : 1u;
  };
  const auto along = [&](std::uint32_t s, const Ogre::Vector3& normal) {
    return faces_[s].dotProduct(normal) >= kSmoothUpTo * faces_[s].length() * normal.length();
  };
  corners_.clear();
  around_.clear();
  starts_.assign(1, 0);
  indices_.assign(2 + (regional ? surface.region_colors.size() : 0), {});
  std::vector<std::uint32_t> smooth[2];  // of a vertex: its first corner of the outer surface, of cuts
  for (auto& corners : smooth) corners.assign(vertices, kNoCorner);
  std::vector<std::uint32_t> faces;
  for (std::size_t t = 0; t < triangles; ++t) {
    const std::uint32_t part = tissueOf(t, triangles_[3 * t]);
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t v = triangles_[3 * t + k];
      std::uint32_t& one = smooth[cut_[t] != 0][v];
      const std::size_t at = 6 * t + 2 * static_cast<std::size_t>(k);
      const std::array<float, 2> uv = uv_.empty() ? std::array<float, 2>{} : std::array<float, 2>{uv_[at], uv_[at + 1]};
      std::uint32_t corner = one;
      while (corner != kNoCorner && corners_[corner].uv != uv) corner = corners_[corner].next;
      if (corner == kNoCorner && one != kNoCorner) {  // at a seam of the image
        faces.assign(around_.begin() + starts_[one], around_.begin() + starts_[one + 1]);
        corner = addCorner(v, corners_[one].tissue, faces);
        corners_[corner].next = std::exchange(corners_[one].next, corner);
      } else if (corner == kNoCorner) {
        faces.clear();
        Ogre::Vector3 normal = Ogre::Vector3::ZERO;
        for (std::uint32_t i = first[v]; i < first[v + 1]; ++i)
          if ((cut_[fan[i]] != 0) == (cut_[t] != 0)) {
            faces.push_back(fan[i]);
            normal += faces_[fan[i]];
          }
        if (std::all_of(faces.begin(), faces.end(), [&](std::uint32_t s) { return along(s, normal); })) {
          corner = one = addCorner(v, tissueOf(t, v), faces);
        } else {  // a crease: those that are nearly in the triangle's plane
          faces.erase(std::remove_if(faces.begin(), faces.end(),
                                     [&](std::uint32_t s) { return s != t && !along(s, faces_[t]); }),
                      faces.end());
          corner = addCorner(v, tissueOf(t, v), faces);
        }
      }
      corners_[corner].uv = uv;
      indices_[part].push_back(corner);
    }
  }
}

void BodyShape::makeBuffers() {
  auto& manager = Ogre::HardwareBufferManager::getSingleton();
  data_ = std::make_unique<Ogre::VertexData>();
  data_->vertexCount = corners_.size();
  Ogre::VertexDeclaration* layout = data_->vertexDeclaration;
  layout->addElement(0, 0, Ogre::VET_FLOAT3, Ogre::VES_POSITION);
  layout->addElement(0, 3 * sizeof(float), Ogre::VET_FLOAT3, Ogre::VES_NORMAL);
  layout->addElement(0, 6 * sizeof(float), Ogre::VET_FLOAT2, Ogre::VES_TEXTURE_COORDINATES, 1);
  layout->addElement(1, 0, Ogre::VET_UBYTE4_NORM, Ogre::VES_DIFFUSE);
  layout->addElement(2, 0, Ogre::VET_FLOAT3, Ogre::VES_TEXTURE_COORDINATES, 0);
  layout->addElement(2, 3 * sizeof(float), Ogre::VET_FLOAT4, Ogre::VES_TEXTURE_COORDINATES, 2);
  places_ = manager.createVertexBuffer(8 * sizeof(float), corners_.size(),
                                       Ogre::HardwareBuffer::HBU_DYNAMIC_WRITE_ONLY_DISCARDABLE);
  colours_ = manager.createVertexBuffer(4, corners_.size(), Ogre::HardwareBuffer::HBU_DYNAMIC_WRITE_ONLY);
  rests_ = manager.createVertexBuffer(7 * sizeof(float), corners_.size(), Ogre::HardwareBuffer::HBU_STATIC_WRITE_ONLY);
  data_->vertexBufferBinding->setBinding(0, places_);
  data_->vertexBufferBinding->setBinding(1, colours_);
  data_->vertexBufferBinding->setBinding(2, rests_);
}

void BodyShape::makeParts() {
  parts_.clear();
  for (std::size_t p = 0; p < indices_.size(); ++p) {
    parts_.push_back(nullptr);
    if (indices_[p].empty()) continue;
    parts_[p] = std::make_unique<BodyPart>(name_ + "_" + std::to_string(p), data_.get());
    parts_[p]->setTriangles(indices_[p]);
    node_->attachObject(parts_[p].get());
  }
}

void BodyShape::setColours(const meshless_surgery::Surface& surface, const meshless_surgery::BodyTopology* patterns,
                           const BodyLook& look) {
  const std::size_t vertices = surface.vertices.size() / 3;
  const bool strained = look.by_strain && surface.strain.size() == vertices;
  std::vector<Ogre::ColourValue> colours{toColour(surface.color), toColour(surface.inside_color)};
  for (const auto& colour : surface.region_colors) colours.push_back(toColour(colour));
  std::vector<std::uint8_t> bytes(4 * corners_.size());
  for (std::size_t c = 0; c < corners_.size(); ++c) {
    const Corner& corner = corners_[c];
    Ogre::ColourValue colour = colours[corner.tissue];
    if (strained) {
      colour = heatColour(surface.strain[corner.vertex] / look.full_strain);
    } else if (patterns && !look.shine) {  // which finds the patterns by itself
      const auto& baked = corner.tissue > 0 ? patterns->inside_colors : patterns->colors;
      if (baked.size() == 3 * vertices)
        for (int k = 0; k < 3; ++k) colour[k] = static_cast<float>(baked[3 * corner.vertex + k]) / 255.0f;
    }
    const float lamp = look.shine ? 1.0f : kLamp;
    const float channels[] = {
        lamp * colour.r, lamp * colour.g, lamp * colour.b,
        strained ? static_cast<float>(look.opacity) : colour.a * static_cast<float>(look.opacity)};
    for (int k = 0; k < 4; ++k)
      bytes[4 * c + k] = static_cast<std::uint8_t>(255.0f * std::clamp(channels[k], 0.0f, 1.0f) + 0.5f);
  }
  colours_->writeData(0, bytes.size(), bytes.data(), true);
}

// Places and normals at rest, what the faces around a corner measure there, and how far the edge of a cut is; nothing
// where that is not known, or of no account.
void BodyShape::setRest(const meshless_surgery::BodyTopology* patterns, const BodyLook& look) {
  rest_areas_.clear();
  floats_.assign(7 * corners_.size(), 0.0f);
  const bool wanted = look.shine && !look.by_strain, known = wanted && patterns && !patterns->rest.empty();
  const std::vector<float>& rest = known ? patterns->rest : at_;
  std::vector<float> from_rim(at_.size() / 3, kFarFromRim);
  if (wanted) from_rim = rimDistances(rest, triangles_, cut_, kFarFromRim);
  std::vector<Ogre::Vector3> faces(known ? cut_.size() : 0);
  for (std::size_t t = 0; t < faces.size(); ++t) {
    const std::uint32_t* corner = &triangles_[3 * t];
    const Ogre::Vector3 a = vertexOf(rest, corner[0]);
    faces[t] = (vertexOf(rest, corner[1]) - a).crossProduct(vertexOf(rest, corner[2]) - a);
  }
  if (known) rest_areas_.resize(corners_.size());
  for (std::size_t c = 0; c < corners_.size(); ++c) {
    float* to = &floats_[7 * c];
    to[6] = from_rim[corners_[c].vertex];
    if (!known) continue;
    Ogre::Vector3 normal = Ogre::Vector3::ZERO;
    float area = 0.0f;
    for (std::uint32_t i = starts_[c]; i < starts_[c + 1]; ++i) {
      normal += faces[around_[i]];
      area += faces[around_[i]].length();
    }
    normal.normalise();
    rest_areas_[c] = std::max(area, std::numeric_limits<float>::min());
    const auto& [u, v] = corners_[c].uv;
    const bool by_uv = !uv_.empty() && corners_[c].tissue == 0;
    for (const Ogre::Vector3& at : {by_uv ? Ogre::Vector3(u, v, 0.0f) : vertexOf(rest, corners_[c].vertex), normal})
      for (int axis = 0; axis < 3; ++axis) *to++ = at[axis];
  }
  rests_->writeData(0, floats_.size() * sizeof(float), floats_.data(), true);
}

void BodyShape::setMaterials(const meshless_surgery::Surface& surface, const meshless_surgery::BodyTopology* patterns,
                             const TissueTextures& textures, const BodyLook& look) {
  const double opacity = look.opacity * static_cast<double>(surface.color.a);
  const bool clear = opacity < 0.998;
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    if (!parts_[p]) continue;
    Ogre::Pass* pass = parts_[p]->pass();
    pass->setSceneBlending(clear ? Ogre::SBT_TRANSPARENT_ALPHA : Ogre::SBT_REPLACE);
    pass->setDepthWriteEnabled(opacity > kSeenThrough);
    // Through clear tissue what is behind it shows, not its own back side: that would be drawn in any order.
    // Otherwise what is open is seen from both sides.
    pass->setCullingMode(clear || closed_ ? Ogre::CULL_CLOCKWISE : Ogre::CULL_NONE);
    pass->setPolygonMode(look.wire ? Ogre::PM_WIREFRAME : Ogre::PM_SOLID);
    const meshless_surgery::Look& tissue = patterns && p < patterns->looks.size() ? patterns->looks[p] : plainLook();
    const float wetness = look.by_strain ? kDry : tissue.wetness;
    pass->removeAllTextureUnitStates();
    if (look.shine) {
      const TissueProgram& program = tissueProgram();
      const bool of_image = tissue.noise == meshless_surgery::Look::IMAGE;
      const Ogre::TexturePtr texture = of_image ? textures.find(tissue.image) : Ogre::TexturePtr();
      const bool patterned = patterns && !patterns->rest.empty() && !look.by_strain && tissue.scale > 0.0f &&
                             tissue.noise < program.patterned.size() && (tissue.noise > 0 || tissue.bump > 0.0f) &&
                             (texture || !of_image);
      pass->setVertexProgram(program.vertex);
      const bool by_uv = patterned && p == 0 && !uv_.empty();
      pass->setFragmentProgram(by_uv ? program.by_uv : patterned ? program.patterned[tissue.noise] : program.even);
      const auto vertex = pass->getVertexProgramParameters();
      vertex->setNamedAutoConstant("worldviewproj_matrix", Ogre::GpuProgramParameters::ACT_WORLDVIEWPROJ_MATRIX);
      vertex->setNamedAutoConstant("worldview_matrix", Ogre::GpuProgramParameters::ACT_WORLDVIEW_MATRIX);
      vertex->setNamedAutoConstant("view_matrix", Ogre::GpuProgramParameters::ACT_VIEW_MATRIX);
      vertex->setNamedAutoConstant("world_matrix", Ogre::GpuProgramParameters::ACT_WORLD_MATRIX);
      const auto fragment = pass->getFragmentProgramParameters();
      fragment->setIgnoreMissingParams(true);
      fragment->setNamedConstant("second", toColour(tissue.second));
      fragment->setNamedConstant("scale", by_uv ? 1.0f : tissue.scale);
      fragment->setNamedConstant("bump", tissue.bump);
      fragment->setNamedConstant("wetness", wetness);
      if (patterned && texture) {
        Ogre::TextureUnitState* unit = pass->createTextureUnitState();
        unit->setTexture(texture);
        unit->setTextureFiltering(Ogre::TFO_TRILINEAR);
        fragment->setNamedConstant("image", 0);
        fragment->setNamedConstant("aspect",
                                   static_cast<float>(texture->getWidth()) / static_cast<float>(texture->getHeight()));
      }
      continue;
    }
    pass->setVertexProgram("");
    pass->setFragmentProgram("");
    pass->setLightingEnabled(true);
    pass->setVertexColourTracking(Ogre::TVC_AMBIENT | Ogre::TVC_DIFFUSE);
    const float mirror = 0.5f * wetness;
    pass->setSpecular(mirror, mirror, mirror, 1.0f);
    pass->setShininess(80.0f * wetness);
    pass->setSelfIllumination(look.by_strain ? Ogre::ColourValue(0.12f, 0.12f, 0.12f)
                                             : toColour(surface.color) * kSelfLight);
  }
}

void BodyShape::shade(const ShadowTips& tips) {
  if (!look_.shine) return;
  for (const auto& part : parts_)
    if (part) part->pass()->getFragmentProgramParameters()->setNamedConstant("tips", tips[0].ptr(), tips.size());
}

void BodyShape::place() {
  floats_.resize(8 * corners_.size());
  Ogre::AxisAlignedBox box;
  float* to = floats_.data();
  for (std::size_t c = 0; c < corners_.size(); ++c) {
    const Ogre::Vector3 at = vertexOf(at_, corners_[c].vertex);
    Ogre::Vector3 normal = Ogre::Vector3::ZERO;
    float area = 0.0f;
    for (std::uint32_t i = starts_[c]; i < starts_[c + 1]; ++i) {
      normal += faces_[around_[i]];
      if (!rest_areas_.empty()) area += faces_[around_[i]].length();
    }
    normal.normalise();
    box.merge(at);
    for (const Ogre::Vector3& v : {at, normal})
      for (int axis = 0; axis < 3; ++axis) *to++ = v[axis];
    *to++ = rest_areas_.empty() ? 1.0f : area / rest_areas_[c];
    *to++ = pale_.empty() ? 0.0f : pale_[corners_[c].vertex];
  }
  places_->writeData(0, floats_.size() * sizeof(float), floats_.data(), true);
  for (const auto& part : parts_)
    if (part) part->setBounds(box);
}

void BodyShape::show(const meshless_surgery::Surface& surface, const meshless_surgery::BodyTopology* patterns,
                     const TissueTextures& textures, const BodyLook& look, bool at_once) {
  const std::size_t vertices = surface.vertices.size() / 3;
  if (patterns && !patterns->rest.empty() && patterns->rest.size() != surface.vertices.size()) patterns = nullptr;
  static const std::vector<float> none;
  const bool by_uv = patterns && !patterns->rest.empty() && patterns->uv.size() == 2 * surface.triangles.size() &&
                     !patterns->looks.empty() && patterns->looks[0].noise == meshless_surgery::Look::IMAGE;
  const std::vector<float>& uv = by_uv ? patterns->uv : none;
  const bool same = sameTriangles(surface) && uv == uv_;
  const bool whole = same || (3 * surface.cut.size() == surface.triangles.size() &&
                              std::all_of(surface.triangles.begin(), surface.triangles.end(),
                                          [vertices](std::uint32_t v) { return v < vertices; }));
  node_->setVisible(whole && !surface.triangles.empty());
  if (!whole || surface.triangles.empty()) return;
  const bool new_look = !same || (patterns != nullptr) != patterned_ || !(look == look_) || surface.color != color_ ||
                        surface.inside_color != inside_color_;
  if (!same) {
    uv_ = uv;
    findCorners(surface);
    parts_.clear();
    makeBuffers();
    makeParts();
  }
  if (new_look || look.by_strain) setColours(surface, patterns, look);
  if (new_look) {
    setRest(patterns, look);
    setMaterials(surface, patterns, textures, look);
    patterned_ = patterns != nullptr;
    look_ = look;
    color_ = surface.color;
    inside_color_ = surface.inside_color;
  }
  const bool pressed = pressedBy(surface);
  if (same && (pressed || surface.vertices != to_)) {
    from_ = at_;
    to_ = surface.vertices;
    moving_ = true;
  }
  if (moving_ && at_once)
    move(1.0f);
  else if (!same || new_look)
    place();
}

/// Whether that has changed. Between the pressures at the two ends of capillaries, 12 and 32 mmHg, blood is pressed out
/// of tissue (Landis 1930).
bool BodyShape::pressedBy(const meshless_surgery::Surface& surface) {
  std::vector<float> pale;
  if (surface.pressure.size() == surface.vertices.size() / 3)
    for (const float pressure : surface.pressure)
      pale.push_back(std::clamp((pressure - kVenous) / (kArterial - kVenous), 0.0f, 1.0f));
  const bool changed = pale != pale_;
  pale_.swap(pale);
  return changed;
}

void BodyShape::move(float share) {
  if (!moving_) return;
  moving_ = share < 1.0f;
  for (std::size_t k = 0; k < at_.size(); ++k) at_[k] = moving_ ? from_[k] + share * (to_[k] - from_[k]) : to_[k];
  findFaces();
  place();
}

}  // namespace meshless
