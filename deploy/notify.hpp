// What a service tells its service manager: the sd_notify protocol, datagrams to $NOTIFY_SOCKET.
// One thread; allocates; blocks: never. Without a manager nothing is sent.
#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace clamber {

class Notifier {
 public:
  /// From the environment: NOTIFY_SOCKET, and WATCHDOG_USEC if it is meant for this process.
  Notifier();
  ~Notifier();
  Notifier(const Notifier&) = delete;
  Notifier& operator=(const Notifier&) = delete;

  /// Lines such as "READY=1". A manager that does not read in time misses one.
  void send(const std::string& lines) const;
  /// The time within which the manager expects "WATCHDOG=1"; nothing: it does not.
  [[nodiscard]] std::optional<std::chrono::microseconds> watchdog() const { return watchdog_; }

 private:
  int fd_ = -1;
  std::optional<std::chrono::microseconds> watchdog_;
};

}  // namespace clamber
