// Partial cuts: which bodies a blade opens, and what becomes of those that come apart.
#include <algorithm>
#include <chrono>
#include <cmath>

#include "meshless_surgery/body/cut_body.h"
#include "world_impl.h"

namespace meshless {
namespace {

Status checkBlade(const Blade& b) {
  if (!b.origin.allFinite() || !b.x_axis.allFinite() || !b.y_axis.allFinite()) return notFinite("the blade's pose");
  if (!(std::abs(b.x_axis.norm() - 1.0) < 1e-6 && std::abs(b.y_axis.norm() - 1.0) < 1e-6 &&
        std::abs(b.x_axis.dot(b.y_axis)) < 1e-6))
    return Error{ErrorCode::kInvalidArgument, "the blade's axes are not unit vectors at a right angle"};
  if (!(b.length > 0.0 && b.length <= 1e9)) return outOfRange("length", b.length, "above 0 to 1e9 m");
  if (!(b.depth > 0.0 && b.depth <= 1e9)) return outOfRange("depth", b.depth, "above 0 to 1e9 m");
  return Done{};
}

}  // namespace

Result<Reply> World::Impl::apply(const InciseCommand& command) {
  if (Status status = checkBlade(command.blade); !status) return status.error();
  for (const std::string& name : command.bodies)
    if (!find(name)) return Error{ErrorCode::kUnknownName, "there is no body '" + name + "'; " + knownBodies()};
  Result<InciseReply> reply = inciseNow(command);
  if (!reply) return reply.error();
  return Reply(*reply);
}

Result<InciseReply> World::Impl::inciseNow(const InciseCommand& command, const Blade* at_rest) {
  const auto start = std::chrono::steady_clock::now();
  Box reach;
  for (double s : {-command.blade.behind, command.blade.length})
    for (double t : {command.blade.rise, -command.blade.depth})
      reach.extend(command.blade.origin + s * command.blade.x_axis + t * command.blade.y_axis);

  struct Opened {
    BodyId id;
    CutBody body;
  };
  std::vector<Opened> all;
  InciseReply reply;
  std::optional<Error> refused;
  std::string missed;
  for (auto& body : bodies) {
    if (!command.bodies.empty() &&
        std::find(command.bodies.begin(), command.bodies.end(), body->name) == command.bodies.end())
      continue;
    refreshSurface(*body);
    Box bounds;
    for (const Vec3& p : body->state.surface) bounds.extend(p);
    if (!at_rest && !bounds.overlaps(reach)) continue;
    Result<CutBody> opened = cutBody(*body->model, body->state, at_rest ? *at_rest : command.blade,
                                     {0.0, 0, picked(body->id), at_rest != nullptr});
    if (opened) {
      all.push_back({body->id, std::move(*opened)});
    } else if (opened.error().code == ErrorCode::kMissed) {
      missed = body->name + ": " + opened.error().detail;
    } else {
      refused = Error{opened.error().code, body->name + " cannot be opened: " + opened.error().detail};
      reply.notes.push_back(refused->detail);
    }
  }
  const Blade& blade = command.blade;
  const std::vector<std::vector<char>> parted = partedBy(blade, command.bodies, {});
  if (all.empty() && !anyIn(parted)) {
    if (refused) return *refused;
    if (!missed.empty()) return Error{ErrorCode::kMissed, missed};
    return Error{ErrorCode::kMissed, command.bodies.empty() ? "the blade met no body; " + knownBodies()
                                                            : "the blade met none of the bodies named"};
  }

  std::size_t gone = 0, come = 0;
  for (const Opened& opened : all) {
    gone += find(opened.id)->model->next_patch > 1;
    come += opened.body.pieces.size();
  }
  if (Status status = checkPieces(gone, come); !status) return status.error();

  // From here nothing fails.
  CutUndo before = beforeCut();
  for (std::string& note : partFibres(parted)) reply.notes.push_back(std::move(note));
  for (Opened& opened : all) {
    WorldBody& body = *find(opened.id);
    const std::string name = body.name;
    reply.cut_bodies.push_back(name);
    reply.opened_area += opened.body.opened_area;
    reply.work += opened.body.work;
    if (opened.body.pieces.size() == 1) {
      wake(body);
      const Points positions = body.state.positions;
      Descent descent = descentOf(opened.body.pieces[0]);
      descent.child = body.id;
      const BodyModelPtr whole = std::exchange(body.model, std::move(opened.body.pieces[0].model));
      body.state = std::move(opened.body.pieces[0].state);
      followPieces(body.id, positions, {descent});
      followFibres(body.id, *whole, positions, {body.id});
      body.mesh.reset();
      body.surface_current = true;
      body.rest_from.clear();  // it was of the old particles
      surface_contacts.forget(body.number);
      batches_current = contacts_current = false;  // they are of the old model
      say(EventType::kIncised, name, 0, "opened");
      sayLeaks(name, *body.model, body.state);
    } else {
      const std::vector<std::string> names = replaceByPieces(opened.id, std::move(opened.body.pieces));
      reply.new_bodies.insert(reply.new_bodies.end(), names.begin(), names.end());
      say(EventType::kIncised, name, 0, "opened, and came apart into " + std::to_string(names.size()) + " pieces");
    }
  }
  rememberCut(std::move(before), reply.cut_bodies, reply.new_bodies);
  reply.duration = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return reply;
}

}  // namespace meshless
