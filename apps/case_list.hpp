// A list of climbs that differ in robot and recording: each planned, certified, run and judged, a
// row of a table each.
// One thread, and no other OdeWorld at the same time; allocates; reads and writes files.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "apps/sweep_case.hpp"

namespace clamber {

struct ClimbCase {
  std::string name;
  SweepInputs inputs;           ///< recording, robot, reading ...
  std::optional<double> scale;  ///< the robot is made this many times as large first
  bool torque_kept = false;     ///< and keeps its torque limits
  double height = 0.275;        ///< m
  double friction = 0.8;
  double toes = 0.03;  ///< m, from the toes to the obstacle at the start
};

struct CaseList {
  std::string title;
  std::string text;  ///< what the table's readers should know, a paragraph
  std::vector<ClimbCase> cases;
};

/// @throws InputError
[[nodiscard]] CaseList load_case_list(const std::filesystem::path& file);

/// What became of a case. Whatever is wrong with a recording or a robot is the row's, not an error.
struct CaseRow {
  std::string name;
  std::string robot;
  int joints = 0;
  double mass = 0.0;    ///< kg
  double leg = 0.0;     ///< m, thigh to sole, straight
  double height = 0.0;  ///< m
  bool climbs = false;
  bool skipped = false;       ///< the recording is not there
  std::string contacts;       ///< the order found
  double peak_torque = 0.0;   ///< N m
  double torque_limit = 0.0;  ///< of that joint, N m
  std::string peak_joint;
  double support_margin = 0.0;  ///< m
  double planning_time = 0.0;   ///< s
  std::string why;              ///< stage and reason of what did not work
};

/// Runs a case in `out`/<name>. A recording that is not there is looked for in `recordings`.
/// @throws JobFailed when interrupted, InputError when `out` cannot be written
[[nodiscard]] CaseRow run_case(const ClimbCase& climb, const std::filesystem::path& out,
                               const std::filesystem::path& recordings);

/// The table as Markdown.
[[nodiscard]] std::string case_table(const CaseList& list, const std::vector<CaseRow>& rows);

}  // namespace clamber
