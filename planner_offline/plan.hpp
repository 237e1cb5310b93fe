// The plan: readable result of the planner, input of the controller's image and of the report.
// Start-up only: allocates, reads and writes files, throws InputError.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "control/failure_policy.hpp"
#include "robot_model/model.hpp"

namespace clamber {

/// A contact that carries the robot at a keyframe, with the force the equilibrium program gave it.
struct PlannedContact {
  std::string link;                                    ///< ContactLink::name
  std::string surface;                                 ///< "floor" or an obstacle's name
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< on the surface, world, m
  Eigen::Vector3d force = Eigen::Vector3d::Zero();     ///< on the robot, world, N
};

struct Keyframe {
  double time = 0.0;  ///< s
  int phase = 0;      ///< index into Plan::phases
  Configuration x;
  JointVector tau;  ///< feed-forward, N m
  std::vector<PlannedContact> contacts;
  double support_margin = 0.0;      ///< m, CoM inside the support region (negative: outside)
  double torque_margin = 0.0;       ///< N m, smallest |limit| - |tau|
  double obstacle_clearance = 0.0;  ///< m, links not in contact to floor and obstacle
  double self_clearance = 0.0;      ///< m, over the configured pairs
};

/// A stretch of keyframes with one contact set.
struct Phase {
  std::string name;                                     ///< e.g. "State1", "swing Lknee"
  double start = 0.0;                                   ///< s
  FailurePolicy failure_policy = FailurePolicy::kHold;  ///< when the host falls silent in it
};

/// One line of what the plan holds for where the world differs from the model, from its
/// certificate.
struct CertifiedFor {
  std::string what;  ///< e.g. "obstacle height"
  std::string unit;
  double stated = 0.0;  ///< the uncertainty asked for
  double holds = 0.0;   ///< what the motion's margins leave room for
};

struct Plan {
  std::string robot;  ///< name
  std::string robot_hash;
  std::string scenario;  ///< name
  std::string scenario_hash;
  std::string recording;
  bool synthetic_recording = false;
  std::string tool_version;
  double friction = 0.0;
  double obstacle_height = 0.0;  ///< m
  double ballast_mass = 0.0;     ///< kg
  std::vector<std::string> joint_names;
  std::vector<std::string> notes;  ///< what the planner did about missing or extra contacts
  std::vector<CertifiedFor> certified_for;  ///< empty: of no certificate
  std::vector<Phase> phases;
  std::vector<Keyframe> keyframes;
};

/// The plan file's text.
[[nodiscard]] std::string format_plan(const Plan& plan);
void save_plan(const Plan& plan, const std::filesystem::path& file);
/// @throws InputError
[[nodiscard]] Plan load_plan(const std::filesystem::path& file);
/// 100 Hz CSV: time, base_x base_y base_z base_qw base_qx base_qy base_qz, joints by name,
/// tau_<joint>.
void export_trajectory(const Plan& plan, const std::filesystem::path& file);

}  // namespace clamber
