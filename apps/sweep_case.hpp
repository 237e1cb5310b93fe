// One case of a sweep: recording -> plan with certificate -> judged climb, as a record that says
// what held or why not.
// One thread, and no other OdeWorld at the same time; allocates; reads and writes files.
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <tuple>
#include <variant>

#include "apps/steps.hpp"
#include "apps/sweep_grid.hpp"

namespace clamber {

/// What all cases of a sweep have in common.
struct SweepInputs {
  std::string recording = "configs/recordings/climb_table_synthetic.mvnx";
  std::string scenario = "configs/scenarios/box_0.275.yaml";
  std::string robot = "configs/robots/coman";
  std::string settings = "configs/planner/default.yaml";
  std::string control = "configs/control/default.yaml";
  RecordingOptions reading;
  bool plan_only = false;
  /// The goal is the last state of the recording, not the contacts that the scenario names.
  bool goal_as_recorded = false;
};

/// What each reduced state adds to the one before and gives up: "Lwrist Rwrist, Lknee, Rknee".
[[nodiscard]] std::string contact_order(const ContactSequence& sequence);

/// Runs cases and keeps their records in a folder:
///   cases/<key>.json      what came out, one line; the same case gives the same bytes
///   times/<key>.json      s of wall time of its stages
///   scenarios/<key>.yaml  its scenario, to do it again with `clamber climb --scenario`
///   plans/<key>.*         plan, certificate, what was rejected: where they are kept
class SweepRunner {
 public:
  /// Reads every input, so that what is unusable shows before the first case. @throws InputError
  SweepRunner(SweepInputs inputs, std::filesystem::path out, bool keep_plans);

  /// The folder holds the case's record, made by this program from the same inputs.
  [[nodiscard]] bool done(const SweepPoint& point) const;
  /// Runs the case and writes its files, the record last.
  /// @throws InputError when the inputs fit no case or files cannot be written
  /// @throws JobFailed when interrupted
  nlohmann::ordered_json run(const SweepPoint& point);

 private:
  using Json = nlohmann::ordered_json;
  /// The robot with a ballast, and the motion mapped to it.
  struct Mapped {
    RobotModel model;
    LoadedMotion motion;
  };
  /// A contact sequence, or why there is none.
  using Contacts = std::variant<ContactSequence, std::string>;

  const Mapped& mapped(double ballast);
  const Contacts& contacts(const SweepPoint& point, const Scenario& scenario, Json& times);
  /// Fill the record as far as the case gets; the record says where it ended and why.
  void attempt(const SweepPoint& point, Json& record, Json& times);
  void execute(const Mapped& robot, const Scenario& scenario, const std::string& plan, Json& record,
               Json& times);
  [[nodiscard]] std::filesystem::path file(const char* folder, const SweepPoint& point,
                                           const char* ending) const;

  SweepInputs inputs_;
  std::filesystem::path out_;
  bool keep_plans_;
  std::string scenario_;  ///< the scenario file's text
  std::string digest_;    ///< of all inputs but the point
  std::string program_;   ///< SHA-256 of the program
  std::map<double, Mapped> mapped_;
  /// The playback depends on ballast, depth and friction, not on height or distance.
  std::map<std::tuple<double, double, double>, Contacts> contacts_;
  Progress quiet_{true};
};

/// "h0.2_f0.8: climbs, 17.1 N m at most (RHipSag)", or where it ended and why.
[[nodiscard]] std::string describe_case(const nlohmann::ordered_json& record);

}  // namespace clamber
