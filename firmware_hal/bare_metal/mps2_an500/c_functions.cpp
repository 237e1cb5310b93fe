// All that the loop needs of a C library. It is linked without one: a call whose result might
// differ from the host's library (sin, exp, pow, ...) does not link.
#include <cstddef>
#include <cstdint>

namespace {
/// To the nearest whole number, halves away from zero: one instruction.
double rounded(double x) {
  double y;
  asm("vrinta.f64 %P0, %P1" : "=w"(y) : "w"(x));
  return y;
}
}  // namespace

extern "C" {

void* memcpy(void* to, const void* from, std::size_t size) {
  auto* t = static_cast<std::uint8_t*>(to);
  const auto* f = static_cast<const std::uint8_t*>(from);
  if (((reinterpret_cast<std::uintptr_t>(t) | reinterpret_cast<std::uintptr_t>(f)) & 3u) == 0)
    for (; size >= 4; size -= 4, t += 4, f += 4) {
      *reinterpret_cast<std::uint32_t*>(t) = *reinterpret_cast<const std::uint32_t*>(f);
    }
  while (size-- > 0) *t++ = *f++;
  return to;
}

void* memmove(void* to, const void* from, std::size_t size) {
  auto* t = static_cast<std::uint8_t*>(to);
  const auto* f = static_cast<const std::uint8_t*>(from);
  if (t <= f || t >= f + size) return memcpy(to, from, size);
  while (size-- > 0) t[size] = f[size];
  return to;
}

void* memset(void* to, int value, std::size_t size) {
  auto* t = static_cast<std::uint8_t*>(to);
  const auto byte = static_cast<std::uint8_t>(value);
  if ((reinterpret_cast<std::uintptr_t>(t) & 3u) == 0)
    for (; size >= 4; size -= 4, t += 4) *reinterpret_cast<std::uint32_t*>(t) = byte * 0x01010101u;
  while (size-- > 0) *t++ = byte;
  return to;
}

int memcmp(const void* a, const void* b, std::size_t size) {
  const auto* x = static_cast<const std::uint8_t*>(a);
  const auto* y = static_cast<const std::uint8_t*>(b);
  for (; size > 0; --size, ++x, ++y)
    if (*x != *y) return *x - *y;
  return 0;
}

std::size_t strlen(const char* text) {
  std::size_t length = 0;
  while (text[length] != '\0') ++length;
  return length;
}

long lround(double x) { return static_cast<long>(rounded(x)); }
long long llround(double x) { return static_cast<long long>(rounded(x)); }

}  // extern "C"
