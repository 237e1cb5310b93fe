// Wall and processor time of a stage, and quantiles over many.
// Benchmarks only.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <ctime>
#include <vector>

namespace clamber::bench {

struct Elapsed {
  double wall = 0.0;  ///< s
  double processor =
      0.0;  ///< s over all threads of the process: what a loaded machine does not add to
};

class Stopwatch {
 public:
  Stopwatch() : wall_(std::chrono::steady_clock::now()), processor_(processor_now()) {}
  [[nodiscard]] Elapsed elapsed() const {
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - wall_;
    return {wall.count(), processor_now() - processor_};
  }

 private:
  static double processor_now() {
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  }
  std::chrono::steady_clock::time_point wall_;
  double processor_;
};

/// Time of one call of `f`, us.
template <typename F>
double microseconds(const F& f) {
  const auto start = std::chrono::steady_clock::now();
  f();
  const std::chrono::duration<double, std::micro> time = std::chrono::steady_clock::now() - start;
  return time.count();
}

/// The value that a share of all values do not exceed (nearest rank).
inline double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size())));
  return values[std::clamp<std::size_t>(rank, 1, values.size()) - 1];
}

}  // namespace clamber::bench
