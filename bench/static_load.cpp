#include "static_load.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "meshless_surgery/body/cell_blend.h"
#include "meshless_surgery/body/filled_cells.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "truth_surface.h"

namespace meshless::bench {
namespace {

constexpr double kOnFace = 1e-9;  // [m]

int axisOf(const std::string& name) { return name == "y" ? 1 : name == "z" ? 2 : 0; }

// Area of the face x = top that belongs to each particle [m^2], from the cells' faces in it.
std::vector<double> faceAreas(const Points& rest, double top, double spacing) {
  std::vector<double> areas(rest.size(), 0.0);
  Box face;
  for (const Vec3& p : rest)
    if (std::abs(p.x() - top) < kOnFace) face.extend(p);
  for (std::size_t i = 0; i < rest.size(); ++i) {
    if (!(std::abs(rest[i].x() - top) < kOnFace)) continue;
    areas[i] = spacing * spacing;
    for (int axis : {1, 2})
      if (rest[i][axis] < face.min[axis] + kOnFace || rest[i][axis] > face.max[axis] - kOnFace) areas[i] *= 0.5;
  }
  return areas;
}

// The spacing nearest to the wanted one, within 15 %, for which corners of the lattice lie on the plane x = plane: what
// is held ends there, and a bar's sag goes with the fourth power of its length.
double alignedSpacing(const TriangleMesh& mesh, double plane, double wanted) {
  const Box bounds = boundsOf(mesh.vertices);
  const double extent = bounds.max.x() - bounds.min.x(), middle = 0.5 * (bounds.min.x() + bounds.max.x());
  double best = wanted, least = 1e300;
  for (int k = -1500; k <= 1500; ++k) {
    const double spacing = wanted * (1.0 + 1e-4 * k);
    const double cells = std::ceil(extent / spacing - 1e-6);
    const double place = (plane - (middle - 0.5 * cells * spacing)) / spacing;
    const double off = std::abs(place - std::round(place)) + 1e-6 * std::abs(k);
    if (off < least) {
      least = off;
      best = spacing;
    }
  }
  return best;
}

struct Load {
  Points acceleration;  // [m/s^2] of dead forces
  std::vector<bool> held;
  std::vector<Index> moved;    // of them, those of the end that is moved
  Points target;               // of held particles [m]
  Points start;                // a first guess [m]
  Vec3 sphere = Vec3::Zero();  // centre [m]
  double radius = 0.0;         // [m] 0: none
  std::vector<bool> on_sphere_face;
};

// `rest` is where the particles were put.
Load makeLoad(const TruthCase& truth, const BodyModel& model, const Points& rest, double spacing) {
  const std::size_t n = rest.size();
  Load load;
  const Vec3 gravity = truth.vector("gravity");
  load.acceleration.assign(n, gravity);
  load.held.assign(n, false);
  load.target = load.start = rest;
  const int axis = axisOf(truth.text("fixed_axis"));
  for (std::size_t i = 0; i < n; ++i)
    load.held[i] = rest[i][axis] <= truth.number("fixed_below") + 0.01 * spacing + kOnFace;

  const std::string kind = truth.text("load");
  const Vec3 top = truth.has("box_max") ? truth.vector("box_max") : Vec3::Zero();
  if (kind == "end_traction" || kind == "end_torsion") {
    const std::vector<double> areas = faceAreas(rest, top.x(), spacing);
    const Vec3 centre(top.x(), 0.0, 0.0);
    for (std::size_t i = 0; i < n; ++i) {
      const Vec3 traction = kind == "end_traction"
                                ? truth.vector("traction")
                                : Vec3(truth.number("torsion_traction_slope") * Vec3::UnitX().cross(rest[i] - centre));
      load.acceleration[i] += areas[i] / model.masses[i] * traction;
    }
  } else if (kind == "end_rotation" || kind == "end_stretch") {
    const double length = top.x() - truth.vector("box_min").x();
    const double angle = kind == "end_rotation" ? truth.number("moved_rotation_degrees") * M_PI / 180.0 : 0.0;
    const Vec3 shift = kind == "end_stretch" ? truth.vector("moved_translation") : Vec3::Zero();
    for (std::size_t i = 0; i < n; ++i) {
      const double share = (rest[i].x() - truth.vector("box_min").x()) / length;
      load.start[i] = Eigen::AngleAxisd(share * angle, Vec3::UnitX()) * rest[i] + share * shift;
      if (rest[i].x() >= top.x() - kOnFace) {
        load.held[i] = true;
        load.moved.push_back(static_cast<Index>(i));
        load.target[i] = load.start[i];
      }
    }
  } else if (kind == "sphere") {
    load.radius = truth.number("sphere_radius");
    load.sphere = truth.vector("sphere_center");
    load.on_sphere_face.assign(n, false);
    for (std::size_t i = 0; i < n; ++i) load.on_sphere_face[i] = rest[i].z() > top.z() - kOnFace;
  }
  return load;
}

}  // namespace

Result<StaticResult> solveStatic(const TruthCase& truth, const std::string& folder, const StaticSettings& settings) {
  BodyDef def;
  def.name = truth.text("case");
  if (truth.has("surface")) {
    Result<TriangleMesh> surface = readSurface(folder + "/" + truth.text("surface"));
    if (!surface) return surface.error();
    def.mesh = std::move(*surface);
  } else {
    const Vec3 low = truth.vector("box_min"), high = truth.vector("box_max");
    def.mesh = boxMesh(high - low, settings.spacing);
    def.pose.translation = 0.5 * (low + high);
  }
  const double spacing =
      truth.has("surface") ? alignedSpacing(def.mesh, truth.number("fixed_below"), settings.spacing) : settings.spacing;
  def.spacing = spacing;
  def.clusters = settings.clusters;
  def.material = settings.material;
  def.material.density = truth.number("density");
  if (def.material.elastic()) {
    def.material.youngs_modulus = truth.number("youngs_modulus");
    def.material.poissons_ratio = truth.number("poissons_ratio");
  }
  const Material material = def.material;
  const Result<PreparedBody> body = prepareBody(std::move(def));
  if (!body) return body.error();
  const BodyModel& model = *body->model;
  const Load load = makeLoad(truth, model, body->state.positions, spacing);
  double largest = 0.0;
  for (const Vec3& u : truth.displacement) largest = std::max(largest, u.norm());

  const std::size_t n = model.rest.size();
  Points x = load.start, v(n, Vec3::Zero()), a;
  for (std::size_t i = 0; i < n; ++i)
    if (load.held[i]) x[i] = load.target[i];
  std::vector<ClusterPose> poses = material.elastic() ? body->state.cells : body->state.poses;
  MatchCounters counters;
  const ElasticParameters parameters =
      elasticParameters(material.youngs_modulus, material.poissons_ratio, material.density);
  const double rate = settings.appearance_rate;
  const double h = material.elastic() ? 0.6 / model.highest_frequency : 0.5 / rate;
  ElasticBatchState state;
  if (material.elastic()) model.elastic_batch->setRotations(poses, state);
  const auto accelerate = [&] {
    if (material.elastic()) {
      model.elastic_batch->accelerate(matchInput(model), parameters, x, state, a, counters);
    } else {
      matchShapes(matchInput(model), x, material.mode, material.beta, poses, a, counters);
      for (std::size_t i = 0; i < n; ++i) a[i] = rate * rate * (a[i] - x[i]);
    }
  };

  // Dynamic relaxation: damped as the Rayleigh quotient of the last motion says (Underwood 1983).
  StaticResult result;
  result.particles = n;
  result.clusters = model.groups();
  std::vector<double> times;
  Points last_a(n, Vec3::Zero()), moved(n, Vec3::Zero());
  Vec3 sphere_push = Vec3::Zero();
  int calm = 0;
  double damping = 0.0;  // [1/s]
  for (int step = 0; step < settings.max_steps && calm < 50; ++step) {
    const auto start = std::chrono::steady_clock::now();
    accelerate();
    times.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    double stiffness = 0.0, inertia = 0.0, farthest = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      stiffness -= model.masses[i] * moved[i].dot(a[i] - last_a[i]);
      inertia += model.masses[i] * moved[i].squaredNorm();
    }
    last_a = a;
    if (step > 1 && inertia > 0.0) damping = 2.0 * std::sqrt(std::max(0.0, stiffness / inertia));
    damping = std::min(damping, 1.0 / h);
    sphere_push.setZero();
    for (std::size_t i = 0; i < n; ++i) {
      if (load.held[i]) continue;
      const Vec3 before = x[i];
      v[i] = (v[i] * (1.0 - 0.5 * damping * h) + h * (a[i] + load.acceleration[i])) / (1.0 + 0.5 * damping * h);
      x[i] += h * v[i];
      if (load.radius > 0.0 && load.on_sphere_face[i]) {
        const Vec3 out = x[i] - load.sphere;
        const double depth = load.radius - out.norm();
        if (depth > 0.0) {
          const Vec3 shift = depth * out.normalized();
          x[i] += shift;
          sphere_push += model.masses[i] / (h * h) * shift;
          const double inwards = v[i].dot(out.normalized());
          if (inwards < 0.0) v[i] -= inwards * out.normalized();
        }
      }
      moved[i] = x[i] - before;
      farthest = std::max(farthest, moved[i].norm());
    }
    ++result.steps;
    // The slowest mode takes a few hundred steps: what moves less than this in one is done.
    calm = step > 200 && farthest < settings.rest * largest ? calm + 1 : 0;
  }
  result.at_rest = calm >= 50;
  result.contact_force = -sphere_push.z();
  accelerate();
  for (const Index i : load.moved) {
    const Vec3 force = -model.masses[i] * a[i];
    result.end_force += force;
    result.end_moment += x[i].cross(force).x();
  }
  std::nth_element(times.begin(), times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2), times.end());
  result.step_ms = times[times.size() / 2];

  const CellFinder finder(*model.lattice);
  const Pose& placed = body->state.placed;
  Points places;
  std::vector<Index> cells;
  for (const Vec3& p : truth.rest) {
    places.push_back(placed.rotation.conjugate() * (p - placed.translation));
    cells.push_back(finder.nearest(places.back()));
  }
  const SurfaceBinding samples = bindToCells(*model.lattice, places, cells);
  double squares = 0.0;
  for (Index s = 0; s < truth.rest.size(); ++s) {
    result.samples.push_back(samples.place(s, x));
    squares += (result.samples.back() - truth.rest[s] - truth.displacement[s]).squaredNorm();
  }
  result.largest = largest;
  result.error = std::sqrt(squares / static_cast<double>(truth.rest.size())) / largest;
  return result;
}

}  // namespace meshless::bench
