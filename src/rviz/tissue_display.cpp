#include "tissue_display.h"

#include <algorithm>
#include <limits>
#include <set>

#include <OgreSceneNode.h>
#include <rviz/display_context.h>
#include <rviz/frame_manager.h>
#include <rviz/properties/bool_property.h>
#include <rviz/properties/enum_property.h>
#include <rviz/properties/float_property.h>
#include <rviz/properties/string_property.h>
#include <pluginlib/class_list_macros.hpp>

#include "ogre_convert.h"
#include "tissue_program.h"

namespace meshless {
namespace {

enum Colouring { kByMaterial, kByStrain };

constexpr float kLongestWait = 0.5f;  // [s] for the topology of a surface, before it is shown plain
constexpr float kTipWidth = 0.004f;   // [m] of jaws and blades
constexpr float kSmallestOrgan = 1e-3f, kLargestOrgan = 2.0f;  // [m] of organs

// [m] the longest side of what it spans.
float lengthOf(const meshless_surgery::Surface& surface) {
  float longest = 0.0f;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    float low = std::numeric_limits<float>::max(), high = std::numeric_limits<float>::lowest();
    for (std::size_t i = axis; i < surface.vertices.size(); i += 3) {
      low = std::min(low, surface.vertices[i]);
      high = std::max(high, surface.vertices[i]);
    }
    longest = std::max(longest, high - low);
  }
  return longest;
}

std::map<std::string, meshless_surgery::Surfaces::ConstPtr>& heardSurfaces() {
  static std::map<std::string, meshless_surgery::Surfaces::ConstPtr> heard;
  return heard;
}

}  // namespace

meshless_surgery::Surfaces::ConstPtr shownSurfaces(const std::string& topic) {
  const auto found = heardSurfaces().find(topic);
  return found != heardSurfaces().end() ? found->second : nullptr;
}

TissueDisplay::TissueDisplay() {
  node_ = new rviz::StringProperty("Node", "/deformer", "The deformer node that is shown.", this, SLOT(listen()));
  colour_ = new rviz::EnumProperty("Colour by", "Material", "Strain: blue is undeformed, red the full strain.", this,
                                   SLOT(listen()));
  colour_->addOption("Material", kByMaterial);
  colour_->addOption("Strain", kByStrain);
  full_strain_ = new rviz::FloatProperty("Full strain", 0.3f, "Change of length, as a share, that is shown red.",
                                         colour_, SLOT(changeLook()), this);
  full_strain_->setMin(0.001f);
  opacity_ = new rviz::FloatProperty("Opacity", 1.0f, "Of the bodies.", this, SLOT(changeLook()));
  opacity_->setMin(0.05f);
  opacity_->setMax(1.0f);
  wire_ = new rviz::BoolProperty("Wireframe", false, "The edges of the triangles alone.", this, SLOT(changeLook()));
  shine_ =
      new rviz::BoolProperty("Shine", true,
                             "Lamps at the camera and above, wet tissue, patterns for each pixel. Without it: rviz's "
                             "light, patterns for each vertex.",
                             this, SLOT(changeLook()));
  smooth_ = new rviz::BoolProperty("Smooth motion", true,
                                   "Between two messages, what moves is shown on its way: one message late. Without "
                                   "it: in steps, as messages come.",
                                   this, SLOT(changeLook()));
  tools_shown_ = new rviz::BoolProperty("Tools", true, "Instruments, springs, push sphere.", this, SLOT(changeLook()));
  full_force_ = new rviz::FloatProperty("Full force", 20.0f, "Force [N] of a spring that is shown red.", tools_shown_,
                                        SLOT(changeLook()), this);
  full_force_->setMin(0.001f);
  shadows_ = new rviz::BoolProperty("Shadows", true,
                                    "Of the tips of instruments on tissue below them, to judge depth. Needs Shine.",
                                    tools_shown_, SLOT(changeLook()), this);
}

TissueDisplay::~TissueDisplay() { heardSurfaces().erase(topic_); }

void TissueDisplay::onEnable() { listen(); }

void TissueDisplay::onDisable() {
  heardSurfaces().erase(topic_);
  subscriber_.shutdown();
  topology_subscriber_.shutdown();
  images_subscriber_.shutdown();
  bodies_.clear();
}

void TissueDisplay::reset() {
  Display::reset();
  bodies_.clear();
  surfaces_.reset();
  drawn_.reset();
  patterns_.clear();
  topology_.reset();
}

void TissueDisplay::listen() {
  if (!isEnabled() || !initialized()) return;
  std::string error;
  std::string node = node_->getStdString();
  if (node.empty() || !ros::names::validate(node, error)) node = "/deformer";
  // A remapping of the node's name alone moves the display, as it does the tools.
  heardSurfaces().erase(topic_);
  topic_ = ros::names::resolve(node) + (colour_->getOptionInt() == kByStrain ? "/strained_surfaces" : "/surfaces");
  setStatus(rviz::StatusProperty::Warn, "Topic", "no message from " + QString::fromStdString(topic_) + " yet");
  subscriber_ = update_nh_.subscribe<meshless_surgery::Surfaces>(
      topic_, 1, [this](const meshless_surgery::Surfaces::ConstPtr& surfaces) {
        heardSurfaces()[topic_] = surfaces;
        if (!surfaces_ || surfaces_->run != surfaces->run) bodies_.clear();
        surfaces_ = surfaces;
        fresh_ = true;
      });
  topology_subscriber_ = update_nh_.subscribe<meshless_surgery::Topology>(
      ros::names::resolve(node) + "/topology", 1, [this](const meshless_surgery::Topology::ConstPtr& topology) {
        next_topology_ = topology;
        changeLook();
      });
  images_subscriber_ = update_nh_.subscribe<meshless_surgery::TissueImages>(
      ros::names::resolve(node) + "/images", 1, [this](const meshless_surgery::TissueImages::ConstPtr& images) {
        textures_.take(*images);
        ++images_taken_;
        changeLook();
      });
}

void TissueDisplay::changeLook() { fresh_ = surfaces_ != nullptr; }

void TissueDisplay::update(float wall_dt, float) {
  if (!surfaces_) return;
  Ogre::Vector3 position;
  Ogre::Quaternion orientation;
  if (!context_->getFrameManager()->getTransform(surfaces_->header.frame_id, ros::Time(), position, orientation)) {
    setStatus(rviz::StatusProperty::Error, "Transform",
              "no transform from " + QString::fromStdString(surfaces_->header.frame_id) + " to " + fixed_frame_);
    return;
  }
  deleteStatus("Transform");
  scene_node_->setPosition(position);
  scene_node_->setOrientation(orientation);
  // Once a frame, however fast messages come. Pieces wait for their looks, which come on a topic of their own.
  if (fresh_) {
    const bool known = findPatterns();
    waited_ = known ? 0.0f : waited_ + wall_dt;
    if (known || waited_ > kLongestWait) draw();
  }
  if (pace_.moving()) move(wall_dt);
}

bool TissueDisplay::findPatterns() {
  if (surfaces_->topology == 0) return true;  // of a node that has none
  if (next_topology_ && next_topology_ != topology_ && next_topology_->run == surfaces_->run &&
      next_topology_->topology == surfaces_->topology) {
    topology_ = next_topology_;
    patterns_.clear();
    for (const auto& body : topology_->bodies) patterns_[body.id] = &body;
  }
  return topology_ && topology_->run == surfaces_->run && topology_->topology == surfaces_->topology;
}

void TissueDisplay::draw() {
  fresh_ = false;
  BodyLook look;
  look.by_strain = colour_->getOptionInt() == kByStrain;
  look.full_strain = full_strain_->getFloat();
  look.opacity = opacity_->getFloat();
  look.wire = wire_->getBool();
  look.shine = shine_->getBool() && tissueProgram().usable();
  if (shine_->getBool() && !look.shine)
    setStatus(rviz::StatusProperty::Warn, "Shine", QString::fromStdString(tissueProgram().refused));
  else
    deleteStatus("Shine");
  const bool known = findPatterns();
  look.topology = known ? surfaces_->topology : 0;
  look.images = images_taken_;
  const bool another = surfaces_ != drawn_;
  const bool follows = drawn_ && drawn_->run == surfaces_->run && drawn_->topology == surfaces_->topology;
  const double interval = follows ? (surfaces_->header.stamp - drawn_->header.stamp).toSec() : 0.0;
  if (another) pace_.next(smooth_->getBool() ? interval : 0.0);
  if (another) {
    tools_from_ = std::move(tools_between_);
    tools_to_ = *surfaces_;
    tools_to_.bodies.clear();
    tools_between_ = tools_to_;
  }
  drawn_ = surfaces_;
  std::set<std::uint32_t> seen;
  std::size_t triangles = 0;
  bool others = false;
  for (const auto& surface : surfaces_->bodies) {
    seen.insert(surface.id);
    triangles += surface.cut.size();
    auto& shape = bodies_[surface.id];
    if (!shape) {
      shape = std::make_unique<BodyShape>(scene_manager_, scene_node_);
      others = true;
    }
    const auto patterns = known ? patterns_.find(surface.id) : patterns_.end();
    shape->show(surface, patterns == patterns_.end() ? nullptr : patterns->second, textures_, look, !pace_.moving());
  }
  if (another && pace_.moving()) {
    tools_from_.header = tools_to_.header;
    const bool moving =
        !(tools_from_ == tools_to_) ||
        std::any_of(bodies_.begin(), bodies_.end(), [](const auto& body) { return body.second->moving(); });
    if (!moving) pace_.next(0.0);
  }
  if (others) warnOfSize();
  for (auto it = bodies_.begin(); it != bodies_.end();)
    it = seen.count(it->first) > 0 ? std::next(it) : bodies_.erase(it);
  showTools();
  setStatus(rviz::StatusProperty::Ok, "Topic",
            QString("%1 bodies, %2 triangles").arg(surfaces_->bodies.size()).arg(triangles));
  context_->queueRender();
}

void TissueDisplay::move(float wall_dt) {
  const float share = pace_.go(wall_dt);
  for (const auto& body : bodies_) body.second->move(share);
  moveTools(tools_from_, tools_to_, share, tools_between_);
  showTools();
  context_->queueRender();
}

void TissueDisplay::showTools() {
  const ShadowTips tips = shadowTips();
  for (const auto& body : bodies_) body.second->shade(tips);
  if (!tools_shown_->getBool()) return tools_.reset();
  if (!tools_) tools_ = std::make_unique<ToolsShape>(scene_manager_, scene_node_);
  tools_->show(tools_between_, full_force_->getFloat());
}

ShadowTips TissueDisplay::shadowTips() const {
  ShadowTips tips;
  tips.fill(Ogre::Vector4::ZERO);
  if (!tools_shown_->getBool() || !shadows_->getBool()) return tips;
  std::size_t count = 0;
  const auto add = [&](const Ogre::Vector3& at, float wide) {
    if (count == tips.size()) return;
    const Ogre::Vector3 tip = scene_node_->getPosition() + scene_node_->getOrientation() * at;
    tips[count++] = Ogre::Vector4(tip.x, tip.y, tip.z, wide);
  };
  const meshless_surgery::Surfaces& tools = tools_between_;
  if (tools.scissors_shown)
    add(toOgre(tools.scissors.position) +
            toOgre(tools.scissors.orientation) * Ogre::Vector3(static_cast<float>(tools.scissors_length), 0, 0),
        kTipWidth);
  if (tools.push_shown) add(toOgre(tools.push_position), static_cast<float>(tools.push_radius));
  for (const auto& pick : tools.picks) add(toOgre(pick.position), kTipWidth);
  return tips;
}

// A mesh in millimetres fills the view, or is a dot in it.
void TissueDisplay::warnOfSize() {
  const meshless_surgery::Surface* largest = nullptr;
  float length = 0.0f;
  for (const auto& surface : surfaces_->bodies)
    if (const float here = lengthOf(surface); here > length) {
      largest = &surface;
      length = here;
    }
  if (!largest || (length >= kSmallestOrgan && length <= kLargestOrgan)) return deleteStatus("Size");
  setStatus(rviz::StatusProperty::Warn, "Size",
            QString("%1 is %2 m long; organs are %3 to %4 m: see scale and units")
                .arg(QString::fromStdString(largest->name))
                .arg(length, 0, 'g', 3)
                .arg(kSmallestOrgan)
                .arg(kLargestOrgan));
}

}  // namespace meshless

PLUGINLIB_EXPORT_CLASS(meshless::TissueDisplay, rviz::Display)
