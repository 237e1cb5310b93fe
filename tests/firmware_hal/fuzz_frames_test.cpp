// A seeded slice of frame fuzzing: whatever comes over the bus, nothing crashes and no host that
// was not told to ever sends an enabling frame. CLAMBER_FUZZ_FRAMES sets the number of frames.
#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/firmware_hal/frame_storm.hpp"

namespace clamber {
namespace {

TEST(FuzzFrames, NothingCrashesAndNothingMoves) {
  const char* wanted = std::getenv("CLAMBER_FUZZ_FRAMES");
  const std::uint64_t count = wanted == nullptr ? 400'000 : std::strtoull(wanted, nullptr, 10);
  std::mt19937_64 random(31);
  test::FrameStorm storm;
  for (std::uint64_t i = 0; i < count; ++i) {
    const char* broken = storm.take(test::stormy_frame(random));
    ASSERT_EQ(broken, nullptr) << broken << " at frame " << i;
  }
  EXPECT_GT(storm.used(), count / 1000) << "the storm misses the drives";
  std::printf("%llu frames, %llu used by a host\n", static_cast<unsigned long long>(count),
              static_cast<unsigned long long>(storm.used()));
}

}  // namespace
}  // namespace clamber
