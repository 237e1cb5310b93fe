// Names, qualities and ROS 2 type hashes of what we publish. Inside this room only.
// Any thread; allocates; blocks: never.
#pragma once

#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>
#include <string>

namespace clamber::topics {

inline constexpr int kFramesDepth = 8;
inline constexpr int kEventsDepth = 64;

/// rt/<robot>/telemetry/<name>
[[nodiscard]] std::string own(const std::string& robot, const std::string& name);

// Writers. Never blocked by a reader: each keeps the last samples and forgets the others.
/// For what is measured: the next sample is as good. A reader that asks for reliable gets nothing.
[[nodiscard]] eprosima::fastdds::dds::DataWriterQos measured(int depth);
/// Reliable although what is sent at 1 to 100 Hz would not need it: reliable readers, which ROS 2's
/// tools are, refuse a best-effort writer.
[[nodiscard]] eprosima::fastdds::dds::DataWriterQos for_ros2(const std::string& type_hash);
/// Reliable, and late joiners get the last `depth` samples.
[[nodiscard]] eprosima::fastdds::dds::DataWriterQos kept(int depth,
                                                         const std::string& type_hash = {});

// Readers that match them.
[[nodiscard]] eprosima::fastdds::dds::DataReaderQos read_measured(int depth);
[[nodiscard]] eprosima::fastdds::dds::DataReaderQos read_kept(int depth);

// REP 2016's hashes, which ROS 2 reads from a writer's user data (without: "INVALID" in its tools).
inline constexpr const char* kJointStateHash =
    "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e";
inline constexpr const char* kStringHash =
    "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";
inline constexpr const char* kTransformsHash =
    "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087";
inline constexpr const char* kDiagnosticsHash =
    "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e";

}  // namespace clamber::topics
