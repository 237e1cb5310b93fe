// How many bits a frame takes on the wire, exactly and at worst (ISO 11898-1:2015, 10.4 and 10.5).
// Any thread; allocates: never; blocks: never.
#pragma once

#include <cstdint>

#include "firmware_hal/can_frame.hpp"

namespace clamber {

/// Bits from start of frame to the end of the intermission (3 bits), split by bit rate. A classic
/// frame and an FD frame without BRS have nominal bits only. BRS itself and the CRC delimiter, in
/// whose middle the rate changes, count as nominal: the real frame is shorter by less than 2 bits.
struct FrameBits {
  std::uint32_t nominal = 0;
  std::uint32_t data = 0;
  std::uint32_t stuffed = 0;  ///< of these: dynamic stuff bits (FD's fixed stuff bits not counted)

  [[nodiscard]] std::uint32_t total() const noexcept { return nominal + data; }
};

/// Bits of this very frame: depends on id, payload and, for classic frames, the checksum.
/// A frame that is not valid (is_valid) takes no bits.
[[nodiscard]] FrameBits exact_bits(const CanFrame& frame) noexcept;

/// Bits of the worst id and payload of this kind and length: one stuff bit after the first five and
/// then after every four bits (R. I. Davis et al., Real-Time Systems 35, 2007, equation (1), and
/// the same argument for FD, whose checksum has fixed stuff bits).
/// @param length a length that CAN knows (dlc_of)
[[nodiscard]] FrameBits worst_bits(std::size_t length, FrameFormat format,
                                   bool extended = false) noexcept;

/// Bit times in whole nanoseconds, so that simulated time has no rounding.
struct BitTiming {
  std::uint32_t nominal_ns = 1000;
  std::uint32_t data_ns = 1000;
};

[[nodiscard]] inline std::uint64_t duration_ns(const FrameBits& bits, BitTiming timing) noexcept {
  return std::uint64_t{bits.nominal} * timing.nominal_ns +
         std::uint64_t{bits.data} * timing.data_ns;
}

/// Arbitration (ISO 11898-1, 10.3.2): of frames that start together the smallest key wins. Base id,
/// then RTR or SRR, then IDE, then the extension and its RTR.
[[nodiscard]] std::uint32_t arbitration_key(const CanFrame& frame) noexcept;

}  // namespace clamber
