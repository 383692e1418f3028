#include "clip_tool.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <OgreMatrix3.h>
#include <meshless_surgery/Clip.h>
#include <meshless_surgery/Unclip.h>
#include <rviz/properties/float_property.h>
#include <pluginlib/class_list_macros.hpp>

#include "cut_preview.h"
#include "ogre_convert.h"
#include "tissue_display.h"

namespace meshless {
namespace {

constexpr double kNearClip = 25.0;  // [px] from the middle of a clip
constexpr double kClipWidth = 0.005, kClipOpening = 0.02;  // [m] as ~clip takes them where none are given
constexpr float kBeside = 0.0006f;  // [m] that the jaws are drawn beside the tissue

/// Which way a vessel runs at a place: along that, its surface is turned least. Zero where there is none within reach.
Ogre::Vector3 wayOf(const meshless_surgery::Surface& surface, const Ogre::Vector3& place, float reach) {
  Ogre::Matrix3 turns = Ogre::Matrix3::ZERO;
  float area = 0.0f;
  for (std::size_t t = 0; t + 2 < surface.triangles.size(); t += 3) {
    const Ogre::Vector3 a = vertexOf(surface, surface.triangles[t]), b = vertexOf(surface, surface.triangles[t + 1]),
                        c = vertexOf(surface, surface.triangles[t + 2]);
    if (!(((a + b + c) / 3.0f).squaredDistance(place) <= reach * reach)) continue;
    Ogre::Vector3 normal = (b - a).crossProduct(c - a);
    const float size = normal.normalise();
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) turns[i][j] += size * normal[i] * normal[j];
    area += size;
  }
  if (!(area > 0.0f)) return Ogre::Vector3::ZERO;
  Ogre::Real sizes[3];
  Ogre::Vector3 axes[3];
  (turns * (1.0f / area)).EigenSolveSymmetric(sizes, axes);
  return axes[std::min_element(sizes, sizes + 3) - sizes];
}

}  // namespace

ClipTool::ClipTool() : HandTool('l') {}

void ClipTool::onInitialize() {
  HandTool::onInitialize();
  width_ = new rviz::FloatProperty("Width", kClipWidth, "[m] of the jaws, along the vessel.", getPropertyContainer());
  opening_ = new rviz::FloatProperty("Opening", kClipOpening, "[m] of the jaws; they reach as far across.",
                                     getPropertyContainer());
  for (rviz::FloatProperty* length : {width_, opening_}) {
    length->setMin(0.0005f);
    length->setMax(0.1f);
  }
}

void ClipTool::onActivate() {
  asking_ = removing_ = false;
  surfaces_ = shownSurfaces(link().nameOf("surfaces"));
  surfaces_topic_ = link().handle().subscribe<meshless_surgery::Surfaces>(
      link().nameOf("surfaces"), 1,
      [this](const meshless_surgery::Surfaces::ConstPtr& surfaces) { surfaces_ = surfaces; });
}

void ClipTool::onDeactivate() {
  surfaces_topic_.shutdown();
  surfaces_.reset();
  shown_.reset();
  clips_.clear();
}

void ClipTool::stateCame(const meshless_surgery::State& state) {
  clips_.clear();
  for (const auto& attachment : state.attachments)
    if (attachment.jaws > 0.0 && attachment.fibres > 0) clips_.push_back({attachment.name, toFixed(attachment.middle)});
}

const ClipTool::Clip* ClipTool::clipUnderCursor() const {
  const Clip* nearest = nullptr;
  double best = kNearClip;
  for (const Clip& clip : clips_) {
    const double pixels = pixelsTo(clip.middle);
    if (pixels > best) continue;
    best = pixels;
    nearest = &clip;
  }
  return nearest;
}

bool ClipTool::onMouse(rviz::ViewportMouseEvent& event) {
  removing_ = event.shift();
  if (!event.leftDown()) return event.left();
  if (removing_) {
    takeOff();
  } else {
    putOn();
  }
  return true;
}

std::optional<ClipTool::Jaws> ClipTool::jawsUnderCursor() const {
  if (!seen() || !hover().over || !surfaces_) return std::nullopt;
  const auto surface = std::find_if(surfaces_->bodies.begin(), surfaces_->bodies.end(), [this](const auto& body) {
    return QString::fromStdString(body.name) == hover().body;
  });
  if (surface == surfaces_->bodies.end()) return std::nullopt;
  Ogre::Vector3 origin;
  Ogre::Quaternion turn;
  worldPose(origin, turn);
  const Ogre::Vector3 place = turn.Inverse() * (hover().position - origin), view = turn.Inverse() * viewDirection();
  const float reach = 0.5f * opening_->getFloat();
  Jaws jaws;
  jaws.along = wayOf(*surface, place, reach);
  jaws.across = view.crossProduct(jaws.along);
  // A vessel that runs straight away from the viewer: no way in the picture is better than another.
  if (!(jaws.across.normalise() > 0.1f)) return std::nullopt;
  const Ogre::Vector3 away = jaws.along.crossProduct(jaws.across);
  Ogre::Vector3 low(std::numeric_limits<float>::max()), high = -low;
  // The vessel's section at the place.
  for (std::size_t c = 0; c < surface->triangles.size(); ++c) {
    const std::uint32_t next = surface->triangles[c % 3 == 2 ? c - 2 : c + 1];
    const Ogre::Vector3 a = vertexOf(*surface, surface->triangles[c]) - place, b = vertexOf(*surface, next) - place;
    const float from = a.dotProduct(jaws.along), to = b.dotProduct(jaws.along);
    if ((from < 0.0f) == (to < 0.0f)) continue;
    const Ogre::Vector3 way = a + (b - a) * (from / (from - to));
    if (way.length() > 2.0f * reach) continue;
    const Ogre::Vector3 own(0.0f, way.dotProduct(jaws.across), way.dotProduct(away));
    low.makeFloor(own);
    high.makeCeil(own);
  }
  if (!(low.y < high.y)) return std::nullopt;
  jaws.half = Ogre::Vector3(0.5f * width_->getFloat(), 0.5f * (high.y - low.y) + kBeside, 0.5f * (high.z - low.z));
  jaws.middle = place + 0.5f * (low.y + high.y) * jaws.across + 0.5f * (low.z + high.z) * away;
  return jaws;
}

void ClipTool::onUpdate(double) { showJaws(removing_ ? std::nullopt : jawsUnderCursor()); }

void ClipTool::showJaws(const std::optional<Jaws>& jaws) {
  if (!jaws) return shown_.reset();
  if (!shown_) {
    shown_ = std::make_unique<rviz::BillboardLine>(scene_manager_);
    shown_->setLineWidth(0.5f * kLineWidth);
    shown_->setColor(0.2f, 0.9f, 1.0f, 1.0f);
    shown_->setMaxPointsPerLine(5);
    shown_->setNumLines(2);
  }
  Ogre::Vector3 origin;
  Ogre::Quaternion turn;
  worldPose(origin, turn);
  shown_->clear();
  shown_->setPosition(origin);
  shown_->setOrientation(turn);
  const Ogre::Vector3 away = jaws->half.z * jaws->along.crossProduct(jaws->across), along = jaws->half.x * jaws->along;
  for (const float side : {-1.0f, 1.0f}) {
    const Ogre::Vector3 jaw = jaws->middle + side * jaws->half.y * jaws->across;
    if (side > 0.0f) shown_->newLine();
    for (const Ogre::Vector3& corner :
         {jaw - along - away, jaw + along - away, jaw + along + away, jaw - along + away, jaw - along - away})
      shown_->addPoint(corner);
  }
}

void ClipTool::putOn() {
  if (asking_) return;
  const auto jaws = jawsUnderCursor();
  if (!jaws) {
    say(hover().over ? "the vessel runs straight away from the viewer: turn the view" : "a clip goes on a vessel");
    return;
  }
  meshless_surgery::Clip wish;  // in the node's world frame
  wish.request.body = hover().body.toStdString();
  wish.request.point = toPoint(jaws->middle);
  wish.request.direction = toVector(jaws->across);
  wish.request.width = width_->getFloat();
  wish.request.opening = opening_->getFloat();
  asking_ = true;
  link().call("clip", wish, [this](const meshless_surgery::Clip::Response& answer) {
    asking_ = false;
    say(answer.success ? QString::fromStdString(answer.name) + " is on" : QString::fromStdString(answer.message));
  });
}

void ClipTool::takeOff() {
  const Clip* clip = clipUnderCursor();
  if (!clip) {
    say("no clip there");
    return;
  }
  meshless_surgery::Unclip wish;
  wish.request.name = clip->name;
  const QString name = QString::fromStdString(clip->name);
  link().call("unclip", wish, [this, name](const meshless_surgery::Unclip::Response& answer) {
    say(answer.success ? name + " is off" : QString::fromStdString(answer.message));
  });
}

QString ClipTool::help() const {
  return "<b>Left:</b> put a clip on the vessel.  <b>Shift+left:</b> take one off.  <b>Middle, right, wheel:</b> view. "
         " "
         "<b>R:</b> clear all springs.";
}

}  // namespace meshless

PLUGINLIB_EXPORT_CLASS(meshless::ClipTool, rviz::Tool)
