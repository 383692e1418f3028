#include "task_text.h"

#include <cmath>

#include <QStringList>

namespace meshless {

QString taskText(const meshless_surgery::TaskState& task, double time) {
  const auto text = [](const std::string& words) { return QString::fromStdString(words).toHtmlEscaped(); };
  QStringList lines{"<b>" + text(task.task) + "</b>: " + text(task.brief)};
  if (task.running && task.stage < task.stages.size()) {
    const QString now = QString("<b>Now, %1 of %2: %3</b>")
                            .arg(task.stage + 1)
                            .arg(task.stages.size())
                            .arg(text(task.stages[task.stage]));
    lines << (task.stage_brief.empty() ? now : now + ". " + text(task.stage_brief));
    QStringList limits;
    if (task.settling) lines << "The scene comes to rest first";
    if (time >= 0.0 && !task.settling) lines << QString("Time: %1 s").arg(time, 0, 'f', 0);
    if (task.time_limit > 0.0) limits << QString("%1 s").arg(task.time_limit);
    if (task.force_limit > 0.0) limits << QString("%1 N").arg(task.force_limit);
    if (!limits.isEmpty()) lines << "Limits: " + limits.join(", ");
    if (std::isfinite(task.plan_done)) lines << QString("Plan: %1 % is cut").arg(100.0 * task.plan_done, 0, 'f', 0);
  } else if (!task.failed.empty()) {
    lines << "<b>Failed</b>: " + text(task.failed);
  } else {
    const char* const end = task.stage < task.stages.size() ? "Stopped" : task.passed ? "Passed" : "Not passed";
    lines << QString("<b>%1</b>, %2 of 100").arg(end).arg(task.score, 0, 'f', 0);
  }
  for (const std::string& why : task.not_counted) lines << "<b>Does not count</b>: " + text(why);
  return lines.join("<br>");
}

}  // namespace meshless
