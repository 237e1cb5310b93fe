#include "firmware_hal/socketcan/socketcan_port.hpp"

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/sock_diag.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "firmware_hal/socketcan/error_frame.hpp"
#include "firmware_hal/socketcan/interface_check.hpp"

namespace clamber {
namespace {

static_assert(CANFD_MTU == 72);

constexpr std::int64_t kNanoseconds = 1'000'000'000;
constexpr std::int64_t kFirstRetry = 10'000'000;  // ns, doubled up to kLastRetry
constexpr std::int64_t kLastRetry = 1'000'000'000;
// More than a second of all that a full FD bus can carry: what is lost beyond that is counted.
constexpr int kReceiveBuffer = 8 << 20;

std::int64_t nanoseconds(const timespec& t) noexcept {
  return static_cast<std::int64_t>(t.tv_sec) * kNanoseconds + t.tv_nsec;
}

std::int64_t now_on(clockid_t clock) noexcept {
  timespec t{};
  clock_gettime(clock, &t);
  return nanoseconds(t);
}

/// A frame as the kernel takes it. @return its size in bytes
std::size_t to_raw(const CanFrame& frame, canfd_frame& raw) noexcept {
  raw = {};
  raw.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0u) | (frame.remote ? CAN_RTR_FLAG : 0u);
  raw.len = frame.length;
  if (frame.fd)
    raw.flags =
        static_cast<std::uint8_t>((frame.brs ? CANFD_BRS : 0) | (frame.esi ? CANFD_ESI : 0));
  std::memcpy(raw.data, frame.data.data(), std::min<std::size_t>(frame.length, sizeof raw.data));
  return frame.fd ? CANFD_MTU : CAN_MTU;
}

/// @return false: no frame of ISO 11898-1
bool from_raw(const canfd_frame& raw, bool fd, CanFrame& frame) noexcept {
  frame.extended = (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.remote = (raw.can_id & CAN_RTR_FLAG) != 0;
  frame.error = false;
  frame.id = raw.can_id & (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.fd = fd;
  frame.brs = fd && (raw.flags & CANFD_BRS) != 0;
  frame.esi = fd && (raw.flags & CANFD_ESI) != 0;
  frame.length = raw.len;
  if (!is_valid(frame)) return false;
  frame.data = {};
  if (!frame.remote) std::memcpy(frame.data.data(), raw.data, frame.length);
  return true;
}

bool set_flags(int socket, const std::string& interface, bool up) noexcept {
  ifreq request{};
  std::strncpy(request.ifr_name, interface.c_str(), IFNAMSIZ - 1);
  if (ioctl(socket, SIOCGIFFLAGS, &request) != 0) return false;
  request.ifr_flags =
      static_cast<short>(up ? request.ifr_flags | IFF_UP : request.ifr_flags & ~IFF_UP);
  return ioctl(socket, SIOCSIFFLAGS, &request) == 0;
}

}  // namespace

SocketCanPort::SocketCanPort(const SocketCanSettings& settings)
    : interface_(settings.interface), fd_(settings.fd) {
  require_interface(settings);
  errno = 0;
  if (!open()) fail_to_open(settings, errno);
}

SocketCanPort::SocketCanPort(int socket) noexcept : fd_(true), socket_(socket) { configure(); }

SocketCanPort::~SocketCanPort() {
  if (socket_ >= 0) close(socket_);
}

/// @return false: see errno. Leaves no socket behind then
bool SocketCanPort::open() noexcept {
  socket_ = ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (socket_ < 0) return false;
  configure();
  ifreq request{};
  std::strncpy(request.ifr_name, interface_.c_str(), IFNAMSIZ - 1);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  bool ready = ioctl(socket_, SIOCGIFINDEX, &request) == 0;
  if (ready) {
    address.can_ifindex = request.ifr_ifindex;
    ready = ioctl(socket_, SIOCGIFFLAGS, &request) == 0;
  }
  if (ready && (request.ifr_flags & IFF_UP) == 0) {
    errno = ENETDOWN;
    ready = false;
  }
  ready = ready && bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  if (ready) {
    state_ = PortState::kActive;
    retry_at_ = 0;
    retry_after_ = 0;
    return true;
  }
  const int error = errno;
  close(socket_);
  socket_ = -1;
  errno = error;
  return false;
}

void SocketCanPort::configure() noexcept {
  to_monotonic_ = now_on(CLOCK_MONOTONIC) - now_on(CLOCK_REALTIME);
  const auto set = [this](int level, int option, const auto& value) {
    // What an older kernel does not know shows in the counters, not here.
    (void)setsockopt(socket_, level, option, &value, sizeof value);
  };
  const int on = 1;
  if (fd_) set(SOL_CAN_RAW, CAN_RAW_FD_FRAMES, on);
  set(SOL_CAN_RAW, CAN_RAW_ERR_FILTER, can_err_mask_t{CAN_ERR_MASK});
  set(SOL_SOCKET, SO_TIMESTAMPNS, on);
  set(SOL_SOCKET, SO_RXQ_OVFL, on);
  set(SOL_SOCKET, SO_RCVBUF, kReceiveBuffer);
  kernel_drops_ = 0;
  for (std::size_t i = 0; i < kBatch; ++i) vectors_[i] = {raw_[i].bytes.data(), CANFD_MTU};
}

void SocketCanPort::lose() noexcept {
  if (socket_ >= 0) close(socket_);
  socket_ = -1;
  if (state_ != PortState::kDown) ++counters_.losses;
  state_ = PortState::kDown;
  retry_at_ = 0;
}

void SocketCanPort::take_errno(int error) noexcept {
  switch (error) {
    case EAGAIN:
    case EINTR:
    case ENOBUFS:
      return;
    default:  // ENETDOWN, ENODEV, ENXIO and what else leaves no way to go on with this socket
      lose();
  }
}

SendResult SocketCanPort::send(std::span<const CanFrame> frames) noexcept {
  SendResult result;
  while (result.sent < frames.size()) {
    if (socket_ < 0) return {result.sent, SendStatus::kDown};
    const std::size_t count = std::min(frames.size() - result.sent, kBatch);
    for (std::size_t i = 0; i < count; ++i) {
      auto* raw = reinterpret_cast<canfd_frame*>(raw_[i].bytes.data());
      messages_[i] = {};
      vectors_[i].iov_len = to_raw(frames[result.sent + i], *raw);
      messages_[i].msg_hdr.msg_iov = &vectors_[i];
      messages_[i].msg_hdr.msg_iovlen = 1;
    }
    const int sent =
        sendmmsg(socket_, messages_.data(), static_cast<unsigned>(count), MSG_DONTWAIT);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) {
      take_errno(errno);
      if (socket_ < 0) return {result.sent, SendStatus::kDown};
      ++counters_.refused;
      return {result.sent, SendStatus::kFull};
    }
    // Fewer than asked: the next call says why.
    result.sent += static_cast<std::size_t>(sent);
    counters_.sent += static_cast<std::uint64_t>(sent);
  }
  return result;
}

std::size_t SocketCanPort::receive(std::span<ReceivedFrame> into) noexcept {
  std::size_t filled = 0;
  const bool ask = !std::exchange(nothing_, false);
  while (ask && socket_ >= 0 && filled < into.size()) {
    const std::size_t count = std::min(into.size() - filled, kBatch);
    for (std::size_t i = 0; i < count; ++i) {
      messages_[i] = {};
      vectors_[i].iov_len = CANFD_MTU;
      messages_[i].msg_hdr.msg_iov = &vectors_[i];
      messages_[i].msg_hdr.msg_iovlen = 1;
      messages_[i].msg_hdr.msg_control = control_[i].bytes.data();
      messages_[i].msg_hdr.msg_controllen = control_[i].bytes.size();
    }
    const int received =
        recvmmsg(socket_, messages_.data(), static_cast<unsigned>(count), MSG_DONTWAIT, nullptr);
    if (received < 0 && errno == EINTR) continue;
    if (received < 0) {
      take_errno(errno);
      break;
    }
    for (std::size_t i = 0; i < static_cast<std::size_t>(received); ++i)
      if (take(i, messages_[i].msg_len, into[filled])) ++filled;
    if (static_cast<std::size_t>(received) < count) break;
  }
  return filled;
}

/// One received message. @return false: it holds no frame for `out`
bool SocketCanPort::take(std::size_t slot, std::size_t bytes, ReceivedFrame& out) noexcept {
  msghdr& header = messages_[slot].msg_hdr;
  out.time_ns = 0;
  for (cmsghdr* c = CMSG_FIRSTHDR(&header); c != nullptr; c = CMSG_NXTHDR(&header, c)) {
    if (c->cmsg_level != SOL_SOCKET) continue;
    if (c->cmsg_type == SO_TIMESTAMPNS) {
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(c), sizeof stamp);
      out.time_ns = nanoseconds(stamp) + to_monotonic_;
    } else if (c->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t drops = 0;
      std::memcpy(&drops, CMSG_DATA(c), sizeof drops);
      counters_.overruns += drops - kernel_drops_;  // modulo 2^32, as it counts
      kernel_drops_ = drops;
    }
  }
  if (out.time_ns == 0) out.time_ns = now_on(CLOCK_MONOTONIC);
  const auto& raw = *reinterpret_cast<const canfd_frame*>(raw_[slot].bytes.data());
  if (bytes != CAN_MTU && bytes != CANFD_MTU) {
    ++counters_.malformed;
    return false;
  }
  if ((raw.can_id & CAN_ERR_FLAG) != 0) {
    take_error_frame(raw);
    return false;
  }
  if (!from_raw(raw, bytes == CANFD_MTU, out.frame)) {
    ++counters_.malformed;
    return false;
  }
  // Some adapters come back from bus-off without saying so: who hears is back.
  if (state_ == PortState::kBusOff) {
    state_ = PortState::kActive;
    ++counters_.restarts;
  }
  ++counters_.received;
  return true;
}

void SocketCanPort::take_error_frame(const canfd_frame& raw) noexcept {
  ++counters_.error_frames;
  std::array<std::uint8_t, 8> data{};
  std::memcpy(data.data(), raw.data, data.size());
  const ErrorReport report = read_error_frame(raw.can_id & CAN_ERR_MASK, data);
  if (report.overflow) ++counters_.overruns;
  if (!report.state) return;
  const PortState before = std::exchange(state_, *report.state);
  if (state_ == PortState::kBusOff && before != PortState::kBusOff) ++counters_.bus_offs;
  if (before == PortState::kBusOff && state_ != PortState::kBusOff) ++counters_.restarts;
}

bool SocketCanPort::has_unsent() noexcept {
  if (socket_ < 0) return false;
  // A queued frame stays charged to its socket until the driver has sent it.
  std::array<std::uint32_t, SK_MEMINFO_VARS> memory{};
  socklen_t size = sizeof memory;
  if (getsockopt(socket_, SOL_SOCKET, SO_MEMINFO, memory.data(), &size) != 0) return false;
  return memory[SK_MEMINFO_WMEM_ALLOC] > 0;
}

bool SocketCanPort::discard_unsent() noexcept {
  if (!has_unsent()) return true;
  if (interface_.empty() || !set_flags(socket_, interface_, false)) return false;
  const bool up = set_flags(socket_, interface_, true);
  int error = 0;
  socklen_t size = sizeof error;
  (void)getsockopt(socket_, SOL_SOCKET, SO_ERROR, &error, &size);  // our own doing
  if (!up) lose();
  if (has_unsent()) return false;
  ++counters_.discarded;
  return true;
}

void SocketCanPort::maintain(std::int64_t now_ns) noexcept {
  if (now_ns >= compare_clocks_at_) {
    to_monotonic_ = now_on(CLOCK_MONOTONIC) - now_on(CLOCK_REALTIME);
    compare_clocks_at_ = now_ns + kNanoseconds;
  }
  if (state_ != PortState::kDown || interface_.empty()) return;
  if (retry_at_ == 0) {
    retry_after_ = kFirstRetry;
    retry_at_ = now_ns + retry_after_;
  }
  if (now_ns < retry_at_) return;
  if (open()) {
    ++counters_.reopened;
    return;
  }
  retry_after_ = std::min(2 * retry_after_, kLastRetry);
  retry_at_ = now_ns + retry_after_;
}

}  // namespace clamber
