// Tools that streams move: each goes where its stream says at a bounded speed, and is lifted off when the stream falls
// silent. No ROS in here but the clock: see ToolInputs for the topics and frames.
#pragma once

#include <array>
#include <map>
#include <functional>
#include <mutex>

#include "clock.h"
#include "settings.h"
#include "tool_motion.h"
#include "meshless_surgery/world/world.h"

namespace meshless {

constexpr double kJawOpen = 0.1;     // [rad] the jaw must have been opened beyond ...
constexpr double kJawClosed = 0.02;  // [rad] ... and close below, to cut
constexpr double kBlades = 0.06;     // [m] length and width of blades for large bodies

/// Length and width of blades for a body [m]: three times what it is wide, which is the middle one of its extents along
/// its principal axes; at most kBlades.
double bladesFor(const Points& surface);

/// Whether a tool hears its stream, in CRTK's words.
enum class Operating { kDisabled, kEnabled, kPaused };
const char* toString(Operating state);

class StreamedTools {
 public:
  /// Has a job done between two steps, later or at once, without waiting for it: WorldRunner::post.
  using Post = std::function<void(std::function<void(World&)>)>;
  /// A cut of the jaw that was refused.
  using Refused = std::function<void(const Error&)>;

  /// `clock` outlives it.
  StreamedTools(const NodeSettings& settings, const Clock& clock, Post post, Refused refused);

  /// What a stream said; `stamp` is its own [s], 0 where it has none. Refused as by ToolMotion::hear, and where the
  /// tool is not enabled. Else a warning for people: of a jump that no hand makes; empty: none.
  Result<std::string> hear(ToolKind tool, const Pose& pose, double stamp);
  /// The opening of the jaw [rad]. Closed after it was open: all that the blades meet is cut. Refused where the
  /// scissors are not enabled.
  Status hearJaw(double angle);
  /// To be called at least every ToolMotion::kLongestTick: tools go on, and those whose streams are silent are lifted.
  void look();

  /// One of CRTK's: enable, disable (what its stream placed is lifted), pause (it stays where it is), resume, home.
  /// Refused kInvalidArgument where the word is not known or does not fit the state.
  Status command(ToolKind tool, const std::string& word);
  struct Condition {
    Operating state = Operating::kEnabled;
    bool busy = false;  // it is on its way to where its stream wants it
  };
  Condition condition(ToolKind tool) const;
  /// Of an instrument of the scene, which has its own streams; nothing: it is gone.
  void noteInstrument(const std::string& name, std::optional<Operating> state);
  /// Which tools and instruments do not hear their streams: a part of a sentence that begins with "; ", empty where all do. A reset
  /// leaves it so.
  std::string notEnabled() const;

  /// Where its stream last wanted a tool, while the stream speaks.
  std::optional<Pose> hand(ToolKind tool) const;

 private:
  struct Tool {
    std::string name;
    ToolKind kind;
    double max_speed;  // [m/s]
    ToolMotion motion;
    Operating state = Operating::kEnabled;
    bool posted = false;  // a move waits for the world: no second one behind it
  };

  static Error deaf(const Tool& tool);
  void postMove(Tool& tool);
  void move(Tool& tool, World& world);
  void movePick(Tool& tool, World& world);
  void movePush(Tool& tool, World& world);
  void moveScissors(Tool& tool, World& world);
  ScissorBlades blades(const Pose& pose) const;
  void halt(Tool& tool);
  void lift(Tool& tool, const std::string& why);

  const NodeSettings settings_;
  const Clock& clock_;
  const Post post_;
  const Refused refused_;

  mutable std::mutex mutex_;  // of all below; the posted jobs take it too
  std::array<Tool, 3> tools_;
  std::map<std::string, Operating> deaf_instruments_;
  double jaw_angle_ = 0.5;  // [rad]
  bool jaw_armed_ = false;
};

}  // namespace meshless
