// The last minute of a live run, for any number of browsers that read at their own pace.
// push() and read() on different threads; allocates: in the constructor only, but for what read()
// returns; read() blocks up to its timeout.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

namespace clamber {

/// A ring of rows with one position per reader, which the reader keeps: one that is slow or stalled
/// costs nothing here and misses what is older than the ring.
class LiveFeed {
 public:
  static constexpr std::size_t kRows = 3000;  ///< a minute

  /// @param width numbers a row
  explicit LiveFeed(std::size_t width) : width_(width), rows_(width * kRows) {}

  void push(std::span<const float> row);
  /// Nobody needs to wait any longer: every read() returns at once.
  void stop();

  /// Rows from `position` on, at most `most`; waits for one when there is none. Advances
  /// `position`.
  [[nodiscard]] std::vector<float> read(std::uint64_t& position, std::size_t most,
                                        std::chrono::milliseconds timeout);
  [[nodiscard]] bool stopped() const;

 private:
  const std::size_t width_;
  mutable std::mutex mutex_;
  std::condition_variable more_;
  std::vector<float> rows_;
  std::uint64_t written_ = 0;
  bool stopped_ = false;
};

}  // namespace clamber
