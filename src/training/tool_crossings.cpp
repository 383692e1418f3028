#include "meshless_surgery/training/tool_crossings.h"

#include <algorithm>
#include <cmath>

namespace meshless {
namespace {

constexpr double kMostLooks = 1000.0;  // in a step

double shareOf(double along, double square) { return square > 0.0 ? std::clamp(along / square, 0.0, 1.0) : 0.0; }

}  // namespace

// The nearest points of two lines, or an end of one and the nearest point of the other.
double segmentDistance(const Vec3& from_a, const Vec3& to_a, const Vec3& from_b, const Vec3& to_b) {
  const Vec3 a = to_a - from_a, b = to_b - from_b, way = from_a - from_b;
  const double aa = a.squaredNorm(), bb = b.squaredNorm(), ab = a.dot(b);
  const double det = aa * bb - ab * ab;
  double best = std::numeric_limits<double>::infinity();
  const auto look = [&](double s, double t) { best = std::min(best, (way + s * a - t * b).norm()); };
  for (const double s : {0.0, 1.0}) look(s, shareOf((way + s * a).dot(b), bb));
  for (const double t : {0.0, 1.0}) look(shareOf((t * b - way).dot(a), aa), t);
  if (det > 1e-12 * aa * bb) {
    const double s = (ab * way.dot(b) - bb * way.dot(a)) / det, t = (aa * way.dot(b) - ab * way.dot(a)) / det;
    if (s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0) look(s, t);
  }
  return best;
}

void ToolCrossings::feed(const std::vector<TrainingFrame::Tool>& tools) {
  std::map<Key, Axis> now;
  std::set<std::pair<Key, Key>> near;
  for (const TrainingFrame::Tool& tool : tools) now[{tool.kind, tool.pick}] = {tool.position, tool.tissue};
  for (std::size_t i = 0; i < tools.size(); ++i)
    for (std::size_t j = i + 1; j < tools.size(); ++j) {
      const Key keys[2] = {{tools[i].kind, tools[i].pick}, {tools[j].kind, tools[j].pick}};
      Axis after[2], before[2];
      double way = 0.0;
      for (int k = 0; k < 2; ++k) {
        after[k] = now.at(keys[k]);
        const auto known = last_.find(keys[k]);
        before[k] = known == last_.end() ? after[k] : known->second;
        way += std::max((after[k].from - before[k].from).norm(), (after[k].to - before[k].to).norm());
      }
      const double apart = tools[i].radius + tools[j].radius;
      const double looks = std::clamp(std::ceil(2.0 * way / apart), 1.0, kMostLooks);
      bool met = false, meet = false;
      for (double look = 1.0; look <= looks; ++look) {
        Axis at[2];
        for (int k = 0; k < 2; ++k) {
          at[k].from = before[k].from + look / looks * (after[k].from - before[k].from);
          at[k].to = before[k].to + look / looks * (after[k].to - before[k].to);
        }
        meet = segmentDistance(at[0].from, at[0].to, at[1].from, at[1].to) < apart;
        met = met || meet;
      }
      const std::pair<Key, Key> pair(keys[0], keys[1]);
      if (met && !near_.count(pair)) ++count_;
      if (meet) near.insert(pair);
    }
  last_ = std::move(now);
  near_ = std::move(near);
}

}  // namespace meshless
