// Blades of instruments in the world: what scissors close on and what the edge of a scalpel goes through opens.
#include <algorithm>
#include <cmath>

#include "line_search.h"
#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kSnip = 0.125;     // of blades: they have closed on so much more before it is cut, or close no further
constexpr double kJoins = 3e-4;     // [m] by which a snip goes over the last one, and beyond tissue
constexpr double kStands = 2e-3;    // [m/s] an edge that is slower cuts at once
constexpr double kRests = 1e-6;     // [m/s] slower blades stand
constexpr double kGoesOn = 0.8;     // cosine: blades turned less go on with the wound of an earlier stroke
constexpr double kJustAhead = 0.1;  // of the way between two: the first line of an edge, ahead of what it has cut
constexpr int kMostLines = 100;
constexpr int kLines = 5;  // along a snip, on which its tissue is looked for

/// Tissue on a line across blades, that lies between their edges.
struct BetweenBlades {
  double low = 0.0, high = 0.0;  // [m] along the line, from the middle of the blades
  Points rest;                   // [m] where the line goes in and out, in pairs
  double thickness = 0.0;        // [m] at rest
  Vec3 middle = Vec3::Zero();    // [m] likewise
};

BetweenBlades between(const std::vector<Crossing>& met, double gap, const ContactSurface& surface) {
  BetweenBlades found;
  const auto atRest = [&](const NearestFace& face) {
    Vec3 sum = Vec3::Zero();
    for (int k = 0; k < 3; ++k) sum += face.shares[k] * surface.rest[surface.triangles[face.face][k]];
    return sum;
  };
  for (std::size_t n = 0; n + 1 < met.size(); ++n) {
    if (!met[n].in || met[n + 1].in || met[n].at > gap || met[n + 1].at < -gap) continue;
    const Vec3 from = atRest(met[n].face), to = atRest(met[n + 1].face);
    found.low = std::min(found.low, met[n].at);
    found.high = std::max(found.high, met[n + 1].at);
    found.rest.insert(found.rest.end(), {from, to});
    found.thickness += (to - from).norm();
    found.middle += 0.5 * (to - from).norm() * (from + to);
  }
  if (found.thickness > 0.0) found.middle /= found.thickness;
  return found;
}

BladeWound* woundOf(Instrument& instrument, const std::string& body) {
  for (BladeWound& wound : instrument.wounds)
    if (wound.body == body) return &wound;
  return nullptr;
}

}  // namespace

void World::Impl::cutByInstruments() {
  for (std::size_t n = 0; n < instruments.size(); ++n) {
    Instrument& instrument = instruments[n];
    const InstrumentDef& def = instrument.def;
    if (def.type == InstrumentType::kScalpel) cutByEdge(n);
    if (def.type != InstrumentType::kScissors) continue;
    instrument.resists = 0.0;
    const double length = def.jaw_length, cuts_to = instrument.cutsTo();
    if (cuts_to < instrument.cut_to) {  // they open
      if (cuts_to < instrument.cut_to - kJoins) ++instrument.stroke;
      instrument.cut_to = cuts_to;
      instrument.cut_work = instrument.owed = 0.0;
    }
    const double more = cuts_to - instrument.cut_to;
    const bool whole = cuts_to == length, stops = !(instrument.jaw_rate < -kRests / length);
    const bool snips = more > 0.0 && (more >= kSnip * length || whole || (stops && more >= kJoins));
    const bool presses = !whole && instrument.jaw_target < instrument.jaw - kRests;
    if (!snips && !presses) continue;
    std::vector<std::string> near;
    const Box blades = boundsOf(instrument_bodies[n]->positions);
    for (const auto& body : bodies) {
      if (!body->model->solid || (!snips && body->material.toughness == 0.0)) continue;
      refreshSurface(*body);
      if (boundsOf(body->state.surface).overlaps(blades)) near.push_back(body->name);
    }
    bool any = false;
    for (const std::string& name : near) any = snip(n, *find(name), cuts_to, snips) || any;
    if (snips && (any || whole)) {  // else there was air so far
      instrument.cut_to = cuts_to;
      instrument.owed -= std::exchange(instrument.cut_work, 0.0);
    }
    if (instrument.resists > 0.0)
      instrument.resists = std::max(0.0, instrument.resists + instrument.owed / (kSnip * length));
  }
}

bool World::Impl::snip(std::size_t n, WorldBody& body, double cuts_to, bool snips) {
  Instrument& instrument = instruments[n];
  const InstrumentDef& def = instrument.def;
  // Lines across the blades, in the plane on which they slide along each other.
  const Mat3 axes = instrument.pose.rotation.toRotationMatrix();
  const LineFrame frame{instrument.pose * instrument_bodies[n]->shape->hinge, {axes.col(0), -axes.col(2), axes.col(1)}};
  const ShownSurface shown = shownNow(body);
  LineSearch lines(shown, frame, def.jaw_length + kJoins, 0.0);
  const double slope = std::tan(0.5 * instrument.jaw);
  const auto at = [&](double x) {
    const double gap = std::max(slope * x - def.bladeOverlap(), 0.4 * def.jaw_thickness);
    return between(lines.through(x, 0.0), gap, *shown.surface);
  };
  const BladeWound* const known = woundOf(instrument, body.name);
  if (cuts_to < def.jaw_length && body.material.toughness > 0.0) {
    // The area at rest that comes in this frame, for the way there.
    Instrument then = instrument;
    then.jaw += std::min(0.0, instrument.jaw_rate / settings.step_rate);
    const double way = std::max(then.cutsTo() - cuts_to, kJoins), part = way / kLines;
    const auto uncut = [&](double x) {
      BetweenBlades tissue = at(x);
      if (known && known->has(tissue.middle)) tissue.thickness = 0.0;
      return tissue;
    };
    double area = 0.0;
    BetweenBlades last = uncut(cuts_to);
    for (int k = 1; k <= kLines; ++k) {
      const BetweenBlades next = uncut(cuts_to + k * part);
      const bool both = last.thickness > 0.0 && next.thickness > 0.0;
      area += 0.5 * (last.thickness + next.thickness) * (both ? (next.middle - last.middle).norm() : part);
      last = next;
    }
    instrument.resists += body.material.toughness * area / way;
  }
  if (!snips) return false;
  const double begins = instrument.cut_to, more = cuts_to - begins, thickness = def.jaw_thickness;
  const double apart = 0.25 * std::min(body.edge_length, thickness);
  const int count = std::clamp(static_cast<int>(std::ceil(more / apart)), kLines, kMostLines);
  double low = 0.0, high = 0.0;  // [m]
  Points met;
  for (int k = 0; k < count; ++k) {
    const BetweenBlades tissue = at(begins + more * k / (count - 1));
    low = std::min(low, tissue.low);
    high = std::max(high, tissue.high);
    met.insert(met.end(), tissue.rest.begin(), tissue.rest.end());
  }
  InciseCommand command;
  command.bodies = {body.name};
  command.blade = {frame.centre + begins * axes.col(0), axes.col(0), axes.col(1), more, kJoins, kJoins, 0.0};
  const double margin = 2.0 * apart + kJoins;  // tissue is squeezed between two lines
  const bool same_stroke = known && known->stroke == instrument.stroke;
  const bool ends = at(cuts_to + kJoins).rest.empty();  // tissue does
  if (met.empty()) {
    // Blades that are through leave no thread between two lines, or beside them.
    if (!same_stroke || !ends) return false;
    BladeWound whole = *known;
    --whole.stroke;  // once
    whole.least -= Vec2::Constant(margin);
    whole.most += Vec2::Constant(margin);
    return cutWound(n, body, whole, whole.least, whole.most, command);
  }
  command.blade.depth -= low;
  command.blade.rise += high;
  // A wound is gone on with where what is between the blades is within their thickness of its plane, and at it; that of
  // an earlier stroke, where the blades are in its plane too.
  const auto extend = [&](const BladeWound& of, Vec2& least, Vec2& most) {
    least.setConstant(std::numeric_limits<double>::infinity());
    most = -least;
    double farthest = 0.0;
    for (std::size_t k = 0; k + 1 < met.size(); k += 2) {
      const double beside = std::abs(of.beside(0.5 * (met[k] + met[k + 1])));
      if (beside > def.jaw_width) continue;  // another layer of folded tissue is elsewhere at rest
      farthest = std::max(farthest, beside);
      for (const Vec3& p : {met[k], met[k + 1]}) {
        least = least.cwiseMin(of.within(p));
        most = most.cwiseMax(of.within(p));
      }
    }
    return least.x() <= most.x() && farthest <= thickness;
  };
  Vec2 least, most;
  std::optional<Blade> led;  // to a plane at rest
  if (!same_stroke) led = bladeAtRest(*body.model, body.state, command.blade);
  const auto turned = [&] { return std::abs(known->x_axis.cross(known->y_axis).dot(led->plane().normal)); };
  bool goes_on = known && (same_stroke || (led && turned() > kGoesOn)) && extend(*known, least, most);
  if (goes_on) {
    const double near = kSnip * def.jaw_length;
    goes_on = least.x() < known->most.x() + near && most.x() > known->least.x() - near &&
              least.y() < known->most.y() + near && most.y() > known->least.y() - near;
  }
  BladeWound wound;
  bool along = true;  // the wound grows along its x axis
  if (goes_on) {
    wound = *known;
    along = most.x() - wound.most.x() >= wound.least.x() - least.x();
  } else {
    if (same_stroke) led = bladeAtRest(*body.model, body.state, command.blade);
    if (!led) return true;
    wound = {body.name, led->origin, led->x_axis, led->y_axis, Vec2::Zero(), Vec2::Zero(), 0};
    extend(wound, least, most);
  }
  if (!(least.x() <= most.x())) return true;
  Vec2 from = least - Vec2::Constant(margin), to = most + Vec2::Constant(margin);
  if (!ends) (along ? to : from).x() = along ? most.x() : least.x();
  if (goes_on && ends) {  // as a whole: it may part the body now
    from = from.cwiseMin(wound.least);
    to = to.cwiseMax(wound.most);
  } else if (goes_on) {  // from where it ends
    if (along)
      from.x() = least.x() < wound.least.x() ? from.x() : std::min(wound.most.x(), least.x());
    else
      to.x() = most.x() > wound.most.x() ? to.x() : std::max(wound.least.x(), most.x());
  }
  wound.least = goes_on ? Vec2(wound.least.cwiseMin(from)) : from;
  wound.most = goes_on ? Vec2(wound.most.cwiseMax(to)) : to;
  wound.stroke = instrument.stroke;
  return cutWound(n, body, wound, from, to, command);
}

void World::Impl::cutByEdge(std::size_t n) {
  Instrument& instrument = instruments[n];
  const InstrumentDef& def = instrument.def;
  const Vec3 heel = def.heel();
  instrument.resists = 0.0;
  const double way = std::max((instrument.pose * heel - instrument.edge_at * heel).norm(),
                              (instrument.pose.translation - instrument.edge_at.translation).norm());
  bool cuts = way >= kSnip * def.jaw_length || (way >= kJoins && instrument.velocity.norm() <= kStands);
  if (way == 0.0 && !instrument.in_tissue) return;
  Box swept;
  for (const Pose& at : {instrument.edge_at, instrument.pose})
    for (const Vec3& end : {heel, Vec3(Vec3::Zero())}) swept.extend(at * end);
  swept.min -= Vec3::Constant(kJoins);
  swept.max += Vec3::Constant(kJoins);
  std::vector<std::string> near;
  for (const auto& body : bodies) {
    if (!body->model->solid) continue;
    refreshSurface(*body);
    if (boundsOf(body->state.surface).overlaps(swept)) near.push_back(body->name);
  }
  bool inside = false, leaves = false;
  for (const std::string& name : near) {
    const EdgeIs is = sweepEdge(n, *find(name), cuts);
    inside = inside || is == EdgeIs::kInside;
    leaves = leaves || is == EdgeIs::kLeaving;
  }
  if (leaves && !cuts) {  // what it has swept so far
    cuts = true;
    instrument.resists = 0.0;
    for (const std::string& name : near) sweepEdge(n, *find(name), cuts);
  }
  if (cuts || !inside) {
    instrument.edge_at = instrument.pose;
    instrument.owed -= std::exchange(instrument.cut_work, 0.0);
  }
  if (std::exchange(instrument.in_tissue, inside) && !inside) {
    ++instrument.stroke;
    instrument.owed = 0.0;
  }
  if (instrument.resists > 0.0)
    instrument.resists = std::max(0.0, instrument.resists + instrument.owed / (kSnip * def.jaw_length));
}

World::Impl::EdgeIs World::Impl::sweepEdge(std::size_t n, WorldBody& body, bool cuts) {
  Instrument& instrument = instruments[n];
  const InstrumentDef& def = instrument.def;
  const Vec3 heel = instrument.pose * def.heel(), heel_goes = heel - instrument.edge_at * def.heel();
  const Vec3 tip_goes = instrument.pose.translation - instrument.edge_at.translation;
  const double length = def.heel().norm(), way = std::max(heel_goes.norm(), tip_goes.norm());
  const Vec3 along = (instrument.pose.translation - heel) / length, ahead = instrument.pose.rotation * def.ahead();
  const LineFrame frame{heel, {ahead, along.cross(ahead), along}};
  const ShownSurface shown = shownNow(body);
  LineSearch lines(shown, frame, way + kJoins, way + kJoins);
  // What is around the edge is at rest where the affine map that fits it best leads it.
  const Blade blade{instrument.pose.translation, ahead, -along, kJoins, kJoins, length, way};
  const std::optional<Blade> led = bladeAtRest(*body.model, body.state, blade);
  if (!led) return EdgeIs::kOutside;
  const Vec3 down = -led->rise / blade.rise * led->y_axis;  // at rest, for one metre along the edge
  const double apart = 0.25 * std::min(body.edge_length, def.jaw_thickness),
               margin = std::max(apart, 0.25 * body.model->spacing) + kJoins;
  const auto atRest = [&](const Crossing& crossing, double at) {
    Vec3 sum = (at - crossing.at) * down;
    for (int k = 0; k < 3; ++k)
      sum += crossing.face.shares[k] * shown.surface->rest[shown.surface->triangles[crossing.face.face][k]];
    return sum;
  };
  const auto outOf = [&](const Crossing& crossing) {
    if (shown.surface->cut_faces[crossing.face.face]) return Vec3(Vec3::Zero());  // into a wound
    const Triangle& t = shown.surface->triangles[crossing.face.face];
    const Points& rest = shown.surface->rest;
    return Vec3(margin * (rest[t[1]] - rest[t[0]]).cross(rest[t[2]] - rest[t[0]]).normalized());
  };
  struct Ends {
    Vec3 from, to;      // [m] at rest
    Vec3 beyond, past;  // [m] likewise: out of tissue, where that ends there
  };
  /// Tissue on the edge, moved by `by`.
  const auto on = [&](const Vec3& by) {
    std::vector<Ends> found;
    const Vec3 at = frame.of(heel + by);
    const std::vector<Crossing>& met = lines.through(at.x(), at.y());
    for (std::size_t k = 0; k + 1 < met.size(); ++k) {
      const double from = std::max(met[k].at, at.z()), to = std::min(met[k + 1].at, at.z() + length);
      if (!met[k].in || met[k + 1].in || !(from < to)) continue;
      const auto nearer = [&](double z) -> const Crossing& {
        return std::abs(z - met[k].at) < std::abs(z - met[k + 1].at) ? met[k] : met[k + 1];
      };
      found.push_back({atRest(nearer(from), from), atRest(nearer(to), to),
                       from == met[k].at ? outOf(met[k]) : Vec3(Vec3::Zero()),
                       to == met[k + 1].at ? outOf(met[k + 1]) : Vec3(Vec3::Zero())});
    }
    return found;
  };
  const std::vector<Ends> next = on(kJoins * ahead);
  double thickness = 0.0;  // [m^2] at rest that opens in a metre ahead
  for (const Ends& ends : next) thickness += led->length / blade.length * (ends.to - ends.from).norm();
  const BladeWound* const known = woundOf(instrument, body.name);
  const bool goes_on = known && known->stroke == instrument.stroke;
  const EdgeIs is = !next.empty() ? EdgeIs::kInside : goes_on ? EdgeIs::kLeaving : EdgeIs::kOutside;
  instrument.resists += body.material.toughness / def.sharpness * thickness;
  if (!cuts) return is;

  const int count = std::clamp(static_cast<int>(std::ceil(way / apart)), kLines, kMostLines);
  Points met, deepest;         // [m]; deepest: one a line
  Vec3 middle = Vec3::Zero();  // [m] of the last line in tissue
  bool ends = true;            // tissue does
  bool through = false;        // the edge reaches out of it
  for (int k = 0; k <= count; ++k) {
    const double back = 1.0 - std::max<double>(k, kJustAhead) / count;
    const std::vector<Ends> line = on(-back * 0.5 * (heel_goes + tip_goes));
    ends = line.empty();
    if (ends) continue;
    middle.setZero();
    for (const Ends& part : line) {
      for (const Vec3& p : {part.from, Vec3(part.from + part.beyond), part.to, Vec3(part.to + part.past)})
        met.push_back(p);
      middle += 0.5 / static_cast<double>(line.size()) * (part.from + part.to);
    }
    deepest.push_back(line.back().to);
    through = through || !line.back().past.isZero(0.0);
  }
  InciseCommand command;
  command.bodies = {body.name};
  command.blade = blade;
  if (met.empty() && is == EdgeIs::kLeaving) {  // it leaves no thread before the surface
    BladeWound last = *known;
    --last.stroke;
    cutWound(n, body, last, Vec2(-margin, last.least.y()), Vec2(margin, last.most.y()), command);
  }
  if (met.empty() || !(ahead.dot(heel_goes + tip_goes) > 0.0)) return is;

  // In the plane of the stroke's last snip where that holds what the edge has swept; else in one on from its end.
  BladeWound wound{body.name, led->origin, led->x_axis, led->y_axis, Vec2::Zero(), Vec2::Zero(), instrument.stroke};
  bool turns = false;
  if (goes_on) {
    wound.origin = known->origin;
    const Vec3 normal = known->x_axis.cross(known->y_axis), goes = middle - known->origin;
    turns = std::any_of(met.begin(), met.end(), [&](const Vec3& p) { return std::abs(known->beside(p)) > kJoins; });
    if (!turns) wound.y_axis = (wound.y_axis - normal.dot(wound.y_axis) * normal).normalized();
    const Vec3 x_axis = turns ? Vec3(goes - wound.y_axis.dot(goes) * wound.y_axis) : wound.y_axis.cross(normal);
    wound.x_axis = x_axis.norm() > 0.0 ? x_axis.normalized() : wound.y_axis.unitOrthogonal();
  }
  Vec2 from = wound.within(met.front()), to = from;
  for (const Vec3& p : met) {
    from = from.cwiseMin(wound.within(p));
    to = to.cwiseMax(wound.within(p));
  }
  const double back = turns ? kJoins : margin;  // [m] over the last snip
  if (!through) {                               // what it opens is as deep as the edge was in the mean
    double sum = 0.0;
    for (const Vec3& p : deepest) sum += wound.within(p).y();
    from.y() = sum / static_cast<double>(deepest.size());
    // Nor deeper where it goes back over the last snip, and the tip came from above.
    const Vec2 tip_way = wound.within(deepest.back()) - wound.within(deepest.front());
    if (goes_on && tip_way.x() > kJoins && tip_way.y() < 0.0) from.y() -= tip_way.y() / tip_way.x() * back;
  }
  from.x() = (goes_on ? std::min(from.x(), 0.0) : from.x()) - back;
  if (ends || next.empty()) to.x() += margin;
  const Vec2 end = wound.within(middle);
  wound.origin += end.x() * wound.x_axis + end.y() * wound.y_axis;
  wound.least = from - end;
  wound.most = to - end;
  if (next.empty()) --wound.stroke;  // that is done
  cutWound(n, body, wound, wound.least, wound.most, command);
  return is;
}

bool World::Impl::cutWound(std::size_t n, WorldBody& body, BladeWound wound, const Vec2& from, const Vec2& to,
                           const InciseCommand& command) {
  Instrument& instrument = instruments[n];
  const Vec2 half = 0.5 * (to - from);
  const Vec3 origin = wound.origin + from.x() * wound.x_axis + (from.y() + half.y()) * wound.y_axis;
  const Blade blade = {origin, wound.x_axis, wound.y_axis, 2.0 * half.x(), half.y(), half.y(), 0.0};
  const std::size_t said = events.size();
  ++commands;  // each is another one
  const double toughness = body.material.toughness;
  stroke_of_cut = (std::uint64_t{instrument.number} + 1) << 32 | instrument.stroke;
  const Result<InciseReply> made = inciseNow(command, &blade);
  stroke_of_cut = 0;
  if (!made) {  // all of it is open; what is refused is made with the next
    BladeWound* const known = woundOf(instrument, wound.body);
    if (known && made.error().code == ErrorCode::kUnsuitableShape) *known = wound;
    return true;
  }
  instrument.owed += toughness / instrument.def.sharpness * made->opened_area;
  std::vector<BladeWound>& wounds = instrument.wounds;
  wounds.erase(std::remove_if(wounds.begin(), wounds.end(),
                              [&](const BladeWound& of) { return of.body == wound.body || !find(of.body); }),
               wounds.end());
  std::vector<std::string> names = made->new_bodies;  // pieces keep the frame of rest
  if (names.empty()) names = {wound.body};
  for (const std::string& name : names) {
    wound.body = name;
    if (wounds.size() < kMostWounds) wounds.push_back(wound);
  }
  for (std::size_t e = said; e < events.size(); ++e)
    if (events[e].type == EventType::kIncised) events[e].instrument = instrument.def.name;
  return true;
}

}  // namespace meshless
