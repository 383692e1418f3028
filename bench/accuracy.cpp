// Run time against error: the deformer against the finite-element truth, and the laws that it must keep. Writes
// accuracy.csv and, where gnuplot is installed, its plots.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include <CLI/CLI.hpp>

#include "laws.h"
#include "meshless_surgery/base/share_folder.h"
#include "meshless_surgery/world/world.h"
#include "plot.h"
#include "settled_load.h"
#include "static_load.h"
#include "tool_load.h"

namespace meshless::bench {
namespace {

const char* const kLoads[] = {"bar_cantilever_small", "bar_cantilever_large", "bar_pull",
                              "bar_stretch_150",      "bar_torsion",          "bar_twist_90",
                              "bar_twist_180",        "block_indent",         "organ_hang"};
const char* const kRatios[] = {"nu30", "nu45"};
// Made by bench/truth/calculix.py.
const char* const kSettled[] = {"bar",
                                "bar_fine",
                                "bar_nu45",
                                "bar_nu49",
                                "bar_turned",
                                "bar_awkward_000",
                                "bar_awkward_260",
                                "bar_awkward_282",
                                "bar_awkward_322",
                                "bar_oblique_clamp",
                                "taper",
                                "tube",
                                "curved",
                                "angle",
                                "skin_edge",
                                "skin_rim"};
// By the sphere, a pick, a blade.
const char* const kPressed[] = {"../calculix/press_1_nu30", "../calculix/press_3_nu30", "../calculix/press_8_nu30",
                                "../calculix/press_1_nu45", "../calculix/press_3_nu45", "../calculix/press_8_nu45",
                                "../calculix/ball_above_1", "../calculix/ball_above",   "../calculix/ball_beside",
                                "block_press_3_nu30",       "block_press_3_nu45"};
// At several places: how the force depends on where the vertices of the surface and the cells lie under the sphere. The
// edges are those of a user's block, of a cylinder primitive, and finer ones.
const char* const kPlaced[] = {"../calculix/press_1_nu45", "block_press_3_nu45", "cylinder_press_1_nu45",
                               "cylinder_press_4_nu45"};
const double kEdges[] = {0.0, 0.005};  // [m]
const Vec3 kBeside[] = {Vec3::Zero(), Vec3(0.003, 0, 0), Vec3(0.003, 0.002, 0), Vec3(0.006, 0.002, 0),
                        Vec3(0.006, 0.006, 0)};
const char* const kPulled[] = {"pull_nu30", "pull_nu45"};
const char* const kIncised[] = {"half_cut_0", "half_cut_1",      "half_cut_2",
                                "half_cut_3", "half_cut_within", "incision_0"};

struct Row {
  std::string benchmark, name, mode, setting;
  double run_time_ms, error;
};

struct Table {
  std::ofstream file;
  std::vector<Row> rows;

  void row(const std::string& benchmark, const std::string& name, const std::string& mode, const std::string& setting,
           double run_time_ms, double error) {
    char line[400];
    std::snprintf(line, sizeof line, "%s,%s,%s,%s,%.6g,%.6g", benchmark.c_str(), name.c_str(), mode.c_str(),
                  setting.c_str(), run_time_ms, error);
    file << line << '\n' << std::flush;
    std::puts(line);
    std::fflush(stdout);
    rows.push_back({benchmark, name, mode, setting, run_time_ms, error});
  }
};

std::string shortNumber(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

// How far two solutions are from each other, as the error is measured.
double difference(const StaticResult& a, const StaticResult& b) {
  double squares = 0.0;
  for (std::size_t s = 0; s < a.samples.size(); ++s) squares += (a.samples[s] - b.samples[s]).squaredNorm();
  return std::sqrt(squares / static_cast<double>(a.samples.size())) / a.largest;
}

// Elastic materials: nothing to calibrate. The run time is that of one substep. `fem` is the error against the
// truth, `self` that against our own finest solution: what is left of `fem` there is the model's.
bool elasticRows(Table& table, const std::string& folder, const std::vector<double>& spacings) {
  for (const char* load : kLoads)
    for (const char* ratio : kRatios) {
      const std::string name = std::string(load) + "_" + ratio;
      const Result<TruthCase> truth = readTruthCase(folder + "/" + name + ".csv");
      if (!truth) {
        std::fprintf(stderr, "%s\n", truth.error().detail.c_str());
        return false;
      }
      std::vector<StaticResult> results;
      std::vector<std::string> settings_of;
      const auto solve = [&](const StaticSettings& settings, const std::string& kind) {
        const Result<StaticResult> result = solveStatic(*truth, folder, settings);
        if (!result) {
          std::fprintf(stderr, "%s: %s\n", name.c_str(), result.error().detail.c_str());
          return false;
        }
        const std::string setting =
            kind + " " + shortNumber(1000.0 * settings.spacing) + " mm " + std::to_string(result->particles);
        table.row("fem", name, kind == "cells" ? "elastic" : "elastic_wide",
                  setting + (result->at_rest ? "" : " not at rest"), result->step_ms, result->error);
        if (result->contact_force > 0.0)
          table.row("fem_force", name, "elastic", setting, result->step_ms,
                    std::abs(result->contact_force / truth->number("indentation_force") - 1.0));
        results.push_back(*result);
        settings_of.push_back(setting);
        return true;
      };
      StaticSettings settings;
      settings.material.youngs_modulus = 1.0;
      settings.clusters.kind = ClusterOptions::Kind::kCells;
      for (double spacing : spacings) {
        settings.spacing = spacing;
        if (!solve(settings, "cells")) return false;
      }
      for (std::size_t k = 0; k + 1 < results.size(); ++k)
        table.row("self", name, "elastic", settings_of[k], results[k].step_ms, difference(results[k], results.back()));
      // The same law on wide overlapping clusters.
      if (std::string(load).find("bar_") != 0 || std::string(load).find("twist") != std::string::npos) continue;
      settings.spacing = 0.0125;
      settings.clusters.kind = ClusterOptions::Kind::kCount;
      settings.clusters.count = 40;
      for (double overlap : {0.1, 0.6}) {
        settings.clusters.overlap = overlap;
        if (!solve(settings, "40 clusters overlap " + shortNumber(overlap))) return false;
      }
    }
  return true;
}

// The bar under its weight, from soft to stiff and coarse to fine: with the default of max_substeps, which slows what
// needs more, and with as many as it needs. The run time is that of a frame of 1/120 s.
bool stiffRows(Table& table, const std::string& folder) {
  const Result<TruthCase> truth = readTruthCase(folder + "/../calculix/bar_nu45.csv");
  if (!truth) {
    std::fprintf(stderr, "%s\n", truth.error().detail.c_str());
    return false;
  }
  for (const double finer : {0.5, 1.0, 2.0})
    for (const double youngs : {1e3, 1e4, 1e5, 1e6, 1e7}) {
      std::size_t substeps = 0;
      for (const int most : {WorldSettings().max_substeps, 1000}) {
        SettledOptions options;
        options.finer = finer;
        options.stiffer = youngs / truth->number("youngs_modulus");
        options.max_substeps = most;
        const Result<SettledResult> result = settle(*truth, folder + "/../calculix", options);
        if (!result) {
          std::fprintf(stderr, "%s\n", result.error().detail.c_str());
          return false;
        }
        if (result->substeps == substeps) continue;  // the default is enough
        substeps = result->substeps;
        table.row("stiff", "bar_nu45 " + std::to_string(result->particles) + " particles",
                  "max_substeps " + std::to_string(most),
                  shortNumber(1e-3 * youngs) + " kPa " + std::to_string(substeps) + " substeps " +
                      shortNumber(result->slower) + " times as slowly" + (result->moving > 3e-4 ? " not at rest" : ""),
                  result->step_ms, result->error);
      }
    }
  return true;
}

// Bodies as users have them, through World::step: at the default spacing and finer. The run time is that of a frame.
// The organ at its own spacings.
bool settledRows(Table& table, const std::string& folder, const std::string& part, const std::vector<double>& finer) {
  struct Entry {
    std::string folder, name;
    std::vector<double> spacings;  // [m] none: the default and finer
  };
  std::vector<Entry> entries;
  for (const char* name : kSettled) entries.push_back({folder + "/../calculix", name, {}});
  for (const char* ratio : kRatios)
    entries.push_back({folder, std::string("organ_hang_") + ratio, {0.0, 0.0125, 0.01, 0.008}});
  for (const Entry& entry : entries) {
    if (entry.name.find(part) == std::string::npos) continue;
    const Result<TruthCase> truth = readTruthCase(entry.folder + "/" + entry.name + ".csv");
    if (!truth) {
      std::fprintf(stderr, "%s\n", truth.error().detail.c_str());
      return false;
    }
    const auto add = [&](double times, double spacing) {
      const Result<SettledResult> result = settle(*truth, entry.folder, {times, spacing});
      if (!result) {  // a clamp that holds nothing, for one
        table.row("settled", entry.name, "filled", "refused", 0.0, 1.0);
        std::fprintf(stderr, "%s: %s\n", entry.name.c_str(), result.error().detail.c_str());
        return;
      }
      const std::string setting = shortNumber(1000.0 * result->spacing) + " mm " + std::to_string(result->particles);
      table.row("settled", entry.name, "filled", setting + (result->moving > 3e-4 ? " not at rest" : ""),
                result->step_ms, result->error);
      table.row("settled_tip", entry.name, "filled", setting, result->step_ms, result->tip - 1.0);
      table.row("settled_farthest", entry.name, "filled", setting, result->step_ms, result->farthest);
      if (result->slope > 0.0)
        table.row("settled_slope", entry.name, "filled", setting, result->step_ms, result->slope);
    };
    if (entry.spacings.empty())
      for (const double times : finer) add(times, 0.0);
    for (const double spacing : entry.spacings) add(1.0, spacing);
  }
  return true;
}

// The sphere at several places of a surface: the error of its force at each, and of all places how many cells the
// radius of the contact has, the least error, its mean, the largest, and the RMS.
bool placeRows(Table& table, const std::string& file, const std::vector<double>& finer) {
  const Result<TruthCase> truth = readTruthCase(file);
  if (!truth) {
    std::fprintf(stderr, "%s\n", truth.error().detail.c_str());
    return false;
  }
  const double contact = std::sqrt(truth->number("sphere_radius") * truth->number("sphere_depth"));
  for (const double times : finer) {
    double least = 1e9, most = -1e9, sum = 0.0, squares = 0.0, cells = 0.0, step_ms = 0.0;
    int count = 0;
    for (const double edge : kEdges)
      for (const Vec3& beside : kBeside) {
        ToolOptions options;
        options.finer = times;
        options.edge = edge;
        options.beside = beside;
        const Result<ToolResult> result = press(*truth, options);
        if (!result) {
          std::fprintf(stderr, "%s\n", result.error().detail.c_str());
          return false;
        }
        const double error = result->ratio - 1.0;
        table.row("press_place", truth->text("case"), "filled",
                  shortNumber(1000.0 * result->spacing) + " mm " + std::to_string(result->particles) + " edge " +
                      shortNumber(1000.0 * edge) + " at " + shortNumber(1000.0 * beside.x()) + " " +
                      shortNumber(1000.0 * beside.y()) + (result->at_rest ? "" : " not at rest"),
                  result->step_ms, error);
        least = std::min(least, error);
        most = std::max(most, error);
        sum += error;
        squares += error * error;
        cells = contact / result->spacing;
        step_ms += result->step_ms;
        ++count;
      }
    for (const auto& [name, value] : {std::pair("least", least), std::pair("mean", sum / count),
                                      std::pair("most", most), std::pair("rms", std::sqrt(squares / count))})
      table.row(std::string("press_places_") + name, truth->text("case"), "filled",
                shortNumber(cells) + " cells in the contact's radius", step_ms / count, value);
  }
  return true;
}

// Bodies under tools, in a World with its defaults. The run time is that of a frame. `press`, `pull` and `incised` are
// errors of the shape; with `_force`, `_tip` and `_mouth` the quotient to the truth, less one.
bool toolRows(Table& table, const std::string& folder, const std::string& part, const std::vector<double>& finer) {
  const auto add = [&](const char* benchmark, const std::string& file, const char* other, const auto& load) {
    const Result<TruthCase> truth = readTruthCase(folder + "/" + file + ".csv");
    const std::string name = file.substr(file.rfind('/') + 1);
    if (!truth) {
      std::fprintf(stderr, "%s\n", truth.error().detail.c_str());
      return false;
    }
    const Result<ToolResult> result = load(*truth);
    if (!result) {
      table.row(benchmark, name, "filled", "refused", 0.0, 1.0);
      std::fprintf(stderr, "%s: %s\n", name.c_str(), result.error().detail.c_str());
      return true;
    }
    const std::string setting = shortNumber(1000.0 * result->spacing) + " mm " + std::to_string(result->particles) +
                                (result->at_rest ? "" : " not at rest");
    table.row(benchmark, name, "filled", setting, result->step_ms, result->error);
    table.row(std::string(benchmark) + "_tip", name, "filled", setting, result->step_ms, result->tip - 1.0);
    if (other) table.row(std::string(benchmark) + other, name, "filled", setting, result->step_ms, result->ratio - 1.0);
    return true;
  };
  const auto chosen = [&](const char* name) { return std::string(name).find(part) != std::string::npos; };
  bool read = true;
  for (const char* name : kPressed)
    for (const double times : finer)
      if (chosen(name))
        read = add("press", name, "_force", [&](const TruthCase& t) { return press(t, {times, 0.0, 0.0}); }) && read;
  for (const char* name : kPlaced)
    if (chosen(name)) read = placeRows(table, folder + "/" + name + ".csv", finer) && read;
  for (const char* name : kPulled)
    for (const double times : finer)
      if (chosen(name))
        read = add("pull", std::string("../calculix/") + name, nullptr,
                   [&](const TruthCase& t) {
                     return pull(t, {times, 0.0, 0.0});
                   }) &&
               read;
  for (const char* name : kIncised) {
    if (!chosen(name)) continue;
    const double height = std::string(name).find("incision") == 0 ? 0.04 : 0.05;
    for (const double cells : {8.0, 7.6})  // lattice planes on the faces, and between them
      read = add("incised", std::string("../calculix/") + name, "_mouth",
                 [&](const TruthCase& t) {
                   return hangIncised(t, folder + "/../calculix", {1.0, height / cells, 0.0});
                 }) &&
             read;
  }
  return read;
}

// Appearance materials: one scalar, fitted to the small cantilever; what is left there, and on the other loads, is the
// model's own error.
bool appearanceRows(Table& table, const std::string& folder, double spacing) {
  struct Variant {
    MatchMode mode;
    ClusterOptions clusters;
    const char* name;
  };
  ClusterOptions cells;
  cells.kind = ClusterOptions::Kind::kCells;
  ClusterOptions one;
  one.kind = ClusterOptions::Kind::kOne;
  const Variant variants[] = {{MatchMode::kRigid, cells, "cells"},
                              {MatchMode::kLinear, cells, "cells"},
                              {MatchMode::kLinear, ClusterOptions(), "auto"},
                              {MatchMode::kQuadratic, ClusterOptions(), "auto"},
                              {MatchMode::kQuadratic, one, "one"}};
  for (const Variant& variant : variants) {
    const auto solve = [&](const std::string& name, double logarithm) -> Result<StaticResult> {
      const Result<TruthCase> truth = readTruthCase(folder + "/" + name + ".csv");
      if (!truth) return truth.error();
      StaticSettings settings;
      settings.spacing = spacing;
      settings.clusters = variant.clusters;
      settings.material.mode = variant.mode;
      settings.material.beta = variant.mode == MatchMode::kRigid ? 0.0 : 0.5;
      settings.appearance_rate = std::exp(logarithm);
      settings.max_steps = 6000;
      return solveStatic(*truth, folder, settings);
    };
    double low = 2.0, high = 11.0;  // of ln(rate)
    for (int search = 0; search < 14; ++search) {
      const double a = low + 0.382 * (high - low), b = low + 0.618 * (high - low);
      const Result<StaticResult> at_a = solve("bar_cantilever_small_nu30", a),
                                 at_b = solve("bar_cantilever_small_nu30", b);
      if (!at_a || !at_b) return false;
      if (at_a->error < at_b->error)
        high = b;
      else
        low = a;
    }
    const double best = 0.5 * (low + high);
    // The truth's bodies are of different stiffness; the scalar of an appearance material goes with it.
    const Result<TruthCase> fitted = readTruthCase(folder + "/bar_cantilever_small_nu30.csv");
    for (const char* load :
         {"bar_cantilever_small", "bar_cantilever_large", "bar_pull", "bar_stretch_150", "bar_torsion"}) {
      const std::string name = std::string(load) + "_nu30";
      const Result<TruthCase> truth = readTruthCase(folder + "/" + name + ".csv");
      if (!truth) return false;
      const double scale = truth->number("youngs_modulus") / fitted->number("youngs_modulus");
      const Result<StaticResult> result = solve(name, best + 0.5 * std::log(scale));
      if (!result) return false;
      table.row("fem", name, toString(variant.mode),
                std::string(variant.name) + " " + shortNumber(std::exp(best)) + " rad/s fitted on small cantilever" +
                    (result->at_rest ? "" : " not at rest"),
                result->step_ms, result->error);
    }
  }
  return true;
}

// What the deformer must keep (laws.h). Errors are relative, angles in rad; the rows of a step are named by it.
void lawRows(Table& table, int steps, const std::vector<double>& rates) {
  const std::string drift_setting = std::to_string(steps) + " steps";
  for (const Kind& kind : kinds()) {
    for (bool in_float : {false, true}) {
      if (in_float && !runsInFloat(kind)) continue;
      const std::string precision = in_float ? "float" : "double";
      if (!kind.elastic)
        for (double scale : {1e-6, 1.0, 1e6})
          for (double far : {0.0, 1000.0}) {
            if (far > 0.0 && scale != 1.0) continue;
            table.row("patch", kind.name, precision, "size " + shortNumber(scale) + " m at " + shortNumber(far) + " m",
                      0.0, patchError(kind, in_float, scale, far));
          }
      const Drift drift = momentumDrift(kind, in_float, steps);
      table.row("momentum_linear", kind.name, precision, drift_setting, 0.0, drift.linear);
      table.row("momentum_angular", kind.name, precision, drift_setting, 0.0, drift.angular);
      table.row("energy_gain", kind.name, precision, drift_setting, 0.0, drift.energy);
    }
    for (bool tumbling : {false, true}) {
      std::vector<double> lengths, errors;
      for (double rate : rates) {
        lengths.push_back(1.0 / rate);
        errors.push_back(spinError(kind, tumbling, 1.0 / rate, 2.0));
        table.row(tumbling ? "tumbling" : "spin", kind.name, "double", shortNumber(1000.0 / rate), 0.0, errors.back());
      }
      table.row(tumbling ? "tumbling_order" : "spin_order", kind.name, "double", "fitted", 0.0,
                fittedOrder(lengths, errors));
    }
    table.row("spin_loss", kind.name, "double", "10 s", 0.0, spinLoss(kind, 1.0 / 60.0, 10.0));
    const Ringing finest = ringing(kind, 1920.0);
    const double finest_sag = sag(kind, 1920.0);
    for (double rate : rates) {
      const Ringing here = ringing(kind, rate);
      const std::string setting = shortNumber(1000.0 / rate);
      table.row("ringing", kind.name, "double", setting, 0.0, std::abs(here.frequency / finest.frequency - 1.0));
      table.row("decay", kind.name, "double", setting, 0.0, std::abs(here.decay / finest.decay - 1.0));
      table.row("sag", kind.name, "double", setting, 0.0, std::abs(sag(kind, rate) / finest_sag - 1.0));
    }
  }
}

// A cube squeezed by 40 %: how much of its volume or area changes, by the curve that holds it.
void squeezeRows(Table& table) {
  struct Curve {
    const char* name;
    std::vector<std::array<double, 2>> points;
  };
  const Curve curves[] = {{"off", {}}, {"lax", {{0.0, 0.0}, {0.1, 0.0}, {0.3, 0.3}}}, {"stiff", {{0.0, 1.0}}}};
  for (bool elastic : {false, true})
    for (const Curve& curve : curves)
      for (bool area : {false, true}) {
        Material material;
        material.alpha = 0.8;
        material.damping = 5.0;
        if (elastic) {
          material.youngs_modulus = 500.0;
          material.poissons_ratio = 0.1;
        }
        (area ? material.area : material.volume).points = curve.points;
        const Squeezed squeezed = squeeze(material);
        table.row(area ? "squeezed_area" : "squeezed_volume", elastic ? "elastic" : "looks", "double", curve.name, 0.0,
                  std::abs((area ? squeezed.area : squeezed.volume) - 1.0));
      }
}

// The number that a setting begins with: the step [ms], of stiff bars E [kPa].
double numberOf(const Row& row) { return std::strtod(row.setting.c_str(), nullptr); }

bool plots(const Table& table, const std::string& out) {
  Plot front;
  front.title = "Run time against error, against the finite-element truth";
  front.x = "time of a substep [ms]";
  front.y = "RMS error / largest displacement";
  Plot spin, steps;
  spin.title = "A free block against Euler's equations, after 2 s at 6 rad/s";
  steps.title = "The same motion at any step: relative to 1/1920 s";
  spin.x = steps.x = "step [ms]";
  spin.y = "angle [rad]";
  steps.y = "relative difference";
  Plot stiff;
  stiff.title = "A held bar, from soft to stiff: where the default of max_substeps is enough, both are one";
  stiff.x = "Young's modulus [kPa]";
  stiff.y = "time of a frame of 1/120 s [ms]";
  for (const Row& row : table.rows) {
    if (row.benchmark == "fem" && row.mode == "elastic" && row.name.find("_nu45") != std::string::npos)
      front.series[row.name].emplace_back(row.run_time_ms, row.error);
    if (row.benchmark == "fem" && row.mode == "elastic_wide")
      front.series["elastic, 40 clusters"].emplace_back(row.run_time_ms, row.error);
    if (row.benchmark == "fem" && (row.mode == "rigid" || row.mode == "linear" || row.mode == "quadratic"))
      front.series[row.mode + " (looks, fitted)"].emplace_back(row.run_time_ms, row.error);
    if ((row.benchmark == "spin" || row.benchmark == "tumbling") && row.setting != "fitted")
      spin.series[row.benchmark + " " + row.name].emplace_back(numberOf(row), row.error);
    if (row.benchmark == "ringing" || row.benchmark == "decay" || row.benchmark == "sag")
      steps.series[row.benchmark + " " + row.name].emplace_back(numberOf(row), std::max(row.error, 1e-7));
    if (row.benchmark == "stiff") stiff.series[row.name + ", " + row.mode].emplace_back(numberOf(row), row.run_time_ms);
  }
  for (auto& [name, points] : front.series)
    if (name.find("looks") != std::string::npos || name.find("40") != std::string::npos)
      front.points_alone.insert(name);
  const auto made = [&out](const Plot& plot, const char* name) {
    return plot.series.empty() || draw(plot, out + "/" + name);
  };
  return made(front, "accuracy.png") && made(spin, "spin.png") && made(steps, "steps.png") && made(stiff, "stiff.png");
}

}  // namespace
}  // namespace meshless::bench

int main(int argc, char** argv) {
  using namespace meshless::bench;
  CLI::App app{"Accuracy of the deformer: accuracy.csv and its plots"};
  std::string out = ".", truth = meshless::shareFolder() + "/bench/truth/data";
  std::string settled, tools;
  bool quick = false, stiff = false;
  app.add_option("--out", out, "folder for accuracy.csv and the plots")->check(CLI::ExistingDirectory);
  app.add_option("--truth", truth, "folder of the finite-element truth")->check(CLI::ExistingDirectory);
  app.add_flag("--quick", quick, "coarse bodies and few steps: minutes become seconds");
  CLI::Option* const only =
      app.add_option("--settled", settled, "only bodies as users have them whose name has this in it");
  CLI::Option* const only_tools =
      app.add_option("--tools", tools, "only bodies under tools whose case's name has this in it");
  app.add_flag("--stiff", stiff, "only a bar from soft to stiff");
  std::vector<double> finer = {1.0, 1.26, 1.59, 2.0};
  app.add_option("--finer", finer, "the spacings of --settled and --tools: how many times as fine as the default")
      ->check(CLI::Range(0.1, 10.0));
  CLI11_PARSE(app, argc, argv);
  Table table;
  table.file.open(out + "/accuracy.csv");
  if (!table.file) {
    std::fprintf(stderr, "cannot write %s/accuracy.csv\n", out.c_str());
    return 1;
  }
  table.file << "benchmark,case,mode,setting,run_time_ms,error\n";
  if (stiff) return stiffRows(table, truth) && plots(table, out) ? 0 : 1;
  if (only->count() > 0) return settledRows(table, truth, settled, finer) ? 0 : 1;
  if (only_tools->count() > 0) return toolRows(table, truth, tools, finer) ? 0 : 1;
  if (quick) finer = {1.0};
  const std::vector<double> spacings =
      quick ? std::vector<double>{0.0125} : std::vector<double>{0.025, 0.0125, 0.05 / 7.0, 0.00625};
  if (!settledRows(table, truth, "", finer)) return 1;
  if (!toolRows(table, truth, "", finer)) return 1;
  if (!quick && !stiffRows(table, truth)) return 1;
  if (!elasticRows(table, truth, spacings)) return 1;
  if (!quick && !appearanceRows(table, truth, 0.0125)) return 1;
  lawRows(table, quick ? 500 : 10000,
          quick ? std::vector<double>{60.0, 240.0} : std::vector<double>{60, 120, 240, 480, 960});
  squeezeRows(table);
  table.file.close();
  if (!plots(table, out))
    std::fprintf(stderr, "gnuplot did not make the plots; the table is in %s/accuracy.csv\n", out.c_str());
  return 0;
}
