// The fields of a frame, once, for everything that stores them: message schema, message bytes,
// CSV and HDF5 columns. A field that is added to the frame is added here.
// Any thread; allocates: never; blocks: never.
#pragma once

#include "telemetry/frame.hpp"

namespace clamber {

struct FieldText {
  const char* name;
  const char* unit;     ///< "" for counts
  const char* meaning;  ///< for the schema
};

using PerJoint = std::array<double, kMaxJoints>;
using PerContact = std::array<double, kMaxContacts>;

/// Calls visit(FieldText, member) for every field but joint_count and contact_count, which are the
/// lengths of the arrays wherever frames are stored.
/// @tparam Frame TelemetryFrame, const or not
template <typename Frame, typename Visit>
void visit_fields(Frame& frame, Visit&& visit) {
  visit(FieldText{"sequence", "", "tick number: a gap is a loss"}, frame.sequence);
  visit(FieldText{"time", "s", "since the first tick"}, frame.time);
  visit(FieldText{"plan_time", "s", "on the plan's clock"}, frame.plan_time);
  visit(FieldText{"phase", "", "index of the plan's phase"}, frame.phase);
  visit(FieldText{"flags", "", "bit 0: the simulation's truth is valid"}, frame.flags);
  visit(FieldText{"mode", "", "of the supervisor"}, frame.mode);
  visit(FieldText{"fault", "", "0: none"}, frame.fault);
  visit(FieldText{"fault_joint", "", "index of the joint; 32: at none"}, frame.fault_joint);
  visit(FieldText{"joint_faults", "", "one bit per joint whose drive reports a fault"},
        frame.joint_faults);
  visit(FieldText{"q_ref", "rad", "reference"}, frame.q_ref);
  visit(FieldText{"q", "rad", "measured"}, frame.q);
  visit(FieldText{"dq", "rad/s", "measured"}, frame.dq);
  visit(FieldText{"tau_ff", "N m", "feed-forward"}, frame.tau_ff);
  visit(FieldText{"tau_cmd", "N m", "commanded"}, frame.tau_cmd);
  visit(FieldText{"tau_meas", "N m", "measured"}, frame.tau_meas);
  visit(FieldText{"tau_limit", "N m", "magnitude that the controller keeps to"}, frame.tau_limit);
  visit(FieldText{"temperature", "degree Celsius", "of the drive; 0: not known"},
        frame.temperature);
  visit(FieldText{"age", "ticks", "since the reply that q, dq and tau_meas are of"}, frame.age);
  visit(FieldText{"base_position", "m", "truth: x y z"}, frame.base_position);
  visit(FieldText{"base_orientation", "", "truth: w x y z"}, frame.base_orientation);
  visit(FieldText{"force_obstacle", "N", "truth: normal force of each contact link on obstacles"},
        frame.force_obstacle);
  visit(FieldText{"force_floor", "N", "truth: the same on the floor"}, frame.force_floor);
  visit(FieldText{"force_forbidden", "N", "truth: carried by torso and pelvis"},
        frame.force_forbidden);
  visit(FieldText{"force_other", "N", "truth: carried by links that are no contacts"},
        frame.force_other);
}

}  // namespace clamber
