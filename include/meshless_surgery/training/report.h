// What is handed to the trainee: one page that needs no network, and the same numbers for programs.
#pragma once

#include "meshless_surgery/training/training.h"

namespace meshless {

/// An older report of the same trainee and task.
struct EarlierReport {
  std::string name;  // of its folder
  double score = 0.0;
  bool passed = false;
  std::map<std::string, double> values;  // what could be measured
};

struct ReportHead {
  std::string trainee, log;            // the file's name of the log; empty: none is written
  bool hashes_met = true;              // the replay came to the recorded states
  std::string lost;                    // a sentence, where the log is not whole
  std::vector<EarlierReport> earlier;  // oldest first
  std::string date;                    // when it was done, as dateText() (io/task.h) writes it; empty: not known
};

/// One object: task, trainee, log, date, outcome, stages, score, metrics with their goals, events.
std::string reportJson(const Training& training, const ReportHead& head);
/// A line a metric: name, unit, value, score, weight, good, bad, pass, passed. Empty where there is nothing.
std::string reportCsv(const Training& training);
/// One page; pictures are SVG in it.
std::string reportHtml(const Training& training, const ReportHead& head);

/// docs/metrics.md's table of metricTable().
std::string metricsMarkdown();

}  // namespace meshless
