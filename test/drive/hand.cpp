#include "drive/hand.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace {

constexpr std::uint64_t kHand = 300;     // purpose of the first slot's numbers
constexpr double kLongest = 8.0;         // [s] of all that it does
constexpr double kHandForce = 20.0;      // [N]: then a human hand pulls no farther
constexpr std::size_t kMostPieces = 12;  // it cuts no more then
constexpr std::size_t kMostLocked = 4;

/// A body that it reaches for, and its surface.
struct Target {
  std::string name;
  Points vertices;
  std::vector<Triangle> triangles;
  Box bounds;
  Vec3 centre = Vec3::Zero();
  double size() const { return (bounds.max - bounds.min).maxCoeff(); }
};

Target anyBody(World& world, Random& random, double& top) {
  const WorldSnapshot shot = world.snapshot({true, false, false, false});
  top = 0.0;
  for (const BodySnapshot& body : shot.bodies) top = std::max(top, boundsOf(body.surface).max.z());
  const BodySnapshot& body = shot.bodies[random.bits() % shot.bodies.size()];
  Target target;
  target.name = body.name;
  target.vertices = body.surface;
  target.triangles = body.model->surface.triangles;
  target.bounds = boundsOf(body.surface);
  for (const Vec3& p : body.surface) target.centre += p / static_cast<double>(body.surface.size());
  return target;
}

/// The highest of a few vertices: a hand comes from above.
Vec3 reachable(const Target& target, Random& random) {
  Vec3 best = target.vertices[random.bits() % target.vertices.size()];
  for (int k = 0; k < 3; ++k) {
    const Vec3& other = target.vertices[random.bits() % target.vertices.size()];
    if (other.z() > best.z()) best = other;
  }
  return best;
}

Vec3 normalTo(const Vec3& axis, Random& random) {
  for (;;) {
    const Vec3 across = axis.cross(random.direction());
    if (across.norm() > 0.1) return across.normalized();
  }
}

}  // namespace

Hand::Hand(std::uint64_t seed, bool cuts, Apply apply) : seed_(seed), cuts_(cuts), apply_(std::move(apply)) {
  slots_ = Random(seed_, kHand).whole(3, 9);
}

Result<Reply> Hand::apply(const Command& command) {
  Result<Reply> reply = apply_(command);
  if (!reply) ++counts_.refused;
  return reply;
}

bool Hand::act(World& world) {
  step_ = 1.0 / world.settings().step_rate;
  if (total_ == 0) wait(0.5);
  while (left_ == 0) {
    end(world);
    if (slot_ == slots_ || total_ * step_ > kLongest || world.bodyCount() == 0) {
      (void)apply_(ClearPicksCommand{});
      (void)apply_(PushCommand{false, 0.0, Vec3::Zero(), 0.0, false});
      (void)apply_(OpenScissorsCommand{});
      return false;
    }
    ++slot_;
    begin(world);
  }
  --left_;
  ++total_;
  if (doing_ == Doing::kPulling) {
    const std::optional<Pick> held = world.heldPick();
    if (held && held->id == pick_ && held->force.norm() < kHandForce) {
      target_ += way_;
      (void)apply_(MovePickCommand{pick_, target_});
    }
  }
  return true;
}

void Hand::wait(double seconds) {
  doing_ = Doing::kWaiting;
  left_ = std::max(1, static_cast<int>(std::lround(seconds / step_)));
}

void Hand::begin(World& world) {
  Random random(seed_, kHand + static_cast<std::uint64_t>(slot_));
  const double choice = random.between(0.0, 1.0), pause = random.between(0.2, 0.8);
  wait(pause);
  if (choice < 0.32) return pull(world, random);
  if (choice < 0.46) return push(world, random);
  if (!cuts_ || choice > 0.92) return;
  if (choice < 0.70) return cut(world, random);
  if (choice < 0.86) return incise(world, random);
  if (apply(UndoCutCommand{})) ++counts_.undos;
}

void Hand::end(const World&) {
  if (doing_ == Doing::kPulling) {
    if (lock_)
      (void)apply_(LockCommand{pick_, std::nullopt});
    else
      (void)apply_(ReleaseCommand{pick_});
  }
  if (doing_ == Doing::kPushing) (void)apply_(PushCommand{false, 0.0, Vec3::Zero(), 0.0, false});
  doing_ = Doing::kWaiting;
}

void Hand::pull(World& world, Random& random) {
  double top = 0.0;
  const Target target = anyBody(world, random, top);
  PickCommand pick;
  pick.point = reachable(target, random);
  pick.body = target.name;
  if (random.chance(0.3)) pick.stiffness = random.logBetween(100.0, 2000.0);
  Vec3 direction = random.direction();
  direction.z() = std::abs(direction.z()) + 0.2;  // away from what it lies on
  const double speed = random.logBetween(0.05, 0.5), seconds = random.between(0.3, 1.0) * target.size() / speed;
  const std::size_t locked = world.snapshot({}).picks.size();
  lock_ = random.chance(0.4) && locked < kMostLocked;
  const Result<Reply> reply = apply(pick);
  if (!reply) return;
  ++counts_.pulls;
  pick_ = std::get<PickReply>(*reply).pick;
  target_ = std::get<PickReply>(*reply).position;
  way_ = speed * step_ * direction.normalized();
  wait(std::clamp(seconds, 0.1, 2.5));
  doing_ = Doing::kPulling;
}

void Hand::push(World& world, Random& random) {
  double top = 0.0;
  const Target target = anyBody(world, random, top);
  PushCommand push;
  push.radius = random.between(0.008, 0.03);
  const Vec3 aim = reachable(target, random);
  // From above everything, so that it appears in the air, to some way below the surface.
  push.position = Vec3(aim.x(), aim.y(), top + push.radius + 0.01);
  Vec3 to = aim + random.between(0.05, 0.3) * target.size() * (target.centre - aim).normalized();
  to.z() = std::max(to.z(), push.radius + 0.01);
  if (!apply(push)) return;
  ++counts_.pushes;
  push.speed = random.logBetween(0.05, 0.5);
  const double seconds = (to - push.position).norm() / push.speed;
  push.position = to;
  (void)apply_(push);
  wait(std::clamp(seconds + random.between(0.0, 0.3), 0.1, 2.5));
  doing_ = Doing::kPushing;
}

void Hand::cut(World& world, Random& random) {
  if (world.bodyCount() >= kMostPieces) return;
  double top = 0.0;
  const Target target = anyBody(world, random, top);
  CutCommand command;
  ScissorBlades& blades = command.blades;
  Vec3 normal = random.direction();
  if (random.chance(0.5)) normal = normalTo(Vec3::UnitZ(), random);
  blades.x_axis = normalTo(normal, random);
  blades.y_axis = normal.cross(blades.x_axis);
  const Vec3 through = target.centre + 0.2 * target.size() * random.inCube(1.0);
  blades.origin = through;
  if (random.chance(0.3)) {
    blades.length = random.between(1.0, 2.0) * target.size();
    blades.width = random.between(0.5, 2.0) * target.size();
    blades.origin = through - 0.5 * blades.length * blades.x_axis;
  }
  if (random.chance(0.5)) command.bodies = {target.name};
  if (random.chance(0.25)) command.close_time = random.between(0.1, 0.2);
  if (random.chance(0.15)) command.roughness = random.between(0.0005, 0.002);
  if (apply(command)) ++counts_.cuts;
}

void Hand::incise(World& world, Random& random) {
  double top = 0.0;
  const Target target = anyBody(world, random, top);
  const Triangle& t = target.triangles[random.bits() % target.triangles.size()];
  const Vec3 &a = target.vertices[t[0]], &b = target.vertices[t[1]], &c = target.vertices[t[2]];
  InciseCommand command;
  Blade& blade = command.blade;
  blade.y_axis = (b - a).cross(c - a).normalized();
  blade.x_axis = normalTo(blade.y_axis, random);
  blade.length = random.between(0.2, 0.6) * target.size();
  blade.depth = random.between(0.1, 0.5) * target.size();
  const double above = 0.1 * target.size();  // the surface may rise beside
  blade.origin = (a + b + c) / 3.0 + above * blade.y_axis - 0.5 * blade.length * blade.x_axis;
  blade.depth += above;
  if (random.chance(0.7)) command.bodies = {target.name};
  if (apply(command)) ++counts_.incisions;
}

}  // namespace meshless
