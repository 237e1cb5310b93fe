// The subcommands of `clamber`: each adds itself, its options and its callback.
// Start-up only. Callbacks throw InputError (exit code 2), JobFailed or PlanningFailed (1).
#pragma once

#include <CLI/CLI.hpp>

namespace clamber {

void add_climb_command(CLI::App& app);
void add_import_command(CLI::App& app);
void add_playback_command(CLI::App& app);
void add_contacts_command(CLI::App& app);
void add_plan_command(CLI::App& app);
void add_verify_command(CLI::App& app);
void add_cases_command(CLI::App& app);
void add_scale_robot_command(CLI::App& app);
void add_sweep_command(CLI::App& app);
void add_run_command(CLI::App& app);
void add_monitor_command(CLI::App& app);
void add_telemetry_publisher_command(CLI::App& app);  ///< not for people: see run_support.hpp
void add_replay_command(CLI::App& app);
void add_report_command(CLI::App& app);
void add_export_command(CLI::App& app);
void add_record_command(CLI::App& app);
void add_web_command(CLI::App& app);
void add_operator_commands(CLI::App& app);  ///< arm, start, ...
void add_bus_command(CLI::App& app);
void add_drives_command(CLI::App& app);
void add_key_command(CLI::App& app);
void add_bundle_command(CLI::App& app);
void add_flash_command(CLI::App& app);
void add_service_command(CLI::App& app);
void add_doctor_command(CLI::App& app);

}  // namespace clamber
