// The task that a trainee does on the running node: ~start_task, ~stop_task, ~report, ~task, ~metrics. What is measured
// is measured as a replay of the log does it (training/training.h).
#pragma once

#include <memory>
#include <optional>

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>

#include "meshless_surgery/io/task.h"
#include "rejections.h"
#include "runner.h"
#include "streamed_tools.h"

namespace meshless {

struct TrainingFolders {
  FileAccess access;
  std::string scene_file;     // of the scene that runs; tasks of another one are refused
  std::string scenes, tasks;  // config/scenes, config/tasks
  std::string reports;        // made when the first is written
  std::string log;            // the file's name that commands are logged to; empty: none
};

/// A name of config/tasks, or a file that may be read.
Result<LoadedTask> loadTask(const std::string& task, const TrainingFolders& folders);

class LiveTraining {
 public:
  LiveTraining(const ros::NodeHandle& private_handle, WorldRunner& runner, TrainingFolders folders,
               std::string world_frame, Rejections& rejections, const StreamedTools& tools);
  ~LiveTraining();

  /// Before the runner starts: the task of the parameter.
  void begin(TaskDef task, const std::string& trainee);
  /// Why a task that runs refuses it; from any thread.
  std::optional<Error> refuses(Intervention intervention) const;
  /// Services and topics, from now on.
  void start();
  /// No service is being answered any more, and none will be.
  void stop();

  // On the runner's thread.
  void heard(const std::vector<Event>& events);
  void changed(World& world, double dt);

 private:
  struct Handlers;
  std::unique_ptr<Handlers> handlers_;
};

}  // namespace meshless
