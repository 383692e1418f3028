// What the elastic forces of a substep cost: bytes and operations as the source has them, and the time that they take.
#pragma once

#include "meshless_surgery/body/body.h"

namespace meshless::bench {

/// Of one call of ElasticBatch::accelerate().
struct ElasticWork {
  double bytes = 0.0;       // each array that outlives a block once for each pass that reads or writes it
  double operations = 0.0;  // additions, multiplications, divisions and roots in double, each counted as one
};
/// Needs a body of filled cells without plastic flow.
ElasticWork elasticWork(const BodyModel& model);

struct ElasticTime {
  double seconds = 0.0;  // of a call, the best of several passes
  std::size_t cold = 0;  // rotations of all calls that Newton's method did not find: not in elasticWork()
};
/// On one thread, from positions that turn and stretch from call to call about as they do from substep to substep, so
/// that a rotation takes its usual two steps. `material` is elastic.
ElasticTime timeElastic(const BodyModel& model, const Material& material);

}  // namespace meshless::bench
