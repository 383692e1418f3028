// Plays scenes that nobody wrote and holds them to laws.
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <mutex>
#include <sstream>
#include <string>
#include <thread>

#include <CLI/CLI.hpp>

#include "meshless_surgery/base/share_folder.h"
#include "drive/drive_table.h"
#include "drive/known_breaks.h"
#include "meshless_surgery/io/scene.h"
#include "meshless_surgery/world/saved_world.h"

namespace {

using meshless::ContactMethod;
using meshless::DriveReport;

constexpr std::size_t kLogs = 10;

const std::map<std::string, ContactMethod> kContacts{
    {"none", ContactMethod::kNone}, {"textbook", ContactMethod::kTextbook}, {"surface", ContactMethod::kSurface}};

std::string shippedMaterials() {
#ifdef MATERIALS_FOLDER
  return MATERIALS_FOLDER;  // of the checkout: a build without ROS has no share folder
#else
  return meshless::shareFolder() + "/config/materials";
#endif
}

/// Ctrl-C: the scenes that are being played are the last; what was found until then is said.
volatile std::sig_atomic_t enough = 0;
void stop(int) { enough = 1; }

/// Of the worst so far alone: a log has some megabytes.
void dropLogs(std::vector<std::unique_ptr<DriveReport>>& done) {
  std::vector<DriveReport*> kept;
  for (const auto& report : done)
    if (report && !report->log.empty()) kept.push_back(report.get());
  std::stable_sort(kept.begin(), kept.end(),
                   [](const DriveReport* a, const DriveReport* b) { return a->badness() > b->badness(); });
  for (std::size_t k = 0; k < kept.size(); ++k)
    if (k >= kLogs || kept[k]->holds()) {
      std::string().swap(kept[k]->log);
      kept[k]->state.reset();
    }
}

bool writeFile(const std::string& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary);
  file << bytes;
  file.close();
  if (!file) std::cerr << "drive: cannot write " << path << '\n';
  return static_cast<bool>(file);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Plays random scenes, each from its seed alone: organs, materials, supports, a hand that pulls, pushes, cuts and "
      "lets go, then five seconds or more alone. Holds them to laws (volume, depth, crossings, folds, energy, rest, "
      "mass, "
      "momentum) that know nothing of how contacts are found, and prints a table, the worst ten, and what breaks at "
      "what. Exit status: 0 where every seed holds, or where all is as --known says; 1 where not, 2 where it could not "
      "begin.");
  std::uint64_t seed = 1, count = 1;
  int jobs = 1;
  std::string out, contact, materials, known_file;
  meshless::DriveChoices choices;
  meshless::DriveOptions options;
  bool no_cuts = false, no_hands = false;
  app.add_option("--seed", seed, "the first seed")->required();
  app.add_option("--count", count, "so many seeds, one after the other")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  app.add_option(
      "--out", out,
      "folder, made where it is missing: drive.csv, table.txt, and of the worst ten seed_N.log (rosrun "
      "meshless_surgery replay) and seed_N.state (the node's ~load shows it in rviz), the state in which the "
      "first law broke");
  app.add_option("--jobs", jobs, "scenes at a time")->check(CLI::Range(1, 64))->capture_default_str();
  app.add_option("--budget", options.budget, "[s] of processor time for a scene; then it did not finish")
      ->check(CLI::Range(1.0, 1e6))
      ->capture_default_str();
  app.add_option("--contact", contact, "the method of contact: none, textbook, surface; else the default");
  app.add_option("--material", choices.material, "elastic, looks, or a name in config/materials alone");
  app.add_option("--support", choices.support, "ground, tray, bowl, hung or stack alone");
  app.add_option("--organs", choices.most_organs, "at most so many bodies, 1 to 3")->capture_default_str();
  app.add_option("--triangles", choices.most_triangles, "at most so many a body, 500 to 30000, of random shapes")
      ->capture_default_str();
  app.add_option(
         "--known", known_file,
         "file with lines SEED | LAW | REASON, at most four: these breaks are expected, and no others; what did "
         "not finish is no break")
      ->check(CLI::ExistingFile);
  app.add_flag("--no-cuts", no_cuts, "the hand waits where it would cut");
  app.add_flag("--no-hands", no_hands, "nobody touches anything");
  app.add_option("--materials", materials, "folder of material files; else the shipped ones")
      ->check(CLI::ExistingDirectory);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;  // --help is no error
  }
  options.cuts = !no_cuts && !no_hands;
  options.hands = !no_hands;
  options.record = !out.empty();

  const auto fail = [](const std::string& why) {
    std::cerr << "drive: " << why << '\n';
    return 2;
  };
  if (!contact.empty()) {
    const auto found = kContacts.find(contact);
    if (found == kContacts.end()) return fail("contact is '" + contact + "'; accepted: none, textbook, surface");
    choices.contact = found->second;
  }
  auto shipped = meshless::readMaterials(materials.empty() ? shippedMaterials() : materials);
  if (!shipped) return fail(shipped.error().detail);
  choices.shipped = std::move(*shipped);
  std::vector<meshless::KnownBreak> known;
  if (!known_file.empty()) {
    std::ifstream file(known_file);
    auto read = meshless::readKnownBreaks(file);
    if (!read) return fail(known_file + ": " + read.error().detail);
    known = std::move(*read);
  }
  // A choice that is not there is said before anything is made.
  if (const auto first = meshless::makeDriveScene(seed, choices);
      !first && first.error().code != meshless::ErrorCode::kFailed)
    return fail(first.error().detail);
  std::error_code failed;
  if (!out.empty()) std::filesystem::create_directory(out, failed);
  if (failed) return fail("cannot make the folder " + out + ": " + failed.message());

  std::vector<std::unique_ptr<DriveReport>> done(count);
  std::mutex mutex;
  std::uint64_t next = 0, printed = 0;
  std::signal(SIGINT, stop);
  std::signal(SIGTERM, stop);
  meshless::printHead(std::cout);
  const auto work = [&] {
    for (;;) {
      std::uint64_t mine = 0;
      {
        const std::lock_guard<std::mutex> lock(mutex);
        if (next == count || enough) return;
        mine = next++;
      }
      auto report = std::make_unique<DriveReport>();
      const auto scene = meshless::makeDriveScene(seed + mine, choices);
      if (scene) {
        *report = meshless::drive(*scene, options);
      } else {
        report->seed = seed + mine;
        report->refused = scene.error().detail;
      }
      const std::lock_guard<std::mutex> lock(mutex);
      done[mine] = std::move(report);
      dropLogs(done);
      for (; printed < count && done[printed]; ++printed) meshless::printRow(std::cout, *done[printed]);
    }
  };
  std::vector<std::thread> threads;
  for (int k = 1; k < jobs; ++k) threads.emplace_back(work);
  work();
  for (std::thread& thread : threads) thread.join();

  std::vector<DriveReport> reports;
  for (const auto& report : done)
    if (report) reports.push_back(std::move(*report));
  meshless::printSummary(std::cout, reports);
  bool written = true;
  if (!out.empty()) {
    std::ostringstream csv, table;
    meshless::writeCsv(csv, reports);
    meshless::printHead(table);
    for (const DriveReport& report : reports) meshless::printRow(table, report);
    meshless::printSummary(table, reports);
    written = writeFile(out + "/drive.csv", csv.str()) && writeFile(out + "/table.txt", table.str());
    for (const DriveReport* report : meshless::worstOf(reports, kLogs)) {
      const std::string name = out + "/seed_" + std::to_string(report->seed);
      if (report->log.empty()) continue;  // it could not be made
      written = writeFile(name + ".log", report->log) &&
                writeFile(name + ".state", meshless::encode(*report->state, "drive")) && written;
    }
    if (written) std::cout << "Written to " << out << '\n';
  }
  if (!written) return 2;
  if (!known_file.empty()) {
    const std::vector<std::string> said = meshless::unlikeKnown(reports, known);
    for (const std::string& one : said) std::cout << one << '\n';
    return said.empty() && reports.size() == count ? 0 : 1;
  }
  const bool all_hold =
      std::all_of(reports.begin(), reports.end(), [](const DriveReport& report) { return report.holds(); });
  return all_hold && reports.size() == count ? 0 : 1;
}
