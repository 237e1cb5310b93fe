#include "telemetry/ring.hpp"

#include <algorithm>
#include <bit>
#include <stdexcept>

namespace clamber {

FrameRing::FrameRing(std::size_t capacity) : slots_(capacity), mask_(capacity - 1) {
  if (!std::has_single_bit(capacity)) {
    throw std::invalid_argument("FrameRing: the capacity must be a power of two, got " +
                                std::to_string(capacity));
  }
}

bool FrameRing::try_push(const TelemetryFrame& frame) noexcept {
  const std::size_t write = write_position_.load(std::memory_order_relaxed);
  if (write - read_position_seen_ == slots_.size()) {
    read_position_seen_ = read_position_.load(std::memory_order_acquire);
    if (write - read_position_seen_ == slots_.size()) {
      // The only writer of the counter: no read-modify-write is needed.
      dropped_.store(dropped_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
      return false;
    }
  }
  slots_[write & mask_] = frame;
  write_position_.store(write + 1, std::memory_order_release);
  return true;
}

std::size_t FrameRing::pop(std::span<TelemetryFrame> out) noexcept {
  const std::size_t read = read_position_.load(std::memory_order_relaxed);
  if (write_position_seen_ - read < out.size()) {
    write_position_seen_ = write_position_.load(std::memory_order_acquire);
  }
  const std::size_t count = std::min(write_position_seen_ - read, out.size());
  for (std::size_t i = 0; i < count; ++i) out[i] = slots_[(read + i) & mask_];
  read_position_.store(read + count, std::memory_order_release);
  return count;
}

}  // namespace clamber
