#include "meshless_surgery/io/scene.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <tuple>

#include "material_yaml.h"
#include "meshless_surgery/base/random.h"
#include "region_yaml.h"
#include "yaml_map.h"

namespace meshless {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxBodies = 10000;
constexpr std::size_t kMaxObstacles = 100;
constexpr std::size_t kMaxAttachments = 1000;

void readWorld(YamlSource& source, const YAML::Node& node, WorldSettings& world, std::vector<std::string>& warnings) {
  YamlMap map(source, node, "world");
  map.vector("gravity", {-1000.0, 1000.0, false, "m/s^2"}, world.gravity);
  const YAML::Node ground = map.get("ground");
  if (ground.IsDefined()) {
    double height = 0.0;
    if (ground.IsNull() || (ground.IsScalar() && ground.Scalar() == "none"))
      world.ground.reset();
    else if (!ground.IsScalar() || !YAML::convert<double>::decode(ground, height))
      source.fail(ground, "ground is " + shown(ground), "a height, " + lengths().text() + ", or none");
    else if (readNumber(source, ground, "ground", lengths(), height))
      world.ground = height;
  }
  map.number("ground_friction", {0.0, 10.0}, world.ground_friction);
  map.number("step_rate", {1.0, 10000.0, false, "Hz"}, world.step_rate);
  map.whole("substeps", 1, 1000, world.substeps);
  map.whole("max_substeps", 1, 1000, world.max_substeps);
  map.whole("threads", 1, 64, world.threads);
  const int contact = map.choice("contact", {"none", "textbook", "rest_shape", "surface", "auto"});
  if (contact >= 0) world.contact = contact < 2 ? static_cast<ContactMethod>(contact) : ContactMethod::kSurface;
  if (contact == 2 || contact == 4)
    warnings.push_back("contact: " + std::string(contact == 2 ? "rest_shape" : "auto") +
                       " is no more and means surface");
  if (const int sleep = map.choice("sleep", {"false", "true"}); sleep >= 0) world.sleep = sleep == 1;
  if (const YAML::Node pick = map.get("pick"); pick.IsDefined()) {
    YamlMap keys(source, pick, "pick");
    keys.number("max_distance", lengths(0.0, true), world.pick_max_distance);
    keys.number("stiffness", {0.0, 1e9, true, "N/m"}, world.pick_stiffness);
    keys.number("radius", lengths(0.0), world.pick_radius);
    keys.finish();
  }
  if (const YAML::Node push = map.get("push"); push.IsDefined()) {
    YamlMap keys(source, push, "push");
    keys.number("radius", lengths(0.0, true), world.push_radius);
    keys.finish();
  }
  map.finish();
  if (source.fault) return;
  if (const Status status = world.validate(); !status) source.fail(node, "world: " + status.error().detail, "");
}

Pose readPose(YamlSource& source, const YAML::Node& node) {
  Pose pose;
  YamlMap map(source, node, "pose");
  map.vector("position", lengths(), pose.translation);
  Vec3 rpy = Vec3::Zero();
  std::vector<double> xyzw;
  map.vector("rpy", {-100.0, 100.0, false, "rad"}, rpy);
  map.numbers("xyzw", 4, {-2.0, 2.0}, xyzw);
  if (!xyzw.empty() && map.has("rpy")) source.fail(node, "pose has rpy and xyzw", "one of them");
  pose.rotation = Eigen::AngleAxisd(rpy.z(), Vec3::UnitZ()) * Eigen::AngleAxisd(rpy.y(), Vec3::UnitY()) *
                  Eigen::AngleAxisd(rpy.x(), Vec3::UnitX());
  if (!xyzw.empty()) {
    pose.rotation = Quat(xyzw[3], xyzw[0], xyzw[1], xyzw[2]);
    const double norm = pose.rotation.norm();
    if (!(std::abs(norm - 1.0) <= 1e-2))
      source.fail(map.get("xyzw"), "xyzw has the length " + std::to_string(norm), "a unit quaternion, 0.99 to 1.01");
    else
      pose.rotation.normalize();
  }
  map.finish();
  return pose;
}

ClusterOptions readClusters(YamlSource& source, const YAML::Node& node) {
  ClusterOptions options;
  const std::string accepted =
      "auto, one, cells, {grid: [x, y, z], overlap: 0 to 1}, {count: 1 to 100000, overlap: 0 to 1}";
  if (!node.IsMap()) {
    if (node.IsScalar() && node.Scalar() == "auto")
      options.kind = ClusterOptions::Kind::kAuto;
    else if (node.IsScalar() && node.Scalar() == "one")
      options.kind = ClusterOptions::Kind::kOne;
    else if (node.IsScalar() && node.Scalar() == "cells")
      options.kind = ClusterOptions::Kind::kCells;
    else
      source.fail(node, "clusters is " + shown(node), accepted);
    return options;
  }
  YamlMap map(source, node, "clusters");
  const YAML::Node grid = map.get("grid");
  const bool has_count = map.has("count");
  if (grid.IsDefined() == has_count)
    source.fail(node, has_count ? "clusters has grid and count" : "clusters has no grid and no count", accepted);
  if (grid.IsDefined()) {
    options.kind = ClusterOptions::Kind::kGrid;
    if (!grid.IsSequence() || grid.size() != 3) {
      source.fail(grid, "grid is " + shown(grid), "a list of 3 whole numbers, 1 to 1000");
    } else {
      double cells = 1.0;
      for (std::size_t k = 0; k < 3; ++k) {
        readWhole(source, grid[k], "grid[" + std::to_string(k) + "]", 1, 1000, options.grid[k]);
        cells *= options.grid[k];
      }
      if (cells > 100000.0) source.fail(grid, "grid has " + std::to_string(cells) + " cells", "up to 100000 together");
    }
  }
  if (has_count) {
    options.kind = ClusterOptions::Kind::kCount;
    map.whole("count", 1, 100000, options.count);
  }
  map.number("overlap", {0.0, 1.0}, options.overlap);
  map.finish();
  return options;
}

bool isFrameName(const std::string& text) {
  return !text.empty() && text.size() <= 200 && text != "/" &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isgraph(c); });
}

std::vector<HeldRegion> readFixed(YamlSource& source, const YAML::Node& node) {
  const std::string accepted =
      "{box: {min, max}}, {plane: {point, normal}} (what is below it) or {sphere: {centre, radius}}, frame: world or "
      "body, and follows: a frame of tf";
  std::vector<HeldRegion> regions;
  if (!node.IsSequence() || node.size() > kMaxHeldRegions) {
    source.fail(node, "fixed is " + shown(node), "a list of up to 1000 of " + accepted);
    return regions;
  }
  for (const auto& entry : node) {
    YamlMap map(source, entry, "fixed");
    const YAML::Node box = map.get("box"), plane = map.get("plane"), sphere = map.get("sphere");
    HeldRegion read;
    read.in_world = map.choice("frame", {"world", "body"}) != 1;
    map.text("follows", read.follows);
    if (map.has("follows") && !isFrameName(read.follows))
      source.fail(map.get("follows"), "follows is " + shown(map.get("follows")), "the name of a frame of tf");
    map.finish();
    const int shapes = box.IsDefined() + plane.IsDefined() + sphere.IsDefined();
    if (shapes == 0) source.fail(entry, "an entry of fixed has no box, no plane and no sphere", accepted);
    if (shapes > 1) source.fail(entry, "an entry of fixed has several shapes", accepted);
    if (source.fault) break;
    if (box.IsDefined()) read.region = readBox(source, box);
    if (plane.IsDefined()) read.region = Region::below(readPlane(source, plane));
    if (sphere.IsDefined()) read.region = readSphere(source, sphere);
    if (source.fault) break;
    regions.push_back(std::move(read));
  }
  return regions;
}

/// The poses of a body's copies; `start` is the first one's place.
std::vector<Pose> readCopies(YamlSource& source, const YAML::Node& node, const Pose& start) {
  YamlMap map(source, node, "copies");
  int count = 0, seed = 1;
  std::array<int, 3> grid{{0, 1, 1}};
  Vec3 offset = Vec3::Zero();
  double jitter = 0.0, turn = 0.0;
  map.whole("count", 1, kMaxBodies, count);
  const YAML::Node cells = map.get("grid");
  if (cells.IsDefined()) {
    if (!cells.IsSequence() || cells.size() != 3)
      source.fail(cells, "grid is " + shown(cells), "a list of 3 whole numbers, 1 to 10000");
    else
      for (std::size_t k = 0; k < 3; ++k)
        readWhole(source, cells[k], "grid[" + std::to_string(k) + "]", 1, kMaxBodies, grid[k]);
  }
  map.vector("offset", lengths(), offset);
  map.number("jitter", lengths(0.0), jitter);
  map.number("turn", {0.0, 3.2, false, "rad"}, turn);
  map.whole("seed", 0, 2147483647, seed);
  map.finish();
  if (count == 0 && grid[0] == 0) source.fail(node, "copies has no count and no grid", "one of them, or both");
  if (grid[0] == 0) grid[0] = count;
  const double places = static_cast<double>(grid[0]) * grid[1] * grid[2];
  if (places > kMaxBodies || places < count)
    source.fail(node, "the grid of copies has " + std::to_string(static_cast<long long>(places)) + " places",
                std::to_string(std::max(1, count)) + " to " + std::to_string(kMaxBodies));
  if (source.fault) return {};
  if (count == 0) count = static_cast<int>(places);
  std::vector<Pose> poses;
  Random dice(static_cast<std::uint64_t>(seed));
  for (int k = 0; k < count; ++k) {
    const Vec3 place(k % grid[0], k / grid[0] % grid[1], k / grid[0] / grid[1]);
    Pose pose = start;
    pose.translation += place.cwiseProduct(offset) + dice.inCube(jitter);
    const Vec3 axis = dice.direction();
    pose.rotation = (Eigen::AngleAxisd(dice.between(0.0, turn), axis) * pose.rotation).normalized();
    poses.push_back(pose);
  }
  return poses;
}

CollisionChoice readCollision(YamlSource& source, const YAML::Node& node) {
  CollisionChoice choice;
  if (node.IsScalar() && node.Scalar() == "auto") return choice;
  choice.kind = CollisionChoice::Kind::kEdge;
  if (node.IsScalar() && node.Scalar() == "visual")
    choice.kind = CollisionChoice::Kind::kVisual;
  else
    readNumber(source, node, "collision", lengths(0.0, true), choice.edge);
  return choice;
}

CavityFill readCavities(YamlSource& source, const YAML::Node& node) {
  CavityFill fill;
  const std::string accepted = "empty, {pressure: Pa}, or {volume: ml, compliance: ml/Pa} with one of them or both";
  if (node.IsScalar() && node.Scalar() == "empty") return fill;
  if (!node.IsMap()) {
    source.fail(node, "cavities is " + shown(node), accepted);
    return fill;
  }
  YamlMap map(source, node, "cavities");
  const bool pressure = map.has("pressure"), volume = map.has("volume") || map.has("compliance");
  if (pressure == volume)
    source.fail(node,
                pressure ? "cavities has pressure, and volume or compliance" : "cavities has no pressure and no volume",
                accepted);
  fill.kind = pressure ? CavityFill::Kind::kPressure : CavityFill::Kind::kVolume;
  map.number("pressure", {0.0, 1e6, false, "Pa"}, fill.pressure);
  map.number("volume", {0.0, 1e9, true, "ml"}, fill.volume);
  map.number("compliance", {0.0, 1e6, true, "ml/Pa"}, fill.compliance);
  fill.volume *= 1e-6;
  fill.compliance *= 1e-6;
  map.number("leak", {0.0, 3600.0, true, "s"}, fill.leak);
  map.finish();
  return fill;
}

/// [m] of one unit of a file's or primitive's lengths.
double readUnits(YamlMap& map) {
  std::vector<std::string> names;
  for (const auto& [name, metres] : kLengthUnits) names.push_back(name);
  const int chosen = map.choice("units", names);
  return chosen < 0 ? 1.0 : kLengthUnits[static_cast<std::size_t>(chosen)].second;
}

bool readUpAxis(YamlMap& map) { return map.choice("up_axis", {"z", "y"}) == 1; }

/// Factors along the body's own axes; those that are left out keep the volume.
Vec3 readPrestretch(YamlSource& source, const YAML::Node& node) {
  const std::string accepted = "factors of 0.5 to 2 along one or two of x, y and z, such as {x: 1.1}; the rest follows";
  if (!node.IsMap()) {
    source.fail(node, "prestretch is " + shown(node), accepted);
    return Vec3::Ones();
  }
  YamlMap map(source, node, "prestretch");
  Vec3 factors = Vec3::Zero();
  int given = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const std::string key(1, "xyz"[axis]);
    map.number(key, {0.5, 2.0}, factors[axis]);
    given += map.has(key);
  }
  map.finish();
  if (given == 0 || given == 3)
    source.fail(node, given == 0 ? "prestretch is empty" : "prestretch says all of x, y and z", accepted);
  if (source.fault) return Vec3::Ones();
  double product = 1.0;
  for (const double factor : factors)
    if (factor > 0.0) product *= factor;
  const double rest = std::pow(product, -1.0 / (3 - given));
  for (double& factor : factors)
    if (!(factor > 0.0)) factor = rest;
  return factors;
}

/// A unit vector; zero: along the body.
Vec3 readDirection(YamlSource& source, const YAML::Node& node) {
  Vec3 direction = Vec3::Zero();
  if (node.IsScalar() && node.Scalar() == "along") return direction;
  const std::string accepted = "along, or [x, y, z] in the body's own frame, of any length but 0";
  if (!node.IsSequence() || node.size() != 3) {
    source.fail(node, "fibre_direction is " + shown(node), accepted);
    return direction;
  }
  for (std::size_t axis = 0; axis < 3; ++axis)
    readNumber(source, node[axis], "fibre_direction[" + std::to_string(axis) + "]", {-1e6, 1e6},
               direction[static_cast<Eigen::Index>(axis)]);
  if (!source.fault && !(direction.norm() > 1e-12)) source.fail(node, "fibre_direction is " + shown(node), accepted);
  return source.fault ? Vec3(Vec3::Zero()) : Vec3(direction.normalized());
}

/// Without its name.
InstrumentDef readInstrument(YamlSource& source, const YAML::Node& node) {
  InstrumentDef def;
  YamlMap map(source, node, "an instrument");
  const int type = map.choice("type", {"probe", "grasper", "hook", "scissors", "clip_applier", "scalpel", "endoscope"});
  if (!map.has("type"))
    source.fail(node, "an instrument has no type", "probe, grasper, hook, scissors, clip_applier, scalpel, endoscope");
  def.type = static_cast<InstrumentType>(std::max(0, type));
  if (const YAML::Node pose = map.get("pose"); pose.IsDefined()) def.pose = readPose(source, pose);
  for (const InstrumentNumber& number : kInstrumentNumbers)
    map.number(number.key, {number.least, number.most, false, number.unit}, def.*number.value);
  def.latch = map.choice("grasp", {"friction", "latch"}) == 1;
  if (map.has("remote_centre")) {
    def.remote_centre = Vec3::Zero();
    map.vector("remote_centre", lengths(), *def.remote_centre);
  }
  map.finish();
  return def;
}

class SceneReader {
 public:
  SceneReader(YamlSource& source, std::string folder, const FileAccess& access, ImageFiles& images, SceneDef& scene)
      : source_(source), folder_(std::move(folder)), access_(access), images_{images, folder_}, scene_(scene) {}

  void read(const YAML::Node& root) {
    YamlMap map(source_, root, "the scene");
    if (const YAML::Node world = map.get("world"); world.IsDefined())
      readWorld(source_, world, scene_.world, scene_.warnings);
    if (const YAML::Node materials = map.get("materials"); materials.IsDefined())
      readMaterialMap(source_, materials, images_, scene_.materials);
    const YAML::Node bodies = map.get("bodies"), obstacles = map.get("obstacles");
    const YAML::Node attachments = map.get("attachments"), instruments = map.get("instruments");
    if (const int space = map.choice("space", {kSpaces.begin(), kSpaces.end()}); space >= 0)
      space_ = kSpaces[static_cast<std::size_t>(space)];
    map.finish();
    if (!bodies.IsSequence() || bodies.size() > kMaxBodies) {
      source_.fail(bodies.IsDefined() ? bodies : root, "bodies is " + shown(bodies), "a list of up to 10000 bodies");
      return;
    }
    for (const auto& body : bodies) {
      if (source_.fault) return;  // later bodies may take seconds to load
      readBody(body);
    }
    if (obstacles.IsDefined()) {
      if (!obstacles.IsSequence() || obstacles.size() > kMaxObstacles)
        return source_.fail(obstacles, "obstacles is " + shown(obstacles), "a list of up to 100 obstacles");
      for (const auto& obstacle : obstacles) {
        if (source_.fault) return;
        readObstacle(obstacle);
      }
    }
    if (instruments.IsDefined()) readInstruments(instruments);
    if (!attachments.IsDefined() || source_.fault) return;
    if (!attachments.IsSequence() || attachments.size() > kMaxAttachments)
      return source_.fail(attachments, "attachments is " + shown(attachments), "a list of up to 1000 attachments");
    for (const auto& attachment : attachments) {
      if (source_.fault) return;
      readAttachment(attachment);
    }
  }

 private:
  void readBody(const YAML::Node& node) {
    YamlMap map(source_, node, "a body");
    BodyDef def;
    // What is cheap to read comes first: no mesh is loaded for a body that is refused.
    map.text("name", def.name);
    double scale = 1.0, edge = 0.0;
    map.number("scale", {0.0, 1e6, true}, scale);
    scale *= readUnits(map);
    map.number("spacing", lengths(0.0, true), def.spacing);
    map.number("thickness", lengths(0.0, true), def.thickness);
    if (const int chosen = map.choice("resolution", {"coarse", "medium", "fine"}); chosen >= 0)
      def.resolution = static_cast<Resolution>(chosen);
    if (map.has("spacing") && map.has("resolution"))
      source_.fail(map.get("resolution"), "a body has spacing and resolution", "one of them");
    map.number("edge", lengths(0.0, true), edge);
    const MeshRepair repair = readRepair(map);
    if (const YAML::Node pose = map.get("pose"); pose.IsDefined()) def.pose = readPose(source_, pose);
    if (const YAML::Node clusters = map.get("clusters"); clusters.IsDefined())
      def.clusters = readClusters(source_, clusters);
    if (const YAML::Node cells = map.get("cells"); cells.IsDefined()) {
      if (cells.IsScalar() && cells.Scalar() == "whole")
        def.warnings.push_back("cells: whole is no more and means filled");
      else if (!cells.IsScalar() || cells.Scalar() != "filled")
        source_.fail(cells, "cells is " + shown(cells), "filled");
    }
    if (const YAML::Node collision = map.get("collision"); collision.IsDefined())
      def.collision = readCollision(source_, collision);
    readBodyMaterial(map.get("material"), def.material);
    if (const YAML::Node fixed = map.get("fixed"); fixed.IsDefined()) def.fixed = readFixed(source_, fixed);
    if (const YAML::Node cavities = map.get("cavities"); cavities.IsDefined())
      def.cavities = readCavities(source_, cavities);
    if (const YAML::Node prestretch = map.get("prestretch"); prestretch.IsDefined())
      def.prestretch = readPrestretch(source_, prestretch);
    if (const YAML::Node direction = map.get("fibre_direction"); direction.IsDefined())
      def.fibre_direction = readDirection(source_, direction);
    const bool y_up = readUpAxis(map);
    if (const YAML::Node regions = map.get("regions"); regions.IsDefined()) readRegions(regions, scale, y_up, def);
    std::vector<Pose> poses{def.pose};
    const YAML::Node copies = map.get("copies");
    if (copies.IsDefined()) poses = readCopies(source_, copies, def.pose);
    const YAML::Node file = map.get("file"), primitive = map.get("primitive");
    if (file.IsDefined() == primitive.IsDefined())
      source_.fail(node, file.IsDefined() ? "a body has file and primitive" : "a body has no file and no primitive",
                   "one of them");
    if (file.IsDefined() && edge > 0.0) source_.fail(map.get("edge"), "edge of a body from a file", "with a primitive");
    refuseOfPrimitive(map);
    map.finish();
    if (source_.fault) return;

    if (file.IsDefined())
      loadFile(file, scale, repair, y_up, def);
    else
      makePrimitive(primitive, scale, edge, def);
    if (source_.fault) return;
    if (!isPlainName(def.name)) source_.fail(node, "the body's name is '" + def.name.substr(0, 60) + "'", kPlainName);
    if (scene_.bodies.size() + poses.size() > static_cast<std::size_t>(kMaxBodies))
      source_.fail(node, "the scene has more bodies", "up to 10000");
    for (std::size_t k = 0; k < poses.size() && !source_.fault; ++k) {
      BodyDef copy = def;
      copy.pose = poses[k];
      copy.copy = k > 0;
      if (copies.IsDefined()) copy.name += "_" + std::to_string(k + 1);
      if (!names_.insert(copy.name).second)
        source_.fail(node, "two bodies are named '" + copy.name + "'", "each name once", ErrorCode::kDuplicateName);
      scene_.bodies.push_back(std::move(copy));
    }
  }

  void readObstacle(const YAML::Node& node) {
    YamlMap map(source_, node, "an obstacle");
    BodyDef shape;
    ObstacleDef def;
    double scale = 1.0, edge = 0.0;
    map.text("name", shape.name);
    map.number("scale", {0.0, 1e6, true}, scale);
    scale *= readUnits(map);
    map.number("edge", lengths(0.0, true), edge);
    const MeshRepair repair = readRepair(map);
    map.number("friction", {0.0, 10.0}, def.friction);
    if (const YAML::Node pose = map.get("pose"); pose.IsDefined()) shape.pose = readPose(source_, pose);
    const YAML::Node file = map.get("file"), primitive = map.get("primitive");
    if (file.IsDefined() == primitive.IsDefined())
      source_.fail(node,
                   file.IsDefined() ? "an obstacle has file and primitive" : "an obstacle has no file and no primitive",
                   "one of them");
    refuseOfPrimitive(map);
    const bool y_up = readUpAxis(map);
    map.finish();
    if (source_.fault) return;
    if (file.IsDefined())
      loadFile(file, scale, repair, y_up, shape);
    else
      makePrimitive(primitive, scale, edge, shape);
    if (source_.fault) return;
    if (!isPlainName(shape.name))
      source_.fail(node, "the obstacle's name is '" + shape.name.substr(0, 60) + "'", kPlainName);
    if (!shape.solid) source_.fail(node, "the surface of obstacle '" + shape.name + "' is open", "closed surfaces");
    if (!names_.insert(shape.name).second)
      source_.fail(node, "the name '" + shape.name + "' is taken", "each name once", ErrorCode::kDuplicateName);
    if (source_.fault) return;
    def.name = shape.name;
    def.mesh = std::move(shape.mesh);
    for (Vec3& p : def.mesh.vertices) p = shape.pose * p;
    scene_.obstacles.push_back(std::move(def));
  }

  void readInstruments(const YAML::Node& node) {
    if (!node.IsMap() || node.size() > kMostInstruments)
      return source_.fail(node, "instruments is " + shown(node), "a map of up to 20 names to instruments");
    std::set<std::string> names;
    for (const auto& entry : node) {
      std::string name;
      if (!readText(source_, entry.first, "the name of an instrument", name)) return;
      if (!isInstrumentName(name))
        return source_.fail(entry.first, "an instrument is named " + shown(entry.first), kInstrumentName);
      if (!names.insert(name).second)
        return source_.fail(entry.first, "two instruments are named '" + name + "'", "each name once",
                            ErrorCode::kDuplicateName);
      InstrumentDef def = readInstrument(source_, entry.second);
      if (source_.fault) return;
      def.name = name;
      if (const Status valid = def.validate(); !valid) return source_.fail(entry.second, valid.error().detail, "");
      scene_.instruments.push_back(std::move(def));
    }
  }

  void readAttachment(const YAML::Node& node) {
    YamlMap map(source_, node, "an attachment");
    AttachCommand attachment;
    map.text("name", attachment.name);
    const YAML::Node ends = map.get("bodies"), region = map.get("region");
    map.number("distance", lengths(0.0, true), attachment.distance);
    map.number("stiffness", {0.0, 1e15, true, "N/m^3"}, attachment.stiffness);
    double strength = 0.0;
    map.number("strength", {0.0, 1e15, true, "Pa"}, strength);
    if (map.has("strength")) attachment.strength = strength;
    if (!map.has("stiffness")) source_.fail(node, "an attachment has no stiffness", "above 0 to 1e15 N/m^3");
    map.finish();
    if (!map.has("name")) attachment.name.clear();
    if (map.has("name") && !isPlainName(attachment.name))
      source_.fail(node, "the attachment's name is '" + attachment.name.substr(0, 60) + "'", kPlainName);
    if (!ends.IsSequence() || ends.size() != 2)
      return source_.fail(node, "bodies of an attachment is " + shown(ends),
                          "a list of two names, of bodies or obstacles, or one of them world");
    for (std::size_t k = 0; k < 2; ++k) {
      std::string& name = k == 0 ? attachment.body : attachment.other;
      if (!readText(source_, ends[k], "bodies of an attachment", name)) return;
      if (name != kWorldEnd && names_.count(name) == 0)
        return source_.fail(ends[k],
                            "there is no body and no obstacle " + shown(ends[k]) + ", did you mean '" +
                                nearestWord(name, {names_.begin(), names_.end()}) + "'?",
                            "names of this scene, or world", ErrorCode::kUnknownName);
    }
    if (attachment.body != kWorldEnd && attachment.other != kWorldEnd && !map.has("distance"))
      return source_.fail(node, "an attachment has no distance", lengths(0.0, true).text());
    if (region.IsDefined()) {
      YamlMap shape(source_, region, "region");
      const YAML::Node box = shape.get("box"), plane = shape.get("plane"), sphere = shape.get("sphere");
      shape.finish();
      if (box.IsDefined() + plane.IsDefined() + sphere.IsDefined() != 1)
        return source_.fail(region, "region of an attachment has no shape or several",
                            "{box: {min, max}}, {plane: {point, normal}} or {sphere: {centre, radius}}");
      if (source_.fault) return;
      if (box.IsDefined()) attachment.region = readBox(source_, box);
      if (plane.IsDefined()) attachment.region = Region::below(readPlane(source_, plane));
      if (sphere.IsDefined()) attachment.region = readSphere(source_, sphere);
    }
    scene_.attachments.push_back(std::move(attachment));
  }

  void readBodyMaterial(const YAML::Node& node, Material& material) {
    if (!node.IsDefined()) {
      const auto found = scene_.materials.find("default");
      if (found != scene_.materials.end()) material = found->second;
    } else if (node.IsMap()) {
      material.name = "own";
      readMaterial(source_, node, "material", images_, material);
    } else {
      std::string name;
      if (!readText(source_, node, "material", name)) return;
      const auto found = scene_.materials.find(name);
      if (found != scene_.materials.end()) {
        material = found->second;
      } else if (name != "default") {  // which needs no file
        std::vector<std::string> known{"default"};
        std::string accepted = "default";
        for (const auto& entry : scene_.materials) {
          if (entry.first == "default") continue;
          known.push_back(entry.first);
          accepted += ", " + entry.first;
        }
        source_.fail(node, "unknown material " + shown(node) + ", did you mean '" + nearestWord(name, known) + "'?",
                     accepted, ErrorCode::kUnknownName);
      }
    }
  }

  static MeshRepair readRepair(YamlMap& map) {
    const int chosen = map.choice("repair", meshRepairNames());
    return chosen < 0 ? MeshRepair::kMend : static_cast<MeshRepair>(chosen);
  }

  void refuseOfPrimitive(YamlMap& map) {
    if (!map.has("primitive")) return;
    for (const char* key : {"repair", "up_axis"})
      if (map.has(key)) source_.fail(map.get(key), std::string(key) + " of a primitive", "with a file");
  }

  void readRegions(const YAML::Node& node, double scale, bool y_up, BodyDef& def) {
    const std::string accepted = "{box: {min, max}}, {sphere: {centre, radius}} or {file: PATH}, and material: NAME";
    if (!node.IsSequence() || node.size() > 100)
      return source_.fail(node, "regions is " + shown(node), "a list of up to 100 of " + accepted);
    for (const auto& entry : node) {
      YamlMap map(source_, entry, "regions");
      const YAML::Node box = map.get("box"), sphere = map.get("sphere"), file = map.get("file");
      const YAML::Node material = map.get("material");
      map.finish();
      const int shapes = box.IsDefined() + sphere.IsDefined() + file.IsDefined();
      if (shapes == 0) source_.fail(entry, "an entry of regions has no box, no sphere and no file", accepted);
      if (shapes > 1) source_.fail(entry, "an entry of regions has several shapes", accepted);
      if (!material.IsDefined()) source_.fail(entry, "an entry of regions has no material", accepted);
      if (source_.fault) return;
      TissueRegion region;
      readBodyMaterial(material, region.material);
      if (box.IsDefined()) region.region = readBox(source_, box);
      if (sphere.IsDefined()) region.region = readSphere(source_, sphere);
      if (file.IsDefined() && !source_.fault) {
        BodyDef shape;
        loadFile(file, scale, MeshRepair::kMend, y_up, shape);
        if (!source_.fault && !shape.solid) source_.fail(file, "the surface of a region is open", "closed surfaces");
        if (!source_.fault) region.region = Region::within(shape.mesh, shown(file));
      }
      if (source_.fault) return;
      if (region.material.hasFibres())
        source_.warn(material,
                     "the fibres of a region's material are not used: only tissue of the body's own has some");
      if (region.material.relaxes())
        source_.warn(material,
                     "the relaxation of a region's material is not used: all of a body relaxes as the body's "
                     "own material does");
      def.regions.push_back(std::move(region));
    }
  }

  void loadFile(const YAML::Node& node, double scale, MeshRepair repair, bool y_up, BodyDef& def) {
    std::string path;
    if (!readText(source_, node, "file", path)) return;
    const Result<std::string> real = access_.resolve(path, folder_);
    if (!real) return source_.fail(node, real.error().detail, "", real.error().code);
    const auto key = std::make_tuple(*real, scale, repair, y_up);
    auto found = shapes_.find(key);
    if (found == shapes_.end()) {
      Result<LoadedShape> loaded = loadShape(*real, scale, repair, space_, y_up);
      if (!loaded) return source_.fail(node, loaded.error().detail, "", loaded.error().code);
      const std::string file = fs::path(*real).filename().string();
      if (space_.empty() && !loaded->space.empty()) {
        if (first_space_.empty()) {
          first_space_ = loaded->space;
          first_of_space_ = file;
        } else if (first_space_ != loaded->space) {
          return source_.fail(node,
                              "'" + file + "' has its coordinates in " + loaded->space + ", and '" + first_of_space_ +
                                  "' in " + first_space_,
                              "files of one space, or the scene's key space: LPS or RAS, to which all are turned");
        }
      }
      found = shapes_.emplace(key, std::move(*loaded)).first;
    }
    def.mesh = found->second.mesh;
    def.texture = found->second.texture;
    def.solid = found->second.solid;
    def.notes = found->second.notes;
    def.warnings.insert(def.warnings.end(), found->second.warnings.begin(), found->second.warnings.end());
    if (def.name.empty()) def.name = fs::path(*real).stem().string();
  }

  void makePrimitive(const YAML::Node& node, double scale, double edge, BodyDef& def) {
    YamlMap map(source_, node, "primitive");
    const std::vector<std::string> kinds{"box", "sphere", "cylinder"};
    const std::size_t counts[] = {3, 1, 2};
    std::string chosen;
    std::vector<double> sizes;
    for (std::size_t k = 0; k < kinds.size(); ++k) {
      const YAML::Node size = map.get(kinds[k]);
      if (!size.IsDefined()) continue;
      if (!chosen.empty()) source_.fail(node, "primitive is a " + chosen + " and a " + kinds[k], "one of them");
      chosen = kinds[k];
      const NumberRange range{1e-4, kMaxLength, false, "m"};
      sizes.assign(1, 0.0);
      if (counts[k] == 1 && size.IsScalar())
        readNumber(source_, size, chosen, range, sizes[0]);
      else
        map.numbers(chosen, counts[k], range, sizes);
    }
    map.finish();
    if (chosen.empty()) source_.fail(node, "primitive is empty", "one of box, sphere, cylinder");
    if (source_.fault) return;
    for (double& size : sizes) size *= scale;
    Result<TriangleMesh> mesh = primitiveMesh(chosen, sizes, edge * scale);
    if (!mesh) return source_.fail(node, mesh.error().detail, "", mesh.error().code);
    def.mesh = std::move(*mesh);
    if (def.name.empty()) def.name = chosen;
  }

  YamlSource& source_;
  std::string folder_;
  const FileAccess& access_;
  ImageFolder images_;
  SceneDef& scene_;
  std::set<std::string> names_;
  std::string space_;                         // to which files are turned
  std::string first_space_, first_of_space_;  // of the first file that says one, and its name
  std::map<std::tuple<std::string, double, MeshRepair, bool>, LoadedShape>
      shapes_;  // copies and repeated files are read once
};

/// Adds the materials of config/materials of this package, and of the files in ../materials.
Status readMaterialFolders(const std::string& scene_folder, const FileAccess& access, MaterialFiles& materials) {
  const auto realFolder = [](const fs::path& folder) {
    std::error_code failed;
    const fs::path real = fs::canonical(folder, failed);
    return !failed && fs::is_directory(real, failed) ? real.string() : std::string();
  };
  std::string shared;
  if (access.find_package) {
    const std::string package = access.find_package("meshless_surgery");
    shared = package.empty() ? "" : realFolder(fs::path(package) / "config" / "materials");
    if (!shared.empty())
      if (Status read = materials.readFolder(shared); !read) return read;
  }
  const std::string beside = realFolder(fs::path(scene_folder) / ".." / "materials");
  if (beside.empty() || beside == shared) return Done{};
  // The same rule as for meshes, links resolved: every file in it may be read, or none is.
  std::map<std::string, std::string> files;  // by name
  std::error_code failed;
  for (fs::directory_iterator at(beside, failed), end; !failed && at != end; at.increment(failed)) {
    if (at->path().extension() != ".yaml") continue;
    const Result<std::string> real = access.resolve(at->path().string(), "");
    if (!real) {
      materials.warnings.push_back("the materials in '" + beside + "' are not read: " + real.error().detail);
      return Done{};
    }
    files[at->path().string()] = *real;
  }
  for (const auto& [name, real] : files)
    if (Status read = materials.read(real, name); !read) return read;
  return Done{};
}

}  // namespace

Result<InstrumentDef> readInstrument(const std::string& name, const std::string& yaml) {
  if (!isInstrumentName(name))
    return Error{ErrorCode::kInvalidArgument, "name is '" + name.substr(0, 60) + "'; accepted: " + kInstrumentName};
  const Result<YAML::Node> root = parseYaml(yaml, "settings");
  if (!root) return root.error();
  YamlSource source{"settings", {}};
  InstrumentDef def;
  try {
    def = readInstrument(source, *root);
  } catch (const YAML::Exception& e) {
    source.fail(*root, e.what(), "YAML");
  }
  if (source.fault) return *source.fault;
  def.name = name;
  if (const Status valid = def.validate(); !valid) return valid.error();
  return def;
}

Result<CavityFill> readCavityFill(const std::string& yaml) {
  if (yaml.empty()) return CavityFill();
  const Result<YAML::Node> root = parseYaml(yaml, "cavities");
  if (!root) return root.error();
  YamlSource source{"cavities", {}};
  CavityFill fill;
  try {
    fill = readCavities(source, *root);
  } catch (const YAML::Exception& e) {
    source.fail(*root, e.what(), "YAML");
  }
  if (source.fault) return *source.fault;
  return fill;
}

Result<SceneDef> readScene(const std::string& file, const FileAccess& access) {
  std::error_code failed;
  const fs::path real = fs::canonical(file, failed);
  if (failed || !fs::is_regular_file(real, failed))
    return Error{ErrorCode::kUnreadable, "there is no scene '" + file + "'; accepted: a YAML file"};
  FileAccess scene_access = access;
  scene_access.folders.push_back(real.parent_path().string());

  SceneDef scene;
  scene.name = real.stem().string();
  MaterialFiles files{ImageFiles(scene_access)};
  if (Status read = readMaterialFolders(real.parent_path().string(), scene_access, files); !read) return read.error();
  scene.materials = std::move(files.materials);
  scene.warnings = std::move(files.warnings);
  const Result<YAML::Node> root = readYamlFile(real.string(), file);
  if (!root) return root.error();
  // What it is instead is not shown: any file may be named as the scene.
  if (!root->IsMap())
    return Error{ErrorCode::kInvalidArgument, file + ": the scene is not a map; accepted: a map of keys and values"};
  YamlSource source{file, {}};
  try {
    SceneReader(source, real.parent_path().string(), scene_access, files.images, scene).read(*root);
  } catch (const YAML::Exception& e) {
    source.fail(*root, e.what(), "YAML");
  }
  scene.warnings.insert(scene.warnings.end(), source.warnings.begin(), source.warnings.end());
  if (!source.fault) return scene;
  for (const std::string& warning : scene.warnings) source.fault->detail += "; " + warning;
  return *source.fault;
}

}  // namespace meshless
