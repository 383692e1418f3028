#include "meshless_surgery/io/task.h"

#include <sys/stat.h>
#include <zlib.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <regex>

#include "meshless_surgery/base/number_text.h"
#include "opened_file.h"
#include "region_yaml.h"

namespace meshless {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostStages = 100, kMostForbidden = 100, kMostCorners = 1000, kMostNames = 100;
constexpr int kCircleParts = 72;
constexpr std::size_t kMostPicture = 2 << 20, kMostTask = 1 << 20;  // bytes
const std::vector<std::string> kTools{"pick", "push", "scissors", "instrument"};

std::string tasksIn(const fs::path& folder) {
  std::set<std::string> names;
  std::error_code failed;
  for (fs::directory_iterator at(folder, failed), end; !failed && at != end; at.increment(failed))
    if (at->path().extension() == ".yaml") names.insert(at->path().stem().string());
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "those of config/tasks" : text;
}

std::string base64(std::string_view bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t k = 0; k < bytes.size(); k += 3) {
    std::uint32_t group = 0;
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - k);
    for (std::size_t n = 0; n < 3; ++n)
      group = group << 8 | (n < count ? static_cast<unsigned char>(bytes[k + n]) : 0u);
    for (std::size_t n = 0; n < 4; ++n) text += n <= count ? kDigits[group >> (18 - 6 * n) & 63u] : '=';
  }
  return text;
}

/// A box or a sphere, of the keys of `map`; a plane too where it may be one.
std::optional<Region> readRegionKeys(YamlSource& source, YamlMap& map, const YAML::Node& at, bool plane_too,
                                     bool needed) {
  const YAML::Node box = map.get("box"), sphere = map.get("sphere");
  const YAML::Node plane = plane_too ? map.get("plane") : YAML::Node(YAML::NodeType::Undefined);
  const std::string accepted = std::string("{box: {min, max}} or {sphere: {centre, radius}}") +
                               (plane_too ? ", or {plane: {point, normal}} (what is below it)" : "");
  const int shapes = box.IsDefined() + sphere.IsDefined() + plane.IsDefined();
  if (shapes > 1) source.fail(at, map.what() + " has several shapes", accepted);
  if (shapes == 0 && needed) source.fail(at, map.what() + " has no region", accepted);
  if (source.fault || shapes == 0) return std::nullopt;
  if (box.IsDefined()) return Region(readBox(source, box));
  if (sphere.IsDefined()) return readSphere(source, sphere);
  return Region::below(readPlane(source, plane));
}

class TaskReader {
 public:
  /// Pictures are read from `folder` on, and may lie there.
  TaskReader(YamlSource& source, TaskDef& task, const std::string& folder, const FileAccess& access)
      : source_(source), task_(task), folder_(folder), access_(access) {
    access_.folders.push_back(folder);
  }

  /// Where the parts of the task are, for faults that are found later.
  YAML::Node at(const TaskFault& fault) const {
    if (fault.where == "stages" && fault.stage < stages_.size()) return stages_[fault.stage];
    const auto found = parts_.find(fault.where);
    return found == parts_.end() ? root_ : found->second;
  }

  void read(const YAML::Node& root) {
    root_.reset(root);
    YamlMap map(source_, root, "the task");
    map.text("scene", task_.scene);
    map.text("brief", task_.brief);
    std::string picture;
    map.text("picture", picture);
    if (!picture.empty()) readPicture(map.get("picture"), picture);
    map.number("pass_mark", {0.0, 100.0}, task_.pass_mark);
    map.number("settle", {0.0, 60.0, false, "s"}, task_.settle);
    for (const char* part : {"plan", "target", "tray", "view", "stages", "limits", "metrics", "allow"})
      if (const YAML::Node node = map.get(part); node.IsDefined()) parts_[part].reset(node);
    map.finish();
    if (task_.scene.empty()) source_.fail(root, "the task has no scene", "a name of config/scenes, or a path");
    if (parts_.count("plan")) readPlan(parts_["plan"]);
    if (parts_.count("target")) readTarget(parts_["target"]);
    if (parts_.count("tray")) task_.tray = readBox(source_, parts_["tray"]);
    if (parts_.count("view")) task_.view = readBox(source_, parts_["view"]);
    if (parts_.count("limits")) readLimits(parts_["limits"]);
    if (!parts_.count("stages")) source_.fail(root, "the task has no stages", "a list of 1 to 100 stages");
    if (source_.fault) return;
    readStages(parts_["stages"]);
    if (parts_.count("metrics")) readMetrics(parts_["metrics"]);
    if (parts_.count("allow")) readAllow(parts_["allow"]);
  }

 private:
  void readPicture(const YAML::Node& node, const std::string& path) {
    const std::string accepted = "a PNG or JPEG file of up to 2 MiB, from the task's folder on";
    const auto resolved = access_.resolve(path, folder_);
    if (!resolved.ok())
      return source_.fail(node, "picture: " + resolved.error().detail, accepted, resolved.error().code);
    const auto read = readFile(*resolved, kMostPicture);
    if (!read.ok()) return source_.fail(node, "picture: " + read.error().detail, accepted, read.error().code);
    const std::string_view bytes = read->text();
    const bool png = bytes.substr(0, 8) == "\x89PNG\r\n\x1a\n", jpeg = bytes.substr(0, 3) == "\xff\xd8\xff";
    if (!png && !jpeg) return source_.fail(node, "picture is no PNG and no JPEG", accepted, ErrorCode::kUnreadable);
    task_.picture = std::string("data:image/") + (png ? "png" : "jpeg") + ";base64," + base64(bytes);
  }

  void readPlan(const YAML::Node& node) {
    CutPlan plan;
    YamlMap map(source_, node, "plan");
    const bool line = map.has("line"), circle = map.has("circle");
    const std::string accepted = "body, out, depth, and one of: origin with along and length, line, circle";
    for (const char* key : {"body", "out", "depth"})
      if (!map.has(key)) source_.fail(node, std::string("plan has no ") + key, accepted);
    for (const char* key : {"origin", "along", "length"})
      if (map.has(key) == (line || circle))
        source_.fail(node, std::string("plan has ") + (map.has(key) ? "a line or a circle and " : "no ") + key,
                     accepted);
    if (line && circle) source_.fail(node, "plan has a line and a circle", accepted);
    map.text("body", plan.body);
    readDirection(map, "out", plan.out);
    map.number("depth", lengths(0.0, true), plan.depth);
    map.number("tolerance", lengths(0.0, true), plan.tolerance);
    if (line) {
      readLine(map.get("line"), plan);
    } else if (circle) {
      readCircle(map.get("circle"), plan);
    } else {
      map.vector("origin", lengths(), plan.origin);
      readDirection(map, "along", plan.along);
      map.number("length", lengths(0.0, true), plan.length);
    }
    map.finish();
    if (source_.fault) return;
    for (const CutPlan& part : plan.parts())
      if (!(std::abs(part.along.dot(plan.out)) <= 1e-3))
        return source_.fail(map.get("out"),
                            std::string("out is not at a right angle to ") + (line ? "the line" : "along"),
                            "a direction that is, to 0.001");
    plan.out = (plan.out - plan.out.dot(plan.parts()[0].along) * plan.parts()[0].along).normalized();
    task_.plan = plan;
  }

  void readLine(const YAML::Node& node, CutPlan& plan) {
    const std::string accepted = "2 to 1000 places [x, y, z] of the world, none where the one before is";
    if (!node.IsSequence() || node.size() < 2 || node.size() > kMostCorners)
      return source_.fail(node, "line is " + shown(node), accepted);
    for (const auto& corner : node) {
      Vec3 p;
      if (!corner.IsSequence() || corner.size() != 3)
        return source_.fail(corner, "a place of line is " + shown(corner), accepted);
      for (int k = 0; k < 3; ++k)
        if (!readNumber(source_, corner[static_cast<std::size_t>(k)], "line", lengths(), p[k])) return;
      if (!plan.line.empty() && !((p - plan.line.back()).norm() > 1e-9))
        return source_.fail(corner, "a place of line is where the one before is", accepted);
      plan.line.push_back(p);
    }
  }

  /// As a line of so many corners that it is nowhere a thousandth of its radius off.
  void readCircle(const YAML::Node& node, CutPlan& plan) {
    Vec3 centre = Vec3::Zero();
    double radius = 0.0;
    YamlMap map(source_, node, "circle");
    for (const char* key : {"centre", "radius"})
      if (!map.has(key)) source_.fail(node, std::string("circle has no ") + key, "centre, radius");
    map.vector("centre", lengths(), centre);
    map.number("radius", lengths(0.0, true), radius);
    map.finish();
    if (source_.fault) return;
    const Vec3 u = plan.out.unitOrthogonal(), v = plan.out.cross(u);
    for (int k = 0; k < kCircleParts; ++k) {
      const double turn = 2.0 * M_PI * k / kCircleParts;
      plan.line.push_back(centre + radius * (std::cos(turn) * u + std::sin(turn) * v));
    }
    plan.line.push_back(plan.line.front());
  }

  void readDirection(YamlMap& map, const char* key, Vec3& direction) {
    map.vector(key, {-1000.0, 1000.0}, direction);
    if (!(direction.norm() > 1e-6))
      return source_.fail(map.get(key), std::string(key) + " has the length 0", "a direction, longer than 1e-6");
    direction.normalize();
  }

  void readTarget(const YAML::Node& node) {
    Target target;
    YamlMap map(source_, node, "target");
    if (!map.has("body")) source_.fail(node, "target has no body", "the name of a body");
    map.text("body", target.body);
    const std::optional<Region> region = readRegionKeys(source_, map, node, true, true);
    map.finish();
    if (!region) return;
    target.region = *region;
    task_.target = target;
  }

  void readLimits(const YAML::Node& node) {
    TaskLimits& limits = task_.limits;
    YamlMap map(source_, node, "limits");
    double time = 0.0;
    map.number("time", {0.0, 86400.0, true, "s"}, time);
    if (map.has("time")) limits.time = time;
    map.number("force", {0.0, 1e6, true, "N"}, limits.measured.force);
    map.number("strain", {0.0, 100.0, true}, limits.measured.strain);
    limits.strain_limited = map.has("strain");
    const YAML::Node forbidden = map.get("forbidden"), end = map.get("end"), fail = map.get("fail");
    map.finish();
    if (fail.IsDefined()) readFail(fail);
    if (forbidden.IsDefined()) {
      if (!forbidden.IsSequence() || forbidden.size() > kMostForbidden)
        return source_.fail(forbidden, "forbidden is " + shown(forbidden),
                            "a list of up to 100 of {name, body | box | sphere}");
      for (const auto& entry : forbidden) readForbidden(entry);
    }
    if (!end.IsDefined() || source_.fault) return;
    const std::string accepted = "a list of some of time, force, strain, forbidden, which limits gives";
    if (!end.IsSequence() || end.size() > 4) return source_.fail(end, "end is " + shown(end), accepted);
    limits.ends.clear();
    for (const auto& entry : end) {
      std::string word;
      if (!readText(source_, entry, "end", word)) return;
      if (word == "time" && limits.time)
        limits.ends.insert(LimitKind::kTime);
      else if (word == "force" && std::isfinite(limits.measured.force))
        limits.ends.insert(LimitKind::kForce);
      else if (word == "strain" && limits.strain_limited)
        limits.ends.insert(LimitKind::kStrain);
      else if (word == "forbidden" && !limits.measured.forbidden.empty())
        limits.ends.insert(LimitKind::kForbidden);
      else
        return source_.fail(entry, "end has " + shown(entry), accepted);
    }
  }

  void readFail(const YAML::Node& node) {
    if (!node.IsMap())
      return source_.fail(node, "fail is " + shown(node), "a map of names of docs/metrics.md and values");
    for (const auto& entry : node) {
      FailLimit limit;
      const MetricRow* row = readMetricName(entry.first, limit.metric);
      if (!row) return;
      for (const FailLimit& other : task_.limits.fail)
        if (other.metric == limit.metric)
          return source_.fail(entry.first, "fail has " + shown(entry.first) + " twice", "each once");
      if (!readNumber(source_, entry.second, limit.metric, {-1e12, 1e12, false, row->unit}, limit.value)) return;
      task_.limits.fail.push_back(std::move(limit));
    }
  }

  void readAllow(const YAML::Node& node) {
    std::string accepted;
    std::map<std::string, Intervention> words;
    for (std::size_t k = 0; k < kInterventions; ++k) {
      const auto intervention = static_cast<Intervention>(k);
      words[toString(intervention)] = intervention;
      accepted += (k ? ", " : "a list of ") + std::string(toString(intervention));
    }
    if (!node.IsSequence()) return source_.fail(node, "allow is " + shown(node), accepted);
    for (const auto& entry : node) {
      std::string word;
      if (!readText(source_, entry, "allow", word)) return;
      if (!words.count(word)) return source_.fail(entry, "allow has " + shown(entry), accepted);
      task_.allow.insert(words[word]);
    }
  }

  /// Null, and a fault, where there is no such metric.
  const MetricRow* readMetricName(const YAML::Node& node, std::string& name) {
    if (!readText(source_, node, "a metric's name", name)) return nullptr;
    const MetricRow* row = findMetric(name);
    if (!row)
      source_.fail(node, "unknown metric " + shown(node) + ", did you mean '" + nearestWord(name, metricNames()) + "'?",
                   "a name of docs/metrics.md; those of hands with .pick, .pick_2, .push or .scissors",
                   ErrorCode::kUnknownName);
    return row;
  }

  void readForbidden(const YAML::Node& node) {
    Forbidden forbidden;
    YamlMap map(source_, node, "an entry of forbidden");
    map.text("name", forbidden.name);
    map.text("body", forbidden.body);
    const bool body = map.has("body");
    const std::optional<Region> region = readRegionKeys(source_, map, node, false, !body);
    map.finish();
    if (body && region) source_.fail(node, "an entry of forbidden has a body and a region", "one of them");
    if (region) forbidden.region = *region;
    if (forbidden.name.empty())
      forbidden.name = body ? forbidden.body : "region " + std::to_string(task_.limits.measured.forbidden.size() + 1);
    task_.limits.measured.forbidden.push_back(std::move(forbidden));
  }

  void readStages(const YAML::Node& node) {
    if (!node.IsSequence() || node.size() == 0 || node.size() > kMostStages)
      return source_.fail(node, "stages is " + shown(node), "a list of 1 to 100 stages");
    for (const auto& entry : node) {
      if (source_.fault) return;
      stages_.push_back(entry);
      readStage(entry);
    }
  }

  void readStage(const YAML::Node& node) {
    const std::vector<std::string> kinds{"reach",     "stretch_to",    "press_to", "cut_along", "separate",
                                         "remove_to", "leave_nothing", "let_go",   "clip",      "hold",
                                         "hand_over", "put_back",      "put_on",   "see"};
    Stage stage;
    YamlMap map(source_, node, "a stage");
    map.text("name", stage.name);
    map.text("brief", stage.brief);
    map.number("hold_for", {0.0, 3600.0, false, "s"}, stage.hold_for);
    std::string kind, accepted;
    for (const std::string& word : kinds) {
      accepted += (accepted.empty() ? "" : ", ") + word;
      if (!map.has(word)) continue;
      if (!kind.empty()) source_.fail(node, "a stage has " + kind + " and " + word, "one condition");
      kind = word;
    }
    map.finish();
    if (kind.empty()) source_.fail(node, "a stage has no condition", "one of " + accepted);
    if (source_.fault) return;
    if (stage.name.empty()) stage.name = kind;
    const YAML::Node value = map.get(kind);
    if (kind == "separate") {
      Separate separate;
      if (!value.IsSequence() || value.size() != 2)
        return source_.fail(value, "separate is " + shown(value), "a list of two names, of the ends of an attachment");
      if (!readText(source_, value[0], "separate", separate.a) || !readText(source_, value[1], "separate", separate.b))
        return;
      stage.condition = separate;
    } else if (kind == "remove_to" || kind == "let_go") {
      const std::string word = kind == "remove_to" ? "tray" : "all";
      if (map.choice(kind, {word}) < 0) return;
      if (kind == "remove_to")
        stage.condition = RemoveToTray{};
      else
        stage.condition = LetGo{};
    } else {
      readCondition(kind, value, stage.condition);
    }
    if (!source_.fault) task_.stages.push_back(std::move(stage));
  }

  void readCondition(const std::string& kind, const YAML::Node& node, Condition& condition) {
    YamlMap map(source_, node, kind);
    if (kind == "reach") {
      Reach reach;
      if (const int tool = map.choice("tool", kTools); tool >= 0) reach.tool = static_cast<ToolKind>(tool);
      if (!map.has("tool")) source_.fail(node, "reach has no tool", "pick, push, scissors, instrument");
      if (const auto region = readRegionKeys(source_, map, node, false, true)) reach.region = *region;
      condition = reach;
    } else if (kind == "stretch_to") {
      StretchTo stretch;
      if (!map.has("body") || !map.has("distance")) source_.fail(node, "stretch_to has no body or no distance", "both");
      map.text("body", stretch.body);
      map.number("distance", lengths(0.0, true), stretch.distance);
      condition = stretch;
    } else if (kind == "press_to") {
      PressTo press;
      if (!map.has("force")) source_.fail(node, "press_to has no force", "above 0 to 1e6 N");
      map.number("force", {0.0, 1e6, true, "N"}, press.force);
      if (const int tool = map.choice("tool", {"pick", "push", "instrument"}); tool >= 0)
        press.tool = tool == 2 ? ToolKind::kInstrument : static_cast<ToolKind>(tool);
      press.region = readRegionKeys(source_, map, node, false, false);
      if (const int at = map.choice("at", {"middle", "touch"}); at >= 0) press.touch = at == 1;
      condition = press;
    } else if (kind == "cut_along") {
      CutAlong cut;
      map.number("share", {0.0, 1.0, true}, cut.share);
      condition = cut;
    } else if (kind == "clip") {
      Clipped clipped;
      readBody(map, node, kind, clipped.body);
      clipped.region = readRegionKeys(source_, map, node, false, false);
      condition = clipped;
    } else if (kind == "hold") {
      Hold hold;
      readBody(map, node, kind, hold.body);
      map.whole("picks", 1, 10, hold.picks);
      hold.region = readRegionKeys(source_, map, node, false, false);
      condition = hold;
    } else if (kind == "hand_over") {
      HandOver over;
      readBody(map, node, kind, over.body);
      condition = over;
    } else if (kind == "put_back") {
      PutBack back;
      readBody(map, node, kind, back.body);
      if (!map.has("distance")) source_.fail(node, "put_back has no distance", "above 0 to 1000 m");
      map.number("distance", lengths(0.0, true), back.distance);
      condition = back;
    } else if (kind == "put_on") {
      PutOn put;
      readNames(map, node, "bodies", "names of bodies", put.bodies);
      readNames(map, node, "obstacles", "names of obstacles", put.obstacles);
      put.handed_over = map.choice("handed_over", {"false", "true"}) == 1;
      condition = put;
    } else if (kind == "see") {
      See see;
      readBody(map, node, kind, see.body);
      map.number("off_centre", {0.0, 1.0, true}, see.off_centre);
      map.number("fills_least", {0.0, 1.0, true}, see.fills_least);
      map.number("fills_most", {0.0, 1.0, true}, see.fills_most);
      if (!source_.fault && !(see.fills_least < see.fills_most))
        source_.fail(node, "fills_least is " + numberText(see.fills_least),
                     "below fills_most, " + numberText(see.fills_most));
      condition = see;
    } else {
      LeaveNothing leave;
      map.number("share", {0.0, 0.99}, leave.share);
      condition = leave;
    }
    map.finish();
  }

  /// A list of 1 to 100 names, each once.
  void readNames(YamlMap& map, const YAML::Node& at, const std::string& key, const std::string& what,
                 std::vector<std::string>& names) {
    const YAML::Node node = map.get(key);
    const std::string accepted = "a list of 1 to 100 " + what + ", each once";
    if (!node.IsDefined()) return source_.fail(at, map.what() + " has no " + key, accepted);
    if (!node.IsSequence() || node.size() == 0 || node.size() > kMostNames)
      return source_.fail(node, key + " is " + shown(node), accepted);
    for (const auto& entry : node) {
      std::string name;
      if (!readText(source_, entry, key, name)) return;
      if (std::find(names.begin(), names.end(), name) != names.end())
        return source_.fail(entry, key + " has " + shown(entry) + " twice", accepted);
      names.push_back(name);
    }
  }

  void readBody(YamlMap& map, const YAML::Node& node, const std::string& kind, std::string& body) {
    if (!map.has("body")) source_.fail(node, kind + " has no body", "the name of a body");
    map.text("body", body);
  }

  void readMetrics(const YAML::Node& node) {
    if (!node.IsMap()) return source_.fail(node, "metrics is " + shown(node), "a map of names of docs/metrics.md");
    std::set<std::string> seen;
    for (const auto& entry : node) {
      WeightedMetric metric;
      const MetricRow* row = readMetricName(entry.first, metric.name);
      if (!row) return;
      if (!seen.insert(metric.name).second)
        return source_.fail(entry.first, "metrics has " + shown(entry.first) + " twice", "each once");
      YamlMap map(source_, entry.second, "metric " + metric.name);
      const NumberRange any{-1e12, 1e12, false, row->unit};
      if (!map.has("good") || !map.has("bad"))
        source_.fail(entry.second, "metric " + metric.name + " has no good or no bad", "both");
      map.number("weight", {0.0, 1e6, true}, metric.weight);
      map.number("good", any, metric.good);
      map.number("bad", any, metric.bad);
      double pass = 0.0;
      map.number("pass", any, pass);
      if (map.has("pass")) metric.pass = pass;
      map.finish();
      if (source_.fault) return;
      if (metric.good == metric.bad)
        return source_.fail(entry.second, "good and bad of " + metric.name + " are the same", "two values");
      task_.metrics.push_back(std::move(metric));
    }
  }

  YamlSource& source_;
  TaskDef& task_;
  const std::string folder_;
  FileAccess access_;
  YAML::Node root_;
  std::map<std::string, YAML::Node> parts_;
  std::vector<YAML::Node> stages_;
};

}  // namespace

bool isTaskFile(const std::string& task) {
  return task.find('/') != std::string::npos || std::filesystem::path(task).extension() == ".yaml";
}

Result<LoadedTask> readTask(const std::string& file, const std::optional<std::string>& scene_folder,
                            const FileAccess& access, const std::string& only_scene) {
  std::error_code failed;
  const fs::path real = fs::canonical(file, failed);
  if (failed || !fs::is_regular_file(real, failed))
    return Error{ErrorCode::kUnreadable, "there is no task '" + file + "'; accepted: a YAML file, or one of " +
                                             tasksIn(fs::path(file).parent_path())};
  const Result<FileBytes> bytes = readFile(real.string(), kMostTask);
  if (!bytes) return Error{bytes.error().code, file + ": " + bytes.error().detail};
  const Result<YAML::Node> root = parseYaml(std::string(bytes->text()), file);
  if (!root) return root.error();
  if (!root->IsMap())
    return Error{ErrorCode::kInvalidArgument, file + ": the task is not a map; accepted: a map of keys and values"};
  YamlSource source{file, {}};
  LoadedTask loaded;
  loaded.task.name = real.stem().string();
  char version[9];
  std::snprintf(
      version, sizeof version, "%08lx",
      crc32(0, reinterpret_cast<const Bytef*>(bytes->text().data()), static_cast<uInt>(bytes->text().size())));
  loaded.task.version = version;
  loaded.file = real.string();
  TaskReader reader(source, loaded.task, real.parent_path().string(), access);
  try {
    reader.read(*root);
  } catch (const YAML::Exception& e) {
    source.fail(*root, e.what(), "YAML");
  }
  if (source.fault) return *source.fault;
  if (!scene_folder) return loaded;

  const std::string& named = loaded.task.scene;
  const bool is_path = named.find('/') != std::string::npos || fs::path(named).extension() == ".yaml";
  const Result<std::string> scene_file =
      is_path ? access.located(named, real.parent_path().string()) : *scene_folder + "/" + named + ".yaml";
  if (!scene_file) return Error{scene_file.error().code, file + ": its scene: " + scene_file.error().detail};
  if (!only_scene.empty() && !(fs::equivalent(*scene_file, only_scene, failed) && !failed))
    return Error{ErrorCode::kInvalidArgument, file + ": the task is of the scene '" + named +
                                                  "'; accepted: tasks of the scene that runs, " +
                                                  fs::path(only_scene).stem().string()};
  Result<SceneDef> scene = readScene(*scene_file, access);
  if (!scene) return Error{scene.error().code, file + ": its scene: " + scene.error().detail};
  loaded.scene = std::move(*scene);
  loaded.scene_file = *scene_file;
  if (const auto fault = findTaskFault(loaded.task, loaded.scene)) {
    source.fail(reader.at(*fault), fault->what, fault->accepted);
    return *source.fault;
  }
  return loaded;
}

std::string dateText(std::chrono::system_clock::time_point time) {
  const auto since = std::chrono::floor<std::chrono::milliseconds>(time.time_since_epoch());
  const std::time_t seconds = std::chrono::floor<std::chrono::seconds>(since).count();
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  char text[64];
  const std::size_t size = std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S", &parts);
  std::snprintf(text + size, sizeof text - size, ".%03dZ", static_cast<int>(since.count() - 1000 * seconds));
  return text;
}

std::string dateText(double seconds) {
  return dateText(std::chrono::system_clock::time_point(
      std::chrono::round<std::chrono::system_clock::duration>(std::chrono::duration<double>(seconds))));
}

bool isDate(const std::string& text) {
  static const std::regex form(
      "\\d{4}-(0[1-9]|1[0-2])-(0[1-9]|[12]\\d|3[01])T([01]\\d|2[0-3])(:[0-5]\\d){2}(\\.\\d{3})?Z");
  return std::regex_match(text, form);
}

std::vector<EarlierReport> readEarlierReports(const std::string& folder, const std::string& trainee,
                                              const std::string& task, const std::string& but) {
  std::map<std::pair<std::string, std::string>, EarlierReport> found;  // by date and name
  std::error_code failed;
  for (fs::directory_iterator at(folder, failed), end; !failed && at != end; at.increment(failed)) {
    const std::string name = at->path().filename().string();
    if (name == but) continue;
    std::error_code missing;
    const fs::path real = fs::canonical(at->path() / "report.json", missing);
    if (missing || !fs::is_regular_file(real, missing)) continue;
    const Result<YAML::Node> root = readYamlFile(real.string(), name);  // JSON is YAML
    if (!root || !root->IsMap()) continue;
    try {
      const YAML::Node& report = *root;
      if (report["trainee"].as<std::string>() != trainee || report["task"].as<std::string>() != task) continue;
      EarlierReport earlier;
      earlier.name = name;
      earlier.score = report["score"].as<double>();
      earlier.passed = report["passed"].as<bool>();
      for (const auto& metric : report["metrics"])
        if (!metric["value"].IsNull()) earlier.values[metric["name"].as<std::string>()] = metric["value"].as<double>();
      std::string date = report["date"] && !report["date"].IsNull() ? report["date"].as<std::string>() : "";
      if (struct stat info{}; date.empty() && ::stat(real.c_str(), &info) == 0)
        date = dateText(std::chrono::system_clock::from_time_t(info.st_mtime) +
                        std::chrono::milliseconds(info.st_mtim.tv_nsec / 1000000));
      found.emplace(std::make_pair(date, name), std::move(earlier));
    } catch (const YAML::Exception&) {
    }
  }
  std::vector<EarlierReport> all;
  for (auto& [name, earlier] : found) all.push_back(std::move(earlier));
  return all;
}

}  // namespace meshless
