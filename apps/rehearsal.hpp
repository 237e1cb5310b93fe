// The simulated robot behind virtual drives, and the judge who watches it.
// Main thread; allocates; throws InputError.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/executor.hpp"
#include "firmware_hal/virtual_drives/virtual_drives.hpp"
#include "robot_model/model.hpp"
#include "sim_backend/judge.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

class RehearsalWorld {
 public:
  /// The robot at the scenario's start. @param step s of simulated time per tick
  RehearsalWorld(const RobotModel& model, const Scenario& scenario, double step);
  ~RehearsalWorld();
  RehearsalWorld(const RehearsalWorld&) = delete;
  RehearsalWorld& operator=(const RehearsalWorld&) = delete;

  [[nodiscard]] JointPlant& plant();
  /// Once a tick in which the robot may have moved.
  void look();
  /// The judge's verdict: of the last time within kStopAllowance in which he saw the robot on top,
  /// if there was one, else of now. A host brakes before it switches off, and a robot that is only
  /// braked sinks.
  [[nodiscard]] ClimbVerdict verdict() const;
  [[nodiscard]] double time() const;  ///< s

  static constexpr double kStopAllowance = 1.0;  ///< s

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct RehearsalOptions {
  ControllerConfig control;
  std::string log;          ///< file; empty: no log
  std::string plan_sha256;  ///< of what is executed, for the log
  std::string inputs;       ///< file for what `clamber replay` needs; empty: none
  std::string frame_log;    ///< every frame in candump's format; empty: none
};

struct RehearsalRun {
  ExecutorReport execution;
  ClimbVerdict verdict;
  std::string trouble;  ///< why the drives could not be enabled; empty: they could
  std::uint64_t missing_replies = 0;
  double slowest_reply = 0.0;  ///< s from the start of a tick
  double temperature = 0.0;    ///< degree Celsius, of the hottest drive
  std::string hottest;         ///< its joint
  std::uint64_t frames = 0;    ///< in the frame log
  std::string frame_log_sha256;

  [[nodiscard]] bool success() const;
  /// Why not, in one line; empty on success.
  [[nodiscard]] std::string failure() const;
};

/// Runs a plan image with hosts, simulated buses, virtual drives and the simulated robot in this
/// process. Deterministic. @throws InputError when map or image are refused
[[nodiscard]] RehearsalRun rehearse(const RobotModel& model, const Scenario& scenario,
                                    const BusMap& map, const std::vector<std::byte>& image,
                                    const RehearsalOptions& options);
[[nodiscard]] std::string describe(const RehearsalRun& run);

/// The hottest drive and its joint.
struct HottestDrive {
  double temperature = 0.0;  ///< degree Celsius
  std::string joint;
};
[[nodiscard]] HottestDrive hottest(const VirtualDrives& drives);

[[nodiscard]] nlohmann::ordered_json to_json(const ClimbVerdict& verdict);
/// Per drive: joint, bus, power, temperature, frames.
[[nodiscard]] nlohmann::ordered_json to_json(const BusMap& map, const VirtualDrives& drives);

}  // namespace clamber
