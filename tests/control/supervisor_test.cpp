// The supervisor, whole: every state with every combination of inputs, and docs/supervisor.md,
// which is made from the function. CLAMBER_WRITE_DOCS=1 writes the page.
//
// "Torque while a joint is stale": the host closes no loop over a joint that it does not hear, and
// nothing moves on the plan. The drive of such a joint is asked to hold by itself (docs/faults.md);
// to let it go because of a lost frame would let a robot fall that hangs on it.
#include "control/supervisor.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>
#include <vector>

namespace clamber {
namespace {

constexpr FaultSet kAllFaults = (1u << kFaultCount) - 2u;  // bit 0 is kNone's

Mode mode_at(std::size_t i) { return static_cast<Mode>(i); }
FaultCode fault_at(std::size_t i) { return static_cast<FaultCode>(i); }
constexpr FailurePolicy kPlanned[] = {FailurePolicy::kHold, FailurePolicy::kLower,
                                      FailurePolicy::kLimp};

bool allowed(const SupervisorState& s) {
  if (s.mode == Mode::kHolding) return true;
  const bool failed = s.mode == Mode::kLowering || s.mode == Mode::kLimp || s.mode == Mode::kFault;
  return failed == (s.fault != FaultCode::kNone);
}

std::vector<SupervisorState> all_states() {
  std::vector<SupervisorState> states;
  for (std::size_t m = 0; m < kModeCount; ++m)
    for (std::size_t f = 0; f < kFaultCount; ++f)
      if (const SupervisorState s{mode_at(m), fault_at(f)}; allowed(s)) states.push_back(s);
  return states;
}

/// One fault stands for all that can be latched.
std::vector<SupervisorState> shown_states() {
  std::vector<SupervisorState> states;
  for (const SupervisorState& s : all_states())
    if (s.fault == FaultCode::kNone || s.fault == FaultCode::kEstop) states.push_back(s);
  return states;
}

FaultSet present(const SupervisorInputs& in) {
  return in.faults | (in.command == OperatorCommand::kEstop ? bit(FaultCode::kEstop) : 0u);
}

DriveAction demanded(FaultSet faults, FailurePolicy planned) {
  DriveAction most = DriveAction::kFollow;
  for (std::size_t f = 1; f < kFaultCount; ++f)
    if ((faults & bit(fault_at(f))) != 0) most = std::max(most, reaction_to(fault_at(f), planned));
  return most;
}

/// What must hold of every single step; the first that does not, or nullptr.
const char* broken_rule(const SupervisorState& s, const SupervisorInputs& in,
                        const SupervisorState& next, DriveAction demand) {
  const bool faulty = present(in) != 0;
  const bool acknowledged = in.command == OperatorCommand::kAck;
  const DriveAction action = drive_action(next.mode);
  if (!allowed(next)) return "the state after a step is one of the allowed";
  if (s.fault != FaultCode::kNone && next.fault == FaultCode::kNone && (!acknowledged || faulty))
    return "a fault is cleared by an acknowledgement alone, and not while any is present";
  if (!has_torque(s.mode) && has_torque(next.mode) &&
      !(s == SupervisorState{Mode::kDisabled, FaultCode::kNone} &&
        in.command == OperatorCommand::kArm && !faulty && !in.unheard))
    return "torque comes on by arm alone, from disabled, all well and heard";
  if (next.fault != FaultCode::kNone && action == DriveAction::kFollow)
    return "nothing follows the plan while a fault stands";
  if (in.unheard && moves_on_plan(next.mode) && next.mode != s.mode)
    return "no motion begins while a joint is not heard";
  if (faulty && next.fault == FaultCode::kNone) return "a fault that is present is kept";
  if (faulty && action < demand) return "the more severe reaction wins";
  if (s.fault != FaultCode::kNone && !acknowledged && action < drive_action(s.mode))
    return "a reaction never becomes milder by itself";
  if (in.command == OperatorCommand::kStop && moves_on_plan(next.mode))
    return "stop is obeyed in every state";
  if (in.command == OperatorCommand::kPause && moves_on_plan(next.mode))
    return "pause is obeyed in every state";
  if (in.command == OperatorCommand::kEstop &&
      (next.fault == FaultCode::kNone || moves_on_plan(next.mode)))
    return "an e-stop is obeyed in every state";
  return nullptr;
}

TEST(Supervisor, EveryStateWithEveryInput) {
  const std::vector<SupervisorState> states = shown_states();
  std::uint64_t steps = 0;
  for (const FailurePolicy planned : kPlanned) {
    std::vector<DriveAction> demand(kAllFaults + 2u);
    for (FaultSet faults = 0; faults <= kAllFaults; faults += 2)
      demand[faults] = demanded(faults, planned);
    for (FaultSet faults = 0; faults <= kAllFaults; faults += 2)
      for (std::uint8_t c = 0; c < kOperatorCommandCount; ++c)
        for (unsigned flags = 0; flags < 8; ++flags) {
          const SupervisorInputs in{.command = static_cast<OperatorCommand>(c),
                                    .faults = faults,
                                    .unheard = (flags & 1u) != 0,
                                    .new_plan = (flags & 2u) != 0,
                                    .done = (flags & 4u) != 0,
                                    .planned = planned};
          const DriveAction most = demand[present(in)];
          for (const SupervisorState& s : states) {
            ++steps;
            const SupervisorState next = supervise(s, in);
            if (const char* rule = broken_rule(s, in, next, most); rule != nullptr)
              FAIL() << rule << ": " << to_string(s.mode) << " (" << to_string(s.fault)
                     << "), faults " << faults << ", " << to_string(in.command) << ", flags "
                     << flags << " -> " << to_string(next.mode) << " (" << to_string(next.fault)
                     << ")";
          }
        }
  }
  RecordProperty("steps", std::to_string(steps));
  EXPECT_EQ(steps, states.size() * 3 * 8192 * 9 * 8);
}

/// What is done does not depend on which fault is latched: one may stand for all above.
TEST(Supervisor, EveryLatchedFaultIsTreatedAlike) {
  for (const SupervisorState& s : all_states()) {
    if (s.fault == FaultCode::kNone) continue;
    for (const FailurePolicy planned : kPlanned)
      for (FaultSet faults = 0; faults <= kAllFaults; faults += 2)
        for (std::uint8_t c = 0; c < kOperatorCommandCount; ++c) {
          const SupervisorInputs in{.command = static_cast<OperatorCommand>(c),
                                    .faults = faults,
                                    .done = true,
                                    .planned = planned};
          const SupervisorState next = supervise(s, in);
          const SupervisorState other = supervise({s.mode, FaultCode::kEstop}, in);
          ASSERT_EQ(next.mode, other.mode);
        }
  }
}

/// Over any number of steps, not only one.
TEST(Supervisor, NoWayFromFaultToTorqueWithoutAnAcknowledgement) {
  const auto reach = [](bool acks) {
    std::set<std::pair<Mode, FaultCode>> reached;
    std::vector<SupervisorState> open{{Mode::kFault, FaultCode::kEstop}};
    while (!open.empty()) {
      const SupervisorState s = open.back();
      open.pop_back();
      if (!reached.emplace(s.mode, s.fault).second) continue;
      for (std::size_t f = 0; f < kFaultCount; ++f)
        for (std::uint8_t c = 0; c < kOperatorCommandCount; ++c)
          for (unsigned flags = 0; flags < 8; ++flags) {
            const auto command = static_cast<OperatorCommand>(c);
            if (command == OperatorCommand::kAck && !acks) continue;
            for (const FailurePolicy planned : kPlanned)
              open.push_back(supervise(s, {.command = command,
                                           .faults = bit(fault_at(f)),
                                           .unheard = (flags & 1u) != 0,
                                           .new_plan = (flags & 2u) != 0,
                                           .done = (flags & 4u) != 0,
                                           .planned = planned}));
          }
    }
    return reached;
  };
  for (const auto& [mode, fault] : reach(false)) EXPECT_FALSE(has_torque(mode)) << to_string(mode);
  // And with it every mode can be reached again, so that none is a dead end.
  std::set<Mode> modes;
  for (const auto& [mode, fault] : reach(true)) modes.insert(mode);
  EXPECT_EQ(modes.size(), kModeCount);
}

TEST(Supervisor, OneMoreFaultNeverMakesTheReactionMilder) {
  for (const FailurePolicy planned : kPlanned)
    for (const SupervisorState& s : shown_states())
      for (FaultSet faults = 0; faults <= kAllFaults; faults += 2)
        for (std::size_t f = 1; f < kFaultCount; ++f) {
          const Mode one = supervise(s, {.faults = faults, .planned = planned}).mode;
          const Mode more =
              supervise(s, {.faults = faults | bit(fault_at(f)), .planned = planned}).mode;
          ASSERT_GE(drive_action(more), drive_action(one));
        }
}

TEST(Supervisor, EveryFaultHasAReactionAClearConditionAndARank) {
  std::set<FaultCode> ranked(kFaultOrder.begin(), kFaultOrder.end());
  for (std::size_t f = 1; f < kFaultCount; ++f) {
    EXPECT_TRUE(ranked.contains(fault_at(f)));
    EXPECT_STRNE(clear_condition(fault_at(f)), "");
    for (const FailurePolicy planned : kPlanned)
      EXPECT_GE(reaction_to(fault_at(f), planned), DriveAction::kHold);
  }
}

TEST(OperatorCommands, TheMoreSevereCounts) {
  EXPECT_EQ(more_severe(OperatorCommand::kEstop, OperatorCommand::kResume),
            OperatorCommand::kEstop);
  EXPECT_EQ(more_severe(OperatorCommand::kStart, OperatorCommand::kPause), OperatorCommand::kPause);
}

// ---- docs/supervisor.md

const char* const kIntroduction = R"(# The safety supervisor

Made from `control/supervisor.hpp` by `tests/control/supervisor_test.cpp`; do not edit:
`CLAMBER_WRITE_DOCS=1 <build>/tests/control/control_test --gtest_filter='Supervisor*'`. The test fails
when this page is out of date. It also enumerates every state with every combination of inputs
and checks that

- torque comes on by `arm` alone, from *disabled*, with no fault and every joint heard;
- a latched fault is cleared by `ack` alone, and only while no fault is present; over any number of
  steps there is no way from *fault* to torque without it;
- nothing moves along the plan while a fault stands, and no motion begins while a joint is not heard;
- of several faults the most severe reaction wins, it never becomes milder by itself, and one more
  fault never makes it milder;
- `pause`, `stop` and `estop` are obeyed in every state.

A joint that is **not heard** for a tick is no fault yet: the plan's clock stands for all joints, the
host closes no loop over that joint, and its drive holds by itself with the joint's gains and last
torque, because to let go for one lost frame would drop a robot that hangs on it
([faults](faults.md)).
)";

const char* meaning(Mode mode) {
  switch (mode) {
    case Mode::kBoot:
      return "not every joint has been heard yet";
    case Mode::kDisabled:
      return "all is well, nobody has asked for torque";
    case Mode::kReady:
      return "armed: held where it was";
    case Mode::kMovingToStart:
      return "to the plan's first keyframe, or blending into another plan";
    case Mode::kExecuting:
      return "along the plan";
    case Mode::kPaused:
      return "the plan's clock brakes within `pause_time` and stands";
    case Mode::kHolding:
      return "held at the plan's end, where it was stopped, or with a fault";
    case Mode::kLowering:
      return "sinks: for `lowering_time` the torque that carried each joint fades, damped";
    case Mode::kLimp:
      return "no torque, perhaps still in motion, for `lowering_time`";
    case Mode::kFault:
      return "no torque, waits for `ack`";
  }
  return "";
}

std::string name(const SupervisorState& s) {
  const bool failed = s.mode == Mode::kHolding && s.fault != FaultCode::kNone;
  return std::string(to_string(s.mode)) + (failed ? ", faulted" : "");
}

std::string cell(const SupervisorState& s, const SupervisorInputs& in) {
  const SupervisorState next = supervise(s, in);
  return next == s ? "" : name(next);
}

void write_states(std::ostream& out) {
  out << "\n## States\n\n| state | drives | |\n|---|---|---|\n";
  for (std::size_t m = 0; m < kModeCount; ++m)
    out << "| " << to_string(mode_at(m)) << " | " << to_string(drive_action(mode_at(m))) << " | "
        << meaning(mode_at(m)) << " |\n";
}

void write_commands(std::ostream& out) {
  out << "\n## What a command does\n\nWith every joint heard and no fault present; empty: nothing."
         "\n*done*: the state has run its course.\n\n| in | *done* |";
  for (std::uint8_t c = 1; c < kOperatorCommandCount; ++c)
    out << ' ' << to_string(static_cast<OperatorCommand>(c)) << " |";
  out << "\n|---|---|";
  for (std::uint8_t c = 1; c < kOperatorCommandCount; ++c) out << "---|";
  out << '\n';
  for (const SupervisorState& s : shown_states()) {
    out << "| " << name(s) << " | " << cell(s, {.done = true}) << " |";
    for (std::uint8_t c = 1; c < kOperatorCommandCount; ++c)
      // In paused, done says that the plan's start is behind.
      out << ' '
          << cell(s, {.command = static_cast<OperatorCommand>(c), .done = s.mode == Mode::kPaused})
          << " |";
    out << '\n';
  }
  out << "\nOf several commands in one tick, `pause`, `stop`, `disarm` and `estop` drop all lesser "
         "ones.\n`resume` from a pause before the plan's start goes on moving to it.\n";
}

void write_faults(std::ostream& out) {
  out << "\n## What a fault does\n\nThe most severe first, as reported when several demand the "
         "same. `failure_policy` is the plan's or\nthe settings'. Without torque (boot, disabled) "
         "every fault leads to *fault*; *limp* stays limp.\n\n| fault | failure_policy hold | "
         "lower "
         "| limp | acknowledged when |\n|---|---|---|---|---|\n";
  for (const FaultCode fault : kFaultOrder) {
    out << "| " << to_string(fault) << " |";
    for (const FailurePolicy planned : kPlanned)
      out << ' '
          << to_string(supervise({Mode::kExecuting, FaultCode::kNone},
                                 {.faults = bit(fault), .planned = planned})
                           .mode)
          << " |";
    out << ' ' << clear_condition(fault) << " |\n";
  }
}

std::string page() {
  std::ostringstream out;
  out << kIntroduction << "\nEnumerated: " << shown_states().size() << " states, "
      << 3 * 8192 * 9 * 8 << " combinations of inputs each.\n";
  write_states(out);
  write_commands(out);
  write_faults(out);
  return out.str();
}

TEST(Supervisor, ThePageIsUpToDate) {
  const std::string file = std::string(CLAMBER_SOURCE_DIR) + "/docs/supervisor.md";
  if (std::getenv("CLAMBER_WRITE_DOCS") != nullptr) std::ofstream(file) << page();
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  EXPECT_EQ(text.str(), page()) << "write it with CLAMBER_WRITE_DOCS=1";
}

}  // namespace
}  // namespace clamber
