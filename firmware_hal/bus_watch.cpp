#include "firmware_hal/bus_watch.hpp"

#include "firmware_hal/bus_model/frame_bits.hpp"
#include "firmware_hal/codec/canopen.hpp"
#include "firmware_hal/lock_step.hpp"

namespace clamber {
namespace {

bool is_about_a_frame_of_ours(CodecStatus status) {
  return status != CodecStatus::kOk && status != CodecStatus::kForeign;
}

}  // namespace

void BusWatch::take(const ReceivedFrame& received) {
  std::uint32_t tick = 0;
  if (decode_lock_step(received.frame, tick) != LockStepMark::kNone) return;
  ++frames_;
  busy_ns_ += static_cast<std::int64_t>(duration_ns(exact_bits(received.frame), bus_.timing()));
  if (bus_.protocol == BusProtocol::kMit)
    take_mit(received);
  else
    take_cia402(received);
}

void BusWatch::note_reply(std::size_t i, std::int64_t time_ns, double q, double tau) {
  const JointDrive& drive = bus_.drives[i];
  ++drives_[i].replies;
  drives_[i].last_reply_ns = time_ns;
  drives_[i].q = drive.direction * (q - drive.zero);
  drives_[i].tau = drive.direction * tau;
}

void BusWatch::take_mit(const ReceivedFrame& received) {
  bool wrong = false;
  for (std::size_t i = 0; i < drives_.size(); ++i) {
    const MitDrive drive = mit_drive(bus_, bus_.drives[i]);
    MitReply reply;
    const CodecStatus answer = decode_mit_reply(drive, received.frame, reply);
    if (answer == CodecStatus::kOk) {
      note_reply(i, received.time_ns, reply.q, reply.tau);
      drives_[i].state = reply.error != 0 ? "error " + std::to_string(reply.error)
                         : reply.enabled  ? "on"
                                          : "off";
      return;
    }
    MitCommand command;
    const CodecStatus order = decode_mit_command(drive, received.frame, command);
    if (order == CodecStatus::kOk) {
      ++drives_[i].commands;
      return;
    }
    wrong = wrong || is_about_a_frame_of_ours(answer) || is_about_a_frame_of_ours(order);
  }
  if (wrong)
    ++malformed_;
  else
    ++strangers_[received.frame.id];
}

void BusWatch::take_cia402(const ReceivedFrame& received) {
  CanopenId id;
  const CodecStatus status = classify_canopen(received.frame, id);
  if (is_about_a_frame_of_ours(status)) {
    ++malformed_;
    return;
  }
  for (std::size_t i = 0; status == CodecStatus::kOk && i < drives_.size(); ++i) {
    if (bus_.drives[i].node != id.node) continue;
    const Cia402Drive drive = cia402_drive(bus_, bus_.drives[i]);
    Cia402Reply reply;
    Cia402Command command;
    const CodecStatus answer = decode_cia402_reply(drive, received.frame, reply);
    const CodecStatus order = decode_cia402_command(drive, received.frame, command);
    if (answer == CodecStatus::kOk) {
      note_reply(i, received.time_ns, reply.q, reply.tau);
      drives_[i].state = to_string(state_of(reply.statusword));
    } else if (order == CodecStatus::kOk) {
      ++drives_[i].commands;
    } else if (is_about_a_frame_of_ours(answer) || is_about_a_frame_of_ours(order)) {
      ++malformed_;
    }
    return;
  }
  const bool of_the_host =
      status == CodecStatus::kOk && (id.node == 0 || id.node == bus_.host_node);
  if (!of_the_host) ++strangers_[received.frame.id];
}

}  // namespace clamber
