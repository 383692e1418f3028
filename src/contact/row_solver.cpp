#include "meshless_surgery/contact/row_solver.h"

#include <algorithm>

namespace meshless {
namespace {

constexpr int kMostSweeps = 8;
constexpr double kOutShare = 0.2;  // of old overlap, a frame
constexpr double kOutSpeed = 8.0;  // [mean edges/s] at most
constexpr int kOutSweeps = 4;
constexpr double kSlop = 2e-3;  // mean edges that nobody is let out of

class Solver {
 public:
  Solver(const RowSet& set, std::vector<SolverBody>& bodies, SolverScratch& scratch)
      : set_(set), bodies_(bodies), scratch_(scratch) {
    scratch_.active.clear();
    scratch_.levers.clear();
  }

  using Active = SolverScratch::Active;
  using Lever = SolverScratch::Lever;

  /// From here on: what answers in part as rigid bodies does so altogether.
  void moveAsWhole(bool whole) { whole_ = whole; }

  Vec3 sumAt(const ContactRow& row, bool before) const {
    Vec3 sum = sideSum(row.begin, row.middle, row.a, before);
    if (row.b != kNoIndex) sum += sideSum(row.middle, row.end, row.b, before);
    return sum;
  }

  /// With what groups have moved.
  Vec3 sumNow(const ContactRow& row, const Active& a) const {
    Vec3 sum = sumAt(row, false);
    for (Index k = a.levers; k < a.end; ++k) {
      const Lever& lever = scratch_.levers[k];
      const GroupMotion& motion = bodies_[k < a.middle ? row.a : row.b].motions[lever.group];
      sum += lever.share * motion.shift + motion.turn.cross(lever.arm);
    }
    return sum;
  }

  Active activate(Index which) {
    const ContactRow& row = set_.rows[which];
    Active a;
    a.row = which;
    a.start = sumAt(row, true);
    a.before = row.normal.dot(a.start) + row.constant;
    a.levers = static_cast<Index>(scratch_.levers.size());
    addLevers(row.begin, row.middle, row.a);
    a.middle = static_cast<Index>(scratch_.levers.size());
    if (row.b != kNoIndex) addLevers(row.middle, row.end, row.b);
    a.end = static_cast<Index>(scratch_.levers.size());
    a.answer = 0.0;
    for (Index k = row.begin; k < row.end; ++k)
      if (answersBy(k < row.middle ? row.a : row.b)) a.answer += set_.entries[k].coefficient * set_.entries[k].response;
    a.sideways = a.answer;
    for (Index k = a.levers; k < a.end; ++k) {
      const Lever& lever = scratch_.levers[k];
      const SolverBody& body = bodies_[k < a.middle ? row.a : row.b];
      const GroupMotion& motion = body.motions[lever.group];
      const double rigid = shareOf(body), straight = rigid * lever.share * lever.share * motion.inverse_mass;
      const Vec3 about = lever.arm.cross(row.normal);
      a.answer += straight + rigid * about.dot(motion.inverse_inertia * about);
      // Of all directions together: none across answers more.
      a.sideways += straight + rigid * lever.arm.squaredNorm() * motion.inverse_inertia.trace();
    }
    return a;
  }

  void push(const ContactRow& row, const Active& a, const Vec3& impulse) {
    pushSide(row.begin, row.middle, row.a, impulse);
    if (row.b != kNoIndex) pushSide(row.middle, row.end, row.b, impulse);
    for (Index k = a.levers; k < a.end; ++k) {
      const Lever& lever = scratch_.levers[k];
      SolverBody& body = bodies_[k < a.middle ? row.a : row.b];
      GroupMotion& motion = body.motions[lever.group];
      motion.shift += shareOf(body) * lever.share * motion.inverse_mass * impulse;
      motion.turn += shareOf(body) * (motion.inverse_inertia * lever.arm.cross(impulse));
    }
  }

  /// What groups have been moved by goes to their particles.
  void moveGroups(const ContactRow& row) {
    moveGroups(bodies_[row.a]);
    if (row.b != kNoIndex) moveGroups(bodies_[row.b]);
  }

 private:
  Vec3 sideSum(Index begin, Index end, Index body, bool before) const {
    const Vec3* const at = before ? bodies_[body].previous : bodies_[body].positions;
    double x = 0.0, y = 0.0, z = 0.0;
    for (Index k = begin; k < end; ++k) {
      const RowEntry& entry = set_.entries[k];
      const double* p = at[entry.particle].data();
      x += entry.coefficient * p[0];
      y += entry.coefficient * p[1];
      z += entry.coefficient * p[2];
    }
    return {x, y, z};
  }

  double shareOf(const SolverBody& body) const { return whole_ && body.rigid_share > 0.0 ? 1.0 : body.rigid_share; }
  /// By its particles one by one.
  bool answersBy(Index body) const { return !whole_ || !(bodies_[body].rigid_share > 0.0); }

  void pushSide(Index begin, Index end, Index body, const Vec3& impulse) {
    if (!answersBy(body)) return;
    Vec3* const at = bodies_[body].positions;
    for (Index k = begin; k < end; ++k) {
      const RowEntry& entry = set_.entries[k];
      if (entry.response != 0.0) at[entry.particle] += entry.response * impulse;
    }
  }

  void addLevers(Index begin, Index end, Index number) {
    SolverBody& body = bodies_[number];
    if (!(body.rigid_share > 0.0)) return;
    const RigidGroups& groups = *body.groups;
    const std::size_t first = scratch_.levers.size();
    for (Index k = begin; k < end; ++k) {
      const RowEntry& entry = set_.entries[k];
      for (Index n = groups.of_offsets[entry.particle]; n < groups.of_offsets[entry.particle + 1]; ++n) {
        const Index group = groups.of_groups[n];
        GroupMotion& motion = body.motions[group];
        if (!motion.current) motion = groupAt(groups, group, body.previous);
        std::size_t at = first;
        while (at < scratch_.levers.size() && scratch_.levers[at].group != group) ++at;
        if (at == scratch_.levers.size()) scratch_.levers.push_back({group, 0.0, Vec3::Zero()});
        const double share = groups.of_weights[n] * entry.coefficient;
        scratch_.levers[at].share += share;
        scratch_.levers[at].arm += share * (body.previous[entry.particle] - motion.centre);
      }
    }
  }

  void moveGroups(SolverBody& body) {
    if (!(body.rigid_share > 0.0)) return;
    for (Index g = 0; g < body.motions.size(); ++g) {
      GroupMotion& motion = body.motions[g];
      if (!motion.current) continue;
      motion.current = false;
      for (Index k = body.groups->offsets[g]; k < body.groups->offsets[g + 1]; ++k) {
        const Index i = body.groups->members[k];
        body.positions[i] +=
            body.groups->weights[k] * (motion.shift + motion.turn.cross(body.previous[i] - motion.centre));
      }
    }
  }

  const RowSet& set_;
  std::vector<SolverBody>& bodies_;
  SolverScratch& scratch_;
  bool whole_ = false;
};

void pull(SpringRow& spring, double h) {
  const std::vector<Index>& patch = *spring.patch;
  const std::vector<double>& weights = *spring.weights;
  Vec3 stretch = spring.end;
  double answer = 0.0;
  for (std::size_t k = 0; k < patch.size(); ++k) {
    stretch -= weights[k] * spring.positions[patch[k]];
    answer += weights[k] * weights[k] * spring.inverse_masses[k];
  }
  const double stiff = spring.stiffness * h * h;
  const Vec3 more = (stiff * stretch - spring.impulse) / (1.0 + stiff * answer);
  spring.impulse += more;
  for (std::size_t k = 0; k < patch.size(); ++k)
    spring.positions[patch[k]] += weights[k] * spring.inverse_masses[k] * more;
}

// Rows act at both ends of what is between them: across it an impulse is a couple. Bodies get it back as a spin.
void spinBack(SolverBody& body) {
  if (body.leaked.isZero(0.0)) return;
  double mass = 0.0;
  Vec3 sum = Vec3::Zero();
  Mat3 moment = Mat3::Zero();
  const Vec3& origin = body.previous[0];
  for (Index i = 0; i < body.particles; ++i) {
    const double m = 1.0 / body.inverse_masses[i];
    const Vec3 arm = body.previous[i] - origin;
    mass += m;
    sum += m * arm;
    moment += m * arm * arm.transpose();
  }
  const Vec3 mean = sum / mass;
  moment -= mass * mean * mean.transpose();
  const Vec3 turn = inverseInertia(moment.trace() * Mat3::Identity() - moment) * -body.leaked;
  for (Index i = 0; i < body.particles; ++i) body.positions[i] += turn.cross(body.previous[i] - origin - mean);
  body.leaked.setZero();
}

}  // namespace

void solveRows(RowSet& set, const Index* order, std::size_t count, std::vector<SpringRow>& springs,
               std::vector<SolverBody>& bodies, const SolverStep& step, bool free, SolverScratch& scratch,
               SolverCounters& counters) {
  Solver solver(set, bodies, scratch);
  using Active = SolverScratch::Active;
  for (std::size_t n = 0; n < count; ++n) {
    ContactRow& row = set.rows[order[n]];
    Vec3 way = Vec3::Zero();
    if (row.kind == FeaturePair::Kind::kSphere) {  // its tangent plane goes along and turns
      way = step.sphere_to - step.sphere_from;
      const Vec3 from = solver.sumAt(row, true) - step.sphere_from;
      const double distance = from.norm();
      if (distance > 0.0) row.normal = from / distance;
      row.constant = -row.normal.dot(step.sphere_to) - step.sphere_radius;
    }
    if (row.impulse.isZero(0.0) && row.normal.dot(solver.sumAt(row, false)) + row.constant > 0.0) continue;
    Active a = solver.activate(order[n]);
    a.before += row.normal.dot(way);
    a.start += way;  // friction is about the motion relative to what moves
    if (!(a.answer > 0.0)) continue;
    scratch.active.push_back(a);
  }
  counters.active += scratch.active.size();
  for (const Active& a : scratch.active) {
    ContactRow& row = set.rows[a.row];
    // The last impulse, as far as it presses along the new normal.
    if (row.bounce > 0.0 || !(row.normal.dot(row.impulse) > 0.0))
      row.impulse.setZero();
    else
      row.impulse *= step.warm;
    if (!row.impulse.isZero(0.0)) solver.push(row, a, row.impulse);
  }
  double worst = 0.0;  // [m] correction of a row in a sweep
  const auto visit = [&](const Active& a) {
    ContactRow& row = set.rows[a.row];
    const Vec3 now = solver.sumNow(row, a);
    const double gap = row.normal.dot(now) + row.constant;
    // Who was inside comes no deeper; out goes letOut(), without a velocity.
    const double target = (row.bounce > 0.0 ? a.before : std::min(0.0, a.before)) + row.bounce * step.h;
    const double pressed = row.normal.dot(row.impulse);
    const double press = std::max(0.0, pressed + (target - gap) / a.answer);
    Vec3 slid = now - a.start;
    slid -= row.normal.dot(slid) * row.normal;
    Vec3 across = row.impulse - pressed * row.normal - slid / a.sideways;
    const double most = row.friction * press, length = across.norm();
    if (length > most) across *= most / length;
    const Vec3 impulse = press * row.normal + across;
    const Vec3 more = impulse - row.impulse;
    row.impulse = impulse;
    worst = std::max(worst, std::abs(press - pressed) * a.answer);
    if (!more.isZero(0.0)) solver.push(row, a, more);
  };
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    worst = 0.0;
    for (std::size_t n = 0; n < scratch.active.size(); ++n)
      visit(scratch.active[sweep % 2 ? scratch.active.size() - 1 - n : n]);
    for (SpringRow& spring : springs) pull(spring, step.h);
    counters.visits += scratch.active.size();
    if (sweep > 0 && !(worst > step.tolerance)) break;
  }
  for (const Active& a : scratch.active) solver.moveGroups(set.rows[a.row]);
  if (!free) return;
  for (const Active& a : scratch.active) {
    const ContactRow& row = set.rows[a.row];
    const Vec3 couple = a.start.cross(row.impulse);
    bodies[row.a].leaked += 0.5 * couple;
    bodies[row.b == kNoIndex ? row.a : row.b].leaked += 0.5 * couple;
  }
  for (const Active& a : scratch.active) {
    spinBack(bodies[set.rows[a.row].a]);
    if (set.rows[a.row].b != kNoIndex) spinBack(bodies[set.rows[a.row].b]);
  }
}

std::size_t letOut(const RowSet& set, const Index* order, std::size_t count, const std::vector<double>& lengths,
                   double h, std::vector<SolverBody>& bodies, SolverScratch& scratch) {
  Solver solver(set, bodies, scratch);
  for (std::size_t n = 0; n < count; ++n) {
    const ContactRow& row = set.rows[order[n]];
    if (!(row.gap < -kSlop * lengths[row.a])) continue;
    solver.moveAsWhole(row.a != row.b);  // bent into place they would spring back
    if (const auto a = solver.activate(order[n]); a.answer > 0.0) scratch.active.push_back(a);
  }
  for (int sweep = 0; sweep < kOutSweeps; ++sweep)
    for (std::size_t n = 0; n < scratch.active.size(); ++n) {
      const auto& a = scratch.active[sweep % 2 ? scratch.active.size() - 1 - n : n];
      const ContactRow& row = set.rows[a.row];
      // What lies in another comes out slowly, what only touches has its skin at once.
      const double share = row.gap + row.skin < -kSlop * lengths[row.a] ? kOutShare : 1.0;
      const double wanted = row.gap + std::min(share * -row.gap, kOutSpeed * lengths[row.a] * h);
      const double gap = row.normal.dot(solver.sumNow(row, a)) + row.constant;
      solver.moveAsWhole(row.a != row.b);
      if (gap < wanted) solver.push(row, a, (wanted - gap) / a.answer * row.normal);
    }
  for (const auto& a : scratch.active) solver.moveGroups(set.rows[a.row]);
  return scratch.active.size();
}

}  // namespace meshless
