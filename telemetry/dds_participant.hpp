// A Fast DDS participant that is bound to the configured interfaces. Inside this room only.
// Start-up and shutdown threads; allocates; blocks; throws.
#pragma once

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <string>

#include "telemetry/telemetry_config.hpp"

namespace clamber {

/// Owns the participant and everything created through it.
class DdsParticipant {
 public:
  /// Fast DDS starts its threads here, and they inherit the caller's scheduling policy.
  /// @throws InputError for an interface that does not exist; std::runtime_error when DDS refuses
  DdsParticipant(const TelemetryConfig& config, const std::string& name);
  ~DdsParticipant();
  DdsParticipant(const DdsParticipant&) = delete;
  DdsParticipant& operator=(const DdsParticipant&) = delete;

  /// Both return objects that live as long as this. @throws std::runtime_error
  eprosima::fastdds::dds::DataWriter& create_writer(const std::string& topic,
                                                    const eprosima::fastdds::dds::TypeSupport& type,
                                                    eprosima::fastdds::dds::DataWriterQos qos);
  eprosima::fastdds::dds::DataReader& create_reader(const std::string& topic,
                                                    const eprosima::fastdds::dds::TypeSupport& type,
                                                    eprosima::fastdds::dds::DataReaderQos qos);

 private:
  eprosima::fastdds::dds::Topic& create_topic(const std::string& topic,
                                              const eprosima::fastdds::dds::TypeSupport& type);

  eprosima::fastdds::dds::DomainParticipant* participant_ = nullptr;
  eprosima::fastdds::dds::Publisher* publisher_ = nullptr;
  eprosima::fastdds::dds::Subscriber* subscriber_ = nullptr;
};

}  // namespace clamber
