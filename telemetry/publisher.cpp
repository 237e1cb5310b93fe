#include "telemetry/publisher.hpp"

#include <sched.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <fastdds/dds/core/status/PublicationMatchedStatus.hpp>
#include <optional>
#include <stdexcept>
#include <thread>

#include "clamber_telemetryPubSubTypes.h"
#include "ros2_joint_statePubSubTypes.h"
#include "telemetry/dds_participant.hpp"
#include "telemetry/wire.hpp"

namespace clamber {
namespace {

namespace dds = eprosima::fastdds::dds;
using namespace std::chrono_literals;
using eprosima::fastrtps::Duration_t;

constexpr auto kDrainPeriod = 10ms;
constexpr int kFramesDepth = 8;
// A backlog leaves in bursts that fit a subscriber's default socket buffer (208 KiB).
constexpr int kBatchesPerBurst = 8;
constexpr auto kBetweenBursts = 1ms;
constexpr std::uint64_t kTicksPerJointState = 10;
constexpr std::int32_t kAcknowledgeSeconds = 1;

// REP 2016's hash of sensor_msgs/msg/JointState; ROS 2 reads it from a writer's user data.
constexpr const char* kJointStateHash =
    "typehash=RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e;";

dds::DataWriterQos writer_qos(dds::ReliabilityQosPolicyKind reliability,
                              dds::DurabilityQosPolicyKind durability, int depth) {
  dds::DataWriterQos qos;
  qos.reliability().kind = reliability;
  qos.durability().kind = durability;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = depth;
  qos.resource_limits().max_samples = depth;
  qos.resource_limits().max_samples_per_instance = depth;
  qos.resource_limits().max_instances = 1;
  qos.resource_limits().allocated_samples = depth;
  return qos;
}

dds::DataWriterQos frames_qos() {
  dds::DataWriterQos qos =
      writer_qos(dds::BEST_EFFORT_RELIABILITY_QOS, dds::VOLATILE_DURABILITY_QOS, kFramesDepth);
  qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_MEMORY_MODE;
  return qos;
}

// Reliable although 100 Hz would not need it: reliable readers refuse a best-effort writer.
dds::DataWriterQos joint_states_qos() {
  dds::DataWriterQos qos =
      writer_qos(dds::RELIABLE_RELIABILITY_QOS, dds::VOLATILE_DURABILITY_QOS, 1);
  const std::string hash = kJointStateHash;
  qos.user_data().data_vec(std::vector<eprosima::fastrtps::rtps::octet>(hash.begin(), hash.end()));
  return qos;
}

dds::DataWriterQos description_qos() {
  return writer_qos(dds::RELIABLE_RELIABILITY_QOS, dds::TRANSIENT_LOCAL_DURABILITY_QOS, 1);
}

void refuse_real_time_thread() {
  const int policy = sched_getscheduler(0);
  if (policy == SCHED_FIFO || policy == SCHED_RR) {
    throw std::logic_error(
        "telemetry: the publisher must be created before its thread becomes real-time");
  }
}

}  // namespace

class Publisher::Impl {
 public:
  Impl(const TelemetryConfig& config, const TelemetryDescription& description, FrameRing& ring)
      : ring_(ring), participant_(config, "clamber_" + config.robot) {
    const std::string prefix = "rt/" + config.robot + "/telemetry/";
    frames_ = &participant_.create_writer(
        prefix + "frames", dds::TypeSupport(new msg::dds_::Batch_PubSubType()), frames_qos());
    joint_states_ = &participant_.create_writer(
        "rt/joint_states", dds::TypeSupport(new sensor_msgs::msg::dds_::JointState_PubSubType()),
        joint_states_qos());
    description_writer_ = &participant_.create_writer(
        prefix + "description", dds::TypeSupport(new msg::dds_::Description_PubSubType()),
        description_qos());
    described_ = to_wire(config.robot, description);
    write(*description_writer_, &described_);
    joint_state_.name() = description.joint_names;
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
    const Duration_t bound(kAcknowledgeSeconds, 0);
    joint_states_->wait_for_acknowledgments(bound);
    description_writer_->wait_for_acknowledgments(bound);
  }

  PublisherCounters counters() const noexcept {
    constexpr auto relaxed = std::memory_order_relaxed;
    return {.frames = frame_count_.load(relaxed),
            .batches = batch_count_.load(relaxed),
            .joint_states = joint_state_count_.load(relaxed),
            .refused = refused_count_.load(relaxed),
            .ring_drops = ring_.dropped(),
            .rounds = round_count_.load(relaxed)};
  }

  int frame_readers() const {
    dds::PublicationMatchedStatus status;
    frames_->get_publication_matched_status(status);
    return status.current_count;
  }

 private:
  void run(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      drain();
      ++round_count_;
      std::this_thread::sleep_for(kDrainPeriod);
    }
    drain();
  }

  void drain() {
    for (int batches = 0;; ++batches) {
      const std::size_t count = ring_.pop(popped_);
      if (count == 0) return;
      if (batches > 0 && batches % kBatchesPerBurst == 0) {
        std::this_thread::sleep_for(kBetweenBursts);
      }
      publish(std::span(popped_).first(count));
    }
  }

  void publish(std::span<const TelemetryFrame> frames) {
    batch_.count(static_cast<std::uint32_t>(frames.size()));
    batch_.ring_drops(static_cast<std::uint32_t>(ring_.dropped()));
    for (std::size_t i = 0; i < frames.size(); ++i) to_wire(frames[i], batch_.frames()[i]);
    if (write(*frames_, &batch_)) {
      frame_count_ += frames.size();
      ++batch_count_;
    }
    for (const TelemetryFrame& frame : frames) {
      if (frame.sequence % kTicksPerJointState != 0) continue;
      to_joint_state(frame, stamp(frame), joint_state_);
      if (write(*joint_states_, &joint_state_)) ++joint_state_count_;
    }
  }

  /// Frames carry no wall clock, ROS 2's tools expect one: the first frame is given the present.
  std::int64_t stamp(const TelemetryFrame& frame) {
    const auto since_start = static_cast<std::int64_t>(std::llround(frame.time * 1e9));
    if (!start_stamp_) {
      const auto now = std::chrono::system_clock::now().time_since_epoch();
      start_stamp_ =
          std::chrono::duration_cast<std::chrono::nanoseconds>(now).count() - since_start;
    }
    return *start_stamp_ + since_start;
  }

  bool write(dds::DataWriter& writer, void* sample) {
    const bool taken = writer.write(sample);
    if (!taken) ++refused_count_;
    return taken;
  }

  FrameRing& ring_;
  DdsParticipant participant_;
  dds::DataWriter* frames_ = nullptr;
  dds::DataWriter* joint_states_ = nullptr;
  dds::DataWriter* description_writer_ = nullptr;
  msg::dds_::Description_ described_;

  // Used by the publishing thread only.
  std::array<TelemetryFrame, kMaxBatch> popped_;
  msg::dds_::Batch_ batch_;
  sensor_msgs::msg::dds_::JointState_ joint_state_;
  std::optional<std::int64_t> start_stamp_;

  std::atomic<std::uint64_t> frame_count_{0};
  std::atomic<std::uint64_t> batch_count_{0};
  std::atomic<std::uint64_t> joint_state_count_{0};
  std::atomic<std::uint64_t> refused_count_{0};
  std::atomic<std::uint64_t> round_count_{0};

  std::jthread thread_;  // last: it must be gone before what it uses
};

Publisher::Publisher(const TelemetryConfig& config, const TelemetryDescription& description,
                     FrameRing& ring) {
  check(config, description);
  refuse_real_time_thread();
  impl_ = std::make_unique<Impl>(config, description, ring);
}

Publisher::~Publisher() { stop(); }

void Publisher::stop() { impl_->stop(); }

PublisherCounters Publisher::counters() const noexcept { return impl_->counters(); }

int Publisher::frame_readers() const { return impl_->frame_readers(); }

}  // namespace clamber
