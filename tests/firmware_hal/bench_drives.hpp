// Drives just clever enough to answer a host in tests: no physics, no timing, knobs for mischief.
#pragma once

#include <map>
#include <vector>

#include "firmware_hal/codec/cia402_host.hpp"
#include "firmware_hal/codec/mit_host.hpp"

namespace clamber::test {

/// Answers every command with where it is; follows nothing.
struct BenchMitDrive {
  MitDrive codec;
  double q = 0.0;
  bool enabled = false;
  bool silent = false;
  std::uint8_t error = 0;
  std::vector<MitCommand> heard;

  std::vector<CanFrame> take(const CanFrame& frame) {
    MitCommand command;
    if (silent || decode_mit_command(codec, frame, command) != CodecStatus::kOk) return {};
    heard.push_back(command);
    if (command.special) {
      if (command.code == MitSpecial::kEnable && error == 0) enabled = true;
      if (command.code == MitSpecial::kDisable) enabled = false;
      if (command.code == MitSpecial::kClearFault) error = 0;
    }
    MitReply reply;
    reply.q = q;
    reply.error = error;
    reply.enabled = enabled;
    return {encode_mit_reply(codec, reply)};
  }
};

/// A CANopen node with a CiA 402 state machine that takes any configuration.
struct BenchCia402Drive {
  Cia402Drive codec;
  double q = 0.0;
  NmtState nmt = NmtState::kPreOperational;
  Cia402State state = Cia402State::kSwitchOnDisabled;
  std::uint16_t controlword = 0;
  double tau = 0.0;
  double commanded_q = 0.0;
  bool silent = false;
  std::uint32_t abort_index = 0;  ///< this object is refused
  bool deaf_to_sdo = false;
  std::map<std::uint32_t, std::uint32_t> objects;  ///< index << 8 | sub
  int enables = 0;

  std::vector<CanFrame> take(const CanFrame& frame) {
    std::vector<CanFrame> out;
    if (silent) return out;
    NmtCommand nmt_command = NmtCommand::kStop;
    std::uint8_t node = 0;
    Cia402Command command;
    Sdo sdo;
    bool request = false;
    if (decode_nmt(frame, nmt_command, node) == CodecStatus::kOk &&
        (node == 0 || node == codec.node)) {
      if (nmt_command == NmtCommand::kStart) nmt = NmtState::kOperational;
      if (nmt_command == NmtCommand::kPreOperational) nmt = NmtState::kPreOperational;
    } else if (nmt == NmtState::kOperational &&
               decode_cia402_command(codec, frame, command) == CodecStatus::kOk) {
      const Cia402State next = next_state(state, controlword, command.controlword);
      if (next == Cia402State::kEnabled && state != next) ++enables;
      state = next;
      controlword = command.controlword;
      tau = command.tau;
      commanded_q = command.q;
    } else if (nmt == NmtState::kOperational && frame == encode_sync()) {
      Cia402Reply reply;
      reply.statusword = statusword_of(state);
      reply.q = q;
      reply.tau = tau;
      out.push_back(encode_cia402_reply(codec, reply));
    } else if (decode_sdo(frame, sdo, request) == CodecStatus::kOk && request &&
               sdo.node == codec.node && !deaf_to_sdo) {
      out.push_back(encode_sdo(answer(sdo), false));
    }
    return out;
  }

  Sdo answer(Sdo sdo) {
    const std::uint32_t key = std::uint32_t{sdo.index} << 8 | sdo.sub;
    if (sdo.index == abort_index) {
      sdo.kind = SdoKind::kAbort;
      sdo.value = kSdoAbortNoObject;
    } else if (sdo.kind == SdoKind::kDownload) {
      objects[key] = sdo.value;
      sdo.kind = SdoKind::kDownloadReply;
      sdo.value = 0;
    } else {
      sdo.kind = SdoKind::kUploadReply;
      sdo.size = 4;
      sdo.value = objects[key];
    }
    sdo.size = sdo.kind == SdoKind::kUploadReply ? sdo.size : 0;
    return sdo;
  }
};

}  // namespace clamber::test
