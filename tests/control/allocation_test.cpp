// The tick allocates nothing, and the guard that says so can tell.
#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>
#include <memory>
#include <vector>

#include "control/controller.hpp"
#include "tests/control/allocation_guard.hpp"
#include "tests/control/test_plan.hpp"

namespace clamber {
namespace {

class Allocation : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::allocation_guard_works()) GTEST_SKIP() << "skipped: sanitizer build";
  }
};

constexpr std::uint32_t kJoints = 23;
constexpr std::size_t kKeyframes = 81;  // 8 s

TEST_F(Allocation, TenThousandTicksAllocateNothing) {
  const auto image = test::make_image(kJoints, test::smooth_keyframes(kJoints, kKeyframes));
  auto config = test::make_config(kJoints);
  for (auto& joint : config.joints) joint.lower = -4.0, joint.upper = 4.0;
  std::vector<double> workspace(Controller::workspace_size(kKeyframes));
  test::PlantRobot robot(kJoints);
  const auto controller = std::make_unique<Controller>();
  TelemetryFrame frame;
  std::uint64_t calls = 0;
  std::uint64_t faults = 0;
  LoadReport loaded;
  {
    const test::AllocationGuard guard;
    loaded = controller->load(config, test::kRobotHash, image, workspace);
    controller->request(OperatorCommand::kArm);
    controller->request(OperatorCommand::kStart);
    for (int i = 0; i < 10000; ++i) {
      if (i == 5000) robot.states[3].q = std::numeric_limits<double>::quiet_NaN();
      const TickStatus status = controller->tick(robot.states, robot.commands, frame);
      faults += status == TickStatus::kFault ? 1 : 0;
      robot.step(config.dt);
    }
    calls = guard.calls();
  }
  EXPECT_EQ(loaded.status, LoadStatus::kOk);
  EXPECT_EQ(calls, 0u);
  EXPECT_EQ(faults, 0u);
  EXPECT_EQ(controller->status(), TickStatus::kFinished);
}

/// A tick with a flaw: it grows a vector while it runs.
struct AllocatingTick {
  std::vector<double> history;
  TickStatus tick(Controller& controller, test::PlantRobot& robot, TelemetryFrame& frame) {
    history.push_back(frame.time);
    return controller.tick(robot.states, robot.commands, frame);
  }
};

TEST_F(Allocation, TheGuardSeesATickThatAllocates) {
  const auto image = test::make_image(kJoints, test::smooth_keyframes(kJoints, kKeyframes));
  auto config = test::make_config(kJoints);
  for (auto& joint : config.joints) joint.lower = -4.0, joint.upper = 4.0;
  std::vector<double> workspace(Controller::workspace_size(kKeyframes));
  test::PlantRobot robot(kJoints);
  Controller controller;
  ASSERT_EQ(controller.load(config, test::kRobotHash, image, workspace).status, LoadStatus::kOk);
  TelemetryFrame frame;
  AllocatingTick flawed;
  std::uint64_t calls = 0;
  {
    const test::AllocationGuard guard;
    static_cast<void>(flawed.tick(controller, robot, frame));
    calls = guard.calls();
  }
  EXPECT_GE(calls, 1u);
}

TEST_F(Allocation, TheGuardSeesEveryKindOfCall) {
  const auto count = [](const auto& action) {
    const test::AllocationGuard guard;
    action();
    return guard.calls();
  };
  void* volatile kept = nullptr;
  EXPECT_EQ(count([] {}), 0u);
  EXPECT_EQ(count([&] { kept = std::malloc(8); }), 1u);
  EXPECT_EQ(count([&] { kept = std::realloc(kept, 16); }), 1u);
  EXPECT_EQ(count([&] { std::free(kept); }), 1u);
  EXPECT_EQ(count([&] { kept = std::calloc(1, 8); }), 1u);
  std::free(kept);
  EXPECT_EQ(count([&] { kept = std::aligned_alloc(64, 64); }), 1u);
  std::free(kept);
  EXPECT_EQ(count([&] { kept = ::operator new(8); }), 1u);
  ::operator delete(kept);
  // A tick that throws allocates its exception: the guard sees that too.
  EXPECT_GE(count([] {
              try {
                throw 1;
              } catch (int) {
              }
            }),
            1u);
}

}  // namespace
}  // namespace clamber
