// Frames and description of a robot, received over DDS, for whoever shows or records them.
// One thread at a time; allocates; receive() blocks for as long as it is told; throws.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>

#include "telemetry/frame.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

/// Reads only: it creates no writer.
class FrameSubscription {
 public:
  /// @throws InputError for a configuration that check() refuses; std::runtime_error when DDS does
  explicit FrameSubscription(const TelemetryConfig& config);
  ~FrameSubscription();
  FrameSubscription(const FrameSubscription&) = delete;
  FrameSubscription& operator=(const FrameSubscription&) = delete;

  struct Handlers {
    std::function<void(const TelemetryDescription&)> description;
    std::function<void(const TelemetryFrame&)> frame;
  };
  /// Waits for samples, at most `timeout`, and hands them over, the description first.
  void receive(std::chrono::milliseconds timeout, const Handlers& handlers);
  /// Publishers of the robot's frames that are there now.
  [[nodiscard]] int publishers() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clamber
