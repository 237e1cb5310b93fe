// Real RTPS datagrams, heard on the loopback, and what becomes of them when bytes change on the
// way.
#pragma once

#include <arpa/inet.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <thread>
#include <vector>

namespace clamber::test {

using Datagram = std::vector<std::uint8_t>;

/// RTPS standard, 9.6.2.3.
inline int port_of(int domain, int offset) { return 7400 + 250 * domain + offset; }

/// Looks at everything on the loopback; where that is not allowed, at what is sent to a participant
/// that does not exist: announcements only.
class Listener {
 public:
  explicit Listener(int domain) : domain_(domain) {
    socket_ = socket(AF_PACKET, SOCK_DGRAM | SOCK_NONBLOCK, htons(ETH_P_IP));
    raw_ = socket_ >= 0;
    if (raw_) return;
    socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port_of(domain, 10 + 2 * 9)));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0)
      throw std::runtime_error("no port to listen to");
  }
  ~Listener() { close(socket_); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  std::vector<Datagram> hear(std::chrono::milliseconds time, std::size_t at_most) {
    std::vector<Datagram> heard;
    const auto until = std::chrono::steady_clock::now() + time;
    while (std::chrono::steady_clock::now() < until && heard.size() < at_most) {
      Datagram packet(65536);
      const ssize_t size = recv(socket_, packet.data(), packet.size(), 0);
      if (size <= 0) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        continue;
      }
      packet.resize(static_cast<std::size_t>(size));
      if (raw_ && !strip_headers(packet)) continue;
      if (packet.size() > 20 && std::equal(packet.begin(), packet.begin() + 4, "RTPS"))
        heard.push_back(std::move(packet));
    }
    return heard;
  }

 private:
  /// @return it was UDP, to a port of the domain
  bool strip_headers(Datagram& packet) const {
    if (packet.size() < 28 || packet[9] != IPPROTO_UDP) return false;
    const std::size_t ip = 4U * (packet[0] & 15U);
    if (packet.size() < ip + 8) return false;
    const int port = packet[ip + 2] * 256 + packet[ip + 3];
    packet.erase(packet.begin(), packet.begin() + static_cast<std::ptrdiff_t>(ip + 8));
    return port >= port_of(domain_, 0) && port < port_of(domain_ + 1, 0);
  }

  int domain_;
  int socket_ = -1;
  bool raw_ = false;
};

/// Changes, cuts or lengthens a real datagram, most often behind the header that gets it looked at.
inline Datagram mutated(Datagram datagram, std::mt19937& random) {
  const auto pick = [&random](std::size_t below) {
    return std::uniform_int_distribution<std::size_t>(0, below - 1)(random);
  };
  const std::size_t changes = 1 + pick(8);
  const std::size_t first = pick(8) == 0 ? 0 : 20;
  for (std::size_t i = 0; i < changes; ++i)
    datagram[first + pick(datagram.size() - first)] = static_cast<std::uint8_t>(pick(256));
  if (pick(4) == 0) datagram.resize(4 + pick(datagram.size() - 4));
  if (pick(8) == 0)
    datagram.insert(datagram.end(), pick(2000), static_cast<std::uint8_t>(pick(256)));
  return datagram;
}

/// To all of the first participants' ports, multicast's among them.
inline void send_to_all(const std::vector<Datagram>& datagrams, int domain) {
  const int out = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  for (const Datagram& datagram : datagrams)
    for (const int offset : {0, 1, 10, 11, 12, 13, 14, 15}) {
      address.sin_port = htons(static_cast<std::uint16_t>(port_of(domain, offset)));
      static_cast<void>(sendto(out, datagram.data(), datagram.size(), 0,
                               reinterpret_cast<sockaddr*>(&address), sizeof address));
    }
  close(out);
}

}  // namespace clamber::test
