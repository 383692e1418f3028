#include "meshless_surgery/contact/row_solver.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

namespace meshless {
namespace {

constexpr double kOutTime = 0.03;  // [s] in which an overlap falls to 1/e
constexpr double kOutSpeed = 0.5;  // [1/s] mean edges: overlap is removed no faster
constexpr int kSweeps = 4;         // at most; fewer kick aside what lands flat, and let it creep on a slope
constexpr double kSolved = 1e-4;   // of the largest impulse: a sweep that changes less is the last
constexpr double kThinnest = 1e-6;
constexpr double kLag = 0.01;   // [s] of a fibre, by which its stretch follows its tension: else what hangs bounces
constexpr double kSlop = 0.01;  // mean edges of overlap that stay: stacks that are lifted out of it sway

#pragma GCC diagnostic ignored "-Wpsabi"  // all of it is inlined
using Four = double __attribute__((vector_size(32), may_alias));

const Four& four(const Slot& slot) { return reinterpret_cast<const Four&>(slot); }
Four& four(Slot& slot) { return reinterpret_cast<Four&>(slot); }
Vec3 vec3(const Four& v) { return {v[0], v[1], v[2]}; }
Four four(const Vec3& v) { return Four{v[0], v[1], v[2], 0.0}; }

// In two halves, so that one need not wait for the other.
[[gnu::always_inline]] inline Four sumOf(const RowEntry* at, const RowEntry* end, const Slot* slots) {
  Four even{}, odd{};
  for (; at + 1 < end; at += 2) {
    even += at[0].coefficient * four(slots[at[0].particle]);
    odd += at[1].coefficient * four(slots[at[1].particle]);
  }
  if (at < end) even += at->coefficient * four(slots[at->particle]);
  return even + odd;
}

/// By how much points go with a body that is shifted [m] and turned [rad] about a centre [m].
struct RigidShift {
  Four centre, shift, turned[3];

  RigidShift(const Vec3& about, const Vec3& by, const Vec3& turn)
      : centre(four(about)),
        shift(four(by)),
        turned{four(turn.cross(Vec3::UnitX())), four(turn.cross(Vec3::UnitY())), four(turn.cross(Vec3::UnitZ()))} {}
  Four at(const Slot& slot) const {
    const Four arm = four(slot) - centre;
    return shift + arm[0] * turned[0] + arm[1] * turned[1] + arm[2] * turned[2];
  }
};

/// Mass, centre and inertia of points, added up about one of them.
struct MassMoments {
  Vec3 about;         // [m]
  double mass = 0.0;  // [kg]
  Four sum{};         // [kg m]
  Four moment[3]{};   // [kg m^2] columns

  void add(double of_mass, const Slot& slot) {
    const Four arm = four(slot) - four(about), weighed = of_mass * arm;
    mass += of_mass;
    sum += weighed;
    for (int k = 0; k < 3; ++k) moment[k] += arm[k] * weighed;
  }
  Vec3 centre() const { return about + vec3(sum) / mass; }
  /// Of the inertia about the centre; 0 about an axis with less than kThinnest of its trace: what lies in a line to a
  /// thousandth of its length would roll on its own rounding, and no friction held it.
  Mat3 inverseInertia() const {
    const Vec3 mean = vec3(sum) / mass;
    Mat3 spread = -mass * mean * mean.transpose();
    for (int k = 0; k < 3; ++k) spread.col(k) += vec3(moment[k]);
    const Mat3 inertia = spread.trace() * Mat3::Identity() - spread;
    const double scale = inertia.trace();
    if (!(scale > 0.0)) return Mat3::Zero();
    if (inertia.determinant() > kThinnest * scale * scale * scale) return inertia.inverse();
    const Eigen::SelfAdjointEigenSolver<Mat3> solver(inertia / scale);
    Mat3 inverse = Mat3::Zero();
    for (int k = 0; k < 3; ++k)
      if (solver.eigenvalues()[k] > kThinnest)
        inverse +=
            solver.eigenvectors().col(k) * solver.eigenvectors().col(k).transpose() / (solver.eigenvalues()[k] * scale);
    return inverse;
  }
};

class Solver {
 public:
  using Active = SolverScratch::Active;
  using Lever = SolverScratch::Lever;

  Solver(std::vector<SolverBody>& bodies, SolverScratch& scratch) : bodies_(bodies), scratch_(scratch) {
    scratch_.active.clear();
    scratch_.pulls.clear();
  }

  /// [m] of coefficient x, at the start of the substep or now.
  Vec3 sum(const Active& of, bool before) const {
    const SolverBody &a = bodies_[of.a], &b = bodies_[of.b];
    const RowEntry *const entries = of.entries, *const middle = entries + of.row->middle;
    return vec3(sumOf(entries + of.row->begin, middle, before ? a.before : a.now) +
                sumOf(middle, entries + of.row->end, before ? b.before : b.now));
  }

  /// [m] by what its bodies have moved as a whole.
  Vec3 moved(const Active& active) const {
    return moved(bodies_[active.a], active.on_a) + moved(bodies_[active.b], active.on_b);
  }

  /// Whether its bodies can answer a row.
  bool meet(Active& active) {
    const ContactRow& row = *active.row;
    const RowEntry* const entries = active.entries;
    double answer = 0.0, across = 0.0, farthest = 0.0;  // [1/kg]
    const auto leverOf = [&](SolverBody& body, Index begin, Index end) {
      const Lever lever = leverOn(body, [&](const auto& visit) {
        for (Index k = begin; k < end; ++k) visit(entries[k].particle, entries[k].coefficient);
      });
      double own = 0.0, most = 0.0;
      for (Index k = begin; k < end; ++k) {
        const double way = entries[k].coefficient * body.now[entries[k].particle].inverse_mass;
        own += entries[k].coefficient * way;
        most = std::max(most, std::abs(way));
      }
      own *= 1.0 - body.rigid_share;
      farthest = std::max(farthest, (1.0 - body.rigid_share) * most);
      const WholeMotion& whole = body.whole;
      const double straight = lever.share * lever.share * whole.inverse_mass;
      const Vec3 about = lever.arm.cross(row.normal);
      answer += own + straight + about.dot(whole.inverse_inertia * about);
      // Of all directions together: none across answers more.
      across += own + straight + lever.arm.squaredNorm() * whole.inverse_inertia.trace();
      return lever;
    };
    active.on_a = leverOf(bodies_[active.a], row.begin, row.middle);
    active.on_b = leverOf(bodies_[active.b], row.middle, row.end);
    active.mass = 1.0 / answer;
    active.sideways = 1.0 / across;
    return canAnswer(answer, farthest);
  }

  /// [m] by which a row gives way beyond what particles show. worth: [1/s^2] force over impulse.
  double givesWay(const SolverRows& rows, Index number, double worth) const {
    return rows.fine ? rows.fine->of(number, rows.set->rows, worth) : 0.0;
  }

  void activate(Active active, const Vec3& way, const SolverStep& step, double gives) {
    ContactRow& row = *active.row;
    active.start = sum(active, true) + way;  // friction is about the motion relative to what moves
    if (!meet(active)) {
      row.impulse.setZero();
      return;
    }
    const double gap = row.normal.dot(active.start) + row.constant;
    active.target = std::min(gap + gives, 0.0);
    active.worth = 1.0 / (step.h * step.h);
    const FineAnswer* const fine = active.rows->fine;
    active.given = fine ? active.worth * fine->entries[fine->offsets[active.number]].coefficient : 0.0;
    const double approach = gap - row.normal.dot(sum(active, false)) - row.constant;  // [m] in the substep
    if (row.restitution > 0.0 && approach > std::max(gap, step.h * step.slow))
      active.target = gap + row.restitution * approach;
    scratch_.active.push_back(active);
  }

  /// Takes a part of what overlaps away, at the start of the substep as at its end: that gives no speed. once: [s]
  /// since it was done last.
  void letOut(Active active, const Vec3& way, double once, double gives) {
    const ContactRow& row = *active.row;
    active.start = sum(active, true);
    const double edge = edgeOf(active);
    const double slop = active.rows->fine ? 0.0 : kSlop * edge;
    const double deep = -slop - row.normal.dot(active.start + way) - row.constant - gives;
    if (!(deep > 0.0) || !meet(active)) return;
    active.target = row.normal.dot(active.start) + row.constant + once * std::min(deep / kOutTime, kOutSpeed * edge);
    scratch_.active.push_back(active);
  }

  void letOut(const std::vector<SolverRows>& sets) {
    for (const Active& active : scratch_.active) {
      const ContactRow& row = *active.row;
      const double lacking = active.target - row.normal.dot(sum(active, true) + moved(active)) - row.constant;
      if (!(lacking > 0.0)) continue;
      const Vec3 more = active.mass * lacking * row.normal;
      push(active, more);
      pushParticles(active, more, &SolverBody::before);
    }
    moveWhole(sets, true);
    scratch_.active.clear();
  }

  void push(const Active& active, const Vec3& impulse) {
    pushParticles(active, impulse, &SolverBody::now);
    push(bodies_[active.a], active.on_a, impulse);
    push(bodies_[active.b], active.on_b, impulse);
  }

  /// The last impulses, as far as they press along the normal of now. Of rows of a body with itself what of them leaves
  /// the least energy: shreds in a tangle go many times as far as their rows are long, and sweeps would not take back
  /// what rows that come and go give them.
  void warmStart(double share) {
    for (const Active& active : scratch_.active) {
      ContactRow& row = *active.row;
      if (active.target > 0.0 || !(row.normal.dot(row.impulse) > 0.0))
        row.impulse.setZero();
      else
        row.impulse *= share;
    }
    const Active *const all = scratch_.active.data(), *const last = all + scratch_.active.size();
    for (const Active *begin = all, *end = all; begin != last; begin = end) {
      while (end != last && end->rows == begin->rows) ++end;
      warmStart(begin, end, begin->rows->a == begin->rows->b);
    }
  }

  void warmStart(const Active* begin, const Active* end, bool within) {
    const auto worked = [&] {  // [kg m^2]
      double sum = 0.0;
      for (const Active* active = begin; active != end; ++active)
        if (!active->row->impulse.isZero(0.0)) sum += active->row->impulse.dot(beyond(*active));
      return sum;
    };
    const auto give = [&](double share) {
      for (const Active* active = begin; active != end; ++active)
        if (!active->row->impulse.isZero(0.0)) push(*active, share * active->row->impulse);
    };
    const double before = within ? worked() : 0.0;
    give(1.0);
    const double after = within ? worked() : 0.0;
    if (!(after > 0.0)) return;
    // A share s of them gives h^-2 (s before + s^2 (after - before) / 2).
    const double best = std::max(0.0, -before / (after - before));
    give(best - 1.0);
    for (const Active* active = begin; active != end; ++active) active->row->impulse *= best;
  }

  /// [m] how far a row is from what it asks for: along the normal the target, across it the start.
  Vec3 beyond(const Active& active) const {
    const ContactRow& row = *active.row;
    const double from = row.normal.dot(active.start) + row.constant - active.target;
    return sum(active, false) + moved(active) - active.start + from * row.normal;
  }

  /// [kg^2 m^2] what is new of its impulse, squared.
  double visit(const Active& active) {
    ContactRow& row = *active.row;
    const Vec3 now = sum(active, false) + moved(active);
    const double gives = givesWay(*active.rows, active.number, active.worth);
    const double gap = row.normal.dot(now) + row.constant + gives, pressed = row.normal.dot(row.impulse);
    // Nobody who is not dragged goes farther than an edge in a substep: more than that is not asked for at once.
    const double lacking = std::min(active.target - gap, edgeOf(active));
    const bool more_given = active.given > 0.0 && gives < active.rows->fine->most;
    const double mass = more_given ? 1.0 / (1.0 / active.mass + active.given) : active.mass;
    const double press = std::max(0.0, pressed + mass * lacking);
    Vec3 impulse = Vec3::Zero();
    if (press > 0.0) {
      Vec3 slid = now - active.start;
      slid -= row.normal.dot(slid) * row.normal;
      Vec3 across = row.impulse - pressed * row.normal - active.sideways * slid;
      const double most = row.friction * press, squared = across.squaredNorm();
      if (squared > most * most) across *= most / std::sqrt(squared);
      impulse = press * row.normal + across;
    }
    const Vec3 more = impulse - row.impulse;
    row.impulse = impulse;
    if (!more.isZero(0.0)) push(active, more);
    return more.squaredNorm();
  }

  using Pull = SolverScratch::Pull;

  void activate(const SpringRow& spring) { addPull(spring.body, *spring.patch, *spring.weights); }

  void activate(FibreRow& fibre, const SolverStep& step) {
    const bool within = fibre.a == fibre.b;  // moves nothing as a whole
    addPull(fibre.a, fibre.at_a->particles, fibre.at_a->weights, !within);
    if (fibre.b != kNoIndex)
      addPull(fibre.b, fibre.at_b->particles, fibre.at_b->weights, !within);
    else
      scratch_.pulls.emplace_back();
    if (within) scratch_.pulls.back().answer -= 2.0 * sharedAnswer(fibre) * Mat3::Identity();
    // Kelvin and Voigt: tension = stiffness (stretch + lag * its rate), where it is taut.
    const double lags = kLag / step.h, before = std::max(fibre.rest, spanBefore(fibre).norm());
    fibre.stiff = fibre.stiffness * step.h * step.h * (1.0 + lags);
    fibre.from = (fibre.rest + lags * before) / (1.0 + lags);
    fibre.impulse *= step.warm;
    const std::size_t last = scratch_.pulls.size() - 1;
    if (!fibre.impulse.isZero(0.0)) push(fibre, &scratch_.pulls[last - 1], fibre.impulse);
  }

  /// [1/kg] by which one end of a fibre within a body goes with the other: of particles that both have.
  double sharedAnswer(const FibreRow& fibre) const {
    const SolverBody& body = bodies_[fibre.a];
    double shared = 0.0;
    const std::vector<Index>&a = fibre.at_a->particles, &b = fibre.at_b->particles;  // in their order
    for (std::size_t k = 0, n = 0; k < a.size() && n < b.size();) {
      if (a[k] == b[n]) shared += fibre.at_a->weights[k] * fibre.at_b->weights[n] * body.now[a[k]].inverse_mass;
      a[k] < b[n] ? ++k : ++n;
    }
    return (1.0 - body.rigid_share) * shared;
  }

  /// How a point answers an impulse: `rigidly` with its body as a whole, too.
  void addPull(Index of_body, const std::vector<Index>& patch, const std::vector<double>& weights,
               bool rigidly = true) {
    SolverBody& body = bodies_[of_body];
    Pull pull;
    if (rigidly)
      pull.lever = leverOn(body, [&](const auto& visit) {
        for (std::size_t k = 0; k < patch.size(); ++k) visit(patch[k], weights[k]);
      });
    double own = 0.0;
    for (std::size_t k = 0; k < patch.size(); ++k) own += weights[k] * weights[k] * body.now[patch[k]].inverse_mass;
    pull.answer = (1.0 - body.rigid_share) * own * Mat3::Identity();
    const Lever& lever = pull.lever;
    Mat3 arm;
    arm << 0.0, -lever.arm.z(), lever.arm.y(), lever.arm.z(), 0.0, -lever.arm.x(), -lever.arm.y(), lever.arm.x(), 0.0;
    pull.answer += lever.share * lever.share * body.whole.inverse_mass * Mat3::Identity() +
                   arm * body.whole.inverse_inertia * arm.transpose();
    scratch_.pulls.push_back(pull);
  }

  double visit(SpringRow& spring, const Pull& pull, double h) {
    const Vec3 stretch = spring.end - placeOf(spring.body, *spring.patch, *spring.weights, pull);
    const double stiff = spring.stiffness * h * h;
    const Vec3 more = (Mat3::Identity() + stiff * pull.answer).inverse() * (stiff * stretch - spring.impulse);
    spring.impulse += more;
    push(spring.body, *spring.patch, *spring.weights, pull, more);
    return more.squaredNorm();
  }

  /// What the fibre would be without its impulse decides what that is: the one that leaves it as long as it then is.
  double visit(FibreRow& fibre, const Pull* pulls) {
    const Mat3 answer = pulls[0].answer + pulls[1].answer;
    const Vec3 loose = spanOf(fibre, pulls) - answer * fibre.impulse;
    const double length = loose.norm(), stiff = fibre.stiff, rest = fibre.from;
    Vec3 impulse = Vec3::Zero();
    if (length > rest) {
      // As if it answered along itself alone; what it answers across turns it, and is seen to once more.
      const double along = stiff * loose.dot(answer * loose) / (length * length);
      double share = stiff * (length - rest) / (length + along * rest);  // tension over length
      Vec3 span = (Mat3::Identity() + share * answer).inverse() * loose;
      if (pulls[0].lever.share != 0.0 || pulls[1].lever.share != 0.0) {
        const double now = span.norm(), answers = span.dot(answer * span) / (now * now);
        const double more = (stiff * (now - rest) - share * now) / (1.0 + stiff * answers);
        const double tension = share * now + more, then = now - answers * more;
        if (tension > 0.0 && then > 0.0) {
          share = tension / then;
          span = (Mat3::Identity() + share * answer).inverse() * loose;
        }
      }
      impulse = -share * span;
    }
    const Vec3 more = impulse - fibre.impulse;
    fibre.impulse = impulse;
    if (!more.isZero(0.0)) push(fibre, pulls, more);
    return more.squaredNorm();
  }

  /// [m] from b to a at the start of the substep.
  Vec3 spanBefore(const FibreRow& fibre) const {
    const Vec3 a = meanOf(bodies_[fibre.a].before, fibre.at_a->particles, fibre.at_a->weights);
    if (fibre.b == kNoIndex) return a - fibre.place;
    return a - meanOf(bodies_[fibre.b].before, fibre.at_b->particles, fibre.at_b->weights);
  }

  double edgeOf(const Active& of) const { return std::min(bodies_[of.a].edge_length, bodies_[of.b].edge_length); }

  /// What a body has been moved by as a whole goes to its particles, and to where those were, if wanted.
  static void moveWhole(SolverBody& body, bool both) {
    if (!body.whole.current) return;
    body.whole.current = false;
    const RigidShift shift(body.whole.centre, body.whole.shift, body.whole.turn);
    for (Index i = 0; i < body.particles; ++i) {
      const Four way = shift.at(body.before[i]);
      four(body.now[i]) += way;
      if (both) four(body.before[i]) += way;
    }
  }
  void moveWhole(const std::vector<SolverRows>& sets, bool both) {
    for (const SolverRows& rows : sets)
      for (const Index b : {rows.a, rows.b})
        if (b != kNoIndex) moveWhole(bodies_[b], both);
  }

 private:
  static Vec3 meanOf(const Slot* slots, const std::vector<Index>& patch, const std::vector<double>& weights) {
    Vec3 sum = Vec3::Zero();
    for (std::size_t k = 0; k < patch.size(); ++k) sum += weights[k] * slots[patch[k]].place();
    return sum;
  }

  /// [m] of a point now.
  Vec3 placeOf(Index of_body, const std::vector<Index>& patch, const std::vector<double>& weights,
               const Pull& pull) const {
    const SolverBody& body = bodies_[of_body];
    return meanOf(body.now, patch, weights) + moved(body, pull.lever);
  }

  /// [m] from b to a now.
  Vec3 spanOf(const FibreRow& fibre, const Pull* pulls) const {
    const Vec3 a = placeOf(fibre.a, fibre.at_a->particles, fibre.at_a->weights, pulls[0]);
    if (fibre.b == kNoIndex) return a - fibre.place;
    return a - placeOf(fibre.b, fibre.at_b->particles, fibre.at_b->weights, pulls[1]);
  }

  void push(const FibreRow& fibre, const Pull* pulls, const Vec3& impulse) {
    push(fibre.a, fibre.at_a->particles, fibre.at_a->weights, pulls[0], impulse);
    if (fibre.b != kNoIndex) push(fibre.b, fibre.at_b->particles, fibre.at_b->weights, pulls[1], -impulse);
  }

  void push(Index of_body, const std::vector<Index>& patch, const std::vector<double>& weights, const Pull& pull,
            const Vec3& impulse) {
    SolverBody& body = bodies_[of_body];
    const Four way = four(Vec3((1.0 - body.rigid_share) * impulse));
    for (std::size_t k = 0; k < patch.size(); ++k) {
      Slot& slot = body.now[patch[k]];
      four(slot) += weights[k] * slot.inverse_mass * way;
    }
    push(body, pull.lever, impulse);
  }

  void pushParticles(const Active& active, const Vec3& impulse, Slot* SolverBody::*slots) {
    const ContactRow& row = *active.row;
    const auto each = [&](const SolverBody& body, Index begin, Index end) {
      if (!body.moves) return;
      const Four way = four(Vec3((1.0 - body.rigid_share) * impulse));
      for (Index k = begin; k < end; ++k) {
        Slot& slot = (body.*slots)[active.entries[k].particle];
        four(slot) += active.entries[k].coefficient * slot.inverse_mass * way;
      }
    };
    each(bodies_[active.a], row.begin, row.middle);
    each(bodies_[active.b], row.middle, row.end);
  }

  static WholeMotion wholeAt(const SolverBody& body) {
    MassMoments moments{body.before[0].place()};
    for (Index i = 0; i < body.particles; ++i) moments.add(1.0 / body.before[i].inverse_mass, body.before[i]);
    WholeMotion whole;
    whole.current = true;
    whole.inverse_mass = body.rigid_share / moments.mass;
    whole.centre = moments.centre();
    whole.inverse_inertia = body.rigid_share * moments.inverseInertia();
    return whole;
  }

  /// each: calls what it gets with particles and coefficients.
  template <class Each>
  static Lever leverOn(SolverBody& body, const Each& each) {
    Lever lever;
    if (body.held || !(body.rigid_share > 0.0)) return lever;
    if (!body.whole.current) body.whole = wholeAt(body);
    each([&](Index particle, double coefficient) {
      lever.share += coefficient;
      lever.arm += coefficient * (body.before[particle].place() - body.whole.centre);
    });
    return lever;
  }

  static Vec3 moved(const SolverBody& body, const Lever& lever) {
    return lever.share * body.whole.shift + body.whole.turn.cross(lever.arm);
  }

  static void push(SolverBody& body, const Lever& lever, const Vec3& impulse) {
    body.whole.shift += lever.share * body.whole.inverse_mass * impulse;
    body.whole.turn += body.whole.inverse_inertia * lever.arm.cross(impulse);
  }

  std::vector<SolverBody>& bodies_;
  SolverScratch& scratch_;
};

void leak(SolverBody& body, double sign) {
  for (const Slot *now = body.now, *before = body.before; now != body.now + body.particles; ++now, ++before)
    body.leaked += sign / now->inverse_mass * before->place().cross(now->place() - before->place());
}

// Rows act at both ends of what is between them: across it an impulse is a couple. Bodies get it back as a spin.
void spinBack(SolverBody& body) {
  if (body.leaked.isZero(0.0)) return;
  MassMoments moments{body.before[0].place()};
  for (Index i = 0; i < body.particles; ++i) moments.add(1.0 / body.now[i].inverse_mass, body.before[i]);
  const RigidShift back(moments.centre(), Vec3::Zero(), moments.inverseInertia() * -body.leaked);
  for (Index i = 0; i < body.particles; ++i) four(body.now[i]) += back.at(body.before[i]);
  body.leaked.setZero();
}

inline void solve(const std::vector<SolverRows>& sets, std::vector<SpringRow>& springs, std::vector<FibreRow>& fibres,
                  std::vector<SolverBody>& bodies, const SolverStep& step, const std::vector<Index>& free,
                  SolverScratch& scratch, SolverCounters& counters) {
  Solver solver(bodies, scratch);
  const double worth = step.warm / (step.h * step.h);  // force over last impulse
  const auto wayOf = [&step](const ContactRow& row) {
    return row.kind == FeaturePair::Kind::kSphere ? Vec3(step.sphere_to - step.sphere_from) : Vec3(Vec3::Zero());
  };
  const auto activeOf = [](const SolverRows& rows, ContactRow& row) {
    SolverScratch::Active active;
    active.row = &row;
    active.rows = &rows;
    active.number = static_cast<Index>(&row - rows.set->rows.data());
    active.entries = rows.set->entries.data();
    active.a = rows.a;
    active.b = rows.b == kNoIndex ? rows.a : rows.b;  // of which it has no entries
    return active;
  };
  for (const SolverRows& rows : sets)
    for (ContactRow& row : rows.set->rows) {
      const SolverScratch::Active active = activeOf(rows, row);
      if (row.kind == FeaturePair::Kind::kSphere) {  // its tangent plane goes along and turns
        const Vec3 from = solver.sum(active, true) - step.sphere_from;
        const double distance = from.norm();
        if (distance > 0.0) row.normal = from / distance;
        row.constant = row.rise - row.normal.dot(step.sphere_to) - step.sphere_radius;
      }
      // Not of a body with itself: at the lips of a wound rows come and go, and each time it would press tissue anew.
      if (step.number == 0 && rows.a != rows.b)
        solver.letOut(active, wayOf(row), step.frame, solver.givesWay(rows, active.number, worth));
    }
  if (!scratch.active.empty()) {  // what is moved sideways takes angular momentum along
    for (const Index b : free) leak(bodies[b], -1.0);
    solver.letOut(sets);
    for (const Index b : free) leak(bodies[b], 1.0);
  }
  for (const SolverRows& rows : sets)
    for (ContactRow& row : rows.set->rows) {
      const SolverScratch::Active active = activeOf(rows, row);
      const double gives = solver.givesWay(rows, active.number, worth);
      if (!row.impulse.isZero(0.0) || !(row.normal.dot(solver.sum(active, false)) + row.constant + gives > 0.0))
        solver.activate(active, wayOf(row), step, gives);
    }
  for (const SpringRow& spring : springs) solver.activate(spring);
  for (FibreRow& fibre : fibres) solver.activate(fibre, step);
  counters.fibres += fibres.size();
  counters.active += scratch.active.size();
  for (const auto& active : scratch.active) counters.ground += active.row->kind == FeaturePair::Kind::kPlane;
  solver.warmStart(step.warm);
  // Contacts have the last word. Always in the same order: in turns, what the last impulses leave over changes from
  // substep to substep, and stacks of stiff bodies sway.
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    double changed = 0.0, most = 0.0;  // [kg^2 m^2]
    const auto count = [&](double squared, const Vec3& impulse) {
      changed = std::max(changed, squared);
      most = std::max(most, impulse.squaredNorm());
    };
    for (std::size_t n = 0; n < springs.size(); ++n)
      count(solver.visit(springs[n], scratch.pulls[n], step.h), springs[n].impulse);
    for (std::size_t n = 0; n < fibres.size(); ++n)
      count(solver.visit(fibres[n], &scratch.pulls[springs.size() + 2 * n]), fibres[n].impulse);
    for (const auto& active : scratch.active) count(solver.visit(active), active.row->impulse);
    if (!(changed > kSolved * kSolved * most)) break;
  }
  solver.moveWhole(sets, false);
  for (const SpringRow& spring : springs) Solver::moveWhole(bodies[spring.body], false);
  for (const FibreRow& fibre : fibres)
    for (const Index b : {fibre.a, fibre.b})
      if (b != kNoIndex) Solver::moveWhole(bodies[b], false);
  if (free.empty()) return;
  for (const FibreRow& fibre : fibres) {  // it pulls along what it is in the end, not at the start
    Vec3 couple = solver.spanBefore(fibre).cross(fibre.impulse);
    if (fibre.a == fibre.b) couple *= 1.0 - bodies[fibre.a].rigid_share;
    bodies[fibre.a].leaked += 0.5 * couple;
    bodies[fibre.b].leaked += 0.5 * couple;
  }
  for (const auto& active : scratch.active) {
    if (active.start.norm() > solver.edgeOf(active)) continue;  // of who is deep inside it would throw it
    const Vec3 couple = active.start.cross(active.row->impulse);
    bodies[active.a].leaked += 0.5 * couple;
    bodies[active.b].leaked += 0.5 * couple;
  }
  for (const Index b : free) spinBack(bodies[b]);
}

#ifdef __x86_64__
// To the bit as the other: nothing is fused.
template <class... All>
__attribute__((target("avx2"), flatten)) void solveWide(All&... all) {
  solve(all...);
}
#endif

}  // namespace

void solveRows(const std::vector<SolverRows>& sets, std::vector<SpringRow>& springs, std::vector<FibreRow>& fibres,
               std::vector<SolverBody>& bodies, const SolverStep& step, const std::vector<Index>& free,
               SolverScratch& scratch, SolverCounters& counters) {
#ifdef __x86_64__
  if (__builtin_cpu_supports("avx2")) return solveWide(sets, springs, fibres, bodies, step, free, scratch, counters);
#endif
  solve(sets, springs, fibres, bodies, step, free, scratch, counters);
}

}  // namespace meshless
