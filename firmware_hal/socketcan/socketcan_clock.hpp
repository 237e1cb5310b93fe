// CLOCK_MONOTONIC and waiting for several CAN interfaces at once.
// One thread, the ports'; allocates: never after the ports are known; wait() blocks, nothing else.
#pragma once

#include <poll.h>

#include <vector>

#include "firmware_hal/socketcan/socketcan_port.hpp"

namespace clamber {

class SocketCanClock final : public PortClock {
 public:
  /// The ports must outlive the clock.
  explicit SocketCanClock(std::vector<SocketCanPort*> ports);

  [[nodiscard]] std::int64_t now_ns() noexcept override;
  void wait(std::int64_t until_ns) noexcept override;
  void wait_for(FramePort& port, std::int64_t until_ns) noexcept override;

 private:
  [[nodiscard]] int poll(std::span<pollfd> polled, std::int64_t until_ns) noexcept;

  std::vector<SocketCanPort*> ports_;
  std::vector<pollfd> polled_;
};

/// Keeps the calling thread on the processor that it is on. Frames that a thread sends over a vcan
/// arrive in their order only as long as it stays there: each processor has a queue of its own.
/// @return false: not permitted
bool stay_on_this_processor() noexcept;

}  // namespace clamber
