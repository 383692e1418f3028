// What metrics and tasks are told of a world, once a step. The running node and a replay of its log make it by the same
// function, so that what is computed from it is equal to the bit.
#pragma once

#include <limits>
#include <optional>

#include "meshless_surgery/world/world.h"

namespace meshless {

/// A hand is a tool that is moved: of the picks that are not locked the oldest, and the next one; the push sphere; the
/// scissors; of the instruments the first two that have been moved.
enum class Hand { kPick, kSecondPick, kPush, kScissors, kInstrument, kSecondInstrument };
constexpr std::size_t kHands = 6;
const char* toString(Hand hand);

struct TrainingFrame {
  /// Where a body is in the picture of an endoscope. The body is taken for a sphere about the middle of its bounds.
  struct Shown {
    std::string body;
    double off_centre = 0.0;  // [1] of its middle: 0 in the middle of the picture, 1 at its rim
    double fills = 0.0;       // [1] how wide it is, over the width of the picture
    bool hidden = false;      // another body or an obstacle is in front of its middle
  };
  struct Tool {
    ToolKind kind = ToolKind::kPick;
    std::uint32_t pick = 0;        // its number, as that of an instrument
    bool locked = false;           // of a pick
    std::string body;              // that a pick or jaws hold
    Vec3 position = Vec3::Zero();  // [m] of the hand: the free end, the centre, the pivot; of an instrument its tip
    std::optional<Quat> turned;    // of the scissors and of instruments
    // [m] where it works: a pick's end in the tissue, the tips of blades that have an end; of an instrument the other
    // end of its shaft
    Vec3 tissue = Vec3::Zero();
    double radius = 0.0;  // [m] of what is solid about the line from `position` to there
    double force = 0.0;   // [N] between tool and tissue, mean over the step
    Vec3 touch =
        Vec3::Zero();  // [m] of the push sphere: the foremost place of it in the tissue; of instruments the tip
    std::vector<Shown> shown{};  // by an endoscope, of the bodies that are to be seen
  };
  struct Body {
    std::string name;
    std::uint32_t number = 0;
    BodyModelPtr model;
    Pose placed;                    // from the model's frame to the rest shape's place
    Vec3 centre = Vec3::Zero();     // [m] of mass, now; where wanted
    std::vector<double> strains{};  // strainsOf() it; where wanted
    // Where what is put on obstacles is wanted: those that it is around, and whether anything but tools presses on it.
    std::vector<std::string> around{};
    bool supported = false;
  };
  struct Joint {
    std::string name;
    std::vector<std::string> ends;
    std::size_t fibres = 0;
    std::optional<Vec3> clip;  // [m] of a clip: the middle of its jaws in the rest shape, where it was put
  };
  std::uint64_t step = 0;
  std::uint32_t run = 0;                                   // grows with each reset and each loaded state
  double time = 0.0;                                       // [s] simulated
  double dt = 0.0;                                         // [s] of the step
  double wall = std::numeric_limits<double>::quiet_NaN();  // [s] World::wallTime
  Vec3 down = Vec3::Zero();                                // unit, that gravity has; zero without any
  std::vector<Tool> tools;
  std::vector<Body> bodies;
  std::vector<Joint> joints;  // attachments
  std::vector<Event> events;  // since the frame before
  bool sampled = false;       // centres and strains are there, where they are wanted
  bool centres = false;       // they are there
  bool places = false;        // what bodies are around is there
  bool pictures = false;      // what endoscopes show is there
};

/// What costs something, and is looked at ten times a second where a task needs it.
struct FrameWants {
  bool centres = false, strains = false;
  std::vector<std::string> placed;  // bodies that are to be put on obstacles; what supports them is there in each step
  std::vector<std::string> seen;    // bodies that an endoscope is to show

  bool any() const { return centres || strains || !placed.empty() || !seen.empty(); }
};

/// After a step. `events`: what World::takeEvents has given since the frame before.
TrainingFrame frameOf(World& world, std::vector<Event> events, const FrameWants& wants);

/// A piece of `whole`, or itself: names of pieces are those of their parents and a number.
bool isOf(const std::string& body, const std::string& whole);

/// Whether a surface is all around the axis of an obstacle, between its two ends: a ring that was put on a peg. The
/// axis is along the longest extent of the obstacle, through its middle. Tissue beyond the ends does not count; where
/// the axis meets tissue between them, that is on no peg.
bool isAround(const TriangleMesh& obstacle, const Points& surface, const std::vector<Triangle>& triangles);

/// The cells of a body, or its clusters where it has none.
struct TissuePart {
  double mass = 0.0;           // [kg]
  Vec3 centre = Vec3::Zero();  // [m] at rest
};
Index tissueParts(const BodyModel& model);
TissuePart tissuePart(const BodyModel& model, Index part);

/// Of a body whose particles are at `positions`: |stretch - 1| [1] of each of its parts, the largest of its principal
/// directions; 0 of crumbs.
std::vector<double> strainsOf(const BodyModel& model, const Points& positions);

/// What should not happen to a trainee.
bool isError(EventType type);
/// Worth a mark on a line of time.
bool isShown(EventType type);

}  // namespace meshless
