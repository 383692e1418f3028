// What many scenes came to.
#pragma once

#include <iosfwd>

#include "drive/drive.h"

namespace meshless {

/// A line each, as they come.
void printHead(std::ostream& out);
void printRow(std::ostream& out, const DriveReport& report);

/// The worst first; at most `count`, those that hold left out.
std::vector<const DriveReport*> worstOf(const std::vector<DriveReport>& reports, std::size_t count);

/// How many hold, which laws break, by material, support and number of cuts; and what the worst ten broke.
void printSummary(std::ostream& out, const std::vector<DriveReport>& reports);

void writeCsv(std::ostream& out, const std::vector<DriveReport>& reports);

}  // namespace meshless
