// The control thread's side of the operator's desk: takes one command at a time to the controller
// and tells from the supervisor's state whether it was taken.
// Control thread; allocates: never; blocks: never; throws: never.
#pragma once

#include <atomic>
#include <cstdint>

#include "apps/operator_desk.hpp"
#include "control/controller.hpp"

namespace clamber {

class OperatorSeat {
 public:
  /// @param desk  nullptr: no operator; the controller is armed and started at the first tick
  OperatorSeat(OperatorDesk* desk, Controller& controller) noexcept;

  [[nodiscard]] bool attended() const noexcept { return desk_ != nullptr; }

  /// Before the drives are switched on: true once the operator has said `arm`. Answers all else.
  [[nodiscard]] bool armed() noexcept;
  /// While the drives are being switched on, which only an e-stop ends. True: it has, until it is
  /// acknowledged. Answers all else.
  bool stopped_while_enabling() noexcept;
  /// By an e-stop before the drives were on, not acknowledged yet.
  [[nodiscard]] bool stopped() const noexcept { return stopped_; }
  /// The drives are on: what was said before goes to the controller.
  void begin() noexcept;
  void before_tick() noexcept;
  void after_tick(const TelemetryFrame& frame) noexcept;
  /// The run's own figures, which the controller does not know.
  OperatorStatus& status() noexcept { return status_; }

 private:
  void answer(bool done, const char* reason = "", const char* detail = "") noexcept;
  void answer(std::uint64_t id, bool done, const char* reason, const char* detail) noexcept;
  void decide(SupervisorState now) noexcept;
  void publish(SupervisorState now) noexcept;

  OperatorDesk* desk_;
  Controller& controller_;
  OperatorStatus status_;
  OperatorRequest request_;  ///< kNone: nothing to be answered
  SupervisorState before_;
  std::uint32_t patience_ = 0;  ///< ticks that the command may still take
  bool stopped_ = false;        ///< by an e-stop before the drives were on
};

}  // namespace clamber
