#include "firmware_hal/socketcan/open_ports.hpp"

namespace clamber {

SocketCanSettings socketcan_settings(const BusMap& map, const Bus& bus) {
  SocketCanSettings settings;
  settings.interface = bus.interface;
  settings.fd = bus.format().fd;
  settings.map = map.file + ": bus '" + bus.name + "'";
  settings.bitrate = "bitrate " + std::to_string(bus.bitrate);
  if (settings.fd) settings.bitrate += " dbitrate " + std::to_string(bus.data_bitrate) + " fd on";
  return settings;
}

SocketCanPorts open_ports(const BusMap& map) {
  SocketCanPorts opened;
  std::vector<SocketCanPort*> waited_for;
  for (const Bus& bus : map.buses) {
    opened.ports.push_back(std::make_unique<SocketCanPort>(socketcan_settings(map, bus)));
    waited_for.push_back(opened.ports.back().get());
  }
  opened.clock = std::make_unique<SocketCanClock>(std::move(waited_for));
  return opened;
}

}  // namespace clamber
