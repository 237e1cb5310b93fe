// Publishes what the control thread handed over, over DDS, from a thread of its own at normal
// priority. Construct, stop and destroy on a start-up thread: allocates, blocks, throws. Nothing in
// here is for the real-time thread, which only sees the port.
#pragma once

#include <cstdint>
#include <memory>

#include "telemetry/port.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

struct PublisherCounters {
  std::uint64_t frames = 0;        ///< given to DDS
  std::uint64_t batches = 0;       ///< datagrams they went in, up to 10 frames each
  std::uint64_t joint_states = 0;  ///< given to DDS
  std::uint64_t events = 0;        ///< ditto
  std::uint64_t refused = 0;       ///< samples that DDS did not take
  std::uint64_t ring_drops = 0;    ///< frames that found the ring full
  std::uint64_t event_drops = 0;   ///< events that found theirs full
  std::uint64_t gaps = 0;          ///< frames that DDS never got, ring drops among them
  std::uint64_t restarts = 0;      ///< of the publisher's process
  std::uint64_t hangs = 0;         ///< of those, of one that stood still and was killed
  std::uint64_t rounds = 0;        ///< looks at the ring, or at the process that should: it lives
};

/// Whoever publishes from it. Any thread.
[[nodiscard]] PublisherCounters counters_of(const TelemetryBlock& block) noexcept;

/// DDS's threads inherit the policy of the thread that creates them. @throws std::logic_error
void refuse_real_time_thread();

/// Topics: docs/telemetry.md.
/// A subscriber to frames and description that was matched before the first tick and keeps up gets
/// every frame: the second description, sent after the last frame, is its proof to have had it.
class Publisher {
 public:
  /// Creates the DDS participant and starts publishing; carries on where another publisher of the
  /// same block has died. Must run before any thread becomes real-time: DDS's threads inherit the
  /// policy of the thread that creates them.
  /// @param block outlives this; its consumer is this object
  /// @throws InputError for what check() refuses; std::logic_error on a real-time thread;
  ///   std::runtime_error when DDS refuses
  Publisher(const TelemetryConfig& config, const TelemetryDescription& description,
            TelemetryBlock& block);
  ~Publisher();  ///< stops
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;

  /// Publishes what the rings still hold, waits up to a second for the reliable topics to be
  /// acknowledged, and ends the thread. The producer must have stopped. Idempotent.
  void stop();

  /// Readers of the frames topic that are matched now. Any thread; takes DDS's lock.
  [[nodiscard]] int frame_readers() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clamber
