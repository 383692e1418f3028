// Where the blades will cut: the outline of their plane on every body that their rectangle meets.
#pragma once

#include <memory>
#include <vector>

#include <meshless_surgery/Surfaces.h>
#include <rviz/ogre_helpers/billboard_line.h>

namespace meshless {

constexpr float kLineWidth = 0.0015f;  // [m]

/// The blades as in ~cut, in the frame of the surfaces.
struct PreviewBlades {
  Ogre::Vector3 pivot = Ogre::Vector3::ZERO;
  Ogre::Vector3 reach = Ogre::Vector3::UNIT_X;  // unit, along the blades
  Ogre::Vector3 open = Ogre::Vector3::UNIT_Y;   // unit, in which they open
  double length = 0.0;                          // [m]; 0: without end
  double width = 0.0;                           // [m]; 0: without end
};

struct PreviewLine {
  Ogre::Vector3 from, to;
};

/// The lines in which the plane meets the bodies whose surface the rectangle meets: a cut severs these all the way.
std::vector<PreviewLine> linesOfCut(const meshless_surgery::Surfaces& surfaces, const PreviewBlades& blades);

class CutPreview {
 public:
  explicit CutPreview(Ogre::SceneManager* scene_manager);

  /// `width` [m]. The lines' frame is at `origin`, turned by `turn`.
  void show(const std::vector<PreviewLine>& lines, float width, const Ogre::Vector3& origin,
            const Ogre::Quaternion& turn);

 private:
  rviz::BillboardLine shown_;
  std::size_t capacity_ = 1;  // lines
};

}  // namespace meshless
