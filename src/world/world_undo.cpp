// The state before a cut, kept so that it can be taken back.
#include <algorithm>

#include "world_impl.h"

namespace meshless {
namespace {

constexpr std::size_t kMostUndone = 8;  // cuts that are remembered

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

CutUndo World::Impl::beforeCut() const {
  CutUndo before;
  for (const auto& body : bodies)
    before.bodies.push_back(
        {body->id, body->name, body->root, body->number, body->material, body->model, body->state, body->surface_current});
  before.picks = picks;
  for (const Pick& pick : picks) {
    const auto held =
        std::find_if(bodies.begin(), bodies.end(), [&](const auto& body) { return body->id == pick.body; });
    before.pick_bodies.push_back(held != bodies.end() ? (*held)->name : std::string());
  }
  before.attachments = attachments;
  return before;
}

void World::Impl::rememberCut(CutUndo before, std::vector<std::string> cut, std::vector<std::string> pieces) {
  before.stroke = stroke_of_cut;
  if (stroke_of_cut != 0 && !undo.empty() && undo.back().stroke == stroke_of_cut) {  // a snip of the same stroke
    CutUndo& whole = undo.back();
    for (std::string& name : cut)
      if (!contains(whole.pieces, name) && !contains(whole.cut, name)) whole.cut.push_back(std::move(name));
    whole.pieces.insert(whole.pieces.end(), pieces.begin(), pieces.end());
    return;
  }
  before.cut = std::move(cut);
  before.pieces = std::move(pieces);
  undo.push_back(std::move(before));
  if (undo.size() > kMostUndone) undo.erase(undo.begin());
}

Result<Reply> World::Impl::apply(const UndoCutCommand&) {
  if (undo.empty())
    return Error{ErrorCode::kMissed, "there is no cut to undo; " + std::to_string(kMostUndone) +
                                         " are remembered, of the time since the start or the last reset"};
  if (!instruments.empty())
    for (const CutUndo::Body& was : undo.back().bodies) {
      const bool comes = contains(undo.back().cut, was.name) || find(was.name) != nullptr;
      BodyState then = was.state;
      updateSurface(*was.model, then);
      if (Status apart = comes ? liesApart(then.surface, *was.model, was.name) : Status(Done{}); !apart)
        return apart.error();
    }
  CutUndo before = std::move(undo.back());
  for (Instrument& instrument : instruments) instrument.wounds.clear();  // they may be no more
  undo.pop_back();

  // What the cut made, and what it opened without parting it, goes.
  std::vector<BodyId> gone;
  for (const auto& body : bodies)
    if (contains(before.pieces, body->name) || contains(before.cut, body->name)) gone.push_back(body->id);
  for (const BodyId& id : gone) {
    wake(*find(id));
    retire(id);
  }

  // The picks of a body, as they are and as they were.
  const auto holdsAsThen = [&](const WorldBody& body) {
    std::vector<std::pair<PickId, Vec3>> now, then;
    for (const Pick& pick : picks)
      if (pick.body == body.id) now.emplace_back(pick.id, pick.target);
    for (std::size_t i = 0; i < before.picks.size(); ++i)
      if (before.pick_bodies[i] == body.name) then.emplace_back(before.picks[i].id, before.picks[i].target);
    return now == then;
  };
  std::size_t place = 0;  // in the order of bodies
  for (CutUndo::Body& was : before.bodies) {
    if (contains(before.cut, was.name)) {
      WorldBody& body = admit(was.name, std::move(was.material), std::move(was.model), std::move(was.state));
      body.root = std::move(was.root);
      body.number = was.number;  // the same body as before, not a new one
      body.surface_current = was.surface_current;
      std::rotate(bodies.begin() + static_cast<std::ptrdiff_t>(place), bodies.end() - 1, bodies.end());
      ++place;
    } else if (WorldBody* body = find(was.name)) {  // removed since: stays so
      // The others too are where they were: tissue that has moved into the gap would be inside of what comes back. Who
      // slept all the while, does so on.
      const bool slept = body->asleep && body->state.positions == was.state.positions;
      if ((!slept || !holdsAsThen(*body)) && body->state.positions.size() == was.state.positions.size()) {
        body->state = std::move(was.state);
        fitPoses(*body->model, body->state);  // of the material that it has now
        body->surface_current = was.surface_current;
        surface_contacts.forget(body->number);  // what pressed then is not what presses now
        wake(*body);
      }
      ++place;
    }
  }

  contacts_current = false;
  forgetForces([this](const AppliedForce::Point& point) { return !find(point.body); });

  picks.clear();
  for (std::size_t i = 0; i < before.picks.size(); ++i) {
    const WorldBody* body = find(before.pick_bodies[i]);
    if (!body) continue;
    picks.push_back(before.picks[i]);
    picks.back().body = body->id;
  }
  // Of jaws that have let go since.
  picks.erase(std::remove_if(picks.begin(), picks.end(),
                             [this](const Pick& pick) {
                               return pick.latch && std::none_of(instruments.begin(), instruments.end(),
                                                                 [&](const Instrument& of) { return of.latched == pick.id; });
                             }),
              picks.end());
  // Bodies that the cut has made anew have other ids; those that were removed since stay so.
  std::map<BodyId, BodyId> now;
  for (const CutUndo::Body& was : before.bodies)
    if (const WorldBody* body = find(was.name)) now[was.id] = body->id;
  attachments = std::move(before.attachments);
  for (Attachment& attachment : attachments) {
    std::vector<Fibre> left;
    for (Fibre& fibre : attachment.fibres) {
      const bool joins = fibre.b != BodyId();
      if (!now.count(fibre.a) || (joins && !now.count(fibre.b))) continue;
      fibre.a = now[fibre.a];
      if (joins) fibre.b = now[fibre.b];
      left.push_back(std::move(fibre));
    }
    attachment.fibres = std::move(left);
  }
  if (before.cut.empty()) say(EventType::kUndone, "", 0, "as before the cut");
  for (const std::string& name : before.cut) say(EventType::kUndone, name, 0, "as before the cut");
  return Reply(UndoCutReply{before.cut});
}

}  // namespace meshless
