// A motor bus to independent joints, for tests of the run loop.
#pragma once

#include <time.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "firmware_hal/motor_bus.hpp"
#include "tests/control/test_plan.hpp"

namespace clamber::test {

/// Independent joints that move one tick per exchange.
class PlantBus final : public MotorBus {
 public:
  explicit PlantBus(std::size_t joints) : robot_(joints) {}
  int joint_count() const noexcept override { return static_cast<int>(robot_.plants.size()); }
  BusStatus enable() override { return BusStatus::kOk; }
  BusStatus exchange(std::span<const JointCommand> commands, std::span<JointState> states,
                     std::int64_t deadline_ns) noexcept override {
    ++counters_.exchanges;
    if (counters_.exchanges == down_at_) return BusStatus::kDown;
    if (counters_.exchanges == stall_at_) {
      const timespec nap{.tv_sec = 0, .tv_nsec = 5'500'000};
      nanosleep(&nap, nullptr);
    }
    std::copy(commands.begin(), commands.end(), robot_.commands.begin());
    robot_.step(1e-3);
    std::copy(robot_.states.begin(), robot_.states.end(), states.begin());
    deadline_seen_ = deadline_ns;
    return BusStatus::kOk;
  }
  bool set_failure_policy(FailurePolicy policy) noexcept override {
    told_.emplace_back(counters_.exchanges, policy);
    return true;
  }
  double failure_policy_delay() const noexcept override { return policy_delay_; }
  void disable() noexcept override { disabled_ = true; }
  BusCounters counters() const noexcept override { return counters_; }

  PlantRobot robot_;
  BusCounters counters_;
  std::uint64_t down_at_ = 0, stall_at_ = 0;
  std::int64_t deadline_seen_ = 0;
  bool disabled_ = false;
  double policy_delay_ = 0.0;
  std::vector<std::pair<std::uint64_t, FailurePolicy>> told_;  ///< after so many exchanges
};

}  // namespace clamber::test
