#include "meshless_surgery/dynamics/material.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace meshless {
namespace {

Status outOfRange(const char* key, double value, const char* accepted) {
  std::ostringstream text;
  text << key << " is " << value << "; accepted: " << accepted;
  return Error{ErrorCode::kInvalidArgument, text.str()};
}

constexpr double kReferenceStep = 1.0 / 60.0;  // [s] alpha holds there

}  // namespace

const char* toString(SelfContact self_contact) {
  switch (self_contact) {
    case SelfContact::kNone:
      return "none";
    case SelfContact::kWoundFaces:
      return "lips";
    case SelfContact::kAll:
      return "all";
  }
  return "unknown";
}

const char* toString(MatchMode mode) {
  switch (mode) {
    case MatchMode::kRigid:
      return "rigid";
    case MatchMode::kLinear:
      return "linear";
    case MatchMode::kQuadratic:
      return "quadratic";
  }
  return "unknown";
}

double ResponseCurve::at(double error) const {
  if (points.empty()) return 0.0;
  if (error <= points.front()[0]) return points.front()[1];
  for (std::size_t k = 1; k < points.size(); ++k)
    if (error <= points[k][0]) {
      const double share = (error - points[k - 1][0]) / (points[k][0] - points[k - 1][0]);
      return points[k - 1][1] + share * (points[k][1] - points[k - 1][1]);
    }
  return points.back()[1];
}

Status ResponseCurve::validate(const std::string& key) const {
  for (std::size_t k = 0; k < points.size(); ++k) {
    const std::string at = key + "[" + std::to_string(k) + "]";
    const double least = k > 0 ? points[k - 1][0] : 0.0, share = k > 0 ? points[k - 1][1] : 0.0;
    std::ostringstream accepted;
    if (!(points[k][0] >= least && points[k][0] <= 100.0) || (k > 0 && points[k][0] == least)) {
      accepted << (k > 0 ? "above " : "") << least << " to 100, ascending relative errors";
      return outOfRange((at + "[0]").c_str(), points[k][0], accepted.str().c_str());
    }
    if (!(points[k][1] >= share && points[k][1] <= 1.0)) {
      accepted << share << " to 1, shares that never fall";
      return outOfRange((at + "[1]").c_str(), points[k][1], accepted.str().c_str());
    }
  }
  return Done{};
}

Status Material::validate() const {
  if (!(youngs_modulus >= 0.0 && youngs_modulus <= 1e12))
    return outOfRange("youngs_modulus", youngs_modulus, "0 (an appearance material) to 1e12 Pa");
  if (!(poissons_ratio >= 0.0 && poissons_ratio <= 0.49))
    return outOfRange("poissons_ratio", poissons_ratio, "0 to 0.49");
  if (!(stiffening >= 0.0 && stiffening <= 1000.0)) return outOfRange("stiffening", stiffening, "0 (none) to 1000");
  if (!(asymmetry >= -30.0 && asymmetry <= 30.0)) return outOfRange("asymmetry", asymmetry, "-30 to 30");
  if (!(fibres.stiffness >= 0.0 && fibres.stiffness <= 1e12))
    return outOfRange("stiffness of fibres", fibres.stiffness, "0 (none) to 1e12 Pa");
  if (!(fibres.stiffening >= 0.0 && fibres.stiffening <= 1000.0))
    return outOfRange("stiffening of fibres", fibres.stiffening, "0 (none) to 1000");
  if (!(alpha >= 0.0 && alpha <= 1.0)) return outOfRange("alpha", alpha, "0 to 1");
  if (!(beta >= 0.0 && beta <= 1.0)) return outOfRange("beta", beta, "0 to 1");
  if (!(density > 0.0 && density <= 1e6)) return outOfRange("density", density, "above 0 to 1e6 kg/m^3");
  if (!(damping >= 0.0 && damping <= 1e6)) return outOfRange("damping", damping, "0 to 1e6 1/s");
  if (!(friction >= 0.0 && friction <= 10.0)) return outOfRange("friction", friction, "0 to 10");
  if (!(restitution >= 0.0 && restitution <= 1.0)) return outOfRange("restitution", restitution, "0 to 1");
  if (!(toughness >= 0.0 && toughness <= 1e6)) return outOfRange("toughness", toughness, "0 to 1e6 J/m^2");
  if (!(plasticity.yield >= 0.0 && plasticity.yield <= 10.0)) return outOfRange("yield", plasticity.yield, "0 to 10");
  if (!(plasticity.creep >= 0.0 && plasticity.creep <= 1e6))
    return outOfRange("creep", plasticity.creep, "0 (none) to 1e6 1/s");
  if (!(plasticity.maximum >= 0.0 && plasticity.maximum <= 3.0))
    return outOfRange("maximum", plasticity.maximum, "0 to 3");
  if (relaxation.size() > kMostRelaxations)
    return outOfRange("the number of relaxation's branches", static_cast<double>(relaxation.size()), "up to 3");
  double shares = 0.0;
  for (const Relaxation& branch : relaxation) {
    if (!(branch.share > 0.0 && branch.share <= 0.99))
      return outOfRange("relaxation's share", branch.share, "above 0 to 0.99");
    if (!(branch.time >= 1e-4 && branch.time <= 1e6))
      return outOfRange("relaxation's time", branch.time, "1e-4 to 1e6 s");
    shares += branch.share;
  }
  if (!(shares <= 0.99)) return outOfRange("the sum of relaxation's shares", shares, "up to 0.99");
  if (Status status = volume.validate("volume"); !status) return status;
  if (Status status = area.validate("area"); !status) return status;
  for (const Color& c : {color, inside_color})
    for (float channel : {c.r, c.g, c.b, c.a})
      if (!(channel >= 0.0f && channel <= 1.0f)) return outOfRange("a colour's channel", channel, "0 to 1");
  if (Status status = appearance.outer.validate("outer"); !status) return status;
  if (Status status = appearance.inner.validate("inner"); !status) return status;
  return Done{};
}

namespace {

// [1/s] of velocities that goals take, times kReferenceStep; infinite at 1.
double goalRate(double alpha) { return -std::log1p(-alpha); }

}  // namespace

double goalStiffness(const Material& material) {
  const double fitted = material.mode == MatchMode::kRigid ? 0.0 : actingBeta(material.beta, kReferenceStep);
  return (1.0 - fitted) * goalRate(material.alpha) / (kReferenceStep * kReferenceStep);
}

GoalPull goalPull(double alpha, double h) {
  // The place after a substep, of what the goal is 0 for: x1 - gain (x1 + lead v) with x1 = x + h v. gain says how far
  // a steady push goes, and both how much of a velocity is left.
  const double steps = h / kReferenceStep, rate = goalRate(alpha), left = std::exp(-rate * steps);
  const double gain = std::min(rate * steps * steps, 1.0 - left);
  return {gain, gain > 0.0 ? h * (1.0 - left - gain) / gain : 0.0};
}

// Fitted goals alone have no shape to return to: a twentieth of the rigid goal is enough for that, and more with half a
// second in one step.
double actingBeta(double beta, double h) {
  constexpr double kMost = 0.95, kLongStep = 0.2;  // [s]
  return std::min(beta, h > kLongStep ? kMost * kLongStep / h : kMost);
}

}  // namespace meshless
