// Run time against error: the deformer against the finite-element truth, and the laws that it must keep. Writes
// accuracy.csv and, where gnuplot is installed, its plots.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>

#include <CLI/CLI.hpp>

#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/geometry/primitives.h"
#include "static_load.h"

namespace meshless::bench {
namespace {

const char* const kLoads[] = {"bar_cantilever_small", "bar_cantilever_large", "bar_pull",
                              "bar_stretch_150",      "bar_torsion",          "bar_twist_90",
                              "bar_twist_180",        "block_indent",         "organ_hang"};
const char* const kRatios[] = {"nu30", "nu45"};

struct Table {
  std::ofstream file;

  void row(const std::string& benchmark, const std::string& name, const std::string& mode, const std::string& setting,
           double run_time_ms, double error) {
    char line[400];
    std::snprintf(line, sizeof line, "%s,%s,%s,%s,%.6g,%.6g", benchmark.c_str(), name.c_str(), mode.c_str(),
                  setting.c_str(), run_time_ms, error);
    file << line << '\n' << std::flush;
    std::puts(line);
    std::fflush(stdout);
  }
};

std::string shortNumber(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

// Materials for accuracy: nothing to calibrate. The run time is that of one substep.
bool elasticRows(Table& table, const std::string& folder, const std::vector<double>& spacings) {
  for (double spacing : spacings)
    for (const char* load : kLoads)
      for (const char* ratio : kRatios) {
        const std::string name = std::string(load) + "_" + ratio;
        const Result<TruthCase> truth = readTruthCase(folder + "/" + name + ".csv");
        if (!truth) {
          std::fprintf(stderr, "%s\n", truth.error().detail.c_str());
          return false;
        }
        StaticSettings settings;
        settings.spacing = spacing;
        settings.material.youngs_modulus = 1.0;
        const Result<StaticResult> result = solveStatic(*truth, folder, settings);
        if (!result) {
          std::fprintf(stderr, "%s: %s\n", name.c_str(), result.error().detail.c_str());
          return false;
        }
        const std::string setting =
            "cells " + shortNumber(1000.0 * spacing) + " mm " + std::to_string(result->particles);
        table.row("fem", name, "elastic", setting + (result->at_rest ? "" : " not at rest"), result->step_ms,
                  result->error);
        if (result->contact_force > 0.0)
          table.row("fem_force", name, "elastic", setting, result->step_ms,
                    std::abs(result->contact_force / truth->number("indentation_force") - 1.0));
      }
  return true;
}

// Materials for looks: one scalar, fitted to the small cantilever; what is left there, and on the other loads, is the
// model's own error.
bool looksRows(Table& table, const std::string& folder, double spacing) {
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
      settings.looks_rate = std::exp(logarithm);
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
    // The truth's bodies are of different stiffness; a scalar for looks goes with it.
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

// Drift per step of a free body that spins and rings, relative to what it has.
void momentumRows(Table& table, int steps) {
  for (int family = 0; family < 4; ++family) {
    BodyDef def;
    def.name = "block";
    def.mesh = boxMesh(Vec3(0.12, 0.06, 0.04), 12, 6, 4);
    def.spacing = 0.01;
    def.material.damping = 0.0;
    if (family == 3) def.material.youngs_modulus = 20000.0;
    def.material.mode = family == 0 ? MatchMode::kRigid : family == 1 ? MatchMode::kLinear : MatchMode::kQuadratic;
    def.material.beta = 0.5;
    const Material material = def.material;
    const Result<PreparedBody> body = prepareBody(std::move(def));
    if (!body) return;
    BodyState state = body->state;
    const BodyModel& model = *body->model;
    for (std::size_t i = 0; i < model.rest.size(); ++i)
      state.velocities[i] = Vec3(1, -2, 0.5) + Vec3(3, 5, 20).cross(model.rest[i]) +
                            0.1 * Vec3(std::sin(3.1 * i), std::sin(1.7 * i), std::sin(2.3 * i));
    const BodyMeasures before = measureBody(model, state);
    StepScratch scratch;
    MatchCounters counters;
    const double h = model.highest_frequency > 0.0 ? 0.9 / model.highest_frequency : 1.0 / 120.0;
    for (int step = 0; step < steps; ++step) matchAndMove(model, material, Vec3::Zero(), h, state, scratch, counters);
    const BodyMeasures after = measureBody(model, state);
    const char* mode = family == 3 ? "elastic" : toString(material.mode);
    const std::string setting = std::to_string(steps) + " steps";
    table.row("momentum", "linear", mode, setting, 0.0,
              (after.linear_momentum - before.linear_momentum).norm() / before.linear_momentum.norm() / steps);
    table.row("momentum", "angular", mode, setting, 0.0,
              (after.angular_momentum - before.angular_momentum).norm() / before.angular_momentum.norm() / steps);
  }
}

// Sag of a bar held at one end, relative to that at the shortest step.
void stepRows(Table& table) {
  std::vector<double> sags;
  const double steps[] = {1.0 / 960, 1.0 / 480, 1.0 / 240, 1.0 / 120, 1.0 / 60};
  for (double frame : steps) {
    BodyDef def;
    def.name = "bar";
    def.mesh = boxMesh(Vec3(0.12, 0.04, 0.04), 12, 4, 4);
    def.spacing = 0.01;
    def.material.youngs_modulus = 20000.0;
    def.material.damping = 20.0;
    Box end;
    end.extend(Vec3(-1, -1, -1));
    end.extend(Vec3(-0.0599, 1, 1));
    def.fixed.push_back(end);
    const Material material = def.material;
    const Result<PreparedBody> body = prepareBody(std::move(def));
    if (!body) return;
    BodyState state = body->state;
    StepScratch scratch;
    MatchCounters counters;
    for (double t = 0.0; t < 3.0; t += frame) {
      const int substeps = static_cast<int>(std::ceil(frame * highestFrequencyNow(*body->model, state)));
      for (int k = 0; k < substeps; ++k)
        matchAndMove(*body->model, material, Vec3(0, 0, -9.81), frame / substeps, state, scratch, counters);
    }
    sags.push_back(measureBody(*body->model, state).centre_of_mass.z());
    table.row("step_independence", "sag", "elastic", "frame " + shortNumber(1000.0 * frame) + " ms", 0.0,
              std::abs(sags.back() / sags.front() - 1.0));
  }
}

void plot(const std::string& out) {
  const std::string script = out + "/accuracy.gp";
  std::ofstream(script)
      << "set datafile separator ','\nset logscale xy\nset key outside right font ',8'\nset grid\n"
         "set xlabel 'time of a substep [ms]'\nset ylabel 'RMS error / largest displacement'\n"
         "set terminal pngcairo size 1100,700\nset output '"
      << out
      << "/accuracy.png'\n"
         "set title 'Run time against error, against the finite-element truth'\n"
         "cases = 'bar_cantilever_large bar_pull bar_stretch_150 bar_torsion bar_twist_180 block_indent organ_hang'\n"
         "plot for [c in cases] '"
      << out
      << "/accuracy.csv' using "
         "((strcol(1) eq 'fem' && strcol(2) eq c.'_nu45' && strcol(3) eq 'elastic') ? $5 : 1/0):6 with linespoints "
         "title c.' nu 0.45' noenhanced, for [m in 'rigid linear quadratic'] '"
      << out
      << "/accuracy.csv' using "
         "((strcol(1) eq 'fem' && strcol(3) eq m) ? $5 : 1/0):6 with points pt 4 title m.' (looks, fitted)'\n";
  if (std::system(("gnuplot '" + script + "' 2>&1").c_str()) != 0)
    std::fprintf(stderr, "gnuplot did not make the plot; the table is in %s/accuracy.csv\n", out.c_str());
}

}  // namespace
}  // namespace meshless::bench

int main(int argc, char** argv) {
  using namespace meshless::bench;
  CLI::App app{"Accuracy of the deformer: accuracy.csv and its plots"};
  std::string out = ".", truth = TRUTH_FOLDER;
  bool quick = false;
  app.add_option("--out", out, "folder for accuracy.csv and the plots")->check(CLI::ExistingDirectory);
  app.add_option("--truth", truth, "folder of the finite-element truth")->check(CLI::ExistingDirectory);
  app.add_flag("--quick", quick, "coarse bodies and few steps: minutes become seconds");
  CLI11_PARSE(app, argc, argv);
  Table table;
  table.file.open(out + "/accuracy.csv");
  if (!table.file) {
    std::fprintf(stderr, "cannot write %s/accuracy.csv\n", out.c_str());
    return 1;
  }
  table.file << "benchmark,case,mode,setting,run_time_ms,error\n";
  const std::vector<double> spacings =
      quick ? std::vector<double>{0.0125} : std::vector<double>{0.025, 0.0125, 0.05 / 7.0, 0.00625};
  if (!elasticRows(table, truth, spacings)) return 1;
  if (!quick && !looksRows(table, truth, 0.0125)) return 1;
  momentumRows(table, quick ? 500 : 10000);
  stepRows(table);
  plot(out);
  return 0;
}
