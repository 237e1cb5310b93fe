#include "telemetry/frame_subscription.hpp"

#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/core/status/SubscriptionMatchedStatus.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include <algorithm>
#include <utility>

#include "clamber_telemetryPubSubTypes.h"
#include "ros2_messagesPubSubTypes.h"
#include "telemetry/dds_participant.hpp"
#include "telemetry/topics.hpp"
#include "telemetry/wire.hpp"

namespace clamber {
namespace {

namespace dds = eprosima::fastdds::dds;

// Two seconds of batches: what the reader holds while a disk or a browser keeps this thread busy.
constexpr int kHeldBatches = 256;

/// Absent until it is created.
template <typename Sample, typename SampleType>
class Topic {
 public:
  using Use = std::function<void(const Sample&)>;

  void create(DdsParticipant& participant, dds::WaitSet& wait_set, const std::string& topic,
              const dds::DataReaderQos& qos, Use use) {
    reader_ = &participant.create_reader(topic, dds::TypeSupport(new SampleType()), qos);
    reader_->get_statuscondition().set_enabled_statuses(dds::StatusMask::data_available());
    wait_set.attach_condition(reader_->get_statuscondition());
    use_ = std::move(use);
  }
  void take_all() {
    dds::SampleInfo info;
    while (reader_ != nullptr &&
           reader_->take_next_sample(&sample_, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data) use_(sample_);
  }
  [[nodiscard]] int writers() const {
    dds::SubscriptionMatchedStatus status;
    if (reader_ != nullptr) reader_->get_subscription_matched_status(status);
    return status.current_count;
  }

 private:
  dds::DataReader* reader_ = nullptr;
  Use use_;
  Sample sample_;
};

}  // namespace

class FrameSubscription::Impl {
 public:
  Impl(const TelemetryConfig& config, Handlers handlers)
      : handlers_(std::move(handlers)), participant_(config, "clamber_subscription") {
    const auto own = [&config](const char* name) { return topics::own(config.robot, name); };
    using namespace msg::dds_;
    frames_.create(participant_, wait_set_, own("frames"), topics::read_measured(kHeldBatches),
                   [this](const Batch_& batch) { take(batch); });
    if (handlers_.description)
      description_.create(
          participant_, wait_set_, own("description"), topics::read_kept(1),
          [this](const Description_& sample) { handlers_.description(from_wire(sample)); });
    if (handlers_.event)
      events_.create(
          participant_, wait_set_, own("events"), topics::read_kept(topics::kEventsDepth),
          [this](const Event_& sample) { handlers_.event(from_wire(sample), run_start(sample)); });
    if (handlers_.robot_description)
      robot_description_.create(participant_, wait_set_, "rt/robot_description",
                                topics::read_kept(1),
                                [this](const std_msgs::msg::dds_::String_& sample) {
                                  handlers_.robot_description(sample.data());
                                });
  }

  void receive(std::chrono::milliseconds timeout) {
    const auto nanoseconds = static_cast<std::uint32_t>(timeout.count() % 1000) * 1'000'000;
    dds::ConditionSeq active;
    wait_set_.wait(active, eprosima::fastrtps::Duration_t(
                               static_cast<std::int32_t>(timeout.count() / 1000), nanoseconds));
    description_.take_all();
    robot_description_.take_all();
    events_.take_all();
    frames_.take_all();
  }

  [[nodiscard]] int publishers() const { return frames_.writers(); }

 private:
  void take(const msg::dds_::Batch_& batch) {
    const auto count = std::min<std::size_t>(batch.count(), batch.frames().size());
    for (std::size_t i = 0; i < count; ++i) handlers_.frame(from_wire(batch.frames()[i]));
  }

  Handlers handlers_;
  DdsParticipant participant_;
  Topic<msg::dds_::Batch_, msg::dds_::Batch_PubSubType> frames_;
  Topic<msg::dds_::Description_, msg::dds_::Description_PubSubType> description_;
  Topic<msg::dds_::Event_, msg::dds_::Event_PubSubType> events_;
  Topic<std_msgs::msg::dds_::String_, std_msgs::msg::dds_::String_PubSubType> robot_description_;
  dds::WaitSet wait_set_;  // after the participant: conditions are detached before readers go
};

FrameSubscription::FrameSubscription(const TelemetryConfig& config, Handlers handlers) {
  check(config, {});
  impl_ = std::make_unique<Impl>(config, std::move(handlers));
}
FrameSubscription::~FrameSubscription() = default;

void FrameSubscription::receive(std::chrono::milliseconds timeout) { impl_->receive(timeout); }
int FrameSubscription::publishers() const { return impl_->publishers(); }

}  // namespace clamber
