#include "firmware_hal/codec/canopen.hpp"

namespace clamber {
namespace {

constexpr std::uint32_t kNmtId = 0x000;
constexpr std::uint32_t kSyncId = 0x080;
constexpr std::uint32_t kTpdo1Id = 0x180;
constexpr std::uint32_t kSdoReplyId = 0x580;
constexpr std::uint32_t kSdoRequestId = 0x600;
constexpr std::uint32_t kHeartbeatId = 0x700;

bool length_fits(CanopenKind kind, std::uint8_t length) noexcept {
  switch (kind) {
    case CanopenKind::kNmt:
      return length == 2;
    case CanopenKind::kSync:
      return length <= 1;  // with or without counter
    case CanopenKind::kEmergency:
    case CanopenKind::kSdoReply:
    case CanopenKind::kSdoRequest:
      return length == 8;
    case CanopenKind::kTpdo:
    case CanopenKind::kRpdo:
      return length >= 1 && length <= 8;
    case CanopenKind::kHeartbeat:
      return length == 1;
  }
  return false;
}

/// Function codes of CiA 301 table 39 without TIME, which nothing here uses.
bool kind_of(std::uint32_t id, CanopenId& out) noexcept {
  const auto node = static_cast<std::uint8_t>(id & 0x7Fu);
  const std::uint32_t function = id & 0x780u;
  out = {CanopenKind::kSync, node, 0};
  if (id == kNmtId) {
    out.kind = CanopenKind::kNmt;
    return true;
  }
  if (id == kSyncId) return true;
  if (node == 0) return false;
  if (function == kSyncId) {
    out.kind = CanopenKind::kEmergency;
  } else if (function >= kTpdo1Id && function <= 0x500) {
    const std::uint32_t number = (function - kTpdo1Id) / 0x80;  // TPDO1 RPDO1 TPDO2 ...
    out.kind = number % 2 == 0 ? CanopenKind::kTpdo : CanopenKind::kRpdo;
    out.pdo = static_cast<std::uint8_t>(1 + number / 2);
  } else if (function == kSdoReplyId) {
    out.kind = CanopenKind::kSdoReply;
  } else if (function == kSdoRequestId) {
    out.kind = CanopenKind::kSdoRequest;
  } else if (function == kHeartbeatId) {
    out.kind = CanopenKind::kHeartbeat;
  } else {
    return false;
  }
  return true;
}

/// Classified and of this kind, or why not.
CodecStatus expect(const CanFrame& frame, CanopenKind kind, CanopenId& id) noexcept {
  const CodecStatus status = classify_canopen(frame, id);
  if (status != CodecStatus::kOk) return status;
  return id.kind == kind ? CodecStatus::kOk : CodecStatus::kForeign;
}

constexpr std::uint8_t kExpedited = 0x02;
constexpr std::uint8_t kSized = 0x01;

std::uint8_t data_command(std::uint8_t base, std::uint8_t size) noexcept {
  if (size == 0 || size > 4) return base | kExpedited;
  return static_cast<std::uint8_t>(base | kExpedited | kSized | (4 - size) << 2);
}

/// Size of expedited data; false: segmented, or bits that CiA 301 keeps at zero.
bool read_size(std::uint8_t command, std::uint8_t& size) noexcept {
  if ((command & kExpedited) == 0 || (command & 0x10) != 0) return false;
  const auto unused = static_cast<std::uint8_t>(command >> 2 & 0x03);
  if ((command & kSized) == 0) {
    size = 0;
    return unused == 0;
  }
  size = static_cast<std::uint8_t>(4 - unused);
  return true;
}

bool read_command(std::uint8_t command, bool request, Sdo& sdo) noexcept {
  constexpr std::uint8_t kAbortCommand = 0x80;
  if (command == kAbortCommand) {
    sdo.kind = SdoKind::kAbort;
    return true;
  }
  const std::uint8_t specifier = command & 0xE0;
  if (request) {
    if (specifier == 0x20) {
      sdo.kind = SdoKind::kDownload;
      return read_size(command, sdo.size);
    }
    sdo.kind = SdoKind::kUpload;
    return command == 0x40;
  }
  if (specifier == 0x40) {
    sdo.kind = SdoKind::kUploadReply;
    return read_size(command, sdo.size);
  }
  sdo.kind = SdoKind::kDownloadReply;
  return command == 0x60;
}

}  // namespace

CodecStatus classify_canopen(const CanFrame& frame, CanopenId& id) noexcept {
  if (frame.extended || frame.remote || frame.error || frame.fd) return CodecStatus::kBadFormat;
  CanopenId read;
  if (!kind_of(frame.id, read)) return CodecStatus::kForeign;
  if (!length_fits(read.kind, frame.length)) return CodecStatus::kBadLength;
  id = read;
  return CodecStatus::kOk;
}

CanFrame encode_nmt(NmtCommand command, std::uint8_t node) noexcept {
  const std::array<std::uint8_t, 2> bytes{static_cast<std::uint8_t>(command), node};
  return make_frame(kNmtId, bytes);
}

CodecStatus decode_nmt(const CanFrame& frame, NmtCommand& command, std::uint8_t& node) noexcept {
  CanopenId id;
  const CodecStatus status = expect(frame, CanopenKind::kNmt, id);
  if (status != CodecStatus::kOk) return status;
  const auto read = static_cast<NmtCommand>(frame.data[0]);
  switch (read) {
    case NmtCommand::kStart:
    case NmtCommand::kStop:
    case NmtCommand::kPreOperational:
    case NmtCommand::kResetNode:
    case NmtCommand::kResetCommunication:
      break;
    default:
      return CodecStatus::kBadContent;
  }
  if (frame.data[1] > 127) return CodecStatus::kBadContent;
  command = read;
  node = frame.data[1];
  return CodecStatus::kOk;
}

CanFrame encode_sync() noexcept { return make_frame(kSyncId, {}); }

CanFrame encode_heartbeat(std::uint8_t node, NmtState state) noexcept {
  const std::array<std::uint8_t, 1> bytes{static_cast<std::uint8_t>(state)};
  return make_frame(kHeartbeatId + node, bytes);
}

CodecStatus decode_heartbeat(const CanFrame& frame, std::uint8_t& node, NmtState& state) noexcept {
  CanopenId id;
  const CodecStatus status = expect(frame, CanopenKind::kHeartbeat, id);
  if (status != CodecStatus::kOk) return status;
  const auto read = static_cast<NmtState>(frame.data[0]);
  switch (read) {
    case NmtState::kBoot:
    case NmtState::kStopped:
    case NmtState::kOperational:
    case NmtState::kPreOperational:
      node = id.node;
      state = read;
      return CodecStatus::kOk;
  }
  return CodecStatus::kBadContent;
}

CanFrame encode_emergency(const Emergency& emergency) noexcept {
  std::array<std::uint8_t, 8> bytes{};
  write_le(bytes, 0, 2, emergency.code);
  bytes[2] = emergency.error_register;
  for (std::size_t i = 0; i < emergency.vendor.size(); ++i) bytes[3 + i] = emergency.vendor[i];
  return make_frame(kSyncId + emergency.node, bytes);
}

CodecStatus decode_emergency(const CanFrame& frame, Emergency& emergency) noexcept {
  CanopenId id;
  const CodecStatus status = expect(frame, CanopenKind::kEmergency, id);
  if (status != CodecStatus::kOk) return status;
  emergency.node = id.node;
  emergency.code = static_cast<std::uint16_t>(read_le(frame.payload(), 0, 2));
  emergency.error_register = frame.data[2];
  for (std::size_t i = 0; i < emergency.vendor.size(); ++i) emergency.vendor[i] = frame.data[3 + i];
  return CodecStatus::kOk;
}

CanFrame encode_sdo(const Sdo& sdo, bool request) noexcept {
  std::array<std::uint8_t, 8> bytes{};
  switch (sdo.kind) {
    case SdoKind::kDownload:
      bytes[0] = data_command(0x20, sdo.size);
      break;
    case SdoKind::kUpload:
      bytes[0] = 0x40;
      break;
    case SdoKind::kDownloadReply:
      bytes[0] = 0x60;
      break;
    case SdoKind::kUploadReply:
      bytes[0] = data_command(0x40, sdo.size);
      break;
    case SdoKind::kAbort:
      bytes[0] = 0x80;
      break;
  }
  write_le(bytes, 1, 2, sdo.index);
  bytes[3] = sdo.sub;
  const bool data = sdo.kind == SdoKind::kDownload || sdo.kind == SdoKind::kUploadReply;
  if (data) write_le(bytes, 4, sdo.size == 0 || sdo.size > 4 ? 4 : sdo.size, sdo.value);
  if (sdo.kind == SdoKind::kAbort) write_le(bytes, 4, 4, sdo.value);
  return make_frame((request ? kSdoRequestId : kSdoReplyId) + sdo.node, bytes);
}

CodecStatus decode_sdo(const CanFrame& frame, Sdo& sdo, bool& request) noexcept {
  CanopenId id;
  const CodecStatus status = classify_canopen(frame, id);
  if (status != CodecStatus::kOk) return status;
  const bool to_drive = id.kind == CanopenKind::kSdoRequest;
  if (!to_drive && id.kind != CanopenKind::kSdoReply) return CodecStatus::kForeign;
  Sdo read;
  if (!read_command(frame.data[0], to_drive, read)) return CodecStatus::kBadContent;
  read.node = id.node;
  read.index = static_cast<std::uint16_t>(read_le(frame.payload(), 1, 2));
  read.sub = frame.data[3];
  const bool data = read.kind == SdoKind::kDownload || read.kind == SdoKind::kUploadReply;
  if (data) read.value = read_le(frame.payload(), 4, read.size == 0 ? 4 : read.size);
  if (read.kind == SdoKind::kAbort) read.value = read_le(frame.payload(), 4, 4);
  sdo = read;
  request = to_drive;
  return CodecStatus::kOk;
}

}  // namespace clamber
