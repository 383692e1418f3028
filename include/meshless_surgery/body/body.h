// A body: a constant model and a state that changes. Particles carry mass; every vertex of the surface is a particle
// or is embedded between some.
#pragma once

#include <limits>
#include <memory>

#include "meshless_surgery/body/body_def.h"
#include "meshless_surgery/body/clamp.h"
#include "meshless_surgery/dynamics/elastic.h"
#include "meshless_surgery/dynamics/elastic_batch.h"
#include "meshless_surgery/geometry/lattice/cell_lattice.h"

namespace meshless {

/// How a surface vertex follows the particles.
struct SurfaceBinding {
  std::vector<Index> particle;        // one a vertex: the particle that it is, or kNoIndex for an embedded vertex
  std::vector<Index> embedded;        // embedded vertices, ascending
  std::vector<Index> offsets;         // one each, into the two below; and one more, their end
  std::vector<Index> carriers;        // particles that the embedded vertices follow
  std::vector<double> weights;        // add up to 1 for a vertex; some are negative where it lies outside of them
  Points levers;                      // [m] one each: what the carriers do not span at rest (thin sheets, crumbs)
  std::vector<Index> turners;         // one each: the cluster whose affine fit takes the lever along
  std::vector<Index> lever_clusters;  // ascending: those that take a lever along; their poses are needed with positions
  Index bound = 0;                    // embedded vertices whose carriers were searched for; the others have a parent's
};

/// What a region of a body is made of, and that over the body's own material.
struct RegionTissue {
  Material material;  // elastic constants, density and inside_color count
  double density = 1.0;
  double mu = 0.0, lambda = 0.0, youngs = 0.0;  // over the Young's modulus of the body's
};
RegionTissue regionTissue(const Material& own, const Material& body);

/// What contact takes for the surface.
struct CollisionSurface {
  TriangleMesh mesh;  // rest positions of the vertices [m]
  SurfaceBinding binding;
  double distance = 0.0;  // [m] from the visual surface, at most
};

/// The cavities of a body that are or were filled, as surfaces of their own, which turn and move with its particles: no
/// levers. They are of the surface for contact, or of the visual one where there is no other.
struct Cavities {
  struct Shell {
    std::uint32_t patch = kCavityPatch;  // of its faces
    std::vector<Triangle> triangles;     // closed, outwards of the cavity: where it is open, with lids
    bool open = false;                   // a blade has joined it with the outside
    double rest_volume = 0.0;            // [m^3] of the visual surface
    double share = 1.0;                  // that over the volume within `triangles` at rest
  };
  std::vector<Shell> shells;  // patches ascending
  SurfaceBinding binding;     // of their vertices
};

/// Constant while it lives: rest shape, topology, clusters, masses.
struct BodyModel {
  Points rest;                 // [m] particles
  std::vector<double> masses;  // [kg] > 0
  /// What shapes are matched with: the masses, and of fixed particles a multiple, so that the body follows what holds
  /// it.
  std::vector<double> match_masses;
  std::vector<bool> fixed;  // held in place
  bool any_fixed = false;
  ParticleGraph graph;
  ClusterSet clusters;
  RestShape shape;
  std::vector<ElasticRest> elastic;                   // empty where the material is an appearance material
  std::shared_ptr<const ElasticBatch> elastic_batch;  // the same, vectorised
  /// Of a body whose cells know how far they are filled (CellFill::kFilled), else null. Cluster c is cell c, corner by
  /// corner.
  std::shared_ptr<const CellLattice> lattice;
  double cell_mass = 0.0;                             // [kg] of a whole cell of it, of the body's own material
  std::vector<RegionTissue> regions;                  // of lattice->regions
  std::shared_ptr<const ElasticCells> cells;          // of it, where the material is elastic
  std::vector<ClampPoint> clamp_points;               // of it: where free tissue ends at what is held
  std::shared_ptr<const Clamp> clamp;                 // of them; null where there are none
  bool isHeld() const { return any_fixed || clamp; }  // it has no rigid motion of its own
  std::vector<bool> tissue;  // one a corner of it: no ghost; empty where all particles are tissue
  /// [1/m^2] norm of ElasticRest::spread_inverse: what a cut leaves of a cell can be narrower, so that its stress would
  /// need a shorter step. It resists as a flat cluster does.
  double most_spread_inverse = std::numeric_limits<double>::infinity();
  double specific_stiffness = 0.0;  // [m^2/s^2] Young's modulus over density; 0 of an appearance material
  double poissons_ratio = 0.0;      // of an elastic material
  double highest_frequency = 0.0;   // [rad/s] of an elastic material: see longestSubstep()
  Pose own;                         // from the frame of rest positions to the body's own, that of its file
  TriangleMesh surface;             // rest positions of the vertices [m]
  TextureMapPtr texture;            // of its file, which its pieces share; null: it has none
  SurfaceBinding binding;
  std::shared_ptr<const CollisionSurface> collision;  // null: contact takes the visual surface
  std::shared_ptr<const Cavities> cavities;           // null: none is filled
  bool solid = true;
  bool incised = false;          // it has wound faces, which can press on each other
  double spacing = 0.0;          // [m] between interior particles
  double rest_volume = 0.0;      // [m^3]; 0 where not solid
  double rest_area = 0.0;        // [m^2] of the surface
  double mass = 0.0;             // [kg]
  std::uint32_t next_patch = 1;  // for the next cut

  /// False for a corner of a cell that no tissue is near: it carries what it must, and nobody shows or picks it.
  bool isTissue(Index particle) const { return tissue.empty() || tissue[particle]; }
};

/// The model's view for dynamics/shape_matching.h, at rest.
inline MatchInput matchInput(const BodyModel& model) {
  return {model.rest, model.match_masses, model.clusters, model.shape, nullptr};
}
/// Makes what the material needs of a model whose particles, masses and clusters are there: match_masses, shape,
/// elastic and highest_frequency.
void makeMoments(BodyModel& model, const Material& material);
/// clamp, from clamp_points.
void makeClamp(BodyModel& model);
/// elastic and elastic_batch from shape, whose clusters beyond most_spread_inverse lose their linear fit.
void makeElastic(BodyModel& model);
/// 0..1: share of the mass that is held in place.
double heldShare(const BodyModel& model);
/// 0..1: share of the volume that lies in each region.
std::vector<double> regionShares(const BodyModel& model);
/// One a vertex of the surface: 0, or the number of the region that it lies in, from 1 on. Empty without regions.
std::vector<std::uint8_t> surfaceRegions(const BodyModel& model);

using BodyModelPtr = std::shared_ptr<const BodyModel>;

/// What fills a cavity.
struct FilledCavity {
  std::uint32_t patch = kCavityPatch;  // of its faces, one of those of BodyModel::cavities
  double pressure = 0.0;    // [Pa] more than around the body, where it is held; of an open one: when it was opened
  double content = 0.0;     // [m^3] of a volume, without pressure; of an open one: when it was opened
  double compliance = 0.0;  // [m^3/Pa] 0: the pressure is held
  double leak = 1.0;        // [s]
  double filled_for = 0.0;  // [s]
  double open_for = 0.0;    // [s]
  double acting = 0.0;      // [Pa] in the last substep
};

/// Changes with every step.
struct BodyState {
  Points positions;   // [m]
  Points velocities;  // [m/s]
  std::vector<ClusterPose> poses;
  Points surface;                     // [m] present positions of the surface's vertices; see updateSurface
  double swelling = 1.0;              // of goals, or of the size without stress, where the volume is held
  double stretch = 1.0;               // of an elastic body: by how much its highest frequency has grown since rest
  double pace = 1.0;                  // root of the stiffnessFactor that its velocities are of
  double stiffened = 1.0;             // share of its material's stiffness that it has; see ease.h
  double substep = 0.0;               // [s] the last one; 0 before the first
  std::vector<PlasticShape> plastic;  // one a cluster once something has flowed; empty before
  Points eased;            // [m/s^2] one a particle where a cut lets go of it little by little, else empty; see ease.h
  double eased_for = 0.0;  // [s] since that cut
  bool eased_whole = false;            // what is eased may have a force and a torque
  bool unwinding = false;              // it was wound up in itself, and goes back to its shape; see unwind.h
  std::vector<FilledCavity> cavities;  // those that are filled still
  Pose placed;                         // where the rest shape was put: what is held stays there
};

inline MatchInput matchInput(const BodyModel& model, const BodyState& state) {
  return {model.rest, model.match_masses, model.clusters, model.shape, &state.plastic};
}

struct PreparedBody {
  BodyDef def;  // mesh left out: it is in the model
  BodyModelPtr model;
  BodyState state;
};

/// Builds particles, masses, graph, clusters and binding; may take a second for large meshes. Refuses
/// (kInvalidArgument) bad spacing, material, clusters or pose, (kUnsuitableShape) an empty or flat solid, or more than
/// 200,000 particles.
Result<PreparedBody> prepareBody(BodyDef def);

/// The same body elsewhere, at rest, under another name: model is shared, and stays in the frame of `body`'s pose. Only
/// for a body without fixed particles and in the state that prepareBody gave it.
PreparedBody placedCopy(const PreparedBody& body, std::string name, const Pose& pose);

/// The same rest shape with the masses of another density, and with the moments that the other material needs. Regions
/// keep theirs; a body that has some stays elastic.
BodyModelPtr withMaterial(const BodyModelPtr& model, const Material& before, const Material& after);

/// Places state.surface for state.positions; changes nothing else.
void updateSurface(const BodyModel& model, BodyState& state);

struct BodyMeasures {
  double volume = 0.0;  // [m^3] of the present surface; 0 where not solid
  double area = 0.0;    // [m^2]
  Vec3 centre_of_mass = Vec3::Zero();
  Vec3 velocity = Vec3::Zero();          // [m/s] of the centre of mass
  Vec3 linear_momentum = Vec3::Zero();   // [kg m/s]
  Vec3 angular_momentum = Vec3::Zero();  // [kg m^2/s] about the centre of mass
  double kinetic_energy = 0.0;           // [J]
  struct Cavity {
    double volume = 0.0;    // [m^3]
    double pressure = 0.0;  // [Pa]
    bool open = false;
  };
  std::vector<Cavity> cavities;  // one a shell of BodyModel::cavities
};
/// Needs state.surface to be up to date for volume and area.
BodyMeasures measureBody(const BodyModel& model, const BodyState& state);

}  // namespace meshless
