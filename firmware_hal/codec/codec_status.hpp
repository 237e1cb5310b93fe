// What a codec says about a frame or a command. Plain data.
#pragma once

#include <cstdint>

namespace clamber {

enum class CodecStatus : std::uint8_t {
  kOk,
  kClamped,     ///< encoded, but a value was beyond the drive's range and is now at its end
  kNotFinite,   ///< a value is NaN or infinite: nothing was encoded
  kForeign,     ///< another node's or another protocol's id
  kBadFormat,   ///< classic where FD was agreed or the other way, 29-bit id, remote or error frame
  kBadLength,   ///< the right id with a payload of the wrong length
  kBadContent,  ///< right id and length, but the bytes contradict themselves
};

[[nodiscard]] constexpr const char* to_string(CodecStatus status) noexcept {
  switch (status) {
    case CodecStatus::kOk:
      return "ok";
    case CodecStatus::kClamped:
      return "clamped";
    case CodecStatus::kNotFinite:
      return "not finite";
    case CodecStatus::kForeign:
      return "foreign id";
    case CodecStatus::kBadFormat:
      return "wrong frame format";
    case CodecStatus::kBadLength:
      return "wrong length";
    case CodecStatus::kBadContent:
      return "contradictory content";
  }
  return "?";
}

}  // namespace clamber
