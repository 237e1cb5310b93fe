// What the slower topics say of the frames that have passed since their last sample.
// One thread; allocates: TimingSummary keeps its samples; blocks: never. Inside this room only.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "clamber_telemetry.h"
#include "telemetry/port.hpp"

namespace clamber {

/// Torques against their limits.
class TorqueSummary {
 public:
  /// @param dt s that a tick stands for
  explicit TorqueSummary(double dt) : dt_(dt) {}
  void add(const TelemetryFrame& frame) noexcept;
  /// Fills all but the number, and begins the next window.
  void take(msg::dds_::TorqueMargins_& wire) noexcept;

 private:
  double dt_;
  TelemetryFrame last_;
  std::array<double, kMaxJoints> window_{};
  std::array<double, kMaxJoints> run_{};
  std::array<std::uint64_t, kMaxJoints> saturated_{};  ///< ticks
};

/// How the loop kept its time.
class TimingSummary {
 public:
  void add(const TelemetryRecord& record);
  /// Fills what the loop itself knows, and begins the next window.
  void take(msg::dds_::Timing_& wire);

 private:
  struct Times {
    std::vector<float> window;  ///< us
    float max_run = 0.0F;
    void add(std::int64_t ns);
    void take(msg::dds_::Spread_& wire);
  };
  Times wakeup_, tick_, exchange_;
  std::uint64_t last_tick_ = 0;
  double last_time_ = 0.0;
  LoopRecord last_;
};

/// How the buses answer.
class BusSummary {
 public:
  void add(const TelemetryRecord& record) noexcept;
  void take(msg::dds_::BusHealth_& wire) noexcept;

 private:
  std::array<double, kMaxJoints> oldest_{};  ///< ticks
  TelemetryRecord last_;
};

}  // namespace clamber
