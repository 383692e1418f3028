#include "meshless_surgery/training/report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "meshless_surgery/base/number_text.h"
#include "report_text.h"

namespace meshless {

std::string outcomeOf(const Training& training) {
  if (training.progress().done()) return "done";
  if (!training.progress().failed().empty()) return "failed";
  return "unfinished";
}

std::string numberOf(double value) { return std::isfinite(value) ? numberText(value, 17) : ""; }

const WeightedMetric* weightedOf(const Training& training, const std::string& name) {
  for (const WeightedMetric& metric : training.task().metrics)
    if (metric.name == name) return &metric;
  return nullptr;
}

std::vector<std::string> allowedIn(const TaskDef& task) {
  std::vector<std::string> words;
  for (const Intervention intervention : task.allow) words.push_back(toString(intervention));
  return words;
}

namespace {

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      char code[8];
      std::snprintf(code, sizeof code, "\\u%04x", static_cast<unsigned>(static_cast<unsigned char>(c)));
      out += code;
    } else {
      out += c;
    }
  }
  return out + '"';
}

std::string joinedText(const std::vector<std::string>& texts) {
  std::string out;
  for (const std::string& text : texts) out += (out.empty() ? "" : ", ") + quoted(text);
  return out;
}

std::string numberOrNull(double value) { return std::isfinite(value) ? numberOf(value) : "null"; }

}  // namespace

std::string reportJson(const Training& training, const ReportHead& head) {
  const TaskDef& task = training.task();
  const TaskProgress& progress = training.progress();
  std::string out = "{\n  \"format\": 1,\n";
  out += "  \"task\": " + quoted(task.name) + ",\n  \"scene\": " + quoted(task.scene) + ",\n";
  out += "  \"trainee\": " + quoted(head.trainee) + ",\n  \"log\": " + quoted(head.log) + ",\n";
  out += "  \"date\": " + (head.date.empty() ? "null" : quoted(head.date)) + ",\n";
  out += "  \"hashes_met\": " + std::string(head.hashes_met ? "true" : "false") + ",\n";
  out += "  \"lost\": " + quoted(head.lost) + ",\n";
  out += "  \"first_step\": " + std::to_string(training.firstStep()) +
         ",\n  \"last_step\": " + std::to_string(training.lastStep()) + ",\n";
  out += "  \"outcome\": " + quoted(outcomeOf(training)) + ",\n  \"failed\": " + quoted(progress.failed()) + ",\n";
  out +=
      "  \"score\": " + numberOrNull(training.score()) + ",\n  \"pass_mark\": " + numberOrNull(task.pass_mark) + ",\n";
  out += "  \"passed\": " + std::string(training.passed() ? "true" : "false") +
         ",\n  \"counted\": " + (training.notCounted().empty() ? "true" : "false") + ",\n  \"not_counted\": [" +
         joinedText(training.notCounted()) + "],\n  \"allowed\": [" + joinedText(allowedIn(task)) +
         "],\n  \"package_version\": " + quoted(MESHLESS_SURGERY_VERSION) +
         ",\n  \"task_version\": " + quoted(task.version) + ",\n  \"stages\": [";
  for (std::size_t s = 0; s < task.stages.size(); ++s)
    out += std::string(s ? "," : "") + "\n    {\"name\": " + quoted(task.stages[s].name) +
           ", \"met_at\": " + (s < progress.times().size() ? numberOf(progress.times()[s]) : "null") + "}";
  out += "\n  ],\n  \"metrics\": [";
  bool first = true;
  for (const MetricValue& value : training.values()) {
    out += std::string(first ? "" : ",") + "\n    {\"name\": " + quoted(value.name) +
           ", \"unit\": " + quoted(findMetric(value.name)->unit) + ", \"value\": " + numberOrNull(value.value);
    if (const WeightedMetric* metric = weightedOf(training, value.name)) {
      out += ", \"weight\": " + numberOf(metric->weight) + ", \"good\": " + numberOf(metric->good) +
             ", \"bad\": " + numberOf(metric->bad) + ", \"score\": " + numberOf(100.0 * scoreOf(*metric, value.value));
      if (metric->pass)
        out += ", \"pass\": " + numberOf(*metric->pass) +
               ", \"passed\": " + (passes(*metric, value.value) ? "true" : "false");
    }
    out += "}";
    first = false;
  }
  out += "\n  ],\n  \"events\": [";
  const std::size_t shown = std::min<std::size_t>(training.events().size(), 2000);
  for (std::size_t k = 0; k < shown; ++k) {
    const TrainingEvent& event = training.events()[k];
    out += std::string(k ? "," : "") + "\n    {\"time\": " + numberOf(event.time) +
           ", \"error\": " + (event.error ? "true" : "false") + ", \"text\": " + quoted(event.text) + "}";
  }
  return out + "\n  ]\n}\n";
}

std::string reportCsv(const Training& training) {
  std::string out = "metric,unit,value,score,weight,good,bad,pass,passed\n";
  for (const MetricValue& value : training.values()) {
    out += value.name + "," + findMetric(value.name)->unit + "," + numberOf(value.value) + ",";
    if (const WeightedMetric* metric = weightedOf(training, value.name)) {
      out += numberOf(100.0 * scoreOf(*metric, value.value)) + "," + numberOf(metric->weight) + "," +
             numberOf(metric->good) + "," + numberOf(metric->bad) + "," +
             (metric->pass ? numberOf(*metric->pass) : "") + "," +
             (metric->pass ? (passes(*metric, value.value) ? "true" : "false") : "");
    } else {
      out += ",,,,,";
    }
    out += "\n";
  }
  return out;
}

std::string metricsMarkdown() {
  std::string out = "| name | unit | better | what it is | source |\n|---|---|---|---|---|\n";
  for (const MetricRow& row : metricTable()) {
    out += "| `" + std::string(row.name) + (row.per_hand ? ".HAND" : "") + "` | " + row.unit + " | " +
           (row.better == Better::kLower ? "lower" : "higher") + " | ";
    for (const char* c = row.formula; *c; ++c) out += *c == '|' ? std::string("\\|") : std::string(1, *c);
    out += " | " + std::string(row.source) + " |\n";
  }
  return out;
}

}  // namespace meshless
