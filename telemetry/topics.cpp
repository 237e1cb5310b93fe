#include "telemetry/topics.hpp"

#include <vector>

namespace clamber::topics {
namespace {

namespace dds = eprosima::fastdds::dds;

dds::DataWriterQos writer(dds::ReliabilityQosPolicyKind reliability,
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
  // Strings and sequences have no largest size; fastddsgen guesses one, which the URDF exceeds.
  qos.endpoint().history_memory_policy =
      eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  return qos;
}

dds::DataWriterQos with_hash(dds::DataWriterQos qos, const std::string& type_hash) {
  if (type_hash.empty()) return qos;
  const std::string data = "typehash=" + type_hash + ";";
  qos.user_data().data_vec(std::vector<eprosima::fastrtps::rtps::octet>(data.begin(), data.end()));
  return qos;
}

dds::DataReaderQos reader(dds::ReliabilityQosPolicyKind reliability,
                          dds::DurabilityQosPolicyKind durability, int depth) {
  dds::DataReaderQos qos;
  qos.reliability().kind = reliability;
  qos.durability().kind = durability;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = depth;
  return qos;
}

}  // namespace

std::string own(const std::string& robot, const std::string& name) {
  return "rt/" + robot + "/telemetry/" + name;
}

dds::DataWriterQos measured(int depth) {
  dds::DataWriterQos qos =
      writer(dds::BEST_EFFORT_RELIABILITY_QOS, dds::VOLATILE_DURABILITY_QOS, depth);
  qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_MEMORY_MODE;
  return qos;
}

dds::DataWriterQos for_ros2(const std::string& type_hash) {
  return with_hash(writer(dds::RELIABLE_RELIABILITY_QOS, dds::VOLATILE_DURABILITY_QOS, 1),
                   type_hash);
}

dds::DataWriterQos kept(int depth, const std::string& type_hash) {
  return with_hash(
      writer(dds::RELIABLE_RELIABILITY_QOS, dds::TRANSIENT_LOCAL_DURABILITY_QOS, depth), type_hash);
}

dds::DataReaderQos read_measured(int depth) {
  return reader(dds::BEST_EFFORT_RELIABILITY_QOS, dds::VOLATILE_DURABILITY_QOS, depth);
}

dds::DataReaderQos read_kept(int depth) {
  return reader(dds::RELIABLE_RELIABILITY_QOS, dds::TRANSIENT_LOCAL_DURABILITY_QOS, depth);
}

}  // namespace clamber::topics
