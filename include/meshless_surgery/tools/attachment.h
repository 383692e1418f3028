// What holds organs together: connective tissue between two bodies, or of one and what does not move.
#pragma once

#include <optional>

#include "meshless_surgery/base/ids.h"
#include "meshless_surgery/contact/row_solver.h"

namespace meshless {

/// Stands for a piece of connective tissue: it pulls along itself where it is longer than it was when it was made, and
/// never pushes.
struct Fibre {
  BodyId a, b;  // b is of no body where the other end is a place
  BodyPoint at_a, at_b;
  Vec3 place = Vec3::Zero();  // [m] that place
  double area = 0.0;          // [m^2] of the surface that it stands for
  double rest = 0.0;          // [m] length
  Vec3 force = Vec3::Zero();  // [N] on a, in the last substep
  double tension = 0.0;       // [N] mean over the last step
};

/// What makes an attachment of a body to itself a clip: two jaws that close what is hollow between them.
struct Clip {
  double jaws = 0.0;    // [m] how wide what is between them may be; falls to `closed`
  double closed = 0.0;  // [m]
  double tissue = 0.0;  // [m] between the jaws, when they are closed
};

struct Attachment {
  std::string name;
  std::string other;               // the obstacle, or "world"; empty between bodies
  double stiffness = 0.0;          // [N/m^3]
  std::optional<double> strength;  // [Pa] at which a fibre tears; empty: never
  std::uint32_t made = 0;          // fibres
  bool torn = false;               // some of it
  std::optional<Clip> clip;        // its fibres are between walls of a lumen
  std::vector<Fibre> fibres;       // that are whole
};

/// A force that was applied to a patch of tissue.
struct AppliedForce {
  struct Point {
    BodyId body;
    BodyPoint at;
    double share = 0.0;  // of the force
  };
  Vec3 force = Vec3::Zero();  // [N]
  double left = 0.0;          // [s]
  std::vector<Point> points;
};

/// Other end of an attachment that is no body and no obstacle: places of the world.
inline const std::string kWorldEnd = "world";

}  // namespace meshless
