#include "drive/drive_table.h"

#include <algorithm>
#include <iomanip>
#include <map>
#include <ostream>

#include "drive/words.h"

namespace meshless {
namespace {

constexpr std::size_t kWorst = 10;

std::string brokenLaws(const DriveReport& report) {
  if (!report.refused.empty()) return "REFUSED: " + report.refused;
  std::string names;
  for (std::size_t law = 0; law < kLaws; ++law)
    if (report.findings[law].broken()) names += (names.empty() ? "" : " ") + std::string(kLawNames[law]);
  if (!report.finished) names += (names.empty() ? "" : " ") + std::string("DID NOT FINISH");
  return names.empty() ? "holds" : names;
}

double simulatedOverReal(const DriveReport& r) { return r.wall > 0.0 ? r.simulated / r.wall : 0.0; }
double simulatedOverProcessor(const DriveReport& r) { return r.processor > 0.0 ? r.simulated / r.processor : 0.0; }

int blades(const DriveReport& report) { return report.hand.cuts + report.hand.incisions; }

std::string bladesGroup(const DriveReport& report) {
  const int count = blades(report);
  return count == 0 ? "0" : count <= 2 ? "1 to 2" : count <= 4 ? "3 to 4" : "5 and more";
}

struct Group {
  std::size_t count = 0, hold = 0;
  std::array<std::size_t, kLaws> broken{};
  std::size_t unfinished = 0;
  void add(const DriveReport& report) {
    ++count;
    hold += report.holds();
    unfinished += !report.finished;
    for (std::size_t law = 0; law < kLaws; ++law) broken[law] += report.findings[law].broken();
  }
};

void printGroup(std::ostream& out, const std::string& name, const Group& group) {
  out << std::left << std::setw(24) << name << std::right << std::setw(6) << group.count << std::setw(7) << group.hold;
  for (const std::size_t broken : group.broken) out << std::setw(11) << broken;
  out << std::setw(12) << group.unfinished << '\n';
}

std::string quoted(std::string text) {
  std::replace(text.begin(), text.end(), '"', '\'');
  std::replace(text.begin(), text.end(), '\n', ' ');
  return '"' + text + '"';
}

double middle(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

}  // namespace

void printHead(std::ostream& out) {
  out << "  seed bodies triangles family  support  cuts incis. undos pieces  sim/real  sim/cpu  laws that broke\n";
}

void printRow(std::ostream& out, const DriveReport& r) {
  out << std::right << std::setw(6) << r.seed << std::setw(7) << r.bodies << std::setw(10) << r.triangles << ' '
      << std::left << std::setw(8) << r.family << std::setw(8) << r.support << std::right << std::setw(5) << r.hand.cuts
      << std::setw(7) << r.hand.incisions << std::setw(6) << r.hand.undos << std::setw(7) << r.pieces << std::fixed
      << std::setprecision(2) << std::setw(10) << simulatedOverReal(r) << std::setw(9) << simulatedOverProcessor(r)
      << "  " << brokenLaws(r) << std::endl;
}

std::vector<const DriveReport*> worstOf(const std::vector<DriveReport>& reports, std::size_t count) {
  std::vector<const DriveReport*> worst;
  for (const DriveReport& report : reports)
    if (!report.holds()) worst.push_back(&report);
  std::stable_sort(worst.begin(), worst.end(),
                   [](const DriveReport* a, const DriveReport* b) { return a->badness() > b->badness(); });
  if (worst.size() > count) worst.resize(count);
  return worst;
}

void printSummary(std::ostream& out, const std::vector<DriveReport>& reports) {
  const auto worst = worstOf(reports, kWorst);
  if (!worst.empty()) out << "\nThe worst " << worst.size() << ":\n";
  for (const DriveReport* report : worst) {
    out << "seed " << report->seed << ": " << report->organs << "; " << report->materials << "; " << report->support
        << "\n";
    for (std::size_t law = 0; law < kLaws; ++law)
      if (report->findings[law].broken())
        out << "  " << std::left << std::setw(10) << kLawNames[law] << ' ' << report->findings[law].text << '\n';
    if (!report->refused.empty()) out << "  refused: " << report->refused << '\n';
    if (!report->finished && report->refused.empty())
      out << "  did not finish: " << words(report->simulated) << " s simulated in " << words(report->processor)
          << " s\n";
  }

  std::vector<std::pair<std::string, std::map<std::string, Group>>> tables{
      {"", {}}, {"material", {}}, {"support", {}}, {"cuts and incisions", {}}, {"bodies", {}}};
  std::vector<double> pace;
  for (const DriveReport& r : reports) {
    tables[0].second["all"].add(r);
    tables[1].second[r.family].add(r);
    tables[2].second[r.support].add(r);
    tables[3].second[bladesGroup(r)].add(r);
    tables[4].second[std::to_string(r.bodies)].add(r);
    if (r.finished) pace.push_back(simulatedOverProcessor(r));
  }
  for (const auto& [title, groups] : tables) {
    out << '\n'
        << std::left << std::setw(24) << (title.empty() ? "seeds" : "by " + title) << std::right << std::setw(6)
        << "seeds" << std::setw(7) << "hold";
    for (const char* law : kLawNames) out << std::setw(11) << law;
    out << std::setw(12) << "unfinished" << '\n';
    for (const auto& [name, group] : groups) printGroup(out, name, group);
  }
  const Group& all = tables[0].second["all"];
  out << '\n'
      << all.hold << " of " << all.count << " hold; simulated over processor time: median " << words(middle(pace))
      << '\n';
}

void writeCsv(std::ostream& out, const std::vector<DriveReport>& reports) {
  out << "seed,holds,finished,broken,family,support,bodies,triangles,particles,cuts,incisions,undos,pulls,pushes,"
         "refused,"
         "pieces,simulated_s,real_s,processor_s,worst_step_ms,hash,state_time_s";
  for (const char* law : kLawNames) out << ',' << law;  // scores
  out << ",organs,materials,broke\n";
  for (const DriveReport& r : reports) {
    out << r.seed << ',' << r.holds() << ',' << r.finished << ',' << r.broken() << ',' << r.family << ',' << r.support
        << ',' << r.bodies << ',' << r.triangles << ',' << r.particles << ',' << r.hand.cuts << ',' << r.hand.incisions
        << ',' << r.hand.undos << ',' << r.hand.pulls << ',' << r.hand.pushes << ',' << r.hand.refused << ','
        << r.pieces << ',' << words(r.simulated) << ',' << words(r.wall) << ',' << words(r.processor) << ','
        << words(1e3 * r.worst_step) << ',' << std::hex << r.hash << std::dec << ',' << words(r.state_time);
    for (const Finding& finding : r.findings) out << ',' << words(finding.score);
    std::string broke = r.refused;
    for (std::size_t law = 0; law < kLaws; ++law)
      if (r.findings[law].broken())
        broke += (broke.empty() ? "" : "; ") + std::string(kLawNames[law]) + ": " + r.findings[law].text;
    out << ',' << quoted(r.organs) << ',' << quoted(r.materials) << ',' << quoted(broke) << '\n';
  }
}

}  // namespace meshless
