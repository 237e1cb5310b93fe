// Torques against their limits, and what was lost on the way, from a stream of frames.
// One thread at a time; allocates; blocks: never.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "telemetry/frame.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

struct JointTorque {
  std::string name;
  std::optional<double> limit;  ///< N m; unknown before the description has arrived
  double now = 0.0;             ///< N m, measured in the last frame
  double window = 0.0;          ///< N m, of largest magnitude since the last start_window()
  double peak = 0.0;            ///< N m, of largest magnitude in this run
  double saturated = 0.0;       ///< s at the limit, measured or commanded, in this run

  /// |torque| / limit; 0 while the limit is unknown.
  [[nodiscard]] double load(double torque) const noexcept;
};

/// Counts start again when a run does, which shows as tick numbers that step back.
class TorqueWatch {
 public:
  void describe(const TelemetryDescription& description);
  void add(const TelemetryFrame& frame);
  void start_window();

  /// All joints; the least margin in the window first, ties in the robot's order.
  [[nodiscard]] std::vector<JointTorque> worst_first() const;
  /// The joint with the least margin in the whole run. Only when joints() > 0.
  [[nodiscard]] const JointTorque& worst_of_run() const;

  [[nodiscard]] const TelemetryFrame& last() const noexcept { return last_; }
  [[nodiscard]] const TelemetryDescription& description() const noexcept { return description_; }
  [[nodiscard]] std::size_t joints() const noexcept { return torques_.size(); }
  [[nodiscard]] std::uint64_t received() const noexcept { return received_; }
  /// Frames that are missing between the first and the last one received.
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }

 private:
  void name_joints();

  TelemetryDescription description_;
  std::vector<JointTorque> torques_;
  TelemetryFrame last_;
  std::uint64_t received_ = 0;
  std::uint64_t lost_ = 0;
};

}  // namespace clamber
