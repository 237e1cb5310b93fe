// Feeds the service manager's watchdog as long as a run is alive in all its parts, and writes down
// how it is. Construct and destroy on the main thread, around the run; watches from a thread of its
// own at ordinary priority. Allocates, writes a small file; throws InputError at the start only.
//
// Alive is: the control loop goes round, telemetry's publisher goes round, and while the drives
// have torque no joint is stale unless the supervisor has seen that and acts on it. If one of them
// stops for half the watchdog's time the feeding ends, and the manager ends the process: the drives
// are then without a host, and do what their phase's failure policy says.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <thread>

#include "apps/run_pulse.hpp"
#include "apps/service_health.hpp"
#include "deploy/notify.hpp"

namespace clamber {

class ServiceMonitor {
 public:
  struct Sources {
    const RunPulse* pulse = nullptr;
    /// Counts the publisher's rounds; empty: no telemetry.
    std::function<std::uint64_t()> publisher;
    /// The drives while they are off; empty: nobody asks them.
    std::function<DriveHealth()> drives;
  };
  /// @param health  what is known already; the rest is filled in
  /// @param file  for the health; empty: none
  ServiceMonitor(Sources sources, ServiceHealth health, std::filesystem::path file);
  ~ServiceMonitor();
  ServiceMonitor(const ServiceMonitor&) = delete;
  ServiceMonitor& operator=(const ServiceMonitor&) = delete;

 private:
  using Clock = std::chrono::steady_clock;

  /// A counter that must not stand still.
  struct Counter {
    std::uint64_t value = 0;
    Clock::time_point moved = Clock::now();
    bool stands(std::uint64_t now, Clock::time_point at, Clock::duration limit);
  };

  void watch(const std::stop_token& stop);
  [[nodiscard]] std::string find_problem(Clock::time_point now);
  void note_joints();
  void tell(const std::string& problem);
  void write_down();

  Sources sources_;
  ServiceHealth health_;
  std::filesystem::path file_;
  Notifier notifier_;
  Clock::duration limit_;
  Counter loop_, publisher_;
  Clock::time_point fresh_ = Clock::now();
  bool stopping_ = false;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace clamber
