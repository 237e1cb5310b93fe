// The report's plots as self-contained SVG: light and dark, no script, nothing fetched.
// Off-line only: allocates; never blocks.
#pragma once

#include <string>

#include "planner_offline/plan.hpp"
#include "report/run_data.hpp"

namespace clamber {

/// Measured torque of left and right knee and elbow over time, playback left and plan right on one
/// scale, with the joints' +- torque limit (paper Fig. 7). `playback` may be null. Joints are found
/// by name: those that start with L or R and contain Knee or Elb.
[[nodiscard]] std::string plot_torques(const RunData* playback, const RunData& climb);

/// Largest |torque| of every joint as bars, playback and plan, with each joint's limit.
[[nodiscard]] std::string plot_peaks(const RunData* playback, const RunData& climb);

/// The plan's support margin (distance of the CoM inside the support region) over time, m.
[[nodiscard]] std::string plot_support_margin(const Plan& plan);

/// Measured forces: one row a contact link, a bar while it carries (darker: more force); below,
/// the weight on obstacle, floor and forbidden links, as a share of the robot's weight.
[[nodiscard]] std::string plot_contacts(const RunData& run);

}  // namespace clamber
