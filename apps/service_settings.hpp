// What a slot's service runs (service.yaml in the slot), and whether all that is in the slot is
// usable. Start-up only; allocates, reads files; throws InputError, JobFailed.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "deploy/manifest.hpp"
#include "firmware_hal/bus_map.hpp"
#include "robot_model/model.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

/// Paths are relative to the slot.
struct ServiceSettings {
  std::string plan;  ///< plans/NAME/plan.json
  std::string robot = "configs/robots/coman";
  std::string hal = "configs/hal/coman_mit.yaml";
  std::string control = "configs/control/default.yaml";
  std::string runtime = "configs/runtime/default.yaml";
};
[[nodiscard]] ServiceSettings load_service_settings(const std::filesystem::path& folder);
[[nodiscard]] std::string format_service_settings(const ServiceSettings& settings);

/// The scenario in `configs` that a plan file was made for. @throws InputError: there is none
struct FoundScenario {
  std::filesystem::path file;
  Scenario scenario;
};
[[nodiscard]] FoundScenario scenario_of_plan(const std::filesystem::path& plan,
                                             const std::filesystem::path& configs);

/// The bus map's CAN interfaces with their node ids; empty for the simulation.
[[nodiscard]] Hardware hardware_of(const std::string& hal, const RobotModel& robot);
/// The map behind `hal`; nullopt: the simulation.
[[nodiscard]] std::optional<BusMap> load_drives(const std::string& hal, const RobotModel& robot);

/// Every file of the folder that a run would need, as a run would read it: robot, scenarios,
/// settings, buses with their budget, every plan with its certificate and image.
/// @return a line for each; @throws at the first that is unusable
std::vector<std::string> check_slot(const std::filesystem::path& folder);

}  // namespace clamber
