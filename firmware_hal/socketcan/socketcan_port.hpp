// A CAN interface of Linux (AF_CAN, raw): a bus's transport.
// One thread. Opening: allocates, throws. From then on: allocates never, blocks never.
//
// What a raw socket cannot do: a frame that it took is the kernel's. Until it is on the wire it
// waits in the interface's queue, also while nobody acknowledges, and goes out when the bus comes
// back. Only taking the interface down empties that queue, which needs CAP_NET_ADMIN. So the owner
// of a port must not hand over a tick's frames while older ones wait (has_unsent()); then at most
// one tick's frames can ever be late, and what ends a run comes right behind them.
#pragma once

#include <sys/socket.h>
#include <sys/uio.h>

#include <array>
#include <string>

#include "firmware_hal/frame_port.hpp"

struct canfd_frame;

namespace clamber {

struct SocketCanSettings {
  std::string interface;
  bool fd = false;      ///< carries FD frames
  std::string map;      ///< file and bus, for messages
  std::string bitrate;  ///< "bitrate 1000000 ...": what `ip link` should be told, for messages
};

class SocketCanPort final : public FramePort {
 public:
  /// @throws InputError naming the interface, what is wrong with it and how to put it right: no CAN
  ///   in the kernel, permission denied, absent, of another kind, down, MTU without FD
  explicit SocketCanPort(const SocketCanSettings& settings);
  /// Takes over a connected datagram socket that carries frames as a CAN socket would: for tests.
  explicit SocketCanPort(int socket) noexcept;
  ~SocketCanPort() override;

  SendResult send(std::span<const CanFrame> frames) noexcept override;
  std::size_t receive(std::span<ReceivedFrame> into) noexcept override;
  /// With CAP_NET_ADMIN takes the interface down and up, if something is unsent: tens of
  /// milliseconds on some adapters. Without: false.
  bool discard_unsent() noexcept override;
  [[nodiscard]] bool has_unsent() noexcept override;
  void maintain(std::int64_t now_ns) noexcept override;
  [[nodiscard]] PortState state() const noexcept override { return state_; }
  [[nodiscard]] const PortCounters& counters() const noexcept override { return counters_; }

  /// The socket, to wait for; -1 while the interface is lost.
  [[nodiscard]] int descriptor() const noexcept { return socket_; }
  /// After a wait: the next receive() need not ask.
  void nothing_to_receive() noexcept { nothing_ = true; }

 private:
  static constexpr std::size_t kBatch = 32;  ///< frames per system call

  [[nodiscard]] bool open() noexcept;
  void configure() noexcept;
  void lose() noexcept;
  void take_errno(int error) noexcept;
  [[nodiscard]] bool take(std::size_t slot, std::size_t bytes, ReceivedFrame& out) noexcept;
  void take_error_frame(const canfd_frame& raw) noexcept;

  std::string interface_;
  bool fd_ = false;
  int socket_ = -1;
  bool nothing_ = false;
  PortState state_ = PortState::kActive;
  PortCounters counters_;
  std::uint32_t kernel_drops_ = 0;
  std::int64_t retry_at_ = 0;  ///< CLOCK_MONOTONIC; 0: not planned yet
  std::int64_t retry_after_ = 0;
  /// From the time of day, which the kernel stamps receptions with, to CLOCK_MONOTONIC; compared
  /// once a second by maintain().
  std::int64_t to_monotonic_ = 0;
  std::int64_t compare_clocks_at_ = 0;

  // Headers of the system calls, made once: only payloads change.
  std::array<mmsghdr, kBatch> messages_{};
  std::array<iovec, kBatch> vectors_{};
  struct alignas(8) Raw {
    std::array<std::uint8_t, 72> bytes{};
  };
  std::array<Raw, kBatch> raw_{};
  struct alignas(8) Control {
    std::array<std::uint8_t, 64> bytes{};
  };
  std::array<Control, kBatch> control_{};
};

}  // namespace clamber
