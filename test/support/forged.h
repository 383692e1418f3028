// Numbers that no file of ours has, put where numbers lie; and a limit for what is then done with them.
#pragma once

#include <sys/time.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstring>
#include <limits>

#include "support/random.h"

namespace meshless::test {

/// A number from `first` on becomes a bad one: of 8 bytes where a plausible double lies, of 4 anywhere.
inline void forgeNumber(Random& random, std::string& bytes, std::size_t first) {
  using Limits = std::numeric_limits<double>;
  static const std::vector<double> doubles = {Limits::infinity(),
                                              -Limits::infinity(),
                                              Limits::quiet_NaN(),
                                              1e200,
                                              -1e200,
                                              1e30,
                                              1e19,
                                              -1e10,
                                              Limits::denorm_min(),
                                              -1.0,
                                              0.0,
                                              2147483648.0};
  static const std::vector<std::uint32_t> words = {0u, 1u, 1000u, 0x7fffffffu, 0x80000000u, 0xffffffffu, 0x7ff00000u};
  const bool wide = random.integer(0, 3) > 0;
  const std::size_t size = wide ? 8 : 4;
  if (bytes.size() < first + size) return;
  std::size_t at = first;
  for (int n = 0; n < 200; ++n) {
    at = first + static_cast<std::size_t>(random.uniform(0, 1) * static_cast<double>(bytes.size() - size - first + 1));
    double there = 0.0;
    if (wide) std::memcpy(&there, bytes.data() + at, size);
    if (!wide || (std::abs(there) > 1e-7 && std::abs(there) < 1e7)) break;
  }
  if (wide)
    std::memcpy(&bytes[at], &doubles[static_cast<std::size_t>(random.integer(0, static_cast<int>(doubles.size()) - 1))],
                8);
  else
    std::memcpy(&bytes[at], &words[static_cast<std::size_t>(random.integer(0, static_cast<int>(words.size()) - 1))], 4);
}

/// Ends the program where its scope takes more than five seconds of the processor, and says what it was at.
class TimeLimit {
 public:
  explicit TimeLimit(const std::string& at) {
    std::snprintf(text(), kLength, "HANGS: %s\n", at.c_str());
    std::signal(SIGVTALRM, [](int) {
      (void)!write(2, text(), std::strlen(text()));
      _exit(3);
    });
    set(5);
  }
  ~TimeLimit() { set(0); }
  TimeLimit(const TimeLimit&) = delete;
  TimeLimit& operator=(const TimeLimit&) = delete;

 private:
  static constexpr std::size_t kLength = 200;
  static char* text() {
    static char buffer[kLength];
    return buffer;
  }
  static void set(int seconds) {
    itimerval timer{};
    timer.it_value.tv_sec = seconds;
    setitimer(ITIMER_VIRTUAL, &timer, nullptr);
  }
};

}  // namespace meshless::test
