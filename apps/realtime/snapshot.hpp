// The latest value of something that one thread writes and others read whole (a sequence lock).
// write(): one thread, wait-free; read(): any, tries again while it is written; allocates: never.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace clamber {

template <typename Value>
class Snapshot {
  static_assert(std::is_trivially_copyable_v<Value>);

 public:
  Snapshot() noexcept { write(Value{}); }

  void write(const Value& value) noexcept {
    Words words{};
    std::memcpy(words.data(), &value, sizeof value);
    const std::uint64_t version = version_.load(std::memory_order_relaxed);
    version_.store(version + 1, std::memory_order_relaxed);
    // Whoever sees a new word sees the odd version too; no fences, which the thread sanitizer does
    // not know.
    for (std::size_t i = 0; i < kWords; ++i) words_[i].store(words[i], std::memory_order_release);
    version_.store(version + 2, std::memory_order_release);
  }
  [[nodiscard]] Value read() const noexcept {
    for (;;) {
      const std::uint64_t before = version_.load(std::memory_order_acquire);
      Words words{};
      for (std::size_t i = 0; i < kWords; ++i) words[i] = words_[i].load(std::memory_order_acquire);
      if (before % 2 != 0 || version_.load(std::memory_order_relaxed) != before) continue;
      Value value{};
      std::memcpy(static_cast<void*>(&value), words.data(), sizeof value);
      return value;
    }
  }

 private:
  static constexpr std::size_t kWords = (sizeof(Value) + 7) / 8;
  using Words = std::array<std::uint64_t, kWords>;

  std::array<std::atomic<std::uint64_t>, kWords> words_{};
  std::atomic<std::uint64_t> version_{0};
};

}  // namespace clamber
