// Traps every heap call of a thread while it is armed. Linking this replaces the process's malloc
// family by one that looks first (a thread-local flag) and then does the same.
// Any thread, each for itself; allocates: never; blocks: never.
#pragma once

#include <cstdint>

#include "apps/realtime/runtime_settings.hpp"

namespace clamber {

/// False in builds with a sanitizer, whose allocator cannot be replaced.
[[nodiscard]] bool malloc_guard_works() noexcept;

/// Armed for the calling thread as long as it lives; not nested.
class MallocGuard {
 public:
  /// kAbort: the first call says on standard error which one it was and where, and aborts.
  explicit MallocGuard(GuardAction action) noexcept;
  ~MallocGuard();
  MallocGuard(const MallocGuard&) = delete;
  MallocGuard& operator=(const MallocGuard&) = delete;

  /// Calls of malloc, calloc, realloc, free and the aligned kinds since construction; operator new
  /// and delete end there.
  [[nodiscard]] std::uint64_t calls() const noexcept;
};

}  // namespace clamber
