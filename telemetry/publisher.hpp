// Publishes what the ring holds over DDS, from a thread of its own at normal priority.
// Construct, stop and destroy on a start-up thread: allocates, blocks, throws. Nothing in here is
// for the real-time thread, which only sees the ring.
#pragma once

#include <cstdint>
#include <memory>

#include "telemetry/ring.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

struct PublisherCounters {
  std::uint64_t frames = 0;        ///< given to DDS
  std::uint64_t batches = 0;       ///< datagrams they went in, up to 10 frames each
  std::uint64_t joint_states = 0;  ///< given to DDS
  std::uint64_t refused = 0;       ///< samples that DDS did not take
  std::uint64_t ring_drops = 0;    ///< frames that found the ring full
  std::uint64_t rounds = 0;        ///< looks at the ring: it lives
};

/// Topics:
///   rt/<robot>/telemetry/frames       clamber/msg/Batch: every tick; best effort, keep last 8
///   rt/joint_states                   sensor_msgs/msg/JointState: every 10th tick; reliable
///   rt/<robot>/telemetry/description  clamber/msg/Description: at the start and, the same, at the
///                                     end; reliable, transient local
/// A subscriber to frames and description that was matched before the first tick and keeps up gets
/// every frame: the second description is its proof to have had the last.
class Publisher {
 public:
  /// Creates the DDS participant and starts publishing. Must run before any thread becomes
  /// real-time: DDS's threads inherit the policy of the thread that creates them.
  /// @param ring outlives this; its consumer is this object
  /// @throws InputError for what check() refuses; std::logic_error on a real-time thread;
  ///   std::runtime_error when DDS refuses
  Publisher(const TelemetryConfig& config, const TelemetryDescription& description,
            FrameRing& ring);
  ~Publisher();  ///< stops
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;

  /// Publishes what the ring still holds, waits up to a second for the reliable topics to be
  /// acknowledged, and ends the thread. The producer must have stopped. Idempotent.
  void stop();

  /// Any thread.
  [[nodiscard]] PublisherCounters counters() const noexcept;
  /// Readers of the frames topic that are matched now. Any thread; takes DDS's lock.
  [[nodiscard]] int frame_readers() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clamber
