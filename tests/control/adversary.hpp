// A robot, its buses and its operator at their worst, tick by tick from a seed, and what a
// controller must keep whatever they do. For bench/random_inputs and a slice of it as a test.
#pragma once

#include <cstdio>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "control/controller.hpp"
#include "tests/control/test_plan.hpp"

namespace clamber::test {

struct CampaignResult {
  std::uint64_t ticks = 0;
  std::uint64_t lives = 0;  ///< controllers loaded anew
  std::array<std::uint64_t, kModeCount> modes{};
  std::array<std::uint64_t, kFaultCount> faults{};  ///< latched
  std::uint64_t acknowledged = 0;
  std::uint64_t switched = 0;
  std::string broken;  ///< the first rule that did not hold, and where; empty: none
};

class Adversary {
 public:
  Adversary(std::uint64_t seed, std::uint32_t joints)
      : random_(seed),
        joints_(joints),
        images_{make_image(joints, smooth_keyframes(joints, kKeyframes)), other_image(joints)},
        workspaces_(2, std::vector<double>(Controller::workspace_size(kKeyframes))),
        robot_(joints),
        seen_(joints),
        load_(joints) {}

  CampaignResult run(std::uint64_t ticks) {
    CampaignResult result;
    while (result.ticks < ticks && result.broken.empty()) {
      begin_life();
      ++result.lives;
      const std::uint64_t life = std::min<std::uint64_t>(ticks - result.ticks, 500 + below(8000));
      for (std::uint64_t i = 0; i < life && result.broken.empty(); ++i) tick(result);
    }
    return result;
  }

 private:
  static constexpr std::size_t kKeyframes = 31;

  static std::vector<std::byte> other_image(std::uint32_t joints) {
    std::vector<ImageKeyframe> keyframes = smooth_keyframes(joints, kKeyframes);
    for (ImageKeyframe& k : keyframes)
      for (std::uint32_t j = 0; j < joints; ++j) k.q[j] *= j % 2 == 0 ? 0.5 : -0.4;
    return make_image(joints, keyframes);
  }

  std::uint64_t below(std::uint64_t n) { return random_() % n; }
  bool one_in(std::uint64_t n) { return below(n) == 0; }
  double real(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  void begin_life() {
    ControllerConfig config = make_config(joints_);
    config.time_scale = real(0.3, 1.2);
    config.pause_time = real(0.05, 0.5);
    config.lowering_time = real(0.05, 0.6);
    config.failure_policy = static_cast<FailurePolicy>(below(3));
    config.saturation_time = one_in(2) ? real(0.01, 0.3) : ControllerConfig::kNever;
    config.tracking_error_limit = one_in(2) ? real(0.02, 0.4) : ControllerConfig::kNever;
    config.limit_margin = one_in(2) ? 0.05 : ControllerConfig::kNever;
    if (one_in(3)) config.overspeed_factor = ControllerConfig::kNever;
    if (one_in(3)) config.jump_limit = 1e9;
    config.feed_forward = one_in(4) ? FeedForward::kNone : FeedForward::kPlan;
    if (one_in(3)) config.joints[below(joints_)].spring_stiffness = real(100.0, 2000.0);
    // 1: hardly ever, 6: in every other tick something is wrong.
    mood_ = 1 + below(6);
    const LoadReport report = controller_->load(config, kRobotHash, images_[0], workspaces_[0]);
    const LoadReport other =
        Controller::open(config, kRobotHash, images_[1], workspaces_[1], other_plan_);
    loaded_ = report.status == LoadStatus::kOk && other.status == LoadStatus::kOk;
    for (std::size_t j = 0; j < joints_; ++j) {
      robot_.plants[j] = Plant{.q = real(-0.3, 0.3)};
      load_[j] = real(-12.0, 12.0);
      robot_.states[j] = {.q = robot_.plants[j].q, .tau = wild(real(-5.0, 5.0), 50)};
    }
    if (!one_in(5)) {
      controller_->request(OperatorCommand::kArm);
      controller_->request(OperatorCommand::kStart);
    }
    before_ = controller_->supervision();
    if (one_in(4)) stuck_ = {below(joints_), 1 + below(12), 0};
  }

  /// Now and then no number at all, or one that no joint can have.
  double wild(double value, std::uint64_t rarity) {
    if (!one_in(rarity)) return value;
    switch (below(7)) {
      case 0:
        return std::numeric_limits<double>::quiet_NaN();
      case 1:
        return std::numeric_limits<double>::infinity();
      case 2:
        return -std::numeric_limits<double>::infinity();
      case 3:
        return std::numeric_limits<double>::max();
      case 4:
        return std::numeric_limits<double>::denorm_min();
      case 5:
        return real(-1e6, 1e6);
      default:
        return value + real(-0.5, 0.5);
    }
  }

  void disturb_states() {
    seen_ = robot_.states;
    const std::uint64_t rarity = 16000u >> (2 * mood_ - 2);
    for (JointState& s : seen_) {
      if (!one_in(rarity * 8)) continue;
      s.q = wild(s.q, 3);
      s.dq = wild(s.dq, 3);
      s.tau = wild(s.tau, 3);
      s.temperature = wild(one_in(6) ? 130.0 : 40.0, 3);
      s.flags = one_in(3) ? static_cast<std::uint32_t>(random_()) : s.flags;
      s.age = static_cast<std::uint32_t>(random_());
    }
    // Trouble that stays.
    if (stuck_.ticks == 0) frozen_ = robot_.states[below(joints_)];
    if (one_in(rarity)) stuck_ = {below(joints_), 1 + below(one_in(3) ? 300 : 12), below(6)};
    if (stuck_.ticks > 0) {
      --stuck_.ticks;
      JointState& s = seen_[stuck_.joint];
      if (stuck_.kind == 0) s.flags |= kJointStale;
      if (stuck_.kind == 1) s.q += 0.3;
      if (stuck_.kind == 2) s.flags |= kJointSaturated;
      if (stuck_.kind == 3) s.dq = 20.0;
      if (stuck_.kind == 4) s = frozen_;
      if (stuck_.kind == 5) s.q = 2.1;  // beyond its range
    }
    if (one_in(rarity)) load_[below(joints_)] = real(-60.0, 60.0);
  }

  void disturb_operation() {
    if (one_in(1500))
      controller_->request(static_cast<OperatorCommand>(below(kOperatorCommandCount)));
    if (one_in(2000)) controller_->request(OperatorCommand::kPause);
    if (one_in(40)) controller_->request(OperatorCommand::kAck);
    if (one_in(60)) controller_->request(OperatorCommand::kArm);
    if (one_in(60)) controller_->request(OperatorCommand::kStart);
    if (one_in(60)) controller_->request(OperatorCommand::kResume);
    if (one_in(500)) controller_->set_speed(wild(real(-0.2, 1.3), 5));
    if (one_in(40000u >> (2 * mood_)))
      controller_->set_bus_health(
          {.down = one_in(3), .skipped_ticks = static_cast<std::uint32_t>(below(150))});
    if (one_in(800))
      controller_->set_feed_forward(one_in(2) ? FeedForward::kNone : FeedForward::kPlan);
    if (one_in(800))
      controller_->set_gains(
          std::vector<PidGains>(joints_, {real(0.0, 2000.0), real(0.0, 500.0), real(0.0, 30.0)}));
  }

  void tick(CampaignResult& result) {
    disturb_states();
    disturb_operation();
    if (one_in(1500) &&
        controller_->switch_plan(other_plan_, wild(real(0.0, 3.0), 6)) == SwitchStatus::kOk)
      ++result.switched;
    const std::uint32_t requests = controller_->requests();
    // Another size than the robot's, once in a while.
    const bool short_span = one_in(6000);
    const auto states = std::span(seen_).first(short_span ? joints_ - 1 : joints_);
    static_cast<void>(controller_->tick(states, robot_.commands, frame_));
    check(requests, result);
    // Where nothing carries it, it hangs near where it began, so that it can be started again.
    for (std::size_t j = 0; j < joints_; ++j)
      robot_.plants[j].load = has_torque(before_.mode) ? load_[j] : -30.0 * robot_.plants[j].q;
    robot_.step(controller_->config().dt);
    for (auto& plant : robot_.plants) {  // end stops
      plant.q = std::clamp(plant.q, -2.3, 2.3);
      plant.dq = std::clamp(plant.dq, -30.0, 30.0);
    }
    ++result.ticks;
  }

  void check(std::uint32_t requests, CampaignResult& result) {
    const SupervisorState now = controller_->supervision();
    const bool acks = (requests & 1u << static_cast<unsigned>(OperatorCommand::kAck)) != 0;
    const bool arms = (requests & 1u << static_cast<unsigned>(OperatorCommand::kArm)) != 0;
    const bool failed =
        now.mode == Mode::kLowering || now.mode == Mode::kLimp || now.mode == Mode::kFault;
    const bool latched = now.fault != FaultCode::kNone;
    const auto rule = [&](bool holds, const char* what) {
      if (holds || !result.broken.empty()) return;
      result.broken = std::string(what) + ": tick " + std::to_string(result.ticks) + ", " +
                      to_string(before_.mode) + " -> " + to_string(now.mode) + " (" +
                      to_string(now.fault) + ")";
    };
    rule(loaded_, "the plans are accepted");
    rule(now.mode == Mode::kHolding || failed == latched, "mode and fault fit together");
    rule(before_.fault == FaultCode::kNone || latched || acks, "a fault goes by ack alone");
    rule(has_torque(before_.mode) || !has_torque(now.mode) || arms, "torque comes by arm alone");
    rule(!latched || !moves_on_plan(now.mode), "no motion while a fault stands");
    for (std::size_t j = 0; j < joints_; ++j) {
      const JointCommand& c = robot_.commands[j];
      rule(std::isfinite(c.q) && std::isfinite(c.dq) && std::isfinite(c.tau), "finite commands");
      rule(std::abs(c.tau) <= controller_->config().joints[j].torque_limit, "torque limit");
      rule(c.kp >= 0.0 && c.kp <= 2000.0 && c.kd >= 0.0 && c.kd <= 30.0, "gains of the settings");
      rule(has_torque(now.mode) || (c.tau == 0.0 && c.kp == 0.0 && c.kd == 0.0),
           "no torque where there must be none");
    }
    ++result.modes[static_cast<std::size_t>(now.mode)];
    if (latched && before_.fault == FaultCode::kNone)
      ++result.faults[static_cast<std::size_t>(now.fault)];
    result.acknowledged += !latched && before_.fault != FaultCode::kNone ? 1 : 0;
    before_ = now;
  }

  struct Stuck {
    std::uint64_t joint = 0, ticks = 0, kind = 0;
  };

  std::mt19937_64 random_;
  std::uint32_t joints_;
  std::vector<std::vector<std::byte>> images_;
  std::vector<std::vector<double>> workspaces_;
  ControllerPlan other_plan_;
  PlantRobot robot_;
  std::vector<JointState> seen_;
  std::vector<double> load_;  ///< N m
  std::unique_ptr<Controller> controller_ = std::make_unique<Controller>();
  TelemetryFrame frame_;
  SupervisorState before_;
  Stuck stuck_;
  JointState frozen_;
  std::uint64_t mood_ = 1;
  bool loaded_ = false;
};

inline void print(const CampaignResult& result, std::FILE* out) {
  std::fprintf(out, "%llu ticks, %llu lives, %llu faults acknowledged, %llu plans switched\n",
               static_cast<unsigned long long>(result.ticks),
               static_cast<unsigned long long>(result.lives),
               static_cast<unsigned long long>(result.acknowledged),
               static_cast<unsigned long long>(result.switched));
  for (std::size_t m = 0; m < kModeCount; ++m)
    std::fprintf(out, "  in %-18s %10llu ticks\n", to_string(static_cast<Mode>(m)),
                 static_cast<unsigned long long>(result.modes[m]));
  for (std::size_t f = 1; f < kFaultCount; ++f)
    std::fprintf(out, "  %-40s %8llu times\n", to_string(static_cast<FaultCode>(f)),
                 static_cast<unsigned long long>(result.faults[f]));
  std::fprintf(out, "%s\n", result.broken.empty() ? "every rule held" : result.broken.c_str());
}

}  // namespace clamber::test
