// Which joint's drive is where: buses, protocols, node ids, motor types, from configuration files.
// Start-up only: allocates, reads files, throws InputError. The result is const and may be shared.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "firmware_hal/bus_model/frame_bits.hpp"
#include "firmware_hal/codec/cia402.hpp"
#include "firmware_hal/codec/mit.hpp"
#include "firmware_hal/virtual_drives/winding.hpp"
#include "robot_model/model.hpp"

namespace clamber {

enum class BusProtocol : std::uint8_t { kMit, kCia402 };
[[nodiscard]] const char* to_string(BusProtocol protocol) noexcept;

struct MitMotor {
  MitRanges ranges;
  MitReplyKind reply = MitReplyKind::kPlain;
  double temperature_offset = 0.0;  ///< degree Celsius
  double watchdog = 0.025;          ///< s without a command until the drive goes limp; 0: never
  bool fd = false;                  ///< the drive can be set to CAN FD
};

struct Cia402Motor {
  double counts_per_turn = 65536.0;  ///< position counts per turn of the joint
  double rated_torque = 1.0;         ///< N m at the joint: object 6076h behind the gear
  double gear_ratio = 1.0;           ///< turns of the motor per turn of the joint
  double max_torque = 1.0;           ///< N m at the joint; commands are clamped to it
  std::int16_t lower_option = 0;     ///< 6007h by which it lowers its joint; 0: it cannot
  // Settings of the drive itself, which only its simulation needs:
  double loop_kp = 1000.0;   ///< N m/rad at the joint: its position loop (CSP, quick stop)
  double loop_kd = 20.0;     ///< N m s/rad
  double quick_stop = 20.0;  ///< rad/s^2 at the joint: 6085h
};

struct MotorType {
  std::string name;
  BusProtocol protocol = BusProtocol::kMit;
  MitMotor mit;        ///< if protocol is kMit
  Cia402Motor cia402;  ///< if protocol is kCia402
  WindingHeat winding;
};

struct JointDrive {
  std::string name;            ///< of the joint
  int joint = 0;               ///< index in the robot model
  std::uint16_t node = 0;      ///< node id; with kMit also the id of its commands
  std::uint16_t reply_id = 0;  ///< kMit
  MotorType motor;
  double direction = 1.0;  ///< 1 or -1: joint = direction * (drive - zero)
  double zero = 0.0;       ///< rad, the drive's reading at joint position 0
};

struct Bus {
  std::string name;
  std::string interface;
  BusProtocol protocol = BusProtocol::kMit;
  std::uint32_t bitrate = 1'000'000;  ///< bit/s, arbitration
  std::uint32_t data_bitrate = 0;     ///< bit/s, payload of FD frames; 0: classic CAN
  std::vector<JointDrive> drives;     ///< in sending order
  // kCia402 only
  Cia402Mode mode = Cia402Mode::kCyclicTorque;
  std::uint8_t host_node = 1;
  double heartbeat = 0.02;  ///< s between heartbeats, host's and drives'; lost after 2.5 of them
  LostHostReaction lost_host = LostHostReaction::kQuickStop;

  [[nodiscard]] FrameFormat format() const noexcept { return {data_bitrate > 0, data_bitrate > 0}; }
  [[nodiscard]] BitTiming timing() const noexcept {
    return {1'000'000'000u / bitrate, 1'000'000'000u / (data_bitrate > 0 ? data_bitrate : bitrate)};
  }
};

struct BusMap {
  std::string file;
  double rate = 1000.0;       ///< Hz, ticks of the controller
  double max_load = 0.8;      ///< of the worst-case bus time; more is refused
  double turnaround = 50e-6;  ///< s from a drive's trigger to its reply, at most
  int joint_count = 0;
  std::optional<long> calibrated;  ///< day on which the zeros were measured, days since 1970
  std::vector<Bus> buses;
};

/// Reads a bus map and the motor types it names, and checks both against the robot: every joint on
/// exactly one bus, ids unique, ranges that hold the joint's limits, watchdogs that outlast a tick.
/// It does not check the load: see require_budget() in bus_budget.hpp.
/// @throws InputError "<file>:<line>: <key>: <what is wrong and how to put it right>"
[[nodiscard]] BusMap load_bus_map(const std::filesystem::path& file, const RobotModel& robot);

/// The same from text already read; `motors:` in it is relative to the folder of `file`.
[[nodiscard]] BusMap parse_bus_map(const std::string& text, const std::filesystem::path& file,
                                   const RobotModel& robot);

/// The drive as the codec needs it.
[[nodiscard]] MitDrive mit_drive(const Bus& bus, const JointDrive& drive) noexcept;
[[nodiscard]] Cia402Drive cia402_drive(const Bus& bus, const JointDrive& drive) noexcept;

}  // namespace clamber
