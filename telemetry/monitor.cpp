#include "telemetry/monitor.hpp"

#include <chrono>
#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <iomanip>
#include <ostream>

#include "clamber_telemetryPubSubTypes.h"
#include "telemetry/dds_participant.hpp"
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
constexpr Seconds kPlainPeriod{1.0};
constexpr Seconds kDashboardPeriod{0.1};

dds::DataReaderQos frames_qos() {
  dds::DataReaderQos qos;
  qos.reliability().kind = dds::BEST_EFFORT_RELIABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = kFramesDepth;
  return qos;
}

dds::DataReaderQos description_qos() {
  dds::DataReaderQos qos;
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
  return qos;
}

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
        frames_(participant_.create_reader("rt/" + config.robot + "/telemetry/frames",
                                           dds::TypeSupport(new msg::dds_::Batch_PubSubType()),
                                           frames_qos())),
        description_(participant_.create_reader(
            "rt/" + config.robot + "/telemetry/description",
            dds::TypeSupport(new msg::dds_::Description_PubSubType()), description_qos())) {
    for (dds::DataReader* reader : {&frames_, &description_}) {
      reader->get_statuscondition().set_enabled_statuses(dds::StatusMask::data_available());
      wait_set_.attach_condition(reader->get_statuscondition());
    }
  }

  /// Waits up to 50 ms for samples and hands them to the watch.
  void receive(TorqueWatch& watch) {
    dds::ConditionSeq active;
    wait_set_.wait(active, eprosima::fastrtps::Duration_t(0, 50'000'000));
    take_all(description_, description_sample_,
             [&](const msg::dds_::Description_& sample) { watch.describe(from_wire(sample)); });
    take_all(frames_, batch_, [&](const msg::dds_::Batch_& batch) {
      ring_drops_ = batch.ring_drops();
      const auto count = std::min<std::size_t>(batch.count(), batch.frames().size());
      for (std::size_t i = 0; i < count; ++i) watch.add(from_wire(batch.frames()[i]));
    });
  }

  [[nodiscard]] std::uint32_t ring_drops() const noexcept { return ring_drops_; }

 private:
  DdsParticipant participant_;
  dds::DataReader& frames_;
  dds::DataReader& description_;
  dds::WaitSet wait_set_;  // after the participant: conditions are detached before readers go
  msg::dds_::Batch_ batch_;
  msg::dds_::Description_ description_sample_;
  std::uint32_t ring_drops_ = 0;
};

void print_summary(const TorqueWatch& watch, std::ostream& out) {
  out << "received " << watch.received() << " frames, lost " << watch.lost();
  if (watch.joints() > 0) {
    const JointTorque& worst = watch.worst_of_run();
    out << std::fixed << std::setprecision(2) << "; least margin: " << worst.name << ' '
        << worst.peak << " N m";
    if (worst.limit) out << " of " << *worst.limit;
  }
  out << '\n' << std::flush;
}

}  // namespace

int run_monitor(const MonitorOptions& options, std::ostream& out) {
  check(options.telemetry, {});
  Subscription subscription(options.telemetry);
  TorqueWatch watch;

  const auto start = Clock::now();
  while (watch.received() == 0) {
    subscription.receive(watch);
    if (Clock::now() - start > Seconds(options.timeout)) {
      out << "no telemetry from " << options.telemetry.robot << " in domain "
          << options.telemetry.domain << " within " << options.timeout << " s\n"
          << std::flush;
      return 1;
    }
  }

  const Seconds period = options.plain ? kPlainPeriod : kDashboardPeriod;
  const auto first = Clock::now();
  for (int shown = 1; !options.duration || Clock::now() - first < Seconds(*options.duration);) {
    subscription.receive(watch);
    if (Clock::now() - first < shown * period) continue;
    ++shown;
    if (options.plain) {
      out << plain_line(watch, subscription.ring_drops()) << '\n' << std::flush;
    } else {
      out << dashboard(watch, subscription.ring_drops(), options.rows) << std::flush;
    }
    watch.start_window();
  }
  print_summary(watch, out);
  return 0;
}

}  // namespace clamber
