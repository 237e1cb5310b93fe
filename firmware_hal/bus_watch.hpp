// What passes on one bus of a map, seen by a listener: load, who commands, who answers, how old.
// One thread; allocates: in the constructor and for ids of strangers; blocks: never. No sockets.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "firmware_hal/bus_map.hpp"
#include "firmware_hal/frame_port.hpp"

namespace clamber {

struct WatchedDrive {
  std::uint64_t commands = 0;
  std::uint64_t replies = 0;
  std::int64_t last_reply_ns = 0;  ///< 0: none ever
  double q = 0.0;                  ///< rad, of the joint
  double tau = 0.0;                ///< N m, of the joint
  std::string state;               ///< "on", "off", "error 13", "operation enabled"
};

class BusWatch {
 public:
  /// `bus` must outlive it.
  explicit BusWatch(const Bus& bus) : bus_(bus), drives_(bus.drives.size()) {}

  void take(const ReceivedFrame& received);

  [[nodiscard]] const Bus& bus() const { return bus_; }
  /// By drive, in the order of the bus map.
  [[nodiscard]] const WatchedDrive& drive(std::size_t i) const { return drives_[i]; }
  [[nodiscard]] std::uint64_t frames() const { return frames_; }
  /// Time that all frames took on the wire, with their real stuff bits, at the map's bit rates.
  [[nodiscard]] std::int64_t busy_ns() const { return busy_ns_; }
  [[nodiscard]] std::uint64_t malformed() const { return malformed_; }
  /// Frames of nobody in the map, by id.
  [[nodiscard]] const std::map<std::uint32_t, std::uint64_t>& strangers() const {
    return strangers_;
  }

 private:
  void take_mit(const ReceivedFrame& received);
  void take_cia402(const ReceivedFrame& received);
  void note_reply(std::size_t drive, std::int64_t time_ns, double q, double tau);

  const Bus& bus_;
  std::vector<WatchedDrive> drives_;
  std::uint64_t frames_ = 0;
  std::int64_t busy_ns_ = 0;
  std::uint64_t malformed_ = 0;
  std::map<std::uint32_t, std::uint64_t> strangers_;
};

}  // namespace clamber
