#include "apps/executor.hpp"

#include <time.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <optional>

#include "apps/operator_seat.hpp"
#include "apps/realtime/control_thread.hpp"
#include "apps/run_events.hpp"

namespace clamber {
namespace {

constexpr std::int64_t kNanoseconds = 1'000'000'000;
constexpr std::int64_t kLookForOperator = 1'000'000;  // ns, while the drives are off

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
  explicit Grid(double dt) : period_(std::llround(dt * static_cast<double>(kNanoseconds))) {}

  /// The first grid point is a period from now.
  void begin() noexcept { next_ = now_ns() + period_; }
  /// Sleeps to the next grid point. @return now
  std::int64_t wait(ExecutorReport& report) noexcept {
    sleep_until(next_);
    const std::int64_t now = now_ns();
    wakeup_ = now - next_;
    report.timing.wakeup.add(wakeup_);
    next_ += period_;
    return now;
  }
  /// Of the current tick: its start after its grid point, ns.
  [[nodiscard]] std::int64_t wakeup() const noexcept { return wakeup_; }
  /// The end of the current tick's period.
  [[nodiscard]] std::int64_t deadline() const noexcept { return next_; }
  /// Closes the tick's books.
  void finish_tick(std::int64_t now, ExecutorReport& report) noexcept {
    const std::int64_t late = now - next_;
    if (late <= 0) return;
    const std::int64_t lost = (late + period_ - 1) / period_;
    ++report.overruns;
    report.skipped += static_cast<std::uint64_t>(lost);
    next_ += lost * period_;
  }

 private:
  std::int64_t period_;
  std::int64_t next_ = 0;
  std::int64_t wakeup_ = 0;
};

std::uint64_t ticks_in(double seconds, double dt) {
  return static_cast<std::uint64_t>(std::llround(seconds / dt));
}

/// What happens between enable() and disable(). All memory is had before the first tick.
class Loop {
 public:
  Loop(Controller& controller, MotorBus& bus, const ExecutorOptions& options,
       ExecutorReport& report)
      : controller_(controller),
        bus_(bus),
        options_(options),
        report_(report),
        seat_(options.desk, controller),
        grid_(controller.config().dt),
        guards_(options.runtime.guards, ticks_in(options.runtime.warm_up, controller.config().dt)),
        guard_exchange_(options.bus_calls != BusCalls::kSimulation),
        fault_ticks_(ticks_in(options.fault_time, controller.config().dt)),
        states_(static_cast<std::size_t>(bus.joint_count())),
        commands_(states_.size()) {}

  void run_paced() {
    guards_.install(options_.bus_calls);
    if (!switch_on()) return;
    grid_.begin();
    if (report_.bus != BusStatus::kDown)
      report_.bus = bus_.exchange(commands_, states_, grid_.deadline());
    while (report_.bus != BusStatus::kDown && paced_tick() == Next::kContinue) {
    }
    disable();
    report_.guards = guards_.report();
  }

  void run_free() {
    if (!switch_on()) return;
    // The first states are asked for with commands that ask nothing of the drives.
    if (report_.bus != BusStatus::kDown) report_.bus = bus_.exchange(commands_, states_, 0);
    while (report_.bus != BusStatus::kDown && tick() == Next::kContinue) {
      report_.bus = bus_.exchange(commands_, states_, 0);
      if (options_.log != nullptr && options_.log->wants_flush()) options_.log->flush();
      if (options_.inputs != nullptr && options_.inputs->wants_flush()) options_.inputs->flush();
    }
    disable();
  }

 private:
  enum class Next : std::uint8_t { kContinue, kStop };

  [[nodiscard]] bool stop_asked() const noexcept {
    return options_.stop != nullptr && options_.stop->load(std::memory_order_relaxed);
  }

  /// The drives stay off until the operator has armed. False: the run is to end.
  bool wait_for_operator() noexcept {
    std::int64_t next = now_ns();
    while (!seat_.armed()) {
      report_.stopped = stop_asked();
      if (report_.stopped) return false;
      next += kLookForOperator;
      sleep_until(next);
      count_look(next);
    }
    return true;
  }

  /// Nothing waits for a look, but a thread that is late for one would be late for a tick, and
  /// those who watch are to know before there is torque.
  void count_look(std::int64_t& due) noexcept {
    const std::int64_t now = now_ns();
    if (now >= due + kLookForOperator) {
      late_looks_ += options_.realtime ? 1 : 0;
      due = now;
    }
    if (options_.pulse == nullptr) return;
    options_.pulse->overruns.store(report_.overruns + late_looks_, std::memory_order_relaxed);
    options_.pulse->beats.fetch_add(1, std::memory_order_relaxed);
  }

  /// Waits for the operator and enables the drives, again after an e-stop meanwhile. False: the run
  /// is to end before it began.
  bool switch_on() {
    bus_.set_give_up([this] { return stop_asked() || seat_.stopped_while_enabling(); });
    do {
      if (!wait_for_operator()) return false;
      start_ = now_ns();
      switching(true);
      if (options_.before_enable) options_.before_enable();
      report_.bus = bus_.enable();
      switching(false);
    } while (report_.bus == BusStatus::kDown && seat_.stopped());
    report_.stopped = stop_asked();
    seat_.begin();
    return true;
  }

  void disable() noexcept {
    switching(true);
    bus_.disable();
    report_.wall_time = static_cast<double>(now_ns() - start_) / static_cast<double>(kNanoseconds);
  }

  Next paced_tick() noexcept {
    const std::int64_t start = grid_.wait(report_);
    guards_.enter();
    const Next next = tick();
    std::int64_t now = now_ns();
    report_.timing.tick.add(now - start);
    loop_.wakeup_ns = grid_.wakeup();
    loop_.tick_ns = now - start;
    if (next == Next::kContinue) {
      report_.bus = bus_.exchange(commands_, states_, grid_.deadline());
      const std::int64_t sent = now;
      now = now_ns();
      report_.timing.exchange.add(now - sent);
      loop_.exchange_ns = now - sent;
      grid_.finish_tick(now, report_);
    }
    if (guard_exchange_) guards_.leave();
    return next;
  }

  Next tick() noexcept {
    seat_.before_tick();
    controller_.set_bus_health(
        {.skipped_ticks = static_cast<std::uint32_t>(report_.skipped - skipped_)});
    skipped_ = report_.skipped;
    if (options_.inputs != nullptr) options_.inputs->before(controller_, states_);
    report_.status = controller_.tick(states_, commands_, frame_);
    if (options_.inputs != nullptr) options_.inputs->after(commands_);
    tell_operator();
    beat();
    if (!guard_exchange_) guards_.leave();
    if (options_.observe) options_.observe(frame_);
    hand_over();
    prepare_failure();
    ++report_.ticks;
    report_.stopped = stop_asked();
    return report_.stopped || report_.status == TickStatus::kFinished || given_up()
               ? Next::kStop
               : Next::kContinue;
  }

  void tell_operator() noexcept {
    if (!seat_.attended()) return;
    OperatorStatus& status = seat_.status();
    status.overruns = report_.overruns;
    status.skipped = report_.skipped;
    status.worst_wakeup = 1e-9 * static_cast<double>(report_.timing.wakeup.max());
    status.missing_replies = bus_.counters().missing_replies;
    seat_.after_tick(frame_);
  }

  void switching(bool on) noexcept {
    if (options_.pulse == nullptr) return;
    options_.pulse->switching = on;
    options_.pulse->torque = false;
  }

  void beat() noexcept {
    if (options_.pulse == nullptr) return;
    RunPulse& pulse = *options_.pulse;
    constexpr auto relaxed = std::memory_order_relaxed;
    const SupervisorState now = controller_.supervision();
    const auto stale = std::count_if(states_.begin(), states_.end(),
                                     [](const JointState& state) { return state.age > kStaleAge; });
    pulse.torque.store(has_torque(now.mode), relaxed);
    pulse.fault.store(now.fault != FaultCode::kNone, relaxed);
    pulse.stale_joints.store(static_cast<std::uint32_t>(stale), relaxed);
    pulse.overruns.store(report_.overruns + late_looks_, relaxed);
    pulse.beats.fetch_add(1, relaxed);
  }

  /// A fault ends a run that nobody attends, some time after the robot has sunk.
  bool given_up() noexcept {
    const bool sinks = controller_.supervision().mode == Mode::kLowering;
    faulted_ += report_.status == TickStatus::kFault && !sinks ? 1 : 0;
    return !seat_.attended() && faulted_ > fault_ticks_;
  }

  /// Tells the drives, so that they know before the first command of a phase goes out.
  void prepare_failure() noexcept {
    const FailurePolicy policy = controller_.lost_host_policy(bus_.failure_policy_delay());
    if (told_ == policy) return;
    static_cast<void>(bus_.set_failure_policy(policy));
    told_ = policy;
  }

  void hand_over() noexcept {
    // While it waits for the operator nothing moves, and the log's room is for what does.
    const bool idle = report_.status == TickStatus::kIdle;
    if (options_.log != nullptr && !idle) options_.log->push(frame_);
    if (options_.telemetry == nullptr) return;
    const BusCounters bus = bus_.counters();
    loop_.overruns = report_.overruns;
    loop_.skipped = report_.skipped;
    loop_.exchanges = bus.exchanges;
    loop_.missing_replies = bus.missing_replies;
    loop_.late_exchanges = bus.late;
    loop_.bus_status = static_cast<std::uint64_t>(report_.bus);
    // A frame that finds no room is counted by the port; the tick carries on.
    (void)options_.telemetry->push(frame_, loop_);
    for (const TelemetryEvent& event : events_.after_tick(frame_))
      (void)options_.telemetry->push(event);
  }

  Controller& controller_;
  MotorBus& bus_;
  const ExecutorOptions& options_;
  ExecutorReport& report_;
  OperatorSeat seat_;
  RunEvents events_;
  Grid grid_;
  TickGuards guards_;
  bool guard_exchange_;
  std::uint64_t fault_ticks_;
  std::uint64_t faulted_ = 0;
  std::uint64_t skipped_ = 0;  ///< grid points, up to the last tick
  std::uint64_t late_looks_ = 0;
  std::vector<JointState> states_;
  std::vector<JointCommand> commands_;
  TelemetryFrame frame_;
  LoopRecord loop_;
  std::optional<FailurePolicy> told_;
  std::int64_t start_ = 0;
};

}  // namespace

std::size_t log_capacity(const Controller& controller, bool realtime) {
  if (!realtime) return 4096;
  const double dt = controller.config().dt;
  // Beyond the expected ticks: a longer move to the start, waiting for a joint, a fault held.
  return controller.expected_ticks() + static_cast<std::size_t>(std::ceil(10.0 / dt));
}

ExecutorReport execute(Controller& controller, MotorBus& bus, const ExecutorOptions& options) {
  ExecutorReport report;
  Loop loop(controller, bus, options, report);
  if (options.realtime)
    run_in_control_thread(options.runtime, [&](std::vector<std::string> refused) {
      report.refused = std::move(refused);
      loop.run_paced();
    });
  else
    loop.run_free();
  if (options.pulse != nullptr) options.pulse->over = true;
  report.duration = static_cast<double>(report.ticks) * controller.config().dt;
  report.fault = controller.fault();
  report.fault_joint = controller.fault_joint();
  if (options.log != nullptr) {
    options.log->close();
    report.log_dropped = options.log->dropped();
  }
  if (options.inputs != nullptr) {
    options.inputs->close();
    report.log_dropped += options.inputs->dropped();
  }
  return report;
}

}  // namespace clamber
