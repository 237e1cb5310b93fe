#include "firmware_hal/candump.hpp"

#include <cstdio>

namespace clamber {
namespace {

constexpr std::uint32_t kErrorFlag = 0x20000000;
constexpr std::uint32_t kBrsFlag = 0x1;
constexpr std::uint32_t kEsiFlag = 0x2;

int hex_digit(char c) noexcept {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

/// Digits up to the first other character; -1: none, or too large.
std::int64_t take_decimal(std::string_view& text) noexcept {
  constexpr std::int64_t kTooLarge = 1'000'000'000'000;
  std::int64_t value = 0;
  std::size_t n = 0;
  for (; n < text.size() && text[n] >= '0' && text[n] <= '9'; ++n) {
    value = 10 * value + (text[n] - '0');
    if (value > kTooLarge) return -1;
  }
  text.remove_prefix(n);
  return n == 0 ? -1 : value;
}

bool take(std::string_view& text, char expected) noexcept {
  if (text.empty() || text.front() != expected) return false;
  text.remove_prefix(1);
  return true;
}

const char* take_time(std::string_view& text, std::int64_t& time_us) noexcept {
  if (!take(text, '(')) return "expected '(seconds.microseconds)' at the start";
  const std::int64_t seconds = take_decimal(text);
  if (seconds < 0 || !take(text, '.')) return "expected seconds and a point after '('";
  const std::size_t before = text.size();
  const std::int64_t fraction = take_decimal(text);
  if (fraction < 0 || before - text.size() != 6) return "expected six digits of microseconds";
  if (!take(text, ')') || !take(text, ' ')) return "expected ') ' after the time";
  time_us = 1'000'000 * seconds + fraction;
  return nullptr;
}

const char* take_id(std::string_view& text, CanFrame& frame) noexcept {
  std::uint32_t id = 0;
  std::size_t n = 0;
  for (; n < text.size() && hex_digit(text[n]) >= 0 && n < 9; ++n)
    id = id << 4 | static_cast<std::uint32_t>(hex_digit(text[n]));
  if (n != 3 && n != 8) return "expected an id of 3 or 8 hexadecimal digits";
  text.remove_prefix(n);
  frame.error = n == 8 && (id & kErrorFlag) != 0;
  frame.extended = n == 8 && !frame.error;
  frame.id = frame.error ? id & ~kErrorFlag : id;
  if (frame.id > (n == 8 ? kMaxExtendedId : kMaxStandardId)) return "id out of range";
  return nullptr;
}

const char* take_data(std::string_view& text, CanFrame& frame) noexcept {
  const std::size_t most = frame.fd ? 64 : 8;
  while (!text.empty() && text.front() != ' ' && text.front() != '_') {
    if (text.size() < 2 || hex_digit(text[0]) < 0 || hex_digit(text[1]) < 0)
      return "expected data as pairs of hexadecimal digits";
    if (frame.length == most) return "more data than such a frame holds";
    frame.data[frame.length++] =
        static_cast<std::uint8_t>(hex_digit(text[0]) << 4 | hex_digit(text[1]));
    text.remove_prefix(2);
  }
  if (dlc_of(frame.length, frame.fd) < 0) return "no CAN FD frame has this length";
  return nullptr;
}

const char* take_payload(std::string_view& text, CanFrame& frame) noexcept {
  if (!take(text, '#')) return "expected '#' after the id";
  if (take(text, '#')) {
    const int flags = text.empty() ? -1 : hex_digit(text.front());
    if (flags < 0) return "expected a digit of flags after '##'";
    if (frame.error) return "an error frame is never FD";
    text.remove_prefix(1);
    frame.fd = true;
    frame.brs = (static_cast<std::uint32_t>(flags) & kBrsFlag) != 0;
    frame.esi = (static_cast<std::uint32_t>(flags) & kEsiFlag) != 0;
    return take_data(text, frame);
  }
  if (take(text, 'R')) {
    frame.remote = true;
    if (!text.empty() && text.front() >= '0' && text.front() <= '8') {
      frame.length = static_cast<std::uint8_t>(text.front() - '0');
      text.remove_prefix(1);
    }
    return nullptr;
  }
  return take_data(text, frame);
}

/// What newer versions add: "_F" (raw length code of 8 bytes) and the direction.
const char* take_rest(std::string_view text) noexcept {
  if (take(text, '_')) {
    if (text.empty() || hex_digit(text.front()) < 9) return "expected a length code after '_'";
    text.remove_prefix(1);
  }
  if (text.empty() || text == " R" || text == " T" || text == " B" || text == " E") return nullptr;
  return "unexpected text after the data";
}

}  // namespace

const char* parse_candump(std::string_view text, CandumpLine& line) noexcept {
  if (text.ends_with('\r')) text.remove_suffix(1);
  CandumpLine read;
  if (const char* error = take_time(text, read.time_us)) return error;
  const std::size_t space = text.find(' ');
  if (space == 0 || space == std::string_view::npos || space > 15)
    return "expected an interface name and the frame after the time";
  read.interface = text.substr(0, space);
  text.remove_prefix(space + 1);
  if (const char* error = take_id(text, read.frame)) return error;
  if (const char* error = take_payload(text, read.frame)) return error;
  if (const char* error = take_rest(text)) return error;
  line = read;
  return nullptr;
}

std::string format_candump(std::int64_t time_us, std::string_view interface,
                           const CanFrame& frame) {
  char text[64];
  std::snprintf(text, sizeof text, "(%010lld.%06lld) ", static_cast<long long>(time_us / 1'000'000),
                static_cast<long long>(time_us % 1'000'000));
  std::string line = text;
  line += interface;
  std::snprintf(text, sizeof text, frame.extended || frame.error ? " %08X#" : " %03X#",
                frame.error ? frame.id | kErrorFlag : frame.id);
  line += text;
  if (frame.remote)
    return frame.length == 0 ? line + "R" : line + "R" + std::to_string(frame.length);
  if (frame.fd) {
    std::snprintf(text, sizeof text, "#%X",
                  (frame.brs ? kBrsFlag : 0u) | (frame.esi ? kEsiFlag : 0u));
    line += text;
  }
  for (const std::uint8_t byte : frame.payload()) {
    std::snprintf(text, sizeof text, "%02X", byte);
    line += text;
  }
  return line;
}

}  // namespace clamber
