#include "report/peaks.hpp"

#include <gtest/gtest.h>

#include "tests/report/made_robot.hpp"

namespace clamber {
namespace {

TEST(TorquePeaks, FindsASingleTicksSpikeOfEitherSign) {
  const RunData run = test::made_climb();
  const auto peaks = torque_peaks(run);
  ASSERT_EQ(peaks.size(), run.model.joints.size());
  EXPECT_EQ(peaks[4].joint, "LKneeSag");
  EXPECT_DOUBLE_EQ(peaks[4].value, 41.5);
  EXPECT_DOUBLE_EQ(peaks[4].time, 1.234);
  EXPECT_NEAR(peaks[0].value, 8.0, 1e-3);
  const auto largest = largest_peak(peaks);
  ASSERT_TRUE(largest.has_value());
  EXPECT_EQ(largest->joint, "LKneeSag");
}

TEST(TorquePeaks, LeavesOutWhatIsEarlier) {
  const RunData run = test::made_climb();
  const auto largest = largest_peak(torque_peaks(run, 1.2345));
  ASSERT_TRUE(largest.has_value());
  EXPECT_LE(largest->value, 8.0);
  EXPECT_FALSE(largest_peak(torque_peaks(run, 100.0)).has_value());
}

TEST(HandsCarryFrom, NeedsBothWristsAboveTheThreshold) {
  RunData run = test::made_climb();
  ASSERT_TRUE(hands_carry_from(run).has_value());
  EXPECT_DOUBLE_EQ(*hands_carry_from(run), 2.0);
  for (TelemetryFrame& frame : run.frames) {
    if (frame.time < 2.5) {
      frame.force_obstacle[5] = 5.0;  // Rwrist: at the threshold, not above
    }
  }
  EXPECT_DOUBLE_EQ(*hands_carry_from(run), 2.5);
  for (TelemetryFrame& frame : run.frames) {
    frame.flags = 0;
  }
  EXPECT_FALSE(hands_carry_from(run).has_value());
}

}  // namespace
}  // namespace clamber
