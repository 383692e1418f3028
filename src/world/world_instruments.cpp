// Instruments in the world: how they are led through a frame, and what they feel.
#include <algorithm>
#include <cmath>

#include "meshless_surgery/base/number_text.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/tools/grasp.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kHolds = 0.01;   // [N] on each jaw: they hold what is between them
constexpr double kLostFor = 0.1;  // [s] without: they have lost it
constexpr double kCrushed = 0.1;  // of the angle at which jaws have met tissue: they close no further
constexpr double kFires =
    0.5;  // of that angle: a clip applier has closed; likewise where it presses with so much of grip
constexpr double kReloads = 0.1;                          // [rad] that it opens before it has another clip
constexpr double kRests = 1e-6;                           // [m/s] slower instruments wake nobody
constexpr int kWaysOut = 4;                               // of an instrument from obstacles, at most, in a step of
constexpr double kStepOut = 1e-3, kMostStepsOut = 100.0;  // [m], of which a substep has at most so many

bool isHand(const Pose& pose) {
  return pose.translation.norm() <= kFarthestHand && std::abs(pose.rotation.norm() - 1.0) <= 1e-3;
}

}  // namespace

InstrumentBody::InstrumentBody(const InstrumentDef& def)
    : shape(std::make_shared<const InstrumentShape>(shapeOf(def))),
      surface(shape->mesh, ownSupports(static_cast<Index>(shape->mesh.vertices.size()))),
      inverse_masses(shape->mesh.vertices.size(), 0.0) {}

void InstrumentBody::place(const Instrument& of) { shape->place(of.pose, of.jaw, positions); }

Instrument* World::Impl::findInstrument(const std::string& name) {
  for (Instrument& instrument : instruments)
    if (instrument.def.name == name) return &instrument;
  return nullptr;
}

std::string World::Impl::knownInstruments() const {
  std::string list;
  for (const Instrument& instrument : instruments) list += (list.empty() ? "" : ", ") + instrument.def.name;
  return list.empty() ? "there are no instruments" : "instruments are: " + list;
}

void World::Impl::makeInstrumentBodies() {
  instrument_bodies.clear();
  for (const Instrument& instrument : instruments) {
    instrument_bodies.push_back(std::make_shared<InstrumentBody>(instrument.def));
    instrument_bodies.back()->place(instrument);
    instrument_bodies.back()->hand_then = instrument.hand;
    instrument_bodies.back()->jaw_then = instrument.jaw_hand;
  }
}

Status World::Impl::liesApart(const Points& tissue, const BodyModel& model, const std::string& name) const {
  if (settings.contact != ContactMethod::kSurface || tissue.empty()) return Done{};
  const Box bounds = boundsOf(tissue);
  for (std::size_t n = 0; n < instruments.size(); ++n)
    if (Status apart = liesApart(*instrument_bodies[n], instruments[n].def.name, tissue, bounds, model, name); !apart)
      return apart;
  return Done{};
}

Status World::Impl::liesApart(const InstrumentBody& instrument, const std::string& instrument_name,
                              const Points& tissue, const Box& bounds, const BodyModel& model,
                              const std::string& name) {
  if (!boundsOf(instrument.positions).overlaps(bounds)) return Done{};
  const SolidQuery metal({instrument.positions, instrument.shape->mesh.triangles, {}});
  bool meets = std::any_of(tissue.begin(), tissue.end(), [&](const Vec3& p) { return metal.contains(p); });
  if (model.solid && !meets) {
    const SolidQuery solid({tissue, model.surface.triangles, {}});
    const Points& points = instrument.positions;
    meets = std::any_of(points.begin(), points.end(), [&](const Vec3& p) { return solid.contains(p); });
  }
  if (!meets) return Done{};
  return Error{ErrorCode::kInvalidArgument, "instrument '" + instrument_name + "' would be inside of body '" + name +
                                                "'; accepted: outside of tissue"};
}

Result<Reply> World::Impl::apply(const AttachInstrumentCommand& command) {
  const InstrumentDef& def = command.def;
  if (!isInstrumentName(def.name))
    return Error{ErrorCode::kInvalidArgument,
                 "name of the instrument is '" + def.name.substr(0, 60) + "'; accepted: " + kInstrumentName};
  if (findInstrument(def.name))
    return Error{ErrorCode::kDuplicateName, "there is an instrument '" + def.name + "' already; " + knownInstruments()};
  if (instruments.size() >= kMostInstruments)
    return Error{ErrorCode::kInvalidArgument, "there are " + std::to_string(instruments.size()) +
                                                  " instruments; accepted: up to " + std::to_string(kMostInstruments)};
  if (Status valid = def.validate(); !valid) return valid.error();
  Instrument instrument;
  instrument.def = def;
  instrument.def.pose.rotation.normalize();
  instrument.pose = instrument.def.pose;
  instrument.aim();
  instrument.hand = instrument.target = instrument.pose;
  instrument.cut_to = instrument.cutsTo();
  instrument.edge_at = instrument.pose;
  auto body = std::make_shared<InstrumentBody>(def);
  body->place(instrument);
  const double lowest = boundsOf(body->positions).min.z();
  if (settings.ground && lowest < *settings.ground)
    return Error{ErrorCode::kInvalidArgument, "instrument '" + def.name + "' would begin " +
                                                  numberText(*settings.ground - lowest, 3) +
                                                  " m below the ground; accepted: above it"};
  for (const auto& other : bodies) {
    if (settings.contact != ContactMethod::kSurface) break;
    refreshSurface(*other);
    const Points& tissue = other->state.surface;
    if (tissue.empty()) continue;
    if (Status apart = liesApart(*body, def.name, tissue, boundsOf(tissue), *other->model, other->name); !apart)
      return apart.error();
  }
  for (const auto& obstacle : obstacles)
    for (const Vec3& p : body->positions)
      if (obstacle->surface.closed && obstacle->bounds.contains(p) && obstacle->solid.contains(p))
        return Error{ErrorCode::kInvalidArgument, "instrument '" + def.name + "' would be inside of obstacle '" +
                                                      obstacle->def->name + "'; accepted: outside"};
  body->hand_then = instrument.hand;
  instrument.number = next_instrument++;
  instruments.push_back(std::move(instrument));
  instrument_bodies.push_back(std::move(body));
  say(EventType::kInstrument, "", 0, "instrument " + def.name + " is in the hand");
  return Reply(Done{});
}

Result<Reply> World::Impl::apply(const DetachInstrumentCommand& command) {
  const Instrument* const instrument = findInstrument(command.name);
  if (!instrument)
    return Error{ErrorCode::kUnknownName, "there is no instrument '" + command.name + "'; " + knownInstruments()};
  const auto place = instrument - instruments.data();
  unlatch(instruments[place]);
  wakeWithin(boundsOf(instrument_bodies[place]->positions));
  surface_contacts.forget(kInstrumentKey + instrument->number);
  contacts_current = false;
  instruments.erase(instruments.begin() + place);
  instrument_bodies.erase(instrument_bodies.begin() + place);
  say(EventType::kInstrument, "", 0, "instrument " + command.name + " was put away");
  return Reply(Done{});
}

Result<Reply> World::Impl::apply(const LeadInstrumentCommand& command) {
  Instrument* const instrument = findInstrument(command.name);
  if (!instrument)
    return Error{ErrorCode::kUnknownName, "there is no instrument '" + command.name + "'; " + knownInstruments()};
  if (command.pose && !isHand(*command.pose))
    return Error{ErrorCode::kInvalidArgument, "pose is " + numberText(command.pose->translation.norm()) +
                                                  " m from the origin, with a quaternion of length " +
                                                  numberText(command.pose->rotation.norm()) + "; accepted: up to " +
                                                  numberText(kFarthestHand) + " m, a length of 1"};
  if (command.jaw && !instrument->def.hasJaws())
    return Error{ErrorCode::kInvalidArgument,
                 "instrument '" + command.name + "' is a " + toString(instrument->def.type) + ", which has no jaws"};
  if (command.jaw && !(*command.jaw >= 0.0 && *command.jaw <= kWidestJaw))
    return outOfRange("jaw", *command.jaw, "0 to " + numberText(kWidestJaw) + " rad");
  if (command.pose) instrument->target = {command.pose->rotation.normalized(), command.pose->translation};
  if (command.jaw) instrument->jaw_target = *command.jaw;
  return Reply(Done{});
}

Status World::addSceneInstrument(const InstrumentDef& def) {
  const Result<Reply> reply = impl_->apply(AttachInstrumentCommand{def});
  if (!reply) return reply.error();
  impl_->scene_instruments.push_back(def);
  return Done{};
}

void World::Impl::leadInstruments(double h_frame) {
  for (std::size_t n = 0; n < instruments.size(); ++n) {
    Instrument& instrument = instruments[n];
    InstrumentBody& body = *instrument_bodies[n];
    body.hand_then = instrument.handAfter(h_frame);
    body.jaw_then = instrument.jawAfter(h_frame);
    const double reach = instrument.def.shaft_length + instrument.def.jaw_length;
    body.still = body.hand_then.translation == instrument.hand.translation &&
                 body.hand_then.rotation.coeffs() == instrument.hand.rotation.coeffs() &&
                 body.jaw_then == instrument.jaw_hand && instrument.velocity.norm() <= kRests &&
                 instrument.spin.norm() * reach <= kRests && std::abs(instrument.jaw_rate) * reach <= kRests;
    body.felt = body.stepped = false;
    body.rests = body.still && !sleepersAt(n).empty();
    if (Pick* const held = latchOf(instrument)) {
      Instrument then = instrument;
      then.move(body.hand_then, body.jaw_then, h_frame);
      if (!body.still) {
        wake(*find(held->body));
        held->target = then.pose * instrument.latch_at;
      }
    }
  }
}

std::vector<WorldBody*> World::Impl::sleepersAt(std::size_t n) {
  std::vector<WorldBody*> found;
  const std::vector<std::uint64_t> keys = surface_contacts.loadedBy(kInstrumentKey + instruments[n].number);
  for (const auto& body : bodies)
    if (body->asleep && std::find(keys.begin(), keys.end(), body->number) != keys.end()) found.push_back(body.get());
  return found;
}

// Who sleeps in a hand that somebody else moves wakes too.
bool World::Impl::wakeInHands() {
  bool woken = false;
  for (const SurfaceContacts::Island& island : surface_contacts.islands())
    for (const Index c : island.led) {
      const std::size_t n = c - bodies.size() - obstacles.size();
      for (WorldBody* body : sleepersAt(n)) {
        wake(*body);
        woken = true;
      }
      instrument_bodies[n]->rests = false;
    }
  return woken;
}

bool World::Impl::anyInstrumentGoes() const {
  return std::any_of(instrument_bodies.begin(), instrument_bodies.end(), [](const auto& body) { return !body->still; });
}

void World::Impl::fillInstrumentCollider(std::size_t n, double h, double h_left, Collider& collider) {
  const Instrument& instrument = instruments[n];
  InstrumentBody& body = *instrument_bodies[n];
  collider = Collider();
  collider.key = kInstrumentKey + instrument.number;
  collider.edge_length = body.surface.edge_length;
  collider.surface = &body.surface;
  collider.positions = body.positions.data();
  collider.inverse_masses = body.inverse_masses.data();
  collider.particles = body.surface.vertices();
  collider.friction = instrument.def.friction;
  collider.obstacle = collider.led = true;
  collider.moves = false;
  collider.bounds = boundsOf(body.positions);
  if (body.still) {
    body.velocities.clear();
    return;
  }
  Instrument then = instrument;
  then.move(body.hand_then, body.jaw_then, h_left);
  if (settings.ground) {
    body.shape->place(then.pose, then.jaw, body.velocities);
    then.pose.translation.z() += std::max(0.0, *settings.ground - boundsOf(body.velocities).min.z());
  }
  body.shape->place(then.pose, then.jaw, body.velocities);
  for (Index v = 0; v < body.positions.size(); ++v) {
    body.velocities[v] = (body.velocities[v] - body.positions[v]) / h_left;
    collider.bounds.extend(body.positions[v] + h * body.velocities[v]);
  }
  collider.velocities = body.velocities.data();
}

void World::Impl::advanceInstrument(Index collider, double h, int left) {
  const std::size_t n = collider - bodies.size() - obstacles.size();
  Instrument& instrument = instruments[n];
  InstrumentBody& body = *instrument_bodies[n];
  const double share = 1.0 / left;
  Pose hand = instrument.hand;
  hand.translation += share * (body.hand_then.translation - hand.translation);
  hand.rotation =
      left == 1 ? body.hand_then.rotation : hand.rotation.slerp(share, body.hand_then.rotation).normalized();
  const Pose before = instrument.pose;
  instrument.move(hand, instrument.jaw_hand + share * (body.jaw_then - instrument.jaw_hand), h);
  body.before.swap(body.positions);
  body.place(instrument);
  body.blocked.setZero();
  const double lowest = settings.ground ? boundsOf(body.positions).min.z() - *settings.ground : 0.0;
  if (lowest < 0.0) {
    body.blocked = instrument.block(-lowest * Vec3::UnitZ(), h);
    body.place(instrument);
  }
  if (obstacles.empty()) return;
  double way = 0.0;  // [m]
  for (Index v = 0; v < body.positions.size(); ++v)
    way = std::max(way, (body.positions[v] - body.before[v]).squaredNorm());
  way = std::sqrt(way);
  body.clear.resize(body.positions.size(), 0.0);
  if (*std::min_element(body.clear.begin(), body.clear.end()) > body.gone + way) {
    body.gone += way;
    return;
  }
  // A hand that was held goes far at once: step by step nothing is passed.
  const Pose then = instrument.pose;
  const double steps = std::clamp(std::ceil(way / kStepOut), 1.0, kMostStepsOut);
  Vec3 out = Vec3::Zero();
  for (double k = 1.0; k <= steps; ++k) {
    instrument.pose.translation = before.translation + k / steps * (then.translation - before.translation) + out;
    instrument.pose.rotation = before.rotation.slerp(k / steps, then.rotation).normalized();
    body.place(instrument);
    body.gone += way / steps;
    for (int pass = 0; pass < kWaysOut; ++pass) {
      const Vec3 more = wayOutOfObstacles(body);
      if (more.isZero(0.0)) break;
      out += more;
      body.gone += more.norm();
      instrument.pose.translation += more;
      body.place(instrument);
    }
  }
  instrument.pose = then;
  if (!out.isZero(0.0)) body.blocked += instrument.block(out, h);
  body.place(instrument);
}

Vec3 World::Impl::wayOutOfObstacles(InstrumentBody& body) const {
  double deepest = 0.0;
  Vec3 out = Vec3::Zero();
  for (Index v = 0; v < body.positions.size(); ++v) {
    if (body.clear[v] > body.gone) continue;
    const Vec3& p = body.positions[v];
    double least = std::numeric_limits<double>::infinity();
    for (const auto& obstacle : obstacles) {
      if (!obstacle->surface.closed) continue;
      const Vec3 beside = (obstacle->bounds.min - p).cwiseMax(p - obstacle->bounds.max).cwiseMax(0.0);
      if (!beside.isZero(0.0)) {
        least = std::min(least, beside.norm());
        continue;
      }
      const Vec3 way_out = obstacle->solid.nearest(p) - p;
      const bool inside = obstacle->solid.contains(p);
      least = std::min(least, inside ? 0.0 : way_out.norm());
      if (!inside || !(way_out.norm() > deepest)) continue;
      deepest = way_out.norm();
      out = way_out;
    }
    body.clear[v] = body.gone + least;
  }
  return out;
}

void World::Impl::forgetLoad(std::size_t n) {
  instruments[n].force.setZero();
  instruments[n].torque.setZero();
  instruments[n].jaw_torque = 0.0;
  instrument_bodies[n]->pressed.clear();
}

void World::Impl::feelInstrument(Index island, Index collider, double h, double share) {
  const std::size_t n = collider - bodies.size() - obstacles.size();
  Instrument& instrument = instruments[n];
  InstrumentBody& body = *instrument_bodies[n];
  if (!std::exchange(body.felt, true)) forgetLoad(n);
  InstrumentLoad load;
  instrument.force += share * body.blocked;
  const Vec3 hinge = instrument.pose * body.shape->hinge, axis = instrument.pose.rotation * Vec3::UnitZ();
  std::vector<char>& met = body.met;
  met.assign(bodies.size(), 0);
  double most = 0.0;  // [kg] of all that it touches
  using Side = SurfaceContacts::RowSide;
  surface_contacts.eachOnLed(
      island, collider, [&](const ContactRow& row, const Side& metal, const Side& tissue, double mass) {
        if (!std::exchange(met[tissue.collider], 1)) most += bodies[tissue.collider]->model->mass;
        double on_jaw[2] = {0.0, 0.0};  // [N]
        for (const RowEntry* at = metal.begin; at != metal.end; ++at) {
          const Vec3 on = at->coefficient / (h * h) * row.impulse;  // [N]
          const Vec3 arm = body.positions[at->particle] - instrument.pose.translation;
          const double moved = std::abs(at->coefficient) * mass;
          load.force += on;
          load.torque += arm.cross(on);
          load.mass += moved;
          load.inertia += moved * arm.squaredNorm();
          const std::uint8_t part = body.shape->parts[at->particle];
          if (part == InstrumentShape::kShaft) continue;
          const double side = part == InstrumentShape::kUpperJaw ? 0.5 : -0.5;
          const Vec3 lever = axis.cross(body.positions[at->particle] - hinge);  // [m] its way for 1 rad
          load.jaw += side * lever.dot(on);
          load.jaw_inertia += 0.25 * moved * lever.squaredNorm();
          if (const double length = lever.norm(); length > 0.0)
            on_jaw[part == InstrumentShape::kLowerJaw] += 2.0 * side * lever.dot(on) / length;
        }
        for (int k = 0; k < 2; ++k) {
          if (on_jaw[k] == 0.0) continue;
          auto pressed = std::find_if(body.pressed.begin(), body.pressed.end(),
                                      [&](const InstrumentBody::Pressed& p) { return p.body == tissue.collider; });
          if (pressed == body.pressed.end()) pressed = body.pressed.insert(pressed, {tissue.collider, {}});
          pressed->on[k] += share * on_jaw[k];
          for (const RowEntry* at = metal.begin; at != metal.end; ++at) {
            const double weight = std::abs(at->coefficient) * row.impulse.norm();
            pressed->at += weight * body.positions[at->particle];
            pressed->weight += weight;
          }
        }
      });
  if (load.mass > most) {  // rows share the particles that they move
    const double part = most / load.mass;
    load.mass *= part;
    load.inertia *= part;
    load.jaw_inertia *= part;
  }
  addLatch(instrument, load);
  instrument.load = load;
  instrument.jaw_torque += share * instrument.cut_torque;
  instrument.force += share * (load.force + instrument.cut_force);
  instrument.torque += share * load.torque;
  instrument.jaw_torque += share * load.jaw;
  body.stepped = true;
}

void World::Impl::stepFreeInstruments(double h, int parts, int parts_left) {
  for (std::size_t n = 0; n < instruments.size(); ++n) {
    InstrumentBody& body = *instrument_bodies[n];
    // What sleeps in its hand is held as before.
    if (std::exchange(body.stepped, false) || (body.rests && !body.felt)) continue;
    if (!body.felt && parts_left == parts) forgetLoad(n);
    instruments[n].load = InstrumentLoad();
    addLatch(instruments[n], instruments[n].load);
    instruments[n].force += instruments[n].load.force / parts;
    instruments[n].torque += instruments[n].load.torque / parts;
    advanceInstrument(static_cast<Index>(bodies.size() + obstacles.size() + n), h, parts_left);
    instruments[n].force += (body.blocked + instruments[n].cut_force) / parts;
    instruments[n].jaw_torque += instruments[n].cut_torque / parts;
  }
}

void World::Impl::finishInstruments(double h_frame) {
  for (std::size_t n = 0; n < instruments.size(); ++n) {
    Instrument& instrument = instruments[n];
    InstrumentBody& body = *instrument_bodies[n];
    if (!instrument.isFinite()) {
      instrument.comeBack();
      body.place(instrument);
      body.pressed.clear();
      say(EventType::kFault, "", 0,
          "the pose of instrument " + instrument.def.name + " was not finite any more; it is where its hand is");
    }
    const bool applies = instrument.def.type == InstrumentType::kClipApplier;
    if ((instrument.def.type != InstrumentType::kGrasper && !applies) || (body.rests && !body.felt)) continue;
    const bool pinches = std::any_of(body.pressed.begin(), body.pressed.end(),
                                     [](const InstrumentBody::Pressed& p) { return p.on[0] > 0.0 && p.on[1] > 0.0; });
    if (!pinches)
      instrument.jaw_stop = 0.0;
    else if (instrument.jaw_stop == 0.0)
      instrument.jaw_stop = kCrushed * instrument.jaw;
    const auto gripOn = [&](const InstrumentBody::Pressed& p) { return std::min(p.on[0], p.on[1]); };
    instrument.gripped = 0.0;
    const InstrumentBody::Pressed* most = nullptr;
    for (const InstrumentBody::Pressed& p : body.pressed) {
      if (bodies[p.body]->name == instrument.holds) instrument.gripped = gripOn(p);
      if (!most || gripOn(p) > gripOn(*most)) most = &p;
    }
    if (applies) {
      if (!instrument.loaded) instrument.closed_to = std::min(instrument.closed_to, instrument.jaw);
      if (!pinches) {
        instrument.loaded = instrument.loaded || instrument.jaw > instrument.closed_to + kReloads;
      } else if (instrument.loaded && gripOn(*most) > kHolds &&
                 (instrument.jaw <= kFires * instrument.jaw_stop / kCrushed ||
                  gripOn(*most) >= kFires * instrument.def.grip)) {
        putOnClip(instrument, bodies[most->body]->name);
      }
      continue;
    }
    if (instrument.latched != 0) {
      const Pick* const held = latchOf(instrument);
      if (held && !(instrument.jaw_target > instrument.closed_to)) {
        instrument.holds = find(held->body)->name;
        instrument.latch_force = -held->force;
        instrument.closed_to = std::min(instrument.closed_to, instrument.jaw_target);
        instrument.lost_for = 0.0;
        continue;
      }
      unlatch(instrument);
    }
    if (!instrument.holds.empty()) {
      if (instrument.gripped > 0.0) {
        instrument.lost_for = 0.0;
        instrument.closed_to = std::min(instrument.closed_to, instrument.jaw_target);
        continue;
      }
      instrument.lost_for += h_frame;
      const bool there = find(instrument.holds) != nullptr;
      if (there && instrument.lost_for < kLostFor) continue;
      const bool opened = instrument.jaw_target > instrument.closed_to;
      if (there) {
        say(opened ? EventType::kReleased : EventType::kDropped, instrument.holds, 0,
            instrument.def.name + (opened ? " let go of " : " dropped ") + instrument.holds +
                (opened ? "" : ": it slipped out of the jaws"));
        events.back().instrument = instrument.def.name;
      }
      instrument.holds.clear();
      instrument.lost_for = 0.0;
    }
    if (!most || !(gripOn(*most) > kHolds)) continue;
    instrument.holds = bodies[most->body]->name;
    instrument.gripped = gripOn(*most);
    instrument.closed_to = instrument.jaw_target;
    say(EventType::kGrasped, instrument.holds, 0,
        instrument.def.name + " grasped " + instrument.holds + " with " + numberText(instrument.gripped, 3) + " N");
    events.back().instrument = instrument.def.name;
    events.back().force = instrument.gripped;
    if (instrument.def.latch) latch(instrument, *bodies[most->body], most->at / most->weight);
  }
}

Pick* World::Impl::latchOf(const Instrument& instrument) {
  if (instrument.latched == 0) return nullptr;
  for (Pick& pick : picks)
    if (pick.id == instrument.latched && find(pick.body)) return &pick;
  return nullptr;
}

void World::Impl::latch(Instrument& instrument, const WorldBody& body, const Vec3& at) {
  const BodyModel& model = *body.model;
  Index nearest = kNoIndex;
  double least = std::numeric_limits<double>::infinity();
  for (Index i = 0; i < model.rest.size(); ++i) {
    const double away = (body.state.positions[i] - at).squaredNorm();
    if (!model.isTissue(i) || !(away < least)) continue;
    least = away;
    nearest = i;
  }
  if (nearest == kNoIndex) return;
  Pick pick;
  pick.id = next_pick++;
  pick.body = body.id;
  pick.locked = pick.latch = true;
  pick.stiffness = instrument.def.stiffness;
  makeGrasp(model, body.state.positions, nearest, graspRadius(model), at, pick);
  pick.place = placeOf(model, pick.particle);
  pick.target = pick.reached = pick.position;
  instrument.latched = pick.id;
  instrument.latch_at = instrument.pose.rotation.conjugate() * (pick.position - instrument.pose.translation);
  instrument.latch_force.setZero();
  picks.push_back(std::move(pick));
}

void World::Impl::unlatch(Instrument& instrument) {
  if (Pick* const held = latchOf(instrument)) {
    wake(*find(held->body));
    picks.erase(picks.begin() + (held - picks.data()));
  }
  instrument.latched = 0;
  instrument.latch_force.setZero();
}

void World::Impl::addLatch(const Instrument& instrument, InstrumentLoad& load) {
  const Pick* const held = latchOf(instrument);
  if (!held) return;
  const double inverse = graspInverseMass(*find(held->body)->model, *held);  // [1/kg]
  const Vec3 arm = held->position - instrument.pose.translation;
  load.force += instrument.latch_force;
  load.torque += arm.cross(instrument.latch_force);
  if (!(inverse > 0.0)) return;
  load.mass += 1.0 / inverse;
  load.inertia += arm.squaredNorm() / inverse;
}

void World::Impl::emptyJaws(const WorldBody& body, const std::string& why) {
  for (Instrument& instrument : instruments) {
    if (instrument.holds != body.name) continue;
    instrument.holds.clear();
    instrument.lost_for = 0.0;
    say(EventType::kReleased, body.name, 0, instrument.def.name + " let go of " + body.name + ": " + why);
    events.back().instrument = instrument.def.name;
  }
}

void World::Impl::putOnClip(Instrument& instrument, const std::string& body) {
  const InstrumentDef& def = instrument.def;
  instrument.loaded = false;
  instrument.closed_to = instrument.jaw;
  ClipCommand command;
  command.body = body;
  command.point = instrument.pose * Vec3(-0.5 * def.jaw_length, 0.0, 0.0);
  command.direction = instrument.pose.rotation * Vec3::UnitY();
  command.width = def.jaw_width;
  command.opening = def.jaw_length;
  ++commands;  // each is another one
  if (const Result<Reply> made = apply(command); !made)
    say(EventType::kMisfired, body, 0, def.name + " put no clip on " + body + ": " + made.error().detail);
  events.back().instrument = def.name;
}

}  // namespace meshless
