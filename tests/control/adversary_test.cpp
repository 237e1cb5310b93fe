// A slice of bench/random_inputs: whatever comes in, what goes out keeps its limits and the
// supervisor its states.
#include "tests/control/adversary.hpp"

#include <gtest/gtest.h>

namespace clamber {
namespace {

TEST(Adversary, NoInputMakesAForbiddenCommandOrState) {
  test::Adversary adversary(20, 4);
  const test::CampaignResult result = adversary.run(100000);
  EXPECT_EQ(result.broken, "");
  EXPECT_EQ(result.ticks, 100000u);
  // It has been everywhere.
  for (std::size_t m = 0; m < kModeCount; ++m)
    EXPECT_GT(result.modes[m], 0u) << to_string(static_cast<Mode>(m));
  for (std::size_t f = 1; f < kFaultCount; ++f)
    EXPECT_GT(result.faults[f], 0u) << to_string(static_cast<FaultCode>(f));
}

}  // namespace
}  // namespace clamber
