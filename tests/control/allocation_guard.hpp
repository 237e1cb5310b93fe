// Counts what this thread allocates while a guard lives. Link allocation_guard.cpp into the test.
#pragma once

#include <cstdint>

namespace clamber::test {

/// False under a sanitizer, whose own allocator cannot be replaced.
[[nodiscard]] bool allocation_guard_works() noexcept;

class AllocationGuard {
 public:
  AllocationGuard() noexcept;
  ~AllocationGuard();
  AllocationGuard(const AllocationGuard&) = delete;
  AllocationGuard& operator=(const AllocationGuard&) = delete;
  /// Calls to malloc, calloc, realloc, free and the aligned kinds (operator new and delete end
  /// there) by this thread since construction.
  [[nodiscard]] std::uint64_t calls() const noexcept;
};

}  // namespace clamber::test
