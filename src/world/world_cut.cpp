// Closing the scissors: which bodies they meet, their pieces, and what becomes of names and springs.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <sstream>

#include "meshless_surgery/body/cavities.h"
#include "meshless_surgery/tools/grasp.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kGraspSpacings = 4.0;  // radius of a grasp in particle spacings where the scene sets none
constexpr double kOpenAngle = 0.5;      // [rad] of blades that a service closes

struct Severed {
  BodyId parent;
  CutBody cut;
};

// Nearly every body of a scene with many pieces is beside the plane as a whole.
bool meetsPlane(const Points& surface, const Plane& plane) {
  bool above = false, below = false;
  for (const Vec3& p : surface) {
    const double height = plane.height(p);
    above = above || height >= 0.0;
    below = below || height <= 0.0;
    if (above && below) return true;
  }
  return false;
}

}  // namespace

Status World::Impl::checkCut(const CutCommand& command) {
  const ScissorBlades& b = command.blades;
  if (!b.origin.allFinite() || !b.x_axis.allFinite() || !b.y_axis.allFinite()) return notFinite("the blades' pose");
  if (!(std::abs(b.x_axis.norm() - 1.0) < 1e-6 && std::abs(b.y_axis.norm() - 1.0) < 1e-6 &&
        std::abs(b.x_axis.dot(b.y_axis)) < 1e-6))
    return Error{ErrorCode::kInvalidArgument, "the blades' axes are not unit vectors at a right angle"};
  if (!(b.length >= 0.0 && b.length <= 1e9)) return outOfRange("length", b.length, "0 (unbounded) to 1e9 m");
  if (!(b.width >= 0.0 && b.width <= 1e9)) return outOfRange("width", b.width, "0 (unbounded) to 1e9 m");
  if (!(command.close_time >= 0.0 && command.close_time <= 3600.0))
    return outOfRange("close_time", command.close_time, "0 (at once) to 3600 s");
  if (!(command.roughness >= 0.0 && command.roughness <= 1e6))
    return outOfRange("roughness", command.roughness, "0 (clean) to 1e6 m");
  for (const std::string& name : command.bodies)
    if (!find(name)) return Error{ErrorCode::kUnknownName, "there is no body '" + name + "'; " + knownBodies()};
  return Done{};
}

Result<Reply> World::Impl::apply(const CutCommand& command) {
  if (Status status = checkCut(command); !status) return status.error();
  if (command.close_time == 0.0) {
    Result<CutReply> reply = cutNow(command);
    if (!reply) return reply.error();
    return Reply(*reply);
  }
  ClosingCut cut;
  cut.ticket = next_ticket++;
  cut.command = command;
  cut.started_at = step;
  cut.done_at = step + static_cast<std::uint64_t>(std::ceil(command.close_time * settings.step_rate - 1e-9));
  cut.start_angle = kOpenAngle;
  scissors.shown = true;
  scissors.blades = command.blades;
  scissors.angle = cut.start_angle;
  closing.push_back(cut);
  return Reply(CutStarted{cut.ticket});
}

void World::Impl::showBlades(const ClosingCut& cut) {
  const double whole = static_cast<double>(cut.done_at - cut.started_at);
  scissors.blades = cut.command.blades;
  scissors.angle = cut.start_angle * static_cast<double>(cut.done_at - std::min(step, cut.done_at)) / whole;
}

void World::Impl::closeBlades() {
  for (std::size_t i = 0; i < closing.size();) {
    ClosingCut& c = closing[i];
    showBlades(c);
    if (step < c.done_at) {
      ++i;
      continue;
    }
    ++commands;  // each is another one, though several meet in one step
    // Bodies may have been removed or cut by others while the blades closed: the names still there are cut.
    CutCommand command = c.command;
    std::string gone;
    command.bodies.erase(std::remove_if(command.bodies.begin(), command.bodies.end(),
                                        [&](const std::string& name) {
                                          if (find(name)) return false;
                                          gone = name;
                                          return true;
                                        }),
                         command.bodies.end());
    if (!c.command.bodies.empty() && command.bodies.empty())
      finished.emplace(c.ticket, Error{ErrorCode::kMissed, "body '" + gone + "' was gone when the blades met"});
    else
      finished.emplace(c.ticket, cutNow(command));
    closing.erase(closing.begin() + static_cast<std::ptrdiff_t>(i));
    if (closing.empty()) scissors.shown = false;
  }
}

Result<Reply> World::Impl::apply(const OpenScissorsCommand&) {
  if (closing.empty()) return Error{ErrorCode::kMissed, "no scissors are closing"};
  for (const ClosingCut& c : closing)
    finished.emplace(c.ticket, Error{ErrorCode::kMissed, "the scissors were opened before their blades met"});
  closing.clear();
  scissors.shown = false;
  return Reply(Done{});
}

Result<Reply> World::Impl::apply(const OpenBladesCommand& command) {
  const auto found =
      std::find_if(closing.begin(), closing.end(), [&](const ClosingCut& cut) { return cut.ticket == command.ticket; });
  if (found == closing.end())
    return Error{ErrorCode::kMissed, "no blades of the cut " + std::to_string(command.ticket) + " are closing"};
  finished.emplace(found->ticket, Error{ErrorCode::kMissed, "the blades were opened before they met"});
  closing.erase(found);
  scissors.shown = !closing.empty();
  if (scissors.shown) showBlades(closing.back());
  return Reply(Done{});
}

std::optional<Result<CutReply>> World::finishedCut(std::uint32_t ticket) {
  const auto it = impl_->finished.find(ticket);
  if (it == impl_->finished.end()) return std::nullopt;
  Result<CutReply> reply = it->second;
  impl_->finished.erase(it);
  return reply;
}

Result<CutReply> World::Impl::cutNow(const CutCommand& command) {
  const auto start = std::chrono::steady_clock::now();
  const Blade blades = command.blades.blade();
  const Plane plane = blades.plane();
  std::vector<Severed> severed;
  CutReply reply;
  std::string refused;
  for (auto& body : bodies) {
    if (!command.bodies.empty() &&
        std::find(command.bodies.begin(), command.bodies.end(), body->name) == command.bodies.end())
      continue;
    refreshSurface(*body);
    if (!meetsPlane(body->state.surface, plane)) continue;
    TriangleMesh present;
    present.vertices = body->state.surface;
    present.triangles = body->model->surface.triangles;
    if (!meets(present, blades)) continue;
    Result<CutBody> cut =
        cutBody(*body->model, body->state, Blade::through(plane),
                {command.roughness, static_cast<std::uint32_t>(next_ticket + step), picked(body->id)});
    if (cut) {
      severed.push_back({body->id, std::move(*cut)});
    } else if (cut.error().code != ErrorCode::kMissed) {
      refused = body->name + " cannot be cut: " + cut.error().detail;
      reply.notes.push_back(refused);
    }
  }
  std::vector<BodyId> whole;
  for (const Severed& s : severed) whole.push_back(s.parent);
  const std::vector<std::vector<char>> parted = partedBy(blades, command.bodies, whole);
  if (severed.empty() && !anyIn(parted)) {
    if (!refused.empty()) return Error{ErrorCode::kUnsuitableShape, refused};
    return Error{ErrorCode::kMissed, command.bodies.empty() ? "the blades met no body; " + knownBodies()
                                                            : "the blades met none of the bodies named"};
  }

  std::size_t gone = 0, come = 0;
  for (const Severed& s : severed) {
    gone += find(s.parent)->model->next_patch > 1;
    come += s.cut.pieces.size();
  }
  if (Status status = checkPieces(gone, come); !status) return status.error();

  // From here nothing fails: parents are retired and their pieces admitted.
  CutUndo before = beforeCut();
  for (std::string& note : partFibres(parted)) reply.notes.push_back(std::move(note));
  for (Severed& s : severed) {
    const std::string parent_name = find(s.parent)->name;
    const std::vector<std::string> names = replaceByPieces(s.parent, std::move(s.cut.pieces));
    reply.new_bodies.insert(reply.new_bodies.end(), names.begin(), names.end());
    reply.cut_bodies.push_back(parent_name);
    reply.cap_area += s.cut.opened_area;
    reply.work += s.cut.work;
    say(EventType::kCut, parent_name, 0, "cut into " + std::to_string(names.size()) + " pieces");
  }
  rememberCut(std::move(before), reply.cut_bodies, reply.new_bodies);
  reply.duration = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return reply;
}

void World::Impl::sayLeaks(const std::string& name, const BodyModel& model, const BodyState& state) {
  for (const FilledCavity& cavity : state.cavities) {
    if (!shellOf(model, cavity.patch)->open || cavity.open_for > 0.0) continue;
    std::ostringstream text;
    text << "a cavity of " << name << " is open: its pressure of " << cavity.pressure << " Pa falls to 0 in "
         << cavity.leak << " s";
    say(EventType::kLeak, name, 0, text.str());
    events.back().cavity = cavity.patch;
  }
}

Status World::Impl::checkPieces(std::size_t gone, std::size_t come) const {
  std::size_t pieces = 0;
  for (const auto& body : bodies) pieces += body->model->next_patch > 1;
  // What opens one and parts nothing is always possible.
  if (pieces - gone + come <= kMostPieces || come <= gone) return Done{};
  return Error{ErrorCode::kFailed, "there would be " + std::to_string(pieces - gone + come) +
                                       " pieces; accepted: up to " + std::to_string(kMostPieces) +
                                       ": remove some, or name the bodies to be cut"};
}

std::vector<std::string> World::Impl::replaceByPieces(const BodyId& parent_id, std::vector<BodyPiece> pieces) {
  WorldBody& parent = *find(parent_id);
  wake(parent);
  const std::string parent_name = parent.name, root = parent.root;
  const Material material = parent.material;
  const bool touched = parent.touched_by_push;
  std::vector<std::string> names;
  std::vector<Descent> descents;
  int number = 0;
  for (BodyPiece& piece : pieces) {
    std::string name;
    do name = parent_name + "." + std::to_string(++number);
    while (used_names.count(name));
    descents.push_back(descentOf(piece));
    WorldBody& child = admit(name, material, std::move(piece.model), std::move(piece.state));
    sayLeaks(name, *child.model, child.state);
    child.touched_by_push = touched;
    child.root = root;
    descents.back().child = child.id;
    names.push_back(name);
  }
  followPieces(parent_id, find(parent_id)->state.positions, descents);
  std::vector<BodyId> children;
  for (const Descent& descent : descents) children.push_back(descent.child);
  followFibres(parent_id, *find(parent_id)->model, find(parent_id)->state.positions, children);
  retire(parent_id);
  return names;
}

double World::Impl::graspRadius(const BodyModel& model) const {
  return settings.pick_radius > 0.0 ? settings.pick_radius : kGraspSpacings * model.spacing;
}

std::vector<TissuePlace> World::Impl::picked(const BodyId& body) const {
  std::vector<TissuePlace> places;
  for (const Pick& pick : picks)
    if (pick.body == body) places.push_back(pick.place);
  return places;
}

World::Impl::Descent World::Impl::descentOf(BodyPiece& piece) {
  return {BodyId(), std::move(piece.parent_particles), std::move(piece.copied_from), std::move(piece.places)};
}

void World::Impl::followPieces(const BodyId& parent, const Points& before, const std::vector<Descent>& pieces) {
  std::size_t asked = 0;  // in the order of picked()
  for (Pick& pick : picks) {
    if (pick.body != parent) continue;
    const std::size_t n = asked++;
    const Vec3 grabbed = graspMean(pick, before);
    const auto holdIn = [&](const Descent& piece, Index centre, const TissuePlace& place) {
      const WorldBody& child = *find(piece.child);
      const std::vector<Index>& old = piece.parent_particles;
      std::vector<Index> patch;
      for (const Index particle : pick.patch)
        if (const auto at = std::find(old.begin(), old.end(), particle); at != old.end())
          patch.push_back(static_cast<Index>(at - old.begin()));
      bool parted = patch.size() < pick.patch.size();
      for (std::size_t i = 0; i < piece.copied_from.size() && !parted; ++i)
        parted = old[i] == kNoIndex &&
                 std::find(pick.patch.begin(), pick.patch.end(), piece.copied_from[i]) != pick.patch.end();
      if (parted) {
        makeGrasp(*child.model, child.state.positions, centre, graspRadius(*child.model), grabbed, pick);
      } else {  // a cut elsewhere changes nothing of it
        pick.patch = std::move(patch);
        pick.particle = centre;
      }
      pick.body = child.id;
      pick.place = place;
    };
    const auto holds = [&](const Descent& piece) {
      return n < piece.places.size() && piece.places[n].cell != kNoIndex;
    };
    if (const auto holder = std::find_if(pieces.begin(), pieces.end(), holds); holder != pieces.end()) {
      holdIn(*holder, centreIn(*holder, holder->places[n], pick.particle), holder->places[n]);
      continue;
    }
    for (const Descent& piece : pieces) {
      const std::vector<Index>& old = piece.parent_particles;
      const auto centre = std::find(old.begin(), old.end(), pick.particle);
      if (centre == old.end()) continue;
      holdIn(piece, static_cast<Index>(centre - old.begin()), {});
      break;
    }
  }
}

// The copy of the particle that was grabbed, or else the corner nearest to the place, of the cell that has it.
Index World::Impl::centreIn(const Descent& piece, const TissuePlace& place, Index grabbed) {
  const LatticeCell& cell = find(piece.child)->model->lattice->cells[place.cell];
  int nearest = 0;
  for (int k = 0; k < 8; ++k) {
    if (piece.copied_from[cell.corners[k]] == grabbed) return cell.corners[k];
    if (trilinearWeight(k, place.at) > trilinearWeight(nearest, place.at)) nearest = k;
  }
  return cell.corners[nearest];
}

}  // namespace meshless
