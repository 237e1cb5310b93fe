// clamber bus budget and decode as a user meets them: output, exit codes, one line for bad input.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/apps/command_line.hpp"

namespace clamber {
namespace {

using testing::HasSubstr;
using testing::Not;

class BusCommand : public testing::Test {
 protected:
  test::CommandResult run(const std::string& arguments) const {
    return test::clamber("bus " + arguments, folder_.path());
  }
  void write(const char* name, const std::string& text) const {
    std::ofstream(folder_.path() / name) << text;
  }
  static void expect_one_line(const test::CommandResult& result, const char* message) {
    EXPECT_THAT(result.error, testing::StartsWith("clamber: error: "));
    EXPECT_THAT(result.error, HasSubstr(message));
    EXPECT_EQ(std::count(result.error.begin(), result.error.end(), '\n'), 1);
  }

  test::TemporaryFolder folder_{"bus_command"};
};

TEST_F(BusCommand, BudgetFits) {
  const auto result = run("budget configs/hal/coman_mit.yaml --frames");
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.out, HasSubstr("FD 1/5 Mbit/s"));
  EXPECT_THAT(result.out, HasSubstr("67.9 %"));
  EXPECT_THAT(result.out, HasSubstr("RHipSag reply"));
  EXPECT_EQ(run("budget configs/hal/coman_cia402.yaml").exit_code, 0);
}

TEST_F(BusCommand, BudgetRefuses) {
  const auto result = run("budget configs/hal/coman_mit_classic.yaml");
  EXPECT_EQ(result.exit_code, 1);
  expect_one_line(result, "162.0 %");
  EXPECT_THAT(result.out, HasSubstr("does not fit"));
}

TEST_F(BusCommand, UnusableMaps) {
  auto result = run("budget nowhere.yaml");
  EXPECT_EQ(result.exit_code, 2);
  expect_one_line(result, "nowhere.yaml");
  result = run("budget configs/hal/ode.yaml");
  EXPECT_EQ(result.exit_code, 2);
  expect_one_line(result, "expected socketcan");
  EXPECT_EQ(run("").exit_code, 2);
}

constexpr const char* kGood =
    "(1700000000.000100) can0 029##1FFFFFFFFFFFFFFFC\n"
    "(1700000000.000200) can0 429##119BFFFFFF000282D\n"
    "(1700000000.000300) can9 123#00\n";

TEST_F(BusCommand, DecodesALog) {
  write("good.log", kGood);
  const auto result = run("decode good.log");
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.out, HasSubstr("fd+ 029 [8]      RHipSag <- ENABLE"));
  EXPECT_THAT(result.out, HasSubstr("RHipSag -> q 2.0000 rad"));
  EXPECT_THAT(result.out, HasSubstr("interface is not in the bus map"));
  EXPECT_THAT(result.out, Not(HasSubstr("\033")));  // no terminal, no colour
  EXPECT_THAT(result.error, HasSubstr("3 frames: 1 data, 1 switching, 0 trouble, 1 foreign"));
}

TEST_F(BusCommand, DecodesCanopenWithAndWithoutAMap) {
  write("servo.log", "(1.000000) vcan3 229#0F00E803\n(1.000001) vcan3 729#05\n");
  EXPECT_THAT(run("decode servo.log --canopen").out, HasSubstr("node 41 is operational"));
  EXPECT_THAT(
      run("decode servo.log --config configs/hal/coman_cia402.yaml --bus right_leg_upper").out,
      HasSubstr("RHipSag <- control 0x000F  tau 20.00 N m"));
  const auto result = run("decode servo.log --bus third_arm");
  EXPECT_EQ(result.exit_code, 2);
  expect_one_line(result, "no bus 'third_arm'");
}

TEST_F(BusCommand, MalformedLinesAreNamedAndCounted) {
  write("half.log", std::string(kGood) + "garbage\n\n(1.000000) can0 02\n");
  const auto result = run("decode half.log");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.out, HasSubstr("ENABLE"));
  EXPECT_THAT(result.error, HasSubstr("half.log:4: expected '(seconds.microseconds)'"));
  EXPECT_THAT(result.error, HasSubstr("half.log:6: "));
  EXPECT_THAT(result.error, HasSubstr("2 unreadable lines"));
  std::string many;
  for (int i = 0; i < 1000; ++i) many += "x\n";
  write("many.log", kGood + many);
  const auto flood = run("decode many.log");
  EXPECT_LT(std::count(flood.error.begin(), flood.error.end(), '\n'), 30);
  EXPECT_THAT(flood.error, HasSubstr("1000 unreadable lines"));
}

TEST_F(BusCommand, ALogWithoutAFrameIsUnusable) {
  write("empty.log", "");
  write("text.log", "nothing\n");
  EXPECT_EQ(run("decode empty.log").exit_code, 2);
  EXPECT_EQ(run("decode text.log").exit_code, 2);
  EXPECT_EQ(run("decode nowhere.log").exit_code, 2);
}

/// Where the interfaces are there, tests/vcan/commands looks further.
TEST_F(BusCommand, LiveCommandsWithoutInterfaces) {
  if (std::filesystem::exists("/sys/class/net/can0")) GTEST_SKIP() << "skipped: there is a can0";
  for (const char* command : {"scan", "monitor"}) {
    const auto result = run(std::string(command) + " configs/hal/coman_mit.yaml");
    EXPECT_EQ(result.exit_code, 2);
    expect_one_line(result, "coman_mit.yaml: bus 'right_leg': interface 'can0': ");
    EXPECT_EQ(run(std::string(command) + " nowhere.yaml").exit_code, 2);
    EXPECT_EQ(run(command).exit_code, 2);
  }
  EXPECT_EQ(run("monitor configs/hal/coman_mit.yaml --duration 0").exit_code, 2);
}

}  // namespace
}  // namespace clamber
