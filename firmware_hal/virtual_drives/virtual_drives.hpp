// All drives of a bus map and the joints behind them. One thread; allocates: in the constructor,
// then only what the plant does; blocks: never. No sockets, no clock: step() is its time.
#pragma once

#include <memory>
#include <vector>

#include "firmware_hal/bus_map.hpp"
#include "firmware_hal/virtual_drives/cia402_drive.hpp"
#include "firmware_hal/virtual_drives/mit_drive.hpp"

namespace clamber {

/// A drive with its place on bus and robot.
struct PlacedDrive {
  std::unique_ptr<VirtualDrive> drive;
  VirtualMitDrive* mit = nullptr;        ///< the same if it speaks mit, or
  VirtualCia402Drive* cia402 = nullptr;  ///< if it speaks cia402
  std::string name;                      ///< of the joint
  Mounting mounting;
};

class VirtualDrives {
 public:
  /// Cold drives with the power just on. The plant must outlive this and have the map's joints.
  /// @throws InputError when it has not
  VirtualDrives(const BusMap& map, JointPlant& plant);

  /// Boot-up messages, for drives that send one.
  void boot() noexcept;
  /// Gives a frame of a bus to its drives; their answers are in their outboxes.
  void receive(std::size_t bus, const CanFrame& frame) noexcept;
  /// One tick of the map's rate: torques, plant, sensors, the drives' clocks.
  ///
  /// Until all drives are on, and again once their host has switched all of them off, the robot
  /// stands on a stand: the plant stands still. A drive that lets go by itself lets the robot fall.
  void step();
  /// Takes the frames that the bus's drives have to send, drive by drive.
  void collect(std::size_t bus, std::vector<CanFrame>& into);

  [[nodiscard]] std::size_t bus_count() const noexcept { return buses_.size(); }
  [[nodiscard]] std::vector<PlacedDrive>& bus(std::size_t i) noexcept { return buses_[i]; }
  [[nodiscard]] const std::vector<PlacedDrive>& bus(std::size_t i) const noexcept {
    return buses_[i];
  }
  /// Off the stand: all drives have been on and their host has not switched all of them off.
  [[nodiscard]] bool released() const noexcept { return released_; }
  /// Times the host has switched all drives off after all had been on.
  [[nodiscard]] std::uint64_t finished_runs() const noexcept { return finished_runs_; }
  [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }
  /// Steps in which the plant moved.
  [[nodiscard]] std::uint64_t moved_steps() const noexcept { return moved_steps_; }

 private:
  void watch_stand() noexcept;
  void read_sensors();

  JointPlant& plant_;
  double step_;
  std::vector<std::vector<PlacedDrive>> buses_;
  std::vector<double> torques_;
  bool released_ = false;
  std::uint64_t finished_runs_ = 0;
  std::uint64_t steps_ = 0;
  std::uint64_t moved_steps_ = 0;
};

}  // namespace clamber
