// Every metric, computed a second time from what the world said after each step and from what the script did: by other
// code, and on the way that docs/metrics.md tells. A metric that is new wants a law in laws().
#include <cmath>
#include <complex>

#include <Eigen/SVD>

#include "shapes/hollow_organs.h"
#include "training/played.h"

namespace meshless {
namespace metrics_law_test {

using test::Played;

constexpr double kRate = 120.0, kNone = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kWindow = 12, kTremor = 240;  // steps of 0.1 and 2 s

struct Law {
  double value = kNone;
  double within = 1e-9;  // of the value
  double least = 1e-12;  // and so much
};

/// A session and what its script knows of it.
struct Session {
  Session(const WorldSettings& settings, const TaskDef& task) : played(settings, task) {}

  void step(int count = 1) {
    for (int k = 0; k < count; ++k) {
      played.step();
      SnapshotWants wants;
      wants.particles = true;
      steps.push_back(played.world.snapshot(wants));
    }
  }
  template <class T>
  T apply(const Command& command) {
    return played.apply<T>(command);
  }

  Played played;
  std::vector<WorldSnapshot> steps;
  std::vector<PickId> picks;         // of the two hands that pick, in their order
  std::map<std::string, Law> known;  // by the script: counts, and what its geometry gives
};

using Way = std::vector<std::optional<Vec3>>;  // of a hand, step by step

Way wayOf(const Session& s, std::size_t hand) {
  Way way;
  bool begun = false;  // an instrument is there from its first move on
  for (const WorldSnapshot& shot : s.steps) {
    std::optional<Vec3> at;
    for (const Pick& pick : shot.picks)
      if (hand < s.picks.size() && pick.id == s.picks[hand]) at = pick.target;
    if (hand == 2 && shot.push.enabled) at = shot.push.position;
    if (hand == 3 && shot.scissors.shown) at = shot.scissors.blades.origin;
    for (std::size_t n = 0; n < shot.instruments.size() && hand >= 4; ++n) {
      const Vec3& tip = shot.instruments[n].pose.translation;
      if (n == hand - 4 && tip != shot.instruments[n].def.pose.translation) begun = true;
      if (n == hand - 4 && begun) at = tip;
    }
    way.push_back(at);
  }
  return way;
}

bool seen(const Way& way) {
  return std::any_of(way.begin(), way.end(), [](const auto& at) { return at.has_value(); });
}

/// The step in which it came, of the presence that step k is of.
std::size_t cameAt(const Way& way, std::size_t k) {
  while (k > 0 && way[k - 1]) --k;
  return k;
}

bool moves(const Way& way, std::size_t k) {
  if (!way[k]) return false;
  const std::size_t from = std::max(cameAt(way, k), k < kWindow ? 0 : k - kWindow);
  return (*way[k] - *way[from]).norm() > 0.005 * static_cast<double>(k - from) / kRate;
}

double pathOf(const Way& way) {
  double path = 0.0;
  for (std::size_t k = 1; k < way.size(); ++k)
    if (way[k] && way[k - 1]) path += (*way[k] - *way[k - 1]).norm();
  return path;
}

/// [m/s] of each movement.
std::vector<Points> movementsOf(const Way& way) {
  std::vector<Points> all;
  for (std::size_t k = 1; k < way.size(); ++k) {
    if (!moves(way, k)) continue;
    std::size_t from = k;
    if (k == 0 || !moves(way, k - 1)) {
      all.emplace_back();
      from = std::max(cameAt(way, k), k < kWindow ? 0 : k - kWindow) + 1;
    }
    for (; from <= k; ++from) all.back().push_back(kRate * (*way[from] - *way[from - 1]));
  }
  return all;
}

double byDuration(const std::vector<Points>& movements, const std::function<double(const Points&)>& of) {
  double sum = 0.0, whole = 0.0;
  for (const Points& movement : movements)
    if (const double value = of(movement); std::isfinite(value)) {
      sum += static_cast<double>(movement.size()) * value;
      whole += static_cast<double>(movement.size());
    }
  return sum / whole;
}

double sparc(const Points& movement) {
  const double size = 16.0 * std::pow(2.0, std::ceil(std::log2(static_cast<double>(movement.size()))));
  std::vector<double> spectrum;
  for (int bin = 0; bin * kRate / size <= 10.0; ++bin) {
    std::complex<double> sum = 0.0;
    for (std::size_t k = 0; k < movement.size(); ++k)
      sum += movement[k].norm() * std::polar(1.0, -2.0 * M_PI * bin * static_cast<double>(k) / size);
    spectrum.push_back(std::abs(sum));
  }
  const double top = spectrum[0];  // speeds are not below 0
  while (spectrum.back() < 0.05 * top) spectrum.pop_back();
  double arc = 0.0;
  for (std::size_t k = 1; k < spectrum.size(); ++k)
    arc += std::sqrt(std::pow((spectrum[k] - spectrum[k - 1]) / top, 2) +
                     std::pow(1.0 / static_cast<double>(spectrum.size() - 1), 2));
  return -arc;
}

double ldlj(const Points& movement) {
  if (movement.size() < 4) return kNone;
  double peak = 0.0, integral = 0.0;
  for (const Vec3& v : movement) peak = std::max(peak, v.norm());
  for (std::size_t k = 2; k < movement.size(); ++k) {
    const Vec3 jerk = ((movement[k] - movement[k - 1]) - (movement[k - 1] - movement[k - 2])) * kRate * kRate;
    integral += jerk.squaredNorm() / kRate;
  }
  const double time = static_cast<double>(movement.size()) / kRate;
  return -std::log(std::pow(time, 3) / (peak * peak) * integral);
}

double tremor(const Way& way) {
  double sum = 0.0, windows = 0.0;
  for (std::size_t k = 0; k < way.size(); ++k) {
    if (!way[k]) continue;
    const std::size_t lived = k - cameAt(way, k) + 1;
    if (lived < kTremor || (lived - kTremor) % (kTremor / 2) != 0) continue;
    Eigen::MatrixXd line(kTremor, 2), at(kTremor, 3);
    Eigen::VectorXd hann(kTremor);
    for (Eigen::Index n = 0; n < static_cast<Eigen::Index>(kTremor); ++n) {
      line.row(n) << 1.0, static_cast<double>(n);
      at.row(n) = *way[k + 1 - kTremor + static_cast<std::size_t>(n)];
      hann[n] = std::pow(std::sin(M_PI * static_cast<double>(n) / kTremor), 2);
    }
    at -= line * line.colPivHouseholderQr().solve(at);
    double power = 0.0;
    for (int half_hertz = 8; half_hertz <= 28; ++half_hertz)
      for (int axis = 0; axis < 3; ++axis) {
        std::complex<double> part = 0.0;
        for (Eigen::Index n = 0; n < static_cast<Eigen::Index>(kTremor); ++n)
          part += hann[n] * at(n, axis) * std::polar(1.0, -2.0 * M_PI * half_hertz * static_cast<double>(n) / kTremor);
        power += std::norm(part);
      }
    sum += 4.0 * power / (kTremor * hann.squaredNorm());
    windows += 1.0;
  }
  return std::sqrt(sum / windows);
}

std::vector<double> forcesOf(const Session& s) {
  std::vector<double> forces;
  for (const WorldSnapshot& shot : s.steps) {
    double most = shot.push.enabled ? shot.push.force.norm() : 0.0;
    for (const Pick& pick : shot.picks) most = std::max(most, pick.force.norm());
    for (const Instrument& of : shot.instruments) most = std::max(most, of.force.norm());
    forces.push_back(most);
  }
  return forces;
}

/// [N] of all tools together, where one is at work.
std::vector<double> togetherOf(const Session& s) {
  std::vector<double> forces;
  for (const WorldSnapshot& shot : s.steps) {
    double sum = shot.push.enabled ? shot.push.force.norm() : 0.0;
    for (const Pick& pick : shot.picks) sum += pick.force.norm();
    for (const Instrument& of : shot.instruments) sum += of.force.norm();
    if (sum > 1e-6) forces.push_back(sum);
  }
  return forces;
}

/// [m] that the one body falls between two grasps, seen ten times a second.
double fallOf(const Session& s) {
  double most = 0.0, highest = -1e300;
  bool was_held = false, let_go = false;
  for (const WorldSnapshot& shot : s.steps) {
    if (shot.step % kWindow != 0) continue;
    const BodySnapshot& body = shot.bodies.front();
    double moment = 0.0, mass = 0.0;
    for (std::size_t i = 0; i < body.particles.size(); ++i) {
      moment += body.model->masses[i] * body.particles[i].z();
      mass += body.model->masses[i];
    }
    const bool held = !shot.picks.empty();
    let_go = !held && (let_go || was_held);
    highest = held ? moment / mass : std::max(highest, moment / mass);
    if (let_go) most = std::max(most, highest - moment / mass);
    was_held = held;
  }
  return most;
}

/// Of cells that are filled, in a body that began at rest: the largest |stretch - 1|, and the volume beyond the limit.
std::pair<double, double> strainOf(const Session& s) {
  double most = 0.0, volume = 0.0;
  for (const WorldSnapshot& shot : s.steps) {
    if (shot.step % kWindow != 0) continue;
    double beyond = 0.0;
    for (const BodySnapshot& body : shot.bodies) {
      const CellLattice& lattice = *body.model->lattice;
      for (const LatticeCell& cell : lattice.cells) {
        Mat3 gradient = Mat3::Zero();
        for (int corner = 0; corner < 8; ++corner)
          for (int axis = 0; axis < 3; ++axis)
            gradient.col(axis) += (corner >> axis & 1 ? 0.25 : -0.25) / lattice.spacing *
                                  body.particles[cell.corners[static_cast<std::size_t>(corner)]];
        const Vec3 stretches = Eigen::JacobiSVD<Mat3>(gradient).singularValues();
        const double strain = (stretches - Vec3::Ones()).cwiseAbs().maxCoeff();
        most = std::max(most, strain);
        if (strain > s.played.training.task().limits.measured.strain) beyond += std::pow(lattice.spacing, 3);
      }
    }
    volume = std::max(volume, beyond);
  }
  return {most, volume};
}

struct Line {
  Vec3 from, to;
  double radius;
};
std::vector<std::pair<std::string, Line>> toolsOf(const WorldSnapshot& shot) {
  std::vector<std::pair<std::string, Line>> tools;
  for (const Pick& pick : shot.picks)
    tools.push_back({"pick " + std::to_string(pick.id), {pick.target, pick.position, 0.0025}});
  if (shot.push.enabled) tools.push_back({"push", {shot.push.position, shot.push.position, shot.push.radius}});
  const ScissorBlades& blades = shot.scissors.blades;
  if (shot.scissors.shown)
    tools.push_back({"scissors", {blades.origin, blades.origin + blades.length * blades.x_axis, 0.0025}});
  for (const Instrument& of : shot.instruments) {
    const double length = of.def.shaft_length + (of.def.type == InstrumentType::kGrasper ? of.def.jaw_length : 0.0);
    tools.push_back({of.def.name, {of.pose.translation, of.pose * Vec3(-length, 0, 0), of.def.shaft_radius}});
  }
  return tools;
}
double distance(const Line& a, const Line& b) {
  const auto toB = [&](double share) {
    const Vec3 p = a.from + share * (a.to - a.from), way = b.to - b.from;
    const double along = way.squaredNorm() > 0.0 ? (p - b.from).dot(way) / way.squaredNorm() : 0.0;
    return (p - b.from - std::min(1.0, std::max(0.0, along)) * way).norm();
  };
  double low = 0.0, high = 1.0;  // the distance is convex
  for (int k = 0; k < 100; ++k) {
    const double third = (high - low) / 3.0;
    (toB(low + third) < toB(high - third) ? high : low) =
        toB(low + third) < toB(high - third) ? high - third : low + third;
  }
  return toB(0.5 * (low + high));
}
double crossingsOf(const Session& s) {
  double count = 0.0;
  std::set<std::string> near;
  for (const WorldSnapshot& shot : s.steps) {
    std::set<std::string> now;
    const auto tools = toolsOf(shot);
    for (std::size_t i = 0; i < tools.size(); ++i)
      for (std::size_t j = i + 1; j < tools.size(); ++j)
        if (distance(tools[i].second, tools[j].second) < tools[i].second.radius + tools[j].second.radius)
          now.insert(tools[i].first + tools[j].first);
    for (const std::string& pair : now) count += !near.count(pair);
    near = now;
  }
  return count;
}

/// Steps in which a tool is in the forbidden region, and how often one came there.
std::pair<double, double> forbiddenOf(const Session& s) {
  double steps = 0.0, came = 0.0;
  bool was = false;
  for (const WorldSnapshot& shot : s.steps) {
    bool there = false;
    for (const auto& [name, line] : toolsOf(shot))
      for (const Forbidden& forbidden : s.played.training.task().limits.measured.forbidden)
        there = there || (forbidden.body.empty() && forbidden.region.contains(line.from));
    steps += there;
    came += there && !was;
    was = there;
  }
  return {steps, came};
}

double stepsWithHands(const Session& s, const std::function<bool(double)>& that) {
  double count = 0.0;
  std::array<Way, kHands> ways;
  for (std::size_t hand = 0; hand < kHands; ++hand) ways[hand] = wayOf(s, hand);
  for (std::size_t k = 0; k < s.steps.size(); ++k) {
    double moving = 0.0;
    for (const Way& way : ways) moving += moves(way, k);
    count += that(moving);
  }
  return count;
}

using Compute = std::function<Law(const Session&, std::size_t hand)>;

Compute knownAs(const std::string& name, double otherwise) {
  return [name, otherwise](const Session& s, std::size_t) {
    const auto found = s.known.find(name);
    return found == s.known.end() ? Law{otherwise} : found->second;
  };
}
Compute ofWay(const std::function<double(const Way&)>& compute) {
  return [compute](const Session& s, std::size_t hand) {
    const Way way = wayOf(s, hand);
    return Law{seen(way) ? compute(way) : kNone, 1e-6};
  };
}

/// By the names of the rows of metricTable().
const std::map<std::string, Compute>& laws() {
  static const std::map<std::string, Compute> all{
      {"time", [](const Session& s, std::size_t) { return Law{static_cast<double>(s.steps.size()) / kRate}; }},
      {"wall_time", knownAs("wall_time", kNone)},
      {"real_time_factor", knownAs("real_time_factor", kNone)},
      {"idle_time",
       [](const Session& s, std::size_t) {
         return Law{stepsWithHands(s, [](double moving) { return moving == 0.0; }) / kRate};
       }},
      {"stages", knownAs("stages", 0.0)},
      {"path_length", ofWay(pathOf)},
      {"economy", ofWay([](const Way& way) {
         double straight = 0.0;
         for (std::size_t k = 0; k < way.size(); ++k)
           if (way[k] && (k + 1 == way.size() || !way[k + 1])) straight += (*way[k] - *way[cameAt(way, k)]).norm();
         return straight / pathOf(way);
       })},
      {"workspace", ofWay([](const Way& way) {
         Vec3 mean = Vec3::Zero();
         double count = 0.0;
         for (const auto& at : way)
           if (at) {
             mean += *at;
             count += 1.0;
           }
         mean /= count;
         Mat3 covariance = Mat3::Zero();
         for (const auto& at : way)
           if (at) covariance += (*at - mean) * (*at - mean).transpose() / count;
         const Vec3 spreads = Eigen::JacobiSVD<Mat3>(covariance).singularValues();
         return 4.0 / 3.0 * M_PI * (5.0 * spreads).cwiseSqrt().prod();
       })},
      {"mean_speed", ofWay([](const Way& way) {
         double path = 0.0, time = 0.0;
         for (std::size_t k = 1; k < way.size(); ++k)
           if (moves(way, k)) {
             path += (*way[k] - *way[k - 1]).norm();
             time += 1.0 / kRate;
           }
         return path / time;
       })},
      {"top_speed", ofWay([](const Way& way) {
         double most = 0.0;
         for (std::size_t k = 1; k < way.size(); ++k)
           if (way[k] && way[k - 1]) most = std::max(most, kRate * (*way[k] - *way[k - 1]).norm());
         return most;
       })},
      {"movements", ofWay([](const Way& way) { return static_cast<double>(movementsOf(way).size()); })},
      {"sparc", ofWay([](const Way& way) { return byDuration(movementsOf(way), sparc); })},
      {"ldlj", ofWay([](const Way& way) { return byDuration(movementsOf(way), ldlj); })},
      {"tremor", ofWay(tremor)},
      {"angular_path",
       [](const Session& s, std::size_t hand) {
         double turned = 0.0;
         bool any = false;
         for (std::size_t k = 0; k < s.steps.size(); ++k) {
           any = any || s.steps[k].scissors.shown;
           if (k == 0 || !s.steps[k].scissors.shown || !s.steps[k - 1].scissors.shown) continue;
           const ScissorBlades &a = s.steps[k - 1].scissors.blades, &b = s.steps[k].scissors.blades;
           const double trace =
               a.x_axis.dot(b.x_axis) + a.y_axis.dot(b.y_axis) + a.x_axis.cross(a.y_axis).dot(b.x_axis.cross(b.y_axis));
           turned += std::acos(std::min(1.0, 0.5 * (trace - 1.0)));
         }
         if (hand < 4) return Law{hand == 3 && any ? turned : kNone, 1e-6};
         const Way way = wayOf(s, hand);
         double by = 0.0;
         for (std::size_t k = 1; k < way.size(); ++k)
           if (way[k] && way[k - 1])
             by += s.steps[k].instruments[hand - 4].pose.rotation.angularDistance(
                 s.steps[k - 1].instruments[hand - 4].pose.rotation);
         return Law{seen(way) ? by : kNone, 1e-6};
       }},
      {"force_mean",
       [](const Session& s, std::size_t) {
         double sum = 0.0, count = 0.0;
         for (const double force : forcesOf(s)) {
           if (!(force > 1e-6)) continue;
           sum += force;
           count += 1.0;
         }
         return Law{sum / count};
       }},
      {"force_peak",
       [](const Session& s, std::size_t) {
         const std::vector<double> forces = forcesOf(s);
         return Law{*std::max_element(forces.begin(), forces.end())};
       }},
      {"impulse",
       [](const Session& s, std::size_t) {
         double sum = 0.0;
         for (const double force : forcesOf(s)) sum += force / kRate;
         return Law{sum, 1e-4};
       }},
      {"force_together_peak",
       [](const Session& s, std::size_t) {
         const std::vector<double> forces = togetherOf(s);
         return Law{forces.empty() ? 0.0 : *std::max_element(forces.begin(), forces.end())};
       }},
      {"force_together_mean",
       [](const Session& s, std::size_t) {
         double sum = 0.0;
         for (const double force : togetherOf(s)) sum += force;
         return Law{sum / static_cast<double>(togetherOf(s).size())};
       }},
      {"force_time_above",
       [](const Session& s, std::size_t) {
         const double limit = s.played.training.task().limits.measured.force;
         double above = 0.0;
         for (const double force : forcesOf(s)) above += force > limit;
         return Law{std::isfinite(limit) ? above / kRate : kNone};
       }},
      {"strain_peak",
       [](const Session& s, std::size_t) {
         return s.played.training.task().wantsStrain() ? Law{strainOf(s).first, 1e-6} : Law{};
       }},
      {"strained_volume",
       [](const Session& s, std::size_t) {
         return s.played.training.task().wantsStrain() ? Law{strainOf(s).second, 1e-6} : Law{};
       }},
      {"volume_removed", knownAs("volume_removed", 0.0)},
      {"healthy_share", knownAs("healthy_share", kNone)},
      {"target_left", knownAs("target_left", kNone)},
      {"cut_area", knownAs("cut_area", 0.0)},
      {"cuts", knownAs("cuts", 0.0)},
      {"strokes", knownAs("strokes", 0.0)},
      {"plan_rms", knownAs("plan_rms", kNone)},
      {"plan_hausdorff", knownAs("plan_hausdorff", kNone)},
      {"off_plan_area", knownAs("off_plan_area", kNone)},
      {"plan_done", knownAs("plan_done", kNone)},
      {"margin_least", knownAs("margin_least", kNone)},
      {"margin_mean", knownAs("margin_mean", kNone)},
      {"clip_distance", knownAs("clip_distance", kNone)},
      {"drops", knownAs("drops", 0.0)},
      {"out_of_view", knownAs("out_of_view", kNone)},
      {"grasps", knownAs("grasps", 0.0)},
      {"picks_at_once",
       [](const Session& s, std::size_t) {
         std::size_t most = 0;
         for (const WorldSnapshot& shot : s.steps) most = std::max(most, shot.picks.size());
         return Law{static_cast<double>(most)};
       }},
      {"drop_height",
       [](const Session& s, std::size_t) {
         return s.played.training.task().looksAt("drop_height") ? Law{fallOf(s)} : Law{};
       }},
      {"undos", knownAs("undos", 0.0)},
      {"torn",
       [](const Session& s, std::size_t) {
         // The first fibre, and the last one.
         double count = 0.0;
         std::map<std::string, bool> begun, ended;
         for (std::size_t k = 0; k < s.steps.size(); ++k) {
           std::map<std::string, std::size_t> left;
           for (const AttachmentSnapshot& joint : s.steps[k].attachments) {
             if (joint.jaws) continue;
             left[joint.name] = joint.fibres;
             if (joint.fibres < joint.made && !std::exchange(begun[joint.name], true)) count += 1.0;
             if (joint.fibres == 0 && !std::exchange(ended[joint.name], true)) count += 1.0;
           }
           if (k > 0)
             for (const AttachmentSnapshot& joint : s.steps[k - 1].attachments)
               if (!joint.jaws && joint.fibres > 0 && !left.count(joint.name) &&
                   !std::exchange(ended[joint.name], true))
                 count += 1.0;
         }
         return Law{count};
       }},
      {"leaks", knownAs("leaks", 0.0)},
      {"bleeding_time", knownAs("bleeding_time", kNone)},
      {"forbidden_contacts",
       [](const Session& s, std::size_t) {
         if (s.played.training.task().limits.measured.forbidden.empty()) return Law{};
         const auto cut = s.known.find("forbidden_cuts");
         return Law{forbiddenOf(s).second + (cut == s.known.end() ? 0.0 : cut->second.value)};
       }},
      {"forbidden_time",
       [](const Session& s, std::size_t) {
         return s.played.training.task().limits.measured.forbidden.empty() ? Law{} : Law{forbiddenOf(s).first / kRate};
       }},
      {"instrument_crossings", [](const Session& s, std::size_t) { return Law{crossingsOf(s)}; }},
      {"hands_share",
       [](const Session& s, std::size_t) {
         std::vector<double> paths;
         for (std::size_t hand = 0; hand < kHands; ++hand) paths.push_back(pathOf(wayOf(s, hand)));
         std::sort(paths.rbegin(), paths.rend());
         double all = 0.0;
         for (const double path : paths) all += path;
         return Law{all > 0.0 ? paths[1] / all : kNone};
       }},
      {"hands_overlap",
       [](const Session& s, std::size_t) {
         const double one = stepsWithHands(s, [](double moving) { return moving > 0.0; });
         return Law{one > 0.0 ? stepsWithHands(s, [](double moving) { return moving > 1.0; }) / one : kNone};
       }},
  };
  return all;
}

/// Rows whose value was there and not 0, in any session: twice as large would have been seen.
std::set<std::string>& told() {
  static std::set<std::string> rows;
  return rows;
}

void check(const Session& s) {
  for (const MetricValue& metric : s.played.training.values()) {
    const std::string row = metric.name.substr(0, metric.name.find('.'));
    std::size_t hand = 0;
    while (hand + 1 < kHands && metric.name != row + "." + toString(static_cast<Hand>(hand))) ++hand;
    const auto law = laws().find(row);
    ASSERT_NE(laws().end(), law) << "no law computes " << row;
    const Law should = law->second(s, hand);
    if (std::isnan(should.value)) {
      EXPECT_TRUE(std::isnan(metric.value)) << metric.name << " is " << metric.value << "; there is nothing to measure";
      continue;
    }
    EXPECT_NEAR(should.value, metric.value, should.within * std::abs(should.value) + should.least) << metric.name;
    if (metric.value != 0.0) told().insert(row);
  }
}

TaskDef task() {
  TaskDef task = test::openTask();
  task.stages.insert(task.stages.begin(), Stage{"nothing", "", LetGo{}, 0.05});
  return task;
}

BodyDef cellBlock(const std::string& name, const Vec3& at) {
  BodyDef def = test::block(name, at);
  def.material.youngs_modulus = 2e3;
  def.material.damping = 20.0;
  def.spacing = 0.025;  // fills its cells
  return def;
}

void ofHands() {
  TaskDef def = task();
  def.limits.measured.force = 0.5;
  def.limits.measured.strain = 0.05;
  def.limits.measured.forbidden.push_back({"wall", "", Region(Vec3(-1, -1, 0.285), Vec3(1, 1, 1))});
  def.metrics.push_back({"strain_peak", 1.0, 0.1, 1.0, {}});
  Session s(test::weightless(), def);
  ASSERT_TRUE(s.played.world.addSceneBody(test::shared(cellBlock("block", Vec3(0, 0, 0.2)))).ok());
  s.played.begin();
  s.step(24);
  s.known["stages"] = {1.0};
  const auto grasp = [&](const Vec3& at) {
    PickCommand pick;
    pick.point = at;
    pick.max_distance = 0.05;
    pick.stiffness = 100.0;
    const auto picked = s.apply<PickReply>(pick);
    s.picks.push_back(picked.pick);
    return picked;
  };
  const auto smooth = [](double u) { return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u); };
  const auto first = grasp(Vec3(-0.05, 0, 0.25));
  // Up into the forbidden region and down, twice, with a tremor.
  const auto firstAt = [&](int k) -> Vec3 {
    const double t = k / kRate, u = std::fmod(t, 1.5) / 1.5;
    return first.position + Vec3(0.01 * t, 0.002 * t, 0.04 * smooth(u < 0.5 ? 2.0 * u : 2.0 - 2.0 * u)) +
           0.0005 * std::sin(2.0 * M_PI * 8.0 * t) * Vec3(0.6, 0.8, 0.0);
  };
  int k = 0;
  for (; k < 180; ++k) {
    s.apply<Done>(MovePickCommand{first.pick, firstAt(k)});
    s.step();
  }
  // A second hand, which crosses the first one's shaft, and leaves.
  const auto second = grasp(Vec3(0.05, 0, 0.25));
  for (int n = 0; n < 300; ++n, ++k) {
    const Vec3 beside = firstAt(k) + Vec3(0.0, 0.0, -0.004);
    const double u = smooth(std::min(1.0, n / 120.0));
    s.apply<Done>(MovePickCommand{first.pick, firstAt(k)});
    s.apply<Done>(MovePickCommand{second.pick, (1.0 - u) * second.position + u * beside});
    s.step();
  }
  s.apply<Done>(LiftCommand{ToolKind::kPick, false, "its stream was silent"});
  s.known["drops"] = {1.0};
  s.known["grasps"] = {2.0};
  s.step(60);
  check(s);
  // The push sphere, and scissors that turn.
  PushCommand push;
  push.radius = 0.02;
  push.position = Vec3(0.09, 0.0, 0.275);
  for (int n = 0; n < 300; ++n) {
    push.position = Vec3(0.09, 0.01 * n / 300.0, 0.275 - 0.02 * smooth(n / 300.0));
    s.apply<Done>(push);
    ScissorBlades blades;
    const Quat turn(Eigen::AngleAxisd(0.004 * n, Vec3(0.3, 0.5, 0.8).normalized()));
    blades.origin = Vec3(-0.2, 0.05 * smooth(n / 300.0), 0.2 + 0.02 * std::sin(0.02 * n));
    blades.x_axis = turn * Vec3::UnitX();
    blades.y_axis = turn * Vec3::UnitY();
    blades.length = 0.03;
    blades.width = 0.02;
    s.played.world.setScissors(blades, 0.3);
    s.step();
  }
  s.apply<Done>(LiftCommand{});
  push.enable = false;
  s.apply<Done>(push);
  s.step(30);
  // Two instruments: one lies there, is taken up and turned, and crosses the other, which presses the block.
  const Quat down(Eigen::AngleAxisd(0.5 * M_PI, Vec3::UnitY()));
  for (const bool left : {true, false}) {
    AttachInstrumentCommand attach;
    attach.def.name = left ? "left" : "right";
    attach.def.type = left ? InstrumentType::kGrasper : InstrumentType::kProbe;
    attach.def.pose = {down, Vec3(left ? -0.2 : 0.2, 0.0, 0.35)};
    s.apply<Done>(attach);
  }
  s.step(20);
  for (int n = 1; n <= 240; ++n) {
    const double u = smooth(n / 240.0);
    LeadInstrumentCommand lead;
    lead.name = "left";
    lead.pose = Pose{Quat(Eigen::AngleAxisd(0.5 * M_PI + 0.8 * u, Vec3::UnitY())), Vec3(-0.2 + 0.2 * u, 0.02, 0.35)};
    s.apply<Done>(lead);
    lead.name = "right";
    lead.pose = Pose{down, Vec3(0.2 - 0.17 * u, 0.02, 0.35 - 0.13 * smooth(std::min(1.0, n / 200.0)))};
    s.apply<Done>(lead);
    s.step();
  }
  s.step(20);
  s.played.training.stop();
  check(s);
}

/// Mean over the cut face of the block, by a grid.
double overFace(const std::function<double(double y, double z)>& of) {
  double sum = 0.0;
  constexpr int kGrid = 400;
  for (int i = 0; i < kGrid; ++i)
    for (int j = 0; j < kGrid; ++j)
      sum += of(-0.05 + 0.1 * (i + 0.5) / kGrid, -0.05 + 0.1 * (j + 0.5) / kGrid) / (kGrid * kGrid);
  return sum;
}

void ofCuts() {
  TaskDef def = task();
  // Half of the section at x = 0, and of that the upper half.
  CutPlan plan;
  plan.body = "block";
  plan.origin = Vec3(0.0, -0.05, 0.25);
  plan.along = Vec3::UnitY();
  plan.length = 0.05;
  plan.depth = 0.05;
  plan.tolerance = 0.005;
  def.plan = plan;
  def.target = Target{"block", Region(Vec3(0.05, -0.02, 0.18), Vec3(0.07, 0.02, 0.22))};
  def.limits.measured.forbidden.push_back({"other", "other", {}});
  Session s(test::weightless(), def);
  ASSERT_TRUE(s.played.world.addSceneBody(test::shared(cellBlock("block", Vec3(0, 0, 0.2)))).ok());
  ASSERT_TRUE(s.played.world.addSceneBody(test::shared(cellBlock("other", Vec3(0, 0.5, 0.2)))).ok());
  s.played.begin();
  s.step(24);
  s.known["stages"] = {1.0};
  s.known["target_left"] = {1.0, 1e-3};
  s.known["off_plan_area"] = {0.0};
  s.known["plan_done"] = {0.0};
  check(s);
  // A wound of 20 mm of the plan's 50, as deep as it.
  InciseCommand incise;
  incise.blade = {Vec3(0.0, -0.06, 0.26), Vec3::UnitY(), Vec3::UnitZ(), 0.03, 0.06};
  incise.bodies = {"block"};
  s.apply<InciseReply>(incise);
  s.step(3);
  s.known["strokes"] = {1.0};
  s.known["cut_area"] = {0.02 * 0.05, 0.01};
  s.known["plan_done"] = {(0.02 + 0.005) / 0.05, 0.05};  // and the tolerance beside its end
  s.known["plan_rms"] = {0.0};
  s.known["plan_hausdorff"] = {0.03, 0.05};
  s.known["margin_least"] = {0.05, 0.03};  // of samples of the cut
  // On the wound: y from -0.05 to -0.03, z from the middle up to 0.05 above it.
  double mean = 0.0;
  for (int i = 0; i < 200; ++i)
    for (int j = 0; j < 200; ++j)
      mean += std::hypot(0.05, -0.02 - (-0.05 + 0.02 * (i + 0.5) / 200), std::max(0.0, 0.05 * (j + 0.5) / 200 - 0.02)) /
              40000;
  s.known["margin_mean"] = {mean, 0.01};
  check(s);
  s.apply<UndoCutReply>(UndoCutCommand{});
  s.step(3);
  s.known["undos"] = {1.0};
  s.known["cut_area"] = {0.0};
  s.known["plan_done"] = {0.0};
  for (const char* name : {"plan_rms", "plan_hausdorff", "margin_least", "margin_mean"}) s.known.erase(name);
  check(s);
  // Right through both bodies, 4 mm beside the plan; the piece with the target is taken away in the same step.
  CutCommand cut;
  cut.blades.origin = Vec3(0.004, -1, 0.2);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3::UnitZ();
  s.apply<CutReply>(cut);
  std::string piece;
  for (const BodySnapshot& body : s.played.world.snapshot({}).bodies)
    if (isOf(body.name, "block") && body.model->rest_volume < 1e-3) piece = body.name;
  s.apply<Done>(RemoveCommand{piece});
  s.step(3);
  s.known["cuts"] = {1.0};
  s.known["forbidden_cuts"] = {1.0};
  s.known["cut_area"] = {0.02, 0.01};  // of both
  s.known["volume_removed"] = {0.096 * 0.01, 1e-3};
  s.known["healthy_share"] = {1.0 - 0.02 * 0.04 * 0.04 / (0.096 * 0.01), 1e-3};
  s.known["target_left"] = {0.0, 0.0, 1e-3};
  const auto off = [](double y, double z) { return std::hypot(0.004, std::max(0.0, y), std::min(0.0, z)); };
  s.known["plan_rms"] = {std::sqrt(overFace([&](double y, double z) { return std::pow(off(y, z), 2); })), 0.01};
  s.known["plan_hausdorff"] = {off(0.05, -0.05), 0.03};
  s.known["off_plan_area"] = {0.01 * overFace([&](double y, double z) { return off(y, z) > 0.005 ? 1.0 : 0.0; }), 0.02};
  s.known["plan_done"] = {1.0};
  const auto margin = [](double y, double z) {
    return std::hypot(0.046, std::max(0.0, std::abs(y) - 0.02), std::max(0.0, std::abs(z) - 0.02));
  };
  s.known["margin_least"] = {0.046, 0.03};
  s.known["margin_mean"] = {overFace(margin), 0.01};
  check(s);
}

void ofVesselsCavitiesAndAttachments() {
  TaskDef def = task();
  def.stages.push_back({"clip", "", Clipped{"vessel", {}}, 0.0});
  def.target = Target{"ball", Region::sphere(Vec3(1, 0, 0), 0.05)};
  WorldSettings settings = test::weightless();
  settings.max_substeps = 8;
  Session s(settings, def);
  BodyDef vessel = test::defOf(vesselMesh(), "vessel");
  vessel.spacing = 0.002;
  vessel.material.youngs_modulus = 2e4;
  vessel.material.damping = 20.0;
  for (const double x : {-0.025, 0.025})
    vessel.fixed.push_back(HeldRegion(Vec3(x - 0.004, -0.01, -0.01), Vec3(x + 0.004, 0.01, 0.01)));
  ASSERT_TRUE(s.played.world.addSceneBody(test::shared(vessel)).ok());
  TriangleMesh wall = sphereMesh(0.03, 0.008);
  shapes::append(wall, shapes::turnedInsideOut(sphereMesh(0.02, 0.008)), Vec3::Zero());
  BodyDef bladder = test::defOf(wall, "bladder");
  bladder.pose.translation = Vec3(0, 0.3, 0);
  bladder.spacing = 0.01;
  bladder.material.youngs_modulus = 1e4;
  bladder.material.damping = 20.0;
  bladder.cavities.kind = CavityFill::Kind::kPressure;
  bladder.cavities.pressure = 50.0;
  ASSERT_TRUE(s.played.world.addSceneBody(test::shared(bladder)).ok());
  ASSERT_TRUE(s.played.world.addSceneBody(test::shared(test::ball("ball", Vec3(1, 0, 0)))).ok());
  AttachCommand joint;
  joint.name = "joint";
  joint.body = "ball";
  joint.other = kWorldEnd;
  joint.stiffness = 1e4;
  joint.strength = 20.0;
  joint.region = Region::sphere(Vec3(1, 0, 0.1), 0.04);
  ASSERT_TRUE(s.played.world.addSceneAttachment(joint).ok());
  s.played.begin();
  s.step(12);
  s.known["stages"] = {1.0};
  s.known["bleeding_time"] = {0.0};
  s.known["target_left"] = {1.0};
  check(s);
  // Cut twice with no clip on: the two ends bleed, the piece between them does not.
  double area = 0.0;
  for (const double x : {-0.003, 0.003}) {
    CutCommand cut;
    cut.blades.origin = Vec3(x, -0.1, 0);
    cut.blades.x_axis = Vec3::UnitY();
    cut.blades.y_axis = Vec3::UnitZ();
    cut.blades.length = 0.2;
    cut.blades.width = 0.2;
    area += s.apply<CutReply>(cut).cap_area;
    s.step(6);
  }
  s.known["cuts"] = {2.0};
  s.known["cut_area"] = {area, 0.01};
  s.known["bleeding_time"] = {12.0 / kRate};
  check(s);
  for (const double x : {-0.012, 0.012}) {
    ClipCommand clip;
    clip.point = Vec3(x, 0, 0);
    clip.width = 0.003;
    s.apply<ClipReply>(clip);
    s.step(2);
  }
  s.step(60);
  s.known["bleeding_time"] = {14.0 / kRate};
  s.known["clip_distance"] = {1.012, 1e-3};
  check(s);
  // The bladder is opened.
  CutCommand open;
  open.blades.origin = Vec3(-1, 0.3, 0.001);
  open.blades.x_axis = Vec3::UnitX();
  open.blades.y_axis = Vec3::UnitY();
  open.blades.width = 0.2;
  area += s.apply<CutReply>(open).cap_area;
  s.step(3);
  s.known["cuts"] = {3.0};
  s.known["cut_area"] = {area, 0.01};
  s.known["leaks"] = {1.0};
  check(s);
  // The ball is torn off.
  PickCommand pick;
  pick.point = Vec3(1, 0, -0.1);
  pick.max_distance = 0.05;
  const auto picked = s.apply<PickReply>(pick);
  s.picks.push_back(picked.pick);
  for (int k = 0; k < 120; ++k) {
    s.apply<Done>(MovePickCommand{picked.pick, picked.position - 0.001 * k * Vec3::UnitZ()});
    s.step();
  }
  s.known["grasps"] = {1.0};
  s.played.training.stop();
  check(s);
}

/// A block is lifted, dropped, caught in the air and laid down, while somebody watches a clock that is half as fast.
void ofFalls() {
  TaskDef def = task();
  def.metrics.push_back({"drop_height", 1.0, 0.0, 1.0, {}});
  def.view = Box{Vec3(-1, -1, 0.1), Vec3(1, 1, 1)};
  def.stages.push_back({"never", "", PutOn{{"block"}, {"peg"}, false}, 0.0});
  WorldSettings settings;
  settings.ground = 0.0;
  Session s(settings, def);
  ASSERT_TRUE(s.played.world.addSceneBody(test::shared(cellBlock("block", Vec3(0, 0, 0.06)))).ok());
  s.played.begin();
  const auto pass = [&](int steps) {
    for (int k = 0; k < steps; ++k) {
      s.played.world.setWallTime(1e9 + 2.0 / kRate * static_cast<double>(s.steps.size()));
      s.step();
    }
  };
  pass(60);
  const auto grasp = [&] {
    PickCommand pick;
    pick.point = Vec3(0, 0, 0.2);
    pick.max_distance = 0.2;
    const auto picked = s.apply<PickReply>(pick);
    s.picks = {picked.pick};
    return picked;
  };
  for (const double up : {0.2, 0.1}) {
    const auto picked = grasp();
    for (int k = 1; k <= 60; ++k) {
      s.apply<Done>(MovePickCommand{picked.pick, picked.position + up / 60.0 * k * Vec3::UnitZ()});
      pass(1);
    }
    pass(60);
    s.apply<Done>(ReleaseCommand{picked.pick});
    s.picks.clear();
    pass(13);
  }
  pass(60);
  const double time = static_cast<double>(s.steps.size()) / kRate;
  s.known["stages"] = {1.0};
  s.known["grasps"] = {2.0};
  s.known["drops"] = {1.0};  // the first time it was caught
  s.known["out_of_view"] = {1.0};
  s.known["wall_time"] = {2.0 * time - 2.0 / kRate, 1e-6};  // from the first step on
  s.known["real_time_factor"] = {time / (2.0 * time - 2.0 / kRate), 1e-6};
  s.played.training.stop();
  // A hand that has left is not told from the next one here: what is of hands is in the other sessions.
  for (const MetricValue& metric : s.played.training.values())
    if (metric.name.find('.') == std::string::npos && metric.name.find("hands") == std::string::npos &&
        metric.name != "idle_time" && metric.name != "instrument_crossings") {
      const Law should = laws().at(metric.name)(s, 0);
      if (std::isnan(should.value)) continue;
      EXPECT_NEAR(should.value, metric.value, should.within * std::abs(should.value) + should.least) << metric.name;
      if (metric.value != 0.0) told().insert(metric.name);
    }
  EXPECT_GT(s.played.value("drop_height"), 0.03);
}

TEST(MetricsLaw, EveryMetricIsComputedASecondTime) {
  for (const auto& [name, session] : {std::make_pair("hands", ofHands),
                                      {"cuts", ofCuts},
                                      {"vessels", ofVesselsCavitiesAndAttachments},
                                      {"falls", ofFalls}}) {
    SCOPED_TRACE(name);
    session();
  }
  for (const MetricRow& row : metricTable()) {
    EXPECT_TRUE(laws().count(row.name)) << "no law computes " << row.name;
    EXPECT_TRUE(told().count(row.name)) << row.name << " was 0 or empty in every session";
  }
}

}  // namespace metrics_law_test
}  // namespace meshless
