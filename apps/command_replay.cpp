// clamber replay: logged inputs of the controller again, every command compared.
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/input_log.hpp"
#include "apps/job_failed.hpp"

namespace clamber {
namespace {

void run(const std::string& file) {
  const InputLog log = load_input_log(file);
  const Replay result = replay(log);
  std::cout << "log:         " << log.ticks.size() << " ticks, " << log.header.joint_names.size()
            << " joints of " << log.header.robot << ", plan "
            << log.header.plan_sha256.substr(0, 12) << '\n';
  if (const auto& found = result.difference) {
    throw JobFailed("tick " + std::to_string(found->tick) +
                    (found->joint.empty() ? "" : ", joint " + found->joint) + ": " + found->what);
  }
  std::cout << "replayed:    every command the same to the bit; at the end "
            << to_string(result.end.mode);
  if (result.end.fault != FaultCode::kNone) std::cout << " (" << to_string(result.end.fault) << ')';
  std::cout << '\n';
}

}  // namespace

void add_replay_command(CLI::App& app) {
  auto file = std::make_shared<std::string>();
  CLI::App* command =
      app.add_subcommand("replay", "Runs a log of the controller's inputs again and compares");
  command->add_option("log", *file, "input log (clamber run --inputs)")->required();
  command->footer(
      "The log holds settings, plan image, every tick's joint states, operator's commands and bus\n"
      "health, and the commands that came out. Exit code 1: a command is another, or a record is\n"
      "damaged; tick and joint are named.\n\n"
      "Example:\n"
      "  clamber run out/climb/plan.json --inputs out/inputs.log && clamber replay "
      "out/inputs.log");
  command->callback([file] { run(*file); });
}

}  // namespace clamber
