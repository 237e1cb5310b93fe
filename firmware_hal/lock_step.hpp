// Lock step over CAN: how host and simulated drives agree on where a tick ends, in frames.
// Any thread; allocates: never; blocks: never. Simulated drives only: real ones never see these.
//
// Every tick, on every bus: the host sends its frames, then "sent" with the tick's number. When the
// drives have "sent" of this tick from every bus, they let the tick pass, send all that they have
// to say on each bus, and last, on each bus, "done" with the same number. The host's tick ends when
// it has "done" from every bus. So a frame that is missing on purpose stops nobody, ticks in which
// nobody owes a reply last as long as any other, and nothing depends on who is faster.
//
// Number 0 is the handshake: nothing passes in it, the host repeats it until it is answered on
// every bus, and drives answer every one. A "sent" of the tick that was last is answered again as
// well.
#pragma once

#include <cstdint>

#include "firmware_hal/can_frame.hpp"

namespace clamber {

enum class LockStepMark : std::uint8_t { kNone, kSent, kDone };

// The least urgent ids there are: on a bus with arbitration they come behind all that they close.
inline constexpr std::uint32_t kLockStepSentId = 0x1FFFFFFE;
inline constexpr std::uint32_t kLockStepDoneId = 0x1FFFFFFF;

/// A classic frame on every bus. @param mark kSent or kDone
[[nodiscard]] inline CanFrame encode_lock_step(LockStepMark mark, std::uint32_t tick) noexcept {
  CanFrame frame;
  frame.id = mark == LockStepMark::kSent ? kLockStepSentId : kLockStepDoneId;
  frame.extended = true;
  frame.length = 4;
  for (unsigned i = 0; i < 4; ++i) frame.data[i] = static_cast<std::uint8_t>(tick >> (8 * i));
  return frame;
}

/// @return kNone: another frame; `tick` is then untouched
[[nodiscard]] inline LockStepMark decode_lock_step(const CanFrame& frame,
                                                   std::uint32_t& tick) noexcept {
  if (!frame.extended || frame.remote || frame.error || frame.fd || frame.length != 4)
    return LockStepMark::kNone;
  if (frame.id != kLockStepSentId && frame.id != kLockStepDoneId) return LockStepMark::kNone;
  tick = 0;
  for (unsigned i = 0; i < 4; ++i) tick |= std::uint32_t{frame.data[i]} << (8 * i);
  return frame.id == kLockStepSentId ? LockStepMark::kSent : LockStepMark::kDone;
}

}  // namespace clamber
