// Heaps of fast bodies that springs tear into one place: each point would be queried in all the others.
#include <algorithm>
#include <atomic>

#include "contacts_impl.h"

namespace meshless {
namespace {

Index vertexSamples(const ContactShape& shape) {
  const std::vector<ContactSample>& samples = shape.samples();
  const auto is_vertex = [](const ContactSample& s) { return !(s.share > 0.0); };
  return static_cast<Index>(std::partition_point(samples.begin(), samples.end(), is_vertex) - samples.begin());
}

std::size_t usualQueries(std::size_t points, const ContactShape& in) {
  return static_cast<std::size_t>(static_cast<double>(points) * in.crowding());
}

// Work [about a microsecond of one thread] of a usual query with all that follows from it; and in a substep, of a point
// that has passed through (a contact is made and swept), of one that is traced, and of any.
constexpr double kQueryWork = 5.0, kCaughtWork = 4.0, kFollowWork = 1.5, kSampleWork = 0.05;
constexpr double kMostWork = 1.5e5;  // of a frame, or so: beyond it stiff materials get fewer substeps
constexpr double kMostStops = 2e4;   // caught points times substeps that contacts ask for
constexpr double kFewest = 2.0;      // substeps that are always left

// About how many usual queries fast pairs make in a frame: beyond it they are queried only in some of its substeps.
constexpr std::size_t kMostAsked = 25000, kMostAskedEach = 2;  // of all, or so often of each there is

}  // namespace

Index samplesFor(const Pair& pair, const ContactShape& shape) {
  return pair.by_vertices ? vertexSamples(shape) : static_cast<Index>(shape.samples().size());
}

double Contacts::Impl::mostQueries() const {
  // In heaps of crumbs that are torn together, the points that pass through have to do between two queries.
  if (heap || caught.size() > many_caught) return static_cast<double>(kMostInHeap);
  return static_cast<double>(std::max(kMostAsked, kMostAskedEach * samples));
}

// By the queries of fast pairs and the points that have passed through: slow pairs are not queried again in a frame.
void Contacts::Impl::chooseSubsteps(double torn, double standing) {
  const double stops = static_cast<double>(caught.size());
  affordable_substeps = kAnySubsteps;
  if (asked_points > 0 || stops > 0.0) {
    const double round_work = kQueryWork * asked, rounds = std::max(1.0, mostQueries() / std::max(1.0, asked));
    const double each = kCaughtWork * stops + kFollowWork * static_cast<double>(asked_points) +
                        kSampleWork * static_cast<double>(samples);
    double most = kMostWork / (round_work + each);
    if (most > rounds) most = (kMostWork - rounds * round_work) / each;  // the other substeps are without queries
    affordable_substeps = static_cast<int>(std::clamp<double>(most, kFewest, kAnySubsteps));
  }
  double most = std::max(kFewest, kMostStops / std::max(1.0, stops));
  if (heap) most = std::min<double>(most, affordable_substeps);
  // A stack that bounces apart for a frame is still one.
  standing_substeps =
      std::max(standing_substeps - 1, static_cast<int>(std::ceil(std::min<double>(standing, kAnySubsteps))));
  needed_substeps = std::max(standing_substeps, static_cast<int>(std::ceil(std::clamp(torn, 1.0, most))));
}

void Contacts::Impl::findHeaps(const std::vector<ShapeCollider>& colliders, const ForEach& for_each) {
  heap = false;
  std::vector<Index> fast_pairs;
  std::size_t all = 0, at_most = 0;
  for (Index k = 0; k < pairs.size(); ++k) {
    if (!pairs[k].fast) continue;
    fast_pairs.push_back(k);
    const ContactShape &a = *colliders[pairs[k].a].shape, &b = *colliders[pairs[k].b].shape;
    at_most += usualQueries(a.samples().size(), b) + usualQueries(b.samples().size(), a);
  }
  many_caught = kManyCaught;
  if (at_most <= kMostInHeap && caught.size() <= many_caught) return;
  for (Index p = 0; p < colliders.size(); ++p)
    if (needed[p] & 1) all += vertexSamples(*colliders[p].shape);
  // So many have passed through that yet more points would not sort it out.
  many_caught = std::max(many_caught, all / kManyCaughtOf);
  heap = caught.size() > many_caught;
  if (heap)
    for (Index k : fast_pairs) pairs[k].by_vertices = true;
  if (heap || at_most <= kMostInHeap) return;
  const std::size_t bound = std::max(kMostInHeap, all);
  if (at_most <= bound) return;
  std::atomic<std::size_t> in_reach{0};
  runEach(for_each, fast_pairs.size(), [&](std::size_t n) {
    const Pair& pair = pairs[fast_pairs[n]];
    const Box region = grown(intersection(colliders[pair.a].bounds, colliders[pair.b].bounds), pair.reach);
    if (region.empty()) return;
    for (Index p : {pair.a, pair.b}) {
      std::size_t count = 0;
      for (const ContactSample& sample : colliders[p].shape->samples())
        count += region.contains(sampleAt(colliders[p], sample));
      in_reach += usualQueries(count, *colliders[p == pair.a ? pair.b : pair.a].shape);
    }
  });
  heap = in_reach > bound;
  if (!heap) return;
  for (Index k : fast_pairs) pairs[k].by_vertices = true;
}

}  // namespace meshless
