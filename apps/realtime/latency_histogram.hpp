// Times in bins whose width grows with them, so that one table holds nanoseconds and seconds.
// One thread; allocates: never; blocks: never. 64 bins an octave: a percentile is at most 1.6 %
// high.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace clamber {

class LatencyHistogram {
 public:
  /// A negative time counts as 0, one beyond a minute as a minute; max() keeps what it was.
  void add(std::int64_t ns) noexcept {
    ++bins_[bin_of(std::clamp<std::int64_t>(ns, 0, kTop))];
    ++count_;
    max_ = std::max(max_, ns);
    sum_ += static_cast<double>(ns);
  }

  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  [[nodiscard]] std::int64_t max() const noexcept { return max_; }  ///< ns
  [[nodiscard]] double mean() const noexcept {
    return count_ > 0 ? sum_ / static_cast<double>(count_) : 0.0;
  }
  /// ns that this share (0..1) of the times does not exceed: the upper end of its bin.
  [[nodiscard]] std::int64_t percentile(double share) const noexcept {
    const auto wanted = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(count_)));
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i < kBins; ++i) {
      seen += bins_[i];
      if (seen > 0 && seen >= wanted) return std::min(top_of(i), max_);
    }
    return max_;
  }
  /// visit(upper end of the bin in ns, times in it) for every bin that has any.
  template <typename Visit>
  void each(Visit visit) const {
    for (std::size_t i = 0; i < kBins; ++i)
      if (bins_[i] > 0) visit(std::min(top_of(i), max_), bins_[i]);
  }

 private:
  static constexpr int kShift = 6;                                   // 2^6 bins an octave
  static constexpr std::int64_t kTop = (std::int64_t{1} << 36) - 1;  // ns, 69 s
  static constexpr std::size_t kBins = (36 - kShift + 1) << kShift;

  // The first two octaves have bins of 1 ns; from there on a value's seven leading bits name it.
  [[nodiscard]] static constexpr std::size_t bin_of(std::int64_t ns) noexcept {
    const auto value = static_cast<std::uint64_t>(ns);
    const int shift = std::max(0, static_cast<int>(std::bit_width(value)) - (kShift + 1));
    return (static_cast<std::size_t>(shift) << kShift) + static_cast<std::size_t>(value >> shift);
  }
  [[nodiscard]] static constexpr std::int64_t top_of(std::size_t bin) noexcept {
    const std::size_t shift = bin < (2u << kShift) ? 0 : (bin >> kShift) - 1;
    return static_cast<std::int64_t>(((bin - (shift << kShift) + 1) << shift) - 1);
  }

  std::array<std::uint64_t, kBins> bins_{};
  std::uint64_t count_ = 0;
  std::int64_t max_ = 0;
  double sum_ = 0.0;
};

}  // namespace clamber
