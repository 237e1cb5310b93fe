// Is this computer fit for a 1 kHz loop? Kernel, processors, clock, permissions, disk, leftovers.
// Start-up only: allocates, reads /proc and /sys; blocks: the latency check, as long as it is told.
#pragma once

#include <cstdint>
#include <filesystem>

#include "apps/doctor/finding.hpp"
#include "apps/realtime/runtime_settings.hpp"

namespace clamber {

/// Where the kernel shows itself; another root for tests.
struct MachineRoot {
  std::filesystem::path path = "/";
};

[[nodiscard]] Finding check_kernel(const MachineRoot& root);
[[nodiscard]] Finding check_clocksource(const MachineRoot& root);
[[nodiscard]] Finding check_governor(const MachineRoot& root);
/// Are the processors that the control thread may use kept free of everything else?
[[nodiscard]] Finding check_isolation(const MachineRoot& root, const RuntimeSettings& settings);
/// Asks the system for what the control thread will ask for: a line for each that is refused.
[[nodiscard]] Findings check_permissions(const RuntimeSettings& settings);
/// Free bytes where the logs go, against what an hour of 1 kHz frames takes.
[[nodiscard]] Finding check_disk(const std::filesystem::path& folder);
/// Shared memory of DDS participants that are dead: it fills /dev/shm until nobody can join.
[[nodiscard]] Finding check_shared_memory(const MachineRoot& root);
/// Runs cyclictest at the control thread's priority. 0 s: skipped.
[[nodiscard]] Finding check_latency(double seconds, int priority);

/// The verdict on what cyclictest wrote (its --json). Text that is not that is a problem.
[[nodiscard]] Finding judge_cyclictest(const std::string& json);

}  // namespace clamber
