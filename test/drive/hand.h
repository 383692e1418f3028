// A human hand, by a seed: it pulls, locks, pushes, cuts, opens, takes back, and lets go.
#pragma once

#include "meshless_surgery/base/random.h"
#include "meshless_surgery/world/world.h"

namespace meshless {

struct HandCounts {
  int pulls = 0, pushes = 0, cuts = 0, incisions = 0, undos = 0, refused = 0;
};

class Hand {
 public:
  using Apply = std::function<Result<Reply>(const Command&)>;

  /// Without cuts it waits where it would cut, open or take back, and else does the same.
  Hand(std::uint64_t seed, bool cuts, Apply apply);

  /// To be called before each step of the world. False once all is done; then nothing is held any more.
  bool act(World& world);
  const HandCounts& counts() const { return counts_; }

 private:
  enum class Doing { kWaiting, kPulling, kPushing };

  void begin(World& world);
  void end(const World& world);
  void pull(World& world, Random& random);
  void push(World& world, Random& random);
  void cut(World& world, Random& random);
  void incise(World& world, Random& random);
  void wait(double seconds);
  Result<Reply> apply(const Command& command);

  std::uint64_t seed_;
  bool cuts_;
  Apply apply_;
  HandCounts counts_;
  double step_ = 0.0;  // [s]
  int slots_ = 0, slot_ = 0;
  int left_ = 0;   // steps of what it does now
  int total_ = 0;  // steps so far
  Doing doing_ = Doing::kWaiting;
  PickId pick_ = 0;
  bool lock_ = false;
  Vec3 target_ = Vec3::Zero(), way_ = Vec3::Zero();  // [m], [m] a step
};

}  // namespace meshless
