// The `clamber` command: chooses the subcommand and turns errors into exit codes.
#include <algorithm>
#include <iostream>
#include <string>

#include "apps/cli_pages.hpp"
#include "apps/commands.hpp"
#include "apps/job_failed.hpp"
#include "planner_offline/planner.hpp"
#include "robot_model/loader.hpp"

namespace {

enum ExitCode : int { kFine = 0, kJobFailed = 1, kUnusableInput = 2, kInternalError = 3 };

int complain(const char* kind, std::string what, ExitCode code) {
  std::replace(what.begin(), what.end(), '\n', ' ');
  std::cout.flush();
  std::cerr << "clamber: " << kind << what << '\n';
  return code;
}

void describe(CLI::App& app) {
  app.description(
      "Clamber makes a humanoid robot climb obstacles as large as its leg, with hands, elbows\n"
      "and knees, from a recording of a person who does it.");
  app.footer(
      "The flow, each step on files:\n"
      "  recording --import--> motion --contacts--> contact states --plan--> plan --run--> log\n"
      "`clamber climb` does all of it and writes a report.\n"
      "\n"
      "Examples:\n"
      "  clamber climb                         the shipped demonstration, a box of 0.275 m\n"
      "  clamber climb --height 0.35           the same demonstration, a higher box\n"
      "  clamber climb my_recording.mvnx --out out/mine\n"
      "  clamber plan --help                   more about one step\n"
      "\n"
      "Configuration files are looked for as given, then in $CLAMBER_CONFIGS or in the tree that\n"
      "the program was built from. Exit codes: 0 fine, 1 the job failed, 2 unusable input.");
  app.set_version_flag("--version", "clamber " CLAMBER_VERSION);
  app.require_subcommand(1);
}

/// The parser only says that a subcommand is missing, not that it does not know the one given.
std::string explain(const CLI::App& app, const CLI::ParseError& error, int argc, char** argv) {
  if (argc > 1 && argv[1][0] != '-' && app.get_subcommands().empty())
    return std::string("unknown command '") + argv[1] + "'";
  return error.what();
}

int run(int argc, char** argv) {
  CLI::App app{"", "clamber"};
  describe(app);
  clamber::add_climb_command(app);
  clamber::add_import_command(app);
  clamber::add_playback_command(app);
  clamber::add_contacts_command(app);
  clamber::add_plan_command(app);
  clamber::add_verify_command(app);
  clamber::add_run_command(app);
  clamber::add_monitor_command(app);
  clamber::add_telemetry_publisher_command(app);
  clamber::add_operator_commands(app);
  clamber::add_sweep_command(app);
  clamber::add_scale_robot_command(app);
  clamber::add_cases_command(app);
  clamber::add_replay_command(app);
  clamber::add_report_command(app);
  clamber::add_export_command(app);
  clamber::add_record_command(app);
  clamber::add_web_command(app);
  clamber::add_bus_command(app);
  clamber::add_drives_command(app);
  clamber::add_key_command(app);
  clamber::add_bundle_command(app);
  clamber::add_flash_command(app);
  clamber::add_service_command(app);
  clamber::add_pages_command(app);
  clamber::add_doctor_command(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    return complain("error: ", explain(app, error, argc, argv) + " (see clamber --help)",
                    kUnusableInput);
  }
  return kFine;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const clamber::InputError& error) {
    return complain("error: ", error.what(), kUnusableInput);
  } catch (const clamber::PlanningFailed& error) {
    return complain("error: ", std::string("no plan: ") + error.what(), kJobFailed);
  } catch (const clamber::JobFailed& error) {
    return complain("error: ", error.what(), kJobFailed);
  } catch (const std::exception& error) {
    return complain("internal error: ", error.what(), kInternalError);
  }
}
