// A saved world as bytes, and back. Layout: magic (8 bytes), version (4), checksum of the payload (4), its length (8),
// payload.
#include "meshless_surgery/world/saved_world.h"

#include <algorithm>

#include "meshless_surgery/body/cavities.h"
#include "meshless_surgery/body/filled_cells.h"
#include "meshless_surgery/geometry/lattice/cell_regions.h"
#include "meshless_surgery/geometry/lattice/cut_lattice.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "saved_world_impl.h"

namespace meshless {
namespace {

constexpr std::string_view kMagic = "MLSSTATE";
constexpr std::uint64_t kMostModels = 1u << 20;

/// What follows the magic, of at least kStateHeaderBytes.
struct StateHeader {
  explicit StateHeader(std::string_view bytes) {
    InArchive archive(bytes.substr(kMagic.size()));
    archive(version, sum, length);
  }
  std::uint32_t version = 0, sum = 0;
  std::uint64_t length = 0;
};

Error unreadable(const std::string& why) {
  return {ErrorCode::kUnreadable, "this is no state that can be read: " + why};
}

void require(bool holds, const std::string& fault) {
  if (!holds) throw ArchiveFault(fault);
}
void requireNone(const std::string& fault) { require(fault.empty(), fault); }

template <class T>
bool allBelow(const std::vector<T>& values, std::size_t end) {
  return std::all_of(values.begin(), values.end(), [end](T v) { return v < end; });
}
bool areRows(const std::vector<Index>& offsets, std::size_t rows, std::size_t entries) {
  return offsets.size() == rows + 1 && offsets.front() == 0 && offsets.back() == entries &&
         std::is_sorted(offsets.begin(), offsets.end());
}
bool areTriangles(const TriangleMesh& mesh) {
  return (mesh.patches.empty() || mesh.patches.size() == mesh.triangles.size()) &&
         std::all_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const Triangle& t) {
           return std::all_of(t.begin(), t.end(), [&](Index v) { return v < mesh.vertices.size(); });
         });
}

template <class Of, class Kept>
using As = std::conditional_t<std::is_const_v<Of>, const Kept, Kept>;

/// With its model's place in the table instead of its model.
template <class Archive, class Body, class Place>
void keepBody(Archive& archive, Body& body, Place& place) {
  auto& [id, number, name, root, material, model, state, surface_current, touched_by_push, stiffness_factor, bounds, asleep,
         still_for, rest_from, sleep_group] = static_cast<As<Body, KeptBody>&>(body);
  (void)model;
  archive(id, number, name, root, material, place, state, surface_current, touched_by_push, stiffness_factor, bounds, asleep,
          still_for, rest_from, sleep_group, body.batch);
}

SavedBody loadBody(InArchive& archive, const ModelTable& models) {
  SavedBody body;
  std::uint32_t model = 0;
  keepBody(archive, body, model);
  body.model = models.at(model);
  requireNone(faultOf(*body.model, body.state));
  requireNone(faultOf(*body.model, body.material));
  require(body.rest_from.empty() || body.rest_from.size() == body.state.positions.size(),
          "body '" + body.name + "' was elsewhere with other particles");
  return body;
}

// Everything but settings, bodies, scene and obstacles.
template <class Archive, class World>
void keepRest(Archive& archive, World& world) {
  auto& [settings, scene_gravity, step, batches_current, generations, free_slots, next_number, used_names, scene, picks,
         next_pick, attachments, used_attachments, scene_attachments, forces, push, scissors, instruments,
         next_instrument, scene_instruments, closing, next_ticket, next_sleep_group, tetrahedralizations] =
      static_cast<As<World, KeptWorld>&>(world);
  (void)settings, (void)scene;
  archive(scene_gravity, step, batches_current, world.batches, generations, free_slots, next_number, used_names, picks,
          next_pick, attachments, used_attachments, scene_attachments, forces, push, scissors, instruments, next_instrument,
          scene_instruments, closing, next_ticket, next_sleep_group, world.surface_contacts, tetrahedralizations);
}

void checkSlots(const SavedWorld& world) {
  std::set<std::uint32_t> slots, numbers;
  std::set<std::string> names;
  for (const SavedBody& body : world.bodies) {
    require(body.id.slot < world.generations.size() && body.id.generation == world.generations[body.id.slot],
            "body '" + body.name + "' has an id that is not in use");
    require(slots.insert(body.id.slot).second, "two bodies have the same id");
    require(names.insert(body.name).second && world.used_names.count(body.name), "a name is not in use");
    require(numbers.insert(body.number).second && body.number < world.next_number, "a body's number is not in use");
  }
  for (const std::uint32_t slot : world.free_slots)
    require(slot < world.generations.size() && slots.insert(slot).second, "a free place is not free");
}

void checkBatches(const SavedWorld& world) {
  require(world.batches <= world.bodies.size(), "there are more batches than bodies");
  std::vector<const SavedBody*> first(world.batches, nullptr);
  for (const SavedBody& body : world.bodies) {
    if (body.batch == kNoIndex) continue;
    require(body.batch < world.batches, "a batch is not there");
    const SavedBody*& of = first[body.batch];
    if (!of) of = &body;
    require(of->model->rest.size() == body.model->rest.size() && of->material.mode == body.material.mode &&
                BodyBatch::holds(matchInput(*body.model, body.state)),
            "body '" + body.name + "' does not fit into its batch");
  }
  for (const SavedBody* body : first) require(body != nullptr, "a batch is empty");
}

bool isThere(const Instrument& instrument) {
  for (const Pose& pose : {instrument.target, instrument.hand, instrument.pose, instrument.edge_at})
    if (!(pose.translation.norm() <= 1e6) || !(std::abs(pose.rotation.norm() - 1.0) <= 1e-6)) return false;
  for (const double jaw : {instrument.jaw_target, instrument.jaw_hand, instrument.jaw})
    if (!(jaw >= 0.0 && jaw <= kWidestJaw)) return false;
  const InstrumentLoad& load = instrument.load;
  for (const Vec3& v :
       {instrument.velocity, instrument.spin, load.force, load.torque, instrument.force, instrument.torque,
        instrument.latch_at, instrument.latch_force, instrument.cut_force})
    if (!(v.norm() <= 1e12)) return false;
  for (const double x : {instrument.owed, instrument.jaw_rate, load.jaw, instrument.jaw_torque, instrument.gripped})
    if (!(std::abs(x) <= 1e12)) return false;
  for (const double x :
       {load.mass, load.inertia, load.jaw_inertia, instrument.jaw_stop, instrument.cut_to, instrument.resists,
        instrument.cut_torque, instrument.cut_work, instrument.answers, instrument.closed_to, instrument.lost_for})
    if (!(x >= 0.0 && x <= 1e15)) return false;
  const auto isWound = [](const BladeWound& wound) {
    return wound.origin.norm() <= 1e9 && wound.least.norm() <= 1e9 && wound.most.norm() <= 1e9 &&
           std::abs(wound.x_axis.norm() - 1.0) <= 1e-6 && std::abs(wound.y_axis.norm() - 1.0) <= 1e-6 &&
           std::abs(wound.x_axis.dot(wound.y_axis)) <= 1e-6;
  };
  return instrument.wounds.size() <= kMostWounds &&
         std::all_of(instrument.wounds.begin(), instrument.wounds.end(), isWound);
}

void checkTools(const SavedWorld& world) {
  for (const Pick& pick : world.picks) {
    require(!pick.patch.empty() && pick.patch.size() == pick.weights.size(), "a pick holds nothing");
    for (const SavedBody& body : world.bodies)
      if (body.id == pick.body)
        require(pick.particle < body.model->rest.size() && allBelow(pick.patch, body.model->rest.size()) &&
                    pick.place.at.allFinite() &&
                    (pick.place.cell == kNoIndex ||
                     (body.model->lattice && pick.place.cell < body.model->lattice->cells.size())),
                "a pick holds what is not there");
  }
  const auto holds = [&](const BodyId& id, const BodyPoint& at) {
    const auto body =
        std::find_if(world.bodies.begin(), world.bodies.end(), [&](const SavedBody& b) { return b.id == id; });
    return body != world.bodies.end() && !at.particles.empty() && at.particles.size() == at.weights.size() &&
           allBelow(at.particles, body->model->rest.size());
  };
  require(world.scene_gravity.norm() <= 1e4 && world.forces.size() <= kMostForces, "a force or gravity is none");
  for (const AppliedForce& force : world.forces) {
    require(force.force.norm() <= kMostForce && force.left > 0.0 && force.left <= kLongestForce, "a force is none");
    for (const AppliedForce::Point& point : force.points)
      require(holds(point.body, point.at) && point.share > 0.0 && point.share <= 1.0 + 1e-9,
              "a force acts on what is not there");
  }
  for (const Attachment& attachment : world.attachments) {
    require(world.used_attachments.count(attachment.name) > 0 && attachment.fibres.size() <= attachment.made &&
                attachment.stiffness > 0.0 && attachment.stiffness <= 1e15 &&
                (!attachment.strength || *attachment.strength > 0.0) &&
                (!attachment.clip || (attachment.clip->jaws >= 0.0 && attachment.clip->closed >= 0.0)),
            "an attachment is none");
    for (const Fibre& fibre : attachment.fibres)
      require(holds(fibre.a, fibre.at_a) &&
                  (fibre.b == BodyId() ? !attachment.other.empty()
                                       : (attachment.clip || fibre.b != fibre.a) && holds(fibre.b, fibre.at_b)) &&
                  fibre.area > 0.0 && fibre.rest >= 0.0,
              "a fibre joins what is not there");
  }
  std::set<std::string> names;
  std::set<std::uint32_t> numbers;
  for (const Instrument& instrument : world.instruments) {
    const Status valid = instrument.def.validate();
    require(valid.ok() && isInstrumentName(instrument.def.name) && isThere(instrument) &&
                names.insert(instrument.def.name).second && numbers.insert(instrument.number).second &&
                instrument.number < world.next_instrument,
            "an instrument is none");
  }
  for (const InstrumentDef& def : world.scene_instruments)
    require(def.validate().ok() && isInstrumentName(def.name), "an instrument is none");
  require(world.instruments.size() <= kMostInstruments && world.scene_instruments.size() <= kMostInstruments,
          "there are too many instruments");
  for (const ClosingCut& cut : world.closing) require(cut.done_at > cut.started_at, "blades close in no time");
}

std::uint64_t readCount(InArchive& archive) {
  std::uint64_t count = 0;
  archive(count);
  archive.need(count, 1);
  return count;
}

SavedWorldPtr readWorld(InArchive& archive) {
  auto world = std::make_shared<SavedWorld>();
  readSettings(archive, *world);
  ModelTable models;
  models.read(archive);
  readBodies(archive, models, *world);
  readScene(archive, models, *world);
  readRest(archive, *world);
  return world;
}

}  // namespace

void readSettings(InArchive& archive, SavedWorld& world) {
  archive(world.settings);
  const Status settings = world.settings.validate();
  if (!settings.ok()) throw ArchiveFault(settings.error().detail);
}

void readBodies(InArchive& archive, const ModelTable& models, SavedWorld& world) {
  for (std::uint64_t i = readCount(archive); i > 0; --i) world.bodies.push_back(loadBody(archive, models));
}

void readScene(InArchive& archive, const ModelTable& models, SavedWorld& world) {
  for (std::uint64_t i = readCount(archive); i > 0; --i) world.scene.push_back(loadPrepared(archive, models));
  std::set<std::string> names;
  for (std::uint64_t i = readCount(archive); i > 0; --i) {
    ObstacleDef obstacle;
    archive(obstacle);
    requireNone(faultOf(obstacle));
    require(names.insert(obstacle.name).second, "two obstacles have the same name");
    world.obstacles.push_back(std::make_shared<const ObstacleDef>(std::move(obstacle)));
  }
}

void readRest(InArchive& archive, SavedWorld& world) {
  keepRest(archive, world);
  require(archive.left() == 0, std::to_string(archive.left()) + " bytes are left over");
  checkSlots(world);
  checkBatches(world);
  checkTools(world);
  std::map<std::uint64_t, SurfaceMemory::Known> colliders;
  for (const SavedBody& body : world.bodies) {
    const BodyModel& model = *body.model;
    const std::size_t particles = model.rest.size();
    const std::size_t vertices =
        model.collision ? model.collision->mesh.vertices.size() : model.surface.vertices.size();
    colliders[body.number] = {particles, vertices > 0 ? vertices : particles};
  }
  for (std::size_t i = 0; i < world.obstacles.size(); ++i) {
    const std::size_t vertices = world.obstacles[i]->mesh.vertices.size();
    colliders[kObstacleKey + i] = {vertices, vertices};
  }
  for (const Instrument& instrument : world.instruments) {
    const std::size_t vertices = shapeOf(instrument.def).mesh.vertices.size();
    colliders[kInstrumentKey + instrument.number] = {vertices, vertices};
  }
  requireNone(world.surface_contacts.fault(colliders));
}

void writeBodies(OutArchive& archive, ModelTable& models, const SavedWorld& world) {
  archive(static_cast<std::uint64_t>(world.bodies.size()));
  for (const SavedBody& body : world.bodies) {
    const std::uint32_t model = models.add(body.model);
    keepBody(archive, body, model);
  }
}

void writeScene(OutArchive& archive, ModelTable& models, const SavedWorld& world) {
  archive(static_cast<std::uint64_t>(world.scene.size()));
  for (const auto& body : world.scene) savePrepared(archive, *body, models.add(body->model));
  archive(static_cast<std::uint64_t>(world.obstacles.size()));
  for (const auto& obstacle : world.obstacles) archive(*obstacle);
}

void writeRest(OutArchive& archive, const SavedWorld& world) { keepRest(archive, world); }

// --- checks

namespace {

// Of mass or length: its powers and its inverse are numbers.
bool isQuantity(double value) { return value > 1e-50 && value < 1e50; }

// Of a surface of so many vertices, bound to a body's particles and cells.
std::string faultOf(const SurfaceBinding& b, std::size_t vertices, std::size_t particles, std::size_t cells) {
  if (!areRows(b.offsets, vertices, b.carriers.size()) || b.weights.size() != b.carriers.size() ||
      !allBelow(b.carriers, particles))
    return "a body's surface is not bound to its particles";
  if (b.cells.size() != (cells > 0 ? vertices : 0) || !allBelow(b.cells, cells))
    return "a body's surface is not embedded in its cells";
  return "";
}

// Of a body with a lattice.
std::string faultOfRegions(const BodyModel& m) {
  const auto isShare = [](double share) { return share > 0.0 && share < 1e300; };
  for (const RegionTissue& region : m.regions)
    if (!isShare(region.density) || !isShare(region.mu) || !(region.lambda == 0.0 || isShare(region.lambda)) ||
        !isShare(region.youngs) || !region.material.validate())
      return "a region is of no material";
  if (!m.lattice->regions) return m.regions.empty() ? "" : "a region has no tissue";
  const std::vector<CellRegions::Part>& parts = m.lattice->regions->parts();
  SampleSet taken = kNoSample;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    if (p > 0 && parts[p].place < parts[p - 1].place) return "the regions of a lattice are not in order";
    if (p == 0 || parts[p].place != parts[p - 1].place) taken = kNoSample;
    if (!(parts[p].region < m.regions.size()) || (parts[p].samples & taken))
      return "a sample is in no region or in two";
    taken |= parts[p].samples;
  }
  return "";
}

}  // namespace

std::string faultOf(const BodyModel& m) {
  const std::size_t particles = m.rest.size(), clusters = m.clusters.size(), vertices = m.surface.vertices.size();
  const std::size_t count = m.lattice ? m.lattice->cells.size() : 0;
  if (particles == 0) return "a body has no particles";
  if (m.held_middles.size() > kMaxHeldRegions || (!m.held_by.empty() && m.held_by.size() != particles) ||
      !std::all_of(m.held_middles.begin(), m.held_middles.end(), [](const Vec3& p) { return p.allFinite(); }))
    return "a body is held by what cannot hold it";
  for (Index i = 0; i < particles; ++i)
    if (m.fixed[i] && m.holderOf(i) >= m.held_middles.size()) return "a particle is held by nothing";
  if (m.masses.size() != particles || m.match_masses.size() != particles || m.fixed.size() != particles)
    return "a body's masses are not those of its particles";
  for (std::size_t i = 0; i < particles; ++i)
    if (!isQuantity(m.masses[i]) || !isQuantity(m.match_masses[i])) return "a particle has no mass";
  if (!areRows(m.graph.offsets, particles, m.graph.neighbours.size()) ||
      m.graph.lengths.size() != m.graph.neighbours.size() || !allBelow(m.graph.neighbours, particles))
    return "a body's graph is not that of its particles";
  if (!std::all_of(m.graph.lengths.begin(), m.graph.lengths.end(), [](double length) { return length >= 0.0; }))
    return "a body's graph has a length below nothing";
  if (clusters + count == 0 || !(m.length > 0.0) || !isQuantity(m.length)) return "a body has no tissue";
  if (clusters > 0 && (!areRows(m.clusters.offsets, clusters, m.clusters.members.size()) ||
                       m.clusters.weights.size() != m.clusters.members.size() ||
                       !allBelow(m.clusters.members, particles) || m.clusters.seeds.size() != clusters ||
                       m.clusters.radii.size() != clusters || !allBelow(m.clusters.seeds, particles)))
    return "a body's clusters are not those of its particles";
  for (std::size_t c = 0; c < clusters; ++c)
    if (m.clusters.offsets[c] == m.clusters.offsets[c + 1]) return "a cluster is empty";
  if (m.shape.clusters.size() != clusters || (!m.shape.quadratic.empty() && m.shape.quadratic.size() != clusters) ||
      (!m.elastic.empty() && (m.elastic.size() != clusters || m.lattice)))
    return "a body's rest shape is not that of its clusters";
  if (m.lattice) {
    const std::vector<LatticeCell>& cells = m.lattice->cells;
    if (cells.empty() || m.lattice->corners != particles || !isQuantity(m.lattice->spacing) || !isQuantity(m.cell_mass))
      return "a body's lattice is not that of its particles";
    for (Index c = 0; c < cells.size(); ++c) {
      const LatticeCell& cell = cells[c];
      if (!std::all_of(cell.corners.begin(), cell.corners.end(), [&](Index i) { return i < particles; }) ||
          !cell.filled ||
          (cell.bridge != kNoIndex && !(cell.bridge < cells.size() && cells[cell.bridge].bridge == cell.bridge)))
        return "a body's lattice is not that of its particles";
      if (cell.face < -1 || cell.face > 2) return "a cell has a face that is none";
      if (!(cell.mass_share >= 0.0 && cell.mass_share <= 1.0) ||
          !(cell.stiffness_share > 0.0 && cell.stiffness_share <= 1.0))
        return "a cell has a share of itself that is none";
    }
    for (const LatticeCell& cell : cells)
      for (int k = 0; k < 8; ++k)
        if (!((m.rest[cell.corners[k]] - m.lattice->restPlace(cell, Vec3(k & 1, k >> 1 & 1, k >> 2 & 1))).norm() <=
              1e-6 * m.lattice->spacing))
          return "a body's particles do not rest at the corners of its cells";
    for (const ClampPoint& point : m.clamp_points)
      if (!(point.cell < cells.size()) || !point.at.allFinite() || !(point.area > 0.0 && point.area < 1e12) ||
          point.region >= m.held_middles.size())
        return "a clamp holds nothing of its body's cells";
    for (const LatticeCell& cell : cells)
      if (!(cell.resists.fraction > 0.0) || !cell.resists.centroid.allFinite() ||
          !(cell.resists.variance.minCoeff() > 0.0))
        return "a cell resists with nothing";
    if (std::string fault = faultOfRegions(m); !fault.empty()) return fault;
    if (!(m.specific_fibres >= 0.0 && m.specific_fibres < 1e50) ||
        (m.fibres.size() != cells.size() && !(m.fibres.empty() && m.specific_fibres == 0.0)) ||
        !std::all_of(m.fibres.begin(), m.fibres.end(), [](const Vec3& a) { return std::abs(a.norm() - 1.0) < 1e-6; }))
      return "a body's fibres are not those of its cells";
    double boxes = 1.0;  // tables of all places are made
    for (int k = 0; k < 3; ++k) {
      const auto [low, high] =
          std::minmax_element(cells.begin(), cells.end(),
                              [k](const LatticeCell& a, const LatticeCell& b) { return a.place[k] < b.place[k]; });
      boxes *= static_cast<double>(high->place[k]) - low->place[k] + 1.0;
    }
    if (!(boxes <= 4e6)) return "the cells of a body's lattice are far apart";
  }
  if (!areTriangles(m.surface)) return "a body's triangles are not those of its vertices";
  if (std::string fault = faultOf(m.binding, vertices, particles, count); !fault.empty()) return fault;
  if (m.collision) {
    const CollisionSurface& c = *m.collision;
    if (!areTriangles(c.mesh) || c.mesh.triangles.empty() || !(c.distance >= 0.0 && c.distance < 1e50))
      return "a body's surface for contact has no triangles of its vertices";
    if (std::string fault = faultOf(c.binding, c.mesh.vertices.size(), particles, count); !fault.empty())
      return "for contact, " + fault;
    if (!m.lattice) return "a body's surface for contact is not embedded in its cells";
  }
  return "";
}

std::string faultOf(const BodyModel& m, const BodyState& s) {
  const std::size_t particles = m.rest.size(), clusters = m.clusters.size();
  const std::size_t cells = m.lattice ? m.lattice->cells.size() : 0;
  if (s.positions.size() != particles || s.velocities.size() != particles || s.poses.size() != clusters ||
      s.cells.size() != cells || s.surface.size() != m.surface.vertices.size() ||
      (!s.plastic.empty() && s.plastic.size() != clusters) ||
      (!s.plastic_cells.empty() && s.plastic_cells.size() != cells) ||
      (!s.relaxed.empty() && s.relaxed.size() != cells))
    return "a body's state is not that of its model";
  if (s.held.size() > m.held_middles.size()) return "a clamp that is not there was moved";
  for (const HeldMotion& motion : s.held)
    for (const Pose& pose : {motion.now, motion.target})
      if (!motion.middle.allFinite() || !pose.translation.allFinite() ||
          !(std::abs(pose.rotation.norm() - 1.0) < 1e-6) || !(motion.left >= 0.0 && motion.left <= 1e9))
        return "a clamp was moved to nowhere";
  for (const FilledCavity& c : s.cavities) {
    if (!shellOf(m, c.patch) || !(std::abs(c.pressure) <= 1e50) || !(std::abs(c.content) <= 1e50) ||
        !(c.compliance >= 0.0 && c.compliance <= 1e50) || !(c.leak > 0.0 && c.leak <= 3600.0) ||
        !(c.filled_for >= 0.0) || !(c.open_for >= 0.0))
      return "a body's cavities are filled with what cannot be";
  }
  return "";
}

std::string faultOf(const BodyModel& m, const Material& material) {
  if (const Status valid = material.validate(); !valid.ok()) return valid.error().detail;
  if (material.elastic() && !m.elastic_batch) return "an elastic body has no rest shape for it";
  if (material.elastic() != (m.clusters.size() == 0) && m.lattice) return "a body has clusters of another material";
  if (!material.elastic() && material.mode == MatchMode::kQuadratic && m.shape.quadratic.empty())
    return "a quadratic body has no rest shape for it";
  return "";
}

std::string faultOf(const ObstacleDef& obstacle) {
  if (!areTriangles(obstacle.mesh)) return "an obstacle's triangles are not those of its vertices";
  const Status valid = checkObstacle(obstacle);
  return valid.ok() ? "" : valid.error().detail;
}

// --- models

std::uint32_t ModelTable::add(const BodyModelPtr& model) {
  const auto [known, is_new] = places_.emplace(model.get(), static_cast<std::uint32_t>(models_.size()));
  if (is_new) models_.push_back(model);
  return known->second;
}

const BodyModelPtr& ModelTable::at(std::uint32_t place) const {
  require(place < models_.size(), "a body's model is not there");
  return models_[place];
}

void ModelTable::read(InArchive& archive) {
  std::uint64_t count = 0;
  archive(count);
  archive.need(count, 1);
  require(count <= kMostModels, "it claims " + std::to_string(count) + " models");
  for (std::uint64_t i = 0; i < count; ++i) readOne(archive);
}

void ModelTable::readOne(InArchive& archive) {
  auto model = std::make_shared<BodyModel>();
  archive(*model);
  requireNone(faultOf(*model));
  if (model->lattice) {
    model->tissue = cornersWithTissue(*model->lattice);
    makeClamp(*model);
  }
  makeCavities(*model);
  if (model->highest_frequency > 0.0 && (model->lattice || !model->elastic.empty())) makeElastic(*model);
  add(model);
}

void savePrepared(OutArchive& archive, const PreparedBody& body, std::uint32_t model) {
  archive(body.def, model, body.state);
}

std::shared_ptr<const PreparedBody> loadPrepared(InArchive& archive, const ModelTable& models) {
  auto body = std::make_shared<PreparedBody>();
  std::uint32_t model = 0;
  archive(body->def, model, body->state);
  body->model = models.at(model);
  requireNone(faultOf(*body->model, body->state));
  requireNone(faultOf(*body->model, body->def.material));
  return body;
}

// --- the whole

std::string encode(const SavedWorld& world, const std::string& origin) {
  std::string bytes(kStateHeaderBytes, '\0');
  OutArchive archive(bytes);
  archive(origin, world.settings);
  ModelTable models;
  for (const SavedBody& body : world.bodies) models.add(body.model);
  for (const auto& body : world.scene) models.add(body->model);
  archive(static_cast<std::uint64_t>(models.models().size()));
  for (const BodyModelPtr& model : models.models()) archive(*model);
  writeBodies(archive, models, world);
  writeScene(archive, models, world);
  writeRest(archive, world);

  std::string header;
  OutArchive head(header);
  head.put(kMagic.data(), kMagic.size());
  const std::string_view payload = std::string_view(bytes).substr(kStateHeaderBytes);
  head(kStateVersion, checksum(payload), static_cast<std::uint64_t>(payload.size()));
  bytes.replace(0, kStateHeaderBytes, header);
  return bytes;
}

Status checkStateHeader(std::string_view header, std::uint64_t file_bytes) {
  if (header.substr(0, kMagic.size()) != kMagic)
    return unreadable("it does not begin with " + std::string(kMagic) + ", as states do");
  if (header.size() < kStateHeaderBytes || file_bytes < kStateHeaderBytes)
    return unreadable("it has " + std::to_string(file_bytes) + " bytes; accepted: at least " +
                      std::to_string(kStateHeaderBytes));
  const StateHeader head(header);
  if (head.version != kStateVersion)
    return unreadable("it is of version " + std::to_string(head.version) +
                      "; accepted: " + std::to_string(kStateVersion));
  const std::uint64_t payload_bytes = file_bytes - kStateHeaderBytes;
  if (payload_bytes != head.length)
    return unreadable("it holds " + std::to_string(payload_bytes) + " bytes of " + std::to_string(head.length) +
                      (payload_bytes < head.length ? ": it was cut off" : ": something follows"));
  return Done{};
}

Result<DecodedWorld> decode(std::string_view bytes) {
  if (const Status header = checkStateHeader(bytes, bytes.size()); !header.ok()) return header.error();
  DecodedWorld decoded;
  try {
    const std::string_view payload = bytes.substr(kStateHeaderBytes);
    if (checksum(payload) != StateHeader(bytes).sum) return unreadable("its checksum is wrong: it was damaged");
    InArchive archive(payload);
    archive(decoded.origin);
    decoded.world = readWorld(archive);
  } catch (const ArchiveFault& fault) {
    return unreadable(fault.what());
  } catch (const std::bad_alloc&) {
    return unreadable("there is not enough memory for it");
  }
  return decoded;
}

// --- World

std::shared_ptr<const SavedWorld> World::capture() const {
  Impl& w = *impl_;
  auto saved = std::make_shared<SavedWorld>();
  static_cast<KeptWorld&>(*saved) = w;
  std::map<const WorldBody*, std::uint32_t> batch_of;
  for (std::size_t i = 0; i < w.batches.size(); ++i)
    for (const WorldBody* body : w.batches[i].bodies) batch_of[body] = static_cast<std::uint32_t>(i);
  saved->batches = w.batches_current ? static_cast<std::uint32_t>(w.batches.size()) : 0;
  for (const auto& body : w.bodies) {
    const auto batch = batch_of.find(body.get());
    saved->bodies.push_back({*body, w.batches_current && batch != batch_of.end() ? batch->second : kNoIndex});
  }
  for (const auto& obstacle : w.obstacles) saved->obstacles.push_back(obstacle->def);
  saved->surface_contacts = w.surface_contacts.memory();
  return saved;
}

void World::restore(const SavedWorld& saved) {
  Impl& w = *impl_;
  w.recordState(saved);
  for (const ClosingCut& c : w.closing)
    w.finished.emplace(c.ticket, Error{ErrorCode::kFailed, "another state was loaded before the blades met"});
  w.batches.clear();
  w.bodies.clear();
  for (const SavedBody& from : saved.bodies) {
    w.bodies.push_back(std::make_unique<WorldBody>());
    static_cast<KeptBody&>(*w.bodies.back()) = from;
  }
  const int threads = w.settings.threads;  // the machine's, not the state's
  static_cast<KeptWorld&>(w) = saved;
  w.settings.threads = threads;
  // Who was matched together then is not who would be grouped now.
  std::vector<std::vector<WorldBody*>> groups(saved.batches);
  for (std::size_t b = 0; b < saved.bodies.size(); ++b)
    if (saved.bodies[b].batch != kNoIndex) groups[saved.bodies[b].batch].push_back(w.bodies[b].get());
  for (std::vector<WorldBody*>& group : groups) w.addBatch(std::move(group));
  w.obstacles.clear();
  for (const auto& obstacle : saved.obstacles) w.obstacles.push_back(std::make_shared<WorldObstacle>(*obstacle));
  w.makeInstrumentBodies();
  w.listFibres();
  w.undo.clear();
  w.report = StepReport();
  w.awake.clear();
  w.loaded.clear();
  w.contacts_current = false;
  w.surface_contacts.recall(saved.surface_contacts);
  ++w.run;
  w.say(EventType::kLoaded, "", 0, "a saved state was loaded");
}

template <class T>
std::uint64_t ContentHashes::of(const std::shared_ptr<const T>& content) {
  const auto [known, is_new] = known_.try_emplace(content.get());
  if (is_new) {
    HashArchive archive;
    archive(*content);
    known->second = {content, archive.hash()};
  }
  return known->second.hash;
}

void ContentHashes::tidy() {
  for (auto it = known_.begin(); it != known_.end();)
    it = it->second.owner.expired() ? known_.erase(it) : std::next(it);
}

// Ids and numbers go on growing over resets, which bring back the same world: they are left out.
std::uint64_t World::stateHash() const {
  const auto saved = capture();
  const auto placeOf = [&](std::uint64_t key) {
    const auto body =
        std::find_if(saved->bodies.begin(), saved->bodies.end(), [&](const SavedBody& b) { return b.number == key; });
    if (body != saved->bodies.end()) return static_cast<std::uint64_t>(body - saved->bodies.begin());
    for (std::size_t n = 0; n < saved->instruments.size(); ++n)
      if (kInstrumentKey + saved->instruments[n].number == key) return kInstrumentKey + n;
    return key;
  };
  SurfaceMemory surfaces = saved->surface_contacts;
  for (KeptPair& pair : surfaces.pairs) {
    pair.key_a = placeOf(pair.key_a);
    pair.key_b = placeOf(pair.key_b);
  }
  for (KeptWay& way : surfaces.ways) way.key = placeOf(way.key);
  HashArchive archive;
  WorldSettings settings = saved->settings;
  settings.threads = 1;  // they change nothing
  ContentHashes& known = impl_->content_hashes;
  known.tidy();
  archive(settings);
  for (const auto& obstacle : saved->obstacles) archive(known.of(obstacle));
  archive(saved->step, saved->batches_current, saved->batches, saved->used_names, saved->push, saved->scissors);
  for (const SavedBody& body : saved->bodies) {
    archive(body.name, body.root, body.material, body.state, body.touched_by_push, body.stiffness_factor, body.bounds, body.asleep,
            body.still_for, body.rest_from, body.sleep_group, body.batch);
    archive(known.of(body.model));
  }
  const auto numbered = [&](const BodyId& id) {
    const auto body = std::find_if(saved->bodies.begin(), saved->bodies.end(),
                                   [&](const SavedBody& other) { return other.id == id; });
    return BodyId{static_cast<std::uint32_t>(body - saved->bodies.begin()), 0};
  };
  for (Pick pick : saved->picks) {
    pick.body = numbered(pick.body);
    pick.id = 0;
    archive(pick);
  }
  for (Attachment attachment : saved->attachments) {
    for (Fibre& fibre : attachment.fibres) {
      fibre.a = numbered(fibre.a);
      if (fibre.b != BodyId()) fibre.b = numbered(fibre.b);
    }
    archive(attachment);
  }
  archive(saved->used_attachments);
  for (AppliedForce force : saved->forces) {
    for (AppliedForce::Point& point : force.points) point.body = numbered(point.body);
    archive(force);
  }
  for (Instrument instrument : saved->instruments) {
    instrument.number = 0;
    instrument.latched = instrument.latched != 0;
    archive(instrument);
  }
  for (ClosingCut cut : saved->closing) {
    cut.ticket = 0;
    archive(cut);
  }
  archive(saved->next_sleep_group, surfaces);
  return archive.hash();
}

}  // namespace meshless
