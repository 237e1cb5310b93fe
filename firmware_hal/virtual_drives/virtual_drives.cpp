#include "firmware_hal/virtual_drives/virtual_drives.hpp"

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

PlacedDrive make_drive(const Bus& bus, const JointDrive& joint, double step) {
  PlacedDrive placed;
  placed.name = joint.name;
  placed.mounting = {joint.joint, joint.direction, joint.zero};
  const WindingHeat& heat = joint.motor.winding;
  if (bus.protocol == BusProtocol::kMit) {
    auto drive = std::make_unique<VirtualMitDrive>(mit_drive(bus, joint), joint.motor.mit.watchdog,
                                                   heat, step);
    placed.mit = drive.get();
    placed.drive = std::move(drive);
  } else {
    auto drive = std::make_unique<VirtualCia402Drive>(cia402_drive(bus, joint), joint.motor.cia402,
                                                      heat, step);
    placed.cia402 = drive.get();
    placed.drive = std::move(drive);
  }
  return placed;
}

}  // namespace

VirtualDrives::VirtualDrives(const BusMap& map, JointPlant& plant)
    : plant_(plant), step_(1.0 / map.rate), torques_(plant.joint_count(), 0.0) {
  for (const Bus& bus : map.buses) {
    std::vector<PlacedDrive>& drives = buses_.emplace_back();
    for (const JointDrive& joint : bus.drives) {
      if (static_cast<std::size_t>(joint.joint) >= plant.joint_count())
        throw InputError(map.file + ": joint " + joint.name + " is not one of the plant's " +
                         std::to_string(plant.joint_count()));
      drives.push_back(make_drive(bus, joint, step_));
    }
  }
  read_sensors();
}

void VirtualDrives::boot() noexcept {
  for (auto& drives : buses_)
    for (PlacedDrive& placed : drives)
      if (placed.cia402 != nullptr) placed.cia402->boot();
}

void VirtualDrives::receive(std::size_t bus, const CanFrame& frame) noexcept {
  for (PlacedDrive& placed : buses_[bus]) placed.drive->receive(frame);
}

void VirtualDrives::step() {
  watch_stand();
  if (released_) {
    for (auto& drives : buses_)
      for (PlacedDrive& placed : drives)
        torques_[static_cast<std::size_t>(placed.mounting.joint)] =
            placed.mounting.direction * placed.drive->torque();
    plant_.step(torques_, step_);
    ++moved_steps_;
    read_sensors();
  }
  for (auto& drives : buses_)
    for (PlacedDrive& placed : drives) placed.drive->pass();
  ++steps_;
}

void VirtualDrives::watch_stand() noexcept {
  bool all_on = true;
  bool all_off = true;
  for (const auto& drives : buses_) {
    for (const PlacedDrive& placed : drives) {
      all_on = all_on && placed.drive->power() == DrivePower::kOn;
      all_off = all_off && placed.drive->power() == DrivePower::kOff;
    }
  }
  if (released_ && all_off) ++finished_runs_;
  released_ = released_ ? !all_off : all_on;
}

void VirtualDrives::read_sensors() {
  for (auto& drives : buses_) {
    for (PlacedDrive& placed : drives) {
      const JointMotion joint = plant_.motion(static_cast<std::size_t>(placed.mounting.joint));
      const double direction = placed.mounting.direction;
      placed.drive->sense({direction * joint.q + placed.mounting.zero, direction * joint.dq,
                           direction * joint.tau});
    }
  }
}

void VirtualDrives::collect(std::size_t bus, std::vector<CanFrame>& into) {
  for (PlacedDrive& placed : buses_[bus]) {
    const auto frames = placed.drive->outbox().frames();
    into.insert(into.end(), frames.begin(), frames.end());
    placed.drive->outbox().clear();
  }
}

}  // namespace clamber
