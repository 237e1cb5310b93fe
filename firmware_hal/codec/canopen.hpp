// CANopen's messages (CiA 301): network management, SYNC, emergency, heartbeat, expedited SDO;
// bytes
// <-> values for both sides. Any thread; allocates: never; blocks: never.
//
// Little-endian, 11-bit ids = function code + node id (CiA 301, 7.3.3). Only classic data frames:
// anything else is kBadFormat, and a known id with a length that its service does not have is
// kBadLength, so that another protocol's frame with CANopen's id (an MIT drive's reply id 0) is
// never taken for a command.
#pragma once

#include <cstdint>

#include "firmware_hal/can_frame.hpp"
#include "firmware_hal/codec/codec_status.hpp"

namespace clamber {

enum class CanopenKind : std::uint8_t {
  kNmt,
  kSync,
  kEmergency,
  kTpdo,
  kRpdo,
  kSdoReply,
  kSdoRequest,
  kHeartbeat,
};

struct CanopenId {
  CanopenKind kind = CanopenKind::kSync;
  std::uint8_t node = 0;  ///< 1 to 127; 0: not a node's message
  std::uint8_t pdo = 0;   ///< 1 to 4
};

/// What the id says, after format and length have been checked. @return kOk, kForeign, kBadFormat,
/// kBadLength
[[nodiscard]] CodecStatus classify_canopen(const CanFrame& frame, CanopenId& id) noexcept;

// ---- network management (CiA 301, 7.2.8)

enum class NmtCommand : std::uint8_t {
  kStart = 0x01,
  kStop = 0x02,
  kPreOperational = 0x80,
  kResetNode = 0x81,
  kResetCommunication = 0x82,
};
enum class NmtState : std::uint8_t {
  kBoot = 0x00,
  kStopped = 0x04,
  kOperational = 0x05,
  kPreOperational = 0x7F,
};

/// @param node 0: all nodes
[[nodiscard]] CanFrame encode_nmt(NmtCommand command, std::uint8_t node) noexcept;
[[nodiscard]] CodecStatus decode_nmt(const CanFrame& frame, NmtCommand& command,
                                     std::uint8_t& node) noexcept;
[[nodiscard]] CanFrame encode_sync() noexcept;
[[nodiscard]] CanFrame encode_heartbeat(std::uint8_t node, NmtState state) noexcept;
[[nodiscard]] CodecStatus decode_heartbeat(const CanFrame& frame, std::uint8_t& node,
                                           NmtState& state) noexcept;

// ---- emergency (7.2.7)

enum EmergencyCode : std::uint16_t {
  kEmergencyReset = 0x0000,
  kEmergencyPassive = 0x8120,
  kEmergencyHeartbeatLost = 0x8130,
  kEmergencyBusOffRecovered = 0x8140,
  kEmergencyPdoLength = 0x8210,
};
struct Emergency {
  std::uint8_t node = 0;
  std::uint16_t code = 0;  ///< EmergencyCode or another of CiA 301 table 26 and CiA 402-2
  std::uint8_t error_register = 0;
  std::array<std::uint8_t, 5> vendor{};
};
[[nodiscard]] CanFrame encode_emergency(const Emergency& emergency) noexcept;
[[nodiscard]] CodecStatus decode_emergency(const CanFrame& frame, Emergency& emergency) noexcept;

// ---- expedited SDO (7.2.4.3); segmented and block transfers are kBadContent

enum class SdoKind : std::uint8_t { kDownload, kUpload, kDownloadReply, kUploadReply, kAbort };

enum SdoAbortCode : std::uint32_t {
  kSdoAbortTimeout = 0x05040000,
  kSdoAbortCommand = 0x05040001,
  kSdoAbortReadOnly = 0x06010002,
  kSdoAbortNoObject = 0x06020000,
  kSdoAbortNoMapping = 0x06040041,
  kSdoAbortLength = 0x06070010,
  kSdoAbortNoSubIndex = 0x06090011,
  kSdoAbortRange = 0x06090030,
  kSdoAbortState = 0x08000022,
};

struct Sdo {
  SdoKind kind = SdoKind::kUpload;
  std::uint8_t node = 0;
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  std::uint8_t size =
      0;  ///< bytes of `value`, 1 to 4; 0: not given by the sender (then 4 are sent)
  std::uint32_t value = 0;  ///< kDownload, kUploadReply: data; kAbort: SdoAbortCode
};
/// @param request true: from the host (id 600h + node), false: from the drive (580h + node)
[[nodiscard]] CanFrame encode_sdo(const Sdo& sdo, bool request) noexcept;
/// The direction is the frame's id.
[[nodiscard]] CodecStatus decode_sdo(const CanFrame& frame, Sdo& sdo, bool& request) noexcept;

// ---- little-endian numbers of PDOs

[[nodiscard]] inline std::uint32_t read_le(std::span<const std::uint8_t> bytes, std::size_t at,
                                           std::size_t count) noexcept {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count && at + i < bytes.size(); ++i)
    value |= std::uint32_t{bytes[at + i]} << (8 * i);
  return value;
}
inline void write_le(std::span<std::uint8_t> bytes, std::size_t at, std::size_t count,
                     std::uint32_t value) noexcept {
  for (std::size_t i = 0; i < count && at + i < bytes.size(); ++i)
    bytes[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
}

}  // namespace clamber
