// A motor bus that never leaves user space, and a short plan to run on it.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

#include "firmware_hal/motor_bus.hpp"
#include "tests/control/test_plan.hpp"

namespace clamber::test {

/// Independent joints that move one tick per exchange.
class StillBus : public MotorBus {
 public:
  explicit StillBus(std::size_t joints) : robot_(joints) {}
  int joint_count() const noexcept override { return static_cast<int>(robot_.plants.size()); }
  BusStatus enable() override {
    ++enabled;
    while (slow_to_enable) {
      if (give_up_ && give_up_()) return BusStatus::kDown;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return BusStatus::kOk;
  }
  void set_give_up(GiveUp asked) override { give_up_ = std::move(asked); }
  BusStatus exchange(std::span<const JointCommand> commands, std::span<JointState> states,
                     std::int64_t /*deadline_ns*/) noexcept override {
    std::copy(commands.begin(), commands.end(), robot_.commands.begin());
    robot_.step(1e-3);
    std::copy(robot_.states.begin(), robot_.states.end(), states.begin());
    if (misbehave != nullptr && ++exchanges_ == 700) misbehave();
    return BusStatus::kOk;
  }
  void disable() noexcept override {}
  BusCounters counters() const noexcept override { return {}; }

  void (*misbehave)() = nullptr;
  std::atomic<int> enabled = 0;
  std::atomic<bool> slow_to_enable = false;  ///< for as long as it is true

 private:
  GiveUp give_up_;
  PlantRobot robot_;
  int exchanges_ = 0;
};

/// A controller that has a plan of 1 s for three joints.
struct ShortPlan {
  ShortPlan() {
    workspace.resize(Controller::workspace_size(11));
    ControllerConfig config = make_config(3);
    config.watchdog_ticks = 1'000'000;  // the machine may be busy
    EXPECT_EQ(controller.load(config, kRobotHash, image, workspace).status, LoadStatus::kOk);
  }
  std::vector<std::byte> image = make_image(3, smooth_keyframes(3, 11));
  std::vector<double> workspace;
  Controller controller;
};

}  // namespace clamber::test
