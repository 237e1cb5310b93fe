// The motor bus on the CAN interfaces of a bus map: hosts, ports and what is to be said about them.
// Construction and texts: start-up thread, allocate. The bus itself: can_motor_bus.hpp.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "firmware_hal/bus_map.hpp"
#include "firmware_hal/can_motor_bus.hpp"
#include "firmware_hal/socketcan/open_ports.hpp"

namespace clamber {

class SocketCanBus {
 public:
  /// Checks the budget, opens the interfaces; no drive hears of it.
  /// @throws InputError (bus_budget.hpp, interface_check.hpp)
  explicit SocketCanBus(const BusMap& map, bool lock_step = false,
                        FrameObserver* observer = nullptr);

  [[nodiscard]] CanMotorBus& bus() { return *bus_; }
  [[nodiscard]] const BusMap& map() const { return map_; }
  [[nodiscard]] const BusHost& host(std::size_t bus) const { return *hosts_[bus]; }
  [[nodiscard]] const SocketCanPort& port(std::size_t bus) const { return *ports_.ports[bus]; }

  /// What the bus's trouble() means and what to do about it, in one line. Empty: no trouble.
  [[nodiscard]] std::string trouble() const;
  /// Drives that have a fault, one line each.
  [[nodiscard]] std::vector<std::string> faults() const;
  /// Per bus: state, replies, what was missing, late, refused, lost. With a line for the header.
  [[nodiscard]] std::string table() const;

 private:
  [[nodiscard]] std::string drive_name(std::size_t bus, int joint) const;

  BusMap map_;
  SocketCanPorts ports_;
  std::vector<std::unique_ptr<BusHost>> hosts_;
  std::unique_ptr<CanMotorBus> bus_;
};

/// "drive error (code 13)"
[[nodiscard]] std::string describe(const LinkStatus& status);

}  // namespace clamber
