#include "apps/operator_seat.hpp"

#include <cmath>

namespace clamber {
namespace {

// Until every joint has been heard, the controller keeps `arm` back.
constexpr std::uint32_t kArmPatience = 1000;  // ticks

bool moves_or_pauses(Mode mode) noexcept { return moves_on_plan(mode) || mode == Mode::kPaused; }

bool took_effect(OperatorCommand command, SupervisorState before, SupervisorState now) noexcept {
  const bool well = now.fault == FaultCode::kNone;
  switch (command) {
    case OperatorCommand::kAck:
      return before.fault != FaultCode::kNone && well;
    case OperatorCommand::kArm:
      return !has_torque(before.mode) && has_torque(now.mode) && well;
    case OperatorCommand::kStart:
      return !moves_or_pauses(before.mode) && moves_on_plan(now.mode);
    case OperatorCommand::kResume:
      return before.mode == Mode::kPaused && moves_on_plan(now.mode);
    case OperatorCommand::kPause:
      return moves_on_plan(before.mode) && now.mode == Mode::kPaused;
    case OperatorCommand::kStop:
      return moves_or_pauses(before.mode) && now.mode == Mode::kHolding && well;
    case OperatorCommand::kDisarm:
      return has_torque(before.mode) && !has_torque(now.mode);
    case OperatorCommand::kEstop:
      return !well;
    case OperatorCommand::kNone:
      break;
  }
  return false;
}

struct Refusal {
  const char* reason;
  const char* detail;
};

Refusal why_not(OperatorCommand command, SupervisorState before, SupervisorState now) noexcept {
  const bool well = now.fault == FaultCode::kNone;
  if (command == OperatorCommand::kAck) {
    if (before.fault == FaultCode::kNone) return {"there is no fault", ""};
    if (now.mode == Mode::kLowering || now.mode == Mode::kLimp)
      return {"the robot has not come to rest yet: ", to_string(now.mode)};
    return {"the fault stands until ", clear_condition(now.fault)};
  }
  if (!well) return {"fault, to be acknowledged first: ", to_string(now.fault)};
  if (command == OperatorCommand::kArm && before.mode == Mode::kBoot)
    return {"some joint has no usable state", ""};
  return {"not while ", to_string(before.mode)};
}

}  // namespace

OperatorSeat::OperatorSeat(OperatorDesk* desk, Controller& controller) noexcept
    : desk_(desk), controller_(controller) {}

bool OperatorSeat::armed() noexcept {
  if (desk_ == nullptr) return true;
  bool done = false;
  const char* reason = "";
  const char* detail = "";
  const bool asked = desk_->requests.take(request_);
  switch (request_.command) {
    case OperatorCommand::kNone:
      break;
    case OperatorCommand::kArm:
      if (!stopped_) return true;  // answered when the controller has done it
      reason = "fault, to be acknowledged first: ";
      detail = to_string(FaultCode::kEstop);
      break;
    case OperatorCommand::kEstop:
      done = stopped_ = true;
      break;
    case OperatorCommand::kAck:
      done = stopped_;
      reason = "there is no fault";
      stopped_ = false;
      break;
    default:
      reason = "not while ";
      detail = to_string(stopped_ ? Mode::kFault : Mode::kDisabled);
  }
  // First the state, then the answer: who was answered may ask for the state at once.
  publish(
      {stopped_ ? Mode::kFault : Mode::kDisabled, stopped_ ? FaultCode::kEstop : FaultCode::kNone});
  if (asked) answer(done, reason, detail);
  return false;
}

bool OperatorSeat::stopped_while_enabling() noexcept {
  OperatorRequest next;
  while (desk_ != nullptr && desk_->requests.take(next)) {
    if (next.command != OperatorCommand::kEstop) {
      answer(next.id, false, "not while ", "the drives are being switched on");
      continue;
    }
    stopped_ = true;
    publish({Mode::kFault, FaultCode::kEstop});
    answer(false, "fault, to be acknowledged first: ", to_string(FaultCode::kEstop));
    answer(next.id, true, "", "");
  }
  return stopped_;
}

void OperatorSeat::begin() noexcept {
  before_ = controller_.supervision();
  controller_.request(OperatorCommand::kArm);
  if (desk_ == nullptr) controller_.request(OperatorCommand::kStart);
  patience_ = kArmPatience;
}

void OperatorSeat::before_tick() noexcept {
  if (desk_ == nullptr || request_.command != OperatorCommand::kNone) return;
  if (!desk_->requests.take(request_)) return;
  before_ = controller_.supervision();
  controller_.request(request_.command);
  const bool waits = request_.command == OperatorCommand::kArm && before_.mode == Mode::kBoot;
  patience_ = waits ? kArmPatience : 1;
}

void OperatorSeat::after_tick(const TelemetryFrame& frame) noexcept {
  if (desk_ == nullptr) return;
  const SupervisorState now = controller_.supervision();
  if (has_torque(now.mode))
    for (std::uint32_t j = 0; j < frame.joint_count; ++j) {
      const double error = std::abs(frame.q_ref[j] - frame.q[j]);
      if (error <= status_.worst_error) continue;
      status_.worst_error = error;
      status_.worst_joint = j;
    }
  status_.ticks = frame.sequence + 1;
  status_.time = frame.time;
  status_.plan_time = frame.plan_time;
  status_.fault_joint = concerns_a_joint(now.fault) ? controller_.fault_joint() : kMaxJoints;
  publish(now);
  decide(now);
}

void OperatorSeat::decide(SupervisorState now) noexcept {
  if (request_.command == OperatorCommand::kNone) return;
  const bool done = took_effect(request_.command, before_, now);
  if (patience_ > 0) --patience_;
  if (!done && patience_ > 0 && now.fault == FaultCode::kNone) return;
  const Refusal refusal = why_not(request_.command, before_, now);
  answer(done, refusal.reason, refusal.detail);
}

void OperatorSeat::answer(bool done, const char* reason, const char* detail) noexcept {
  answer(request_.id, done, done ? "" : reason, done ? "" : detail);
  request_ = {};
}

void OperatorSeat::answer(std::uint64_t id, bool done, const char* reason,
                          const char* detail) noexcept {
  // The server never waits for more answers than it has asked questions.
  (void)desk_->answers.put({id, done, reason, detail});
}

void OperatorSeat::publish(SupervisorState now) noexcept {
  status_.state = to_string(now.mode);
  status_.fault = to_string(now.fault);
  desk_->status.write(status_);
}

}  // namespace clamber
