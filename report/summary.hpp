// The results of one climb: summary.json and the table on the terminal.
// Off-line only: allocates; never blocks (streams apart).
#pragma once

#include <iosfwd>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "report/peaks.hpp"

namespace clamber {

/// What the judge saw at the end of the run.
struct JudgeFigures {
  std::vector<std::string> final_contacts;      ///< contact links on top of the obstacle
  std::vector<std::string> floor_contacts;      ///< links that touch the floor
  double weight_on_obstacle = 0.0;              ///< share of the weight, 0..1
  std::vector<std::string> forbidden_contacts;  ///< links that must carry nothing and do
  double rest_speed = 0.0;                      ///< m/s, fastest link while at rest
};

struct Summary {
  bool success = false;
  JudgeFigures judge;
  double obstacle_height = 0.0;       ///< m
  std::string outcome = "on top of";  ///< "the robot is <outcome> the obstacle": what the goal asks
  std::string recording;
  bool synthetic_recording = false;
  std::optional<TorquePeak> peak_plan;
  std::optional<TorquePeak> peak_playback;
  std::optional<TorquePeak> peak_after_hands;  ///< of the climb, once both wrists carry
  std::optional<bool> playback_success;        ///< nothing: no playback was run
  std::vector<std::pair<std::string, double>> planning_stages;  ///< name and s, in order
  double real_time_factor = 0.0;                                ///< simulated time / wall time
  std::string plan_sha256;
  std::string log_sha256;
  bool feed_forward = true;
  double ballast = 0.0;  ///< kg

  [[nodiscard]] double planning_total() const;  ///< s, sum of the stages
};

/// Fills the three peaks from the runs' frames; `playback` may be null.
void measure_peaks(const RunData& climb, const RunData* playback, Summary& summary);

/// Keys: success, judge {final_contacts, floor_contacts, weight_on_obstacle, forbidden_contacts,
/// rest_speed}, obstacle_height_m, outcome, recording, peak_torque_nm {plan {joint, value},
/// playback {..}}, peak_torque_after_hands_nm, playback_success, planning_s {<stage>.., total},
/// real_time_factor, plan_sha256, log_sha256, and beyond: peak_torque_after_hands_joint,
/// synthetic_recording, feed_forward, ballast_kg. What was not measured is null.
[[nodiscard]] nlohmann::ordered_json to_json(const Summary& summary);

/// The same figures as a table for people.
void print_summary(const Summary& summary, std::ostream& out);

}  // namespace clamber
