#include "team.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace meshless {
namespace {

// A step of a small organ has gaps of some ten microseconds between its loops; between steps threads sleep.
constexpr std::chrono::microseconds kWatchFor(300);
constexpr int kLooks = 64;          // between two looks at the clock
constexpr std::size_t kGrains = 8;  // a part: fewer leave one waiting for the other, more meet too often

thread_local bool at_work = false;

void relax() {
#ifdef __x86_64__
  __builtin_ia32_pause();
#endif
}

}  // namespace

Team::Team(int threads) : parts_(static_cast<std::size_t>(threads)) {
  for (std::size_t who = 1; who < parts_.size(); ++who) others_.emplace_back([this, who] { standBy(who); });
}

Team::~Team() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    end_.store(true);
  }
  wake_.notify_all();
  for (std::thread& other : others_) other.join();
}

void Team::run(std::size_t count, const std::function<void(std::size_t)>& work) {
  if (count < 2 || at_work || busy_.exchange(true, std::memory_order_acquire)) {
    for (std::size_t n = 0; n < count; ++n) work(n);
    return;
  }
  ++shared_;
  work_ = &work;
  grain_ = std::max<std::size_t>(1, count / (kGrains * parts_.size()));
  for (std::size_t n = 0; n < parts_.size(); ++n) {
    parts_[n].next.store(count * n / parts_.size(), std::memory_order_relaxed);
    parts_[n].end = count * (n + 1) / parts_.size();
  }
  const std::uint64_t number = (offer_.load(std::memory_order_relaxed) | kOpen | kInside) + 1;
  offer_.store(number | kOpen, std::memory_order_seq_cst);
  if (asleep_.load(std::memory_order_seq_cst) > 0) {
    { const std::lock_guard<std::mutex> lock(mutex_); }
    wake_.notify_all();
  }
  take(0);
  offer_.fetch_and(~kOpen, std::memory_order_acq_rel);
  for (unsigned look = 0; (offer_.load(std::memory_order_acquire) & kInside) != 0; ++look) {
    relax();
    if (look % kLooks == kLooks - 1) std::this_thread::yield();  // to whom it waits for, if the core is all there is
  }
  std::exception_ptr fault;
  if (faulted_.exchange(false)) fault = std::exchange(fault_, nullptr);
  busy_.store(false, std::memory_order_release);
  if (fault) std::rethrow_exception(fault);
}

void Team::take(std::size_t who) {
  at_work = true;
  const std::function<void(std::size_t)>& work = *work_;
  try {
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      Part& part = parts_[(who + k) % parts_.size()];
      for (;;) {
        const std::size_t from = part.next.fetch_add(grain_, std::memory_order_relaxed);
        if (from >= part.end) break;
        for (std::size_t n = from; n < std::min(part.end, from + grain_); ++n) work(n);
      }
    }
  } catch (...) {
    if (!faulted_.exchange(true)) fault_ = std::current_exception();
  }
  at_work = false;
}

void Team::standBy(std::size_t who) {
  std::uint64_t seen = 0;
  const auto isNew = [&seen](std::uint64_t offer) { return (offer & kOpen) && offer / kNext != seen; };
  auto since = std::chrono::steady_clock::now();
  for (unsigned look = 0; !end_.load(std::memory_order_relaxed); ++look) {
    std::uint64_t offer = offer_.load(std::memory_order_acquire);
    if (isNew(offer)) {
      if (!offer_.compare_exchange_weak(offer, offer + 1, std::memory_order_acq_rel)) continue;
      seen = offer / kNext;
      take(who);
      offer_.fetch_sub(1, std::memory_order_acq_rel);
      since = std::chrono::steady_clock::now();
      continue;
    }
    relax();
    if (look % kLooks != 0) continue;
    std::this_thread::yield();  // who has work comes first
    if (std::chrono::steady_clock::now() - since < kWatchFor) continue;
    std::unique_lock<std::mutex> lock(mutex_);
    asleep_.fetch_add(1, std::memory_order_seq_cst);
    // By a loop that is over, too: the next one comes soon.
    wake_.wait(lock, [&, last = offer / kNext] {
      return end_.load() || offer_.load(std::memory_order_seq_cst) / kNext != last;
    });
    asleep_.fetch_sub(1, std::memory_order_seq_cst);
    since = std::chrono::steady_clock::now();
  }
}

}  // namespace meshless
