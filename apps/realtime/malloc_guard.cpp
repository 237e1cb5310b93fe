#include "apps/realtime/malloc_guard.hpp"

#include <execinfo.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <cstring>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define CLAMBER_OWN_MALLOC 0
#else
#define CLAMBER_OWN_MALLOC 1
#endif

namespace clamber {
namespace {

thread_local GuardAction armed = GuardAction::kOff;
thread_local std::uint64_t calls_seen = 0;

void say(const char* text) noexcept {
  const ssize_t ignored = write(STDERR_FILENO, text, std::strlen(text));
  static_cast<void>(ignored);
}

[[noreturn]] void give_up(const char* function) noexcept {
  armed = GuardAction::kOff;  // backtrace() may allocate
  say("clamber: guard 'malloc': the control thread called ");
  say(function);
  say(" in its tick:\n");
  std::array<void*, 16> frames{};
  backtrace_symbols_fd(frames.data(), backtrace(frames.data(), static_cast<int>(frames.size())),
                       STDERR_FILENO);
  std::abort();
}

[[maybe_unused]] inline void look(const char* function) noexcept {
  if (armed == GuardAction::kOff) return;
  ++calls_seen;
  if (armed == GuardAction::kAbort) give_up(function);
}

}  // namespace

bool malloc_guard_works() noexcept { return CLAMBER_OWN_MALLOC != 0; }

MallocGuard::MallocGuard(GuardAction action) noexcept {
  calls_seen = 0;
  armed = action;
}
MallocGuard::~MallocGuard() { armed = GuardAction::kOff; }
std::uint64_t MallocGuard::calls() const noexcept { return calls_seen; }

}  // namespace clamber

#if CLAMBER_OWN_MALLOC
using clamber::look;

// glibc's own entry points, under the names it keeps for exactly this use.
extern "C" {
// NOLINTBEGIN(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp)
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);

void* malloc(std::size_t size) {
  look("malloc");
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  look("calloc");
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) {
  look("realloc");
  return __libc_realloc(block, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  look("memalign");
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  look("aligned_alloc");
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  look("posix_memalign");
  *block = __libc_memalign(alignment, size);
  return *block == nullptr ? ENOMEM : 0;
}
void free(void* block) {
  look("free");
  __libc_free(block);
}
// NOLINTEND(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp)
}
#endif
