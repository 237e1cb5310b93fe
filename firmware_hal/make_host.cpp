#include "firmware_hal/make_host.hpp"

#include "firmware_hal/codec/cia402_host.hpp"
#include "firmware_hal/codec/mit_host.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

Mounting mounting(const JointDrive& drive) { return {drive.joint, drive.direction, drive.zero}; }

void require_room(bool added, const BusMap& map, const Bus& bus) {
  if (!added)
    throw InputError(map.file + ": bus '" + bus.name + "': more than " +
                     std::to_string(kMaxDrives) + " drives; spread them over several buses");
}

}  // namespace

std::unique_ptr<BusHost> make_host(const BusMap& map, const Bus& bus) {
  if (bus.protocol == BusProtocol::kMit) {
    auto host = std::make_unique<MitHost>(1.0 / map.rate);
    for (const JointDrive& drive : bus.drives)
      require_room(
          host->add_drive(mit_drive(bus, drive), mounting(drive), drive.motor.mit.watchdog), map,
          bus);
    return host;
  }
  auto host = std::make_unique<Cia402Host>(
      Cia402HostSettings{1.0 / map.rate, bus.heartbeat, bus.host_node, bus.lost_host});
  for (const JointDrive& drive : bus.drives) {
    const Cia402Motor& motor = drive.motor.cia402;
    require_room(host->add_drive(cia402_drive(bus, drive), mounting(drive),
                                 motor.rated_torque / motor.gear_ratio),
                 map, bus);
  }
  return host;
}

}  // namespace clamber
