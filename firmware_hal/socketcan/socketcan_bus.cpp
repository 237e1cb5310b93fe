#include "firmware_hal/socketcan/socketcan_bus.hpp"

#include <array>
#include <cstdio>

#include "firmware_hal/bus_model/bus_budget.hpp"
#include "firmware_hal/make_host.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

unsigned long long number(std::uint64_t value) { return value; }

}  // namespace

SocketCanBus::SocketCanBus(const BusMap& map, bool lock_step, FrameObserver* observer) : map_(map) {
  require_budget(map_);
  if (map_.buses.size() > kMaxBuses)
    throw InputError(map_.file + ": hal: buses: more than " + std::to_string(kMaxBuses));
  ports_ = open_ports(map_);
  std::vector<CanSegment> segments;
  for (std::size_t i = 0; i < map_.buses.size(); ++i) {
    hosts_.push_back(make_host(map_, map_.buses[i]));
    segments.push_back({hosts_.back().get(), ports_.ports[i].get()});
  }
  CanBusSettings settings;
  settings.joint_count = map_.joint_count;
  settings.tick = 1.0 / map_.rate;
  settings.lock_step = lock_step;
  settings.observer = observer;
  bus_ = std::make_unique<CanMotorBus>(settings, *ports_.clock, segments);
}

std::string describe(const LinkStatus& status) {
  std::string text = to_string(status.fault);
  if (status.code != 0) {
    std::array<char, 32> code{};
    std::snprintf(code.data(), code.size(), " (code 0x%X)", status.code);
    text += code.data();
  }
  return text;
}

std::string SocketCanBus::drive_name(std::size_t bus, int joint) const {
  const Bus& segment = map_.buses[bus];
  std::string text = "bus '" + segment.name + "' (" + segment.interface + ")";
  for (const JointDrive& drive : segment.drives)
    if (drive.joint == joint)
      text += ": joint " + drive.name + " (node " + std::to_string(drive.node) + ")";
  return text;
}

std::string SocketCanBus::trouble() const {
  const BusTroubleReport& report = bus_->trouble();
  const std::string where = map_.file + ": " + drive_name(report.bus, report.joint);
  switch (report.what) {
    case BusTrouble::kNone:
      return {};
    case BusTrouble::kJointSilent:
      return where +
             " does not answer: check its power, its node id, the wiring and both bit rates "
             "(clamber bus scan shows who answers)";
    case BusTrouble::kDriveFault:
      return where + ": " + describe(report.link);
    case BusTrouble::kNotEnabled:
      return where + " does not switch on" +
             (report.link.fault == LinkFault::kNone ? "" : ": " + describe(report.link));
    case BusTrouble::kNoBus:
      return map_.file + ": every bus is down or bus-off: check the adapters";
    case BusTrouble::kNoPartner:
      return where +
             ": nobody answers in lock step: start `clamber drives` with the same bus map and in "
             "lock step, or run in real time";
    case BusTrouble::kGivenUp:
      return map_.file + ": stopped while the drives were being switched on; they are off";
  }
  return {};
}

std::vector<std::string> SocketCanBus::faults() const {
  std::vector<std::string> lines;
  for (std::size_t b = 0; b < hosts_.size(); ++b)
    for (std::size_t d = 0; d < hosts_[b]->size(); ++d)
      if (const LinkStatus status = hosts_[b]->status(d); status.phase == LinkPhase::kFault)
        lines.push_back(drive_name(b, hosts_[b]->joint(d)) + ": " + describe(status));
  return lines;
}

std::string SocketCanBus::table() const {
  std::string text =
      "bus              interface  state      replies  missing    late  unsent  held  errors"
      "  slowest us\n";
  for (std::size_t b = 0; b < hosts_.size(); ++b) {
    const HostCounters& host = hosts_[b]->counters();
    const SegmentCounters& segment = bus_->segment_counters(b);
    const SocketCanPort& port = *ports_.ports[b];
    std::array<char, 200> line{};
    std::snprintf(
        line.data(), line.size(), "%-16s %-10s %-8s %9llu %8llu %7llu %7llu %5llu %7llu %11.0f\n",
        map_.buses[b].name.c_str(), map_.buses[b].interface.c_str(), to_string(port.state()),
        number(host.replies), number(host.missing_replies), number(segment.late_replies),
        number(segment.unsent_frames), number(segment.held_ticks),
        number(port.counters().error_frames + host.malformed + host.foreign),
        1e-3 * static_cast<double>(segment.slowest_reply_ns));
    text += line.data();
  }
  return text;
}

}  // namespace clamber
