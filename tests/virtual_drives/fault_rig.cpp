#include "tests/virtual_drives/fault_rig.hpp"

#include <cmath>
#include <functional>
#include <map>
#include <numbers>

#include "control/controller.hpp"
#include "firmware_hal/virtual_drives/bench_plant.hpp"
#include "firmware_hal/virtual_drives/rehearsal_bus.hpp"
#include "tests/control/test_plan.hpp"
#include "tests/firmware_hal/coman_map.hpp"

namespace clamber::test {
namespace {

constexpr std::uint32_t kJoints = 6;
constexpr double kLoad = 4.0;  // N m, pulls at every joint
constexpr int kReadyTick = 100;
constexpr int kExecutingTick = 1250;  // in the middle of the plan, at its highest speed
constexpr int kHoldingTick = 2100;

/// The shipped map's first two buses with three drives each.
BusMap small_map(BusProtocol protocol) {
  BusMap map = shipped_map(protocol == BusProtocol::kMit ? "coman_mit.yaml" : "coman_cia402.yaml");
  map.joint_count = kJoints;
  map.buses.resize(2);
  int joint = 0;
  for (Bus& bus : map.buses) {
    bus.drives.resize(3);
    for (JointDrive& drive : bus.drives) drive.joint = joint++;
  }
  return map;
}

/// 0.2 rad there, at rest at both ends, in 1.5 s.
std::vector<ImageKeyframe> keyframes() {
  std::vector<ImageKeyframe> all(16);
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i].time = 0.1 * static_cast<double>(i);
    for (std::uint32_t j = 0; j < kJoints; ++j) {
      all[i].q[j] = 0.1 * (1.0 - std::cos(std::numbers::pi * all[i].time / 1.5));
      all[i].tau[j] = -kLoad;
    }
  }
  return all;
}

ControllerConfig config() {
  ControllerConfig c = make_config(kJoints);
  c.start_time = 0.5;
  c.hold_time = 5.0;
  return c;
}

class Rig {
 public:
  explicit Rig(BusProtocol protocol)
      : map(small_map(protocol)),
        plant(std::vector<BenchJoint>(kJoints, BenchJoint{.load = kLoad})),
        bus(map, plant),
        image(make_image(kJoints, keyframes())),
        workspace(Controller::workspace_size(keyframes().size())) {
    if (controller.load(config(), kRobotHash, image, workspace).status != LoadStatus::kOk)
      throw InputError("the fault matrix's plan is refused");
    controller.request(OperatorCommand::kArm);
    controller.request(OperatorCommand::kStart);
  }

  /// As the executor does it.
  void tick() {
    if (host_alive) {
      bus_status = bus.exchange(commands, states, 0);
      status = controller.tick(states, commands, frame);
      return;
    }
    const std::int64_t until = bus.buses().now_ns() + 1'000'000;
    while (bus.buses().now_ns() < until) bus.buses().wait(until);
  }
  double error() {
    double worst = 0.0;
    for (std::uint32_t j = 0; j < kJoints; ++j)
      worst = std::max(worst, std::abs(plant.joint(j).q - frame.q_ref[j]));
    return worst;
  }
  PlacedDrive& drive() { return bus.drives().bus(0)[0]; }

  BusMap map;
  BenchPlant plant;
  RehearsalBus bus;
  Controller controller;
  std::vector<std::byte> image;
  std::vector<double> workspace;
  std::vector<JointCommand> commands{kJoints};
  std::vector<JointState> states{kJoints};
  TelemetryFrame frame;
  TickStatus status = TickStatus::kMovingToStart;
  BusStatus bus_status = BusStatus::kOk;
  bool host_alive = true;
};

FrameFault both_ways(FrameFaultKind kind, double share) {
  return {.kind = kind, .share = share, .from_drives = true, .to_drives = true};
}

using Mischief = std::function<void(Rig&)>;

Mischief frames(const FrameFault& fault) {
  return [fault](Rig& rig) { rig.bus.port(0).set_fault(fault); };
}

/// The id with which the first drive of the first bus answers.
std::uint32_t reply_id(const Rig& rig) {
  const JointDrive& drive = rig.map.buses[0].drives[0];
  return rig.map.buses[0].protocol == BusProtocol::kMit ? drive.reply_id : 0x180u + drive.node;
}

Mischief on_cia402(const std::function<void(VirtualCia402Drive&)>& mischief) {
  return [mischief](Rig& rig) {
    if (rig.drive().cia402 == nullptr) throw InputError("not with this protocol");
    mischief(*rig.drive().cia402);
  };
}

const std::map<std::string, Mischief>& mischiefs() {
  static const std::map<std::string, Mischief> all{
      {"nothing", [](Rig&) {}},
      {"drop_1", frames(both_ways(FrameFaultKind::kDrop, 0.01))},
      {"drop_5", frames(both_ways(FrameFaultKind::kDrop, 0.05))},
      {"drop_20", frames(both_ways(FrameFaultKind::kDrop, 0.20))},
      {"duplicate", frames(both_ways(FrameFaultKind::kDuplicate, 0.20))},
      {"reorder", frames(both_ways(FrameFaultKind::kReorder, 0.20))},
      {"delay", frames({.kind = FrameFaultKind::kDelay, .delay_ns = 2'000'000})},
      {"stale",
       [](Rig& rig) {
         rig.bus.port(0).set_fault({.kind = FrameFaultKind::kStale, .id = reply_id(rig)});
       }},
      {"wrong_id", frames(both_ways(FrameFaultKind::kWrongId, 0.05))},
      {"bad_length", frames(both_ways(FrameFaultKind::kBadLength, 0.05))},
      {"corrupt", frames({.kind = FrameFaultKind::kCorrupt, .share = 0.05})},
      {"corrupt_commands", frames({.kind = FrameFaultKind::kCorrupt,
                                   .share = 0.05,
                                   .from_drives = false,
                                   .to_drives = true})},
      {"emergency", on_cia402([](VirtualCia402Drive& drive) { drive.emergency(0x3210, 0x05); })},
      {"heartbeat_lost", on_cia402([](VirtualCia402Drive& drive) { drive.mute_heartbeat(true); })},
      {"reboot", [](Rig& rig) { rig.drive().drive->power_cycle(0.05); }},
      {"drive_fault", [](Rig& rig) { rig.drive().drive->break_down(0); }},
      {"over_temperature", [](Rig& rig) { rig.drive().drive->set_temperature(140.0); }},
      {"encoder_jump", [](Rig& rig) { rig.drive().drive->jump_encoder(0.3); }},
      {"bus_off",
       [](Rig& rig) { rig.bus.buses().model(0).disturb(ModelBuses::kHostNode, 20, 500); }},
      {"error_passive",
       [](Rig& rig) { rig.bus.buses().model(0).disturb(ModelBuses::kHostNode, 20, 17); }},
      {"no_room",
       frames({.kind = FrameFaultKind::kNoRoom, .from_drives = false, .to_drives = true})},
      {"interface_down", [](Rig& rig) { rig.bus.buses().port(0).set_down(true); }},
      {"unplugged",
       [](Rig& rig) {
         for (std::size_t i = 0; i < rig.bus.drives().bus(0).size(); ++i)
           rig.bus.buses().model(0).set_connected(ModelBuses::drive_node(i), false);
       }},
      {"host_killed", [](Rig& rig) { rig.host_alive = false; }},
  };
  return all;
}

std::string drives_of(Rig& rig) {
  std::string found = "on";
  for (std::size_t b = 0; b < 2; ++b) {
    for (const PlacedDrive& placed : rig.bus.drives().bus(b)) {
      if (placed.drive->power() == DrivePower::kDropped) return "let go";
      if (placed.cia402 != nullptr && placed.cia402->state() == Cia402State::kQuickStop)
        found = "stop";
      else if (placed.drive->power() == DrivePower::kOff && found == "on")
        found = "off";
    }
  }
  return found;
}

std::string first_link_fault(const Rig& rig) {
  for (std::size_t b = 0; b < 2; ++b)
    for (std::size_t i = 0; i < rig.bus.host(b).size(); ++i)
      if (const LinkFault fault = rig.bus.host(b).status(i).fault; fault != LinkFault::kNone)
        return to_string(fault);
  return to_string(FaultCode::kDriveFault);
}

int milliradians(double radians) { return static_cast<int>(std::ceil(1e3 * radians - 1e-6)); }

FaultOutcome switch_on(Rig& rig) {
  FaultOutcome outcome;
  for (std::uint32_t j = 0; j < kJoints; ++j) rig.plant.joint(j).load = 0.0;  // it is hung up
  double moved = 0.0;
  const std::int64_t start = rig.bus.buses().now_ns();
  if (rig.host_alive) {
    const bool on = rig.bus.enable() == BusStatus::kOk;
    outcome.host = on ? "enables" : "refuses";
    const BusTroubleReport& trouble = rig.bus.bus().trouble();
    if (!on && trouble.link.fault != LinkFault::kNone)
      outcome.detail = to_string(trouble.link.fault);
    else if (!on)
      outcome.detail = trouble.what == BusTrouble::kJointSilent ? "joint silent" : "not enabled";
  } else {
    for (int i = 0; i < kFaultTicks; ++i) rig.tick();
    outcome.host = "none";
  }
  outcome.ticks =
      rig.host_alive ? static_cast<int>((rig.bus.buses().now_ns() - start) / 1'000'000) : 0;
  for (std::uint32_t j = 0; j < kJoints; ++j)
    moved = std::max(moved, std::abs(rig.plant.joint(j).q));
  outcome.drives = drives_of(rig);
  outcome.moved = milliradians(moved);
  return outcome;
}

int tick_of(RobotState state) {
  return state == RobotState::kReady       ? kReadyTick
         : state == RobotState::kExecuting ? kExecutingTick
                                           : kHoldingTick;
}

FaultOutcome disturb(Rig& rig, RobotState state, const Mischief& mischief) {
  if (rig.bus.enable() != BusStatus::kOk) throw InputError("the healthy robot does not enable");
  for (int i = 0; i < tick_of(state); ++i) rig.tick();
  FaultOutcome outcome;
  mischief(rig);
  outcome.host = rig.host_alive ? "goes on" : "none";
  double moved = 0.0;
  int waited = 0;
  int held = 0;
  int dropped = 0;
  for (int i = 1; i <= kFaultTicks; ++i) {
    rig.tick();
    moved = std::max(moved, rig.error());
    if (rig.status == TickStatus::kWaiting && waited == 0) waited = i;
    if (rig.status == TickStatus::kFault && held == 0) held = i;
    if (drives_of(rig) != "on" && dropped == 0) dropped = i;
  }
  if (waited > 0) outcome.host = "waits";
  if (held > 0)
    outcome.host = rig.controller.supervision().mode == Mode::kLowering ? "lowers" : "holds";
  outcome.ticks = held > 0 ? held : (waited > 0 ? waited : dropped);
  if (held > 0) outcome.detail = to_string(rig.controller.fault());
  if (rig.controller.fault() == FaultCode::kDriveFault) outcome.detail = first_link_fault(rig);
  outcome.drives = drives_of(rig);
  outcome.moved = milliradians(moved);
  return outcome;
}

}  // namespace

const char* to_string(RobotState state) {
  switch (state) {
    case RobotState::kDisabled:
      return "disabled";
    case RobotState::kReady:
      return "ready";
    case RobotState::kExecuting:
      return "executing";
    case RobotState::kHolding:
      return "holding";
  }
  return "?";
}

FaultOutcome rehearse_fault(const std::string& fault, BusProtocol protocol, RobotState state) {
  const auto found = mischiefs().find(fault);
  if (found == mischiefs().end()) throw InputError("unknown fault '" + fault + "'");
  Rig rig(protocol);
  if (state != RobotState::kDisabled) return disturb(rig, state, found->second);
  found->second(rig);
  return switch_on(rig);
}

}  // namespace clamber::test
