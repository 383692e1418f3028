#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>

#include "contact_set.h"
#include "meshless_surgery/base/bytes.h"

namespace meshless {
namespace {

constexpr double kDepenetrationShare = 0.3;  // of old overlap, a frame
constexpr double kDepenetrationFrom = 5e-4;  // of the smaller body's size: less overlap is left
constexpr double kDepenetrationSpeed = 1.0;  // [1/s] times the smaller body's size, at most
constexpr double kCaughtSpeed = 10.0;        // [1/s] likewise, of what has passed through
constexpr double kRestingSpeed = 0.1;        // of the speed after a fall by half the size: slower bodies do not bounce
constexpr Index kTaskContacts = 256;         // of a task at the least
constexpr double kStirred = 0.02;   // of the least body's size, against another in one substep: not calm any more
constexpr double kBeside = 0.02;    // barycentric: farther off its triangle a point does not touch it from outside
constexpr double kFarBeside = 1.0;  // nor from inside

// Inverse of an inertia tensor; what has no extent about an axis does not turn about it.
Mat3 inverseInertia(const Mat3& inertia) {
  const double scale = inertia.trace();
  if (!(scale > 0.0) || !std::isfinite(scale)) return Mat3::Zero();
  const double det = (inertia / scale).determinant();
  if (det > 1e-6) return inertia.inverse();
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(inertia / scale);
  Mat3 inverse = Mat3::Zero();
  for (int k = 0; k < 3; ++k)
    if (solver.eigenvalues()[k] > 1e-9)
      inverse +=
          solver.eigenvectors().col(k) * solver.eigenvectors().col(k).transpose() / (solver.eigenvalues()[k] * scale);
  return inverse;
}

// A collider's motion as a whole by the impulses of the sweeps, added to its particles after them.
struct Rigid {
  Vec3 centre = Vec3::Zero();
  Mat3 inverse_inertia = Mat3::Zero();  // [1/(kg m^2)]
  double inverse_mass = 0.0;            // [1/kg]
  double share = 0.0;                   // of an impulse, that moves it as a whole; 0 where it is held
  bool moves = false;
  Vec3 shift = Vec3::Zero();  // [m]
  Vec3 turn = Vec3::Zero();   // [rad]
};

// What does not change about a contact during the sweeps of a substep.
struct Row {
  Vec3 normal, lever_a, lever_b;
  Vec3 arm_a, arm_b;         // [1/(kg m)] turn of each collider by a unit impulse along the normal, with its share
  Vec3 slip = Vec3::Zero();  // [m] tangential, before the sweeps
  double along = 0.0;        // [m] the same along the normal
  double distance = 0.0, target = 0.0;                      // [m]
  double inverse_answer = 0.0, inverse_answer_along = 0.0;  // [kg]
  double friction = 0.0, restitution = 0.0;
  double rigid_a = 0.0,
         rigid_b = 0.0;  // shares of an impulse that move the colliders as a whole; the rest moves particles
  Contact* contact = nullptr;
  bool on_ground = false;
};

Rigid rigidOf(const ShapeCollider& collider) {
  Rigid rigid;
  rigid.moves = true;
  rigid.share = collider.rigid_share;
  if (!(collider.rigid_share > 0.0)) return rigid;
  Vec3 sum = Vec3::Zero();
  double xx = 0, yy = 0, zz = 0, xy = 0, yz = 0, zx = 0;
  const Vec3 origin = collider.positions[0];
  for (Index i = 0; i < collider.particles; ++i) {
    const Vec3 r = collider.positions[i] - origin;
    const Vec3 mr = collider.masses[i] * r;
    sum += mr;
    xx += mr.x() * r.x();
    yy += mr.y() * r.y();
    zz += mr.z() * r.z();
    xy += mr.x() * r.y();
    yz += mr.y() * r.z();
    zx += mr.z() * r.x();
  }
  const Vec3 offset = sum / collider.mass;
  xx -= sum.x() * offset.x();
  yy -= sum.y() * offset.y();
  zz -= sum.z() * offset.z();
  xy -= sum.x() * offset.y();
  yz -= sum.y() * offset.z();
  zx -= sum.z() * offset.x();
  Mat3 inertia;
  inertia << yy + zz, -xy, -zx, -xy, xx + zz, -yz, -zx, -yz, xx + yy;
  rigid.centre = origin + offset;
  rigid.inverse_inertia = inverseInertia(inertia);
  rigid.inverse_mass = 1.0 / collider.mass;
  return rigid;
}

// Where the two points of a contact are, and how they have moved in the substep.
struct Gap {
  Vec3 point_a, point_b;
  Vec3 motion;              // [m] of a against b since the start of the substep
  double local_a, local_b;  // [1/kg] how particles answer an impulse at the points
};

// For a direct contact, normal and weights are made from where the corners are; kKept: those of before, and no answers.
template <bool kKept>
bool readGap(const ContactScene& scene, const std::vector<ShapeCollider>& colliders, Contact& c,
             const std::vector<ContactEntry>& entries, bool with_motion, Gap& gap) {
  const ShapeCollider& a = colliders[c.a];
  gap.local_a = gap.local_b = 0.0;
  gap.motion.setZero();
  if (c.direct) {
    const Index i = c.point[0], j = c.point[1];
    const double t = c.share, s = 1.0 - t;
    gap.point_a = a.positions[i];
    Vec3 before = with_motion ? a.previous[i] : gap.point_a;
    if (t > 0.0) {
      gap.point_a = s * gap.point_a + t * a.positions[j];
      if (with_motion) before = s * before + t * a.previous[j];
      if (a.moves) gap.local_a = s * s * a.inverse_masses[i] + t * t * a.inverse_masses[j];
    } else if (a.moves) {
      gap.local_a = a.inverse_masses[i];
    }
    if (with_motion) gap.motion = gap.point_a - before;
    if (c.b == kNoIndex) {
      gap.point_b = Vec3(gap.point_a.x(), gap.point_a.y(), *scene.ground);
      return true;
    }
    const ShapeCollider& b = colliders[c.b];
    const Vec3 &q0 = b.positions[c.corners[0]], &q1 = b.positions[c.corners[1]], &q2 = b.positions[c.corners[2]];
    if (kKept) {
      const Vec3 &p0 = b.previous[c.corners[0]], &p1 = b.previous[c.corners[1]], &p2 = b.previous[c.corners[2]];
      gap.point_b = c.weights[0] * q0 + c.weights[1] * q1 + c.weights[2] * q2;
      gap.motion -= gap.point_b - (c.weights[0] * p0 + c.weights[1] * p1 + c.weights[2] * p2);
      return true;
    }
    const Vec3 e1 = q1 - q0, e2 = q2 - q0, d = gap.point_a - q0;
    const Vec3 area = e1.cross(e2);
    const double squared = area.squaredNorm();
    if (!(squared > 0.0)) return false;
    const double inverse = 1.0 / squared;
    const double v = d.cross(e2).dot(area) * inverse, w = e1.cross(d).dot(area) * inverse;
    const double u = 1.0 - v - w;
    c.weights = {u, v, w};
    c.normal = area * ((c.flipped ? -1.0 : 1.0) * std::sqrt(inverse));
    gap.point_b = q0 + v * e1 + w * e2;
    if (b.moves)
      gap.local_b = u * u * b.inverse_masses[c.corners[0]] + v * v * b.inverse_masses[c.corners[1]] +
                    w * w * b.inverse_masses[c.corners[2]];
    if (with_motion) {
      const Vec3 &p0 = b.previous[c.corners[0]], &p1 = b.previous[c.corners[1]], &p2 = b.previous[c.corners[2]];
      gap.motion -= gap.point_b - (u * p0 + v * p1 + w * p2);
    }
    return true;
  }
  gap.point_a.setZero();
  gap.point_b.setZero();
  for (Index k = c.first; k < c.split; ++k) {
    const ContactEntry& e = entries[k];
    gap.point_a += e.weight * a.positions[e.particle];
    if (with_motion) gap.motion += e.weight * (a.positions[e.particle] - a.previous[e.particle]);
    if (!kKept && a.moves) gap.local_a += e.weight * e.weight * a.inverse_masses[e.particle];
  }
  gap.point_a += c.offset;
  if (c.b == kNoIndex) {
    gap.point_b = Vec3(gap.point_a.x(), gap.point_a.y(), *scene.ground);
    return true;
  }
  const ShapeCollider& b = colliders[c.b];
  for (Index k = c.split; k < c.end; ++k) {
    const ContactEntry& e = entries[k];
    gap.point_b += e.weight * b.positions[e.particle];
    if (with_motion) gap.motion -= e.weight * (b.positions[e.particle] - b.previous[e.particle]);
    if (!kKept && b.moves) gap.local_b += e.weight * e.weight * b.inverse_masses[e.particle];
  }
  return true;
}

// How a body answers an impulse at a lever, along a direction [1/kg].
double mobility(const Rigid& rigid, double share, const Vec3& lever, double local, const Vec3& along) {
  if (!rigid.moves) return 0.0;
  const Vec3 arm = lever.cross(along);
  return (1.0 - share) * local + share * (rigid.inverse_mass + arm.dot(rigid.inverse_inertia * arm));
}

const Rigid kStill{};

}  // namespace

struct ContactSolver::Impl {
  std::vector<Rigid> rigid;                    // one a collider
  std::vector<Vec3> shifts;                    // of particles by the local shares of impulses, see IslandPlan::shifts
  std::vector<Row> rows;                       // of all islands in a solve(), kept while nothing turns
  std::vector<double> depenetration_impulses;  // one a row in depenetrate() [kg m]
  std::vector<Index> tasks;                    // first island of each, and the end
  std::vector<std::size_t> corrected;          // one a task
  std::vector<Index> row_counts;               // one an island
  std::vector<char> stirred;                   // one an island: not calm, or no more since the frame began

  // inputs of the call
  const ContactScene* scene = nullptr;
  const std::vector<ShapeCollider>* colliders = nullptr;
  const std::vector<ContactEntry>* entries = nullptr;
  const IslandPlan* plan = nullptr;

  Vec3 localShift(const Contact& c, bool of_a) const {
    const Index p = of_a ? c.a : c.b;
    const Index from = plan->shifts[p];
    if (from == kNoIndex) return Vec3::Zero();
    const Vec3* s = shifts.data() + from;
    if (c.direct) {
      if (!of_a)
        return c.weights[0] * s[c.corners[0]] + c.weights[1] * s[c.corners[1]] + c.weights[2] * s[c.corners[2]];
      return c.share > 0.0 ? Vec3((1.0 - c.share) * s[c.point[0]] + c.share * s[c.point[1]]) : s[c.point[0]];
    }
    Vec3 sum = Vec3::Zero();
    for (Index k = of_a ? c.first : c.split; k < (of_a ? c.split : c.end); ++k)
      sum += (*entries)[k].weight * s[(*entries)[k].particle];
    return sum;
  }

  void give(const Contact& c, bool of_a, double local_share, const Vec3& impulse) {
    const Index p = of_a ? c.a : c.b;
    const Index from = plan->shifts[p];
    if (from == kNoIndex) return;
    Vec3* s = shifts.data() + from;
    const double* inverse = (*colliders)[p].inverse_masses;
    const Vec3 shift = local_share * impulse;
    if (c.direct) {
      if (!of_a) {
        for (int k = 0; k < 3; ++k) s[c.corners[k]] += (c.weights[k] * inverse[c.corners[k]]) * shift;
      } else if (c.share > 0.0) {
        s[c.point[0]] += (1.0 - c.share) * inverse[c.point[0]] * shift;
        s[c.point[1]] += c.share * inverse[c.point[1]] * shift;
      } else {
        s[c.point[0]] += inverse[c.point[0]] * shift;
      }
      return;
    }
    for (Index k = of_a ? c.first : c.split; k < (of_a ? c.split : c.end); ++k)
      s[(*entries)[k].particle] += ((*entries)[k].weight * inverse[(*entries)[k].particle]) * shift;
  }

  void apply(const Row& row, const Vec3& impulse) {
    const Contact& c = *row.contact;
    if (row.rigid_a < 1.0) give(c, true, 1.0 - row.rigid_a, impulse);
    if (row.rigid_a > 0.0) push(rigid[c.a], row.rigid_a * impulse, row.lever_a);
    if (row.on_ground) return;
    if (row.rigid_b < 1.0) give(c, false, 1.0 - row.rigid_b, -impulse);
    if (row.rigid_b > 0.0) push(rigid[c.b], -row.rigid_b * impulse, row.lever_b);
  }

  static void push(Rigid& r, const Vec3& impulse, const Vec3& lever) {
    r.shift += r.inverse_mass * impulse;
    r.turn += r.inverse_inertia * lever.cross(impulse);
  }

  Vec3 relativeShift(const Row& row) const {
    const Contact& c = *row.contact;
    const Rigid& a = rigid[c.a];
    Vec3 d = localShift(c, true) + a.shift + a.turn.cross(row.lever_a);
    if (!row.on_ground) {
      const Rigid& b = rigid[c.b];
      d -= localShift(c, false) + b.shift + b.turn.cross(row.lever_b);
    }
    return d;
  }

  void begin(Index island) {
    for (Index k = plan->collider_offsets[island]; k < plan->collider_offsets[island + 1]; ++k) {
      const Index p = plan->colliders[k];
      rigid[p] = rigidOf((*colliders)[p]);
      std::fill_n(shifts.begin() + plan->shifts[p], (*colliders)[p].particles, Vec3::Zero());
    }
  }

  // Where a collider's particle i goes by what the sweeps found, once that is there.
  template <class Visit>
  void forEachMove(Index p, const Visit& visit) const {
    const ShapeCollider& collider = (*colliders)[p];
    const Rigid& r = rigid[p];
    if (!r.shift.allFinite() || !r.turn.allFinite()) return;
    const Vec3* shift = shifts.data() + plan->shifts[p];
    if (r.turn.isZero(0.0) && r.shift.isZero(0.0)) {
      for (Index i = 0; i < collider.particles; ++i) visit(i, shift[i]);
    } else {
      const Vec3 offset = r.shift - r.turn.cross(r.centre);
      for (Index i = 0; i < collider.particles; ++i)
        visit(i, Vec3(shift[i] + offset + r.turn.cross(collider.positions[i])));
    }
  }

  // The share of what the sweeps found that gives the island no kinetic energy. They answer for the body as a whole and
  // for its particles in fixed shares: of bodies that swing wildly the whole would be thrown by what only swings, and
  // few sweeps leave errors. Contacts have none to give, and one share for all keeps momentum.
  double energyShare(Index island) const {
    double along = 0.0, squared = 0.0;  // [kg m^2]
    for (Index k = plan->collider_offsets[island]; k < plan->collider_offsets[island + 1]; ++k) {
      const Index p = plan->colliders[k];
      const ShapeCollider& collider = (*colliders)[p];
      forEachMove(p, [&](Index i, const Vec3& move) {
        along += collider.masses[i] * move.dot(collider.positions[i] - collider.previous[i]);
        squared += collider.masses[i] * move.squaredNorm();
      });
    }
    if (!(2.0 * along + squared > 0.0)) return 1.0;
    return along < 0.0 ? -2.0 * along / squared : 0.0;
  }

  void finish(Index island, double share) {
    for (Index k = plan->collider_offsets[island]; k < plan->collider_offsets[island + 1]; ++k) {
      const Index p = plan->colliders[k];
      Vec3* const positions = (*colliders)[p].positions;
      if (share == 1.0)
        forEachMove(p, [positions](Index i, const Vec3& move) { positions[i] += move; });
      else
        forEachMove(p, [positions, share](Index i, const Vec3& move) { positions[i] += share * move; });
    }
  }

  void start(const ContactScene& of_scene, const std::vector<ShapeCollider>& of_colliders,
             const std::vector<ContactEntry>& of_entries, const IslandPlan& of_plan) {
    scene = &of_scene;
    colliders = &of_colliders;
    entries = &of_entries;
    plan = &of_plan;
    rigid.resize(of_colliders.size());
    for (std::size_t p = 0; p < of_colliders.size(); ++p)
      if (!of_colliders[p].moves) rigid[p] = kStill;  // the place may have been that of a body
    Index particles = 0;
    for (Index p : of_plan.colliders) particles += of_colliders[p].particles;
    if (shifts.size() < particles) shifts.resize(particles);
  }

  void shareOut();

  // Fills what both kinds of sweep need; false where there is nothing to hold.
  bool prepare(Contact& c, const Gap& gap, Row& row) {
    row.contact = &c;
    row.on_ground = c.b == kNoIndex;
    const Rigid& a = (*colliders)[c.a].moves ? rigid[c.a] : kStill;
    const Rigid& b = row.on_ground || !(*colliders)[c.b].moves ? kStill : rigid[c.b];
    row.normal = c.normal;
    row.lever_a = gap.point_a - a.centre;
    row.lever_b = gap.point_b - b.centre;
    // What has passed through is stopped as a whole: its points alone would be left behind.
    row.rigid_a = c.caught && a.share > 0.0 ? 1.0 : a.share;
    row.rigid_b = c.caught && b.share > 0.0 ? 1.0 : b.share;
    if (c.a == c.b) row.rigid_a = row.rigid_b = 0.0;  // a body does not push itself as a whole
    const Vec3 turned_a = row.lever_a.cross(c.normal), turned_b = row.lever_b.cross(c.normal);
    row.arm_a = row.rigid_a * (a.inverse_inertia * turned_a);
    row.arm_b = row.rigid_b * (b.inverse_inertia * turned_b);
    const double answer = (1.0 - row.rigid_a) * gap.local_a + (1.0 - row.rigid_b) * gap.local_b +
                          row.rigid_a * a.inverse_mass + row.rigid_b * b.inverse_mass + turned_a.dot(row.arm_a) +
                          turned_b.dot(row.arm_b);
    if (!(answer > 0.0) || !std::isfinite(answer)) return false;
    row.inverse_answer = 1.0 / answer;
    row.distance = c.normal.dot(gap.point_a - gap.point_b);
    return std::isfinite(row.distance);
  }

  // Of a contact whose answer is known: it moves particles alone.
  bool prepareAgain(Contact& c, const Gap& gap, Row& row) {
    row.contact = &c;
    row.on_ground = c.b == kNoIndex;
    row.normal = c.normal;
    row.lever_a = row.lever_b = row.arm_a = row.arm_b = Vec3::Zero();
    row.rigid_a = row.rigid_b = 0.0;
    row.inverse_answer = 1.0 / c.answer;
    row.distance = c.normal.dot(gap.point_a - gap.point_b);
    return std::isfinite(row.distance);
  }

  void solveIsland(Index island, std::vector<Contact>& contacts, bool fresh, std::size_t& corrected) {
    Row* const first = rows.data() + plan->contact_offsets[island];
    if (fresh) stirred[island] = !plan->calm[island];
    // Calm when the frame began, it can be torn along by a spring or a tool since.
    const double most = stirred[island] ? 0.0 : kStirred * leastSize(island);
    if (!fresh && !stirred[island]) {
      // All impulses of the last substep by the same rows: what they have moved is where this one starts.
      beginAgain(island);
      double farthest = 0.0;
      for (Row* row = first; row != first + row_counts[island]; ++row) {
        Gap gap;
        readGap<true>(*scene, *colliders, *row->contact, *entries, true, gap);
        row->distance = row->normal.dot(gap.point_a - gap.point_b);
        const double along = row->normal.dot(gap.motion);
        row->target = targetOf(*row, along);
        row->slip = gap.motion - along * row->normal;
        farthest = std::max(farthest, gap.motion.squaredNorm());
      }
      stirred[island] = !(farthest < most * most);
    }
    if (fresh || stirred[island]) {
      begin(island);
      Row* row = first;
      for (Index k = plan->contact_offsets[island]; k < plan->contact_offsets[island + 1]; ++k)
        if (makeRow(contacts[plan->contacts[k]], *row)) ++row;
      row_counts[island] = static_cast<Index>(row - first);
      if (!stirred[island]) {
        double farthest = 0.0;
        for (const Row* r = first; r != row; ++r)
          farthest = std::max(farthest, r->slip.squaredNorm() + r->along * r->along);
        stirred[island] = !(farthest < most * most);
      }
      startWarm(island, first);
    }
    strikeTogether(first, first + row_counts[island]);
    const Index count = row_counts[island];
    for (int pass = 0; pass < plan->passes[island]; ++pass)
      for (Index n = 0; n < count; ++n) corrected += sweep(first[pass % 2 ? count - 1 - n : n]);
    const double share = stirred[island] ? energyShare(island) : 1.0;
    if (share < 1.0)
      for (const Row* row = first; row != first + count; ++row) {
        row->contact->impulse *= share;
        row->contact->slip_impulse *= share;
      }
    finish(island, share);
  }

  // From where the last substep ended: stacks converge over substeps, not within one. What moves a collider as a whole
  // is summed before it is divided by mass and inertia.
  void startWarm(Index island, const Row* first) {
    const auto add = [&](Index p, double share, const Vec3& lever, const Vec3& impulse) {
      if (!(share > 0.0)) return;
      rigid[p].shift += share * impulse;
      rigid[p].turn += share * lever.cross(impulse);
    };
    for (const Row* row = first; row != first + row_counts[island]; ++row) {
      Contact& c = *row->contact;
      if (!(c.impulse > 0.0)) {
        c.slip_impulse.setZero();
        continue;
      }
      const Vec3 impulse = c.impulse * row->normal + c.slip_impulse;
      if (row->rigid_a < 1.0) give(c, true, 1.0 - row->rigid_a, impulse);
      add(c.a, row->rigid_a, row->lever_a, impulse);
      if (row->on_ground) continue;
      if (row->rigid_b < 1.0) give(c, false, 1.0 - row->rigid_b, -impulse);
      add(c.b, row->rigid_b, row->lever_b, -impulse);
    }
    for (Index k = plan->collider_offsets[island]; k < plan->collider_offsets[island + 1]; ++k) {
      Rigid& r = rigid[plan->colliders[k]];
      r.shift *= r.inverse_mass;
      r.turn = r.inverse_inertia * r.turn;
    }
  }

  // Points of a body that strike another at once: one after the other they would turn it. So what they need together
  // goes to all of them in equal parts first. Only where nothing pressed before.
  void strikeTogether(const Row* row, const Row* end) {
    while (row != end) {
      const Row* first = row;
      bool pressed = false;
      for (; row != end && row->contact->a == first->contact->a && row->contact->b == first->contact->b; ++row)
        pressed = pressed || row->contact->impulse > 0.0;
      if (pressed || row - first < 2 || first->contact->a == first->contact->b) continue;
      int count = 0;
      double wrong = 0.0, local = 0.0;
      Vec3 lever_a = Vec3::Zero(), lever_b = Vec3::Zero(), normal = Vec3::Zero();
      const auto lacks = [this](const Row& r) { return r.target - r.distance - r.normal.dot(relativeShift(r)); };
      const Rigid& a = rigid[first->contact->a];
      const Rigid& b = first->on_ground ? kStill : rigid[first->contact->b];
      for (const Row* r = first; r != row; ++r) {
        const double lack = lacks(*r);
        if (!(lack > 0.0)) continue;
        ++count;
        wrong += lack;
        lever_a += r->lever_a;
        lever_b += r->lever_b;
        normal += r->normal;
        local += 1.0 / r->inverse_answer - r->rigid_a * a.inverse_mass - r->rigid_b * b.inverse_mass -
                 r->lever_a.cross(r->normal).dot(r->arm_a) - r->lever_b.cross(r->normal).dot(r->arm_b);
      }
      if (count < 2 || !(normal.norm() > 0.5 * count)) continue;
      normal.normalize();
      const Vec3 arm_a = (lever_a / count).cross(normal), arm_b = (lever_b / count).cross(normal);
      const double answer = first->rigid_a * (a.inverse_mass + arm_a.dot(a.inverse_inertia * arm_a)) +
                            first->rigid_b * (b.inverse_mass + arm_b.dot(b.inverse_inertia * arm_b)) +
                            std::max(0.0, local) / (count * count);
      const double each = wrong / count / answer / count;
      if (!(answer > 0.0) || !std::isfinite(each)) continue;
      for (const Row* r = first; r != row; ++r) {
        if (!(r->target > r->distance)) continue;
        r->contact->impulse += each;
        apply(*r, each * r->normal);
      }
    }
  }

  bool makeRow(Contact& c, Row& row) {
    Gap gap;
    const double was = c.impulse;
    c.impulse = 0.0;
    const bool known = c.answer > 0.0;
    if (known) {
      readGap<true>(*scene, *colliders, c, *entries, true, gap);
      if (!prepareAgain(c, gap, row)) return false;
    } else {
      if (!readGap<false>(*scene, *colliders, c, *entries, true, gap) || !prepare(c, gap, row)) return false;
      // Where an embedded vertex takes part and no body moves as a whole, normal and weights are those of the frame.
      if (!c.direct && c.a != c.b && row.rigid_a == 0.0 && row.rigid_b == 0.0) c.answer = gap.local_a + gap.local_b;
    }
    const double along_normal = c.normal.dot(gap.motion);
    const double before = row.distance - along_normal;
    if (c.direct && !row.on_ground) {
      const double least = std::min({c.weights[0], c.weights[1], c.weights[2]});
      if (!c.caught && least < (before > 0.0 ? -kBeside : -kFarBeside)) return false;
    }
    const ShapeCollider &a = (*colliders)[c.a], *b = row.on_ground ? nullptr : &(*colliders)[c.b];
    row.restitution = !b ? a.restitution : b->mass > 0.0 ? std::sqrt(a.restitution * b->restitution) : a.restitution;
    if (row.restitution > 0.0) {
      // The bodies have to approach: particles of a body at rest that tremble would be kept trembling.
      const double size = b ? std::min(a.shape->size(), b->shape->size()) : a.shape->size();
      const double approach = c.normal.dot((b ? b->velocity : Vec3(Vec3::Zero())) - a.velocity);
      if (!(approach > kRestingSpeed * std::sqrt(scene->gravity.norm() * size))) row.restitution = 0.0;
    }
    row.target = targetOf(row, along_normal);
    row.slip = gap.motion - along_normal * c.normal;
    row.along = along_normal;
    row.friction = std::sqrt(a.friction * (b ? b->friction : scene->ground_friction));
    row.inverse_answer_along = 0.0;
    if (row.friction > 0.0 && c.answer > 0.0) {
      row.inverse_answer_along = row.inverse_answer;
    } else if (row.friction > 0.0) {
      // Along the slip and across it: the larger answer is safe for both.
      const double length = row.slip.norm();
      const Vec3 along = length > 0.0 ? Vec3(row.slip / length) : c.normal.unitOrthogonal();
      const Vec3 across = c.normal.cross(along);
      const Rigid& rigid_a = a.moves ? rigid[c.a] : kStill;
      const Rigid& rigid_b = b && b->moves ? rigid[c.b] : kStill;
      const double answer = std::max(mobility(rigid_a, row.rigid_a, row.lever_a, gap.local_a, along) +
                                         mobility(rigid_b, row.rigid_b, row.lever_b, gap.local_b, along),
                                     mobility(rigid_a, row.rigid_a, row.lever_a, gap.local_a, across) +
                                         mobility(rigid_b, row.rigid_b, row.lever_b, gap.local_b, across));
      if (answer > 0.0) row.inverse_answer_along = 1.0 / answer;
    }
    c.impulse = was;
    if (was > 0.0) c.slip_impulse -= c.normal.dot(c.slip_impulse) * c.normal;
    return true;
  }

  // No nearer than at the start of the substep, nor than the surface. What bounces goes back from where it was at a
  // share of the speed at which it came.
  double targetOf(const Row& row, double motion) const {
    const double before = row.distance - motion;
    const double rest = std::min(0.0, before);
    if (!(row.restitution > 0.0) || !(row.distance < 0.0) || !(motion < 0.0)) return rest;
    return std::max(rest, before - row.restitution * motion);
  }

  // One contact of a sweep; 1 where it moved something.
  std::size_t sweep(const Row& row) {
    Contact& c = *row.contact;
    const Vec3 d = relativeShift(row);
    const double along_normal = row.normal.dot(d);
    const double wrong = row.target - row.distance - along_normal;
    if (!(wrong > 0.0) && !(c.impulse > 0.0)) return 0;
    const double change = std::max(-c.impulse, wrong * row.inverse_answer);
    if (!std::isfinite(change)) return 0;
    c.impulse += change;
    Vec3 impulse = change * row.normal;
    if (row.inverse_answer_along > 0.0) {
      // Friction stops what slips, within the cone of all that presses.
      const Vec3 slip = row.slip + d - along_normal * row.normal;
      Vec3 wanted = c.slip_impulse - row.inverse_answer_along * slip;
      const double cone = row.friction * c.impulse, squared = wanted.squaredNorm();
      if (squared > cone * cone) wanted *= cone / std::sqrt(squared);
      impulse += wanted - c.slip_impulse;
      c.slip_impulse = wanted;
    }
    apply(row, impulse);
    return 1;
  }

  // False where the contact does not overlap. `old` [m]: the part of the overlap that is depenetrated.
  bool readOverlap(Contact& c, Gap& gap, double& old) {
    if (!c.below || !readGap<false>(*scene, *colliders, c, *entries, false, gap)) return false;
    const double distance = c.normal.dot(gap.point_a - gap.point_b);
    if (!(distance < 0.0)) return false;
    if (c.direct && c.b != kNoIndex && !c.caught && std::min({c.weights[0], c.weights[1], c.weights[2]}) < -kFarBeside)
      return false;
    old = std::max(0.0, -distance - (c.caught ? 0.0 : kDepenetrationFrom * sizeAt(c)));
    return true;
  }

  double sizeAt(const Contact& c) const {
    const double size = (*colliders)[c.a].shape->size();
    return c.b == kNoIndex ? size : std::min(size, (*colliders)[c.b].shape->size());
  }

  std::size_t depenetrateIsland(Index island, std::vector<Contact>& contacts, double h) {
    const Index from = plan->contact_offsets[island], to = plan->contact_offsets[island + 1];
    Gap gap;
    double old = 0.0;
    // In what has settled nothing is left to depenetrate.
    if (std::none_of(plan->contacts.begin() + from, plan->contacts.begin() + to,
                     [&](Index k) { return readOverlap(contacts[k], gap, old) && old > 0.0; }))
      return 0;
    begin(island);
    Row* const first = rows.data() + from;
    Row* end = first;
    for (Index k = from; k < to; ++k) {
      Contact& c = contacts[plan->contacts[k]];
      if (!readOverlap(c, gap, old) || !prepare(c, gap, *end)) continue;
      const double size = sizeAt(c);
      end->target = end->distance + (c.caught ? std::min(old, kCaughtSpeed * size * h)
                                              : std::min(kDepenetrationShare * old, kDepenetrationSpeed * size * h));
      ++end;
    }
    if (end == first) return 0;
    // There and back, and what was too much is taken back: one way alone turns bodies a little in every frame, always
    // to the same side, and a stack would walk and rock.
    const std::size_t count = static_cast<std::size_t>(end - first);
    double* const impulses = depenetration_impulses.data() + (first - rows.data());
    std::fill_n(impulses, count, 0.0);
    std::size_t moved = 0;
    for (std::size_t n = 0; n < 2 * count; ++n) {
      const std::size_t k = n < count ? n : 2 * count - 1 - n;
      const Row& row = first[k];
      const double wrong = row.target - row.distance - row.normal.dot(relativeShift(row));
      const double change = std::max(-impulses[k], wrong * row.inverse_answer);
      if (change == 0.0 || !std::isfinite(change)) continue;
      impulses[k] += change;
      apply(row, change * row.normal);
      ++moved;
    }
    finish(island, 1.0);
    return moved;
  }

  double leastSize(Index island) const {
    double least = std::numeric_limits<double>::infinity();
    for (Index k = plan->collider_offsets[island]; k < plan->collider_offsets[island + 1]; ++k)
      least = std::min(least, (*colliders)[plan->colliders[k]].shape->size());
    return least;
  }

  // The bodies have hardly turned since begin(): only where they are is found anew.
  void beginAgain(Index island) {
    for (Index k = plan->collider_offsets[island]; k < plan->collider_offsets[island + 1]; ++k) {
      const Index p = plan->colliders[k];
      const ShapeCollider& collider = (*colliders)[p];
      Rigid& r = rigid[p];
      if (!(r.share > 0.0)) continue;
      const Vec3 origin = collider.positions[0];
      Vec3 sum = Vec3::Zero();
      for (Index i = 1; i < collider.particles; ++i) sum += collider.masses[i] * (collider.positions[i] - origin);
      r.centre = origin + sum / collider.mass;
    }
  }
};

ContactSolver::ContactSolver() : impl_(std::make_unique<Impl>()) {}
ContactSolver::~ContactSolver() = default;
ContactSolver::ContactSolver(ContactSolver&&) noexcept = default;
ContactSolver& ContactSolver::operator=(ContactSolver&&) noexcept = default;

// Some islands with about as many contacts as the others'.
void ContactSolver::Impl::shareOut() {
  tasks.assign(1, 0);
  for (Index island = 0; island < plan->size(); ++island)
    if (plan->contact_offsets[island + 1] - plan->contact_offsets[tasks.back()] >= kTaskContacts)
      tasks.push_back(island + 1);
  if (tasks.back() != plan->size()) tasks.push_back(plan->size());
  corrected.assign(tasks.size() - 1, 0);
}

void ContactSolver::solve(const ContactScene& scene, const std::vector<ShapeCollider>& colliders,
                          std::vector<Contact>& contacts, const std::vector<ContactEntry>& entries,
                          const IslandPlan& plan, bool fresh, const ForEach& for_each, ContactCounters& counters) {
  Impl& w = *impl_;
  begin(scene, colliders, entries, plan);
  w.shareOut();
  runEach(for_each, w.tasks.size() - 1, [&](std::size_t task) {
    for (Index island = w.tasks[task]; island < w.tasks[task + 1]; ++island)
      w.solveIsland(island, contacts, fresh, w.corrected[task]);
  });
  for (const std::size_t corrected : w.corrected) counters.corrected += corrected;
}

void ContactSolver::begin(const ContactScene& scene, const std::vector<ShapeCollider>& colliders,
                          const std::vector<ContactEntry>& entries, const IslandPlan& plan) {
  Impl& w = *impl_;
  w.start(scene, colliders, entries, plan);
  // Rows are kept in place: an island has room for all of its contacts.
  w.rows.resize(plan.contacts.size());
  w.row_counts.resize(plan.size());
  w.stirred.resize(plan.size());
  w.depenetration_impulses.resize(plan.contacts.size());
}

void ContactSolver::solveIsland(Index island, std::vector<Contact>& contacts, bool fresh, std::size_t& corrected) {
  impl_->solveIsland(island, contacts, fresh, corrected);
}

void ContactSolver::depenetrateIsland(Index island, std::vector<Contact>& contacts, double h, std::size_t& corrected) {
  corrected += impl_->depenetrateIsland(island, contacts, h);
}

void ContactSolver::depenetrate(const ContactScene& scene, const std::vector<ShapeCollider>& colliders,
                                std::vector<Contact>& contacts, const std::vector<ContactEntry>& entries,
                                const IslandPlan& plan, double h, const ForEach& for_each, ContactCounters& counters) {
  Impl& w = *impl_;
  begin(scene, colliders, entries, plan);
  w.shareOut();
  runEach(for_each, w.tasks.size() - 1, [&](std::size_t task) {
    for (Index island = w.tasks[task]; island < w.tasks[task + 1]; ++island)
      w.corrected[task] += w.depenetrateIsland(island, contacts, h);
  });
  for (const std::size_t corrected : w.corrected) counters.corrected += corrected;
}

std::size_t ContactSolver::bytes() const {
  const Impl& w = *impl_;
  return sizeof w +
         bytesOf(w.rigid, w.shifts, w.rows, w.depenetration_impulses, w.tasks, w.corrected, w.row_counts, w.stirred);
}

}  // namespace meshless
