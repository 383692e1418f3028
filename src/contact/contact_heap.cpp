// Heaps of quick bodies that springs tear into one place: each point would be asked about by all the others.
#include <algorithm>
#include <atomic>

#include "contacts_impl.h"

namespace meshless {
namespace {

// Points that quick pairs ask about at once, if that is more than all there are.
constexpr std::size_t kMostInHeap = 12500;

}  // namespace

Index samplesFor(const Pair& pair, const ContactShape& shape) {
  const std::vector<ContactSample>& samples = shape.samples();
  if (!pair.by_vertices) return static_cast<Index>(samples.size());
  const auto on_edge = [](const ContactSample& s) { return !(s.share > 0.0); };
  return static_cast<Index>(std::partition_point(samples.begin(), samples.end(), on_edge) - samples.begin());
}

void Contacts::Impl::findHeaps(const std::vector<ContactParty>& parties, const ForEach& for_each) {
  std::vector<Index> quick_pairs;
  std::size_t all = 0, at_most = 0;
  for (Index p = 0; p < parties.size(); ++p)
    if (needed[p] & 1) all += parties[p].shape->samples().size();
  for (Index k = 0; k < pairs.size(); ++k) {
    if (!pairs[k].quick) continue;
    quick_pairs.push_back(k);
    for (Index p : {pairs[k].a, pairs[k].b}) at_most += parties[p].shape->samples().size();
  }
  const std::size_t bound = std::max(kMostInHeap, all);
  if (at_most <= bound) return;
  std::atomic<std::size_t> in_reach{0};
  runEach(for_each, quick_pairs.size(), [&](std::size_t n) {
    const Pair& pair = pairs[quick_pairs[n]];
    const Box region = grown(intersection(parties[pair.a].bounds, parties[pair.b].bounds), pair.reach);
    if (region.empty()) return;
    std::size_t count = 0;
    for (Index p : {pair.a, pair.b})
      for (const ContactSample& sample : parties[p].shape->samples())
        count += region.contains(sampleAt(parties[p], sample));
    in_reach += count;
  });
  if (in_reach <= bound) return;
  for (Index k : quick_pairs) pairs[k].by_vertices = true;
}

}  // namespace meshless
