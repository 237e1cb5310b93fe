// Any frames at all against both hosts with the goal "off", and what must hold whatever comes.
#pragma once

#include <cmath>
#include <memory>
#include <random>

#include "firmware_hal/candump.hpp"
#include "firmware_hal/codec/cia402_host.hpp"
#include "firmware_hal/codec/mit_host.hpp"

namespace clamber::test {

/// Mostly frames that are nearly right: ids and bytes the protocols know, with a mistake or none.
inline CanFrame stormy_frame(std::mt19937_64& random) {
  constexpr std::array<std::uint32_t, 16> kIds{0x000, 0x001, 0x002, 0x003, 0x080, 0x081,
                                               0x181, 0x182, 0x201, 0x401, 0x402, 0x403,
                                               0x581, 0x601, 0x701, 0x702};
  constexpr std::array<std::uint8_t, 12> kBytes{0x00, 0x01, 0x05, 0x0F, 0x11, 0x27,
                                                0x37, 0x43, 0x60, 0x7F, 0x80, 0xFF};
  CanFrame frame;
  frame.id = random() % 4 == 0 ? static_cast<std::uint32_t>(random()) : kIds[random() % 16];
  frame.extended = random() % 16 == 0;
  frame.remote = random() % 16 == 0;
  frame.error = random() % 32 == 0;
  frame.fd = random() % 4 == 0;
  frame.brs = random() % 4 == 0;
  frame.length = static_cast<std::uint8_t>(random() % 3 == 0 ? random() % 65 : 8);
  for (std::uint8_t& byte : frame.data)
    byte = random() % 2 == 0 ? kBytes[random() % 12] : static_cast<std::uint8_t>(random());
  if (random() % 8 == 0) frame.data[0] = static_cast<std::uint8_t>(1 + random() % 3);
  return frame;
}

class FrameStorm {
 public:
  FrameStorm() : mit_(std::make_unique<MitHost>(0.001)) {
    Cia402HostSettings settings;
    settings.node = 100;
    cia402_ = std::make_unique<Cia402Host>(settings);
    constexpr std::array kKinds{MitReplyKind::kPlain, MitReplyKind::kVoltage,
                                MitReplyKind::kTemperatureError, MitReplyKind::kStateNibble};
    for (std::uint16_t i = 0; i < 4; ++i) {
      MitDrive drive;
      drive.id = static_cast<std::uint16_t>(i + 1);
      drive.reply_id = i < 2 ? 0 : static_cast<std::uint16_t>(0x400 + drive.id);
      drive.ranges = {{-4, 4}, {-10, 10}, {0, 500}, {0, 5}, {-54, 54}, {-54, 54}, {0, 80}};
      drive.reply = kKinds[i];
      ok_ = mit_->add_drive(drive, {i, 1.0, 0.0}, 0.025) && ok_;
      drives_[i] = drive;
    }
    for (std::uint8_t node = 1; node <= 2; ++node) {
      const auto mode = node == 1 ? Cia402Mode::kCyclicTorque : Cia402Mode::kCyclicPosition;
      ok_ = cia402_->add_drive({node, mode, 1e5, 0.02, 54.0}, {node - 1, -1.0, 0.1}, 0.2) && ok_;
    }
  }

  /// @return nullptr, or what did not hold
  const char* take(const CanFrame& frame) {
    if (!ok_) return "the drives were refused";
    if (mit_->receive(frame) == CodecStatus::kOk) ++used_;
    if (cia402_->receive(frame) == CodecStatus::kOk) ++used_;
    if (const char* broken = drive_side(frame)) return broken;
    if (++frames_ % 8 != 0) return nullptr;
    for (BusHost* host :
         {static_cast<BusHost*>(mit_.get()), static_cast<BusHost*>(cia402_.get())}) {
      host->begin_tick(commands_, list_);
      for (const CanFrame& sent : list_.frames()) {
        if (is_mit_enable(sent) || is_cia402_enable(sent)) return "an enabling frame was sent";
        if (!is_valid(sent)) return "an invalid frame was sent";
      }
      host->end_tick(states_);
      for (const JointState& state : states_) {
        if ((state.flags & kJointEnabled) != 0) return "a joint counts as enabled";
        if (!std::isfinite(state.q) || !std::isfinite(state.dq) || !std::isfinite(state.tau))
          return "a state is not a number";
      }
      if (list_.dropped() != 0) return "the frame list overflowed";
    }
    return nullptr;
  }

  [[nodiscard]] std::uint64_t used() const { return used_; }

 private:
  /// What a drive makes of the frame: enabled by the enable command and nothing else.
  const char* drive_side(const CanFrame& frame) const {
    for (const MitDrive& drive : drives_) {
      MitCommand command;
      if (decode_mit_command(drive, frame, command) != CodecStatus::kOk) continue;
      const bool enables = command.special && command.code == MitSpecial::kEnable;
      if (enables != is_mit_enable(frame)) return "a drive was enabled by another command";
      CanFrame again;
      if (!command.special &&
          encode_mit_command(drive, command.setpoint, again) != CodecStatus::kOk)
        return "a decoded setpoint cannot be encoded";
    }
    return nullptr;
  }

  std::unique_ptr<MitHost> mit_;
  std::unique_ptr<Cia402Host> cia402_;
  std::array<MitDrive, 4> drives_;
  std::array<JointCommand, 4> commands_{};
  std::array<JointState, 4> states_{};
  FrameList list_;
  bool ok_ = true;
  std::uint64_t frames_ = 0;
  std::uint64_t used_ = 0;
};

}  // namespace clamber::test
