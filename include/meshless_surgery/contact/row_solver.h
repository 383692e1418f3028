// Gauss-Seidel on rows: displacements of a substep that keep every gap open, with friction. Conserves linear and, in
// bodies that nothing holds, angular momentum.
#pragma once

#include "meshless_surgery/contact/contact_rows.h"
#include "meshless_surgery/contact/rigid_groups.h"

namespace meshless {

/// A body in a substep; what it points to has to live as long.
struct SolverBody {
  Vec3* positions = nullptr;               // [m] moved
  const Vec3* previous = nullptr;          // [m] at the start of the substep
  const double* inverse_masses = nullptr;  // [1/kg] 0: held
  Index particles = 0;
  const RigidGroups* groups = nullptr;  // where part of the answer is rigid
  double rigid_share = 0.0;             // 0..1: that part
  std::vector<GroupMotion> motions;     // one a group
  Vec3 leaked = Vec3::Zero();           // [kg m^2] angular momentum times h to be given back
};

/// A spring from the mean of a patch to a point: a compliant row of three components.
struct SpringRow {
  Index body = 0;
  const std::vector<Index>* patch = nullptr;
  const std::vector<double>* weights = nullptr;
  std::vector<double> inverse_masses;  // [1/kg] one a particle of the patch; 0: held
  Vec3* positions = nullptr;           // [m] of the body's particles
  Vec3 end = Vec3::Zero();             // [m] where the mean is drawn to
  double stiffness = 0.0;              // [N/m]
  Vec3 impulse = Vec3::Zero();         // [kg m] on the tissue, in this substep
};

struct SolverStep {
  double h = 0.0;     // [s] of the substep
  double warm = 1.0;  // what the impulses of the last substep are worth in this one: (h / its h)^2
  Vec3 sphere_from = Vec3::Zero(), sphere_to = Vec3::Zero();  // [m] centre, at the start and the end of the substep
  double sphere_radius = 0.0;                                 // [m]
  double tolerance = 0.0;                                     // [m] sweeps end where no row has been corrected by more
};

struct SolverCounters {
  std::size_t active = 0;   // rows that could carry load
  std::size_t visits = 0;   // of rows
  std::size_t limited = 0;  // watched pairs that would have met
};

/// Scratch of one thread.
struct SolverScratch {
  struct Lever {  // of a row on a group
    Index group;
    double share;
    Vec3 arm;  // [m] of its shares about the centre
  };
  struct Active {
    Index row;
    Index levers, middle, end;  // of a, then of b
    double before;              // [m] gap at the start of the substep
    Vec3 start;                 // [m] sum of coefficient x then
    double answer, sideways;    // [1/kg] along the normal, and across at most
  };
  std::vector<Active> active;
  std::vector<Lever> levers;
};

/// Solves the rows `order` of the set, and springs, for the bodies that they name. Impulses are read as a start and
/// written. free: nothing holds any of the bodies, so that angular momentum is worth keeping.
void solveRows(RowSet& set, const Index* order, std::size_t count, std::vector<SpringRow>& springs,
               std::vector<SolverBody>& bodies, const SolverStep& step, bool free, SolverScratch& scratch,
               SolverCounters& counters);

/// Old overlap: moves positions alone, a share of each row's depth beyond its skin, at a bounded speed. h [s] of the
/// frame, lengths [m] the mean edges of bodies. Returns the rows that moved something.
std::size_t letOut(const RowSet& set, const Index* order, std::size_t count, const std::vector<double>& lengths,
                   double h, std::vector<SolverBody>& bodies, SolverScratch& scratch);

}  // namespace meshless
