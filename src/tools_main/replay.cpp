// Does again what a log of commands says, without ROS, and compares the hashes on the way.
#include <cinttypes>
#include <cstdio>
#include <fstream>
#include <string>

#include <CLI/CLI.hpp>

#include "meshless_surgery/world/command_log.h"

int main(int argc, char** argv) {
  CLI::App app(
      "Replays a log of commands (the parameter command_log of deformer_node) and prints the hash of the state at its "
      "end. Exit status: 0 where every recorded hash was met, 1 where one was not, 2 where the log cannot be read.");
  std::string file;
  int threads = 1;
  app.add_option("log", file, "the log")->required()->check(CLI::ExistingFile);
  app.add_option("--threads", threads, "1..64; the result does not depend on it")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;  // --help is no error
  }

  std::ifstream log(file, std::ios::binary);
  const auto report = meshless::replay(log, threads);
  if (!report.ok()) {
    std::fprintf(stderr, "replay: %s: %s\n", file.c_str(), report.error().detail.c_str());
    return 2;
  }
  std::printf("%" PRIu64 " commands, %" PRIu64 " steps, %" PRIu64 " hashes compared\n", report->commands, report->steps,
              report->checks);
  if (const std::string lost = report->whatIsLost(); !lost.empty()) std::printf("%s\n", lost.c_str());
  if (report->difference)
    std::printf("DIFFERENT at step %" PRIu64 ": recorded %016" PRIx64 ", replayed %016" PRIx64 "\n",
                report->difference->step, report->difference->recorded, report->difference->found);
  std::printf("step %" PRIu64 " hash %016" PRIx64 "\n", report->last_step, report->hash);
  return report->difference ? 1 : 0;
}
