// Where the controller hands its frames, so that the tick does not know what stands behind it.
// Called by the thread that runs the tick only; allocates: never; blocks: never.
#pragma once

#include "telemetry/frame.hpp"

namespace clamber {

class FrameSink {
 public:
  FrameSink() = default;
  virtual ~FrameSink() = default;
  FrameSink(const FrameSink&) = delete;
  FrameSink& operator=(const FrameSink&) = delete;

  /// Takes a copy of the frame. False when it was dropped for want of room; the sink counts those,
  /// the caller carries on.
  virtual bool push(const TelemetryFrame& frame) noexcept = 0;
};

}  // namespace clamber
