#include "firmware_hal/frame_text.hpp"

#include <cstdarg>
#include <cstdio>

namespace clamber {
namespace {

[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
  char text[256];
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(text, sizeof text, pattern, arguments);
  va_end(arguments);
  return text;
}

FrameText malformed(const std::string& what, CodecStatus status) {
  return {FrameKind::kMalformed, what + ": " + to_string(status)};
}

// ---- error frames (linux/can/error.h)

FrameText describe_error_frame(const CanFrame& frame) {
  struct Bit {
    std::uint32_t mask;
    const char* name;
  };
  constexpr std::array<Bit, 9> kBits{{{0x001, "TX timeout"},
                                      {0x002, "lost arbitration"},
                                      {0x004, "controller problem"},
                                      {0x008, "protocol violation"},
                                      {0x010, "transceiver"},
                                      {0x020, "no acknowledgement"},
                                      {0x040, "bus-off"},
                                      {0x080, "bus error"},
                                      {0x100, "controller restarted"}}};
  std::string text = "error frame:";
  for (const Bit& bit : kBits)
    if ((frame.id & bit.mask) != 0) text += std::string(" ") + bit.name + ",";
  if ((frame.id & 0x004) != 0 && frame.length >= 2) {
    const std::uint8_t c = frame.data[1];
    if ((c & 0x03) != 0) text += " buffer overflow,";
    if ((c & 0x0C) != 0) text += " warning level,";
    if ((c & 0x30) != 0) text += " error passive,";
    if ((c & 0x40) != 0) text += " error active again,";
  }
  if (text.ends_with(',')) text.pop_back();
  return {FrameKind::kTrouble, text};
}

// ---- MIT

const char* special_name(MitSpecial special) {
  switch (special) {
    case MitSpecial::kClearFault:
      return "CLEAR FAULT";
    case MitSpecial::kEnable:
      return "ENABLE";
    case MitSpecial::kDisable:
      return "DISABLE";
    case MitSpecial::kSetZero:
      return "SET ZERO";
  }
  return "?";
}

FrameText describe_mit_command(const JointDrive& drive, const MitCommand& command) {
  if (command.special)
    return {FrameKind::kSwitching, drive.name + " <- " + special_name(command.code)};
  const JointCommand& c = command.setpoint;
  return {FrameKind::kData,
          format("%s <- q %.4f rad  dq %.3f rad/s  kp %.1f  kd %.2f  tau %.2f N m",
                 drive.name.c_str(), drive.direction * (c.q - drive.zero), drive.direction * c.dq,
                 c.kp, c.kd, drive.direction * c.tau)};
}

FrameText describe_mit_reply(const JointDrive& drive, const MitReply& r) {
  std::string text =
      format("%s -> q %.4f rad  dq %.3f rad/s  tau %.2f N m", drive.name.c_str(),
             drive.direction * (r.q - drive.zero), drive.direction * r.dq, drive.direction * r.tau);
  const MitReplyKind kind = drive.motor.mit.reply;
  if (kind == MitReplyKind::kVoltage) text += format("  %.1f V", r.voltage);
  if (kind == MitReplyKind::kTemperatureError || kind == MitReplyKind::kStateNibble)
    text += format("  %.0f C", r.temperature);
  if (kind == MitReplyKind::kStateNibble && r.error == 0) text += r.enabled ? "  on" : "  off";
  if (r.error != 0) text += format("  ERROR %u", unsigned{r.error});
  return {r.error != 0 ? FrameKind::kTrouble : FrameKind::kData, text};
}

FrameText describe_mit(const Bus& bus, const CanFrame& frame) {
  FrameText bad{FrameKind::kForeign, "foreign id"};
  for (const JointDrive& drive : bus.drives) {
    const MitDrive codec = mit_drive(bus, drive);
    MitCommand command;
    CodecStatus status = decode_mit_command(codec, frame, command);
    if (status == CodecStatus::kOk &&
        (frame.fd != codec.format.fd || frame.brs != codec.format.brs))
      status = CodecStatus::kBadFormat;
    if (status == CodecStatus::kOk) return describe_mit_command(drive, command);
    if (frame.id == drive.node) bad = malformed(drive.name + " <-", status);
    MitReply reply;
    status = decode_mit_reply(codec, frame, reply);
    if (status == CodecStatus::kOk) return describe_mit_reply(drive, reply);
    if (frame.id == drive.reply_id && bad.kind == FrameKind::kForeign)
      bad = malformed(drive.name + " ->", status);
  }
  return bad;
}

// ---- CANopen and CiA 402

const char* nmt_name(NmtCommand command) {
  switch (command) {
    case NmtCommand::kStart:
      return "START";
    case NmtCommand::kStop:
      return "STOP";
    case NmtCommand::kPreOperational:
      return "PRE-OPERATIONAL";
    case NmtCommand::kResetNode:
      return "RESET NODE";
    case NmtCommand::kResetCommunication:
      return "RESET COMMUNICATION";
  }
  return "?";
}

const char* nmt_state_name(NmtState state) {
  switch (state) {
    case NmtState::kBoot:
      return "booted";
    case NmtState::kStopped:
      return "stopped";
    case NmtState::kOperational:
      return "operational";
    case NmtState::kPreOperational:
      return "pre-operational";
  }
  return "?";
}

std::string describe_sdo(const Sdo& sdo) {
  const std::string object = format("%04X:%02X", unsigned{sdo.index}, unsigned{sdo.sub});
  switch (sdo.kind) {
    case SdoKind::kDownload:
      return "write " + object + format(" = 0x%X", sdo.value);
    case SdoKind::kUpload:
      return "read " + object;
    case SdoKind::kDownloadReply:
      return "written " + object;
    case SdoKind::kUploadReply:
      return object + format(" is 0x%X", sdo.value);
    case SdoKind::kAbort:
      return "ABORT " + object + format(" code 0x%08X", sdo.value);
  }
  return object;
}

std::string node_name(const Bus* bus, std::uint8_t node) {
  if (bus != nullptr) {
    for (const JointDrive& drive : bus->drives)
      if (drive.node == node) return drive.name;
    if (node == bus->host_node) return "host";
  }
  return format("node %u", unsigned{node});
}

const JointDrive* find_drive(const Bus* bus, std::uint8_t node) {
  if (bus == nullptr) return nullptr;
  for (const JointDrive& drive : bus->drives)
    if (drive.node == node) return &drive;
  return nullptr;
}

FrameText describe_pdo(const Bus* bus, const CanopenId& id, const CanFrame& frame) {
  const std::string name = node_name(bus, id.node);
  const JointDrive* drive = id.pdo == 1 ? find_drive(bus, id.node) : nullptr;
  const bool command = id.kind == CanopenKind::kRpdo;
  if (drive == nullptr) {
    std::string text =
        name + (command ? format(" <- RPDO%u", unsigned{id.pdo}) : format(" -> TPDO%u", id.pdo));
    for (const std::uint8_t byte : frame.payload()) text += format(" %02X", unsigned{byte});
    return {bus == nullptr ? FrameKind::kData : FrameKind::kForeign, text};
  }
  const Cia402Drive codec = cia402_drive(*bus, *drive);
  if (command) {
    Cia402Command c;
    const CodecStatus status = decode_cia402_command(codec, frame, c);
    if (status != CodecStatus::kOk) return malformed(name + " <-", status);
    std::string text = name + format(" <- control 0x%04X", unsigned{c.controlword});
    if (bus->mode == Cia402Mode::kCyclicPosition)
      text += format("  q %.4f rad", drive->direction * (c.q - drive->zero));
    return {FrameKind::kData, text + format("  tau %.2f N m", drive->direction * c.tau)};
  }
  Cia402Reply r;
  const CodecStatus status = decode_cia402_reply(codec, frame, r);
  if (status != CodecStatus::kOk) return malformed(name + " ->", status);
  const Cia402State state = state_of(r.statusword);
  const bool trouble = state == Cia402State::kFault || state == Cia402State::kFaultReaction;
  return {trouble ? FrameKind::kTrouble : FrameKind::kData,
          name + format(" -> q %.4f rad  tau %.2f N m  %s", drive->direction * (r.q - drive->zero),
                        drive->direction * r.tau, to_string(state))};
}

FrameText describe_node_message(const Bus* bus, const CanopenId& id, const CanFrame& frame) {
  const std::string name = node_name(bus, id.node);
  if (id.kind == CanopenKind::kHeartbeat) {
    std::uint8_t node = 0;
    NmtState state = NmtState::kBoot;
    const CodecStatus status = decode_heartbeat(frame, node, state);
    if (status != CodecStatus::kOk) return malformed(name + " heartbeat", status);
    return {state == NmtState::kBoot ? FrameKind::kSwitching : FrameKind::kData,
            name + " is " + nmt_state_name(state)};
  }
  if (id.kind == CanopenKind::kEmergency) {
    Emergency e;
    (void)decode_emergency(frame, e);
    if (e.code == kEmergencyReset) return {FrameKind::kData, name + " EMERGENCY is over"};
    return {FrameKind::kTrouble, name + format(" EMERGENCY 0x%04X register 0x%02X",
                                               unsigned{e.code}, unsigned{e.error_register})};
  }
  Sdo sdo;
  bool request = false;
  const CodecStatus status = decode_sdo(frame, sdo, request);
  if (status != CodecStatus::kOk) return malformed(name + " SDO", status);
  return {sdo.kind == SdoKind::kAbort ? FrameKind::kTrouble : FrameKind::kSwitching,
          name + (request ? " <- " : " -> ") + describe_sdo(sdo)};
}

FrameText describe_canopen_on(const Bus* bus, const CanFrame& frame) {
  CanopenId id;
  const CodecStatus status = classify_canopen(frame, id);
  if (status == CodecStatus::kForeign) return {FrameKind::kForeign, "foreign id"};
  if (status != CodecStatus::kOk) return malformed("CANopen", status);
  switch (id.kind) {
    case CanopenKind::kNmt: {
      NmtCommand command = NmtCommand::kStop;
      std::uint8_t node = 0;
      const CodecStatus read = decode_nmt(frame, command, node);
      if (read != CodecStatus::kOk) return malformed("network management", read);
      return {FrameKind::kSwitching,
              (node == 0 ? std::string("all") : node_name(bus, node)) + " <- " + nmt_name(command)};
    }
    case CanopenKind::kSync:
      return {FrameKind::kData, "SYNC"};
    case CanopenKind::kTpdo:
    case CanopenKind::kRpdo:
      return describe_pdo(bus, id, frame);
    default:
      return describe_node_message(bus, id, frame);
  }
}

}  // namespace

FrameText describe_frame(const Bus& bus, const CanFrame& frame) {
  if (frame.error) return describe_error_frame(frame);
  return bus.protocol == BusProtocol::kMit ? describe_mit(bus, frame)
                                           : describe_canopen_on(&bus, frame);
}

FrameText describe_canopen(const CanFrame& frame) {
  if (frame.error) return describe_error_frame(frame);
  return describe_canopen_on(nullptr, frame);
}

std::string frame_label(const CanFrame& frame) {
  const char* kind = frame.error ? "err" : !frame.fd ? "can" : frame.brs ? "fd+" : "fd";
  std::string text =
      format(frame.extended || frame.error ? "%-3s %08X" : "%-3s %03X", kind, frame.id);
  return text + (frame.remote ? std::string(" [R]") : format(" [%u]", unsigned{frame.length}));
}

}  // namespace clamber
