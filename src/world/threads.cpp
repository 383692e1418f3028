#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "meshless_surgery/base/hand_over.h"
#include "world_impl.h"

namespace meshless {

ForEach makeForEach(int threads) {
  if (threads <= 1) return oneAfterAnother;
  auto arena = std::make_shared<tbb::task_arena>(threads);
  return [arena](std::size_t count, const std::function<void(std::size_t)>& work) {
    if (count < 2) return oneAfterAnother(count, work);
    HandOver hand_over;
    arena->execute(
        [&] { tbb::parallel_for(std::size_t{0}, count, [&](std::size_t n) { hand_over.run([&] { work(n); }); }); });
    hand_over.finish();
  };
}

}  // namespace meshless
