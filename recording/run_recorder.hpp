// Writes a run as an MCAP file that Foxglove, PlotJuggler and ROS 2's tools open.
// One thread; allocates; blocks on the file; throws InputError.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "recording/cdr.hpp"
#include "recording/mcap_writer.hpp"
#include "recording/run_description.hpp"
#include "recording/run_file.hpp"
#include "robot_model/kinematics.hpp"
#include "telemetry/frame.hpp"

namespace clamber {

/// Topics:
///   /<robot>/telemetry/ticks        clamber/msg/Tick: every frame
///   /<robot>/telemetry/description  clamber/msg/Description, once
///   /<robot>/telemetry/events       clamber/msg/Event
///   /robot_description              std_msgs/msg/String: the URDF, once
///   /joint_states                   sensor_msgs/msg/JointState: every 10th tick
///   /tf                             tf2_msgs/msg/TFMessage: every 20th tick with the base's pose
/// The metadata record "clamber" holds the scene to draw the run in.
class RunRecorder final : public RunFile {
 public:
  /// @param model for /tf; without it there is none. Outlives this.
  /// @param start ns, what the run's time counts from: since 1970, or 0 for a run that knows no
  ///        wall clock
  /// @param from s, the run's time when the recording began: where what came before is shown
  RunRecorder(const std::filesystem::path& file, RunDescription run, const RobotModel* model,
              std::uint64_t start, double from = 0.0);

  void add(const TelemetryFrame& frame) override;
  void add(const TelemetryEvent& event) override;
  void add_urdf(const std::string& urdf) override;
  /// Everything so far goes to the file: what follows cannot lose it.
  void flush() { writer_.flush(); }
  void close() override { writer_.close(); }
  [[nodiscard]] std::uint64_t bytes() const { return writer_.bytes(); }

 private:
  [[nodiscard]] std::uint64_t stamp(double time) const;

  RunDescription run_;
  const RobotModel* model_;
  std::uint64_t start_;
  std::uint64_t begin_;  ///< of the recording
  McapWriter writer_;
  std::uint16_t ticks_;
  std::uint16_t description_;
  std::uint16_t events_;
  std::uint16_t joint_states_;
  std::optional<std::uint16_t> tf_;
  CdrWriter message_;  ///< scratch
  RobotData data_;     ///< scratch
};

}  // namespace clamber
