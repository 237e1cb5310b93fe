// Files and the console of the machine that the emulator or debugger runs on (Arm, "Semihosting for
// AArch32 and AArch64"). A bare board without a debugger stops at the first call.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace semihosting {

enum Operation : std::uint32_t {
  kOpen = 0x01,
  kClose = 0x02,
  kWriteText = 0x04,
  kWrite = 0x05,
  kRead = 0x06,
  kExit = 0x20,
};

inline std::int32_t call(Operation operation, const void* argument) noexcept {
  register std::uint32_t r0 asm("r0") = operation;
  register const void* r1 asm("r1") = argument;
  asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
  return static_cast<std::int32_t>(r0);
}

enum Mode : std::uint32_t { kReadBinary = 1, kWriteBinary = 5 };

/// @return a handle, or -1
inline std::int32_t open(const char* name, Mode mode) noexcept {
  std::uint32_t length = 0;
  while (name[length] != '\0') ++length;
  const std::uint32_t block[] = {reinterpret_cast<std::uint32_t>(name), mode, length};
  return call(kOpen, block);
}

/// True when all of `bytes` was filled.
inline bool read(std::int32_t file, std::span<std::byte> bytes) noexcept {
  const std::uint32_t block[] = {static_cast<std::uint32_t>(file),
                                 reinterpret_cast<std::uint32_t>(bytes.data()), bytes.size()};
  return call(kRead, block) == 0;
}

inline bool write(std::int32_t file, std::span<const std::byte> bytes) noexcept {
  const std::uint32_t block[] = {static_cast<std::uint32_t>(file),
                                 reinterpret_cast<std::uint32_t>(bytes.data()), bytes.size()};
  return call(kWrite, block) == 0;
}

inline void print(const char* text) noexcept { call(kWriteText, text); }

inline void print(std::uint64_t number) noexcept {
  char digits[21];
  char* at = digits + sizeof(digits) - 1;
  *at = '\0';
  do {
    *--at = static_cast<char>('0' + number % 10);
    number /= 10;
  } while (number != 0);
  print(at);
}

/// Ends the emulation with this exit code.
[[noreturn]] inline void exit(std::uint32_t code) noexcept {
  constexpr std::uint32_t kApplicationExit = 0x20026;
  const std::uint32_t block[] = {kApplicationExit, code};
  for (;;) call(kExit, block);
}

}  // namespace semihosting
