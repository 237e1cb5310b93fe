#include "telemetry/monitor.hpp"

#include <chrono>
#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/core/status/SubscriptionMatchedStatus.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <iomanip>
#include <ostream>
#include <utility>

#include "clamber_telemetryPubSubTypes.h"
#include "telemetry/check.hpp"
#include "telemetry/dds_participant.hpp"
#include "telemetry/topics.hpp"
#include "telemetry/torque_display.hpp"
#include "telemetry/torque_watch.hpp"
#include "telemetry/wire.hpp"

namespace clamber {
namespace {

namespace dds = eprosima::fastdds::dds;
using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

// A second of batches: what a reader must hold when this process is not scheduled for that long.
constexpr int kFramesDepth = 128;
constexpr std::size_t kEventsKept = 16;
constexpr Seconds kPlainPeriod{1.0};
constexpr Seconds kDashboardPeriod{0.1};

template <typename Sample, typename Use>
void take_all(dds::DataReader& reader, Sample& sample, Use use) {
  dds::SampleInfo info;
  while (reader.take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK) {
    if (info.valid_data) use(sample);
  }
}

class Subscription {
 public:
  explicit Subscription(const TelemetryConfig& config)
      : participant_(config, "clamber_monitor"),
        frames_(create<msg::dds_::Batch_PubSubType>(config, "frames",
                                                    topics::read_measured(kFramesDepth))),
        timing_(create<msg::dds_::Timing_PubSubType>(config, "timing", topics::read_measured(1))),
        bus_(create<msg::dds_::BusHealth_PubSubType>(config, "bus", topics::read_measured(1))),
        events_(create<msg::dds_::Event_PubSubType>(config, "events",
                                                    topics::read_kept(topics::kEventsDepth))),
        description_(create<msg::dds_::Description_PubSubType>(config, "description",
                                                               topics::read_kept(1))) {}

  /// Waits up to 50 ms for samples and hands them out.
  void receive(TorqueWatch& watch, MonitorView& view, std::vector<Check>& checks) {
    dds::ConditionSeq active;
    wait_set_.wait(active, eprosima::fastrtps::Duration_t(0, 50'000'000));
    take_all(description_, description_sample_, [&](const msg::dds_::Description_& sample) {
      watch.describe(from_wire(sample));
      for (Check& check : checks) check.describe(watch.description().joint_names);
    });
    take_all(events_, event_sample_, [&](const msg::dds_::Event_& sample) {
      view.events.push_back(from_wire(sample));
      ++new_events_;
      if (view.events.size() > kEventsKept) view.events.pop_front();
    });
    take_loop(view);
    take_all(frames_, batch_, [&](const msg::dds_::Batch_& batch) {
      view.ring_drops = batch.ring_drops();
      const auto count = std::min<std::size_t>(batch.count(), batch.frames().size());
      for (std::size_t i = 0; i < count; ++i) take_frame(batch.frames()[i], watch, view, checks);
    });
  }

  /// Events since the last call, at most those that the view still holds.
  [[nodiscard]] std::size_t new_events() noexcept { return std::exchange(new_events_, 0); }
  /// A writer of frames was there and is there no longer.
  [[nodiscard]] bool publisher_gone() {
    dds::SubscriptionMatchedStatus status;
    frames_.get_subscription_matched_status(status);
    return status.total_count > 0 && status.current_count == 0;
  }

 private:
  template <typename Type>
  dds::DataReader& create(const TelemetryConfig& config, const char* name,
                          const dds::DataReaderQos& qos) {
    dds::DataReader& reader = participant_.create_reader(topics::own(config.robot, name),
                                                         dds::TypeSupport(new Type()), qos);
    reader.get_statuscondition().set_enabled_statuses(dds::StatusMask::data_available());
    wait_set_.attach_condition(reader.get_statuscondition());
    return reader;
  }

  void take_loop(MonitorView& view) {
    take_all(timing_, timing_sample_, [&](const msg::dds_::Timing_& t) {
      LoopFigures& loop = view.loop ? *view.loop : view.loop.emplace();
      loop.paced = t.paced() != 0;
      loop.wakeup_p99 = static_cast<double>(t.wakeup().p99());
      loop.wakeup_max = static_cast<double>(t.wakeup().max_run());
      loop.tick_p99 = static_cast<double>(t.computing().p99());
      loop.tick_max = static_cast<double>(t.computing().max_run());
      loop.overruns = t.overruns();
      loop.skipped = t.skipped();
      loop.gaps = t.gaps();
      loop.refused = t.refused();
      loop.restarts = t.restarts();
      loop.hangs = t.hangs();
      loop.event_drops = t.event_drops();
    });
    take_all(bus_, bus_sample_, [&](const msg::dds_::BusHealth_& bus) {
      if (!view.loop) return;
      view.loop->missing_replies = bus.missing_replies();
      view.loop->bus_down = bus.status() == 2;
    });
  }

  void take_frame(const msg::dds_::Frame_& wire, TorqueWatch& watch, const MonitorView& view,
                  std::vector<Check>& checks) {
    watch.add(from_wire(wire));
    const CheckSample sample{.frame = watch.last(),
                             .lateness = static_cast<double>(wire.wakeup_us()),
                             .tick_time = static_cast<double>(wire.tick_us()),
                             .lost = static_cast<double>(watch.lost()),
                             .drops = static_cast<double>(view.ring_drops)};
    for (Check& check : checks) check.add(sample);
  }

  DdsParticipant participant_;
  dds::WaitSet wait_set_;
  dds::DataReader& frames_;
  dds::DataReader& timing_;
  dds::DataReader& bus_;
  dds::DataReader& events_;
  dds::DataReader& description_;
  msg::dds_::Batch_ batch_;
  msg::dds_::Timing_ timing_sample_;
  msg::dds_::BusHealth_ bus_sample_;
  msg::dds_::Event_ event_sample_;
  msg::dds_::Description_ description_sample_;
  std::size_t new_events_ = 0;
};

void print_summary(const TorqueWatch& watch, std::ostream& out) {
  out << "received " << watch.received() << " frames, lost " << watch.lost();
  if (watch.joints() > 0) {
    const JointTorque& worst = watch.worst_of_run();
    out << std::fixed << std::setprecision(2) << "; least margin: " << worst.name << ' '
        << worst.peak << " N m";
    if (worst.limit) out << " of " << *worst.limit;
    if (worst.saturated > 0.0) out << ", " << worst.saturated << " s at the limit";
  }
  out << '\n';
}

/// @return all passed
bool print_checks(const std::vector<Check>& checks, std::ostream& out) {
  bool all = true;
  out << std::defaultfloat << std::setprecision(6);
  for (const Check& check : checks) {
    const CheckResult result = check.result();
    all = all && result.passed;
    out << "check " << (result.passed ? "passed: " : "FAILED: ") << check.text();
    if (result.samples == 0)
      out << ": no frame came";
    else
      out << ": " << result.value << (result.joint.empty() ? "" : " at " + result.joint) << " in "
          << result.samples << " frames";
    out << '\n';
  }
  return all;
}

void print_new_events(const MonitorView& view, std::size_t count, std::ostream& out) {
  const std::size_t shown = std::min(count, view.events.size());
  for (std::size_t i = view.events.size() - shown; i < view.events.size(); ++i)
    out << "event " << event_text(view.events[i], view.torques.description()) << '\n';
}

}  // namespace

MonitorOutcome run_monitor(const MonitorOptions& options, std::ostream& out) {
  check(options.telemetry, {});
  std::vector<Check> checks;
  for (const std::string& text : options.checks) checks.emplace_back(text);
  const bool ends = options.end_of_run || !checks.empty();
  Subscription subscription(options.telemetry);
  TorqueWatch watch;
  MonitorView view{.torques = watch, .ring_drops = 0, .loop = {}, .events = {}};

  const auto start = Clock::now();
  while (watch.received() == 0) {
    subscription.receive(watch, view, checks);
    if (Clock::now() - start > Seconds(options.timeout)) {
      out << "no telemetry from " << options.telemetry.robot << " in domain "
          << options.telemetry.domain << " within " << options.timeout << " s\n"
          << std::flush;
      return MonitorOutcome::kNothingCame;
    }
  }

  const Seconds period = options.plain ? kPlainPeriod : kDashboardPeriod;
  const auto first = Clock::now();
  auto next = first + std::chrono::duration_cast<Clock::duration>(period);
  const auto over = [&] {
    return options.duration && Clock::now() - first >= Seconds(*options.duration);
  };
  for (bool last = false; !last;) {
    subscription.receive(watch, view, checks);
    const bool gone = ends && subscription.publisher_gone();
    if (gone) subscription.receive(watch, view, checks);  // what came since
    last = gone || over();
    if (Clock::now() < next && !last) continue;
    next += std::chrono::duration_cast<Clock::duration>(period);
    if (options.plain) {
      print_new_events(view, subscription.new_events(), out);
      out << plain_line(view) << '\n' << std::flush;
    } else {
      out << dashboard(view, options.rows) << std::flush;
    }
    watch.start_window();
  }
  print_summary(watch, out);
  const bool passed = print_checks(checks, out);
  out << std::flush;
  return passed ? MonitorOutcome::kFine : MonitorOutcome::kCheckFailed;
}

}  // namespace clamber
