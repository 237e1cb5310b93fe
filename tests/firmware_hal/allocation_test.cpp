// What runs in the control thread allocates nothing: both hosts over many ticks, with garbage
// between.
#include <gtest/gtest.h>

#include "tests/control/allocation_guard.hpp"
#include "tests/firmware_hal/frame_storm.hpp"

namespace clamber {
namespace {

TEST(CodecAllocation, TicksAndFramesAllocateNothing) {
  if (!test::allocation_guard_works()) GTEST_SKIP() << "skipped: no guard under a sanitizer";
  std::mt19937_64 random(5);
  test::FrameStorm storm;
  std::uint64_t calls = 0;
  for (int i = 0; i < 20000; ++i) {
    const CanFrame frame = test::stormy_frame(random);
    const test::AllocationGuard guard;
    (void)storm.take(frame);
    calls += guard.calls();
  }
  EXPECT_EQ(calls, 0u);
}

}  // namespace
}  // namespace clamber
