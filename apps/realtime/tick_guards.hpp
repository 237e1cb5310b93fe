// The guards around what the control thread does each tick: heap, system calls, page faults.
// Control thread. install() before the first tick: allocates, throws; the rest: allocates never,
// blocks never.
#pragma once

#include <cstdint>
#include <optional>

#include "apps/realtime/malloc_guard.hpp"
#include "apps/realtime/runtime_settings.hpp"
#include "apps/realtime/syscall_guard.hpp"

namespace clamber {

/// Of the guards that were on.
struct GuardReport {
  bool malloc = false, syscalls = false, faults = false;
  bool exchange = false;    ///< they covered the bus too, not the controller alone
  std::uint64_t ticks = 0;  ///< guarded
  std::uint64_t malloc_calls = 0;
  std::uint64_t warm_up_faults = 0;
  std::uint64_t page_faults = 0;  ///< after the warm-up

  [[nodiscard]] bool found() const noexcept { return malloc_calls > 0 || page_faults > 0; }
  /// What, in one line; empty: nothing.
  [[nodiscard]] const char* finding() const noexcept;
};

class TickGuards {
 public:
  /// @param warm_up ticks whose page faults are not held against the run
  TickGuards(const GuardSettings& settings, std::uint64_t warm_up) noexcept
      : settings_(settings), warm_up_(warm_up) {}

  /// Last thing before the loop. @throws InputError when a guard is not to be had
  void install(BusCalls bus);

  void enter() noexcept;
  void leave() noexcept;
  [[nodiscard]] const GuardReport& report() const noexcept { return report_; }

 private:
  GuardSettings settings_;
  std::uint64_t warm_up_;
  std::optional<MallocGuard> malloc_;
  std::uint64_t faults_before_ = 0;
  GuardReport report_;
};

}  // namespace clamber
