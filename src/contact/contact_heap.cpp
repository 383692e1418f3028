// Heaps of quick bodies that springs tear into one place: each point would be asked about by all the others.
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

std::size_t usualLookups(std::size_t points, const ContactShape& in) {
  return static_cast<std::size_t>(static_cast<double>(points) * in.crowding());
}

// Work [about a microsecond of one thread]: of a usual lookup with all that follows from it; in a substep, of a point
// that has passed through, which is made and swept, of one that is followed, and of any.
constexpr double kLookWork = 5.0, kCaughtWork = 4.0, kFollowWork = 1.5, kSampleWork = 0.05;
constexpr double kMostWork = 1.5e5;  // of a frame, or so: beyond it stiff materials get fewer substeps
constexpr double kMostStops = 2e4;   // caught points times substeps that contacts ask for
constexpr double kFewest = 2.0;      // substeps that are always left

// How many usual lookups quick pairs ask for in a frame, or so: beyond it they are looked up in some of its substeps
// alone.
constexpr std::size_t kMostAsked = 25000, kMostAskedEach = 2;  // of all, or so often of each there is

}  // namespace

Index samplesFor(const Pair& pair, const ContactShape& shape) {
  return pair.by_vertices ? vertexSamples(shape) : static_cast<Index>(shape.samples().size());
}

double Contacts::Impl::mostLooked() const {
  // Heaps of crumbs that are torn together: between looks those that pass through have to do.
  if (heap || caught.size() > many_caught) return static_cast<double>(kMostInHeap);
  return static_cast<double>(std::max(kMostAsked, kMostAskedEach * samples));
}

// By what quick pairs ask about, and what has passed through: what lies still is not looked at again within a frame.
void Contacts::Impl::chooseSubsteps(double torn, double standing) {
  const double stops = static_cast<double>(caught.size());
  affordable_substeps = kAnySubsteps;
  if (asked_points > 0 || stops > 0.0) {
    const double look = kLookWork * asked, looks = std::max(1.0, mostLooked() / std::max(1.0, asked));
    const double each = kCaughtWork * stops + kFollowWork * static_cast<double>(asked_points) +
                        kSampleWork * static_cast<double>(samples);
    double most = kMostWork / (look + each);
    if (most > looks) most = (kMostWork - looks * look) / each;  // the other substeps are without a look
    affordable_substeps = static_cast<int>(std::clamp<double>(most, kFewest, kAnySubsteps));
  }
  double most = std::max(kFewest, kMostStops / std::max(1.0, stops));
  if (heap) most = std::min<double>(most, affordable_substeps);
  // A stack that bounces apart for a frame is still one.
  standing_substeps =
      std::max(standing_substeps - 1, static_cast<int>(std::ceil(std::min<double>(standing, kAnySubsteps))));
  needed_substeps = std::max(standing_substeps, static_cast<int>(std::ceil(std::clamp(torn, 1.0, most))));
}

void Contacts::Impl::findHeaps(const std::vector<ContactParty>& parties, const ForEach& for_each) {
  heap = false;
  std::vector<Index> quick_pairs;
  std::size_t all = 0, at_most = 0;
  for (Index k = 0; k < pairs.size(); ++k) {
    if (!pairs[k].quick) continue;
    quick_pairs.push_back(k);
    const ContactShape &a = *parties[pairs[k].a].shape, &b = *parties[pairs[k].b].shape;
    at_most += usualLookups(a.samples().size(), b) + usualLookups(b.samples().size(), a);
  }
  many_caught = kManyCaught;
  if (at_most <= kMostInHeap && caught.size() <= many_caught) return;
  for (Index p = 0; p < parties.size(); ++p)
    if (needed[p] & 1) all += vertexSamples(*parties[p].shape);
  // So many have passed through that yet more points would not sort it out.
  many_caught = std::max(many_caught, all / kManyCaughtOf);
  heap = caught.size() > many_caught;
  if (heap)
    for (Index k : quick_pairs) pairs[k].by_vertices = true;
  if (heap || at_most <= kMostInHeap) return;
  const std::size_t bound = std::max(kMostInHeap, all);
  if (at_most <= bound) return;
  std::atomic<std::size_t> in_reach{0};
  runEach(for_each, quick_pairs.size(), [&](std::size_t n) {
    const Pair& pair = pairs[quick_pairs[n]];
    const Box region = grown(intersection(parties[pair.a].bounds, parties[pair.b].bounds), pair.reach);
    if (region.empty()) return;
    for (Index p : {pair.a, pair.b}) {
      std::size_t count = 0;
      for (const ContactSample& sample : parties[p].shape->samples())
        count += region.contains(sampleAt(parties[p], sample));
      in_reach += usualLookups(count, *parties[p == pair.a ? pair.b : pair.a].shape);
    }
  });
  heap = in_reach > bound;
  if (!heap) return;
  for (Index k : quick_pairs) pairs[k].by_vertices = true;
}

}  // namespace meshless
