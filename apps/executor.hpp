// Runs the controller against a motor bus, as fast as possible or on the clock's 1 kHz grid.
// Paced by the clock it has a thread of its own for the run (control_thread.hpp), which keeps to
// what its guards demand; else it uses the caller's. The loop itself allocates nothing and, paced,
// does no file access; the bus and the observer may (a simulated bus does).
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "apps/input_log.hpp"
#include "apps/operator_desk.hpp"
#include "apps/realtime/latency_histogram.hpp"
#include "apps/realtime/runtime_settings.hpp"
#include "apps/realtime/tick_guards.hpp"
#include "apps/run_log.hpp"
#include "apps/run_pulse.hpp"
#include "control/controller.hpp"
#include "firmware_hal/motor_bus.hpp"
#include "telemetry/port.hpp"

namespace clamber {

struct ExecutorOptions {
  bool realtime = false;    ///< paced on an absolute grid of CLOCK_MONOTONIC
  double fault_time = 1.0;  ///< s that a faulted run goes on holding before it ends
  RuntimeSettings runtime = ordinary_thread();  ///< of a paced run
  /// What exchange() may ask of the kernel. Guards cover it too, but for a simulation's.
  BusCalls bus_calls = BusCalls::kSimulation;
  /// Adds the simulation's truth to a tick's frame; called before the bus moves on. Must not throw.
  std::function<void(TelemetryFrame&)> observe = {};
  TelemetryPort* telemetry = nullptr;       ///< every frame and what happens goes there too
  RunLogWriter* log = nullptr;              ///< size it with log_capacity()
  InputLogWriter* inputs = nullptr;         ///< what `clamber replay` needs; ditto
  const std::atomic<bool>* stop = nullptr;  ///< set from outside: end after the current tick
  /// The operator's. Drives stay off until he has armed, and a fault does not end the run. Without:
  /// armed and started at once.
  OperatorDesk* desk = nullptr;
  RunPulse* pulse = nullptr;  ///< shown to those who watch from outside
  /// The drives are about to be commanded; whoever asked them questions until now stops that before
  /// this returns. On the thread of the loop, outside of ticks.
  std::function<void()> before_enable = {};
};

/// Of a run paced by the clock.
struct Timing {
  LatencyHistogram wakeup;    ///< start of a tick after its grid point
  LatencyHistogram tick;      ///< controller, log and telemetry ring
  LatencyHistogram exchange;  ///< with the wait for the replies
};

struct ExecutorReport {
  TickStatus status = TickStatus::kFault;  ///< the last tick's
  FaultCode fault = FaultCode::kNone;
  std::uint32_t fault_joint = 0;
  BusStatus bus = BusStatus::kOk;  ///< kDown ended the run
  bool stopped = false;            ///< by ExecutorOptions::stop
  std::uint64_t ticks = 0;
  double duration = 0.0;       ///< s, on the controller's clock
  double wall_time = 0.0;      ///< s
  std::uint64_t overruns = 0;  ///< ticks that ended after their period (realtime)
  std::uint64_t skipped = 0;   ///< grid points lost to them
  Timing timing;
  GuardReport guards;
  std::vector<std::string> refused;  ///< what the system did not grant of ExecutorOptions::runtime
  std::uint64_t log_dropped = 0;
};

/// Frames a log must hold between flushes: all of a paced run, which must not touch files.
[[nodiscard]] std::size_t log_capacity(const Controller& controller, bool realtime);

/// Enables the bus, runs until the controller has finished, faulted, the bus is down or stop is
/// set, and disables the bus. The controller must be loaded.
/// @throws InputError before the bus is enabled: a required setting is not granted, no such guard
[[nodiscard]] ExecutorReport execute(Controller& controller, MotorBus& bus,
                                     const ExecutorOptions& options);

}  // namespace clamber
