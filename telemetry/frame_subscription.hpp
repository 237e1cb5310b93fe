// Frames of a robot and what belongs to them, received over DDS, for whoever shows or records them.
// One thread at a time; allocates; receive() blocks for as long as it is told; throws.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "telemetry/event.hpp"
#include "telemetry/frame.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

/// Reads only: it creates no writer.
class FrameSubscription {
 public:
  /// What nobody handles is not subscribed to.
  struct Handlers {
    std::function<void(const TelemetryDescription&)> description;
    std::function<void(const TelemetryFrame&)> frame;  ///< required
    /// @param start of the event's run, ns since 1970
    std::function<void(const TelemetryEvent&, std::int64_t start)> event;
    std::function<void(const std::string& urdf)> robot_description;
  };

  /// @throws InputError for a configuration that check() refuses; std::runtime_error when DDS does
  FrameSubscription(const TelemetryConfig& config, Handlers handlers);
  ~FrameSubscription();
  FrameSubscription(const FrameSubscription&) = delete;
  FrameSubscription& operator=(const FrameSubscription&) = delete;

  /// Waits for samples, at most `timeout`, and hands them over, the description first, frames last.
  void receive(std::chrono::milliseconds timeout);
  /// Publishers of the robot's frames that are there now.
  [[nodiscard]] int publishers() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clamber
