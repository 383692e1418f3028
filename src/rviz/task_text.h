// What the panel says of a task.
#pragma once

#include <meshless_surgery/TaskState.h>
#include <QString>

namespace meshless {

/// Rich text of a few lines: brief, the present stage, limits; once it is over, how it ended.
/// `time`: [s] since its start; below 0: not known.
QString taskText(const meshless_surgery::TaskState& task, double time = -1.0);

}  // namespace meshless
