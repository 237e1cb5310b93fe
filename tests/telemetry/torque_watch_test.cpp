#include "telemetry/torque_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "telemetry/torque_display.hpp"

namespace clamber {
namespace {

using testing::HasSubstr;
using testing::Not;

TelemetryFrame frame(std::uint64_t sequence, double first, double second) {
  TelemetryFrame f;
  f.sequence = sequence;
  f.time = static_cast<double>(sequence) * 1e-3;
  f.joint_count = 2;
  f.tau_meas[0] = first;
  f.tau_meas[1] = second;
  return f;
}

const TelemetryDescription kTwoJoints{{"knee", "wrist"}, {30.0, 10.0}, {}};

TEST(TorqueWatch, SortsByMarginNotByTorque) {
  TorqueWatch watch;
  watch.describe(kTwoJoints);
  watch.add(frame(0, 15.0, -8.0));
  const auto worst = watch.worst_first();
  ASSERT_EQ(worst.size(), 2U);
  EXPECT_EQ(worst[0].name, "wrist");
  EXPECT_DOUBLE_EQ(worst[0].load(worst[0].window), 0.8);
  EXPECT_DOUBLE_EQ(worst[1].load(worst[1].window), 0.5);
}

TEST(TorqueWatch, HoldsThePeakBeyondTheWindow) {
  TorqueWatch watch;
  watch.describe(kTwoJoints);
  watch.add(frame(0, -29.0, 0.0));
  watch.add(frame(1, 3.0, 0.0));
  EXPECT_DOUBLE_EQ(watch.worst_first()[0].window, -29.0);
  watch.start_window();
  watch.add(frame(2, 6.0, 1.0));
  EXPECT_DOUBLE_EQ(watch.worst_first()[0].window, 6.0);
  EXPECT_DOUBLE_EQ(watch.worst_first()[0].peak, -29.0);
  EXPECT_EQ(watch.worst_of_run().name, "knee");
}

TEST(TorqueWatch, CountsGapsAndStartsAgainWithARun) {
  TorqueWatch watch;
  watch.describe(kTwoJoints);
  watch.add(frame(100, 20.0, 0.0));  // joined late: what came before is not lost
  watch.add(frame(101, 0.0, 0.0));
  watch.add(frame(105, 0.0, 0.0));
  EXPECT_EQ(watch.received(), 3U);
  EXPECT_EQ(watch.lost(), 3U);
  watch.add(frame(0, 1.0, 0.0));
  EXPECT_EQ(watch.received(), 1U);
  EXPECT_EQ(watch.lost(), 0U);
  EXPECT_DOUBLE_EQ(watch.worst_of_run().peak, 1.0);
  EXPECT_EQ(watch.worst_of_run().name, "knee");
}

TEST(TorqueWatch, ShowsTorquesBeforeTheDescriptionHasCome) {
  TorqueWatch watch;
  watch.add(frame(0, 12.0, 0.0));
  EXPECT_THAT(plain_line(watch, 0), HasSubstr("joint 0 12.00/? N m, limit unknown"));
  watch.describe(kTwoJoints);
  EXPECT_THAT(plain_line(watch, 0), HasSubstr("knee 12.00/30.0 N m, margin 60.0 %, peak 12.00"));
}

TEST(TorqueDisplay, PlainLineTellsClocksAndLosses) {
  TorqueWatch watch;
  watch.describe(kTwoJoints);
  watch.add(frame(1000, 0.0, 0.0));
  watch.add(frame(1002, 0.0, 0.0));
  EXPECT_THAT(plain_line(watch, 5), HasSubstr("t 1.002 s"));
  EXPECT_THAT(plain_line(watch, 5), HasSubstr("frames 2  lost 1  ring drops 5"));
}

TEST(TorqueDisplay, DashboardKeepsTheWorstWhenRowsAreFew) {
  TorqueWatch watch;
  watch.describe(kTwoJoints);
  watch.add(frame(0, 15.0, 9.0));
  EXPECT_THAT(dashboard(watch, 0, 24), HasSubstr("knee"));
  EXPECT_THAT(dashboard(watch, 0, 24), HasSubstr("[##########################|...]"));
  const std::string low = dashboard(watch, 0, 4);
  EXPECT_THAT(low, HasSubstr("wrist"));
  EXPECT_THAT(low, Not(HasSubstr("knee")));
}

TEST(TorqueDisplay, OverloadDoesNotOverflowTheBar) {
  TorqueWatch watch;
  watch.describe(kTwoJoints);
  watch.add(frame(0, 1e6, -1e300));
  EXPECT_THAT(dashboard(watch, 0, 24), HasSubstr("[#############################|]"));
}

}  // namespace
}  // namespace clamber
