#include "truth_cube.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <optional>
#include <sstream>

#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/world/world.h"

namespace meshless::bench {
namespace {

constexpr double kEdge = 0.08;                      // [m] of the cube
constexpr double kGrid = 0.01;                      // [m] between beads
constexpr double kYoungs = 15300.0;                 // [Pa] of no matter: all is led by displacements
constexpr double kDensity = 980.0;                  // [kg/m^3]
constexpr double kGrip = 1e-3;                      // [m] one particle, which lies where the grid has the bead
constexpr double kLead = 1e5;                       // [N/m] of the springs that lead a bead
constexpr double kLeadTime = 1.0, kSettling = 4.0;  // [s]

bool isLed(const Bead& bead) { return bead.place[2] == 1 || bead.place[2] == kBeadsASide; }

// A place in the tissue: the corners around it, with their weights.
struct TissuePoint {
  std::array<Index, 8> corners{};
  std::array<double, 8> weights{};

  Vec3 of(const Points& particles) const {
    Vec3 sum = Vec3::Zero();
    for (int k = 0; k < 8; ++k) sum += weights[k] * particles[corners[k]];
    return sum;
  }
};

std::optional<TissuePoint> tissueAt(const CellLattice& lattice, const Vec3& rest) {
  for (const LatticeCell& cell : lattice.cells) {
    const Vec3 at = lattice.placeIn(cell, rest);
    if (!(at.minCoeff() >= -1e-9) || !(at.maxCoeff() <= 1.0 + 1e-9)) continue;
    TissuePoint point;
    point.corners = cell.corners;
    for (int k = 0; k < 8; ++k) point.weights[k] = trilinearWeight(k, at);
    return point;
  }
  return std::nullopt;
}

// Along x and y, of places about their mean, by least squares.
double stretchOf(const Points& rest, const Points& now) {
  Vec3 mean_rest = Vec3::Zero(), mean_now = Vec3::Zero();
  for (std::size_t k = 0; k < rest.size(); ++k) {
    mean_rest += rest[k] / static_cast<double>(rest.size());
    mean_now += now[k] / static_cast<double>(now.size());
  }
  double both = 0.0, own = 0.0;
  for (std::size_t k = 0; k < rest.size(); ++k) {
    const Eigen::Vector2d a = (rest[k] - mean_rest).head<2>(), b = (now[k] - mean_now).head<2>();
    both += a.dot(b);
    own += a.squaredNorm();
  }
  return both / own;
}

double layerStretch(const std::vector<Bead>& beads, int layer, const Points& now) {
  Points from, to;
  for (std::size_t b = 0; b < beads.size(); ++b)
    if (beads[b].place[2] == layer) {
      from.push_back(beads[b].rest);
      to.push_back(now[b]);
    }
  return stretchOf(from, to);
}

// [m] by which a layer was moved at a place: evenly between its beads, and on beyond them.
Vec3 wayBetween(const std::vector<Bead>& beads, int layer, int compression, const Vec3& place) {
  std::array<int, 2> low{};
  std::array<double, 2> share{};
  for (int axis : {0, 1}) {
    const double at = place[axis] / kGrid + 0.5 * (kBeadsASide - 1);
    low[axis] = std::clamp(static_cast<int>(std::floor(at)), 0, kBeadsASide - 2);
    share[axis] = at - low[axis];
  }
  Vec3 way = Vec3::Zero();
  for (const Bead& bead : beads) {
    // i runs along x; j along what was y before the cube was turned.
    const int i = bead.place[0] - 1, j = kBeadsASide - bead.place[1];
    if (bead.place[2] != layer || i < low[0] || i > low[0] + 1 || j < low[1] || j > low[1] + 1) continue;
    const double weight = (i == low[0] ? 1.0 - share[0] : share[0]) * (j == low[1] ? 1.0 - share[1] : share[1]);
    way += weight * (bead.then[compression] - bead.rest);
  }
  return way;
}

}  // namespace

Result<std::vector<Bead>> readTruthCube(const std::string& file) {
  std::ifstream stream(file);
  std::vector<Bead> beads;
  std::string line;
  const auto bad = [&](const std::string& why) { return Error{ErrorCode::kUnreadable, file + ": " + why}; };
  if (!stream) return bad("cannot be read");
  while (std::getline(stream, line)) {
    if (line.empty() || line[0] == '#' || line[0] == 'i') continue;
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream numbers(line);
    Bead bead;
    numbers >> bead.place[0] >> bead.place[1] >> bead.place[2];
    const auto place = [&] {
      double x = 0.0, y = 0.0, z = 0.0;
      numbers >> x >> y >> z;
      return Vec3(1e-3 * Vec3(x, -y, -z));  // turned about x: z up
    };
    bead.rest = place();
    for (Vec3& then : bead.then) then = place();
    if (!numbers) return bad("not numbers: " + line);
    beads.push_back(bead);
  }
  if (beads.size() != kBeadsASide * kBeadsASide * kBeadsASide) return bad(std::to_string(beads.size()) + " beads");
  // The middle of the cube is that of the beads, and of the grid of 1 cm in it.
  Vec3 middle = Vec3::Zero();
  for (const Bead& bead : beads) middle += bead.rest / static_cast<double>(beads.size());
  for (Bead& bead : beads) {
    bead.rest -= middle;
    for (Vec3& then : bead.then) then -= middle;
  }
  return beads;
}

Result<CubeRow> pressCube(const std::vector<Bead>& beads, int compression, double poissons_ratio, double spacing) {
  WorldSettings settings;
  settings.pick_radius = kGrip;
  settings.gravity.setZero();
  settings.ground.reset();
  World world(settings);
  BodyDef def;
  def.name = "cube";
  def.mesh = boxMesh(Vec3::Constant(kEdge), 0.01);
  def.spacing = spacing;
  def.material.youngs_modulus = kYoungs;
  def.material.poissons_ratio = poissons_ratio;
  def.material.density = kDensity;
  def.material.damping = 10.0;
  Result<PreparedBody> prepared = prepareBody(std::move(def));
  if (!prepared) return prepared.error();
  if (const auto added = world.addSceneBody(std::make_shared<const PreparedBody>(std::move(*prepared))); !added)
    return added.error();

  // The particles of both layers, also beside the beads: points alone would sink in where cells are finer than beads.
  struct Led {
    PickId pick;
    Vec3 from, way;
  };
  std::vector<Led> led;
  const int across = static_cast<int>(std::round(kEdge / spacing));
  for (const int layer : {1, kBeadsASide})
    for (int i = 0; i <= across; ++i)
      for (int j = 0; j <= across; ++j) {
        PickCommand pick;
        pick.point = Vec3(i * spacing - 0.5 * kEdge, j * spacing - 0.5 * kEdge, (layer - 4) * kGrid);
        pick.max_distance = 0.5 * spacing;
        pick.stiffness = kLead;
        const Result<Reply> picked = world.apply(pick);
        if (!picked) return picked.error();
        const auto& reply = std::get<PickReply>(*picked);
        led.push_back({reply.pick, reply.position, wayBetween(beads, layer, compression, reply.position)});
        if (const auto locked = world.apply(LockCommand{reply.pick, {}}); !locked) return locked.error();
      }
  const int steps = static_cast<int>(kLeadTime * settings.step_rate);
  for (int step = 1; step <= steps; ++step) {
    for (const Led& one : led)
      if (const auto moved = world.apply(LockCommand{one.pick, one.from + one.way * step / steps}); !moved)
        return moved.error();
    world.step();
  }
  for (int step = 0; step < kSettling * settings.step_rate; ++step) world.step();

  const WorldSnapshot shot = world.snapshot({false, true, false});
  const BodySnapshot& body = shot.bodies[0];
  CubeRow row;
  row.cells = body.model->lattice->cells.size();
  Points ours, measured;
  std::array<double, 2> heights{};  // [m] means of the led layers
  std::array<Vec3, 2> ways = {Vec3::Zero(), Vec3::Zero()};
  for (const Bead& bead : beads) {
    const std::optional<TissuePoint> point = tissueAt(*body.model->lattice, bead.rest);
    if (!point) return Error{ErrorCode::kFailed, "a bead is outside of the cube"};
    ours.push_back(point->of(body.particles));
    measured.push_back(bead.then[compression]);
    row.largest = std::max(row.largest, (measured.back() - bead.rest).norm());
    if (!isLed(bead)) continue;
    const std::size_t which = bead.place[2] == 1 ? 0 : 1;
    heights[which] += bead.rest.z() / (kBeadsASide * kBeadsASide);
    ways[which] += (measured.back() - bead.rest) / (kBeadsASide * kBeadsASide);
  }
  for (int layer = 1; layer <= kBeadsASide; ++layer) {
    row.measured[layer - 1] = layerStretch(beads, layer, measured);
    row.ours[layer - 1] = layerStretch(beads, layer, ours);
  }
  double sum = 0.0, evenly = 0.0;
  int between = 0;
  for (std::size_t b = 0; b < beads.size(); ++b) {
    const double off = (ours[b] - measured[b]).norm();
    if (isLed(beads[b])) {
      row.led += off * off / (2 * kBeadsASide * kBeadsASide);
      continue;
    }
    sum += off * off;
    row.worst = std::max(row.worst, off);
    const double share = (beads[b].rest.z() - heights[0]) / (heights[1] - heights[0]);
    const Vec3 way = ways[0] + share * (ways[1] - ways[0]);
    const double wide = row.measured[0] + share * (row.measured[kBeadsASide - 1] - row.measured[0]);
    const Vec3 there = Vec3(wide * beads[b].rest.x(), wide * beads[b].rest.y(), beads[b].rest.z()) + way;
    evenly += (there - measured[b]).squaredNorm();
    ++between;
  }
  row.led = std::sqrt(row.led);
  row.rms = std::sqrt(sum / between);
  row.uniform = std::sqrt(evenly / between);
  return row;
}

}  // namespace meshless::bench
