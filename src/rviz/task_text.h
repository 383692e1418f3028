// What the panel says of a task.
#pragma once

#include <meshless_surgery/TaskState.h>
#include <QString>

namespace meshless {

/// Rich text of a few lines: brief, the present stage, limits; once it is over, how it ended.
QString taskText(const meshless_surgery::TaskState& task);

}  // namespace meshless
