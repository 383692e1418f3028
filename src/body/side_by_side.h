// Loops of a cut, spread over what threads are free. Private to body.
#pragma once

#include <algorithm>
#include <cstddef>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include "meshless_surgery/base/hand_over.h"

namespace meshless {

/// work(from, to) for every `chunk` of 0 .. count - 1. Chunks do not depend on the number of threads, and the calling
/// thread takes all that no other has begun: where the cores are busy it waits for none.
template <class Work>
void inChunks(std::size_t count, std::size_t chunk, const Work& work) {
  const std::size_t chunks = (count + chunk - 1) / chunk;
  HandOver hand_over;
  const auto one = [&](std::size_t c) { hand_over.run([&] { work(c * chunk, std::min(count, (c + 1) * chunk)); }); };
  if (chunks == 1) one(0);
  if (chunks > 1) tbb::parallel_for(std::size_t{0}, chunks, one, tbb::simple_partitioner());
  hand_over.finish();
}

/// The second on another thread if one is free, else after the first.
template <class First, class Second>
void atOnce(const First& first, const Second& second) {
  HandOver hand_over;
  tbb::parallel_invoke([&] { hand_over.run(first); }, [&] { hand_over.run(second); });
  hand_over.finish();
}

}  // namespace meshless
