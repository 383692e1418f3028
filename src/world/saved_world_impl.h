// What a saved world holds, and how every part of it is written. Structured bindings name every field of a struct: one
// that is added and not kept does not compile.
#pragma once

#include <zlib.h>

#include "meshless_surgery/base/archive.h"
#include "meshless_surgery/geometry/lattice/cell_regions.h"
#include "meshless_surgery/world/saved_world.h"
#include "world_impl.h"

namespace meshless {

constexpr std::uint32_t kStateVersion = 33;

inline std::uint32_t checksum(std::string_view bytes) {
  return static_cast<std::uint32_t>(
      crc32_z(crc32_z(0, nullptr, 0), reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

struct SavedBody : KeptBody {
  std::uint32_t batch = kNoIndex;  // which of World::Impl::batches it is in
};

struct SavedWorld : KeptWorld {
  std::vector<SavedBody> bodies;
  std::uint32_t batches = 0;
  std::vector<std::shared_ptr<const ObstacleDef>> obstacles;
  SurfaceMemory surface_contacts;
};

// Writing goes over constant values: cereal takes the const away and hands them to serialize(), which only reads then.

MESHLESS_ARCHIVE(BodyId, slot, generation)
MESHLESS_ARCHIVE(Pose, rotation, translation)
template <class A>
void serialize(A& archive, Box& v) {
  auto& [min, max] = v;
  if constexpr (std::is_same_v<A, InArchive>) {  // the box of nothing, and one without end, have the largest numbers
    for (Vec3* corner : {&min, &max}) {
      archive.take(corner->data(), 3 * sizeof(double));
      if (corner->hasNaN()) throw ArchiveFault("a box has no corner");
    }
  } else {
    archive(min, max);
  }
}
MESHLESS_ARCHIVE(Color, r, g, b, a)
MESHLESS_ARCHIVE(TriangleMesh, vertices, triangles, patches)
MESHLESS_ARCHIVE(ResponseCurve, points)
MESHLESS_ARCHIVE(Relaxation, share, time)
MESHLESS_ARCHIVE(Fibres, stiffness, stiffening)
MESHLESS_ARCHIVE(Plasticity, yield, creep, maximum)
/// What many share, a file has once, where it comes first: write() and read() are for that.
template <class T, class Write>
void saveShared(OutArchive& archive, const std::shared_ptr<const T>& value, const Write& write) {
  archive(value != nullptr);
  if (!value) return;
  const std::size_t known = archive.shared();
  archive(archive.placeOf(value.get()));
  if (archive.shared() > known) write();
}
template <class T, class Read>
void loadShared(InArchive& archive, std::shared_ptr<const T>& value, const Read& read) {
  bool there = false;
  archive(there);
  value.reset();
  if (!there) return;
  std::uint32_t place = 0;
  archive(place);
  auto& known = archive.shared();
  if (place > known.size()) throw ArchiveFault("what is shared is not there");
  if (place == known.size()) {
    Result<std::shared_ptr<const T>> made = read();
    if (!made) throw ArchiveFault(made.error().detail);
    known.emplace_back(*made);
  }
  const auto* shared = std::any_cast<std::shared_ptr<const T>>(&known[place]);
  if (!shared) throw ArchiveFault("what is shared is of another kind");
  value = *shared;
}
inline void save(OutArchive& archive, const ImagePtr& image) {
  saveShared(archive, image, [&] { archive(image->width(), image->height(), image->rgb()); });
}
inline void save(HashArchive& archive, const ImagePtr& image) { archive(image ? image->id() : std::uint64_t{0}); }
inline void load(InArchive& archive, ImagePtr& image) {
  loadShared(archive, image, [&archive] {
    std::uint32_t width = 0, height = 0;
    std::vector<std::uint8_t> rgb;
    archive(width, height, rgb);
    return Image::make(width, height, std::move(rgb));
  });
}
inline void save(OutArchive& archive, const TextureMapPtr& texture) {
  saveShared(archive, texture, [&] { archive(texture->surface(), texture->points()); });
}
inline void save(HashArchive& archive, const TextureMapPtr& texture) {
  if (texture) archive(texture->surface(), texture->points());
}
inline void load(InArchive& archive, TextureMapPtr& texture) {
  loadShared(archive, texture, [&archive] {
    TriangleMesh surface;
    std::vector<TexturePoint> points;
    archive(surface, points);
    return TextureMap::make(std::move(surface), std::move(points));
  });
}
template <class A>
void serialize(A& archive, Look& v) {
  auto& [noise, second, image, scale, wetness, bump] = v;
  archive(choice(noise, Noise::kImage), second, image, scale, wetness, bump);
}
MESHLESS_ARCHIVE(Appearance, outer, inner)
template <class A>
void serialize(A& archive, Material& v) {
  auto& [name, youngs_modulus, poissons_ratio, stiffening, asymmetry, mode, alpha, beta, density, damping, friction,
         restitution, toughness, self_contact, volume, area, plasticity, relaxation, fibres, color, inside_color,
         appearance] = v;
  archive(name, youngs_modulus, poissons_ratio, stiffening, asymmetry, choice(mode, MatchMode::kQuadratic), alpha, beta,
          density, damping, friction, restitution, toughness, choice(self_contact, SelfContact::kAll), volume, area,
          plasticity, relaxation, fibres, color, inside_color, appearance);
}
template <class A>
void serialize(A& archive, WorldSettings& v) {
  auto& [gravity, ground, ground_friction, step_rate, substeps, max_substeps, contact, threads, sleep,
         pick_max_distance, pick_stiffness, pick_radius, push_radius] = v;
  archive(gravity, ground, ground_friction, step_rate, substeps, max_substeps, choice(contact, ContactMethod::kSurface),
          threads, sleep, pick_max_distance, pick_stiffness, pick_radius, push_radius);
}

// --- models

template <class A>
void serialize(A& archive, ClusterOptions& v) {
  auto& [kind, grid, count, overlap] = v;
  archive(choice(kind, ClusterOptions::Kind::kCells), grid, count, overlap);
}
MESHLESS_ARCHIVE(ParticleGraph, offsets, neighbours, lengths)
template <class A>
void serialize(A& archive, ClusterSet& v) {
  auto& [offsets, members, weights, seeds, radii] = v;
  archive(offsets, members, weights, seeds, endless(radii));
}
MESHLESS_ARCHIVE(ClusterRest, mass, centre, size, linear_rank, quadratic_rank, moment_inverse)
MESHLESS_ARCHIVE(QuadraticRest, mean, moment_inverse)
MESHLESS_ARCHIVE(RestShape, clusters, quadratic)
MESHLESS_ARCHIVE(ElasticRest, spread_inverse, spread)
MESHLESS_ARCHIVE(SurfaceBinding, offsets, carriers, weights, cells)
MESHLESS_ARCHIVE(Resistance, fraction, centroid, variance)
MESHLESS_ARCHIVE(ClampPoint, cell, at, area, region)
MESHLESS_ARCHIVE(LatticeCell, corners, place, samples, filled, held, resists, parted, mass_share, stiffness_share,
                 bridge, face)
MESHLESS_ARCHIVE(CellRegions::Part, place, region, samples)
template <class A>
void serialize(A& archive, CellLattice& v) {
  auto& [spacing, origin, corners, cells, regions] = v;
  std::vector<CellRegions::Part> parts;
  if (regions) parts = regions->parts();
  archive(spacing, origin, corners, cells, parts);
  if constexpr (std::is_same_v<A, InArchive>)
    if (!parts.empty()) regions = std::make_shared<CellRegions>(std::move(parts));
}
MESHLESS_ARCHIVE(RegionTissue, material, density, mu, lambda, youngs)
MESHLESS_ARCHIVE(CollisionSurface, mesh, binding, distance)
/// elastic_batch, cells, clamp, tissue and cavities are made again by whoever reads, once all is checked; empty until
/// then.
template <class A>
void serialize(A& archive, BodyModel& v) {
  auto& [rest, masses, fixed, any_fixed, graph, lattice, cell_mass, regions, cells, clamp_points, clamp, held_middles,
         held_by, tissue, grouping, clusters, shape, match_masses, elastic, elastic_batch, fibre_direction, fibres,
         specific_fibres, length, specific_stiffness, poissons_ratio, highest_frequency, own, unstressed, surface,
         texture, binding, collision, cavities, solid, incised, spacing, rest_volume, rest_area, mass, next_patch] = v;
  (void)elastic_batch, (void)cells, (void)clamp, (void)tissue, (void)cavities;
  auto of_contact = collision ? *collision : CollisionSurface();
  auto of_cells = lattice ? *lattice : CellLattice();
  std::vector<std::uint8_t> held(fixed.begin(), fixed.end());
  archive(of_cells, cell_mass, regions, clamp_points, held_middles, held_by, fibre_direction, fibres, specific_fibres);
  archive(rest, masses, held, any_fixed, graph, grouping, clusters, shape, match_masses, elastic, length,
          specific_stiffness, poissons_ratio, highest_frequency, own, unstressed, surface, texture, binding, of_contact,
          solid, incised, spacing, rest_volume, rest_area, mass, next_patch);
  if constexpr (std::is_same_v<A, InArchive>) {
    if (!of_contact.mesh.vertices.empty()) collision = std::make_shared<CollisionSurface>(std::move(of_contact));
    if (!of_cells.cells.empty()) lattice = std::make_shared<CellLattice>(std::move(of_cells));
    fixed.clear();
    for (const std::uint8_t h : held) fixed.push_back(h != 0);
  }
}

// --- states

MESHLESS_ARCHIVE(ClusterPose, centre, rotation, deformation)
MESHLESS_ARCHIVE(PlasticShape, stretch, inverse, stiffening)
MESHLESS_ARCHIVE(RelaxedStrain, of)
MESHLESS_ARCHIVE(HeldMotion, middle, now, target, left)
MESHLESS_ARCHIVE(FilledCavity, patch, pressure, content, compliance, leak, filled_for, open_for, acting)
template <class A>
void serialize(A& archive, BodyState& v) {
  auto& [positions, velocities, poses, cells, surface, swelling, stretch, pace, stiffened, substep, plastic,
         plastic_cells, relaxed, cavities, placed, held] = v;
  // Whether the surface is up to date depends on when it was read. The fields that follow do not.
  if constexpr (!std::is_same_v<A, HashArchive>) archive(surface);
  archive(positions, velocities, poses, cells, swelling, stretch, pace, stiffened, substep, plastic, plastic_cells,
          relaxed, cavities, placed, held);
}
MESHLESS_ARCHIVE(Plane, normal, point)
template <class A>
void serialize(A& archive, Region& v) {
  archive(choice(v.kind, Region::Kind::kSphere), v.box, v.plane, v.centre, v.radius);
}
template <class A>
void serialize(A& archive, HeldRegion& v) {
  archive(v.region, v.in_world);
}
template <class A>
void serialize(A& archive, CollisionChoice& v) {
  archive(choice(v.kind, CollisionChoice::Kind::kEdge), v.edge);
}
template <class A>
void serialize(A& archive, CavityFill& v) {
  auto& [kind, pressure, volume, compliance, leak] = v;
  archive(choice(kind, CavityFill::Kind::kVolume), pressure, volume, compliance, leak);
}
template <class A>
void serialize(A& archive, BodyDef& v) {
  auto& [name, mesh, texture, solid, thickness, pose, spacing, resolution, clusters, collision, material, fixed,
         cavities, prestretch, fibre_direction, regions, copy, notes, warnings] = v;
  (void)texture, (void)regions, (void)thickness, (void)prestretch, (void)fibre_direction;  // the model has them
  archive(name, mesh, solid, pose, spacing, choice(resolution, Resolution::kFine), clusters, collision, material, fixed,
          cavities, copy, notes, warnings);
}
MESHLESS_ARCHIVE(ObstacleDef, name, mesh, friction, color)

// --- tools and commands

MESHLESS_ARCHIVE(ScissorBlades, origin, x_axis, y_axis, length, width)
MESHLESS_ARCHIVE(Blade, origin, x_axis, y_axis, length, depth, rise, behind)
template <class A>
void serialize(A& archive, Pick& v) {
  auto& [id, body, particle, place, patch, weights, target, reached, locked, latch, stiffness, position, force] = v;
  archive(id, body, particle, place.cell, place.at, patch, weights, target, reached, locked, latch, stiffness, position,
          force);
}
MESHLESS_ARCHIVE(BodyPoint, particles, weights)
MESHLESS_ARCHIVE(Fibre, a, b, at_a, at_b, place, area, rest, force, tension)
MESHLESS_ARCHIVE(Clip, jaws, closed, tissue)
MESHLESS_ARCHIVE(Attachment, name, other, stiffness, strength, made, torn, clip, fibres)
MESHLESS_ARCHIVE(AppliedForce::Point, body, at, share)
MESHLESS_ARCHIVE(AppliedForce, force, left, points)
MESHLESS_ARCHIVE(AttachCommand, name, body, other, distance, stiffness, strength, region)
MESHLESS_ARCHIVE(DetachCommand, name, region)
MESHLESS_ARCHIVE(ClipCommand, name, body, point, direction, width, opening)
MESHLESS_ARCHIVE(PushSphere, enabled, radius, position, target, speed, streamed, touching, force)
MESHLESS_ARCHIVE(Scissors, shown, blades, angle)
template <class A>
void serialize(A& archive, InstrumentDef& v) {
  auto& [name, type, pose, shaft_radius, shaft_length, jaw_length, jaw_width, jaw_thickness, friction, stiffness,
         damping, angular_stiffness, angular_damping, max_force, max_torque, max_speed, grip, sharpness, view_angle,
         field_of_view, latch, remote_centre, color] = v;
  archive(name, choice(type, InstrumentType::kEndoscope), pose, shaft_radius, shaft_length, jaw_length, jaw_width,
          jaw_thickness, friction, stiffness, damping, angular_stiffness, angular_damping, max_force, max_torque,
          max_speed, grip, sharpness, view_angle, field_of_view, latch, remote_centre, color);
}
MESHLESS_ARCHIVE(BladeWound, body, origin, x_axis, y_axis, least, most, stroke)
MESHLESS_ARCHIVE(InstrumentLoad, force, torque, jaw, mass, inertia, jaw_inertia)
MESHLESS_ARCHIVE(Instrument, def, number, target, jaw_target, hand, jaw_hand, pose, jaw, velocity, spin, jaw_rate,
                 jaw_stop, cut_to, wounds, stroke, in_tissue, edge_at, cut_force, resists, cut_torque, cut_work, owed,
                 answers, load, force, torque, jaw_torque, holds, gripped, closed_to, loaded, lost_for, latched,
                 latch_at, latch_force)
MESHLESS_ARCHIVE(CutCommand, blades, close_time, roughness, bodies)
MESHLESS_ARCHIVE(ClosingCut, ticket, command, done_at, start_angle, started_at)

// --- checks of what was read

/// Empty where every size fits and every index is in range; else what does not.
std::string faultOf(const BodyModel& model);
std::string faultOf(const BodyModel& model, const BodyState& state);
/// The material's needs of its model.
std::string faultOf(const BodyModel& model, const Material& material);
std::string faultOf(const ObstacleDef& obstacle);

/// Models by their place in a file; those that bodies share are written once.
class ModelTable {
 public:
  std::uint32_t add(const BodyModelPtr& model);
  const std::vector<BodyModelPtr>& models() const { return models_; }
  /// Throws ArchiveFault for one that is not there.
  const BodyModelPtr& at(std::uint32_t place) const;
  /// Reads, checks and completes them.
  void read(InArchive& archive);
  void readOne(InArchive& archive);

 private:
  std::vector<BodyModelPtr> models_;
  std::map<const BodyModel*, std::uint32_t> places_;
};

// The parts of a file of states. Bodies and scenes name models by their place in the table.
void writeBodies(OutArchive& archive, ModelTable& models, const SavedWorld& world);
void writeScene(OutArchive& archive, ModelTable& models, const SavedWorld& world);
void writeRest(OutArchive& archive, const SavedWorld& world);
void readSettings(InArchive& archive, SavedWorld& world);
void readBodies(InArchive& archive, const ModelTable& models, SavedWorld& world);
void readScene(InArchive& archive, const ModelTable& models, SavedWorld& world);
/// The last part; checks the whole.
void readRest(InArchive& archive, SavedWorld& world);

/// A prepared body with its model.
void savePrepared(OutArchive& archive, const PreparedBody& body, std::uint32_t model);
std::shared_ptr<const PreparedBody> loadPrepared(InArchive& archive, const ModelTable& models);

}  // namespace meshless
