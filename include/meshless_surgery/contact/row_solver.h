// A few sweeps of Gauss-Seidel over rows in each of many small steps: displacements that keep every gap open, with
// friction. A gap that is open closes at most; an overlap gets no deeper, and between two is let out at a bounded speed,
// once a frame (Macklin et al. 2019, "Small steps in physics simulation"). Conserves linear and, in bodies that nothing holds,
// angular momentum.
#pragma once

#include "meshless_surgery/contact/contact_rows.h"

namespace meshless {

/// How a body has been moved as a rigid one in a substep, about its centre at the substep's start.
struct WholeMotion {
  bool current = false;                 // mass, centre and inverse_inertia are of this substep
  double inverse_mass = 0.0;            // [1/kg] times the rigid share, as inverse_inertia
  Vec3 centre = Vec3::Zero();           // [m]
  Mat3 inverse_inertia = Mat3::Zero();  // [1/(kg m^2)]; no turn about an axis with nothing beside it
  Vec3 shift = Vec3::Zero();            // [m]
  Vec3 turn = Vec3::Zero();             // [rad]
};

/// A particle: where it is [m], and its inverse mass [1/kg], 0 where it is held.
struct alignas(32) Slot {
  double x = 0.0, y = 0.0, z = 0.0, inverse_mass = 0.0;

  Vec3 place() const { return {x, y, z}; }
  void put(const Vec3& at) { x = at.x(), y = at.y(), z = at.z(); }
};

/// A body in a substep; what it points to has to live as long.
struct SolverBody {
  Slot* now = nullptr;     // moved
  Slot* before = nullptr;  // at the start of the substep; moved where overlaps are let out, which gives no speed
  Index particles = 0;
  bool moves = true;
  double edge_length = 0.0;             // [m] mean; infinite where it does not move
  double rigid_share = 0.0;             // 0..1: that part of its answer moves it as a rigid body; a held one not at all
  bool held = false;
  WholeMotion whole;
  Vec3 leaked = Vec3::Zero();           // [kg m^2] angular momentum times h to be given back
};

/// Rows between two bodies, by their places in a list; b is kNoIndex for what has no particles.
struct SolverRows {
  RowSet* set = nullptr;
  Index a = 0, b = kNoIndex;
  const FineAnswer* fine = nullptr;  // null: none
};

/// A spring from the mean of a patch to a point: a compliant row of three components.
struct SpringRow {
  Index body = 0;
  const std::vector<Index>* patch = nullptr;
  const std::vector<double>* weights = nullptr;
  Vec3 end = Vec3::Zero();      // [m] where the mean is drawn to
  double stiffness = 0.0;       // [N/m]
  Vec3 impulse = Vec3::Zero();  // [kg m] on the tissue, in this substep
};

/// A point of a body: the weighted mean of some of its particles.
struct BodyPoint {
  std::vector<Index> particles;
  std::vector<double> weights;  // add up to 1

  Vec3 of(const Points& positions) const {
    Vec3 sum = Vec3::Zero();
    for (std::size_t k = 0; k < particles.size(); ++k) sum += weights[k] * positions[particles[k]];
    return sum;
  }
};

/// Joins a point of a body to one of another body, or to a place: it pulls along itself where it is longer than at
/// rest.
struct FibreRow {
  Index a = 0, b = kNoIndex;  // bodies; b is kNoIndex where the other end is a place
  const BodyPoint *at_a = nullptr, *at_b = nullptr;
  Vec3 place = Vec3::Zero();       // [m] that place
  double rest = 0.0;               // [m]
  double stiffness = 0.0;          // [N/m]
  Vec3 impulse = Vec3::Zero();     // [kg m] on a in a substep; between frames the force [N]
  double stiff = 0.0, from = 0.0;  // of the solver, in a substep: [kg] per length beyond that [m]
};

struct SolverStep {
  double h = 0.0;      // [s] of the substep
  double frame = 0.0;  // [s] of the frame, in whose first substep old overlap is let out
  double slow = 0.0;   // [m/s] at which nothing bounces
  int number = 0;      // of it in the search
  double warm = 1.0;   // what the impulses of the last substep are worth in this one: (h / its h)^2
  Vec3 sphere_from = Vec3::Zero(), sphere_to = Vec3::Zero();  // [m] centre, at the start and the end of the substep
  double sphere_radius = 0.0;                                 // [m]
};

struct SolverCounters {
  std::size_t active = 0;  // rows that could carry load
  std::size_t ground = 0;  // of them, those of the ground
  std::size_t fibres = 0;  // that could pull
};

/// Scratch of one thread.
struct SolverScratch {
  struct Lever {  // of a row on a body as a whole
    double share = 0.0;
    Vec3 arm = Vec3::Zero();  // [m] of its shares about the centre
  };
  struct Active {
    ContactRow* row;
    const SolverRows* rows;
    Index number;  // of the row in them
    const RowEntry* entries;
    Index a, b;  // bodies; the same where there is one
    Lever on_a, on_b;
    Vec3 start;                 // [m] sum of coefficient x at the start of the substep
    double target;              // [m] gap that is asked for at least
    double mass;                // [kg] impulse for a gap that is 1 m short
    double given;               // [m/(kg m)] by which the row gives way to its own impulse
    double sideways;            // [kg] the same across the normal, for a slide of 1 m
    double worth;               // [1/s^2] force over impulse
  };
  struct Pull {
    Mat3 answer = Mat3::Zero();  // [m/(kg m)] of the point to an impulse
    Lever lever{};
  };
  std::vector<Active> active;
  std::vector<Pull> pulls;  // one a spring, then two a fibre
};

/// Solves the rows, springs and fibres for the bodies that they name. Impulses of rows and fibres are read as a start
/// and written. free: those that move, if nothing holds them, so that angular momentum is worth keeping; else empty.
void solveRows(const std::vector<SolverRows>& sets, std::vector<SpringRow>& springs, std::vector<FibreRow>& fibres,
               std::vector<SolverBody>& bodies, const SolverStep& step, const std::vector<Index>& free,
               SolverScratch& scratch, SolverCounters& counters);

}  // namespace meshless
