#include "telemetry/torque_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "telemetry/event_history.hpp"
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

const TelemetryDescription kTwoJoints = [] {
  TelemetryDescription description;
  description.joint_names = {"knee", "wrist"};
  description.torque_limits = {30.0, 10.0};
  return description;
}();

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
  EXPECT_THAT(plain_line({watch}), HasSubstr("joint 0 12.00/? N m, limit unknown"));
  watch.describe(kTwoJoints);
  EXPECT_THAT(plain_line({watch}), HasSubstr("knee 12.00/30.0 N m, margin 60.0 %, peak 12.00"));
}

TEST(TorqueDisplay, PlainLineTellsClocksAndLosses) {
  TorqueWatch watch;
  watch.describe(kTwoJoints);
  watch.add(frame(1000, 0.0, 0.0));
  watch.add(frame(1002, 0.0, 0.0));
  EXPECT_THAT(plain_line({watch, 5}), HasSubstr("t 1.002 s"));
  EXPECT_THAT(plain_line({watch, 5}), HasSubstr("frames 2  lost 1  ring drops 5"));
}

TEST(TorqueDisplay, DashboardKeepsTheWorstWhenRowsAreFew) {
  TorqueWatch watch;
  watch.describe(kTwoJoints);
  watch.add(frame(0, 15.0, 9.0));
  EXPECT_THAT(dashboard({watch}, 24), HasSubstr("knee"));
  EXPECT_THAT(dashboard({watch}, 24), HasSubstr("[##########################|...]"));
  const std::string low = dashboard({watch}, 5);
  EXPECT_THAT(low, HasSubstr("wrist"));
  EXPECT_THAT(low, Not(HasSubstr("knee")));
}

TEST(TorqueWatch, CountsTheTimeAtTheLimit) {
  TorqueWatch watch;
  watch.describe(kTwoJoints);
  for (std::uint64_t tick = 0; tick < 20; ++tick) {
    TelemetryFrame f = frame(tick, 1.0, 1.0);
    f.tau_limit = {30.0, 10.0};
    f.tau_cmd[1] = tick >= 10 ? -10.0 : 9.0;
    watch.add(f);
  }
  EXPECT_NEAR(watch.worst_first()[0].saturated, 0.010, 1e-12);
  EXPECT_EQ(watch.worst_first()[1].saturated, 0.0);
  EXPECT_THAT(plain_line({watch}),
              HasSubstr("wrist 1.00/10.0 N m, margin 90.0 %, peak 1.00, 0.010 s at limit"));
}

TEST(TorqueDisplay, TellsStateLoopAndEvents) {
  TorqueWatch watch;
  TelemetryDescription names = kTwoJoints;
  names.modes = {"boot", "executing"};
  names.faults = {"none", "tracking error"};
  names.phases = {{"State1", 3}};
  watch.describe(names);
  TelemetryFrame f = frame(5, 1.0, 1.0);
  f.mode = f.fault = 1;
  f.fault_joint = 1;
  watch.add(f);
  EXPECT_EQ(state_text(watch), "mode executing  phase 0 'State1'  fault tracking error at wrist");
  TelemetryEvent event;
  event.time = 1.5;
  event.kind = EventKind::kFault;
  event.severity = Severity::kError;
  event.joint = 1;
  event.append("tracking error");
  const MonitorView view{
      .torques = watch,
      .loop = LoopFigures{.paced = true, .wakeup_p99 = 70.4, .overruns = 2, .restarts = 1},
      .events = {event}};
  EXPECT_THAT(plain_line(view), HasSubstr("wake-up p99 70 max 0 us"));
  EXPECT_THAT(plain_line(view), HasSubstr("late 2"));
  EXPECT_THAT(plain_line(view), HasSubstr("publisher restarted 1 times"));
  EXPECT_THAT(dashboard(view, 24), HasSubstr("1.500 s  error    fault: tracking error at wrist"));
  EXPECT_THAT(dashboard(view, 10), Not(HasSubstr("1.500 s  error")));
}

TEST(TorqueDisplay, OverloadDoesNotOverflowTheBar) {
  TorqueWatch watch;
  watch.describe(kTwoJoints);
  watch.add(frame(0, 1e6, -1e300));
  EXPECT_THAT(dashboard({watch}, 24), HasSubstr("[#############################|]"));
}

TEST(EventHistory, KnowsWhatIsSentAgainAndForgetsTheRunBefore) {
  EventHistory history;
  TelemetryEvent event;
  const auto add = [&](std::uint64_t number, std::int64_t start) {
    event.sequence = number;
    return history.add(event, start);
  };
  EXPECT_TRUE(add(0, 100));
  EXPECT_TRUE(add(1, 100));
  EXPECT_FALSE(add(0, 100));
  EXPECT_FALSE(add(1, 100));
  EXPECT_TRUE(add(2, 100));
  EXPECT_EQ(history.events().size(), 3U);
  EXPECT_TRUE(add(0, 200));
  EXPECT_EQ(history.events().size(), 1U);
  EXPECT_EQ(history.start(), 200);
  for (std::uint64_t i = 1; i < 2 * EventHistory::kKept; ++i) add(i, 200);
  EXPECT_EQ(history.events().size(), EventHistory::kKept);
  EXPECT_EQ(history.events().back().sequence, 2 * EventHistory::kKept - 1);
}

}  // namespace
}  // namespace clamber
