// Settings, run loop and run log around the controller.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "apps/controller_config.hpp"
#include "apps/executor.hpp"
#include "apps/run_log.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"
#include "tests/apps/plant_bus.hpp"
#include "tests/control/test_plan.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

class Files : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) /
              (std::string("clamber_apps_") +
               testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path write(const std::string& text) {
    std::ofstream(folder_ / "file") << text;
    return folder_ / "file";
  }
  fs::path folder_;
};

RobotModel small_robot() {
  RobotModel robot;
  robot.name = "small";
  robot.hash = std::string(test::kRobotHash);
  for (const char* name : {"LShYaw", "LElbj", "RElbj"}) {
    Joint joint;
    joint.name = name;
    joint.lower = -2.0;
    joint.upper = 2.0;
    joint.velocity_limit = 4.0;
    joint.torque_limit = 30.0;
    joint.drive_torque_limit = 50.0;
    joint.kp = 1000.0;
    joint.ki = 2.0;
    joint.kd = 3.0;
    robot.joints.push_back(joint);
  }
  robot.contacts.resize(2);
  robot.contacts[0].name = "Lwrist";
  robot.contacts[1].name = "Rwrist";
  return robot;
}

using ControllerSettings = Files;

TEST_F(ControllerSettings, TheShippedFileStatesTheDefaults) {
  const fs::path configs = fs::path(CLAMBER_SOURCE_DIR) / "configs";
  const RobotModel coman = load_robot(configs / "robots/coman/robot.yaml");
  const ControllerConfig shipped = load_controller_config(configs / "control/default.yaml", coman);
  const ControllerConfig built_in = load_controller_config(write("{}"), coman);
  EXPECT_EQ(shipped.joint_count, 23u);
  EXPECT_EQ(shipped.dt, built_in.dt);
  EXPECT_EQ(shipped.feed_forward, built_in.feed_forward);
  EXPECT_EQ(shipped.torque_rate_limit, built_in.torque_rate_limit);
  EXPECT_EQ(shipped.derivative_filter, built_in.derivative_filter);
  EXPECT_EQ(shipped.transfer_time, built_in.transfer_time);
  EXPECT_EQ(shipped.time_scale, built_in.time_scale);
  EXPECT_EQ(shipped.start_time, built_in.start_time);
  EXPECT_EQ(shipped.start_speed, built_in.start_speed);
  EXPECT_EQ(shipped.start_distance_limit, built_in.start_distance_limit);
  EXPECT_EQ(shipped.hold_time, built_in.hold_time);
  EXPECT_EQ(shipped.tracking_error_limit, built_in.tracking_error_limit);
  EXPECT_EQ(shipped.stale_ticks_limit, built_in.stale_ticks_limit);
  EXPECT_EQ(shipped.overshoot_limit, built_in.overshoot_limit);
  EXPECT_EQ(shipped.velocity_factor, built_in.velocity_factor);
  EXPECT_EQ(shipped.joints[2].gains.kp, 1000.0);
  EXPECT_EQ(shipped.joints[2].gains.ki, 100.0);
  EXPECT_EQ(shipped.joints[2].torque_limit, 30.0);
}

TEST_F(ControllerSettings, TheRobotsOwnGainsLieBetweenItsModelAndTheFile) {
  const fs::path configs = fs::path(CLAMBER_SOURCE_DIR) / "configs";
  const fs::path own = configs / "robots/coman/control.yaml";
  const RobotModel coman = load_robot(configs / "robots/coman/robot.yaml");
  const auto arm = static_cast<std::size_t>(*coman.find_joint("LShSag"));
  const auto knee = static_cast<std::size_t>(*coman.find_joint("LKneeSag"));
  for (const char* file : {"control/default.yaml", "control/playback.yaml"}) {
    const ControllerConfig shipped =
        load_controller_config(configs / file, coman, own, FeedForward::kNone);
    EXPECT_EQ(shipped.joints[knee].gains.kp, 1000.0) << file;
    EXPECT_EQ(shipped.joints[knee].gains.ki, 40.0) << file;
    EXPECT_EQ(shipped.joints[arm].gains.ki, 0.1) << file;
  }
  const fs::path settings = write("gains: [{joints: [LKneeSag], ki: 7}]");
  EXPECT_EQ(load_controller_config(settings, coman, own).joints[knee].gains.ki, 7.0);
}

TEST_F(ControllerSettings, FeedForwardHasGainsOfItsOwn) {
  const RobotModel robot = small_robot();
  const fs::path file = write(R"(
gains: [{joints: ["*"], ki: 9}]
feed_forward_gains: [{joints: ["*"], ki: 0.5}]
)");
  const auto ki = [&](std::optional<FeedForward> feed_forward) {
    return load_controller_config(file, robot, {}, feed_forward).joints[0].gains.ki;
  };
  EXPECT_EQ(ki(FeedForward::kPlan), 0.5);
  EXPECT_EQ(ki(FeedForward::kNone), 9.0);
  EXPECT_EQ(ki(std::nullopt), 0.5);  // the plan's torques are the default
}

TEST_F(ControllerSettings, TheShippedFilesSuitAnyRobot) {
  const fs::path configs = fs::path(CLAMBER_SOURCE_DIR) / "configs";
  const RobotModel testbot = load_robot(configs / "robots/testbot/robot.yaml");
  for (const char* file : {"control/default.yaml", "control/playback.yaml"}) {
    const ControllerConfig shipped = load_controller_config(configs / file, testbot);
    for (std::size_t j = 0; j < testbot.joints.size(); ++j) {
      EXPECT_EQ(shipped.joints[j].gains.kp, testbot.joints[j].kp);
      EXPECT_EQ(shipped.joints[j].gains.ki, testbot.joints[j].ki);
    }
  }
}

TEST_F(ControllerSettings, OverridesByKeyAndByGroup) {
  const ControllerConfig config = load_controller_config(write(R"(
rate_hz: 500
feed_forward: none
torque_limit: drive
tracking_error_limit: off
start: {distance_limit: 0.2}
gains:
  - {joints: ["*"], kd: 5}
  - {joints: ["*Elbj", LShYaw], kp: 600}
  - {joints: [RElbj], ki: 0}
)"),
                                                         small_robot());
  EXPECT_EQ(config.dt, 0.002);
  EXPECT_EQ(config.feed_forward, FeedForward::kNone);
  EXPECT_TRUE(std::isinf(config.tracking_error_limit));
  EXPECT_EQ(config.start_distance_limit, 0.2);
  for (std::size_t j = 0; j < 3; ++j) {
    EXPECT_EQ(config.joints[j].torque_limit, 50.0);
    EXPECT_EQ(config.joints[j].gains.kp, 600.0);
    EXPECT_EQ(config.joints[j].gains.kd, 5.0);
    EXPECT_EQ(config.joints[j].gains.ki, j == 2 ? 0.0 : 2.0);
  }
}

TEST_F(ControllerSettings, NamesLineAndKeyOfWhatIsWrong) {
  const auto error = [&](const std::string& text) -> std::string {
    try {
      static_cast<void>(load_controller_config(write(text), small_robot()));
    } catch (const InputError& e) {
      return e.what();
    }
    return "no error";
  };
  using testing::HasSubstr;
  EXPECT_THAT(error("rate_hz: 0"), HasSubstr("file:1: rate_hz"));
  EXPECT_THAT(error("\nhold: 3"), HasSubstr("hold"));
  EXPECT_THAT(error("feed_forward: some"), HasSubstr("expected plan or none, found some"));
  EXPECT_THAT(error("torque_limit: 20"), HasSubstr("expected plan or drive, found 20"));
  EXPECT_THAT(error("stale_ticks_limit: 1.5"), HasSubstr("expected a number of ticks"));
  EXPECT_THAT(error("gains: [{joints: [\"*Knee\"], kp: 1}]"),
              HasSubstr("'*Knee' matches no joint of robot small"));
  EXPECT_THAT(error("gains: [{joints: [LElbj], kp: -1}]"), HasSubstr("kp"));
  EXPECT_THAT(error("start: {time: .nan}"), HasSubstr("start.time"));
}

TEST(Pattern, StarStandsForAnything) {
  EXPECT_TRUE(matches("LElbj", "LElbj"));
  EXPECT_FALSE(matches("LElb", "LElbj"));
  EXPECT_TRUE(matches("*Sag", "RHipSag"));
  EXPECT_TRUE(matches("R*Sag", "RHipSag"));
  EXPECT_FALSE(matches("L*Sag", "RHipSag"));
  EXPECT_TRUE(matches("*", "anything"));
  EXPECT_TRUE(matches("*H*S*", "RHipSag"));
  EXPECT_FALSE(matches("*H*S*x", "RHipSag"));
}

class Execution : public Files {
 protected:
  Execution() {
    config_ = test::make_config(3);
    image_ = test::make_image(3, test::smooth_keyframes(3, 11));  // 1 s
    workspace_.resize(Controller::workspace_size(11));
    EXPECT_EQ(controller_.load(config_, test::kRobotHash, image_, workspace_).status,
              LoadStatus::kOk);
  }
  RunLogWriter make_log(const fs::path& file, bool realtime) {
    return {file, make_run_log_header(small_robot(), "cafe", 1e-3),
            log_capacity(controller_, realtime)};
  }
  ControllerConfig config_;
  std::vector<std::byte> image_;
  std::vector<double> workspace_;
  Controller controller_;
  test::PlantBus bus_{3};
};

/// Drives that take long to be told are told the earlier.
TEST_F(Execution, TellsTheDrivesBeforeThePhaseBegins) {
  auto keyframes = test::smooth_keyframes(3, 41);
  for (ImageKeyframe& k : keyframes)
    if (k.phase == 1) k.failure_policy = static_cast<std::uint32_t>(FailurePolicy::kLower);
  const std::vector<std::byte> image = test::make_image(3, keyframes);
  std::vector<double> workspace(Controller::workspace_size(41));
  std::vector<std::uint64_t> told;
  for (const double delay : {0.0, 0.05}) {
    Controller controller;
    ASSERT_EQ(controller.load(config_, test::kRobotHash, image, workspace).status, LoadStatus::kOk);
    test::PlantBus bus(3);
    bus.policy_delay_ = delay;
    ASSERT_EQ(execute(controller, bus, {}).status, TickStatus::kFinished);
    ASSERT_GE(bus.told_.size(), 2u);
    EXPECT_EQ(bus.told_[0], (std::pair{std::uint64_t{1}, FailurePolicy::kHold}));
    EXPECT_EQ(bus.told_[1].second, FailurePolicy::kLower);
    told.push_back(bus.told_[1].first);
  }
  EXPECT_EQ(told[0] - told[1], 50u);  // ticks
}

TEST_F(Execution, LogsEveryTickOfAFullRun) {
  RunLogWriter writer = make_log(folder_ / "run.log", false);
  std::uint64_t observed = 0;
  const ExecutorReport report = execute(controller_, bus_,
                                        {.observe =
                                             [&](TelemetryFrame& f) {
                                               ++observed;
                                               f.flags |= kFrameHasTruth;
                                               f.contact_count = 2;
                                             },
                                         .log = &writer});
  EXPECT_EQ(report.status, TickStatus::kFinished);
  EXPECT_EQ(report.ticks, controller_.expected_ticks() + 1);
  EXPECT_EQ(observed, report.ticks);
  EXPECT_EQ(report.log_dropped, 0u);
  EXPECT_EQ(bus_.deadline_seen_, 0);
  EXPECT_TRUE(bus_.disabled_);
  const RunLog log = load_run_log(folder_ / "run.log");
  EXPECT_THAT(log.header.joint_names, testing::ElementsAre("LShYaw", "LElbj", "RElbj"));
  EXPECT_THAT(log.header.contact_names, testing::ElementsAre("Lwrist", "Rwrist"));
  EXPECT_EQ(log.header.plan_sha256, "cafe");
  EXPECT_EQ(log.header.dt, 1e-3);
  ASSERT_EQ(log.frames.size(), report.ticks);
  for (std::size_t i = 0; i < log.frames.size(); ++i) {
    EXPECT_EQ(log.frames[i].sequence, i);
    EXPECT_EQ(log.frames[i].flags, kFrameHasTruth);
  }
}

TEST_F(Execution, TwoRunsWriteTheSameBytes) {
  for (const char* name : {"a.log", "b.log"}) {
    Controller controller;
    ASSERT_EQ(controller.load(config_, test::kRobotHash, image_, workspace_).status,
              LoadStatus::kOk);
    test::PlantBus bus(3);
    RunLogWriter writer = make_log(folder_ / name, false);
    static_cast<void>(execute(controller, bus, {.log = &writer}));
  }
  EXPECT_EQ(read_file(folder_ / "a.log"), read_file(folder_ / "b.log"));
}

TEST_F(Execution, EndsWhenTheBusGoesDown) {
  bus_.down_at_ = 100;
  const ExecutorReport report = execute(controller_, bus_, {});
  EXPECT_EQ(report.bus, BusStatus::kDown);
  EXPECT_EQ(report.ticks, 99u);
  EXPECT_TRUE(bus_.disabled_);
}

TEST_F(Execution, EndsSomeTimeAfterAFault) {
  for (auto& plant : bus_.robot_.plants) plant.q = 0.6;
  const ExecutorReport report = execute(controller_, bus_, {.fault_time = 0.2});
  EXPECT_EQ(report.status, TickStatus::kFault);
  EXPECT_EQ(report.fault, FaultCode::kStartDistance);
  EXPECT_EQ(report.ticks, 201u);
}

TEST_F(Execution, EndsWhenAskedTo) {
  std::atomic<bool> stop{true};
  const ExecutorReport report = execute(controller_, bus_, {.stop = &stop});
  EXPECT_TRUE(report.stopped);
  EXPECT_EQ(report.ticks, 1u);
}

// Loose bounds: the machine may be busy. What must hold exactly is that late ticks are counted and
// the grid is kept, so that wall time is the grid's.
TEST_F(Execution, KeepsTheGridWhenATickIsLate) {
  bus_.stall_at_ = 500;
  RunLogWriter writer = make_log(folder_ / "run.log", true);
  const ExecutorReport report = execute(controller_, bus_, {.realtime = true, .log = &writer});
  EXPECT_EQ(report.status, TickStatus::kFinished);
  EXPECT_GE(report.overruns, 1u);
  EXPECT_GE(report.skipped, 5u);
  EXPECT_NE(bus_.deadline_seen_, 0);
  EXPECT_EQ(report.log_dropped, 0u);
  const double grid = 1e-3 * static_cast<double>(report.ticks + report.skipped);
  EXPECT_NEAR(report.wall_time, grid, 0.05);
}

TEST_F(Execution, RefusesADamagedLog) {
  {
    RunLogWriter writer = make_log(folder_ / "run.log", false);
    static_cast<void>(execute(controller_, bus_, {.log = &writer}));
  }
  const std::string good = read_file(folder_ / "run.log");
  const auto error = [&](const std::string& bytes) -> std::string {
    try {
      static_cast<void>(load_run_log(write(bytes)));
    } catch (const InputError& e) {
      return e.what();
    }
    return "no error";
  };
  using testing::HasSubstr;
  EXPECT_EQ(error(good), "no error");
  EXPECT_THAT(error(good.substr(0, good.size() - 1)), HasSubstr("truncated in frame"));
  EXPECT_THAT(error("{}\n"), HasSubstr("not a run log"));
  EXPECT_THAT(error("nonsense\n"), HasSubstr("not a run log"));
  EXPECT_THAT(error(""), HasSubstr("not a run log"));
  std::string other = good;
  other.replace(other.find("\"frame_bytes\":"), 15, "\"frame_bytes\":9");
  EXPECT_THAT(error(other), HasSubstr("frame_bytes"));
}

}  // namespace
}  // namespace clamber
