#include "firmware_hal/socketcan/interface_check.hpp"

#include <linux/can.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

/// A socket that closes itself.
class Socket {
 public:
  Socket() : descriptor_(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW)) {}
  ~Socket() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  [[nodiscard]] int descriptor() const { return descriptor_; }

  /// @return false: errno says why
  bool ask(unsigned long what, const std::string& interface, ifreq& answer) const {
    answer = {};
    std::strncpy(answer.ifr_name, interface.c_str(), IFNAMSIZ - 1);
    return ioctl(descriptor_, what, &answer) == 0;
  }

 private:
  int descriptor_;
};

[[noreturn]] void fail(const SocketCanSettings& settings, const std::string& what) {
  throw InputError((settings.map.empty() ? "" : settings.map + ": ") + "interface '" +
                   settings.interface + "': " + what);
}

/// "; there are can0, can1", for who has mistyped a name.
std::string can_interfaces(const Socket& socket) {
  std::string names;
  struct if_nameindex* all = if_nameindex();
  for (struct if_nameindex* i = all; i != nullptr && i->if_name != nullptr; ++i) {
    ifreq answer{};
    if (socket.ask(SIOCGIFHWADDR, i->if_name, answer) && answer.ifr_hwaddr.sa_family == ARPHRD_CAN)
      names += (names.empty() ? "; there are " : ", ") + std::string(i->if_name);
  }
  if (all != nullptr) if_freenameindex(all);
  return names.empty() ? "; there is no CAN interface at all" : names;
}

std::string up_command(const SocketCanSettings& settings) {
  return "ip link set " + settings.interface + " up type can " + settings.bitrate +
         " restart-ms 100 (a vcan: ip link set " + settings.interface +
         (settings.fd ? " mtu 72" : "") + " up)";
}

}  // namespace

void fail_to_open(const SocketCanSettings& settings, int error) {
  switch (error) {
    case EAFNOSUPPORT:
    case EPROTONOSUPPORT:
    case EPFNOSUPPORT:
      fail(
          settings,
          "this kernel has no CAN sockets: modprobe can_raw, or take a kernel that has them (for a "
          "rehearsal: tests/vcan/vcan_run)");
    case EPERM:
    case EACCES:
      fail(
          settings,
          "permission denied for CAN sockets: the container or sandbox forbids them (allow AF_CAN, "
          "or run outside of it)");
    case ENODEV:
    case ENXIO:
      fail(settings, "is gone: plug the adapter in again");
    case ENETDOWN:
      fail(settings, "is down: " + up_command(settings));
    default:
      fail(settings, std::string("cannot be opened: ") + std::strerror(error));
  }
}

void require_interface(const SocketCanSettings& settings) {
  const Socket socket;
  if (socket.descriptor() < 0) fail_to_open(settings, errno);
  if (settings.interface.size() >= IFNAMSIZ)
    fail(settings, "is no interface name: at most 15 characters");
  ifreq answer{};
  if (!socket.ask(SIOCGIFINDEX, settings.interface, answer))
    fail(settings, "does not exist: plug the adapter in, or for a rehearsal: ip link add " +
                       settings.interface + " type vcan" + can_interfaces(socket));
  if (socket.ask(SIOCGIFHWADDR, settings.interface, answer) &&
      answer.ifr_hwaddr.sa_family != ARPHRD_CAN)
    fail(settings, "is no CAN interface" + can_interfaces(socket));
  if (socket.ask(SIOCGIFMTU, settings.interface, answer) && settings.fd &&
      answer.ifr_mtu < static_cast<int>(CANFD_MTU))
    fail(settings, "is set to classic CAN (MTU " + std::to_string(answer.ifr_mtu) +
                       "), the bus is CAN FD: ip link set " + settings.interface + " down; " +
                       up_command(settings));
  if (socket.ask(SIOCGIFFLAGS, settings.interface, answer) && (answer.ifr_flags & IFF_UP) == 0)
    fail(settings, "is down: " + up_command(settings));
}

}  // namespace clamber
