// An instrument as contact sees it.
#pragma once

#include <memory>

#include "meshless_surgery/contact/contact_surface.h"
#include "meshless_surgery/tools/instrument.h"

namespace meshless {

struct InstrumentBody {
  explicit InstrumentBody(const InstrumentDef& def);

  std::shared_ptr<const InstrumentShape> shape;
  ContactSurface surface;
  std::vector<double> inverse_masses;  // [1/kg] 0, one a vertex
  Points positions;                    // [m] vertices now, and an edge
  Points before;                       // [m] at the start of the substep
  Points velocities;                   // [m/s] of the part of the frame that comes
  Pose hand_then;                      // where the hand gets in this frame
  double jaw_then = 0.0;               // [rad] likewise
  bool still = false;                  // it and its hand
  bool rests = false;                  // so does all that it touches
  bool felt = false;                   // in this frame, what is awake
  bool stepped = false;                // in this part of the frame, with what it touches
  Vec3 blocked = Vec3::Zero();         // [N] by the ground and obstacles, in the last substep
  double gone = 0.0;                   // [m] farthest ways of vertices in substeps, summed up
  std::vector<double> clear;           // [m] of `gone`, one a vertex: before it cannot be in an obstacle
  struct Pressed {
    Index body = 0;              // collider
    std::array<double, 2> on{};  // [N] on the inside of the jaws, mean over the step
    Vec3 at = Vec3::Zero();      // [m] where, in the mean: over `weight`
    double weight = 0.0;
  };
  std::vector<Pressed> pressed;
  std::vector<char> met;  // one a body: scratch

  void place(const Instrument& of);
};

}  // namespace meshless
