// A session with every command in it, and its log.
#pragma once

#include <gtest/gtest.h>

#include <set>

#include "meshless_surgery/world/command_log.h"
#include "meshless_surgery/world/saved_world.h"
#include "support/bodies.h"

namespace meshless {
namespace command_log_test {

inline void run(World& world, int steps) {
  for (int i = 0; i < steps; ++i) world.step();
}

/// A session with every command in it, some of them refused.
struct Session {
  std::string log;
  std::vector<std::size_t> ends;  // of the pieces that the sink got
  std::uint64_t hash = 0, steps = 0;
};

inline Session session(bool ended = true, int threads = 1) {
  Session s;
  WorldSettings settings;
  settings.threads = threads;
  World world(settings);
  EXPECT_TRUE(world.addSceneBody(test::shared(test::ball())).ok());
  run(world, 5);
  world.record([&s](std::string bytes) {
    s.log += bytes;
    s.ends.push_back(s.log.size());
  });
  std::set<std::size_t> kinds;
  const auto apply = [&](const Command& command, bool accepted = true) {
    kinds.insert(command.index());
    const auto reply = world.apply(command);
    EXPECT_EQ(accepted, reply.ok()) << command.index() << (reply.ok() ? "" : ": " + reply.error().detail);
  };
  SpawnCommand spawn;
  spawn.body = test::shared(test::block("block", Vec3(0.3, 0, 0.2)));
  apply(spawn);
  apply(spawn, false);
  run(world, 10);
  PickCommand pick;
  pick.point = Vec3(0, 0, 0.25);
  pick.max_distance = 0.2;
  apply(pick);
  pick.point = Vec3(9, 9, 9);
  apply(pick, false);
  MovePickCommand move;
  move.pick = 1;
  move.target = Vec3(0.1, 0, 0.4);
  apply(move);
  run(world, 10);
  LockCommand lock;
  lock.pick = 1;
  apply(lock);
  SetMaterialCommand material;
  material.change = [](const Material& before) -> Result<Material> {
    Material after = before;
    after.alpha *= 0.5;
    return after;
  };
  apply(material);
  material.change = [](const Material&) -> Result<Material> { return Error{ErrorCode::kInvalidArgument, "no"}; };
  apply(material, false);
  PushCommand push;
  push.position = Vec3(0.3, 0, 0.35);
  push.radius = 0.05;
  apply(push);
  push.position = Vec3(0.3, 0, 0.1);
  push.speed = 0.2;
  apply(push);
  world.recordHash();
  run(world, 20);
  CutCommand cut;
  cut.blades.origin = Vec3(0.3, -1, 0.1);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3::UnitZ();
  cut.roughness = 0.002;
  cut.bodies = {"block"};
  apply(cut);
  run(world, 10);
  apply(UndoCutCommand{});
  run(world, 5);
  cut.close_time = 0.1;
  apply(cut);
  run(world, 5);
  apply(OpenScissorsCommand{});
  apply(cut);
  apply(OpenBladesCommand{2});  // of the second that closes
  apply(cut);
  run(world, 30);
  InciseCommand incise;
  incise.blade.origin = Vec3(-0.3, 0, 0.5);
  incise.blade.y_axis = Vec3::UnitZ();
  incise.blade.length = 0.8;
  incise.blade.depth = 0.3;
  incise.bodies = {"ball"};
  apply(incise);
  world.setScissors(cut.blades, 0.3);
  run(world, 5);
  world.hideScissors();
  const auto middle = world.capture();
  AttachCommand attach;
  attach.name = "joint";
  attach.body = "ball";
  attach.other = "world";
  attach.stiffness = 1e5;
  apply(attach);
  apply(attach, false);
  ClipCommand clip;
  clip.point = Vec3(9, 9, 9);
  apply(clip, false);
  MoveClampCommand lead;
  lead.body = "ball";
  apply(lead, false);  // nothing holds it
  SetGravityCommand gravity;
  gravity.gravity = Vec3(0.5, 0, -8);
  apply(gravity);
  gravity.gravity.x() = 1e5;
  apply(gravity, false);
  ApplyForceCommand force;
  force.body = "ball";
  force.force = Vec3(0, 0, 0.5);
  force.time = 0.1;
  apply(force);
  run(world, 5);
  PlaceBodyCommand place;
  place.body = "ball";
  apply(place, false);  // it is attached
  apply(ResetBodiesCommand{{"block"}}, false);  // it was spawned
  apply(ResetBodiesCommand{{"nobody"}}, false);
  AttachInstrumentCommand probe;
  probe.def.name = "probe";
  probe.def.pose.translation = Vec3(-1, -1, 1);
  apply(probe);
  apply(probe, false);  // there is one
  LeadInstrumentCommand hand;
  hand.name = "probe";
  hand.pose = Pose{Quat::Identity(), Vec3(-1, -1, 1.1)};
  apply(hand);
  run(world, 5);
  apply(DetachCommand{"joint", {}});
  apply(DetachInstrumentCommand{"probe"});
  LiftCommand lift;
  lift.tool = ToolKind::kPush;
  apply(lift);
  ReleaseCommand release;
  release.pick = 1;
  apply(release);
  apply(ClearPicksCommand{});
  place.pose.translation = Vec3(3, 3, 1);
  apply(place);
  run(world, 2);
  apply(ResetBodiesCommand{{"ball"}});
  run(world, 2);
  RemoveCommand remove;
  remove.body = "ball";
  apply(remove);
  EXPECT_EQ(std::variant_size_v<Command>, kinds.size());
  run(world, 10);
  world.reset();
  run(world, 10);
  world.recordHash();
  world.restore(*middle);
  run(world, 25);
  world.recordHash();
  s.hash = world.stateHash();
  s.steps = world.stepCount();
  if (ended) world.record(nullptr);
  return s;
}

}  // namespace command_log_test
}  // namespace meshless
