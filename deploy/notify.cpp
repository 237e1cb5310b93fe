#include "deploy/notify.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

/// @throws InputError when the path cannot be one
int connect_to_manager(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if ((path[0] != '/' && path[0] != '@') || path.size() >= sizeof address.sun_path)
    throw InputError("NOTIFY_SOCKET: expected a path or @NAME, found " + path);
  std::memcpy(&address.sun_path[0], path.data(), path.size());
  if (path[0] == '@') address.sun_path[0] = '\0';  // an abstract name
  const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size());
  if (fd < 0 || connect(fd, reinterpret_cast<const sockaddr*>(&address), size) != 0) {
    const std::string why = std::strerror(errno);
    if (fd >= 0) close(fd);
    throw InputError("NOTIFY_SOCKET " + path + ": " + why);
  }
  return fd;
}

}  // namespace

Notifier::Notifier() {
  const std::string path = variable("NOTIFY_SOCKET");
  if (path.empty()) return;
  fd_ = connect_to_manager(path);
  const std::string pid = variable("WATCHDOG_PID"), time = variable("WATCHDOG_USEC");
  if (!time.empty() && (pid.empty() || pid == std::to_string(getpid())))
    watchdog_ = std::chrono::microseconds(std::strtoll(time.c_str(), nullptr, 10));
}

Notifier::~Notifier() {
  if (fd_ >= 0) close(fd_);
}

void Notifier::send(const std::string& lines) const {
  if (fd_ >= 0)
    static_cast<void>(::send(fd_, lines.data(), lines.size(), MSG_NOSIGNAL | MSG_DONTWAIT));
}

}  // namespace clamber
