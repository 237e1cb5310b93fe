// The publisher in a process of its own, so that whatever befalls DDS cannot reach the tick: they
// share a TelemetryMemory, and nothing else.
// Construct, stop and destroy on a start-up thread of ordinary priority: allocates, blocks, throws.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "telemetry/port.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

/// Starts the process, and again when it dies (after 0.1 s, then twice as long each time, up to 5
/// s), from a thread of its own. One that has not looked at the rings for 2 s hangs and is killed.
/// Deaths are counted in the block and told as an event.
class PublisherProcess {
 public:
  /// Returns when the process has joined DDS.
  /// @param memory shared; outlives this
  /// @param command program and arguments of what calls run_publisher_process()
  /// @throws InputError for what check() refuses or an interface that does not exist;
  ///   std::logic_error on a real-time thread; std::runtime_error when it cannot be started
  PublisherProcess(const TelemetryConfig& config, const TelemetryDescription& description,
                   TelemetryMemory& memory, std::vector<std::string> command);
  ~PublisherProcess();  ///< stops
  PublisherProcess(const PublisherProcess&) = delete;
  PublisherProcess& operator=(const PublisherProcess&) = delete;

  /// Lets it publish what the rings still hold and end; kills it when it has not after 5 s.
  /// Idempotent.
  void stop();

  /// -1: it has died and was not started again yet. Any thread.
  [[nodiscard]] int process_id() const noexcept;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// The body of that process; returns when the one that started it stops it or has died.
/// @throws std::runtime_error when it was not started by a PublisherProcess
void run_publisher_process();

}  // namespace clamber
