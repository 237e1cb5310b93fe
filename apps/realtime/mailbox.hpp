// Fixed-size messages from one thread to another without a lock: one side puts, the other takes.
// put(): one thread; take(): one thread; allocates: never; blocks: never.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <type_traits>

namespace clamber {

template <typename Message, std::size_t kSize = 16>
class Mailbox {
  static_assert(std::is_trivially_copyable_v<Message>);
  static_assert((kSize & (kSize - 1)) == 0, "a power of two, so that positions may wrap");

 public:
  /// False: full, the message was not taken.
  [[nodiscard]] bool put(const Message& message) noexcept {
    const std::size_t at = put_.load(std::memory_order_relaxed);
    if (at - taken_.load(std::memory_order_acquire) == kSize) return false;
    slots_[at % kSize] = message;
    put_.store(at + 1, std::memory_order_release);
    return true;
  }
  /// False: empty, `message` is as it was.
  [[nodiscard]] bool take(Message& message) noexcept {
    const std::size_t at = taken_.load(std::memory_order_relaxed);
    if (at == put_.load(std::memory_order_acquire)) return false;
    message = slots_[at % kSize];
    taken_.store(at + 1, std::memory_order_release);
    return true;
  }

 private:
  std::array<Message, kSize> slots_{};
  alignas(64) std::atomic<std::size_t> put_{0};
  alignas(64) std::atomic<std::size_t> taken_{0};
};

}  // namespace clamber
