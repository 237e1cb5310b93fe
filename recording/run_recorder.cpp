#include "recording/run_recorder.hpp"

#include <algorithm>
#include <cmath>

#include "recording/measured_configuration.hpp"
#include "recording/messages.hpp"

namespace clamber {
namespace {

constexpr std::uint64_t kTicksPerJointState = 10;
constexpr std::uint64_t kTicksPerTransforms = 20;

}  // namespace

RunRecorder::RunRecorder(const std::filesystem::path& file, RunDescription run,
                         const RobotModel* model, std::uint64_t start, double from)
    : run_(std::move(run)),
      model_(model),
      start_(start),
      begin_(stamp(from)),
      writer_(file, "ros2", "clamber"),
      ticks_(writer_.add_channel("/" + run_.robot + "/telemetry/ticks", tick_schema(), "cdr")),
      description_(writer_.add_channel("/" + run_.robot + "/telemetry/description",
                                       description_schema(), "cdr")),
      events_(writer_.add_channel("/" + run_.robot + "/telemetry/events", event_schema(), "cdr")),
      joint_states_(writer_.add_channel("/joint_states", joint_state_schema(), "cdr")) {
  if (model_ != nullptr) tf_ = writer_.add_channel("/tf", tf_schema(), "cdr");
  if (!run_.scene.empty()) writer_.add_metadata("clamber", {{"scene", run_.scene}});
  encode_description(run_, message_);
  writer_.write(description_, begin_, message_.bytes());
}

std::uint64_t RunRecorder::stamp(double time) const {
  return start_ + static_cast<std::uint64_t>(std::llround(std::max(0.0, time) * 1e9));
}

void RunRecorder::add(const TelemetryFrame& frame) {
  const std::uint64_t time = stamp(frame.time);
  encode_tick(frame, message_);
  writer_.write(ticks_, time, message_.bytes());
  if (frame.sequence % kTicksPerJointState == 0) {
    encode_joint_state(frame, time, run_, message_);
    writer_.write(joint_states_, time, message_.bytes());
  }
  if (tf_ && frame.sequence % kTicksPerTransforms == 0 && (frame.flags & kFrameHasTruth) != 0) {
    forward_kinematics(*model_, measured_configuration(frame), data_);
    encode_tf(*model_, data_, time, message_);
    writer_.write(*tf_, time, message_.bytes());
  }
}

void RunRecorder::add(const TelemetryEvent& event) {
  const std::uint64_t time = stamp(event.time);
  encode_event(event, time, message_);
  writer_.write(events_, std::max(time, begin_), time, message_.bytes());
}

void RunRecorder::add_urdf(const std::string& urdf) {
  encode_string(urdf, message_);
  writer_.write(writer_.add_channel(kUrdfTopic, string_schema(), "cdr"), begin_, message_.bytes());
}

std::unique_ptr<RunFile> open_mcap(const std::filesystem::path& file, const RunDescription& run,
                                   const RobotModel* model) {
  return std::make_unique<RunRecorder>(file, run, model, 0);
}

}  // namespace clamber
