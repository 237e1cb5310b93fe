#include "tests/control/allocation_guard.hpp"

#include <cerrno>
#include <cstddef>
#include <cstdlib>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define CLAMBER_OWN_MALLOC 0
#else
#define CLAMBER_OWN_MALLOC 1
#endif

namespace {
thread_local bool watching = false;
thread_local std::uint64_t seen = 0;

[[maybe_unused]] void note() noexcept {
  if (watching) ++seen;
}
}  // namespace

#if CLAMBER_OWN_MALLOC
// glibc's own entry points, under the names it keeps for exactly this use.
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);

void* malloc(std::size_t size) {
  note();
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  note();
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) {
  note();
  return __libc_realloc(block, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  note();
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  note();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  note();
  *block = __libc_memalign(alignment, size);
  return *block == nullptr ? ENOMEM : 0;
}
void free(void* block) {
  note();
  __libc_free(block);
}
}
#endif

namespace clamber::test {

bool allocation_guard_works() noexcept { return CLAMBER_OWN_MALLOC != 0; }

AllocationGuard::AllocationGuard() noexcept {
  seen = 0;
  watching = true;
}
AllocationGuard::~AllocationGuard() { watching = false; }
std::uint64_t AllocationGuard::calls() const noexcept { return seen; }

}  // namespace clamber::test
