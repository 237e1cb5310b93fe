#include "firmware_hal/virtual_drives/cia402_drive.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

constexpr std::uint16_t kOverCurrent = 0x2310;  // CiA 402-2, error codes
constexpr std::uint16_t kDriveTooHot = 0x4310;
constexpr std::uint8_t kGenericError = 0x01;  // error register (1001h)
constexpr std::uint8_t kCurrentError = 0x02;
constexpr std::uint8_t kTemperatureError = 0x08;
constexpr std::uint8_t kCommunicationError = 0x10;
constexpr std::uint32_t kPdoInvalid = 0x80000000;

constexpr std::uint16_t kRpdo = 0x1400;
constexpr std::uint16_t kTpdo = 0x1800;
constexpr std::uint16_t kMapping = 0x200;  // from a PDO's communication object to its mapping

std::uint32_t steps_in(double seconds, double step) noexcept {
  return static_cast<std::uint32_t>(std::ceil(seconds / step - 1e-6));
}

std::uint32_t steps_in_ms(std::uint32_t milliseconds, double step) noexcept {
  return steps_in(1e-3 * milliseconds, step);
}

/// A mapped object: index, sub-index, bits (CiA 301, 7.5.2.36).
struct Mapped {
  explicit Mapped(std::uint32_t entry) noexcept
      : index(static_cast<std::uint16_t>(entry >> 16)),
        sub(static_cast<std::uint8_t>(entry >> 8)),
        bytes((entry & 0xFF) / 8) {}
  std::uint16_t index;
  std::uint8_t sub;
  std::size_t bytes;
};

bool is_mapping(std::uint16_t index) noexcept {
  return (index >= 0x1600 && index < 0x1604) || (index >= 0x1A00 && index < 0x1A04);
}

std::uint32_t permille(double tau, double per_permille) noexcept {
  const double value = std::clamp(std::round(tau / per_permille), -32768.0, 32767.0);
  return static_cast<std::uint16_t>(static_cast<std::int16_t>(value));
}

double newton_metres(std::uint32_t value, double per_permille) noexcept {
  return static_cast<std::int16_t>(static_cast<std::uint16_t>(value)) * per_permille;
}

}  // namespace

VirtualCia402Drive::VirtualCia402Drive(const Cia402Drive& codec, const Cia402Motor& motor,
                                       const WindingHeat& heat, double step)
    : VirtualDrive(heat, step), codec_(codec), motor_(motor) {
  define_objects();
}

void VirtualCia402Drive::define_objects() {
  ObjectDictionary& od = objects_;
  od.define(0x1000, 0, 4, 0x00020192, true);  // servo drive, profile 402
  od.define(0x1001, 0, 1, 0, true);
  od.define(0x1006, 0, 4, 0);
  od.define(0x1016, 0, 1, 1, true);
  od.define(0x1016, 1, 4, 0);
  od.define(0x1017, 0, 2, 0);
  od.define(0x1018, 0, 1, 1, true);
  od.define(0x1018, 1, 4, 0, true);  // no vendor: simulated
  for (std::uint16_t n = 0; n < 4; ++n) {
    const std::uint32_t invalid = n == 0 ? 0 : kPdoInvalid;
    for (const auto& [object, id] : {std::pair{kRpdo, 0x200u}, std::pair{kTpdo, 0x180u}}) {
      const auto index = static_cast<std::uint16_t>(object + n);
      const auto mapping = static_cast<std::uint16_t>(index + kMapping);
      od.define(index, 0, 1, 2, true);
      od.define(index, 1, 4, invalid | (id + 0x100u * n + codec_.node));
      od.define(index, 2, 1, 255);
      for (std::uint8_t sub = 0; sub <= 4; ++sub) od.define(mapping, sub, sub == 0 ? 1 : 4, 0);
    }
  }
  od.define(0x6007, 0, 2, 1);
  od.define(0x603F, 0, 2, 0, true);
  od.define(0x6040, 0, 2, 0);
  od.define(0x6041, 0, 2, statusword_of(state_), true);
  od.define(0x605A, 0, 2, 2);
  od.define(0x6060, 0, 1, 0);
  od.define(0x6061, 0, 1, 0, true);
  od.define(0x6064, 0, 4, 0, true);
  od.define(0x6071, 0, 2, 0);
  od.define(0x6076, 0, 4,
            static_cast<std::uint32_t>(std::lround(1e3 * motor_.rated_torque / motor_.gear_ratio)),
            true);
  od.define(0x6077, 0, 2, 0, true);
  od.define(0x607A, 0, 4, 0);
  od.define(0x6085, 0, 4,
            static_cast<std::uint32_t>(std::lround(motor_.quick_stop * codec_.counts_per_radian)));
  od.define(0x60B2, 0, 2, 0);
  od.define(0x60C2, 0, 1, 2, true);
  od.define(0x60C2, 1, 1, 1);
  od.define(0x60C2, 2, 1, 0xFD);
  od.define(0x6502, 0, 4, 1u << 7 | 1u << 9, true);  // cyclic position, cyclic torque
}

// ---- frames

void VirtualCia402Drive::receive(const CanFrame& frame) noexcept {
  if (deaf_ > 0) return;
  CanopenId id;
  const CodecStatus status = classify_canopen(frame, id);
  if (status != CodecStatus::kOk) {
    if (status == CodecStatus::kBadLength && id.node == codec_.node) ++traffic_.malformed;
    return;
  }
  switch (id.kind) {
    case CanopenKind::kNmt: {
      NmtCommand command = NmtCommand::kStop;
      std::uint8_t node = 0;
      if (decode_nmt(frame, command, node) != CodecStatus::kOk) return;
      if (node == 0 || node == codec_.node) take_nmt(command);
      return;
    }
    case CanopenKind::kSync:
      take_sync();
      return;
    case CanopenKind::kRpdo:
      if (id.node == codec_.node && id.pdo == 1) take_rpdo(frame);
      return;
    case CanopenKind::kSdoRequest: {
      Sdo sdo;
      bool request = false;
      if (id.node != codec_.node) return;
      ++traffic_.heard;
      if (decode_sdo(frame, sdo, request) == CodecStatus::kOk && request)
        take_sdo(sdo);
      else
        ++traffic_.malformed;
      return;
    }
    case CanopenKind::kHeartbeat:
      take_host_heartbeat(id.node);
      return;
    default:
      return;
  }
}

void VirtualCia402Drive::boot() noexcept {
  outbox_.push(encode_heartbeat(codec_.node, NmtState::kBoot));
}

void VirtualCia402Drive::take_nmt(NmtCommand command) noexcept {
  ++traffic_.heard;
  switch (command) {
    case NmtCommand::kStart:
      nmt_ = NmtState::kOperational;
      break;
    case NmtCommand::kPreOperational:
      nmt_ = NmtState::kPreOperational;
      break;
    case NmtCommand::kStop:
      if (nmt_ == NmtState::kOperational) lose_host();
      nmt_ = NmtState::kStopped;
      break;
    case NmtCommand::kResetNode:
      power_cycle(0.0);
      boot();
      break;
    case NmtCommand::kResetCommunication:
      lose_host();
      objects_.restore(0x1000, 0x1FFF);
      nmt_ = NmtState::kPreOperational;
      host_heard_ = false;
      boot();
      break;
  }
}

/// Refusals of CiA 301 that belong to an object's meaning.
std::uint32_t VirtualCia402Drive::refusal(const Sdo& request) noexcept {
  const std::uint32_t plain = objects_.refusal(request);
  if (plain != 0 || request.kind != SdoKind::kDownload) return plain;
  // A mapping is changed while it is empty, and its entries must exist.
  if (is_mapping(request.index) && request.sub != 0) {
    if (objects_.value(request.index, 0) != 0) return kSdoAbortState;
    const Mapped mapped(request.value);
    const ObjectDictionary::Object* object = objects_.find(mapped.index, mapped.sub);
    if (object == nullptr || object->size != mapped.bytes) return kSdoAbortNoMapping;
  }
  if (is_mapping(request.index) && request.sub == 0 && request.value > 4) return kSdoAbortRange;
  const bool mode = request.value == 8 || request.value == 10;
  if (request.index == 0x6060 && !mode) return kSdoAbortRange;
  if (request.index == 0x6060 && state_ == Cia402State::kEnabled) return kSdoAbortState;
  const bool own =
      motor_.lower_option != 0 && static_cast<std::int16_t>(request.value) == motor_.lower_option;
  if (request.index == 0x6007 && request.value > 3 && !own) return kSdoAbortRange;
  return 0;
}

void VirtualCia402Drive::take_sdo(const Sdo& request) noexcept {
  if (nmt_ == NmtState::kStopped) return;  // CiA 301, table 39: no SDO there
  Sdo answer = request;
  if (const std::uint32_t reason = refusal(request); reason != 0) {
    answer.kind = SdoKind::kAbort;
    answer.value = reason;
  } else if (request.kind == SdoKind::kUpload) {
    update_actual_values();
    const ObjectDictionary::Object* object = objects_.find(request.index, request.sub);
    answer.kind = SdoKind::kUploadReply;
    answer.size = object->size;
    answer.value = object->value;
  } else {
    objects_.set(request.index, request.sub, request.value);
    answer.kind = SdoKind::kDownloadReply;
    answer.size = 0;
    answer.value = 0;
    if (request.index == 0x6040) act_on_controlword();
    if (request.index == 0x6060) objects_.set(0x6061, 0, request.value);
    if (request.index == 0x1017) since_beat_ = 0;
    if (request.index == 0x1016) host_heard_ = host_lost_ = false;
  }
  outbox_.push(encode_sdo(answer, false));
}

void VirtualCia402Drive::take_rpdo(const CanFrame& frame) noexcept {
  if (nmt_ != NmtState::kOperational || (objects_.value(kRpdo, 1) & kPdoInvalid) != 0) return;
  ++traffic_.heard;
  std::size_t mapped = 0;
  for (std::uint32_t n = 1; n <= objects_.value(kRpdo + kMapping, 0); ++n)
    mapped += Mapped(objects_.value(kRpdo + kMapping, static_cast<std::uint8_t>(n))).bytes;
  if (mapped == 0 || frame.length < mapped) {  // CiA 301, 7.2.2.2: longer is accepted
    ++traffic_.malformed;
    emergency(kEmergencyPdoLength, 0);
    return;
  }
  std::copy_n(frame.data.begin(), rpdo_.size(), rpdo_.begin());
  rpdo_length_ = static_cast<std::uint8_t>(mapped);
}

void VirtualCia402Drive::take_sync() noexcept {
  if (nmt_ != NmtState::kOperational) return;
  if (rpdo_length_ > 0) {
    std::size_t at = 0;
    for (std::uint32_t n = 1; n <= objects_.value(kRpdo + kMapping, 0); ++n) {
      const Mapped mapped(objects_.value(kRpdo + kMapping, static_cast<std::uint8_t>(n)));
      objects_.set(mapped.index, mapped.sub, read_le(rpdo_, at, mapped.bytes));
      at += mapped.bytes;
    }
    rpdo_length_ = 0;
    act_on_controlword();
    act_on_setpoint();
  } else {
    target_rate_ = state_ == Cia402State::kQuickStop ? target_rate_ : 0.0;  // nothing new: stay
  }
  if ((objects_.value(kTpdo, 1) & kPdoInvalid) == 0 && objects_.value(kTpdo, 2) == 1)
    outbox_.push(mapped_tpdo());
}

CanFrame VirtualCia402Drive::mapped_tpdo() noexcept {
  update_actual_values();
  std::array<std::uint8_t, 8> bytes{};
  std::size_t at = 0;
  for (std::uint32_t n = 1; n <= objects_.value(kTpdo + kMapping, 0); ++n) {
    const Mapped mapped(objects_.value(kTpdo + kMapping, static_cast<std::uint8_t>(n)));
    if (at + mapped.bytes > bytes.size()) break;
    write_le(bytes, at, mapped.bytes, objects_.value(mapped.index, mapped.sub));
    at += mapped.bytes;
  }
  return make_frame(objects_.value(kTpdo, 1) & kMaxStandardId, std::span(bytes).first(at));
}

std::int32_t VirtualCia402Drive::counts() const noexcept {
  const double value = std::round(q() * codec_.counts_per_radian);
  return static_cast<std::int32_t>(std::clamp(value, -2147483648.0, 2147483647.0));
}

void VirtualCia402Drive::update_actual_values() noexcept {
  const std::uint16_t limit = limited_ ? kStatusInternalLimit : 0;
  objects_.set(0x6041, 0, statusword_of(state_) | limit);
  objects_.set(0x6064, 0, static_cast<std::uint32_t>(counts()));
  objects_.set(0x6077, 0, permille(measured_torque(), codec_.torque_per_permille));
}

void VirtualCia402Drive::emergency(std::uint16_t code, std::uint8_t error_register) noexcept {
  objects_.set(0x1001, 0, error_register);
  if (nmt_ != NmtState::kStopped)
    outbox_.push(encode_emergency({codec_.node, code, error_register, {}}));
}

// ---- the 402 state machine

void VirtualCia402Drive::act_on_controlword() noexcept {
  const auto word = static_cast<std::uint16_t>(objects_.value(0x6040));
  const Cia402State next = next_state(state_, controlword_, word);
  controlword_ = word;
  if (next == state_) return;
  if (state_ == Cia402State::kFault && !winding_.cooled()) return;  // still there
  if (state_ == Cia402State::kFault) {
    objects_.set(0x603F, 0, 0);
    emergency(kEmergencyReset, 0);
  }
  if (next == Cia402State::kSwitchOnDisabled) dropped_ = false;
  enter(next);
}

void VirtualCia402Drive::act_on_setpoint() noexcept {
  const bool position = objects_.value(0x6061) == 8;
  target_tau_ =
      newton_metres(objects_.value(position ? 0x60B2 : 0x6071), codec_.torque_per_permille);
  if (!position || state_ != Cia402State::kEnabled) return;
  const double target =
      static_cast<std::int32_t>(objects_.value(0x607A)) / codec_.counts_per_radian;
  const auto exponent = static_cast<std::int8_t>(objects_.value(0x60C2, 2));
  const double period = objects_.value(0x60C2, 1) * std::pow(10.0, exponent);
  target_rate_ = target_known_ && period > 0.0 ? (target - target_q_) / period : 0.0;
  target_q_ = target;
  target_known_ = true;
}

void VirtualCia402Drive::enter(Cia402State state) noexcept {
  if (state == Cia402State::kEnabled) {
    dropped_ = false;
    target_tau_ = 0.0;
    target_known_ = false;
    target_q_ = q();
    target_rate_ = 0.0;
  }
  if (state == Cia402State::kQuickStop) {
    target_tau_ = 0.0;
    target_q_ = q();
    target_rate_ = dq();
    if (objects_.value(0x605A) == 0) state = Cia402State::kSwitchOnDisabled;
  }
  sinking_ = false;
  state_ = state;
}

/// Object 6007h, "abort connection option code", in states in which the drive gives torque.
void VirtualCia402Drive::lose_host() noexcept {
  if (state_ != Cia402State::kEnabled && state_ != Cia402State::kQuickStop) {
    if (state_ == Cia402State::kReady || state_ == Cia402State::kSwitchedOn)
      enter(Cia402State::kSwitchOnDisabled);
    return;
  }
  if (const auto code = static_cast<std::int16_t>(objects_.value(0x6007));
      code < 0 && code == motor_.lower_option) {
    sinking_from_ = measured_torque();
    target_q_ = q();
    objects_.set(0x603F, 0, kEmergencyHeartbeatLost);
    enter(Cia402State::kFaultReaction);
    sinking_ = true;
    sunk_for_ = 0.0;
    return;
  }
  switch (static_cast<LostHostReaction>(objects_.value(0x6007))) {
    case LostHostReaction::kNone:
      return;
    case LostHostReaction::kFault:
      dropped_ = true;
      objects_.set(0x603F, 0, kEmergencyHeartbeatLost);
      enter(Cia402State::kFaultReaction);
      return;
    case LostHostReaction::kDisable:
      dropped_ = true;
      enter(Cia402State::kSwitchOnDisabled);
      return;
    case LostHostReaction::kQuickStop:
      if (state_ == Cia402State::kEnabled) enter(Cia402State::kQuickStop);
      return;
  }
}

void VirtualCia402Drive::break_down(std::uint32_t code) noexcept {
  const auto error = code != 0 ? static_cast<std::uint16_t>(code) : kOverCurrent;
  const bool heat = (error & 0xFF00) == 0x4300 || (error & 0xFF00) == 0x4200;
  const std::uint8_t kind = heat ? kTemperatureError : kCurrentError;
  objects_.set(0x603F, 0, error);
  emergency(error, static_cast<std::uint8_t>(kGenericError | kind));
  dropped_ = dropped_ || power() == DrivePower::kOn;
  enter(Cia402State::kFaultReaction);
}

void VirtualCia402Drive::power_cycle(double seconds) noexcept {
  dropped_ = dropped_ || power() == DrivePower::kOn;
  objects_.restore(0x1000, 0x6FFF);
  nmt_ = NmtState::kPreOperational;
  state_ = Cia402State::kSwitchOnDisabled;
  controlword_ = 0;
  rpdo_length_ = 0;
  host_heard_ = host_lost_ = sinking_ = false;
  since_beat_ = 0;
  deaf_ = steps_in(seconds, step());
}

DrivePower VirtualCia402Drive::power() const noexcept {
  if (state_ == Cia402State::kEnabled || state_ == Cia402State::kQuickStop || sinking_)
    return DrivePower::kOn;
  return dropped_ ? DrivePower::kDropped : DrivePower::kOff;
}

// ---- time

double VirtualCia402Drive::hold_torque(double target, double rate) const noexcept {
  return motor_.loop_kp * (target - q()) + motor_.loop_kd * (rate - dq());
}

double VirtualCia402Drive::torque() noexcept {
  double wanted = 0.0;
  if (state_ == Cia402State::kEnabled && objects_.value(0x6061) == 10) wanted = target_tau_;
  if (state_ == Cia402State::kEnabled && objects_.value(0x6061) == 8)
    wanted = target_tau_ + hold_torque(target_q_, target_rate_);
  if (state_ == Cia402State::kQuickStop) wanted = hold_torque(target_q_, target_rate_);
  if (sinking_) wanted = sinking_torque();
  const double given = std::clamp(wanted, -codec_.max_torque, codec_.max_torque);
  limited_ = given != wanted;
  return given;
}

/// Last torque and position loop fade to damping alone.
double VirtualCia402Drive::sinking_torque() const noexcept {
  const DrivesAlone law;
  const double left = std::max(0.0, 1.0 - sunk_for_ / law.lower_time);
  return left * (sinking_from_ + hold_torque(target_q_, 0.0)) - law.lower_damping * dq();
}

/// The ramp of a quick stop: the target goes on ever slower, then stands.
void VirtualCia402Drive::go_on_stopping() noexcept {
  const double slower = objects_.value(0x6085) / codec_.counts_per_radian * step();
  const double before = target_rate_;
  target_rate_ = std::copysign(std::max(0.0, std::abs(before) - slower), before);
  target_q_ += 0.5 * (before + target_rate_) * step();
  // Option codes 1 to 4: let go at standstill; 5 to 8: stay.
  if (target_rate_ == 0.0 && objects_.value(0x605A) < 5) enter(Cia402State::kSwitchOnDisabled);
}

void VirtualCia402Drive::take_host_heartbeat(std::uint8_t node) noexcept {
  const std::uint32_t consumer = objects_.value(0x1016, 1);
  if (node != (consumer >> 16 & 0x7F) || (consumer & 0xFFFF) == 0) return;
  host_heard_ = true;
  host_silence_ = 0;
  if (!host_lost_) return;
  host_lost_ = false;
  if (state_ != Cia402State::kFault) emergency(kEmergencyReset, 0);
}

void VirtualCia402Drive::watch_host() noexcept {
  const std::uint32_t patience = objects_.value(0x1016, 1) & 0xFFFF;
  if (!host_heard_ || host_lost_ || patience == 0) return;
  if (++host_silence_ <= steps_in_ms(patience, step())) return;
  host_lost_ = true;
  emergency(kEmergencyHeartbeatLost, kGenericError | kCommunicationError);
  lose_host();
}

void VirtualCia402Drive::beat() noexcept {
  const std::uint32_t period = objects_.value(0x1017);
  if (period == 0 || heartbeat_muted_ || ++since_beat_ < steps_in_ms(period, step())) return;
  since_beat_ = 0;
  outbox_.push(encode_heartbeat(codec_.node, nmt_));
}

void VirtualCia402Drive::pass() noexcept {
  winding_.pass(measured_torque(), step());
  if (deaf_ > 0) {
    if (--deaf_ == 0) boot();
    return;
  }
  if (sinking_) sunk_for_ += step();
  const bool hosted = !host_lost_ && nmt_ == NmtState::kOperational;
  if (state_ == Cia402State::kFaultReaction && (!sinking_ || hosted)) {
    dropped_ = dropped_ || sinking_;
    enter(Cia402State::kFault);
  }
  if (state_ == Cia402State::kQuickStop) go_on_stopping();
  const bool broken =
      state_ == Cia402State::kFault || (state_ == Cia402State::kFaultReaction && !sinking_);
  if (winding_.too_hot() && !broken) break_down(kDriveTooHot);
  watch_host();
  beat();
}

}  // namespace clamber
