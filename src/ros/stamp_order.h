// Which messages of a stream come late, behind a newer one, by their stamps; and where its sender's clock was set. Both
// look the same at first: what tells them apart is whether newer ones still come. So no stamp, however wrong, stops a
// stream for longer than kLongestLate.
#pragma once

namespace meshless {

class StampOrder {
 public:
  /// [s] after the newest one in which older ones are late. From then on the sender's clock has been set.
  static constexpr double kLongestLate = 0.1;

  enum class Is { kNext, kLate, kAnew };
  /// `stamp` of a message, and `now` on the clock of who hears it, which never goes back [s].
  Is hear(double stamp, double now) {
    if (stamp < newest_ && now - heard_ <= kLongestLate) return Is::kLate;
    const Is is = stamp < newest_ ? Is::kAnew : Is::kNext;
    newest_ = stamp;
    heard_ = now;
    return is;
  }
  /// [s] the stamp of the newest one; 0 where none was heard.
  double newest() const { return newest_; }

 private:
  double newest_ = 0.0, heard_ = 0.0;
};

}  // namespace meshless
