// What a body is made of.
#pragma once

#include "meshless_surgery/appearance/look.h"
#include "meshless_surgery/base/result.h"
#include "meshless_surgery/base/types.h"

namespace meshless {

/// What the goal shape of a cluster may do besides moving as a rigid body (Mueller et al. 2005, sec. 3.3 and 4).
enum class MatchMode { kRigid, kLinear, kQuadratic };

const char* toString(MatchMode mode);

/// What of a body's surface meets the rest of it.
/// kWoundFaces: the faces of cuts and incisions, once an incision has opened the body.
enum class SelfContact { kNone, kWoundFaces, kAll };

const char* toString(SelfContact self_contact);

/// How hard something is held, by how far it is off: a table from relative error (>= 0, ascending) to the share of the
/// error that a substep closes (0..1, never falling), linear between its points and constant beyond. Empty: not held at
/// all.
struct ResponseCurve {
  std::vector<std::array<double, 2>> points;

  double at(double error) const;
  /// Why it is not usable, naming `key`, value and range; else Done.
  Status validate(const std::string& key) const;
};

/// What is strained beyond the yield keeps some of it (dynamics/plastic.h). Strain: |S - 1| of the stretch S without
/// its change of volume, 0.1 where a part is drawn out by about 8 %.
struct Plasticity {
  double yield = 0.1;    // 0..10
  double creep = 0.0;    // [1/s] 0..1e6, rate at which the strain beyond the yield is taken on; 0: none
  double maximum = 0.5;  // 0..3, strain of the rest shape
};

constexpr std::size_t kMostRelaxations = 3;

/// A share of the stress without change of volume that fades with time: a Maxwell element. Of a Prony series
/// G(t) = G (1 - sum of share (1 - exp(-t / time))), whose G is that of youngs_modulus.
struct Relaxation {
  double share = 0.0;  // above 0, all together at most 0.99
  double time = 1.0;   // [s] 1e-4..1e6
};

/// Fibres that lie in an elastic material: they pull where they are longer than at rest, and never push. How they lie is
/// the body's (BodyDef::fibre_direction).
struct Fibres {
  double stiffness = 0.0;   // [Pa] 0..1e12, what they add to Young's modulus along them; 0: there are none
  double stiffening = 0.0;  // 0..1000, how their pull grows beyond small strain: dynamics/elastic.h
};

/// Two families. An appearance material has a youngs_modulus of 0: mode, alpha and beta are the paper's; see goalPull
/// for alpha. An elastic material has a youngs_modulus: the elastic constants of a textbook, without calibration
/// (dynamics/elastic.h); mode, alpha and beta are then not used.
struct Material {
  std::string name = "default";
  double youngs_modulus = 0.0;   // [Pa] 0: an appearance material
  double poissons_ratio = 0.45;  // 0..0.49
  double stiffening = 0.0;       // 0..1000, how stress grows beyond small strain: dynamics/elastic.h
  double asymmetry = 0.0;        // -30..30, how much more where pressed than where pulled, likewise
  MatchMode mode = MatchMode::kLinear;
  double alpha = 0.9;                            // 0..1, how hard goals pull: see goalPull
  double beta = 0.2;                             // 0..1, share of the fitted linear or quadratic map in the goal
  double density = 1000.0;                       // [kg/m^3] > 0
  double damping = 1.0;                          // [1/s] >= 0, decay rate of the motion that deforms
  double friction = 0.5;                         // 0..10, Coulomb
  double restitution = 0.0;                      // 0..1, share of the approach that a contact gives back
  double toughness = 0.0;                        // [J/m^2] >= 0 of a new cut face pair, by blades that are felt
  SelfContact self_contact = SelfContact::kAll;  // never of a body that cannot bend
  ResponseCurve volume;                          // of the solid's volume
  ResponseCurve area;                            // of the surface
  Plasticity plasticity;
  std::vector<Relaxation> relaxation;             // of an elastic material, at most kMostRelaxations
  Fibres fibres;                                  // likewise
  Color color{0.62f, 0.22f, 0.18f, 1.0f};         // of the outer surface
  Color inside_color{0.85f, 0.45f, 0.40f, 1.0f};  // of cut faces
  Appearance appearance;                          // patterns over both

  bool bends() const { return elastic() || mode != MatchMode::kRigid; }
  bool elastic() const { return youngs_modulus > 0.0; }
  bool relaxes() const { return elastic() && !relaxation.empty(); }
  bool hasFibres() const { return elastic() && fibres.stiffness > 0.0; }
  bool plastic() const { return plasticity.creep > 0.0 && plasticity.maximum > 0.0; }
  /// Why the settings are not usable, naming key, value and range; else Done.
  Status validate() const;
};

/// How goals pull in a substep of h [s]: particles that would be at x with velocities v, by all else, are moved by
/// gain times the way from x + lead v to the goal there. So they swing as on a spring of -ln(1 - alpha) / (1/60 s)^2
/// for each unit of mass that takes 1 - alpha of a velocity in 1/60 s, whatever h is. Stable for every h, beside what
/// is stable by itself.
struct GoalPull {
  double gain = 0.0;  // 0..1
  double lead = 0.0;  // [s]
};
GoalPull goalPull(double alpha, double h);

/// [1/s^2] With which goals pull back, of each unit of mass, what is out of shape.
double goalStiffness(const Material& material);

/// The share of the fitted goal that acts in a step of h [s]: beta up to 0.95, and less in steps above 0.2 s.
double actingBeta(double beta, double h);

}  // namespace meshless
