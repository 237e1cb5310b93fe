// Lock-free ring that carries frames from the tick to the telemetry thread.
// One producer thread pushes, one consumer thread pops; allocates: in the constructor only;
// blocks: never (both sides are wait-free).
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "telemetry/frame_sink.hpp"

namespace clamber {

/// A full ring drops the newest frame and counts it: the producer never waits, and what the
/// consumer holds in its hands is never overwritten.
class FrameRing final : public FrameSink {
 public:
  /// @param capacity frames, a power of two. All slots are written here, so that the first lap of
  ///   the tick meets no page fault.
  /// @throws std::invalid_argument when capacity is not a power of two
  explicit FrameRing(std::size_t capacity = 4096);

  /// Producer only. False when the ring was full and the frame was dropped.
  [[nodiscard]] bool try_push(const TelemetryFrame& frame) noexcept;
  bool push(const TelemetryFrame& frame) noexcept override { return try_push(frame); }

  /// Consumer only. Copies the oldest frames into `out` and frees their slots.
  /// @return frames copied, at most out.size(); 0 when the ring is empty
  [[nodiscard]] std::size_t pop(std::span<TelemetryFrame> out) noexcept;

  /// Any thread; while the other side works, a figure of a moment ago.
  [[nodiscard]] std::size_t size() const noexcept {
    const std::size_t read = read_position_.load(std::memory_order_acquire);
    return write_position_.load(std::memory_order_acquire) - read;
  }
  /// Any thread.
  [[nodiscard]] std::uint64_t dropped() const noexcept {
    return dropped_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] std::size_t capacity() const noexcept { return slots_.size(); }

 private:
  // Not std::hardware_destructive_interference_size: gcc warns that its value may change the ABI.
  static constexpr std::size_t kCacheLine = 64;

  std::vector<TelemetryFrame> slots_;
  const std::size_t mask_;

  // Positions count frames since the start and are masked on use, so full and empty stay distinct.
  // Each side keeps the other's position as last seen: it touches the other's cache line only when
  // the ring looks full or empty.
  alignas(kCacheLine) std::atomic<std::size_t> write_position_{0};
  std::size_t read_position_seen_ = 0;  // producer's
  std::atomic<std::uint64_t> dropped_{0};
  alignas(kCacheLine) std::atomic<std::size_t> read_position_{0};
  std::size_t write_position_seen_ = 0;  // consumer's
};

}  // namespace clamber
