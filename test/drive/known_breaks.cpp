#include "drive/known_breaks.h"

#include <algorithm>
#include <istream>
#include <set>

#include "drive/words.h"

namespace meshless {
namespace {

Error malformed(std::size_t line, const std::string& why) {
  return Error{ErrorCode::kInvalidArgument, words("line ", line, ": ", why)};
}

std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \t");
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(" \t\r") + 1 - begin);
}

}  // namespace

Result<std::vector<KnownBreak>> readKnownBreaks(std::istream& in) {
  std::vector<KnownBreak> known;
  std::set<std::string> seeds;
  std::string text;
  for (std::size_t line = 1; std::getline(in, text); ++line) {
    text = trimmed(text);
    if (text.empty() || text[0] == '#') continue;
    std::array<std::string, 3> parts;
    std::istringstream fields(text);
    for (std::string& part : parts) {
      std::getline(fields, part, '|');
      part = trimmed(part);
      if (part.empty()) return malformed(line, "'" + text + "'; accepted: SEED | LAW | REASON");
    }
    if (parts[0].find_first_not_of("0123456789") != std::string::npos)
      return malformed(line, "seed is '" + parts[0] + "'; accepted: a whole number");
    const auto law = std::find(kLawNames.begin(), kLawNames.end(), parts[1]);
    if (law == kLawNames.end()) {
      std::string accepted;
      for (const char* name : kLawNames) accepted += (accepted.empty() ? "" : ", ") + std::string(name);
      return malformed(line, "law is '" + parts[1] + "'; accepted: " + accepted);
    }
    seeds.insert(parts[0]);
    if (seeds.size() > kMostKnownBreaks)
      return malformed(line, words("more than ", kMostKnownBreaks, " scenes are known"));
    known.push_back({std::stoull(parts[0]), static_cast<Law>(law - kLawNames.begin()), parts[2]});
  }
  return known;
}

std::vector<std::string> unlikeKnown(const std::vector<DriveReport>& reports, const std::vector<KnownBreak>& known) {
  std::vector<std::string> said;
  for (const DriveReport& report : reports) {
    if (!report.refused.empty()) said.push_back(words("seed ", report.seed, " was refused: ", report.refused));
    const auto broken = [&report](Law law) { return report.findings[static_cast<std::size_t>(law)].broken(); };
    bool listed = false, breaks = false;
    for (const KnownBreak& one : known) {
      if (one.seed != report.seed) continue;
      listed = true;
      breaks = breaks || broken(one.law);
    }
    if (listed && !breaks && report.finished)
      said.push_back(words("seed ", report.seed, " holds what it is known to break: take it off the list"));
    for (std::size_t n = 0; n < kLaws && !listed; ++n)
      if (broken(static_cast<Law>(n)))
        said.push_back(words("seed ", report.seed, " breaks ", kLawNames[n], ": ", report.findings[n].text));
  }
  return said;
}

}  // namespace meshless
