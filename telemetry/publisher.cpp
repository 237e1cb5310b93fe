#include "telemetry/publisher.hpp"

#include <sched.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <fastdds/dds/core/status/PublicationMatchedStatus.hpp>
#include <stdexcept>
#include <thread>

#include "clamber_telemetryPubSubTypes.h"
#include "ros2_messagesPubSubTypes.h"
#include "telemetry/dds_participant.hpp"
#include "telemetry/diagnostics.hpp"
#include "telemetry/event_names.hpp"
#include "telemetry/summaries.hpp"
#include "telemetry/topics.hpp"
#include "telemetry/transforms.hpp"
#include "telemetry/wire.hpp"

namespace clamber {
namespace {

namespace dds = eprosima::fastdds::dds;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using eprosima::fastrtps::Duration_t;

constexpr auto kDrainPeriod = 10ms;
// A backlog leaves in bursts that fit a subscriber's default socket buffer (208 KiB).
constexpr int kBatchesPerBurst = 8;
constexpr auto kBetweenBursts = 1ms;
constexpr auto kBetweenDiagnostics = 1s;
constexpr auto kAcknowledgeTime = 1s;

// Every so many ticks.
constexpr std::uint64_t kJointStates = 10;
constexpr std::uint64_t kPoses = 20;
constexpr std::uint64_t kTorques = 50;
constexpr std::uint64_t kLoop = 100;

std::int64_t wall_clock() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
}

}  // namespace

void refuse_real_time_thread() {
  const int policy = sched_getscheduler(0);
  if (policy == SCHED_FIFO || policy == SCHED_RR)
    throw std::logic_error(
        "telemetry: the publisher must be created before its thread becomes real-time");
}

PublisherCounters counters_of(const TelemetryBlock& block) noexcept {
  const PublisherState& state = block.publisher;
  return {.frames = state.frames,
          .batches = state.batches,
          .joint_states = state.joint_states,
          .events = state.events,
          .refused = state.refused,
          .ring_drops = block.record_positions.dropped,
          .event_drops = block.event_positions.dropped,
          .gaps = state.gaps,
          .restarts = state.restarts,
          .hangs = state.hangs,
          .rounds = state.rounds + state.watches};
}

class Publisher::Impl {
 public:
  Impl(const TelemetryConfig& config, const TelemetryDescription& description,
       TelemetryBlock& block)
      : block_(block),
        state_(block.publisher),
        records_(block.records, block.record_positions),
        events_(block.events, block.event_positions),
        robot_(config.robot),
        description_(description),
        participant_(config, "clamber_" + config.robot),
        torque_summary_(description.dt),
        transforms_(description) {
    create_writers();
    described_ = to_wire(robot_, description_);
    joint_state_.name() = description_.joint_names;
    write(*description_writer_, &described_);
    send_model();
    send_kept_events();
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }

  void stop() {
    if (!thread_.joinable()) return;
    thread_.request_stop();
    thread_.join();
    // Nobody acknowledges a frame, but a participant reads all its topics from one socket: whoever
    // acknowledges what was sent after the last frame has that frame. Without it, word that the
    // publisher has gone can overtake the end of the run.
    write(*description_writer_, &described_);
    const auto until = Clock::now() + kAcknowledgeTime;
    for (dds::DataWriter* writer : {joint_states_, events_writer_, description_writer_}) {
      const auto left = std::max<Clock::duration>(until - Clock::now(), Clock::duration::zero());
      writer->wait_for_acknowledgments(
          Duration_t(std::chrono::duration<long double>(left).count()));
    }
  }

  int frame_readers() const {
    dds::PublicationMatchedStatus status;
    frames_->get_publication_matched_status(status);
    return status.current_count;
  }

 private:
  template <typename Type>
  dds::DataWriter* writer(const std::string& topic, const dds::DataWriterQos& qos) {
    return &participant_.create_writer(topic, dds::TypeSupport(new Type()), qos);
  }

  void create_writers() {
    const auto own = [this](const char* name) { return topics::own(robot_, name); };
    using namespace msg::dds_;
    frames_ = writer<Batch_PubSubType>(own("frames"), topics::measured(topics::kFramesDepth));
    torques_ = writer<TorqueMargins_PubSubType>(own("torque_margins"), topics::measured(1));
    timing_ = writer<Timing_PubSubType>(own("timing"), topics::measured(1));
    bus_ = writer<BusHealth_PubSubType>(own("bus"), topics::measured(1));
    contacts_ = writer<Contacts_PubSubType>(own("contacts"), topics::measured(1));
    events_writer_ = writer<Event_PubSubType>(own("events"), topics::kept(topics::kEventsDepth));
    description_writer_ = writer<Description_PubSubType>(own("description"), topics::kept(1));

    joint_states_ = writer<sensor_msgs::msg::dds_::JointState_PubSubType>(
        "rt/joint_states", topics::for_ros2(topics::kJointStateHash));
    diagnostics_ = writer<diagnostic_msgs::msg::dds_::DiagnosticArray_PubSubType>(
        "rt/diagnostics", topics::for_ros2(topics::kDiagnosticsHash));
    using Transforms_PubSubType = tf2_msgs::msg::dds_::TFMessage_PubSubType;
    if (!transforms_.empty()) {
      tf_ = writer<Transforms_PubSubType>("rt/tf", topics::for_ros2(topics::kTransformsHash));
      tf_static_ =
          writer<Transforms_PubSubType>("rt/tf_static", topics::kept(1, topics::kTransformsHash));
    }
    if (!description_.urdf.empty())
      robot_description_ = writer<std_msgs::msg::dds_::String_PubSubType>(
          "rt/robot_description", topics::kept(1, topics::kStringHash));
  }

  void send_model() {
    if (tf_static_ != nullptr) {
      auto fixed = transforms_.fixed(wall_clock());
      write(*tf_static_, &fixed);
    }
    if (robot_description_ != nullptr) {
      std_msgs::msg::dds_::String_ urdf;
      urdf.data(description_.urdf);
      write(*robot_description_, &urdf);
    }
  }

  /// What a publisher before this one had sent, for those who join late.
  void send_kept_events() {
    const std::uint64_t count = state_.events;
    const std::uint64_t first = count - std::min<std::uint64_t>(count, state_.kept.size());
    for (std::uint64_t i = first; i < count; ++i) send(state_.kept[i % state_.kept.size()]);
  }

  void run(const std::stop_token& stop) {
    auto next_diagnostics = Clock::now();
    while (!stop.stop_requested()) {
      drain();
      ++state_.rounds;
      if (Clock::now() >= next_diagnostics) {
        diagnose_now();
        next_diagnostics += kBetweenDiagnostics;
      }
      std::this_thread::sleep_for(kDrainPeriod);
    }
    drain();
  }

  void drain() {
    tell_of_losses();
    TelemetryEvent event;
    while (events_.pop(std::span(&event, 1)) == 1) publish(event);
    for (int batches = 0;; ++batches) {
      const std::size_t count = records_.pop(popped_);
      if (count == 0) return;
      if (batches > 0 && batches % kBatchesPerBurst == 0)
        std::this_thread::sleep_for(kBetweenBursts);
      publish(std::span(popped_).first(count));
      ++state_.rounds;  // a backlog may take longer than a publisher that hangs is given
    }
  }

  void publish(std::span<const TelemetryRecord> records) {
    batch_.number(state_.batches);
    batch_.count(static_cast<std::uint32_t>(records.size()));
    batch_.ring_drops(static_cast<std::uint32_t>(block_.record_positions.dropped.load()));
    for (std::size_t i = 0; i < records.size(); ++i)
      to_wire(records[i], description_.contacts_of(records[i].frame.phase), batch_.frames()[i]);
    const bool taken = write(*frames_, &batch_);
    count(records, taken);
    for (const TelemetryRecord& record : records) publish_beside(record);
  }

  /// Of frames that have left the ring: what was published, what is missing.
  void count(std::span<const TelemetryRecord> records, bool taken) {
    const std::uint64_t next = records.back().frame.sequence + 1;
    const std::uint64_t published = taken ? records.size() : 0;
    const std::uint64_t expected =
        std::max<std::uint64_t>(next - std::min<std::uint64_t>(next, state_.next_tick), published);
    state_.next_tick = next;
    state_.frames += published;
    state_.batches += taken ? 1 : 0;
    state_.gaps += expected - published;
  }

  /// What is sent of every so manieth frame.
  void publish_beside(const TelemetryRecord& record) {
    const TelemetryFrame& frame = record.frame;
    torque_summary_.add(frame);
    timing_summary_.add(record);
    bus_summary_.add(record);
    last_frame_ = frame;

    const auto due = [&frame](std::uint64_t ticks) { return frame.sequence % ticks == 0; };
    if (due(kJointStates)) {
      to_joint_state(frame, stamp(frame.time), joint_state_);
      if (write(*joint_states_, &joint_state_)) ++state_.joint_states;
    }
    if (due(kPoses)) publish_poses(frame);
    if (due(kTorques)) {
      torque_summary_.take(torque_sample_);
      write_numbered(*torques_, torque_sample_, 0);
    }
    if (due(kLoop)) publish_loop();
  }

  void publish_poses(const TelemetryFrame& frame) {
    if (tf_ != nullptr) {
      auto moving = transforms_.moving(frame, stamp(frame.time));
      write(*tf_, &moving);
    }
    if ((frame.flags & kFrameHasTruth) == 0) return;
    to_contacts(frame, description_.contacts_of(frame.phase), contact_sample_);
    write_numbered(*contacts_, contact_sample_, 1);
  }

  void publish_loop() {
    const PublisherCounters counters = counters_of(block_);
    timing_summary_.take(timing_sample_);
    timing_sample_.frames(counters.frames);
    timing_sample_.ring_drops(counters.ring_drops);
    timing_sample_.event_drops(counters.event_drops);
    timing_sample_.gaps(counters.gaps);
    timing_sample_.refused(counters.refused);
    timing_sample_.restarts(counters.restarts);
    timing_sample_.hangs(counters.hangs);
    write_numbered(*timing_, timing_sample_, 2);
    bus_summary_.take(bus_sample_);
    write_numbered(*bus_, bus_sample_, 3);
  }

  void diagnose_now() {
    auto array = diagnose(robot_,
                          {.description = description_,
                           .frame = last_frame_,
                           .timing = timing_sample_,
                           .bus = bus_sample_,
                           .torques = torque_sample_},
                          wall_clock());
    write(*diagnostics_, &array);
  }

  void publish(TelemetryEvent event) {
    event.sequence = state_.events;
    name_phase(event, description_);
    state_.kept[event.sequence % state_.kept.size()] = event;
    ++state_.events;
    send(event);
  }

  void send(const TelemetryEvent& event) {
    auto wire = to_wire(event, stamp(event.time));
    write(*events_writer_, &wire);
  }

  /// What befalls telemetry itself is an event too.
  void tell_of_losses() {
    const std::uint64_t restarts = state_.restarts;
    if (restarts > state_.announced) {
      state_.announced = restarts;
      tell("the publisher died and was started again: " + std::to_string(restarts) +
           " times so far, " + std::to_string(state_.hangs) + " hung");
    }
    const std::uint64_t dropped = block_.record_positions.dropped;
    if (dropped > dropped_told_ && Clock::now() >= next_told_) {
      dropped_told_ = dropped;
      next_told_ = Clock::now() + 1s;
      tell("the ring was full: " + std::to_string(dropped) + " frames dropped so far");
    }
  }

  void tell(const std::string& text) {
    TelemetryEvent event;
    // A publisher that has just begun has seen no frame yet, but the one before it had.
    event.tick = state_.next_tick;
    event.time = description_.dt * static_cast<double>(event.tick);
    event.phase = last_frame_.phase;
    event.kind = EventKind::kTelemetry;
    event.severity = Severity::kWarning;
    event.append(text);
    publish(event);
  }

  /// Frames carry no wall clock, ROS 2's tools expect one: the first that is sent gets the present.
  std::int64_t stamp(double time) {
    const auto since_start = static_cast<std::int64_t>(std::llround(time * 1e9));
    if (state_.start_stamp == 0) state_.start_stamp = wall_clock() - since_start;
    return state_.start_stamp + since_start;
  }

  bool write(dds::DataWriter& writer, void* sample) {
    const bool taken = writer.write(sample);
    if (!taken) ++state_.refused;
    return taken;
  }
  template <typename Sample>
  void write_numbered(dds::DataWriter& writer, Sample& sample, std::size_t topic) {
    sample.number(state_.numbers[topic]);
    if (write(writer, &sample)) ++state_.numbers[topic];
  }

  TelemetryBlock& block_;
  PublisherState& state_;
  RingConsumer<TelemetryRecord> records_;
  RingConsumer<TelemetryEvent> events_;
  std::string robot_;
  TelemetryDescription description_;
  DdsParticipant participant_;

  dds::DataWriter* frames_ = nullptr;
  dds::DataWriter* torques_ = nullptr;
  dds::DataWriter* timing_ = nullptr;
  dds::DataWriter* bus_ = nullptr;
  dds::DataWriter* contacts_ = nullptr;
  dds::DataWriter* events_writer_ = nullptr;
  dds::DataWriter* description_writer_ = nullptr;
  dds::DataWriter* joint_states_ = nullptr;
  dds::DataWriter* diagnostics_ = nullptr;
  // Only where there is something to say.
  dds::DataWriter* tf_ = nullptr;
  dds::DataWriter* tf_static_ = nullptr;
  dds::DataWriter* robot_description_ = nullptr;
  msg::dds_::Description_ described_;

  // Used by the publishing thread only.
  std::array<TelemetryRecord, kMaxBatch> popped_;
  TelemetryFrame last_frame_;
  TorqueSummary torque_summary_;
  TimingSummary timing_summary_;
  BusSummary bus_summary_;
  Transforms transforms_;
  msg::dds_::Batch_ batch_;
  msg::dds_::TorqueMargins_ torque_sample_;
  msg::dds_::Timing_ timing_sample_;
  msg::dds_::BusHealth_ bus_sample_;
  msg::dds_::Contacts_ contact_sample_;
  sensor_msgs::msg::dds_::JointState_ joint_state_;
  std::uint64_t dropped_told_ = 0;
  Clock::time_point next_told_;

  std::jthread thread_;  // last: it must be gone before what it uses
};

Publisher::Publisher(const TelemetryConfig& config, const TelemetryDescription& description,
                     TelemetryBlock& block) {
  check(config, description);
  refuse_real_time_thread();
  impl_ = std::make_unique<Impl>(config, description, block);
}

Publisher::~Publisher() { stop(); }

void Publisher::stop() { impl_->stop(); }

int Publisher::frame_readers() const { return impl_->frame_readers(); }

}  // namespace clamber
