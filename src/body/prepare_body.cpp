// From what a user chose to particles, masses, tissue and binding.
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <iterator>
#include <limits>
#include <map>
#include <sstream>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/body/cavities.h"
#include "meshless_surgery/body/cell_blend.h"
#include "meshless_surgery/body/filled_cells.h"
#include "meshless_surgery/dynamics/plastic.h"
#include "meshless_surgery/geometry/lattice/cell_regions.h"
#include "meshless_surgery/geometry/mesh/even_surface.h"
#include "meshless_surgery/geometry/mesh/main_axes.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/refine.h"
#include "meshless_surgery/geometry/mesh/thicken.h"
#include "meshless_surgery/geometry/query/nearest.h"
#include "meshless_surgery/geometry/query/union_find.h"

namespace meshless {
namespace {

constexpr std::size_t kMaxParticles = 200000;
constexpr std::size_t kMostRegions = 100;
constexpr double kAutoCells = 1600.0;  // aimed at where no spacing is given, at most
// [1/s] Of a solid: its cells times how often a pressure wave crosses one in a second. A cell takes about two
// substeps for each crossing, and each of them a tenth of a microsecond: a twentieth of one thread's time.
constexpr double kCrossings = 4e5;
constexpr double kThinnest = 0.75;                  // of a body's mean thickness: its cells are no wider
constexpr double kCoarsest = 1.5;                   // of it, where a surface is coarse: a cube has two cells a side
constexpr double kFinest = 0.1;                     // of the spacing that was wanted
constexpr double kWidestLayer = 3.5;                // thicknesses: samples of wider cells would miss a layer
constexpr double kFlat = 0.98;                      // of alongAxes(): a layer that lies along its lattice
constexpr double kSlanted = 1.5;                    // by statics of layers at 45 degrees, 0.5 to 4 cells wide
constexpr double kResolutionStep = 1.5;             // of the spacing, from one resolution to the next
constexpr double kLeastMassShare = 0.1;             // of the mean: no particle is so light that contacts throw it
constexpr double kSmallest = 1e-3, kLargest = 2.0;  // [m] of organs
constexpr double kUsual = 2e-2;                     // [m] the least that a scale is proposed for
constexpr double kCollisionEdge = 0.8;              // of the spacing
constexpr std::size_t kMostCollisionTriangles = 200000;
constexpr std::size_t kMostNamed = 5;  // cavities, parts
constexpr double kLongestEdge = 1.5;   // of the spacing: the surface bends as finely as its cells

Error invalid(const std::string& what) { return {ErrorCode::kInvalidArgument, what}; }

bool finite(const Vec3& v) { return v.allFinite(); }

bool isPrestretched(const BodyDef& def) { return def.prestretch != Vec3::Ones(); }

Status validate(const BodyDef& def) {
  if (def.mesh.empty()) return Error{ErrorCode::kUnsuitableShape, "body '" + def.name + "' has no triangles"};
  if (!(def.spacing >= 0.0 && def.spacing <= 1e6)) {
    std::ostringstream text;
    text << "spacing is " << def.spacing << "; accepted: above 0 to 1e6 m, or 0 to choose it from the surface";
    return invalid(text.str());
  }
  if (!finite(def.pose.translation) || !def.pose.rotation.coeffs().allFinite() ||
      !(std::abs(def.pose.rotation.norm() - 1.0) < 1e-3))
    return invalid("pose of body '" + def.name + "' is not finite or its quaternion is not of unit length");
  if (def.collision.kind == CollisionChoice::Kind::kEdge &&
      !(def.collision.edge > 0.0 && def.collision.edge <= 1000.0)) {
    std::ostringstream text;
    text << "collision of body '" << def.name << "' is " << def.collision.edge
         << "; accepted: auto, visual, or an edge length above 0 to 1000 m";
    return invalid(text.str());
  }
  const ClusterOptions& c = def.clusters;
  long cells = 1;
  for (int n : c.grid) {
    if (n < 1 || n > 1000) return invalid("clusters.grid has " + std::to_string(n) + " cells; accepted: 1 to 1000");
    cells *= n;
  }
  if (cells > 100000) return invalid("clusters.grid has " + std::to_string(cells) + " cells; accepted: up to 100000");
  if (c.count < 1 || c.count > 100000)
    return invalid("clusters.count is " + std::to_string(c.count) + "; accepted: 1 to 100000");
  if (!(c.overlap >= 0.0 && c.overlap <= 1.0)) {
    std::ostringstream text;
    text << "clusters.overlap is " << c.overlap << "; accepted: 0 to 1";
    return invalid(text.str());
  }
  if (def.regions.size() > kMostRegions)
    return invalid("body '" + def.name + "' has " + std::to_string(def.regions.size()) + " regions; accepted: up to " +
                   std::to_string(kMostRegions));
  for (std::size_t r = 0; r < def.regions.size(); ++r) {
    const Material& material = def.regions[r].material;
    const std::string which = "body '" + def.name + "': regions[" + std::to_string(r) + "]";
    if (const Status valid = material.validate(); !valid) return invalid(which + ": " + valid.error().detail);
    if (!material.elastic())
      return invalid(which + " is of the appearance material '" + material.name +
                     "'; accepted: elastic materials, with a youngs_modulus");
  }
  if (!def.regions.empty() && !(def.solid && def.material.elastic()))
    return invalid("body '" + def.name + "' has regions; accepted: those of a closed body of an elastic material");
  if (const Status valid = def.cavities.validate(); !valid)
    return invalid("body '" + def.name + "': " + valid.error().detail);
  if (!((def.prestretch.array() >= 0.25).all() && (def.prestretch.array() <= 4.0).all() &&
        std::abs(def.prestretch.prod() - 1.0) < 1e-9)) {
    std::ostringstream text;
    text << "prestretch of body '" << def.name << "' is [" << def.prestretch.x() << ", " << def.prestretch.y() << ", "
         << def.prestretch.z() << "]; accepted: factors of 0.25 to 4 that keep the volume";
    return invalid(text.str());
  }
  if (!(def.fibre_direction.isZero(0.0) || std::abs(def.fibre_direction.norm() - 1.0) < 1e-9))
    return invalid("fibre_direction of body '" + def.name + "' is no direction; accepted: a unit vector, or none");
  if (def.material.hasFibres() && !def.solid)
    return invalid("body '" + def.name + "' has fibres, of its material '" + def.material.name +
                   "'; accepted: closed bodies");
  if (isPrestretched(def) && !(def.solid && def.material.elastic()))
    return invalid("body '" + def.name +
                   "' has a prestretch; accepted: that of a closed body of an elastic material, with a youngs_modulus");
  if (isPrestretched(def) && def.material.plastic())
    return invalid("body '" + def.name +
                   "' has a prestretch, and plasticity, which would take it for flow; accepted: "
                   "one of them");
  return def.material.validate();
}

// An open surface with a thickness is a solid.
Status makeLayer(BodyDef& def) {
  if (def.thickness == 0.0 && !def.solid)
    def.notes.push_back("with an open surface it cannot be filled, given a volume or cut as a solid");
  if (def.thickness == 0.0 || def.mesh.empty()) return Done{};
  Result<TriangleMesh> layer = thickened(def.mesh, def.thickness);
  if (!layer) return Error{layer.error().code, "body '" + def.name + "': " + layer.error().detail};
  std::ostringstream text;
  text << (def.solid ? "its surface is the outside of a wall of " : "its open surface is the middle of a layer of ")
       << def.thickness << " m";
  def.notes.push_back(text.str());
  def.mesh = std::move(*layer);
  def.solid = true;
  return Done{};
}

// A layer along the lattice bends right however wide the cells are; across them it is too stiff, and too soft where
// cells that are wider than it meet in a row of corners alone. `surface`: along the axes of the lattice.
void warnOfSlantedLayer(BodyDef& def, const BodyModel& model) {
  const double wanted = 0.5 * def.thickness;
  if (!(def.thickness > 0.0) || model.spacing <= wanted || alongAxes(model.surface) > kFlat) return;
  const double wide = model.spacing / def.thickness;
  std::ostringstream text;
  text << std::setprecision(3) << "where its layer of " << def.thickness << " m lies slanted in its cells of "
       << model.spacing << " m it bends too stiffly, at 45 degrees about " << std::setprecision(2)
       << 1.0 + kSlanted * wide * wide << " times";
  if (wide > 1.0)
    text
        << ", or far too softly: it is thinner than a cell, and where cells meet in a row of corners alone it folds as "
           "on a hinge";
  text << "; it stretches right. With spacing: " << std::setprecision(3) << wanted << " it is " << std::setprecision(2)
       << 1.0 + 0.25 * kSlanted << " times" << (wide > 1.0 ? " and does not fold so" : "") << ", of about "
       << std::round(model.rest_volume / std::pow(wanted, 3.0)) << " cells";
  def.warnings.push_back(text.str());
}

// [m/s]
double pressureWaveSpeed(const ElasticParameters& p) { return std::sqrt((p.lambda + 2.0 * p.mu) / p.density); }

// [m] By what a simulated second of it costs, but finer where it is thin and kAutoCells allow it. One of an appearance
// material needs no more cells than its surface has vertices.
double chooseSpacing(const BodyDef& def, double length, double volume, double area, double edge) {
  double speed = pressureWaveSpeed(elasticityOf(def.material, length));
  for (const TissueRegion& region : def.regions)
    speed = std::max(speed, pressureWaveSpeed(elasticityOf(region.material, length)));
  const double affordable = std::pow(volume * speed / kCrossings, 0.25), thickness = 2.0 * volume / area;
  double spacing = std::max(std::cbrt(volume / kAutoCells), std::min(affordable, kThinnest * thickness));
  if (!def.material.elastic()) spacing = std::max(spacing, std::min(edge, kCoarsest * thickness));
  // A layer that is thinner than its cells has one of them across.
  if (affordable > def.thickness && def.thickness > 0.0)
    spacing = std::cbrt(volume / def.thickness * speed / kCrossings);
  spacing *= std::pow(kResolutionStep, 1 - static_cast<int>(def.resolution));
  return def.thickness > 0.0 ? std::min(spacing, kWidestLayer * def.thickness) : spacing;
}

ParticleGraph linkVertices(const Points& rest, const TriangleMesh& mesh) {
  std::vector<std::array<Index, 2>> edges;
  std::vector<bool> linked(rest.size(), false);
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) {
      edges.push_back({t[k], t[(k + 1) % 3]});
      linked[t[k]] = true;
    }
  // A vertex on its own holds to its nearest neighbour.
  const NearestPoints nearest(rest);
  for (Index i = 0; i < rest.size() && rest.size() > 1; ++i)
    if (!linked[i]) {
      const std::vector<Index> two = nearest.nearest(rest[i], 2);
      edges.push_back({i, two[0] == i ? two[1] : two[0]});
    }
  return makeGraph(rest, std::move(edges));
}

// What is as near to several goes to them in equal parts: regular bodies have many such samples, and a rule that picks
// one of them moves the centre of mass.
void giveToNearest(const NearestPoints& nearest, const Points& rest, const Vec3& p, double amount,
                   std::vector<double>& share) {
  const std::vector<Index> near = nearest.nearest(p, 8);
  const double least = (rest[near[0]] - p).norm();
  std::size_t equal = 1;
  while (equal < near.size() && (rest[near[equal]] - p).norm() <= least * (1.0 + 1e-6)) ++equal;
  for (std::size_t k = 0; k < equal; ++k) share[near[k]] += amount / static_cast<double>(equal);
}

// Each particle gets the mass of what is nearest to it: an open surface is a shell as thick as its spacing.
std::vector<double> shareMass(const BodyDef& def, const TriangleMesh& mesh, const Points& rest, double spacing) {
  std::vector<double> share(rest.size(), 0.0);
  const NearestPoints nearest(rest);
  const double total = def.material.density * surfaceArea(mesh) * spacing;
  for (const Triangle& t : mesh.triangles) {
    const Vec3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    giveToNearest(nearest, rest, (a + b + c) / 3.0, (b - a).cross(c - a).norm(), share);
  }
  double sum = 0.0;
  for (double s : share) sum += s;
  const double least = sum > 0.0 ? kLeastMassShare * sum / static_cast<double>(rest.size()) : 1.0;
  sum = 0.0;
  for (double& s : share) {
    s = std::max(s, least);
    sum += s;
  }
  for (double& s : share) s *= total / sum;
  return share;
}

}  // namespace

namespace {

// The particles of an open surface: its vertices.
Status makeSheet(const BodyDef& def, BodyModel& model) {
  model.rest = model.surface.vertices;
  if (model.rest.size() > kMaxParticles)
    return invalid("body '" + def.name + "' has " + std::to_string(model.rest.size()) + " particles; accepted: up to " +
                   std::to_string(kMaxParticles));
  model.masses = shareMass(def, model.surface, model.rest, model.spacing);
  model.graph = linkVertices(model.rest, model.surface);
  model.binding = ownVertices(static_cast<Index>(model.rest.size()));
  return Done{};
}

// [m] from a place in the rest shape, which was put at `placed`, to what is held of a body at `pose`; null where
// nothing is.
HeldHeight heldHeight(const std::vector<HeldRegion>& regions, const Pose& placed, const Pose& pose) {
  if (regions.empty()) return nullptr;
  return [regions, placed, pose](const Vec3& rest) {
    const Vec3 there = placed * rest, own = pose.rotation.conjugate() * (there - pose.translation);
    double least = std::numeric_limits<double>::infinity();
    for (const HeldRegion& held : regions) least = std::min(least, held.region.height(held.in_world ? there : own));
    return least;
  };
}

// Each gets the region that is nearest to it.
void numberClampPoints(const std::vector<HeldRegion>& regions, const Pose& placed, const Pose& pose,
                       const CellLattice& lattice, std::vector<ClampPoint>& points) {
  std::vector<double> least(points.size(), std::numeric_limits<double>::infinity());
  for (std::uint32_t r = 0; r < regions.size(); ++r) {
    const HeldHeight height = heldHeight({regions[r]}, placed, pose);
    for (std::size_t k = 0; k < points.size(); ++k) {
      const double here = height(lattice.restPlace(lattice.cells[points[k].cell], points[k].at));
      if (!(here < least[k])) continue;
      least[k] = here;
      points[k].region = r;
    }
  }
}

// Every region has tissue, or whoever wrote it is wrong about where the body is.
Status findRegions(const BodyDef& def, const Pose& placed, const Pose& pose, CellLattice& lattice, BodyModel& model) {
  if (def.regions.empty()) return Done{};
  const auto own = [&](const Vec3& rest) {
    return Vec3(pose.rotation.conjugate() * (placed * rest - pose.translation));
  };
  auto found = std::make_shared<CellRegions>(findCellRegions(
      lattice, def.regions.size(),
      [&](std::size_t region, const Vec3& rest) { return def.regions[region].region.height(own(rest)); }));
  std::vector<bool> seen(def.regions.size(), false);
  for (const LatticeCell& cell : lattice.cells)
    for (const CellRegions::Part& part : found->at(cell.place))
      if (part.samples & cell.filled) seen[part.region] = true;
  for (std::size_t r = 0; r < def.regions.size(); ++r) {
    model.regions.push_back(regionTissue(def.regions[r].material, def.material));
    if (seen[r]) continue;
    Box bounds;
    for (const Vec3& v : model.surface.vertices) bounds.extend(own(v));
    std::ostringstream text;
    text << "body '" << def.name << "': regions[" << r << "], " << def.regions[r].region.text()
         << ", has no tissue of its own; accepted: what meets the body, which reaches from " << bounds.min.transpose()
         << " to " << bounds.max.transpose() << " in its own frame, is not covered by later regions, and is wider than "
         << "a quarter of its spacing of " << model.spacing << " m";
    return invalid(text.str());
  }
  lattice.regions = std::move(found);
  return Done{};
}

// The corners of the lattice cells that the solid meets; the whole surface is embedded in them.
Status makeLatticeParticles(const BodyDef& def, const SolidQuery& solid, const Pose& placed, const Pose& pose,
                            BodyModel& model) {
  Result<CellLattice> lattice = divideIntoCells(model.surface, solid, model.spacing);
  if (!lattice) return Error{lattice.error().code, "body '" + def.name + "': " + lattice.error().detail};
  if (lattice->corners > kMaxParticles)
    return invalid("body '" + def.name + "' has " + std::to_string(lattice->corners) + " particles; accepted: up to " +
                   std::to_string(kMaxParticles));
  double filled = 0.0;
  for (const LatticeCell& cell : lattice->cells) filled += momentsOf(cell.filled).fraction;
  model.cell_mass = def.material.density * model.rest_volume / filled;
  const HeldHeight held = heldHeight(def.fixed, placed, pose);
  findResistance(solid, held, *lattice);
  // In units of what a cell of that mass resists with.
  const double unit = std::pow(model.spacing, 3.0) * filled / model.rest_volume;
  for (LatticeCell& cell : lattice->cells) cell.resists.fraction *= unit;
  if (held) model.clamp_points = findClampPoints(*lattice, solid, held);
  numberClampPoints(def.fixed, placed, pose, *lattice, model.clamp_points);
  if (const Status found = findRegions(def, placed, pose, *lattice, model); !found) return found;
  model.lattice = std::make_shared<CellLattice>(std::move(*lattice));
  makeParticlesOfCells(model);
  holdCorners(model);
  return Done{};
}

void holdParticles(const std::vector<HeldRegion>& regions, const Pose& pose, BodyModel& model) {
  model.fixed.assign(model.rest.size(), false);
  const auto inside = [&](const Vec3& p) {
    return std::any_of(regions.begin(), regions.end(), [&](const HeldRegion& held) {
      return held.region.contains(held.in_world ? p : pose.rotation.conjugate() * (p - pose.translation));
    });
  };
  if (regions.empty()) return;
  for (std::size_t i = 0; i < model.rest.size(); ++i)
    if (inside(model.rest[i])) model.fixed[i] = model.any_fixed = true;
}

// Which entry of `fixed` holds what, and the middle of it: of the border at which free tissue ends, or where it has
// none of what is held.
void findHolders(const BodyDef& def, const Pose& placed, const Pose& pose, BodyModel& model) {
  const std::size_t count = def.fixed.size();
  std::vector<HeldHeight> heights;
  for (const HeldRegion& region : def.fixed) heights.push_back(heldHeight({region}, placed, pose));
  struct Mean {
    Vec3 sum = Vec3::Zero();
    double weight = 0.0;

    void add(double of, const Vec3& place) {
      sum += of * place;
      weight += of;
    }
  };
  std::vector<Mean> borders(count), particles(count);
  if (count > 1) model.held_by.assign(model.rest.size(), 0);
  for (std::size_t i = 0; i < model.rest.size(); ++i) {
    if (!model.fixed[i]) continue;
    std::uint32_t by = 0;
    for (std::uint32_t r = 1; r < count; ++r)
      if (heights[r](model.rest[i]) < heights[by](model.rest[i])) by = r;
    if (count > 1) model.held_by[i] = by;
    particles[by].add(1.0, model.rest[i]);
  }
  for (const ClampPoint& point : model.clamp_points)
    borders[point.region].add(point.area, model.lattice->restPlace(model.lattice->cells[point.cell], point.at));
  for (std::size_t r = 0; r < count; ++r) {
    const Mean& mean = borders[r].weight > 0.0 ? borders[r] : particles[r];
    model.held_middles.push_back(mean.weight > 0.0 ? Vec3(mean.sum / mean.weight) : Vec3(Vec3::Zero()));
  }
}

// Every region holds something, or whoever wrote it is wrong about where the body is.
Status checkHeld(const BodyDef& def, const Pose& placed, const Pose& pose, const BodyModel& model) {
  Points held;
  if (model.lattice) {
    for (const ClampPoint& point : model.clamp_points)
      held.push_back(model.lattice->restPlace(model.lattice->cells[point.cell], point.at));
    for (const LatticeCell& cell : model.lattice->cells)
      for (SampleSet left = cell.held ? cell.samples : kNoSample; left; left &= left - 1)
        held.push_back(model.lattice->restPlace(cell, samplePlace(lowestSample(left))));
  } else {
    for (std::size_t i = 0; i < model.rest.size(); ++i)
      if (model.fixed[i]) held.push_back(model.rest[i]);
  }
  const double near = 1e-6 * model.spacing;
  for (std::size_t r = 0; r < def.fixed.size(); ++r) {
    const HeldHeight height = heldHeight({def.fixed[r]}, placed, pose);
    if (std::any_of(held.begin(), held.end(), [&](const Vec3& p) { return height(p) <= near; })) continue;
    Box bounds;
    for (const Vec3& v : model.surface.vertices)
      bounds.extend(def.fixed[r].in_world ? placed * v : pose.rotation.conjugate() * (placed * v - pose.translation));
    std::ostringstream text;
    text << "body '" << def.name << "': fixed[" << r << "], " << def.fixed[r].region.text()
         << (def.fixed[r].in_world ? " in the world's frame" : " in the body's frame")
         << ", holds nothing of it; accepted: what meets the body, which reaches from " << bounds.min.transpose()
         << " to " << bounds.max.transpose() << " there, at a spacing of " << model.spacing << " m";
    return invalid(text.str());
  }
  return Done{};
}

Status bindFilled(const BodyDef& def, BodyModel& model) {
  const CellFinder finder(*model.lattice);
  std::vector<Index> cells;
  for (const Vec3& v : model.surface.vertices) {
    cells.push_back(finder.nearest(v));
    if (cells.back() == kNoIndex) {
      std::ostringstream text;
      text << "body '" << def.name << "' has a vertex at " << v.transpose() << " more than two cells of "
           << model.spacing << " m from the nearest that is filled; a smaller spacing sees what is thin";
      return Error{ErrorCode::kUnsuitableShape, text.str()};
    }
  }
  model.binding = bindToCells(*model.lattice, model.surface.vertices, cells);
  return Done{};
}

// The surface for contact, where it is to be another than the visual one; a note where it cannot be made.
Status makeCollision(BodyDef& def, BodyModel& model) {
  const bool asked = def.collision.kind == CollisionChoice::Kind::kEdge;
  if (def.collision.kind == CollisionChoice::Kind::kVisual) return Done{};
  const double edge = asked ? def.collision.edge : kCollisionEdge * model.spacing;
  if (!asked && meanEdgeLength(model.surface) >= edge) return Done{};
  Result<EvenSurface> even = evenSurface(model.surface, edge, kMostCollisionTriangles);
  if (!even) {
    if (asked && even.error().code == ErrorCode::kInvalidArgument)
      return invalid("collision of body '" + def.name + "': " + even.error().detail);
    def.warnings.push_back("contact takes the visual surface: " + even.error().detail);
    return Done{};
  }
  auto collision = std::make_shared<CollisionSurface>();
  collision->mesh = std::move(even->mesh);
  collision->distance = even->distance;
  const CellFinder finder(*model.lattice);
  std::vector<Index> cells;
  for (const Vec3& v : collision->mesh.vertices) cells.push_back(finder.nearest(v));
  if (std::find(cells.begin(), cells.end(), kNoIndex) != cells.end()) {
    def.warnings.push_back("contact takes the visual surface: even triangles of it are too far from its cells");
    return Done{};
  }
  collision->binding = bindToCells(*model.lattice, collision->mesh.vertices, cells);
  model.collision = std::move(collision);
  return Done{};
}

/// Which cavities it has is said where they are empty, and marked in its surface where they are to be filled.
Status findCavities(BodyDef& def, TriangleMesh& surface) {
  TriangleMesh marked;
  marked.vertices = surface.vertices;
  marked.triangles = surface.triangles;
  const std::vector<double> volumes = def.solid ? markCavities(marked) : std::vector<double>();
  if (def.cavities.empty()) {
    if (volumes.empty()) return Done{};
    std::ostringstream text;
    text << std::setprecision(3) << "it has " << volumes.size()
         << (volumes.size() == 1 ? " cavity of " : " cavities of ");
    for (std::size_t c = 0; c < volumes.size() && c < kMostNamed; ++c) text << (c > 0 ? ", " : "") << 1e6 * volumes[c];
    text << (volumes.size() > kMostNamed ? " ... ml" : " ml")
         << (volumes.size() == 1 ? ", that is empty" : ", that are empty");
    def.notes.push_back(text.str());
    return Done{};
  }
  if (volumes.empty())
    return Error{ErrorCode::kUnsuitableShape,
                 "body '" + def.name + "': cavities are to be filled, and it has none; accepted: a closed surface " +
                     "with another one inside of it"};
  surface.patches = std::move(marked.patches);
  return Done{};
}

/// Which parts it has that no link and no clamp joins; empty where it is one.
std::string partsWarning(const BodyModel& model, const Pose& placed) {
  UnionFind joined(model.rest.size());
  for (Index i = 0; i < model.graph.size(); ++i)
    for (Index k = model.graph.offsets[i]; k < model.graph.offsets[i + 1]; ++k)
      joined.join(i, model.graph.neighbours[k]);
  // What is held hangs on what holds it, and free cells on the held ones that they border on.
  Index held = kNoIndex;
  const auto hold = [&](Index particle) {
    if (held == kNoIndex) held = particle;
    joined.join(held, particle);
  };
  for (Index i = 0; i < model.fixed.size(); ++i)
    if (model.fixed[i]) hold(i);
  for (const ClampPoint& point : model.clamp_points) hold(model.lattice->cells[point.cell].corners[0]);
  std::map<Index, std::pair<double, Vec3>> found;  // mass, and its product with the middle
  for (Index i = 0; i < model.rest.size(); ++i) {
    auto& [mass, middle] = found.emplace(joined.find(i), std::pair(0.0, Vec3(Vec3::Zero()))).first->second;
    mass += model.masses[i];
    middle += model.masses[i] * model.rest[i];
  }
  if (found.size() < 2) return "";
  std::vector<std::pair<double, Vec3>> parts;
  for (const auto& [root, part] : found) parts.push_back({part.first, placed * Vec3(part.second / part.first)});
  std::stable_sort(parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::ostringstream text;
  text << std::setprecision(3) << "it has " << parts.size() << " parts that hang together with nothing:";
  for (std::size_t k = 0; k < parts.size() && k < kMostNamed; ++k)
    text << (k > 0 ? ", " : " ") << 100.0 * parts[k].first / model.mass << " % of its mass around ("
         << parts[k].second.x() << ", " << parts[k].second.y() << ", " << parts[k].second.z() << ") m";
  if (parts.size() > kMostNamed) text << " ...";
  return text.str();
}

/// What is no size of an organ is most often in other units than metres; empty where it is one, or has no size.
std::string sizeWarning(const Points& vertices) {
  const Box bounds = boundsOf(vertices);
  const double longest = (bounds.max - bounds.min).maxCoeff();
  if (!(longest > 0.0 && std::isfinite(longest)) || (longest >= kSmallest && longest <= kLargest)) return "";
  std::ostringstream text;
  text << std::setprecision(3) << "it is " << longest << " m long; organs are " << kSmallest << " to " << kLargest
       << " m";
  for (const auto& [units, scale] :
       {std::pair("units: mm, or ", 1e-3), std::pair("units: cm, or ", 1e-2), std::pair("", 1e2), std::pair("", 1e3)}) {
    const double scaled = longest * scale;
    if (!(scaled >= kUsual && scaled <= kLargest)) continue;
    text << "; " << units << "scale: " << scale << " makes it " << scaled << " m long";
    break;
  }
  return text.str();
}

// Cells, particles and binding. What is thinner than the samples of its cells gets finer ones.
Status makeSolid(BodyDef& def, const Pose& placed, const Pose& pose, BodyModel& model) {
  const SolidQuery solid(model.surface);
  const double wanted = model.spacing;
  Status first = Done{};
  for (;;) {
    BodyModel made = model;
    Status status = makeLatticeParticles(def, solid, placed, pose, made);
    if (status) {
      // What touches a face between its corners dents it there.
      made.surface = withShortEdges(std::move(made.surface), kLongestEdge * made.spacing);
      status = bindFilled(def, made);
    }
    if (!status) {
      if (first) first = status;
      if (status.error().code != ErrorCode::kUnsuitableShape || model.spacing < kFinest * wanted) return first;
      model.spacing *= 0.5;
      continue;
    }
    if (model.spacing < wanted) {
      std::ostringstream text;
      text << std::setprecision(3) << "its spacing is " << model.spacing << " m: cells of " << wanted
           << " m do not see what is thin of it";
      def.warnings.push_back(text.str());
    }
    model = std::move(made);
    return Done{};
  }
}

Result<PreparedBody> prepared(BodyDef def) {
  if (Status made = makeLayer(def); !made) return made.error();
  if (Status status = validate(def); !status) return status.error();
  auto model = std::make_shared<BodyModel>();
  TriangleMesh& surface = model->surface;
  surface = std::move(def.mesh);
  def.mesh = TriangleMesh();
  model->texture = std::move(def.texture);
  const Pose pose{def.pose.rotation.normalized(), def.pose.translation};
  // A lattice lies along the body's own axes, so that turning the body turns all that is made of it.
  Pose placed;
  if (def.solid) {
    const Mat3 axes = mainAxes(surface);
    for (Vec3& v : surface.vertices) v = axes.transpose() * v;
    placed = {pose.rotation * Quat(axes), pose.translation};
    model->own.rotation = Quat(axes);
    model->fibre_direction = axes.transpose() * def.fibre_direction;
    const Vec3 logarithm = -def.prestretch.array().log();
    if (isPrestretched(def)) model->unstressed = plasticShape(axes.transpose() * logarithm.asDiagonal() * axes);
  } else {
    model->own = {pose.rotation.conjugate(), pose.rotation.conjugate() * -pose.translation};
    for (Vec3& v : surface.vertices) v = pose * v;
  }
  for (const Vec3& v : surface.vertices)
    if (!finite(v))
      return Error{ErrorCode::kUnsuitableShape, "body '" + def.name + "' has vertices that are not finite"};
  if (surface.patches.empty()) surface.patches.assign(surface.triangles.size(), kOuterPatch);

  const double edge = meanEdgeLength(surface);
  const Box bounds = boundsOf(surface.vertices);
  if (!(edge > 0.0)) return Error{ErrorCode::kUnsuitableShape, "body '" + def.name + "' has no extent"};
  const double volume = def.solid ? signedVolume(surface) : 0.0;
  if (def.solid && !(volume > 1e-12 * std::pow(bounds.diagonal(), 3.0))) {
    std::ostringstream text;
    text << "body '" << def.name << "' encloses a volume of " << volume << " m^3; a solid needs more than 1e-12 of its "
         << "diagonal cubed";
    return Error{ErrorCode::kUnsuitableShape, text.str()};
  }
  if (const Status found = findCavities(def, surface); !found) return found.error();
  if (def.solid && def.material.elastic() && def.clusters.kind != ClusterOptions::Kind::kAuto &&
      def.clusters.kind != ClusterOptions::Kind::kCells)
    def.warnings.push_back("its clusters are for appearance materials: '" + def.material.name +
                           "' is elastic, and has none");
  model->solid = def.solid;
  model->grouping = def.clusters;
  model->length = (bounds.max - bounds.min).maxCoeff();
  model->rest_volume = volume;
  model->rest_area = surfaceArea(surface);
  model->spacing = def.spacing;
  if (!(model->spacing > 0.0)) {
    model->spacing = def.solid ? chooseSpacing(def, model->length, volume, model->rest_area, edge) : edge;
    warnOfSlantedLayer(def, *model);
  }
  if (def.solid && volume / std::pow(model->spacing, 3.0) > static_cast<double>(kMaxParticles)) {
    std::ostringstream text;
    text << std::setprecision(3);
    if (!(def.spacing > 0.0) && def.thickness > 0.0)
      text << "its layer of " << def.thickness << " m takes a spacing of at most " << kWidestLayer * def.thickness
           << " m: ";
    text << "spacing " << model->spacing << " m would give body '" << def.name << "' about "
         << volume / std::pow(model->spacing, 3.0) << " particles; accepted: up to " << kMaxParticles
         << ", a spacing of at least " << std::cbrt(volume / static_cast<double>(kMaxParticles)) << " m";
    return invalid(text.str());
  }

  if (Status made = def.solid ? makeSolid(def, placed, pose, *model) : makeSheet(def, *model); !made)
    return made.error();

  for (double m : model->masses) model->mass += m;
  if (!model->lattice) holdParticles(def.fixed, pose, *model);
  if (Status holds = checkHeld(def, placed, pose, *model); !holds) return holds.error();
  findHolders(def, placed, pose, *model);
  makeTissue(*model, def.material);
  if (model->lattice) {
    if (Status made = makeCollision(def, *model); !made) return made.error();
  } else {
    if (def.collision.kind == CollisionChoice::Kind::kEdge)
      def.warnings.push_back("contact takes the visual surface: collision is of solids");
  }

  if (const std::string warning = partsWarning(*model, placed); !warning.empty()) def.warnings.push_back(warning);

  Result<std::vector<FilledCavity>> filled = std::vector<FilledCavity>();
  if (!def.cavities.empty()) {
    if (model->collision) {
      auto collision = std::make_shared<CollisionSurface>(*model->collision);
      if (markCavities(surface, collision->mesh)) model->collision = std::move(collision);
    }
    makeCavities(*model);
    filled = filledCavities(*model, def.cavities);
    if (!filled) return Error{filled.error().code, "body '" + def.name + "': " + filled.error().detail};
    std::ostringstream text;
    text << std::setprecision(3);
    for (const Cavities::Shell& shell : model->cavities->shells)
      text << (text.tellp() > 0 ? ", " : "its filled cavities hold ") << 1e6 * shell.rest_volume;
    def.notes.push_back(text.str() + " ml at rest");
  }

  if (!def.fixed.empty()) {
    std::ostringstream text;
    text << std::setprecision(3) << 100.0 * heldShare(*model) << " % of it is held";
    def.notes.push_back(text.str());
  }
  const std::vector<double> shares = regionShares(*model);
  for (std::size_t r = 0; r < shares.size(); ++r) {
    std::ostringstream text;
    text << std::setprecision(3) << 100.0 * shares[r] << " % of it is of " << def.regions[r].material.name << ", in "
         << def.regions[r].region.text();
    def.notes.push_back(text.str());
  }

  PreparedBody body;
  body.state = restState(*model, placed);
  body.state.cavities = std::move(*filled);
  body.def = std::move(def);
  body.model = std::move(model);
  return body;
}

}  // namespace

Result<PreparedBody> prepareBody(BodyDef def) {
  const std::string size = sizeWarning(def.mesh.vertices);
  if (!size.empty()) def.warnings.push_back(size);
  Result<PreparedBody> body = prepared(std::move(def));
  // Whatever is refused of it, its size is most often why.
  if (!body && !size.empty()) return Error{body.error().code, body.error().detail + "; " + size};
  return body;
}

PreparedBody placedCopy(const PreparedBody& body, std::string name, const Pose& pose) {
  PreparedBody copy = body;
  copy.def.name = std::move(name);
  copy.def.pose = pose;
  const Quat turn = pose.rotation.normalized() * body.def.pose.rotation.normalized().conjugate();
  const Pose motion{turn, pose.translation - turn * body.def.pose.translation};
  copy.state = restState(*copy.model,
                         {(turn * body.state.placed.rotation).normalized(), motion * body.state.placed.translation});
  copy.state.cavities = body.state.cavities;
  return copy;
}

}  // namespace meshless
