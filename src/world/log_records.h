// What a log of commands is made of. Magic (8 bytes), version (4), then records (records.h): kind (1), step (8),
// payload.
#pragma once

#include "records.h"
#include "saved_world_impl.h"

namespace meshless {

constexpr std::uint32_t kLogVersion = 16;  // of the hashes in it, too

enum class RecordKind : std::uint8_t {
  kStart,
  kCommand,
  kMaterials,
  kScissors,
  kHideScissors,
  kReset,
  kState,
  kHash,
  kEnd,
  kWallTime,
  kTask
};

constexpr double kNobodyWatches = -1.0;         // of kWallTime
constexpr double kLastSecond = 253402300799.0;  // [s] since 1970: of the year 9999

// Commands as they are logged; those of materials and bodies have their own way.
MESHLESS_ARCHIVE(PickCommand, point, direction, body, max_distance, stiffness)
MESHLESS_ARCHIVE(MovePickCommand, pick, target)
MESHLESS_ARCHIVE(LockCommand, pick, target)
MESHLESS_ARCHIVE(ReleaseCommand, pick)
template <class A>
void serialize(A&, ClearPicksCommand&) {}
template <class A>
void serialize(A&, OpenScissorsCommand&) {}
template <class A>
void serialize(A&, UndoCutCommand&) {}
MESHLESS_ARCHIVE(OpenBladesCommand, ticket)
MESHLESS_ARCHIVE(PushCommand, enable, radius, position, speed, streamed)
MESHLESS_ARCHIVE(InciseCommand, blade, bodies)
template <class A>
void serialize(A& archive, LiftCommand& v) {
  auto& [tool, streamed_only, why] = v;
  archive(choice(tool, ToolKind::kScissors), streamed_only, why);
}
MESHLESS_ARCHIVE(RemoveCommand, body)
MESHLESS_ARCHIVE(AttachInstrumentCommand, def)
MESHLESS_ARCHIVE(DetachInstrumentCommand, name)
MESHLESS_ARCHIVE(LeadInstrumentCommand, name, pose, jaw)
MESHLESS_ARCHIVE(MoveClampCommand, body, clamp, shift, turn, time, streamed)
MESHLESS_ARCHIVE(SetGravityCommand, gravity)
MESHLESS_ARCHIVE(PlaceBodyCommand, body, pose)
MESHLESS_ARCHIVE(ResetBodiesCommand, bodies)
MESHLESS_ARCHIVE(ApplyForceCommand, body, region, force, time)
inline void save(OutArchive& archive, const SpawnCommand& v) {
  archive(*v.body->model);
  savePrepared(archive, *v.body, 0);
}
inline void load(InArchive& archive, SpawnCommand& v) {
  ModelTable models;
  models.readOne(archive);
  v.body = loadPrepared(archive, models);
}
// Materials are logged as they came out, see record().
inline void save(OutArchive&, const SetMaterialCommand&) { assert(false); }
inline void load(InArchive&, SetMaterialCommand&) { throw ArchiveFault("a material's change is no command of a log"); }
MESHLESS_ARCHIVE(TaskNote, begins, task, trainee, allow)
template <class A>
void serialize(A& archive, MaterialChange& v) {
  archive(v.body, v.material);
}

}  // namespace meshless
