// The page: a line of time, the plan and the cut, the metrics, earlier reports.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "meshless_surgery/base/number_text.h"
#include "report_text.h"

namespace meshless {
namespace {

constexpr double kWidth = 960.0, kRow = 130.0, kLeft = 60.0, kRight = 20.0;
constexpr std::size_t kMostColumns = 900, kMostMarks = 300;
constexpr double kWell = 0.8;  // of a metric's marks
const char* const kHandColors[kHands] = {"#1f6fb2", "#7a4fb0", "#2e8b57", "#c2571a", "#0b7a8c", "#8c6d0b"};

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
  return out;
}

std::string shortNumber(double value) {
  return std::isfinite(value) ? numberText(value + 0.0, 3) : "&ndash;";  // no "-0"
}

std::string at(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.1f", value);
  return text == std::string("-0.0") ? "0.0" : text;
}

/// Units as surgeons use them.
struct ShownUnit {
  const char* name;
  double per_si;
};
ShownUnit shownUnit(const std::string& unit) {
  if (unit == "m") return {"mm", 1e3};
  if (unit == "m/s") return {"mm/s", 1e3};
  if (unit == "m^2") return {"cm&sup2;", 1e4};
  if (unit == "m^3") return {"ml", 1e6};
  if (unit == "rad") return {"&deg;", 180.0 / M_PI};
  if (unit == "N s") return {"N s", 1.0};
  if (unit == "N") return {"N", 1.0};
  return unit == "s" ? ShownUnit{"s", 1.0} : ShownUnit{"", 1.0};
}
std::string shownValue(const MetricRow& row, double value, bool with_unit = false) {
  const ShownUnit unit = shownUnit(row.unit);
  return shortNumber(unit.per_si * value) + (with_unit && *unit.name ? std::string(" ") + unit.name : "");
}

std::string svg(double width, double height, const std::string& inside, const std::string& title) {
  return "<svg viewBox=\"0 0 " + at(width) + " " + at(height) + "\" role=\"img\" aria-label=\"" + escaped(title) +
         "\"><title>" + escaped(title) + "</title>" + inside + "</svg>\n";
}

std::string line(double x0, double y0, double x1, double y1, const std::string& look) {
  return "<line x1=\"" + at(x0) + "\" y1=\"" + at(y0) + "\" x2=\"" + at(x1) + "\" y2=\"" + at(y1) + "\" " + look + "/>";
}

std::string label(double x, double y, const std::string& text, const std::string& anchor = "start") {
  return "<text x=\"" + at(x) + "\" y=\"" + at(y) + "\" text-anchor=\"" + anchor + "\">" + text + "</text>";
}

/// The largest of each column's moments.
std::vector<double> columns(const Training& training, const std::function<double(const TrainingMoment&)>& of) {
  const auto& moments = training.moments();
  const std::size_t count = std::min(kMostColumns, moments.size());
  std::vector<double> most(count, 0.0);
  for (std::size_t k = 0; k < moments.size(); ++k) {
    double& column = most[k * count / moments.size()];
    column = std::max(column, of(moments[k]));
  }
  return most;
}

std::string curve(const std::vector<double>& values, double top, double most, const std::string& color) {
  if (values.empty() || !(most > 0.0)) return "";
  std::string path;
  for (std::size_t k = 0; k < values.size(); ++k)
    path +=
        (k ? " " : "") +
        at(kLeft + (kWidth - kLeft - kRight) * (static_cast<double>(k) + 0.5) / static_cast<double>(values.size())) +
        "," + at(top + (kRow - 30.0) * (1.0 - values[k] / most));
  return "<polyline fill=\"none\" stroke=\"" + color + "\" stroke-width=\"1.4\" points=\"" + path + "\"/>";
}

std::string frameOfRow(double top, const std::string& title, double most, const std::string& unit) {
  return "<rect x=\"" + at(kLeft) + "\" y=\"" + at(top) + "\" width=\"" + at(kWidth - kLeft - kRight) + "\" height=\"" +
         at(kRow - 30.0) + "\" fill=\"#fafafa\" stroke=\"#ccc\"/>" +
         label(kLeft - 6, top + 10, shortNumber(most), "end") + label(kLeft - 6, top + kRow - 30.0, "0", "end") +
         label(kLeft, top - 5, title + " [" + unit + "]");
}

/// What there was nothing of is left out.
std::string timeLine(const Training& training) {
  const double whole = std::max(training.metrics().time(), 1e-9);
  const double wide = kWidth - kLeft - kRight;
  double top = 20.0;
  std::string inside;
  const std::vector<double> force = columns(training, [](const TrainingMoment& moment) { return moment.force; });
  double most = 0.0;
  for (const double f : force) most = std::max(most, f);
  if (most > 0.0) {
    const double limit = training.task().limits.measured.force;
    if (std::isfinite(limit)) most = std::max(most, 1.1 * limit);
    inside += frameOfRow(top, "largest force of a tool", most, "N") + curve(force, top, most, "#b22222");
    if (std::isfinite(limit)) {
      const double y = top + (kRow - 30.0) * (1.0 - limit / most);
      inside += line(kLeft, y, kWidth - kRight, y, "stroke=\"#b22222\" stroke-dasharray=\"6 4\"") +
                label(kWidth - kRight - 4, y - 4, "limit", "end");
    }
    top += kRow;
  }
  std::array<std::vector<double>, kHands> speeds;
  most = 0.0;
  for (std::size_t h = 0; h < kHands; ++h) {
    speeds[h] = columns(training, [h](const TrainingMoment& moment) { return 1e3 * moment.speed[h]; });
    for (const double v : speeds[h]) most = std::max(most, v);
  }
  if (most > 0.0) {
    inside += frameOfRow(top, "speed of the hands", most, "mm/s");
    double legend = kLeft + 170.0;
    for (std::size_t h = 0; h < kHands; ++h) {
      if (!training.metrics().motion(static_cast<Hand>(h)).seen()) continue;
      inside += curve(speeds[h], top, most, kHandColors[h]);
      inside += line(legend, top - 9, legend + 18, top - 9,
                     "stroke=\"" + std::string(kHandColors[h]) + "\" stroke-width=\"3\"");
      inside += label(legend + 23, top - 5, toString(static_cast<Hand>(h)));
      legend += 95.0;
    }
    top += kRow;
  }
  inside += label(kLeft, top - 5, "stages met (green), what was done (grey), errors (red)");
  std::size_t marks = 0;
  for (const TrainingEvent& event : training.events()) {
    if (++marks > kMostMarks) break;
    const double x = kLeft + wide * std::min(1.0, event.time / whole);
    const bool stage = event.text.compare(0, 9, "stage met") == 0;
    inside += "<g><title>" + at(event.time) + " s: " + escaped(event.text) + "</title>" +
              line(x, top, x, top + 22,
                   "stroke=\"" +
                       std::string(event.error ? "#c00"
                                   : stage     ? "#2a2"
                                               : "#888") +
                       "\" stroke-width=\"" + (event.error || stage ? "3" : "1.5") + "\"") +
              "</g>";
  }
  for (int k = 0; k <= 5; ++k)
    inside += label(kLeft + wide * k / 5.0, top + 40, at(whole * k / 5.0) + " s", k == 5 ? "end" : "middle");
  return svg(kWidth, top + 50.0, inside, "what happened over time");
}

/// Where the stages are done.
std::vector<Region> regionsOf(const TaskDef& task) {
  std::vector<Region> all;
  for (const Stage& stage : task.stages) {
    if (const auto* reach = std::get_if<Reach>(&stage.condition)) all.push_back(reach->region);
    const auto add = [&](const std::optional<Region>& region) {
      if (region) all.push_back(*region);
    };
    if (const auto* press = std::get_if<PressTo>(&stage.condition)) add(press->region);
    if (const auto* hold = std::get_if<Hold>(&stage.condition)) add(hold->region);
    if (const auto* clipped = std::get_if<Clipped>(&stage.condition)) add(clipped->region);
  }
  if (task.tray) all.push_back(Region(*task.tray));
  return all;
}

struct View {
  const char* name;
  int across, up;
};

std::string dots(const Points& points, const View& view, const std::function<Vec2(const Vec3&, const View&)>& place,
                 const std::string& color, double size, std::size_t most) {
  std::string path;
  const std::size_t every = std::max<std::size_t>(1, points.size() / most);
  for (std::size_t k = 0; k < points.size(); k += every) {
    const Vec2 p = place(points[k], view);
    path += "M" + at(p.x()) + " " + at(p.y()) + "h0";
  }
  if (path.empty()) return "";
  return "<path d=\"" + path + "\" stroke=\"" + color + "\" stroke-width=\"" + at(size) +
         "\" stroke-linecap=\"round\" fill=\"none\"/>";
}

std::string views(const Training& training) {
  constexpr double kSide = 310.0;
  Box bounds;
  for (const Vec3& p : training.outline()) bounds.extend(p);
  for (const Vec3& p : training.tissue().planPoints()) bounds.extend(p);
  for (const Vec3& p : training.tissue().cut().points) bounds.extend(p);
  if (bounds.empty()) return "";
  const Vec3 around = Vec3::Constant(0.5 * (bounds.max - bounds.min).maxCoeff());  // hands farther away are not shown
  const Box near{bounds.min - around, bounds.max + around};
  for (const TrainingMoment& moment : training.moments())
    for (const auto& place : moment.place)
      if (place && near.contains(*place)) bounds.extend(*place);
  const double scale = (kSide - 40.0) / std::max(1e-9, (bounds.max - bounds.min).maxCoeff());
  const Vec3 middle = 0.5 * (bounds.min + bounds.max);
  std::string out = "<div class=\"views\">";
  for (const View& view :
       {View{"from above (x, y)", 0, 1}, View{"from the front (x, z)", 0, 2}, View{"from the side (y, z)", 1, 2}}) {
    const auto place = [&](const Vec3& p, const View& v) {
      return Vec2(0.5 * kSide + scale * (p[v.across] - middle[v.across]),
                  0.5 * kSide - scale * (p[v.up] - middle[v.up]));
    };
    std::string inside = dots(training.outline(), view, place, "#d8c9c0", 2.5, 1500);
    if (training.task().target && training.task().target->region.kind == Region::Kind::kSphere) {
      const Region& region = training.task().target->region;
      const Vec2 p = place(region.centre, view);
      inside += "<circle cx=\"" + at(p.x()) + "\" cy=\"" + at(p.y()) + "\" r=\"" + at(scale * region.radius) +
                "\" fill=\"#e0c040\" fill-opacity=\"0.5\"/>";
    }
    const std::string dashed = "fill=\"none\" stroke=\"#2a8a3a\" stroke-dasharray=\"4 3\"";
    for (const Region& region : regionsOf(training.task())) {
      if (region.kind == Region::Kind::kSphere && near.contains(region.centre)) {
        const Vec2 p = place(region.centre, view);
        inside += "<circle cx=\"" + at(p.x()) + "\" cy=\"" + at(p.y()) + "\" r=\"" + at(scale * region.radius) + "\" " +
                  dashed + "/>";
      } else if (region.kind == Region::Kind::kBox && near.contains(0.5 * (region.box.min + region.box.max))) {
        const Vec2 a = place(region.box.min, view), b = place(region.box.max, view);
        inside += "<rect x=\"" + at(a.x()) + "\" y=\"" + at(b.y()) + "\" width=\"" + at(b.x() - a.x()) +
                  "\" height=\"" + at(a.y() - b.y()) + "\" " + dashed + "/>";
      }
    }
    inside += dots(training.tissue().planPoints(), view, place, "#1f6fb2", 3.0, 800);
    inside += dots(training.tissue().cut().points, view, place, "#c2271a", 1.8, 1200);
    for (std::size_t h = 0; h < kHands; ++h) {
      std::string way;
      const std::size_t every = std::max<std::size_t>(1, training.moments().size() / kMostColumns);
      for (std::size_t k = 0; k < training.moments().size(); k += every) {
        const auto& there = training.moments()[k].place[h];
        if (!there || !bounds.contains(*there)) {
          if (!way.empty() && way.back() != ' ') way += ' ';
          continue;
        }
        const Vec2 p = place(*there, view);
        way += (way.empty() || way.back() == ' ' ? "M" : "L") + at(p.x()) + "," + at(p.y());
      }
      if (!way.empty())
        inside += "<path d=\"" + way + "\" fill=\"none\" stroke=\"" + std::string(kHandColors[h]) +
                  "\" stroke-opacity=\"0.5\"/>";
    }
    inside += label(8, 16, view.name);
    const double centimetre = scale * 0.01;
    inside += line(10, kSide - 10, 10 + 2 * centimetre, kSide - 10, "stroke=\"#333\" stroke-width=\"2\"") +
              label(14 + 2 * centimetre, kSide - 6, "2 cm");
    out += svg(kSide, kSide, inside, std::string("the tissue ") + view.name);
  }
  out += "</div><p class=\"key\">Tissue at rest (grey)";
  if (training.task().plan) out += ", <b style=\"color:#1f6fb2\">plan</b>";
  if (!training.tissue().cut().points.empty()) out += ", <b style=\"color:#c2271a\">cut</b>";
  if (training.task().target) out += ", target (yellow)";
  if (!regionsOf(training.task()).empty()) out += ", where the task says (green, dashed)";
  return out + ", ways of the hands (thin).</p>\n";
}

std::string metricRows(const Training& training, bool counting) {
  std::string out;
  for (const MetricValue& value : training.values()) {
    const WeightedMetric* metric = weightedOf(training, value.name);
    if ((metric != nullptr) != counting || (!counting && !std::isfinite(value.value))) continue;
    const MetricRow& row = *findMetric(value.name);
    out += "<tr><td title=\"" + escaped(row.formula) + "\">" + value.name + "</td><td class=\"n\">" +
           shownValue(row, value.value) + "</td><td>" + shownUnit(row.unit).name + "</td>";
    if (metric) {
      const double score = scoreOf(*metric, value.value);
      const bool good = passes(*metric, value.value);
      std::string bar = "<rect width=\"200\" height=\"12\" fill=\"#eee\"/><rect width=\"" + at(200.0 * score) +
                        "\" height=\"12\" fill=\"" + (good ? "#3a9a4a" : "#c23a2a") + "\"/>";
      if (metric->pass) {
        const double x = 200.0 * scoreOf(*metric, *metric->pass);
        bar += line(x, -1, x, 13, "stroke=\"#000\" stroke-width=\"2\"");
      }
      out += "<td class=\"n\">" + (metric->pass ? shownValue(row, *metric->pass) : "") + "</td><td>" +
             svg(200.0, 12.0, bar, value.name + ": " + at(100.0 * score) + " of 100") + "</td><td class=\"n\">" +
             at(100.0 * score) + "</td><td class=\"n\">" + shortNumber(metric->weight) + "</td>";
    }
    out += "</tr>\n";
  }
  return out;
}

std::string earlierReports(const Training& training, const ReportHead& head) {
  if (head.earlier.empty()) return "<p>There is no earlier report of this trainee and task here.</p>\n";
  std::vector<double> scores;
  for (const EarlierReport& earlier : head.earlier) scores.push_back(earlier.score);
  scores.push_back(training.score());
  const double wide = kWidth - kLeft - kRight, high = 120.0;
  std::string inside = frameOfRow(20.0, "score", 100.0, "of 100"), path;
  const double top = 20.0, row = kRow - 30.0;
  for (std::size_t k = 0; k < scores.size(); ++k) {
    const double x = kLeft + wide * (static_cast<double>(k) + 0.5) / static_cast<double>(scores.size());
    const double y = top + row * (1.0 - scores[k] / 100.0);
    path += (k ? " " : "") + at(x) + "," + at(y);
    inside += "<circle cx=\"" + at(x) + "\" cy=\"" + at(y) + "\" r=\"" + (k + 1 == scores.size() ? "6" : "4") +
              "\" fill=\"#1f6fb2\"><title>" +
              escaped(k < head.earlier.size() ? head.earlier[k].name : std::string("this one")) + ": " + at(scores[k]) +
              "</title></circle>";
  }
  inside += "<polyline fill=\"none\" stroke=\"#1f6fb2\" points=\"" + path + "\"/>";
  const double mark = top + row * (1.0 - training.task().pass_mark / 100.0);
  inside += line(kLeft, mark, kWidth - kRight, mark, "stroke=\"#333\" stroke-dasharray=\"6 4\"") +
            label(kWidth - kRight - 4, mark - 4, "pass mark", "end");
  std::string out = svg(kWidth, high + 10.0, inside, "scores of this trainee, oldest first");
  out += "<table><tr><th>report</th><th>score</th>";
  for (const WeightedMetric& metric : training.task().metrics) {
    const ShownUnit unit = shownUnit(findMetric(metric.name)->unit);
    out += "<th>" + metric.name + (*unit.name ? std::string(" [") + unit.name + "]" : "") + "</th>";
  }
  out += "</tr>\n";
  const std::size_t first = head.earlier.size() > 20 ? head.earlier.size() - 20 : 0;
  for (std::size_t k = first; k < head.earlier.size(); ++k) {
    const EarlierReport& earlier = head.earlier[k];
    out += "<tr><td>" + escaped(earlier.name) + "</td><td class=\"n\">" + at(earlier.score) + "</td>";
    for (const WeightedMetric& metric : training.task().metrics) {
      const auto found = earlier.values.find(metric.name);
      out += "<td class=\"n\">" +
             (found == earlier.values.end() ? "&ndash;" : shownValue(*findMetric(metric.name), found->second)) +
             "</td>";
    }
    out += "</tr>\n";
  }
  out += "<tr class=\"now\"><td>this one</td><td class=\"n\">" + at(training.score()) + "</td>";
  const std::vector<MetricValue> all = training.values();
  for (const WeightedMetric& metric : training.task().metrics)
    for (const MetricValue& value : all)
      if (value.name == metric.name)
        out += "<td class=\"n\">" + shownValue(*findMetric(value.name), value.value) + "</td>";
  return out + "</tr></table>\n";
}

std::string items(const std::vector<std::string>& texts, const std::string& look) {
  std::string out = "<ul>";
  for (const std::string& text : texts) out += "<li class=\"" + look + "\">" + text + "</li>";
  return out + "</ul>\n";
}

/// Why it is not passed; empty: it is.
std::vector<std::string> whyNotPassed(const Training& training) {
  std::vector<std::string> why;
  const TaskDef& task = training.task();
  if (training.passed()) return why;
  for (const std::string& text : training.notCounted()) why.push_back("It does not count: " + escaped(text) + ".");
  if (const std::string& failed = training.progress().failed(); !failed.empty()) why.push_back(escaped(failed) + ".");
  for (std::size_t s = training.progress().stage(); s < task.stages.size(); ++s)
    why.push_back("The stage <b>" + escaped(task.stages[s].name) + "</b> was not met" +
                  (task.stages[s].brief.empty() ? "" : ": " + escaped(task.stages[s].brief)) + ".");
  if (!training.progress().done()) return why;
  for (const MetricValue& value : training.values()) {
    const WeightedMetric* metric = weightedOf(training, value.name);
    if (!metric || passes(*metric, value.value)) continue;
    const MetricRow& row = *findMetric(value.name);
    why.push_back("<b>" + value.name + "</b> is " + shownValue(row, value.value, true) + ", and must be " +
                  (metric->good < metric->bad ? "at most " : "at least ") + shownValue(row, *metric->pass, true) +
                  ": " + escaped(row.formula) + ".");
  }
  if (training.score() < task.pass_mark)
    why.push_back("The score of " + at(training.score()) + " is below the pass mark of " + at(task.pass_mark) + ".");
  return why;
}

/// What counts, in the order of the marks that it has gained or lost.
std::string praise(const Training& training) {
  if (!training.progress().done()) return "";
  std::vector<std::pair<double, std::string>> well, badly;
  for (const MetricValue& value : training.values()) {
    const WeightedMetric* metric = weightedOf(training, value.name);
    if (!metric || !std::isfinite(value.value)) continue;
    const MetricRow& row = *findMetric(value.name);
    const double score = scoreOf(*metric, value.value);
    const std::string text = "<b>" + value.name + "</b>: " + shownValue(row, value.value, true) + " (full marks at " +
                             shownValue(row, metric->good, true) + ")";
    if (score >= kWell)
      well.emplace_back(-metric->weight * score, text);
    else
      badly.emplace_back(-metric->weight * (1.0 - score), text);
  }
  const auto listed = [](std::vector<std::pair<double, std::string>>& all) {
    std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<std::string> texts;
    for (std::size_t k = 0; k < all.size() && k < 5; ++k) texts.push_back(all[k].second);
    return texts;
  };
  return (well.empty() ? "" : "<h2>Done well</h2>" + items(listed(well), "good")) +
         (badly.empty() ? "" : "<h2>To work on</h2>" + items(listed(badly), ""));
}

}  // namespace

std::string reportHtml(const Training& training, const ReportHead& head) {
  const TaskDef& task = training.task();
  const TaskProgress& progress = training.progress();
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>" + escaped(task.name) +
      (head.trainee.empty() ? "" : ", " + escaped(head.trainee)) +
      "</title>\n<style>body{font:15px/1.45 sans-serif;max-width:1000px;margin:24px auto;padding:0 16px;color:#222}"
      "h1{margin:0 0 4px}h2{margin:28px 0 8px;border-bottom:1px solid #ddd}svg{max-width:100%;height:auto}svg "
      "text{font:12px sans-serif;fill:#444}table{border-collapse:collapse}td,th{padding:3px 10px;border-bottom:1px "
      "solid "
      "#eee;text-align:left}td.n{text-align:right;font-variant-numeric:tabular-nums}.views{display:flex;flex-wrap:wrap;"
      "gap:8px}.views svg{width:310px;border:1px solid "
      "#ddd}tr.now{font-weight:bold}.good{color:#1c7a2c}.bad{color:#b0201"
      "0}.big{font-size:22px}.key{color:#555}td svg{width:200px}</style></head><body>\n";
  out += "<h1>" + escaped(task.name) + "</h1><p>" + escaped(task.brief) + "</p>\n";
  if (!task.picture.empty())
    out += "<p><img alt=\"what is to be done\" style=\"max-width:100%\" src=\"" + escaped(task.picture) + "\"></p>\n";
  out += "<p>" + (head.trainee.empty() ? "" : "Trainee: <b>" + escaped(head.trainee) + "</b>. ") +
         "Scene: " + escaped(task.scene) + (head.log.empty() ? "" : ". Log: " + escaped(head.log)) +
         ". Date: " + (head.date.empty() ? "not known" : escaped(head.date)) + ". Version " + MESHLESS_SURGERY_VERSION +
         (task.version.empty() ? "" : ", task " + escaped(task.version)) + ".</p>\n";
  if (const double wall = training.metrics().wallTime(); wall > 0.0)
    out += "<p class=\"key\">" + at(wall) + " s on the wall, at " + shortNumber(training.metrics().realTimeFactor()) +
           " of real time.</p>\n";
  else
    out += "<p class=\"key\">The steps were done by a script: there is no time on the wall.</p>\n";
  if (!task.allow.empty()) {
    std::string words;
    for (const std::string& word : allowedIn(task)) words += (words.empty() ? "" : ", ") + word;
    out += "<p class=\"key\">The task allows: " + words + ".</p>\n";
  }
  if (!head.hashes_met)
    out +=
        "<p class=\"bad\">The replay did not come to the states that were recorded: these numbers are of another "
        "session than the one that was seen.</p>\n";
  if (!head.lost.empty()) out += "<p class=\"bad\">" + escaped(head.lost) + "; the report is of what there is.</p>\n";
  out += "<p class=\"big " + std::string(training.passed() ? "good" : "bad") + "\">" +
         (training.passed() ? "Passed" : "Not passed") + ": " + at(training.score()) + " of 100 (pass mark " +
         at(task.pass_mark) + "), " + outcomeOf(training) + " after " + at(training.metrics().time()) + " s</p>\n";
  out += praise(training);
  if (const std::vector<std::string> why = whyNotPassed(training); !why.empty())
    out += "<h2>Why it is not passed</h2>" + items(why, "bad");
  out += "<h2>Stages</h2><ol>\n";
  for (std::size_t s = 0; s < task.stages.size(); ++s)
    out += "<li>" + escaped(task.stages[s].name) +
           (task.stages[s].brief.empty() ? "" : ": " + escaped(task.stages[s].brief)) + " &mdash; " +
           (s < progress.times().size() ? "<span class=\"good\">met at " + at(progress.times()[s]) + " s</span>"
                                        : "<span class=\"bad\">not met</span>") +
           "</li>\n";
  out += "</ol>\n";
  if (!task.metrics.empty())
    out +=
        "<h2>What counts</h2><table><tr><th>metric</th><th>value</th><th></th><th>must "
        "reach</th><th>score</th><th></th>"
        "<th>weight</th></tr>\n" +
        metricRows(training, true) + "</table>\n<p class=\"key\">A black mark is what must be reached." +
        (progress.done() ? "" : " The score is 0 until all stages are met.") + "</p>\n";
  out += "<h2>Over time</h2>" + timeLine(training);
  const bool cut = !training.tissue().cut().points.empty();
  out += std::string("<h2>") +
         (task.plan ? (cut ? "Plan and cut" : "The plan")
          : cut     ? "The cut"
                    : "Where it was done") +
         "</h2>" + views(training);
  out += "<h2>Earlier reports</h2>" + earlierReports(training, head);
  out += "<h2>All that was measured</h2><table>" + metricRows(training, false) + "</table>\n<h2>Events</h2><table>\n";
  const std::size_t shown = std::min(kMostMarks, training.events().size());
  for (std::size_t k = 0; k < shown; ++k) {
    const TrainingEvent& event = training.events()[k];
    out += "<tr" + std::string(event.error ? " class=\"bad\"" : "") + "><td class=\"n\">" + at(event.time) +
           " s</td><td>" + escaped(event.text) + "</td></tr>\n";
  }
  out += "</table>\n";
  if (training.events().size() > shown)
    out += "<p>" + std::to_string(training.events().size() - shown) + " more.</p>\n";
  return out + "</body></html>\n";
}

}  // namespace meshless
