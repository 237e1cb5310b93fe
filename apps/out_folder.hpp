// The files that `clamber climb` leaves in its folder, and the report made of them.
// One thread; allocates; reads and writes files; throws InputError.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/options.hpp"
#include "apps/simulated_run.hpp"
#include "report/summary.hpp"

namespace clamber {

class OutFolder {
 public:
  explicit OutFolder(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// Makes the folder and removes what an earlier climb left in it.
  void prepare() const;

  [[nodiscard]] std::string motion() const { return at("motion.csv"); }
  [[nodiscard]] std::string contacts() const { return at("contacts.yaml"); }
  [[nodiscard]] std::string plan() const { return at("plan.json"); }
  [[nodiscard]] std::string image() const { return at("plan.img"); }
  [[nodiscard]] std::string trajectory() const { return at("trajectory.csv"); }
  [[nodiscard]] std::string costs() const { return at("costs.csv"); }
  [[nodiscard]] std::string rejected() const { return at("rejected.txt"); }
  [[nodiscard]] std::string log() const { return at("climb.log"); }
  [[nodiscard]] std::string playback_log() const { return at("playback.log"); }
  [[nodiscard]] std::string summary() const { return at("summary.json"); }
  [[nodiscard]] const std::filesystem::path& path() const { return folder_; }

 private:
  [[nodiscard]] std::string at(const char* name) const { return (folder_ / name).string(); }

  std::filesystem::path folder_;
};

/// The parts of a summary that the run and its judge decide.
void take_verdict(const SimulatedRun& run, Summary& summary);

/// summary.json: the summary's own keys, then `extra`'s.
void save_summary(const Summary& summary, const nlohmann::ordered_json& extra,
                  const OutFolder& out);

/// Writes the report from the folder's files; `model` and `scenario` are what the plan was made
/// for. The summary's peaks are measured again, from the logs. @throws InputError also when the
/// plan in the folder was made for another robot or scenario
Summary write_report_of(const OutFolder& out, const RobotModel& model, const Scenario& scenario);

/// Robot and scenario that summary.json names.
struct ClimbInputs {
  RobotOptions robot;
  ScenarioOptions scenario;
};
[[nodiscard]] nlohmann::ordered_json to_json(const ClimbInputs& inputs);
[[nodiscard]] ClimbInputs load_inputs(const OutFolder& out);

}  // namespace clamber
