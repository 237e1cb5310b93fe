// clamber arm, start, pause, resume, stop, disarm, estop, ack, status: the operator's commands to a
// running controller.
#include <cstdlib>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/commands.hpp"
#include "apps/job_failed.hpp"
#include "apps/operator_socket.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

constexpr const char* kDefaultSocket = "/run/clamber/operator.sock";

constexpr double kPatience = 20.0;  // s; the server answers within 15

struct Options {
  std::string word;
  std::string socket;
  bool json = false;
};

struct Word {
  const char* word;
  const char* what;
};
constexpr Word kWords[] = {
    {"arm", "Switches the drives on: the robot is held where it is"},
    {"start", "Moves to the plan's start and executes the plan"},
    {"pause", "Slows the plan down to a stand; the robot is held"},
    {"resume", "Lets a paused plan go on"},
    {"stop", "As pause, and the plan is given up"},
    {"disarm", "Takes the torque away where nothing moves"},
    {"estop", "The failure action at once, kept as a fault until `clamber ack`"},
    {"ack", "Says that the fault has been seen; the only way out of one"},
    {"status", "State, fault, plan time, tracking and timing of the running controller"},
};

std::string socket_of(const Options& options) {
  if (!options.socket.empty()) return options.socket;
  const char* named = std::getenv("CLAMBER_OPERATOR");
  return named != nullptr && *named != '\0' ? named : kDefaultSocket;
}

void print_status(const std::string& text) {
  const auto status = nlohmann::ordered_json::parse(text);
  const auto joint = [&](const char* key) {
    const std::string name = status.at(key);
    return name.empty() ? name : " (" + name + ')';
  };
  std::cout << "state:     " << status.at("state").get<std::string>() << '\n'
            << "fault:     " << status.at("fault").get<std::string>() << joint("fault_joint")
            << '\n'
            << "plan time: " << status.at("plan_time").get<double>() << " s\n"
            << "ticks:     " << status.at("ticks").get<std::uint64_t>() << ", "
            << status.at("overruns").get<std::uint64_t>() << " late, "
            << status.at("skipped_ticks").get<std::uint64_t>() << " skipped, worst wake-up "
            << 1e6 * status.at("worst_wakeup").get<double>() << " us\n"
            << "tracking:  " << status.at("worst_tracking_error").get<double>() << " rad at most"
            << joint("worst_joint") << '\n'
            << "replies:   " << status.at("missing_replies").get<std::uint64_t>() << " missing\n";
}

void run(const Options& options) {
  const std::string answer = ask_controller(socket_of(options), options.word, kPatience);
  const std::string kind = answer.substr(0, answer.find(' '));
  const std::string rest = kind.size() < answer.size() ? answer.substr(kind.size() + 1) : "";
  if (kind == "refused") throw JobFailed(options.word + " refused: " + rest);
  if (kind == "done") {
    std::cout << "done\n";
    return;
  }
  if (kind != "status") throw InputError("the controller did not understand: " + answer);
  if (options.json)
    std::cout << rest << '\n';
  else
    print_status(rest);
}

}  // namespace

void add_operator_commands(CLI::App& app) {
  for (const Word& word : kWords) {
    auto options = std::make_shared<Options>();
    options->word = word.word;
    CLI::App* command = app.add_subcommand(word.word, word.what);
    command->add_option(
        "--socket", options->socket,
        std::string("the controller's (else $CLAMBER_OPERATOR, ") + kDefaultSocket + ")");
    if (options->word == "status")
      command->add_flag("--json", options->json, "one line of JSON, SI units");
    command->group("Operator");
    command->footer(
        "To a controller started with `clamber run ... --operator SOCKET`. Exit codes: 0 done,\n"
        "1 refused (the reason is printed) or no answer, 2 no such controller.");
    command->callback([options] { run(*options); });
  }
}

}  // namespace clamber
