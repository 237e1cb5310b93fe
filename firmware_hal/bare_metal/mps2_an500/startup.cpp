// From reset to run(): vector table, floating point, memory. Cortex-M7 without an operating system
// (Armv7-M Architecture Reference Manual, B1.5 exceptions, B3.2.20 CPACR).
#include <cstddef>
#include <cstdint>

#include "firmware_hal/bare_metal/mps2_an500/semihosting.hpp"

extern "C" {
extern std::uint32_t data_begin[], data_end[], data_load[], bss_begin[], bss_end[];
extern std::uint32_t stack_begin[], stack_end[];
extern void (*init_begin[])();
extern void (*init_end[])();
[[noreturn]] void run();
[[noreturn]] void reset();
[[noreturn]] void fault();
// Called by virtual functions that have no body, and by destructors of objects on the heap: neither
// can happen here.
[[noreturn]] void __cxa_pure_virtual() { fault(); }
}
void operator delete(void* /*memory*/) noexcept { fault(); }
void operator delete(void* /*memory*/, std::size_t /*size*/) noexcept { fault(); }

namespace {
constexpr std::uint32_t kStackPattern = 0xC1A3BE85u;  // what the stack has not reached
}

extern "C" [[noreturn]] void fault() {
  semihosting::print("stopped: exception of the processor\n");
  semihosting::exit(3);
}

/// Bytes of stack that have ever been in use.
std::size_t stack_used() noexcept {
  const std::uint32_t* at = stack_begin;
  while (at < stack_end && *at == kStackPattern) ++at;
  return static_cast<std::size_t>(stack_end - at) * sizeof(*at);
}

extern "C" [[noreturn]] void reset() {
  // Full access to coprocessors 10 and 11, the floating-point unit, before its first instruction.
  auto* const cpacr = reinterpret_cast<volatile std::uint32_t*>(0xE000ED88u);
  *cpacr = *cpacr | 0xFu << 20;
  asm volatile("dsb\n isb");
  const std::uint32_t* from = data_load;
  for (std::uint32_t* to = data_begin; to < data_end;) *to++ = *from++;
  for (std::uint32_t* to = bss_begin; to < bss_end;) *to++ = 0;
  std::uint32_t* here = nullptr;
  asm volatile("mov %0, sp" : "=r"(here));
  for (std::uint32_t* to = stack_begin; to < here;) *to++ = kStackPattern;
  for (auto init = init_begin; init < init_end; ++init) (*init)();
  run();
}

// Initial stack pointer and the system's 15 exceptions. No interrupt is used.
extern "C" [[gnu::section(".vectors"), gnu::used]] const void* const vectors[] = {
    stack_end,
    reinterpret_cast<const void*>(reset),
    reinterpret_cast<const void*>(fault),  // NMI
    reinterpret_cast<const void*>(fault),  // HardFault
    reinterpret_cast<const void*>(fault),  // MemManage
    reinterpret_cast<const void*>(fault),  // BusFault
    reinterpret_cast<const void*>(fault),  // UsageFault
    nullptr,
    nullptr,
    nullptr,
    nullptr,
    reinterpret_cast<const void*>(fault),  // SVCall
    reinterpret_cast<const void*>(fault),  // DebugMonitor
    nullptr,
    reinterpret_cast<const void*>(fault),  // PendSV
    reinterpret_cast<const void*>(fault),  // SysTick
};
