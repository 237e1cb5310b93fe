// A made-up run whose every number is different, for the tests of what stores runs.
#pragma once

#include <cmath>
#include <cstring>
#include <filesystem>
#include <string>

#include <unistd.h>

#include "recording/frame_fields.hpp"
#include "recording/run_description.hpp"

namespace clamber::test {

inline constexpr int kJoints = 23;
inline constexpr int kContacts = 8;

inline TelemetryFrame made_frame(std::uint64_t tick) {
  TelemetryFrame frame;
  frame.sequence = tick;
  frame.time = static_cast<double>(tick) * 1e-3;
  frame.joint_count = kJoints;
  frame.contact_count = kContacts;
  frame.phase = static_cast<std::uint32_t>(tick / 1000);
  frame.flags = kFrameHasTruth;
  double value = 0.1 * std::sin(static_cast<double>(tick));
  const auto fill = [&](auto& array, std::size_t used) {
    for (std::size_t i = 0; i < used; ++i) array[i] = value += 0.125;
  };
  for (PerJoint* array : {&frame.q_ref, &frame.q, &frame.dq, &frame.tau_ff, &frame.tau_cmd,
                          &frame.tau_meas, &frame.tau_limit, &frame.temperature, &frame.age})
    fill(*array, kJoints);
  for (PerContact* array : {&frame.force_obstacle, &frame.force_floor}) fill(*array, kContacts);
  frame.plan_time = 0.5 * frame.time;
  frame.base_position = {value, 0.25, 0.5};
  frame.base_orientation = {1.0, 0.0, 0.0, 0.0};
  frame.force_forbidden = value + 1.0;
  frame.force_other = value + 2.0;
  return frame;
}

inline RunDescription made_run() {
  RunDescription run;
  run.robot = "made";
  for (int j = 0; j < kJoints; ++j) {
    run.telemetry.joint_names.push_back("Joint" + std::to_string(j));
    run.telemetry.torque_limits.push_back(30.0 + j);
  }
  for (int c = 0; c < kContacts; ++c)
    run.telemetry.contact_names.push_back("Contact" + std::to_string(c));
  run.telemetry.plan = "5ec0de";
  run.telemetry.modes = {"idle", "executing"};
  run.telemetry.faults = {"none", "tracking error"};
  run.telemetry.phases = {{"reach", 3}, {"swing Lknee", 1}};
  run.scene = "{\"made\":true}";
  return run;
}

inline constexpr const char* kUrdf = "<robot name=\"made\"/>";

inline TelemetryEvent made_event(std::uint64_t number) {
  TelemetryEvent event;
  event.sequence = number;
  event.tick = 500 * number;
  event.time = 0.5 * static_cast<double>(number);
  event.kind = EventKind::kFault;
  event.severity = Severity::kError;
  event.joint = static_cast<std::int32_t>(number);
  event.phase = 1;
  event.append("tracking error " + std::to_string(number));
  return event;
}

inline bool same(const TelemetryFrame& a, const TelemetryFrame& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

/// A file in the temporary folder that goes with the test.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& name)
      : path_(std::filesystem::temp_directory_path() /
              ("clamber_recording_" + std::to_string(getpid()) + '_' + name)) {}
  ~TemporaryFile() { std::filesystem::remove(path_); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace clamber::test
