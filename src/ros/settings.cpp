#include "settings.h"

#include <algorithm>
#include <set>
#include <utility>

#include <XmlRpcValue.h>
#include <ros/names.h>
#include <ros/param.h>

#include "meshless_surgery/io/session_folder.h"
#include "border_check.h"
#include "frames.h"

namespace meshless {
namespace {

constexpr double kShortestAutosave = 0.05;  // [s] of simulated time

/// Reads parameters and remembers which ones it knows.
class Reader {
 public:
  explicit Reader(const ros::NodeHandle& handle) : handle_(handle) {}

  void read(const std::string& name, std::string& value) {
    XmlRpc::XmlRpcValue found;
    if (!get(name, found)) return;
    // roslaunch turns a name of digits into a number.
    if (found.getType() == XmlRpc::XmlRpcValue::TypeInt) {
      value = std::to_string(static_cast<int>(found));
    } else if (found.getType() == XmlRpc::XmlRpcValue::TypeString) {
      value = static_cast<std::string>(found);
    } else {
      wrongType(name, "a string");
    }
  }

  void read(const std::string& name, bool& value) {
    XmlRpc::XmlRpcValue found;
    if (!get(name, found)) return;
    if (found.getType() == XmlRpc::XmlRpcValue::TypeBoolean) {
      value = static_cast<bool>(found);
    } else {
      wrongType(name, "true or false");
    }
  }

  void read(const std::string& name, double& value, double min, double max, const std::string& unit) {
    XmlRpc::XmlRpcValue found;
    if (!get(name, found)) return;
    if (found.getType() == XmlRpc::XmlRpcValue::TypeInt) {
      value = static_cast<int>(found);
    } else if (found.getType() == XmlRpc::XmlRpcValue::TypeDouble) {
      value = static_cast<double>(found);
    } else {
      wrongType(name, "a number");
      return;
    }
    check.number("parameter ~" + name, value, min, max, unit);
  }

  void read(const std::string& name, std::optional<double>& value, double min, double max, const std::string& unit) {
    known_.insert(name);
    if (!handle_.hasParam(name)) return;
    double number = 0.0;
    read(name, number, min, max, unit);
    value = number;
  }

  void read(const std::string& name, std::vector<std::string>& value) {
    XmlRpc::XmlRpcValue found;
    if (!get(name, found)) return;
    if (found.getType() == XmlRpc::XmlRpcValue::TypeString) {
      value = {static_cast<std::string>(found)};
      if (value[0].empty()) value.clear();
      return;
    }
    if (found.getType() != XmlRpc::XmlRpcValue::TypeArray) {
      wrongType(name, "a list of strings");
      return;
    }
    for (int i = 0; i < found.size(); ++i) {
      if (found[i].getType() != XmlRpc::XmlRpcValue::TypeString) {
        wrongType(name + "[" + std::to_string(i) + "]", "a string");
        return;
      }
      value.push_back(static_cast<std::string>(found[i]));
    }
  }

  /// tf names are short and in one line. Empty where the name may be left out.
  void frame(const std::string& name, std::string& value) {
    read(name, value);
    const std::string given = std::exchange(value, withoutSlash(value));
    if (value.empty() && !given.empty())
      check.fault("parameter ~" + name + " is '" + printable(given) + "'; accepted: a frame's name");
    const bool plain = std::all_of(value.begin(), value.end(), [](unsigned char c) { return c >= ' ' && c != 0x7f; });
    if (plain && value.size() <= kMaxName) return;
    check.fault("parameter ~" + name + " is '" + printable(value) + "'; accepted: at most " + std::to_string(kMaxName) +
                " characters in one line");
  }

  /// A value where a group of parameters is expected would hide all of them.
  void group(const std::string& name) {
    XmlRpc::XmlRpcValue found;
    if (handle_.getParam(name, found) && found.getType() != XmlRpc::XmlRpcValue::TypeStruct)
      wrongType(name, "a group, such as " + name + "/" + (name == "tools" ? "silence" : "follow_frame"));
  }

  std::vector<std::string> unknown() const {
    std::vector<std::string> all;
    std::vector<std::string> unknown_names;
    if (!handle_.getParamNames(all)) return unknown_names;
    const std::string below = handle_.getNamespace() + "/";
    for (const std::string& full : all) {
      if (full.compare(0, below.size(), below) != 0) continue;
      const std::string name = full.substr(below.size());
      if (known_.count(name) == 0) unknown_names.push_back(name);
    }
    std::sort(unknown_names.begin(), unknown_names.end());
    return unknown_names;
  }

  BorderCheck check;

 private:
  bool get(const std::string& name, XmlRpc::XmlRpcValue& value) {
    known_.insert(name);
    return handle_.getParam(name, value);
  }
  void wrongType(const std::string& name, const std::string& wanted) {
    check.fault("parameter ~" + name + " is of the wrong type; accepted: " + wanted);
  }

  ros::NodeHandle handle_;
  std::set<std::string> known_{"diagnostic_period"};  // diagnostic_updater's
};

/// What both nodes have.
void readShared(Reader& reader, NodeSettings& settings) {
  reader.frame("world_frame", settings.world_frame);
  if (settings.world_frame.empty()) reader.check.fault("parameter ~world_frame is ''; accepted: a frame's name");
  reader.frame("tf_prefix", settings.tf_prefix);
  reader.read("session_directory", settings.session_directory);
}

}  // namespace

Result<NodeSettings> readReviewSettings(const ros::NodeHandle& private_handle, std::vector<std::string>& unknown) {
  NodeSettings settings;
  Reader reader(private_handle);
  readShared(reader, settings);
  reader.read("log", settings.command_log);
  if (settings.command_log.empty()) {
    reader.check.fault("parameter ~log is missing; accepted: the name of a log in the session directory, or a path");
  }
  if (!reader.check.ok()) return reader.check.error();
  unknown = reader.unknown();
  return settings;
}

Result<NodeSettings> readNodeSettings(const ros::NodeHandle& private_handle, std::vector<std::string>& unknown) {
  NodeSettings settings;
  Reader reader(private_handle);
  readShared(reader, settings);
  reader.read("scene", settings.scene);
  reader.read("task", settings.task);
  reader.read("trainee", settings.trainee);
  reader.read("data_folders", settings.data_folders);
  reader.read("command_log", settings.command_log);
  reader.read("autosave_period", settings.autosave_period, 0.0, 3600.0, "s");
  reader.read("paused", settings.paused);
  reader.read("publish_clock", settings.publish_clock);
  reader.read("max_backlog", settings.max_backlog, 0.0, 10.0, "s");
  reader.read("markers_rate", settings.markers_rate, 0.1, 30.0, "Hz");
  reader.read("surfaces_rate", settings.surfaces_rate, 0.1, 120.0, "Hz");
  reader.read("vertices_rate", settings.vertices_rate, 0.1, 120.0, "Hz");
  reader.read("points_rate", settings.points_rate, 0.1, 120.0, "Hz");
  reader.read("state_rate", settings.state_rate, 0.1, 1000.0, "Hz");
  reader.read("tools_rate", settings.tools_rate, 0.1, 1000.0, "Hz");
  reader.read("force_rate", settings.force_rate, 1.0, 2000.0, "Hz");
  reader.frame("tools/pick/follow_frame", settings.pick.follow_frame);
  reader.frame("tools/push/follow_frame", settings.push.follow_frame);
  reader.frame("tools/scissors/follow_frame", settings.scissors.follow_frame);
  reader.read("tools/pick/max_distance", settings.pick_max_distance, 1e-6, kMaxLength, "m");
  reader.read("tools/pick/stiffness", settings.pick_stiffness, 1e-3, 1e9, "N/m");
  reader.read("tools/push/radius", settings.push_radius, 1e-6, kMaxLength, "m");
  reader.read("tools/push/max_speed", settings.push_max_speed, 1e-6, 1e3, "m/s");
  reader.read("tools/pick/max_speed", settings.pick_max_speed, 1e-6, 1e3, "m/s");
  reader.read("tools/scissors/max_speed", settings.scissors_max_speed, 1e-6, 1e3, "m/s");
  reader.read("tools/silence", settings.tools_silence, 0.0, 3600.0, "s");
  reader.read("tools/scissors/length", settings.scissors_length, 1e-6, kMaxLength, "m");
  reader.read("tools/scissors/width", settings.scissors_width, 1e-6, kMaxLength, "m");
  for (const char* group : {"tools", "tools/pick", "tools/push", "tools/scissors"}) reader.group(group);
  if (settings.autosave_period > 0.0 && settings.autosave_period < kShortestAutosave) {
    reader.check.fault("parameter ~autosave_period is " + numberText(settings.autosave_period) +
                       "; accepted: 0 (none) or " + numberText(kShortestAutosave) + "..3600 s");
  }
  if (!settings.command_log.empty()) {
    const Status name = SessionFolder::checkName(settings.command_log);
    if (!name.ok()) reader.check.fault("parameter ~command_log: " + name.error().detail);
  }
  if (settings.trainee.size() > kMaxName || settings.trainee != printable(settings.trainee))
    reader.check.fault("parameter ~trainee is '" + printable(settings.trainee) + "'; accepted: up to " +
                       std::to_string(kMaxName) + " bytes of UTF-8 in one line");
  if (settings.scene.empty()) {
    reader.check.fault("parameter ~scene is empty; accepted: a scene's name, a path or package://");
  }
  if (!reader.check.ok()) return reader.check.error();
  unknown = reader.unknown();
  return settings;
}

}  // namespace meshless
