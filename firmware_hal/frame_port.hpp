// One bus's transport seen from above: frames out, frames in, what is unsent, how the link is.
// One thread; allocates: never; blocks: never. Waiting is the clock's affair, for all ports at
// once.
#pragma once

#include <cstdint>
#include <span>

#include "firmware_hal/can_frame.hpp"

namespace clamber {

struct ReceivedFrame {
  CanFrame frame;            ///< never an error frame: those become the port's state
  std::int64_t time_ns = 0;  ///< reception, on the PortClock that goes with the port
};

enum class SendStatus : std::uint8_t {
  kOk,    ///< all frames are queued
  kFull,  ///< no room for the rest now (ENOBUFS): offer it again, or give it up
  kDown,  ///< interface down or gone: the rest is lost
};

struct SendResult {
  std::size_t sent = 0;  ///< of the frames given, in order
  SendStatus status = SendStatus::kOk;
};

enum class PortState : std::uint8_t {
  kActive,
  kWarning,  ///< an error counter from 96
  kPassive,  ///< from 128
  kBusOff,   ///< from 256: neither sends nor receives until restarted
  kDown,     ///< no interface, or it is down
};

[[nodiscard]] constexpr const char* to_string(PortState state) noexcept {
  switch (state) {
    case PortState::kActive:
      return "active";
    case PortState::kWarning:
      return "warning";
    case PortState::kPassive:
      return "passive";
    case PortState::kBusOff:
      return "bus-off";
    case PortState::kDown:
      return "down";
  }
  return "?";
}

struct PortCounters {
  std::uint64_t sent = 0;
  std::uint64_t received = 0;
  std::uint64_t refused = 0;       ///< send() calls that ended with kFull
  std::uint64_t discarded = 0;     ///< queued frames taken back by discard_unsent()
  std::uint64_t overruns = 0;      ///< receptions lost: receive queue full
  std::uint64_t malformed = 0;     ///< receptions that are no CAN frame
  std::uint64_t error_frames = 0;  ///< the controller's reports about the bus
  std::uint64_t bus_offs = 0;
  std::uint64_t restarts = 0;  ///< back from bus-off
  std::uint64_t losses = 0;    ///< times the interface went down or away
  std::uint64_t reopened = 0;  ///< times it was taken back
};

class FramePort {
 public:
  FramePort() = default;
  FramePort(const FramePort&) = delete;
  FramePort& operator=(const FramePort&) = delete;
  virtual ~FramePort() = default;

  /// Queues as many of the frames as there is room for, in order.
  virtual SendResult send(std::span<const CanFrame> frames) noexcept = 0;
  /// Takes what has been received by now, oldest first. @return how many of `into` were filled;
  /// fewer than its size: there are no more for now
  virtual std::size_t receive(std::span<ReceivedFrame> into) noexcept = 0;
  /// Takes back what was queued and is not on the wire yet, as far as the transport can.
  /// @return false: it cannot, and something may still be sent
  virtual bool discard_unsent() noexcept = 0;
  /// Something queued has not been sent yet. Costs a system call: ask only in doubt.
  [[nodiscard]] virtual bool has_unsent() noexcept = 0;
  /// Once a tick: takes back an interface that was lost, at most so often (back-off).
  virtual void maintain(std::int64_t now_ns) noexcept = 0;

  [[nodiscard]] virtual PortState state() const noexcept = 0;
  [[nodiscard]] virtual const PortCounters& counters() const noexcept = 0;
};

/// The time of several ports, and waiting for all of them. On sockets: CLOCK_MONOTONIC and poll();
/// on a bus model: simulated time, which waiting advances.
class PortClock {
 public:
  PortClock() = default;
  PortClock(const PortClock&) = delete;
  PortClock& operator=(const PortClock&) = delete;
  virtual ~PortClock() = default;

  [[nodiscard]] virtual std::int64_t now_ns() noexcept = 0;
  /// Returns when some port may have received something, at `until_ns` at the latest. May return
  /// early for nothing. This and the next are the calls of this page that block.
  virtual void wait(std::int64_t until_ns) noexcept = 0;
  /// The same for one port, to spare wake-ups for the others where all are needed in the end.
  virtual void wait_for(FramePort& port, std::int64_t until_ns) noexcept {
    (void)port;
    wait(until_ns);
  }
};

}  // namespace clamber
