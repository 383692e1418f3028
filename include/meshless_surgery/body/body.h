// A body: a constant model and a state that changes. Particles carry mass; every vertex of the surface is a particle
// or is embedded between some.
#pragma once

#include <memory>

#include "meshless_surgery/body/body_def.h"
#include "meshless_surgery/body/clamp.h"
#include "meshless_surgery/body/held_motion.h"
#include "meshless_surgery/dynamics/elastic.h"
#include "meshless_surgery/dynamics/elastic_batch.h"
#include "meshless_surgery/geometry/lattice/cell_lattice.h"

namespace meshless {

/// How the vertices of a surface follow the particles: a sparse matrix of weights that add up to 1 for a vertex. Those of
/// a body without an inside are particles themselves.
struct SurfaceBinding {
  std::vector<Index> offsets;   // vertices + 1
  std::vector<Index> carriers;  // particles
  std::vector<double> weights;  // some are negative where a vertex lies outside of its carriers
  std::vector<Index> cells;     // one a vertex: whose tissue it is of; empty without cells

  Index size() const { return offsets.empty() ? 0 : static_cast<Index>(offsets.size() - 1); }
  /// Where its carriers have a vertex [m].
  Vec3 place(Index vertex, const Points& positions) const {
    Vec3 sum = Vec3::Zero();
    for (Index k = offsets[vertex]; k < offsets[vertex + 1]; ++k) sum += weights[k] * positions[carriers[k]];
    return sum;
  }
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

/// The cavities of a body that are or were filled, as surfaces of their own. They are of the surface for contact, or of
/// the visual one where there is no other.
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

/// Constant while it lives: rest shape, topology, tissue, masses. The particles of a solid are the corners of filled
/// cells, whatever its material; those of a body without an inside are the vertices of its surface or the points of its
/// cloud.
struct BodyModel {
  Points rest;                 // [m] particles
  std::vector<double> masses;  // [kg] > 0
  std::vector<bool> fixed;     // held in place
  bool any_fixed = false;
  ParticleGraph graph;
  // What pulls: cells, and over them clusters with goals where the material is one of appearance. Of a body without an
  // inside its clusters, with goals or elastic.
  std::shared_ptr<const CellLattice> lattice;         // of a solid, else null
  double cell_mass = 0.0;                             // [kg] of a whole cell of it, of the body's own material
  std::vector<RegionTissue> regions;                  // of lattice->regions
  std::shared_ptr<const ElasticCells> cells;          // of it
  std::vector<ClampPoint> clamp_points;               // of it: where free tissue ends at what is held
  std::shared_ptr<const Clamp> clamp;                 // of them; null where there are none
  bool isHeld() const { return any_fixed || clamp; }  // it has no rigid motion of its own
  Points held_middles;                  // [m] one an entry of `fixed`, of what it holds at rest
  std::vector<std::uint32_t> held_by;   // one a particle, the entry that holds it if one does; empty: there is one entry
  std::uint32_t holderOf(Index particle) const { return held_by.empty() ? 0 : held_by[particle]; }
  std::vector<bool> tissue;  // one a corner of it: no ghost; empty where all particles are tissue
  ClusterOptions grouping;   // how clusters are made where a material needs them
  ClusterSet clusters;       // empty where the material of a solid is elastic
  RestShape shape;
  /// What clusters are matched with: the masses, and of fixed particles a multiple, so that goals follow what is held.
  std::vector<double> match_masses;
  std::vector<ElasticRest> elastic;                   // of clusters that are elastic
  std::shared_ptr<const ElasticBatch> elastic_batch;  // of cells or elastic clusters, vectorised; null: there are none
  Vec3 fibre_direction = Vec3::Zero();  // at rest; zero: along the body
  std::vector<Vec3> fibres;             // unit, one a cell of it where the material has or had fibres, else empty
  double specific_fibres = 0.0;         // [m^2/s^2] their stiffness over density
  double length = 0.0;              // [m] longest extent at rest, of a piece that of the body that was cut first
  double specific_stiffness = 0.0;  // [m^2/s^2] Young's modulus over density
  double poissons_ratio = 0.0;
  double highest_frequency = 0.0;  // [rad/s] of cells or elastic clusters: see longestSubstep()
  Pose own;                        // from the frame of rest positions to the body's own, that of its file
  PlasticShape unstressed;         // of each cell at the start; its inverse is the prestretch
  bool isPrestretched() const { return unstressed.stiffening > 1.0; }
  TriangleMesh surface;            // rest positions of the vertices [m]
  TextureMapPtr texture;           // of its file, which its pieces share; null: it has none
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

  /// Whether an entry of `fixed` holds any of it; of a piece some do not.
  bool isHeldBy(std::uint32_t entry) const;
  /// False for a corner of a cell that no tissue is near: it carries what it must, and nobody shows or picks it.
  bool isTissue(Index particle) const { return tissue.empty() || tissue[particle]; }
  /// Groups of particles that pull: clusters, or cells where there are none.
  Index groups() const { return clusters.size() > 0 ? clusters.size() : static_cast<Index>(lattice->cells.size()); }
};

/// The model's view for dynamics/shape_matching.h, at rest.
inline MatchInput matchInput(const BodyModel& model) {
  return {model.rest, model.match_masses, model.clusters, model.shape, nullptr};
}
/// Makes what the material needs of a model whose particles and masses are there: cells, clusters (if there are none
/// yet) with their moments, stiffness and frequency.
void makeTissue(BodyModel& model, const Material& material);
/// Lame's constants and density of the cells of a body of that longest extent [m]. Under the goals of an appearance
/// material they are as stiff as carries the weight of a body as long as it is: how it wobbles and springs back is its
/// goals' matter, and not whether it stands.
ElasticParameters elasticityOf(const Material& material, double length);
/// The same of what cells or elastic clusters are of, stiffened by a factor.
ElasticParameters ownElasticity(const BodyModel& model, const Material& material, double factor = 1.0);
/// The stiffness over density that highest_frequency is of.
ElasticParameters specificElasticity(const BodyModel& model);
/// clamp, from clamp_points.
void makeClamp(BodyModel& model);
/// cells and elastic_batch of the lattice, or of the clusters where they are elastic.
void makeElastic(BodyModel& model);
/// 0..1: share of the mass that is held in place.
double heldShare(const BodyModel& model);
/// 0..1: share of the volume that lies in each region.
std::vector<double> regionShares(const BodyModel& model);
/// Young's modulus around each particle of a lattice, over that of the body's material. Empty without regions.
std::vector<double> stiffnessOfParticles(const BodyModel& model);
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
  std::vector<ClusterPose> poses;     // of clusters
  std::vector<ClusterPose> cells;     // of cells
  Points surface;                     // [m] present positions of the surface's vertices; see updateSurface
  double swelling = 1.0;              // of goals, and of the size without stress, where the volume is held
  double stretch = 1.0;               // by how much the highest frequency has grown since rest
  double pace = 1.0;                  // root of the stiffnessFactor that its velocities are of
  double stiffened = 1.0;             // share of its material's stiffness that it has; see stiffenedBy()
  double substep = 0.0;               // [s] the last one; 0 before the first
  std::vector<PlasticShape> plastic;  // one a cluster once something has flowed; empty before
  std::vector<PlasticShape> plastic_cells;  // likewise
  std::vector<RelaxedStrain> relaxed;       // one a cell of a material that relaxes, from the first substep on
  std::vector<FilledCavity> cavities;  // those that are filled still
  Pose placed;                         // where the rest shape was put: what is held stays there, but for `held`
  std::vector<HeldMotion> held;        // by the entries of `fixed`; those from the last on that was moved are left out
};

inline MatchInput matchInput(const BodyModel& model, const BodyState& state) {
  return {model.rest, model.match_masses, model.clusters, model.shape, &state.plastic};
}

struct PreparedBody {
  BodyDef def;  // mesh left out: it is in the model
  BodyModelPtr model;
  BodyState state;
};

/// Builds particles, masses, tissue and binding; may take a second for large meshes. Refuses
/// (kInvalidArgument) bad spacing, material, clusters or pose, (kUnsuitableShape) an empty or flat solid, or more than
/// 200,000 particles.
Result<PreparedBody> prepareBody(BodyDef def);

/// The same body elsewhere, at rest, under another name: model is shared, and stays in the frame of `body`'s pose. Only
/// for a body without fixed particles and in the state that prepareBody gave it.
PreparedBody placedCopy(const PreparedBody& body, std::string name, const Pose& pose);

/// The same rest shape with the masses of another density, and with the tissue that the other material needs. Regions
/// keep theirs; a body that has some stays elastic.
BodyModelPtr withMaterial(const BodyModelPtr& model, const Material& before, const Material& after);

/// The state that is at rest under `placed`.
BodyState restState(const BodyModel& model, const Pose& placed);

/// Clusters of a body that has changed its family of materials start where its particles are.
void fitPoses(const BodyModel& model, BodyState& state);

/// For BodyState::stiffened, once a body that was `before` of the `old` material is `model` of another one: the share
/// of its stiffness with which it pulls as hard as until now, at most 1. All of it at once would give strained tissue
/// energy. h: the last substep [s].
double stiffenedBy(const BodyModel& before, const Material& old, const BodyModel& model, const Material& material,
                   double h, const BodyState& state);

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
