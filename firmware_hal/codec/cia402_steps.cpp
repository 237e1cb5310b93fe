// The configuration of a CiA 402 drive as a list of SDO transfers.
#include <cmath>

#include "firmware_hal/codec/cia402_host.hpp"

namespace clamber {
namespace {

constexpr std::uint32_t kInvalid = 0x80000000;  // bit 31 of a PDO's COB-ID: the PDO is off

/// Identity checks, letting go, then heartbeats and reactions, then mode and cycle.
constexpr std::size_t kGeneralSteps = 12;
constexpr std::size_t kOtherPdos = 6;

SdoStep general_step(const Cia402Drive& drive, const Cia402HostSettings& settings,
                     std::size_t step) noexcept {
  const auto period = static_cast<std::uint32_t>(std::lround(1e3 * settings.heartbeat));
  const auto patience =
      static_cast<std::uint32_t>(std::lround(1e3 * kHeartbeatPatience * settings.heartbeat));
  const auto cycle = static_cast<std::uint32_t>(std::lround(1e4 * settings.tick));
  switch (step) {
    case 0:
      return {0x1000, 0, 0, 0, false};  // device type: profile 402
    case 1:
      return {0x6502, 0, 0, 0, false};  // supported modes
    case 2:
      return {0x6076, 0, 0, 0, true};  // rated torque
    case 3:
      // A drive that a host left enabled holds its last torque, and takes no process data until it
      // is started again: let go first.
      return {0x6040, 0, 2, kControlDisableVoltage, false};
    case 4:
      return {0x1017, 0, 2, period, false};
    case 5:
      return {0x1016, 1, 4, std::uint32_t{settings.node} << 16 | patience, false};
    case 6:
      return {0x6007, 0, 2, static_cast<std::uint32_t>(settings.lost_host), false};
    case 7:
      // Slow down on the quick-stop ramp and stay there, held: option code 2 would let go after it.
      return {0x605A, 0, 2, 6, true};
    case 8:
      return {0x6060, 0, 1, static_cast<std::uint32_t>(drive.mode), false};
    case 9:
      return {0x60C2, 1, 1, cycle % 10 == 0 ? cycle / 10 : cycle, true};
    case 10:
      return {0x60C2, 2, 1, cycle % 10 == 0 ? 0xFDu : 0xFCu, true};  // 10^-3 or 10^-4 s
    default:
      return {0x1006, 0, 4, static_cast<std::uint32_t>(std::lround(1e6 * settings.tick)), true};
  }
}

/// RPDO2 to 4 and TPDO2 to 4 off: nobody expects them, and the budget does not hold them.
SdoStep other_pdo_step(const Cia402Drive& drive, std::size_t step) noexcept {
  const auto n = static_cast<std::uint16_t>(step % 3 + 1);
  const bool transmit = step >= 3;
  const auto index = static_cast<std::uint16_t>((transmit ? 0x1800 : 0x1400) + n);
  const std::uint32_t id = (transmit ? 0x180u : 0x200u) + 0x100u * n + drive.node;
  return {index, 1, 4, kInvalid | id, true};
}

/// Off, emptied, filled, type "every SYNC", on (CiA 301, 7.5.2.36: the order a mapping is changed
/// in).
template <std::size_t N>
SdoStep pdo_step(std::uint16_t communication, std::uint32_t id,
                 const std::array<std::uint32_t, N>& mapped, std::size_t step) noexcept {
  const auto mapping = static_cast<std::uint16_t>(communication + 0x200);
  if (step == 0) return {communication, 1, 4, kInvalid | id, false};
  if (step == 1) return {mapping, 0, 1, 0, false};
  if (step < 2 + N)
    return {mapping, static_cast<std::uint8_t>(step - 1), 4, mapped[step - 2], false};
  if (step == 2 + N) return {mapping, 0, 1, static_cast<std::uint32_t>(N), false};
  if (step == 3 + N) return {communication, 2, 1, 1, false};
  return {communication, 1, 4, id, false};
}
constexpr std::size_t pdo_steps(std::size_t mapped) noexcept { return 5 + mapped; }

constexpr std::array<std::uint32_t, 2> kTorqueCommand{0x60400010, 0x60710010};
constexpr std::array<std::uint32_t, 3> kPositionCommand{0x60400010, 0x607A0020, 0x60B20010};
constexpr std::array<std::uint32_t, 3> kReply{0x60410010, 0x60640020, 0x60770010};

std::size_t command_steps(const Cia402Drive& drive) noexcept {
  return pdo_steps(drive.mode == Cia402Mode::kCyclicTorque ? kTorqueCommand.size()
                                                           : kPositionCommand.size());
}

}  // namespace

std::size_t cia402_step_count(const Cia402Drive& drive) noexcept {
  return kGeneralSteps + kOtherPdos + command_steps(drive) + pdo_steps(kReply.size());
}

SdoStep cia402_step(const Cia402Drive& drive, const Cia402HostSettings& settings,
                    std::size_t step) noexcept {
  if (step < kGeneralSteps) return general_step(drive, settings, step);
  step -= kGeneralSteps;
  if (step < kOtherPdos) return other_pdo_step(drive, step);
  step -= kOtherPdos;
  const std::uint32_t node = drive.node;
  if (step < command_steps(drive))
    return drive.mode == Cia402Mode::kCyclicTorque
               ? pdo_step(0x1400, 0x200 + node, kTorqueCommand, step)
               : pdo_step(0x1400, 0x200 + node, kPositionCommand, step);
  return pdo_step(0x1800, 0x180 + node, kReply, step - command_steps(drive));
}

}  // namespace clamber
