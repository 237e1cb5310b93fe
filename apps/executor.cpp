#include "apps/executor.hpp"

#include <time.h>

#include <algorithm>
#include <cerrno>
#include <cmath>

namespace clamber {
namespace {

constexpr std::int64_t kNanoseconds = 1'000'000'000;

std::int64_t now_ns() noexcept {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<std::int64_t>(t.tv_sec) * kNanoseconds + t.tv_nsec;
}

void sleep_until(std::int64_t ns) noexcept {
  const timespec t{.tv_sec = static_cast<time_t>(ns / kNanoseconds),
                   .tv_nsec = static_cast<long>(ns % kNanoseconds)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr) == EINTR) {
  }
}

/// The absolute grid. A late tick costs the grid points it covers; the grid itself never shifts, so
/// that the run's ticks stay in step with whatever else counts on the same clock.
class Grid {
 public:
  explicit Grid(double dt)
      : period_(std::llround(dt * static_cast<double>(kNanoseconds))), next_(now_ns() + period_) {}

  /// Sleeps to the next grid point.
  void wait(ExecutorReport& report) noexcept {
    sleep_until(next_);
    const double late = static_cast<double>(now_ns() - next_) / static_cast<double>(kNanoseconds);
    report.worst_wakeup = std::max(report.worst_wakeup, late);
    next_ += period_;
  }
  /// The end of the current tick's period.
  [[nodiscard]] std::int64_t deadline() const noexcept { return next_; }
  /// Closes the tick's books.
  void finish_tick(ExecutorReport& report) noexcept {
    const std::int64_t late = now_ns() - next_;
    if (late <= 0) return;
    const std::int64_t lost = (late + period_ - 1) / period_;
    ++report.overruns;
    report.skipped += static_cast<std::uint64_t>(lost);
    next_ += lost * period_;
  }

 private:
  std::int64_t period_;
  std::int64_t next_;
};

void hand_over(const TelemetryFrame& frame, const ExecutorOptions& options) noexcept {
  if (options.log != nullptr) options.log->push(frame);
  for (FrameSink* sink : options.sinks) sink->push(frame);
}

/// The loop between enable() and disable().
void run(Controller& controller, MotorBus& bus, const ExecutorOptions& options,
         ExecutorReport& report) {
  const auto joints = static_cast<std::size_t>(bus.joint_count());
  const double dt = controller.config().dt;
  const auto fault_ticks = static_cast<std::uint64_t>(std::llround(options.fault_time / dt));
  std::vector<JointState> states(joints);
  std::vector<JointCommand> commands(joints);
  TelemetryFrame frame;
  std::uint64_t faulted = 0;

  // The first states are asked for with commands that ask nothing of the drives.
  Grid grid(dt);
  report.bus = bus.exchange(commands, states, options.realtime ? grid.deadline() : 0);
  while (report.bus != BusStatus::kDown) {
    if (options.realtime) grid.wait(report);
    report.status = controller.tick(states, commands, frame);
    if (options.observe) options.observe(frame);
    hand_over(frame, options);
    ++report.ticks;
    report.stopped = options.stop != nullptr && options.stop->load(std::memory_order_relaxed);
    faulted += report.status == TickStatus::kFault ? 1 : 0;
    if (report.stopped || report.status == TickStatus::kFinished || faulted > fault_ticks) break;
    report.bus = bus.exchange(commands, states, options.realtime ? grid.deadline() : 0);
    if (options.realtime)
      grid.finish_tick(report);
    else if (options.log != nullptr && options.log->wants_flush())
      options.log->flush();
  }
}

}  // namespace

std::size_t log_capacity(const Controller& controller, bool realtime) {
  if (!realtime) return 4096;
  const double dt = controller.config().dt;
  // Beyond the expected ticks: a longer move to the start, waiting for a joint, a fault held.
  return controller.expected_ticks() + static_cast<std::size_t>(std::ceil(10.0 / dt));
}

ExecutorReport execute(Controller& controller, MotorBus& bus, const ExecutorOptions& options) {
  ExecutorReport report;
  report.bus = bus.enable();
  const std::int64_t start = now_ns();
  if (report.bus != BusStatus::kDown) run(controller, bus, options, report);
  bus.disable();
  report.wall_time = static_cast<double>(now_ns() - start) / static_cast<double>(kNanoseconds);
  report.duration = static_cast<double>(report.ticks) * controller.config().dt;
  report.fault = controller.fault();
  report.fault_joint = controller.fault_joint();
  if (options.log != nullptr) {
    options.log->close();
    report.log_dropped = options.log->dropped();
  }
  return report;
}

}  // namespace clamber
