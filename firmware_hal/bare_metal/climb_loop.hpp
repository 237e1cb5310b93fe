// The control loop without an operating system: recorded joint states in, commands and CAN frames
// out. The same source runs on the host and on a microcontroller, where it must give the same bits.
// One thread; allocates: never (the caller lends all memory); blocks: never; throws: never.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "control/controller.hpp"
#include "firmware_hal/codec/cia402.hpp"
#include "firmware_hal/codec/mit_host.hpp"

namespace clamber {

/// A drive as both protocols know it. Index of the array: the robot's joint.
struct LoopDrive {
  MitDrive mit;
  Cia402Drive cia402;
  Mounting mounting;
};

/// First part of a stream; after it come the plan image, `block_count()` CRC-32C (one a block, of
/// its records) and for every tick joint_count JointStates. All in the machine's own layout, which
/// little-endian ARM and x86-64 share; header_bytes tells when they do not.
struct StreamHeader {
  std::array<char, 8> magic{'C', 'L', 'M', 'B', 'L', 'O', 'O', 'P'};
  std::uint32_t header_bytes = sizeof(StreamHeader);
  std::uint32_t state_bytes = sizeof(JointState);
  std::uint32_t joint_count = 0;
  std::uint32_t tick_count = 0;
  std::uint32_t image_bytes = 0;   ///< a multiple of 4
  std::uint32_t block_ticks = 64;  ///< ticks whose records one checksum covers
  std::array<char, 64> robot_hash{};
  ControllerConfig control;
  std::array<LoopDrive, kMaxJoints> drives{};

  [[nodiscard]] std::uint32_t block_count() const noexcept {
    return (tick_count + block_ticks - 1) / block_ticks;
  }
};

/// What of a frame is on the wire, without bytes whose content nobody sets.
struct WireBytes {
  std::uint32_t id = 0;
  std::uint8_t length = 0;
  std::uint8_t fd = 0;
  std::uint16_t reserved = 0;
  std::array<std::uint8_t, 8> data{};
};

/// What one tick gives for one joint.
struct JointRecord {
  JointCommand command;
  WireBytes mit;
  WireBytes cia402;
};

/// What one tick gives; joint_count JointRecords follow it.
struct TickRecord {
  std::uint32_t status = 0;         ///< TickStatus
  std::uint32_t fault = 0;          ///< FaultCode
  std::uint32_t telemetry_crc = 0;  ///< CRC-32C of the TelemetryFrame
  std::uint32_t links_on = 0;       ///< drives that take part
};
static_assert(sizeof(JointRecord) == 72 && sizeof(TickRecord) == 16, "records have no padding");

[[nodiscard]] constexpr std::size_t record_size(std::size_t joints) noexcept {
  return sizeof(TickRecord) + joints * sizeof(JointRecord);
}

/// Parts of a tick, for what measures them.
enum class LoopPart : std::uint8_t {
  kDrives,   ///< the drives' replies, which on a robot is the drives' work
  kDecode,   ///< MIT host: replies to states
  kControl,  ///< Controller::tick()
  kEncode,   ///< MIT host: commands to frames
  kRecord,   ///< CiA 402 frames, checksum, records: for the comparison
};
inline constexpr std::size_t kLoopParts = 5;

/// Controller and MIT host behind it, as on a robot: the states reach the controller through the
/// drives' replies, with the wire's resolution. CiA 402 frames are encoded beside, for the codec.
class ClimbLoop {
 public:
  /// `header` must be one that fits this machine (header_bytes), and outlive the loop.
  /// @param part_done called at the end of each part of a tick; nullptr: nobody measures
  explicit ClimbLoop(const StreamHeader& header, void (*part_done)(LoopPart) = nullptr) noexcept
      : header_(header), host_(header.control.dt), done_(part_done) {}

  /// Loads the plan (see Controller::load()) and switches the drives on, whose joints stand at
  /// `first`. @return kNotLoaded when they do not come on, else the controller's answer
  [[nodiscard]] LoadReport start(std::span<const std::byte> image, std::span<double> workspace,
                                 std::span<const JointState> first) noexcept;

  /// One tick. @param recorded joint_count states  @param record of record_size(joint_count) bytes
  void tick(std::span<const JointState> recorded, std::span<std::byte> record) noexcept;

 private:
  void done(LoopPart part) const noexcept {
    if (done_ != nullptr) done_(part);
  }
  void reply(std::span<const JointState> recorded) noexcept;
  void ask(std::span<const JointCommand> commands) noexcept;
  [[nodiscard]] JointRecord record_of(std::size_t joint) const noexcept;

  const StreamHeader& header_;
  Controller controller_;
  MitHost host_;
  void (*done_)(LoopPart);
  std::array<CanFrame, kMaxJoints> replies_{};
  FrameList frames_;
  std::array<bool, kMaxJoints> enabled_{};
  std::array<JointState, kMaxJoints> states_{};
  std::array<JointCommand, kMaxJoints> commands_{};
  TelemetryFrame telemetry_;
};

}  // namespace clamber
