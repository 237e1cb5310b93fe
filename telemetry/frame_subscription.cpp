#include "telemetry/frame_subscription.hpp"

#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/core/status/SubscriptionMatchedStatus.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include "clamber_telemetryPubSubTypes.h"
#include "telemetry/dds_participant.hpp"
#include "telemetry/topics.hpp"
#include "telemetry/wire.hpp"

namespace clamber {
namespace {

namespace dds = eprosima::fastdds::dds;

// Two seconds of batches: what the reader holds while a disk or a browser keeps this thread busy.
constexpr int kHeldBatches = 256;

template <typename Sample, typename Use>
void take_all(dds::DataReader& reader, Sample& sample, Use use) {
  dds::SampleInfo info;
  while (reader.take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK)
    if (info.valid_data) use(sample);
}

}  // namespace

class FrameSubscription::Impl {
 public:
  explicit Impl(const TelemetryConfig& config)
      : participant_(config, "clamber_subscription"),
        frames_(participant_.create_reader(topics::own(config.robot, "frames"),
                                           dds::TypeSupport(new msg::dds_::Batch_PubSubType()),
                                           topics::read_measured(kHeldBatches))),
        description_(participant_.create_reader(
            topics::own(config.robot, "description"),
            dds::TypeSupport(new msg::dds_::Description_PubSubType()), topics::read_kept(1))) {
    for (dds::DataReader* reader : {&frames_, &description_}) {
      reader->get_statuscondition().set_enabled_statuses(dds::StatusMask::data_available());
      wait_set_.attach_condition(reader->get_statuscondition());
    }
  }

  void receive(std::chrono::milliseconds timeout, const Handlers& handlers) {
    const auto nanoseconds = static_cast<std::uint32_t>(timeout.count() % 1000) * 1'000'000;
    dds::ConditionSeq active;
    wait_set_.wait(active, eprosima::fastrtps::Duration_t(
                               static_cast<std::int32_t>(timeout.count() / 1000), nanoseconds));
    take_all(description_, description_sample_, [&](const msg::dds_::Description_& sample) {
      if (handlers.description) handlers.description(from_wire(sample));
    });
    take_all(frames_, batch_, [&](const msg::dds_::Batch_& batch) {
      const auto count = std::min<std::size_t>(batch.count(), batch.frames().size());
      for (std::size_t i = 0; i < count; ++i) handlers.frame(from_wire(batch.frames()[i]));
    });
  }

  [[nodiscard]] int publishers() const {
    dds::SubscriptionMatchedStatus status;
    frames_.get_subscription_matched_status(status);
    return status.current_count;
  }

 private:
  DdsParticipant participant_;
  dds::DataReader& frames_;
  dds::DataReader& description_;
  dds::WaitSet wait_set_;  // after the participant: conditions are detached before readers go
  msg::dds_::Batch_ batch_;
  msg::dds_::Description_ description_sample_;
};

FrameSubscription::FrameSubscription(const TelemetryConfig& config) {
  check(config, {});
  impl_ = std::make_unique<Impl>(config);
}
FrameSubscription::~FrameSubscription() = default;

void FrameSubscription::receive(std::chrono::milliseconds timeout, const Handlers& handlers) {
  impl_->receive(timeout, handlers);
}
int FrameSubscription::publishers() const { return impl_->publishers(); }

}  // namespace clamber
