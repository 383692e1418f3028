// Task files (YAML), and reports that were written before.
#pragma once

#include <chrono>

#include "meshless_surgery/io/scene.h"
#include "meshless_surgery/training/report.h"

namespace meshless {

struct LoadedTask {
  TaskDef task;
  SceneDef scene;
  std::string scene_file;  // a path
  std::string file;        // a path
};

/// Else it is a name of config/tasks.
bool isTaskFile(const std::string& task);

/// Reads a task and its scene. `file` is a path. The scene is a name of `scene_folder`, a path from the task's folder on,
/// or package://. Errors read "<file>:<line>: <what>; accepted: <range>"; a task that its scene does not allow
/// (findTaskFault) is refused likewise. With `only_scene`, a path, no other scene is read. Without `scene_folder` the
/// task alone is read. What the task's own folder has may be read, whatever `access` says.
///
/// scene, brief, picture
/// plan: {body, origin, along, out, length, depth, tolerance}       in the rest shape where the scene puts it
/// target: {body, box | sphere | plane}                             likewise
/// tray, view: {min, max}                                           in the world
/// stages: a list of {name, brief, hold_for, and one of
///   reach: {tool, box | sphere}, stretch_to: {body, distance}, press_to: {force, tool, box | sphere},
///   cut_along: {share}, separate: [a, b], remove_to: tray, leave_nothing: {share}, let_go: all,
///   clip: {body, box | sphere}, hold: {body, picks}, hand_over: {body}, put_back: {body, distance},
///   put_on: {bodies, obstacles, handed_over}}
/// limits: {time, force, strain, forbidden: [{name, body | box | sphere}], end: [time, force, strain, forbidden]}
/// metrics: {NAME: {weight, good, bad, pass}}
/// pass_mark
Result<LoadedTask> readTask(const std::string& file, const std::optional<std::string>& scene_folder,
                            const FileAccess& access, const std::string& only_scene = "");

/// In UTC, as in 2026-03-01T14:05:09.250Z: in the order of letters is the order of time.
std::string dateText(std::chrono::system_clock::time_point time);
std::string dateText(double seconds);  // since 1970
/// Whether it is one, to the second or to the millisecond.
bool isDate(const std::string& text);

/// Of the folders in `folder` that have a report.json of that trainee and task, the oldest first, by their dates; one
/// without has that of its file. `but`: not that folder. What is no report is passed over.
std::vector<EarlierReport> readEarlierReports(const std::string& folder, const std::string& trainee,
                                              const std::string& task, const std::string& but);

}  // namespace meshless
