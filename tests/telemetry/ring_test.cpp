#include "telemetry/ring.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <memory>
#include <new>
#include <stdexcept>
#include <thread>

namespace {

// Counts what this thread allocates, to show that pushing does not.
thread_local int allocations = 0;

// Not inlined: gcc would see free() meet a pointer from new and take that for a mistake.
#define CLAMBER_NOINLINE __attribute__((noinline))

}  // namespace

CLAMBER_NOINLINE void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
CLAMBER_NOINLINE void* operator new(std::size_t size, std::align_val_t alignment) {
  ++allocations;
  const auto boundary = static_cast<std::size_t>(alignment);
  if (void* memory = std::aligned_alloc(boundary, (size + boundary - 1) / boundary * boundary)) {
    return memory;
  }
  throw std::bad_alloc();
}
CLAMBER_NOINLINE void operator delete(void* memory) noexcept { std::free(memory); }
CLAMBER_NOINLINE void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
CLAMBER_NOINLINE void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
CLAMBER_NOINLINE void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}

namespace clamber {
namespace {

/// A frame whose first and last fields tell whether it was torn.
TelemetryFrame numbered(std::uint64_t number) {
  TelemetryFrame frame;
  frame.sequence = number;
  frame.tau_meas[0] = static_cast<double>(number);
  frame.force_other = static_cast<double>(number);
  return frame;
}

TEST(FrameRing, RefusesACapacityThatIsNoPowerOfTwo) {
  EXPECT_THROW(FrameRing(0), std::invalid_argument);
  EXPECT_THROW(FrameRing(1000), std::invalid_argument);
  EXPECT_EQ(FrameRing(1024).capacity(), 1024U);
}

TEST(FrameRing, DropsTheNewestAndCounts) {
  FrameRing ring(4);
  for (std::uint64_t i = 0; i < 4; ++i) EXPECT_TRUE(ring.try_push(numbered(i)));
  EXPECT_FALSE(ring.try_push(numbered(4)));
  EXPECT_FALSE(ring.push(numbered(5)));
  EXPECT_EQ(ring.dropped(), 2U);

  std::array<TelemetryFrame, 3> out;
  ASSERT_EQ(ring.pop(out), 3U);
  EXPECT_EQ(out[0].sequence, 0U);
  EXPECT_EQ(out[2].sequence, 2U);
  EXPECT_TRUE(ring.try_push(numbered(6)));
  ASSERT_EQ(ring.pop(out), 2U);
  EXPECT_EQ(out[0].sequence, 3U);
  EXPECT_EQ(out[1].sequence, 6U);
  EXPECT_EQ(ring.pop(out), 0U);
  EXPECT_EQ(ring.dropped(), 2U);
}

TEST(FrameRing, PushingAllocatesNothing) {
  FrameRing ring(8);
  FrameSink& sink = ring;
  const TelemetryFrame frame = numbered(1);
  auto probe = std::make_unique<TelemetryFrame>();
  ASSERT_GT(allocations, 0) << "the counter does not count";
  const int before = allocations;
  for (int i = 0; i < 100; ++i) static_cast<void>(sink.push(frame));
  EXPECT_EQ(allocations, before);
  EXPECT_EQ(ring.dropped(), 92U);
}

TEST(FrameRing, AMillionFramesCrossThreadsInOrder) {
  constexpr std::uint64_t kFrames = 1'000'000;
  FrameRing ring(256);
  std::uint64_t refused = 0;
  std::thread producer([&] {
    for (std::uint64_t i = 0; i < kFrames; ++i) {
      const TelemetryFrame frame = numbered(i);
      while (!ring.try_push(frame)) {
        ++refused;
        std::this_thread::yield();
      }
    }
  });

  std::uint64_t expected = 0;
  std::uint64_t wrong = 0;
  std::array<TelemetryFrame, 10> out;
  while (expected < kFrames) {
    const std::size_t count = ring.pop(out);
    if (count == 0) std::this_thread::yield();
    for (std::size_t i = 0; i < count; ++i, ++expected) {
      const auto number = static_cast<double>(expected);
      if (out[i].sequence != expected || out[i].tau_meas[0] != number ||
          out[i].force_other != number) {
        ++wrong;
      }
    }
  }
  producer.join();
  EXPECT_EQ(wrong, 0U);
  EXPECT_EQ(ring.pop(out), 0U);
  EXPECT_EQ(ring.dropped(), refused);
}

}  // namespace
}  // namespace clamber
