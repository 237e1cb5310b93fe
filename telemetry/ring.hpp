// Lock-free ring between one producer and one consumer thread, also of two processes: the slots and
// positions lie in memory that both see. Allocates: never; blocks: never (both sides wait-free).
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

namespace clamber {

/// What both sides share besides the slots. Positions count items since the start and are masked on
/// use, so full and empty stay distinct.
struct RingPositions {
  // Not std::hardware_destructive_interference_size: gcc warns that its value may change the ABI.
  alignas(64) std::atomic<std::uint64_t> written{0};
  std::atomic<std::uint64_t> dropped{0};
  alignas(64) std::atomic<std::uint64_t> read{0};

  /// Items in the ring, any thread; while the sides work, a figure of a moment ago.
  [[nodiscard]] std::uint64_t size() const noexcept {
    const std::uint64_t from = read.load(std::memory_order_acquire);
    return written.load(std::memory_order_acquire) - from;
  }
};
static_assert(std::atomic<std::uint64_t>::is_always_lock_free, "shared between processes");

/// A full ring drops the newest item and counts it: the producer never waits, and what the consumer
/// holds in its hands is never overwritten. Whatever a broken consumer does to the positions, only
/// slots are written.
template <typename Item>
class RingProducer {
  static_assert(std::is_trivially_copyable_v<Item>);

 public:
  /// @param slots as many as a power of two
  RingProducer(std::span<Item> slots, RingPositions& positions) noexcept
      : slots_(slots), positions_(positions), read_seen_(positions.read.load()) {}

  /// The slot to fill before commit(); nullptr: full, one more dropped.
  [[nodiscard]] Item* claim() noexcept {
    const std::uint64_t at = positions_.written.load(std::memory_order_relaxed);
    // The consumer's cache line is touched only when the ring looks full.
    if (at - read_seen_ >= slots_.size()) {
      read_seen_ = positions_.read.load(std::memory_order_acquire);
      if (at - read_seen_ >= slots_.size()) {
        // The only writer of the counter: no read-modify-write is needed.
        positions_.dropped.store(positions_.dropped.load(std::memory_order_relaxed) + 1,
                                 std::memory_order_relaxed);
        return nullptr;
      }
    }
    return &slots_[at & (slots_.size() - 1)];
  }
  void commit() noexcept {
    positions_.written.store(positions_.written.load(std::memory_order_relaxed) + 1,
                             std::memory_order_release);
  }

 private:
  std::span<Item> slots_;
  RingPositions& positions_;
  std::uint64_t read_seen_;
};

template <typename Item>
class RingConsumer {
 public:
  RingConsumer(std::span<const Item> slots, RingPositions& positions) noexcept
      : slots_(slots), positions_(positions) {}

  /// Copies the oldest items into `out` and frees their slots.
  /// @return items copied, at most out.size(); 0 when the ring is empty
  [[nodiscard]] std::size_t pop(std::span<Item> out) noexcept {
    const std::uint64_t at = positions_.read.load(std::memory_order_relaxed);
    if (written_seen_ - at < out.size() || written_seen_ < at)
      written_seen_ = positions_.written.load(std::memory_order_acquire);
    const auto count = static_cast<std::size_t>(
        std::min<std::uint64_t>(written_seen_ - at, std::min(out.size(), slots_.size())));
    for (std::size_t i = 0; i < count; ++i) out[i] = slots_[(at + i) & (slots_.size() - 1)];
    positions_.read.store(at + count, std::memory_order_release);
    return count;
  }

 private:
  std::span<const Item> slots_;
  RingPositions& positions_;
  std::uint64_t written_seen_ = 0;
};

}  // namespace clamber
