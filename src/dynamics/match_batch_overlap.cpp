#include "match_batch_core.h"

namespace meshless {

struct OverlapBatch::Impl : match_sets::OverlapCore {
  explicit Impl(const MatchInput& body) : OverlapCore(body, std::nullopt) {}
};

OverlapBatch::OverlapBatch(const MatchInput& body) : impl_(std::make_unique<Impl>(body)) {}
OverlapBatch::~OverlapBatch() = default;
OverlapBatch::OverlapBatch(OverlapBatch&&) noexcept = default;
OverlapBatch& OverlapBatch::operator=(OverlapBatch&&) noexcept = default;

void OverlapBatch::setState(const Points& positions, const Points& velocities, const std::vector<Quat>& rotations) {
  impl_->setState(positions, velocities, rotations);
}

void OverlapBatch::getState(Points& positions, Points& velocities, std::vector<Quat>& rotations) const {
  impl_->getState(positions, velocities, rotations);
}

void OverlapBatch::step(const BatchStep& step, MatchCounters& counters, const ForEach& for_each) {
  impl_->step(step, counters, for_each);
}

void OverlapBatch::match(const Points& y, MatchMode mode, double beta, std::vector<ClusterPose>& poses, Points& goals,
                         MatchCounters& counters, const ForEach& for_each) {
  impl_->match(y, mode, beta, poses, goals, counters, for_each);
}

}  // namespace meshless
