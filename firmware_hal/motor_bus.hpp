// The one interface between control and motors, simulated or real.
// exchange() runs in the control thread: noexcept, and a real bus never allocates or locks in it.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "control/failure_policy.hpp"
#include "control/joint_types.hpp"

namespace clamber {

enum class BusStatus : std::uint8_t { kOk, kLate, kDown };

struct BusCounters {
  std::uint64_t exchanges = 0;
  std::uint64_t missing_replies = 0;
  std::uint64_t late = 0;
};

class MotorBus {
 public:
  using GiveUp = std::function<bool()>;

  MotorBus() = default;
  MotorBus(const MotorBus&) = delete;
  MotorBus& operator=(const MotorBus&) = delete;
  virtual ~MotorBus() = default;

  /// Number of joints; commands and states are in the robot model's joint order.
  [[nodiscard]] virtual int joint_count() const noexcept = 0;
  /// Switches the drives on. Takes as long as they do.
  [[nodiscard]] virtual BusStatus enable() = 0;
  /// What enable() asks about once a tick while it waits: true, and it switches off what is on and
  /// returns kDown. A bus whose drives are on at once need not ask.
  virtual void set_give_up(GiveUp /*asked*/) {}
  /// Sends all commands and fills all states; returns by `deadline_ns` (CLOCK_MONOTONIC; 0: none).
  [[nodiscard]] virtual BusStatus exchange(std::span<const JointCommand> commands,
                                           std::span<JointState> states,
                                           std::int64_t deadline_ns) noexcept = 0;
  /// What the drives shall do when no exchange comes any more, from the next exchange on. Control
  /// thread, between two exchanges; until the first call, and where it is refused, drives do what
  /// they are set to. @return false: drives of this kind cannot be told
  [[nodiscard]] virtual bool set_failure_policy(FailurePolicy /*policy*/) noexcept { return false; }
  /// s from that call until the last drive has been told.
  [[nodiscard]] virtual double failure_policy_delay() const noexcept { return 0.0; }
  /// Switches the drives off.
  virtual void disable() noexcept = 0;
  [[nodiscard]] virtual BusCounters counters() const noexcept = 0;
};

}  // namespace clamber
