#include "telemetry/check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

using testing::HasSubstr;

CheckSample sample(double first, double second) {
  CheckSample s;
  s.frame.joint_count = 2;
  s.frame.tau_meas = {first, second};
  s.frame.tau_limit = {30.0, 10.0};
  s.frame.temperature = {40.0, 50.0};
  s.frame.age = {0, 3};
  s.frame.q_ref = {0.5, 0.5};
  s.frame.q = {0.5, 0.75};
  s.lateness = 120.0;
  s.lost = 2.0;
  return s;
}

CheckResult judge(const std::string& text) {
  Check check(text);
  check.describe({"knee", "wrist"});
  check.add(sample(-20.0, 1.0));
  check.add(sample(10.0, 3.0));
  return check.result();
}

TEST(Check, JudgesEveryStatistic) {
  EXPECT_EQ(judge("max(tau[knee]) < 11").value, 10.0);
  EXPECT_EQ(judge("min(tau[knee])<0").value, -20.0);
  EXPECT_EQ(judge("mean(tau[knee]) == -5").value, -5.0);
  EXPECT_TRUE(judge("mean(tau[knee]) == -5").passed);
  EXPECT_DOUBLE_EQ(judge("rms(tau[knee]) < 16").value, std::sqrt(250.0));
  EXPECT_EQ(judge(" last ( tau [ wrist ] ) >= 3 ").value, 3.0);
}

TEST(Check, JudgesEveryQuantity) {
  EXPECT_EQ(judge("max(|tau|) < 30").value, 20.0);
  EXPECT_DOUBLE_EQ(judge("min(margin) > 0.3").value, 1.0 - 20.0 / 30.0);
  EXPECT_EQ(judge("max(temperature) < 60").value, 50.0);
  EXPECT_EQ(judge("max(age) <= 3").value, 3.0);
  EXPECT_EQ(judge("max(|error|) < 1").value, 0.25);
  EXPECT_EQ(judge("min(error) < 1").value, 0.0);
  EXPECT_EQ(judge("max(lateness) < 200").value, 120.0);
  EXPECT_EQ(judge("last(lost) == 0").value, 2.0);
  EXPECT_FALSE(judge("last(lost) == 0").passed);
  EXPECT_TRUE(judge("last(drops) == 0").passed);
  EXPECT_TRUE(judge("max(fault) == 0").passed);
}

TEST(Check, NamesTheJointThatIsFarthestFromPassing) {
  const CheckResult high = judge("max(|tau|) < 2");
  EXPECT_FALSE(high.passed);
  EXPECT_EQ(high.joint, "knee");
  EXPECT_EQ(high.value, 20.0);
  EXPECT_EQ(high.samples, 2U);
  const CheckResult low = judge("min(|tau|) > 5");
  EXPECT_EQ(low.joint, "wrist");
  EXPECT_EQ(low.value, 1.0);
  EXPECT_EQ(judge("max(lateness) < 1").joint, "");
}

TEST(Check, WithoutSamplesNothingPasses) {
  const CheckResult none = Check("max(|tau|) < 30").result();
  EXPECT_FALSE(none.passed);
  EXPECT_EQ(none.samples, 0U);
}

TEST(Check, NotANumberDoesNotPass) {
  Check check("max(tau) < 30");
  check.add(sample(1.0, 0.0));
  check.add(sample(NAN, 0.0));
  check.add(sample(1.0, 0.0));
  EXPECT_FALSE(check.result().passed);
}

TEST(Check, SaysWhereItIsNotUnderstood) {
  const auto error = [](const std::string& text) -> std::string {
    try {
      const Check check(text);
    } catch (const InputError& e) {
      return e.what();
    }
    return "no error";
  };
  EXPECT_THAT(error(""), HasSubstr("column 1: expected a statistic (max, min"));
  EXPECT_THAT(error("most(tau) < 3"), HasSubstr("column 1: expected a statistic"));
  EXPECT_THAT(error("max tau < 3"), HasSubstr("column 5: expected '(', found 'tau < 3'"));
  EXPECT_THAT(error("max(torque) < 3"), HasSubstr("column 5: expected a quantity (tau, "));
  EXPECT_THAT(error("max(|tau) < 3"), HasSubstr("column 9: expected '|'"));
  EXPECT_THAT(error("max(tau[]) < 3"), HasSubstr("column 9: expected the name of a joint"));
  EXPECT_THAT(error("max(lost[knee]) < 3"), HasSubstr("column 5: expected a quantity of joints"));
  EXPECT_THAT(error("max(tau) = 3"), HasSubstr("column 10: expected a comparison (<=, "));
  EXPECT_THAT(error("max(tau) <"), HasSubstr("column 11: expected a number, found the end"));
  EXPECT_THAT(error("max(tau) < inf"), HasSubstr("column 12: expected a number"));
  EXPECT_THAT(error("max(tau) < 3 N"), HasSubstr("column 14: expected the end, found 'N'"));
}

TEST(Check, RefusesAJointThatTheRobotDoesNotHave) {
  Check check("max(tau[ankle]) < 3");
  EXPECT_THAT(
      [&] {
        check.describe({"knee", "wrist"});
      },
      testing::ThrowsMessage<InputError>(HasSubstr("no joint 'ankle', only knee wrist")));
}

}  // namespace
}  // namespace clamber
