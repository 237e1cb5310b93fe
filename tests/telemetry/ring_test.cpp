#include "telemetry/ring.hpp"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <memory>
#include <new>
#include <stdexcept>
#include <thread>
#include <vector>

#include "telemetry/port.hpp"

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

struct Ring {
  explicit Ring(std::size_t capacity) : slots(capacity) {}
  bool push(std::uint64_t number) {
    TelemetryFrame* slot = producer.claim();
    if (slot == nullptr) return false;
    *slot = numbered(number);
    producer.commit();
    return true;
  }
  std::vector<TelemetryFrame> slots;
  RingPositions positions;
  RingProducer<TelemetryFrame> producer{slots, positions};
  RingConsumer<TelemetryFrame> consumer{slots, positions};
};

TEST(Ring, DropsTheNewestAndCounts) {
  Ring ring(4);
  for (std::uint64_t i = 0; i < 4; ++i) EXPECT_TRUE(ring.push(i));
  EXPECT_FALSE(ring.push(4));
  EXPECT_FALSE(ring.push(5));
  EXPECT_EQ(ring.positions.dropped, 2U);
  EXPECT_EQ(ring.positions.size(), 4U);

  std::array<TelemetryFrame, 3> out;
  ASSERT_EQ(ring.consumer.pop(out), 3U);
  EXPECT_EQ(out[0].sequence, 0U);
  EXPECT_EQ(out[2].sequence, 2U);
  EXPECT_TRUE(ring.push(6));
  ASSERT_EQ(ring.consumer.pop(out), 2U);
  EXPECT_EQ(out[0].sequence, 3U);
  EXPECT_EQ(out[1].sequence, 6U);
  EXPECT_EQ(ring.consumer.pop(out), 0U);
  EXPECT_EQ(ring.positions.dropped, 2U);
}

TEST(Ring, AnotherConsumerCarriesOnWhereTheFirstDied) {
  Ring ring(8);
  for (std::uint64_t i = 0; i < 5; ++i) EXPECT_TRUE(ring.push(i));
  std::array<TelemetryFrame, 2> out;
  ASSERT_EQ(ring.consumer.pop(out), 2U);
  RingConsumer<TelemetryFrame> second(ring.slots, ring.positions);
  ASSERT_EQ(second.pop(out), 2U);
  EXPECT_EQ(out[0].sequence, 2U);
}

// A consumer in another process may break; the tick must live with whatever it leaves behind.
TEST(Ring, SurvivesPositionsThatMakeNoSense) {
  Ring ring(4);
  for (const std::uint64_t nonsense :
       {~std::uint64_t{0}, std::uint64_t{1} << 63, std::uint64_t{77}}) {
    ring.positions.read = nonsense;
    for (int i = 0; i < 10; ++i) static_cast<void>(ring.push(1));
  }
  EXPECT_GT(ring.positions.dropped, 0U);
  std::array<TelemetryFrame, 10> out;
  EXPECT_LE(ring.consumer.pop(out), 4U);
}

TEST(TelemetryPort, PushingAllocatesNothing) {
  TelemetryMemory memory;
  TelemetryPort port(memory.block());
  const TelemetryFrame frame = numbered(1);
  auto probe = std::make_unique<TelemetryFrame>();
  ASSERT_GT(allocations, 0) << "the counter does not count";
  const int before = allocations;
  for (std::size_t i = 0; i < TelemetryBlock::kRecords + 100; ++i)
    static_cast<void>(port.push(frame, {}));
  TelemetryEvent event;
  event.append("text");
  for (std::size_t i = 0; i < TelemetryBlock::kEvents + 10; ++i)
    static_cast<void>(port.push(event));
  EXPECT_EQ(allocations, before);
  EXPECT_EQ(memory.block().record_positions.dropped, 100U);
  EXPECT_EQ(memory.block().event_positions.dropped, 10U);
}

TEST(TelemetryMemory, IsSeenWholeByWhoeverIsGivenItsFile) {
  TelemetryMemory ours(TelemetryMemory::Kind::kShared);
  TelemetryPort port(ours.block());
  ASSERT_TRUE(port.push(numbered(7), {.overruns = 3}));
  TelemetryMemory theirs(dup(ours.file()));
  RingConsumer<TelemetryRecord> consumer(theirs.block().records, theirs.block().record_positions);
  std::array<TelemetryRecord, 2> out;
  ASSERT_EQ(consumer.pop(out), 1U);
  EXPECT_EQ(out[0].frame.sequence, 7U);
  EXPECT_EQ(out[0].frame.force_other, 7.0);
  EXPECT_EQ(out[0].loop.overruns, 3U);
  EXPECT_EQ(ours.block().record_positions.size(), 0U);
}

TEST(TelemetryMemory, RefusesAFileThatIsNone) {
  EXPECT_THROW(TelemetryMemory(memfd_create("short", 0)), std::runtime_error);
  const int blank = memfd_create("blank", 0);
  ASSERT_EQ(ftruncate(blank, sizeof(TelemetryBlock)), 0);
  EXPECT_THROW(TelemetryMemory{blank}, std::runtime_error);
  close(blank);
}

TEST(TelemetryEvent, KeepsWhatThereIsRoomFor) {
  TelemetryEvent event;
  event.append("abc");
  event.append("def");
  EXPECT_EQ(event.view(), "abcdef");
  event.append(std::string(500, 'x'));
  EXPECT_EQ(event.view().size(), event.text.size() - 1);
}

TEST(Ring, FramesCrossThreadsInOrder) {
  constexpr std::uint64_t kFrames = 200'000;
  Ring ring(256);
  std::uint64_t refused = 0;
  std::thread producer([&] {
    for (std::uint64_t i = 0; i < kFrames; ++i)
      while (!ring.push(i)) {
        ++refused;
        std::this_thread::yield();
      }
  });

  std::uint64_t expected = 0;
  std::uint64_t wrong = 0;
  std::array<TelemetryFrame, 10> out;
  while (expected < kFrames) {
    const std::size_t count = ring.consumer.pop(out);
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
  EXPECT_EQ(ring.consumer.pop(out), 0U);
  EXPECT_EQ(ring.positions.dropped, refused);
}

}  // namespace
}  // namespace clamber
