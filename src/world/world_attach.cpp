// What holds organs together: fibres are made, drawn, cut, torn, and follow the pieces of a body.
#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <limits>
#include <map>
#include <optional>
#include <sstream>
#include <utility>

#include "meshless_surgery/base/compressed_rows.h"
#include "meshless_surgery/geometry/query/nearest_on_triangle.h"
#include "meshless_surgery/geometry/query/union_find.h"
#include "surface_parts.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kFacing = -0.5;       // cosine: faces are joined that face each other by this or less
constexpr std::size_t kLongName = 90;  // of a name that is chosen, at most
constexpr std::size_t kMostNamed = 5;  // patches

/// Whose faces share corners, the largest first.
std::vector<AttachReply::Patch> patchesOf(const std::map<SurfaceCube, SurfacePart>& parts, const ShownSurface& of) {
  UnionFind joined(parts.size());
  std::vector<Index> first(of.vertices.size(), kNoIndex);  // fibre at each corner
  for (const auto& [cube, part] : parts)
    for (std::size_t f = 0; f < part.faces.size() && part.fibre != kNoIndex; ++f)
      for (const Index v : of.surface->triangles[part.faces[f].first]) {
        if (first[v] == kNoIndex) first[v] = part.fibre;
        joined.join(first[v], part.fibre);
      }
  std::map<Index, AttachReply::Patch> found;
  for (const auto& [cube, part] : parts) {
    if (part.fibre == kNoIndex) continue;
    AttachReply::Patch& patch = found[joined.find(part.fibre)];
    patch.area += part.area;
    patch.middle += part.area * part.middle;
  }
  std::vector<AttachReply::Patch> patches;
  for (const auto& [root, patch] : found) patches.push_back({patch.area, patch.middle / patch.area});
  std::stable_sort(patches.begin(), patches.end(), [](const auto& a, const auto& b) { return a.area > b.area; });
  return patches;
}

bool isOpen(const WorldBody* body) { return body && !body->model->solid; }

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

Status checkNumbers(const AttachCommand& command, bool to_world) {
  if (!(command.stiffness > 0.0 && command.stiffness <= 1e15))
    return outOfRange("stiffness", command.stiffness, "above 0 to 1e15 N/m^3");
  if (command.strength && !(*command.strength > 0.0 && *command.strength <= 1e15))
    return outOfRange("strength", *command.strength, "above 0 to 1e15 Pa, or none");
  if (!to_world && !(command.distance > 0.0 && command.distance <= 1000.0))
    return outOfRange("distance", command.distance, "above 0 to 1000 m");
  return Done{};
}

}  // namespace

Status checkRegion(const std::optional<Region>& region) {
  if (!region) return Done{};
  switch (region->kind) {
    case Region::Kind::kBox:
      if (!region->box.min.allFinite() || !region->box.max.allFinite()) return notFinite("the box of region");
      return Done{};
    case Region::Kind::kPlane:
      if (!region->plane.point.allFinite() || !region->plane.normal.allFinite())
        return notFinite("the plane of region");
      return Done{};
    case Region::Kind::kSphere:
      if (!region->centre.allFinite()) return notFinite("the centre of region");
      if (!(region->radius > 0.0 && region->radius <= 1e6))
        return outOfRange("the radius of region", region->radius, "above 0 to 1e6 m");
      return Done{};
    case Region::Kind::kMesh:
      break;
  }
  return Error{ErrorCode::kUnsupported, "region is " + region->text() + "; accepted: a box, a plane or a sphere"};
}

std::string AttachReply::text() const {
  std::ostringstream text;
  text << std::setprecision(3) << fibres << (fibres == 1 ? " fibre" : " fibres") << " on " << 1e4 * area << " cm^2, in "
       << patches.size() << (patches.size() == 1 ? " patch" : " patches");
  for (std::size_t k = 0; k < patches.size() && k < kMostNamed; ++k)
    text << (k > 0 ? ", " : ": ") << 1e4 * patches[k].area << " cm^2 around (" << patches[k].middle.x() << ", "
         << patches[k].middle.y() << ", " << patches[k].middle.z() << ") m";
  if (patches.size() > kMostNamed) text << " ...";
  return text.str();
}

Result<AttachReply> World::Impl::attach(const AttachCommand& command) {
  const auto obstacleOf = [this](const std::string& name) -> const WorldObstacle* {
    for (const auto& obstacle : obstacles)
      if (obstacle->def->name == name) return obstacle.get();
    return nullptr;
  };
  std::string names[] = {command.body, command.other};
  for (const std::string& name : names) {
    if (find(name) || obstacleOf(name) || name == kWorldEnd) continue;
    std::string known = knownBodies();
    for (const auto& obstacle : obstacles) known += "; obstacle " + obstacle->def->name;
    return Error{ErrorCode::kUnknownName, "there is no body '" + name + "'; " + known + "; or '" + kWorldEnd + "'"};
  }
  if (names[0] == names[1])
    return Error{ErrorCode::kInvalidArgument, "'" + names[0] + "' is to be attached to itself; accepted: two bodies"};
  if (!find(names[0])) std::swap(names[0], names[1]);
  WorldBody* const a = find(names[0]);
  if (!a)
    return Error{ErrorCode::kInvalidArgument,
                 "neither '" + command.body + "' nor '" + command.other + "' is a body; " + knownBodies()};
  WorldBody* const b = find(names[1]);
  const WorldObstacle* const obstacle = b ? nullptr : obstacleOf(names[1]);
  const bool to_world = !b && !obstacle;
  if (Status numbers = checkNumbers(command, to_world); !numbers) return numbers.error();
  if (Status region = checkRegion(command.region); !region) return region.error();
  Attachment made;
  Result<std::string> name = newAttachmentName(command.name, names[0] + "-" + names[1]);
  if (!name) return name.error();
  made.name = *name;
  made.stiffness = command.stiffness;
  made.strength = command.strength;
  if (!b) made.other = names[1];

  const ShownSurface of_a = shownNow(*a);
  ShownSurface of_b;
  if (b) of_b = shownNow(*b);
  if (obstacle) of_b = {&obstacle->surface, obstacle->def->mesh.vertices};
  if (of_a.surface->triangles.empty() || (b && of_b.surface->triangles.empty()))
    return Error{ErrorCode::kUnsuitableShape, "a body without a surface cannot be attached"};
  std::optional<FaceSearch> search;
  if (!to_world) search.emplace(of_b);
  const bool open = isOpen(a) || isOpen(b);  // whose faces face both ways

  const double edge = a->edge_length;
  Points samples;                                        // [m]
  double gap = std::numeric_limits<double>::infinity();  // [m]
  const auto faces = [&](const Vec3& p, Index, const Vec3& area) {
    if (command.region && !command.region->contains(p)) return false;
    samples.push_back(p);
    if (to_world) return true;
    const NearestFace there = search->nearest(p, command.distance);
    if (there.face == kNoIndex) return false;
    gap = std::min(gap, there.distance);
    const Vec3 other = of_b.areaOf(there.face);
    return open || other.dot(area) <= kFacing * other.norm() * area.norm();
  };
  std::map<SurfaceCube, SurfacePart> parts = surfaceParts(
      of_a, edge, [&](Index, double longest) { return longest / (kLongFace * edge); }, faces);
  for (auto& [cube, part] : parts) {
    Fibre fibre;
    fibre.a = a->id;
    fibre.area = part.area;
    fibre.at_a = pointOf(part, of_a);
    const Vec3 at = fibre.at_a.of(a->state.positions);
    fibre.place = at;
    double skin = 0.0;
    if (!to_world) {
      const NearestFace there = search->nearest(part.middle);
      if (there.face == kNoIndex) continue;
      fibre.place = of_b.at(there.face, there.shares);
      skin = kSkin * std::min(edge, b ? b->edge_length : obstacle->surface.edge_length);
      if (b) {
        fibre.b = b->id;
        fibre.at_b = pointOn(*of_b.surface, there);
        fibre.place = fibre.at_b.of(b->state.positions);
      }
      fibre.rest = std::max((at - fibre.place).norm(), skin);  // contact keeps them a skin apart
      if (b) fibre.place.setZero();
    }
    part.fibre = static_cast<Index>(made.fibres.size());
    made.fibres.push_back(std::move(fibre));
  }
  if (made.fibres.empty()) {
    if (samples.empty())
      return Error{ErrorCode::kMissed, "no surface of '" + names[0] + "' lies in " + command.region->text()};
    if (std::isfinite(gap))
      return Error{ErrorCode::kMissed, "'" + names[0] + "' and '" + names[1] + "' are " + number(gap) +
                                           " m apart, but do not face each other there"};
    for (const Vec3& p : samples) gap = std::min(gap, search->nearest(p, gap).distance);
    return Error{ErrorCode::kMissed, "'" + names[0] + "' and '" + names[1] + "' are " + number(gap) + " m apart" +
                                         (command.region ? " in " + command.region->text() : std::string()) +
                                         "; distance is " + number(command.distance) + " m"};
  }

  // From here nothing fails.
  made.made = static_cast<std::uint32_t>(made.fibres.size());
  AttachReply reply{made.name, made.fibres.size(), 0.0, patchesOf(parts, of_a)};
  for (const Fibre& fibre : made.fibres) reply.area += fibre.area;
  wake(*a);
  if (b) wake(*b);
  say(EventType::kAttached, a->name, 0,
      "'" + made.name + "': " + names[0] + " is attached to " + names[1] + " by " + std::to_string(reply.fibres) +
          " fibres");
  keepAttachment(std::move(made));
  return reply;
}

void World::Impl::keepAttachment(Attachment made) {
  used_attachments.insert(made.name);
  attachments.erase(std::remove_if(attachments.begin(), attachments.end(),
                                   [&](const Attachment& torn) { return torn.name == made.name; }),
                    attachments.end());
  attachments.push_back(std::move(made));
}

Result<std::string> World::Impl::newAttachmentName(const std::string& wanted, const std::string& stem) const {
  const bool there = std::any_of(attachments.begin(), attachments.end(),
                                 [&](const Attachment& of) { return of.name == wanted && !of.fibres.empty(); });
  if (there)
    return Error{ErrorCode::kDuplicateName,
                 "the attachment '" + wanted + "' is there already; accepted: another name, or detach it first"};
  if (!wanted.empty()) return wanted;
  const std::string chosen = stem.size() <= kLongName ? stem : "attachment";
  std::string name = chosen;
  for (int n = 2; used_attachments.count(name); ++n) name = chosen + "_" + std::to_string(n);
  return name;
}

ShownSurface World::Impl::shownNow(WorldBody& body) {
  measureSurface(body);
  ShownSurface shown;
  shown.surface = &surfaceModel(body).surface;
  if (body.model->collision) {
    for (Index v = 0; v < shown.surface->vertices(); ++v)
      shown.vertices.push_back(shown.surface->supports.sum(v, body.state.positions.data()));
  } else {
    refreshSurface(body);
    shown.vertices = body.state.surface;
  }
  return shown;
}

Result<AttachReply> World::addSceneAttachment(const AttachCommand& attachment) {
  Result<AttachReply> reply = impl_->attach(attachment);
  if (!reply) return reply;
  impl_->scene_attachments.push_back(attachment);
  impl_->scene_attachments.back().name = reply->name;
  return reply;
}

Result<Reply> World::Impl::apply(const AttachCommand& command) {
  Result<AttachReply> reply = attach(command);
  if (!reply) return reply.error();
  return Reply(*reply);
}

Result<Reply> World::Impl::apply(const DetachCommand& command) {
  const auto found = std::find_if(attachments.begin(), attachments.end(),
                                  [&](const Attachment& attachment) { return attachment.name == command.name; });
  if (found == attachments.end()) {
    std::string known;
    for (std::size_t n = 0; n < attachments.size() && n < 20; ++n) known += (n ? ", " : "") + attachments[n].name;
    return Error{ErrorCode::kUnknownName, "there is no attachment '" + command.name + "'; " +
                                              (known.empty() ? "there are none" : "attachments are: " + known)};
  }
  if (Status region = checkRegion(command.region); !region) return region.error();
  const auto lies = [&](const Fibre& fibre) {
    if (!command.region) return true;
    const Points ends = fibreEnds(fibre);
    return command.region->contains(ends[0]) || command.region->contains(ends[1]);
  };
  if (command.region && std::none_of(found->fibres.begin(), found->fibres.end(), lies))
    return Error{ErrorCode::kMissed, "no fibre of '" + command.name + "' is in " + command.region->text()};
  DetachReply reply;
  reply.gone = loseFibres(*found, EventType::kDetached, "were detached", lies);
  if (reply.gone > 0) events.back().taken_apart = !found->clip;
  reply.left = found->fibres.size();
  if (found->fibres.empty()) attachments.erase(found);
  return Reply(reply);
}

Points World::Impl::fibreEnds(const Fibre& fibre) {
  const WorldBody* const b = find(fibre.b);
  return {fibre.at_a.of(find(fibre.a)->state.positions), b ? fibre.at_b.of(b->state.positions) : fibre.place};
}

std::string World::Impl::firstBodyOf(const Attachment& attachment) {
  const WorldBody* const body = attachment.fibres.empty() ? nullptr : find(attachment.fibres.front().a);
  return body ? body->name : std::string();
}

std::size_t World::Impl::loseFibres(Attachment& attachment, EventType type, const std::string& why,
                                    const std::function<bool(const Fibre&)>& gone) {
  const std::string body = firstBodyOf(attachment);
  std::vector<Fibre> left;
  for (Fibre& fibre : attachment.fibres) {
    if (!gone(fibre)) {
      left.push_back(std::move(fibre));
      continue;
    }
    for (const BodyId& id : {fibre.a, fibre.b})
      if (WorldBody* const end = find(id)) wake(*end);
  }
  const std::size_t lost = attachment.fibres.size() - left.size();
  attachment.fibres = std::move(left);
  if (lost > 0)
    say(type, body, 0,
        "'" + attachment.name + "': " + std::to_string(lost) + " fibres " + why + ", " +
            std::to_string(attachment.fibres.size()) + " of " + std::to_string(attachment.made) + " are left");
  return lost;
}

Vec3 World::Impl::restPlace(const Attachment& clip) {
  Vec3 sum = Vec3::Zero();
  for (const Fibre& fibre : clip.fibres)
    for (const auto& [id, at] : {std::make_pair(fibre.a, &fibre.at_a), {fibre.b, &fibre.at_b}})
      if (const WorldBody* const body = find(id)) sum += body->state.placed * at->of(body->model->rest);
  return clip.fibres.empty() ? sum : Vec3(sum / (2.0 * static_cast<double>(clip.fibres.size())));
}

void World::Impl::showAttachments(const SnapshotWants& wants, std::vector<AttachmentSnapshot>& shown) {
  for (const Attachment& attachment : attachments) {
    AttachmentSnapshot snapshot;
    snapshot.name = attachment.name;
    snapshot.fibres = attachment.fibres.size();
    snapshot.made = attachment.made;
    std::vector<BodyId> ends;
    for (const Fibre& fibre : attachment.fibres) {
      snapshot.area += fibre.area;
      snapshot.force += fibre.tension;
      for (const BodyId& id : {fibre.a, fibre.b})
        if (std::find(ends.begin(), ends.end(), id) == ends.end()) ends.push_back(id);
      const Points line = fibreEnds(fibre);
      snapshot.middle += (line[0] + line[1]) / (2.0 * static_cast<double>(attachment.fibres.size()));
      if (wants.surfaces && !attachment.clip) snapshot.lines.push_back({line[0], line[1]});
    }
    for (const BodyId& id : ends)
      if (const WorldBody* const body = find(id)) snapshot.ends.push_back(body->name);
    if (attachment.clip) {
      snapshot.jaws = attachment.clip->jaws;
      snapshot.rest_place = restPlace(attachment);
      if (wants.surfaces) snapshot.lines = jawLines(attachment);
    }
    if (!attachment.other.empty()) snapshot.ends.push_back(attachment.other);
    shown.push_back(std::move(snapshot));
  }
}

// --- cuts

std::vector<std::vector<char>> World::Impl::partedBy(const Blade& blade, const std::vector<std::string>& of,
                                                     const std::vector<BodyId>& severed) {
  const auto isIn = [](const auto& list, const auto& value) {
    return std::find(list.begin(), list.end(), value) != list.end();
  };
  const Blade all = Blade::through(blade.plane());
  std::vector<std::vector<char>> parted;
  for (const Attachment& attachment : attachments) {
    std::vector<char> gone;
    for (const Fibre& fibre : attachment.fibres) {
      bool meant = of.empty(), whole = false;
      for (const BodyId& id : {fibre.a, fibre.b}) {
        const WorldBody* const body = find(id);
        meant = meant || (body && isIn(of, body->name));
        whole = whole || isIn(severed, id);
      }
      const Points ends = fibreEnds(fibre);
      meant = meant && !attachment.clip;  // no blade cuts a clip
      gone.push_back(meant && (whole ? all : blade).passes(ends[0], ends[1]));
    }
    parted.push_back(std::move(gone));
  }
  return parted;
}

bool World::Impl::anyIn(const std::vector<std::vector<char>>& parted) {
  return std::any_of(parted.begin(), parted.end(), [](const std::vector<char>& gone) {
    return std::find(gone.begin(), gone.end(), 1) != gone.end();
  });
}

std::vector<std::string> World::Impl::partFibres(const std::vector<std::vector<char>>& parted) {
  std::vector<std::string> notes;
  for (std::size_t n = 0; n < parted.size(); ++n) {
    std::size_t at = 0;
    const std::size_t lost = loseFibres(attachments[n], EventType::kDetached, "were cut",
                                        [&](const Fibre&) { return parted[n][at++] != 0; });
    if (lost > 0) notes.push_back("cut " + std::to_string(lost) + " fibres of '" + attachments[n].name + "'");
  }
  return notes;
}

// By where their ends are at rest, on the surface of the piece that is there.
void World::Impl::followFibres(const BodyId& parent, const BodyModel& model, const Points& before,
                               const std::vector<BodyId>& pieces) {
  const auto isOf = [&](const Fibre& fibre) { return fibre.a == parent || fibre.b == parent; };
  if (!isForced(parent) && std::none_of(attachments.begin(), attachments.end(), [&](const Attachment& attachment) {
        return std::any_of(attachment.fibres.begin(), attachment.fibres.end(), isOf);
      }))
    return;
  std::vector<ShownSurface> shown(pieces.size());
  std::vector<FaceSearch> searches;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    const ContactSurface& surface = surfaceModel(*find(pieces[p])).surface;
    shown[p] = {&surface, surface.rest};
    searches.emplace_back(shown[p]);
  }
  const auto follow = [&](BodyId& id, BodyPoint& end) {
    const Vec3 rest = end.of(model.rest);
    NearestFace nearest;
    std::size_t of = 0;
    for (std::size_t p = 0; p < pieces.size(); ++p) {
      if (shown[p].surface->triangles.empty()) continue;
      const NearestFace found = searches[p].nearest(rest, nearest.distance);
      if (!(found.distance < nearest.distance)) continue;
      nearest = found;
      of = p;
    }
    if (nearest.face == kNoIndex) return;
    id = pieces[of];
    end = pointOn(*shown[of].surface, nearest);
  };
  for (Attachment& attachment : attachments)
    for (Fibre& fibre : attachment.fibres) {
      if (!isOf(fibre)) continue;
      const auto endBefore = [&](const BodyId& id, const BodyPoint& at) {
        if (id == parent) return at.of(before);
        const WorldBody* const other = find(id);
        return other ? at.of(other->state.positions) : fibre.place;
      };
      const double was = (endBefore(fibre.a, fibre.at_a) - endBefore(fibre.b, fibre.at_b)).norm();  // [m]
      const bool follows[] = {fibre.a == parent, fibre.b == parent};
      for (int e = 0; e < 2; ++e)
        if (follows[e]) follow(e == 0 ? fibre.a : fibre.b, e == 0 ? fibre.at_a : fibre.at_b);
      // So that nothing jumps where the new point is a little beside the old one.
      const Points ends = fibreEnds(fibre);
      fibre.rest = std::max(0.0, fibre.rest + (ends[0] - ends[1]).norm() - was);
    }
  for (AppliedForce& force : forces)
    for (AppliedForce::Point& point : force.points)
      if (point.body == parent) follow(point.body, point.at);
}

// --- a step

void World::Impl::listFibres() {
  attached.all.clear();
  attached.offsets.clear();
  attached.of_body.clear();
  if (attachments.empty()) return;
  std::vector<Index> body_in(generations.size(), kNoIndex);  // by slots
  for (Index b = 0; b < bodies.size(); ++b) body_in[bodies[b]->id.slot] = b;
  for (Attachment& attachment : attachments)
    for (Fibre& fibre : attachment.fibres) {
      const Index b = fibre.b.slot < body_in.size() ? body_in[fibre.b.slot] : kNoIndex;
      attached.all.push_back({&fibre, attachment.stiffness * fibre.area, body_in[fibre.a.slot], b});
    }
  if (attached.all.empty()) return;
  const auto each = [this](const auto& visit) {
    for (Index n = 0; n < attached.all.size(); ++n) visit(attached.all[n].a, n);
  };
  compressRows(bodies.size(), each, attached.offsets, attached.of_body);
}

// Who is joined sleeps and wakes together.
void World::Impl::wakeAttached() {
  for (bool woken = true; woken;) {
    woken = false;
    for (const AttachedFibre& fibre : attached.all) {
      if (fibre.b == kNoIndex || bodies[fibre.a]->asleep == bodies[fibre.b]->asleep) continue;
      wake(*bodies[bodies[fibre.a]->asleep ? fibre.a : fibre.b]);
      woken = true;
    }
  }
  for (const AttachedFibre& fibre : attached.all)
    if (!bodies[fibre.a]->asleep) fibre.fibre->tension = 0.0;
}

void World::Impl::tearFibres() {
  const std::size_t before = report.torn;
  for (Attachment& attachment : attachments) {
    if (!attachment.strength) continue;
    const auto tears = [&](const Fibre& fibre) { return fibre.tension > *attachment.strength * fibre.area; };
    const auto first = std::find_if(attachment.fibres.begin(), attachment.fibres.end(), tears);
    if (first == attachment.fibres.end()) continue;
    const std::string body = firstBodyOf(attachment);
    for (auto fibre = first; fibre != attachment.fibres.end(); ++fibre) {
      if (!tears(*fibre)) continue;
      ++report.torn;
      for (const BodyId& id : {fibre->a, fibre->b})
        if (WorldBody* const end = find(id)) wake(*end);
    }
    attachment.fibres.erase(std::remove_if(first, attachment.fibres.end(), tears), attachment.fibres.end());
    if (!std::exchange(attachment.torn, true))
      say(EventType::kTorn, body, 0, "'" + attachment.name + "' begins to tear");
    if (attachment.fibres.empty())
      say(EventType::kTorn, body, 0, "'" + attachment.name + "' is torn off: no fibre is left");
  }
  if (report.torn != before) listFibres();
}

}  // namespace meshless
