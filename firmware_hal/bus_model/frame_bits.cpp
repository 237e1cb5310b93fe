#include "firmware_hal/bus_model/frame_bits.hpp"

namespace clamber {
namespace {

constexpr std::uint32_t kIntermission = 3;
constexpr std::uint32_t kAckAndEnd = 1 + 1 + 7;  // slot, delimiter, end of frame

/// Counts stuff bits of a bit stream as it goes by: after five equal bits comes their opposite,
/// which itself begins the next run.
class Stuffer {
 public:
  void bit(bool value) noexcept {
    ++bits_;
    run_ = value == last_ ? run_ + 1 : 1;
    last_ = value;
    if (run_ == 5) {
      ++stuffed_;
      last_ = !value;
      run_ = 1;
      ended_stuffed_ = true;
    } else {
      ended_stuffed_ = false;
    }
  }
  void bits(std::uint32_t value, int count) noexcept {
    for (int i = count - 1; i >= 0; --i) bit(((value >> i) & 1u) != 0);
  }

  [[nodiscard]] std::uint32_t count() const noexcept { return bits_; }
  [[nodiscard]] std::uint32_t stuffed() const noexcept { return stuffed_; }
  /// True if the last bit was followed by a stuff bit.
  [[nodiscard]] bool ended_stuffed() const noexcept { return ended_stuffed_; }

 private:
  std::uint32_t bits_ = 0;
  std::uint32_t stuffed_ = 0;
  int run_ = 0;
  bool last_ = true;  // the idle bus is recessive; run 0, so it does not count
  bool ended_stuffed_ = false;
};

/// CRC-15 of classic frames, polynomial 0x4599, over the bits before stuffing.
class Crc15 {
 public:
  void bits(std::uint32_t value, int count) noexcept {
    for (int i = count - 1; i >= 0; --i) {
      const bool next = (((value >> i) ^ (crc_ >> 14)) & 1u) != 0;
      crc_ = (crc_ << 1) & 0x7FFFu;
      if (next) crc_ ^= 0x4599u;
    }
  }
  [[nodiscard]] std::uint32_t value() const noexcept { return crc_; }

 private:
  std::uint32_t crc_ = 0;
};

template <typename Sink>
void classic_body(const CanFrame& frame, Sink&& put) noexcept {
  put(0u, 1);  // start of frame
  if (frame.extended) {
    put(frame.id >> 18, 11);
    put(3u, 2);  // SRR, IDE
    put(frame.id & 0x3FFFFu, 18);
    put(frame.remote ? 1u : 0u, 1);
    put(0u, 2);  // r1, r0
  } else {
    put(frame.id, 11);
    put(frame.remote ? 1u : 0u, 1);
    put(0u, 2);  // IDE, r0
  }
  put(static_cast<std::uint32_t>(dlc_of(frame.length, false)), 4);
  for (const std::uint8_t byte : frame.payload()) put(byte, 8);
}

FrameBits classic_bits(const CanFrame& frame) noexcept {
  Stuffer stuffer;
  Crc15 crc;
  classic_body(frame, [&](std::uint32_t value, int count) {
    stuffer.bits(value, count);
    crc.bits(value, count);
  });
  stuffer.bits(crc.value(), 15);
  return {stuffer.count() + stuffer.stuffed() + 1 + kAckAndEnd + kIntermission, 0,
          stuffer.stuffed()};
}

/// Stuff count with its parity (4 bits), checksum, and a fixed stuff bit before every four of them.
constexpr std::uint32_t fd_checksum_bits(std::size_t length) noexcept {
  return length <= 16 ? 4 + 17 + 6 : 4 + 21 + 7;
}

/// Bits up to and with BRS.
constexpr std::uint32_t fd_header_bits(bool extended) noexcept { return extended ? 36 : 17; }

FrameBits split(std::uint32_t header, std::uint32_t payload, std::uint32_t stuffed, bool brs) {
  FrameBits bits;
  bits.nominal = header + 1 + kAckAndEnd + kIntermission;
  (brs ? bits.data : bits.nominal) += payload;
  bits.stuffed = stuffed;
  return bits;
}

FrameBits fd_bits(const CanFrame& frame) noexcept {
  Stuffer stuffer;
  stuffer.bit(false);
  if (frame.extended) {
    stuffer.bits(frame.id >> 18, 11);
    stuffer.bits(3u, 2);
    stuffer.bits(frame.id & 0x3FFFFu, 18);
    stuffer.bit(false);  // RRS
  } else {
    stuffer.bits(frame.id, 11);
    stuffer.bits(0u, 2);  // RRS, IDE
  }
  stuffer.bits(2u, 2);  // FDF, res
  stuffer.bit(frame.brs);
  const std::uint32_t header_stuffed = stuffer.stuffed();
  const std::uint32_t header = stuffer.count() + header_stuffed;
  stuffer.bit(frame.esi);
  stuffer.bits(static_cast<std::uint32_t>(dlc_of(frame.length, true)), 4);
  for (const std::uint8_t byte : frame.payload()) stuffer.bits(byte, 8);
  // A run that five bits complete at the very end is broken by the first fixed stuff bit already.
  const std::uint32_t stuffed = stuffer.stuffed() - (stuffer.ended_stuffed() ? 1 : 0);
  const std::uint32_t payload = stuffer.count() + stuffed - header + fd_checksum_bits(frame.length);
  return split(header, payload, stuffed, frame.brs);
}

}  // namespace

FrameBits exact_bits(const CanFrame& frame) noexcept {
  if (!is_valid(frame) || frame.error) return {};
  return frame.fd ? fd_bits(frame) : classic_bits(frame);
}

FrameBits worst_bits(std::size_t length, FrameFormat format, bool extended) noexcept {
  const auto bytes = static_cast<std::uint32_t>(8 * length);
  if (!format.fd) {
    const std::uint32_t open = (extended ? 54u : 34u) + bytes;
    const std::uint32_t stuffed = (open - 1) / 4;
    return {open + stuffed + 1 + kAckAndEnd + kIntermission, 0, stuffed};
  }
  const std::uint32_t header = fd_header_bits(extended);
  const std::uint32_t stuffed = (header + 5 + bytes - 2) / 4;
  const std::uint32_t in_header = (header - 1) / 4;
  return split(header + in_header, 5 + bytes + stuffed - in_header + fd_checksum_bits(length),
               stuffed, format.brs);
}

std::uint32_t arbitration_key(const CanFrame& frame) noexcept {
  const std::uint32_t rtr = frame.remote ? 1u : 0u;
  if (!frame.extended) return frame.id << 21 | rtr << 20;
  return (frame.id >> 18) << 21 | 1u << 20 | 1u << 19 | (frame.id & 0x3FFFFu) << 1 | rtr;
}

}  // namespace clamber
