// Runs the controller against a motor bus, as fast as possible or on the clock's 1 kHz grid.
// Owns its thread for the run. The loop itself allocates nothing and, paced by the clock, does no
// file access; the bus and the observer may (a simulated bus does).
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <vector>

#include "apps/run_log.hpp"
#include "control/controller.hpp"
#include "firmware_hal/motor_bus.hpp"
#include "telemetry/frame_sink.hpp"

namespace clamber {

struct ExecutorOptions {
  bool realtime = false;    ///< paced on an absolute grid of CLOCK_MONOTONIC
  double fault_time = 1.0;  ///< s that a faulted run goes on holding before it ends
  /// Adds the simulation's truth to a tick's frame; called before the bus moves on.
  std::function<void(TelemetryFrame&)> observe = {};
  std::vector<FrameSink*> sinks = {};       ///< besides the log
  RunLogWriter* log = nullptr;              ///< size it with log_capacity()
  const std::atomic<bool>* stop = nullptr;  ///< set from outside: end after the current tick
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
  double worst_wakeup = 0.0;   ///< s, latest start of a tick after its grid point
  std::uint64_t log_dropped = 0;
};

/// Frames a log must hold between flushes: all of a paced run, which must not touch files.
[[nodiscard]] std::size_t log_capacity(const Controller& controller, bool realtime);

/// Enables the bus, runs until the controller has finished, faulted, the bus is down or stop is
/// set, and disables the bus. The controller must be loaded.
[[nodiscard]] ExecutorReport execute(Controller& controller, MotorBus& bus,
                                     const ExecutorOptions& options);

}  // namespace clamber
