// One CAN or CAN FD frame as plain data, the currency of codecs, bus model and transports.
// Any thread; allocates: never; blocks: never.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace clamber {

inline constexpr std::uint32_t kMaxStandardId = 0x7FF;
inline constexpr std::uint32_t kMaxExtendedId = 0x1FFFFFFF;

struct CanFrame {
  std::uint32_t id = 0;
  bool extended = false;  ///< 29-bit id
  bool remote = false;    ///< classic only: asks for data, carries none
  bool error = false;     ///< a controller's report about the bus (SocketCAN), not a frame on it
  bool fd = false;
  bool brs = false;         ///< FD: payload at the data bit rate; a frame without it gains nothing
  bool esi = false;         ///< FD: the sender is error passive
  std::uint8_t length = 0;  ///< bytes of `data` in use; of a remote frame: bytes asked for
  std::array<std::uint8_t, 64> data{};

  [[nodiscard]] std::span<const std::uint8_t> payload() const noexcept {
    return {data.data(), remote ? 0u : length};
  }
  friend bool operator==(const CanFrame&, const CanFrame&) = default;
};

/// What a bus, and every drive on it, is set to: decides how frames are sent and recognised.
struct FrameFormat {
  bool fd = false;
  bool brs = false;
  friend bool operator==(const FrameFormat&, const FrameFormat&) = default;
};

/// A data frame with a standard id in the given format. Bytes beyond 64 are left out.
[[nodiscard]] inline CanFrame make_frame(std::uint32_t id, std::span<const std::uint8_t> bytes,
                                         FrameFormat format = {}) noexcept {
  CanFrame frame;
  frame.id = id;
  frame.fd = format.fd;
  frame.brs = format.fd && format.brs;
  for (const std::uint8_t byte : bytes) {
    if (frame.length == frame.data.size()) break;
    frame.data[frame.length++] = byte;
  }
  return frame;
}

/// True for a data frame with a standard id that carries exactly `length` bytes.
[[nodiscard]] inline bool is_standard_data(const CanFrame& frame, std::size_t length) noexcept {
  return !frame.extended && !frame.remote && !frame.error && frame.length == length;
}

/// DLC of ISO 11898-1 table 5 for a payload; -1: no CAN frame has this length.
[[nodiscard]] constexpr int dlc_of(std::size_t length, bool fd) noexcept {
  constexpr std::array<std::uint8_t, 16> kLengths{0, 1,  2,  3,  4,  5,  6,  7,
                                                  8, 12, 16, 20, 24, 32, 48, 64};
  const std::size_t codes = fd ? kLengths.size() : 9;
  for (std::size_t dlc = 0; dlc < codes; ++dlc)
    if (kLengths[dlc] == length) return static_cast<int>(dlc);
  return -1;
}

/// True if ISO 11898-1 knows such a frame: id range, length, flags that belong together.
[[nodiscard]] constexpr bool is_valid(const CanFrame& frame) noexcept {
  return frame.id <= (frame.extended ? kMaxExtendedId : kMaxStandardId) &&
         dlc_of(frame.length, frame.fd) >= 0 && !(frame.fd && frame.remote) &&
         (frame.fd || (!frame.brs && !frame.esi));
}

}  // namespace clamber
