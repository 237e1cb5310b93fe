// clamber flash: a bundle onto a robot's computer, here or over ssh, as firmware is flashed.
#include <signal.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/child_process.hpp"
#include "apps/commands.hpp"
#include "apps/config_files.hpp"
#include "apps/job_failed.hpp"
#include "apps/operator_socket.hpp"
#include "apps/options.hpp"
#include "apps/progress.hpp"
#include "apps/run_support.hpp"
#include "apps/service_health.hpp"
#include "apps/service_settings.hpp"
#include "deploy/durable.hpp"
#include "deploy/flash.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

// A unit that has failed too often is not started again before that is forgotten.
const std::vector<std::string> kRestartUnit = {
    "/bin/sh", "-c",
    "systemctl reset-failed clamber.service; exec systemctl restart clamber.service"};

struct Options {
  std::vector<std::string> words;  ///< [TARGET] BUNDLE
  std::string root = "/";
  bool force = false;
  bool dry_run = false;
  bool quiet = false;
  bool failed = false;
  bool boot = false;
  bool json = false;
  bool sudo = false;
  std::string robot = "configs/robots/coman";
  std::string hal = "configs/hal/coman_mit.yaml";
  std::vector<std::string> restart;
  HealthSettings health;
};

/// A path as the target's own programs see it.
fs::path below(const Options& options, const std::string& absolute) {
  return fs::path(options.root) / absolute.substr(1);
}

/// Empty when no controller is there: then nothing is armed.
std::string armed_state(const fs::path& socket) {
  const std::optional<std::string> answer = ask_if_there(socket.string(), "status", 5.0);
  if (!answer) return {};
  const std::string state = nlohmann::json::parse(answer->substr(answer->find('{'))).at("state");
  const bool off = state == "boot" || state == "disabled" || state == "limp" || state == "fault";
  return off ? "" : state;
}

void preflight(const Options& options, const Target& target, const fs::path& folder) {
  const std::string program = fs::absolute(folder / "bin/clamber").string();
  const std::string slot = fs::absolute(folder).string();
  ChildResult result = run_child({program, "service", slot, "--check"});
  if (result.status != 0) throw JobFailed(result.last_words());
  if (!target.doctor) return;
  const ServiceSettings service = load_service_settings(folder);
  const auto at = [&](const std::string& name) { return slot + '/' + name; };
  const FoundScenario made_for = scenario_of_plan(folder / service.plan, folder / "configs");
  result = run_child({program, "doctor", at(service.plan), "--hal", at(service.hal), "--robot",
                      at(service.robot), "--control", at(service.control), "--runtime",
                      at(service.runtime), "--scenario", fs::absolute(made_for.file).string(),
                      "--logs", options.root});
  if (result.status != 0) {
    std::cerr << result.output;
    throw JobFailed("clamber doctor: " + result.last_words());
  }
}

void restart(const Target& target) {
  const ChildResult result = run_child(target.restart);
  if (result.status != 0)
    throw JobFailed("`" + target.restart[0] + " ...` failed: " + result.last_words());
}

FlashHooks make_hooks(const Options& options, const Target& target, Progress& progress,
                      const StopGuard& stop) {
  FlashHooks hooks;
  hooks.step = [&](const std::string& step) { progress.stage(step); };
  hooks.armed = [socket = below(options, target.operator_socket)] { return armed_state(socket); };
  hooks.preflight = [&](const fs::path& folder) { preflight(options, target, folder); };
  if (target.restart.empty())
    return hooks;  // nothing runs here: nothing to be asked for its health
  hooks.restart = [&] { restart(target); };
  hooks.gate = [&](const std::string& id) {
    await_health(below(options, target.health_file), id, target.health,
                 [&] { return stop.flag()->load(); });
  };
  return hooks;
}

/// Whoever started this over a connection that breaks gets a finished flash all the same.
void outlive_the_terminal() {
  signal(SIGHUP, SIG_IGN);
  signal(SIGPIPE, SIG_IGN);
}

/// A bundle that comes on standard input, on the disk for as long as it lives.
class ReceivedBundle {
 public:
  explicit ReceivedBundle(const fs::path& root) {
    const fs::path folder = root / "opt/clamber";
    make_folders(folder);
    std::string name = (folder / ".received-XXXXXX").string();
    const Descriptor fd(mkstemp(name.data()));
    if (fd.get() < 0) throw JobFailed(folder.string() + ": cannot be written");
    file_ = name;
    std::uint64_t size = 0;
    std::string block(1 << 16, '\0');
    for (ssize_t got = 0; (got = read(STDIN_FILENO, block.data(), block.size())) > 0;) {
      size += static_cast<std::uint64_t>(got);
      if (size > 2 * kBundleBytes ||
          write(fd.get(), block.data(), static_cast<std::size_t>(got)) != got) {
        fs::remove(file_);
        throw JobFailed("the bundle on standard input is too large for this disk or for any");
      }
    }
  }
  ~ReceivedBundle() {
    std::error_code error;
    fs::remove(file_, error);
  }
  ReceivedBundle(const ReceivedBundle&) = delete;
  ReceivedBundle& operator=(const ReceivedBundle&) = delete;
  [[nodiscard]] const fs::path& file() const { return file_; }

 private:
  fs::path file_;
};

void flash_here(const Options& options, const std::string& bundle) {
  outlive_the_terminal();
  const Target target = load_target(options.root);
  std::unique_ptr<ReceivedBundle> received;
  if (bundle == "-") received = std::make_unique<ReceivedBundle>(options.root);
  const StopGuard stop;
  Progress progress(options.quiet);
  Flasher flasher(options.root, make_hooks(options, target, progress, stop));
  const SlotContent content = flasher.flash(received ? received->file() : fs::path(bundle),
                                            {.force = options.force, .dry_run = options.dry_run});
  std::cout << (options.dry_run ? "would flash: " : "flashed: ") << content.manifest.name() << " ("
            << content.id.substr(0, 12) << ")\n";
}

void flash_over_ssh(const Options& options, const std::string& target, const std::string& bundle) {
  if (target[0] == '-') throw InputError(target + ": no target, expected user@host");
  if (!fs::exists(bundle)) throw InputError(bundle + ": no such file");
  std::vector<std::string> command{"ssh", "-o", "BatchMode=yes", "--", target};
  if (options.sudo) command.insert(command.end(), {"sudo", "-n"});
  command.insert(command.end(), {"clamber", "flash"});
  if (options.root != "/") command.insert(command.end(), {"--root", options.root});
  if (options.force) command.emplace_back("--force");
  if (options.dry_run) command.emplace_back("--dry-run");
  if (options.quiet) command.emplace_back("--quiet");
  command.emplace_back("-");
  const ChildResult result =
      run_child(command, {.patience = 0.0, .input = bundle, .capture = false});
  if (result.status == 255) throw InputError(target + ": no connection over ssh");
  if (result.status == 2) throw InputError(target + ": refused, see above");
  if (result.status != 0) throw JobFailed(target + ": not flashed, see above");
}

void flash(const Options& options) {
  if (options.words.size() == 1) return flash_here(options, options.words[0]);
  flash_over_ssh(options, options.words[0], options.words[1]);
}

void roll_back(const Options& options) {
  outlive_the_terminal();
  const Target target = load_target(options.root);
  const StopGuard stop;
  Progress progress(options.quiet);
  Flasher flasher(options.root, make_hooks(options, target, progress, stop));
  const SlotContent content = flasher.roll_back(
      options.failed ? "the service failed too often" : "asked for", options.failed, options.force);
  std::cout << "rolled back: " << content.manifest.name() << '\n';
}

void recover(const Options& options) {
  Progress progress(options.quiet);
  FlashHooks hooks;
  Target target;
  // At boot the service has not been started yet, and will be from the right slot.
  if (!options.boot) {
    target = load_target(options.root);
    if (!target.restart.empty()) hooks.restart = [&] { restart(target); };
  }
  const std::string done = Flasher(options.root, hooks).recover();
  std::cout << (done.empty() ? "nothing to recover" : done) << '\n';
}

std::string slot_text(const SlotStore& store, Slot slot) {
  const std::optional<SlotContent> content = read_slot(store.slot(slot));
  return content ? content->manifest.name() + " (" + content->id.substr(0, 12) + ")" : "empty";
}

void status(const Options& options) {
  const SlotStore store(options.root);
  const FlashState state = store.load_state();
  const std::optional<Slot> current = store.current();
  if (options.json) {
    const auto name = [](const std::optional<Slot>& slot) {
      return slot ? nlohmann::json(to_string(*slot)) : nlohmann::json(nullptr);
    };
    std::cout << nlohmann::ordered_json{{"current", name(current)},
                                        {"committed", name(state.committed)},
                                        {"trial", name(state.trial)},
                                        {"a", slot_text(store, Slot::kA)},
                                        {"b", slot_text(store, Slot::kB)},
                                        {"bad", state.bad.size()}}
                     .dump(2)
              << '\n';
  } else {
    for (const Slot slot : {Slot::kA, Slot::kB})
      std::cout << "slot " << to_string(slot) << ":  " << slot_text(store, slot)
                << (current == slot ? "  <- current" : "")
                << (state.trial == slot ? ", on trial" : "") << '\n';
    for (const FlashEvent& bad : state.bad)
      std::cout << "bad:     " << bad.name << " (" << bad.id.substr(0, 12) << ") " << bad.detail
                << '\n';
    for (const PublicKey& key : pinned_keys(options.root))
      std::cout << "key:     " << key.id() << ' ' << key.name << '\n';
  }
  if (current) (void)verify_slot(store.slot(*current));
  if (current != state.committed)
    throw JobFailed("a flash is under way or was interrupted (`clamber flash recover`)");
}

void history(const Options& options) {
  for (const FlashEvent& e : SlotStore(options.root).load_state().history)
    std::cout << e.time << "  " << e.what << "  " << e.name << " (" << e.id.substr(0, 12) << ")  "
              << e.detail << '\n';
}

void setup(const Options& options) {
  const RobotModel robot = load_robot(RobotOptions{.robot = options.robot});
  const std::string hal = find_file(options.hal).string();
  Target target;
  target.robot = robot.name;
  target.model = robot.hash;
  target.hardware = hardware_of(hal, robot);
  target.restart = options.restart;
  if (target.restart.empty() && options.root == "/") target.restart = kRestartUnit;
  target.health = options.health;
  target.doctor = options.root == "/";
  const fs::path file = target_file(options.root);
  if (fs::exists(file) && !options.force)
    throw InputError(file.string() + ": exists (--force replaces it)");
  make_folders(file.parent_path());
  replace_file(file, format_target(target), 0644);
  std::cout << format_target(target) << "written: " << file.string() << '\n';
}

CLI::App* add(CLI::App& flash, const char* name, const char* what,
              const std::shared_ptr<Options>& options, void (*run)(const Options&)) {
  CLI::App* command = flash.add_subcommand(name, what);
  command->add_option("--root", options->root, "the robot's file system")->capture_default_str();
  command->add_flag("-q,--quiet", options->quiet, "no progress");
  command->callback([options, run] { run(*options); });
  return command;
}

}  // namespace

void add_flash_command(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "flash", "Puts a bundle onto a robot's computer: checked, tried, and taken back if it fails");
  command->add_option("bundle", options->words, "[user@host] BUNDLE; `-`: from standard input")
      ->expected(1, 2);
  command->add_option("--root", options->root, "the robot's file system")->capture_default_str();
  command->add_flag("--dry-run", options->dry_run, "checks only; changes nothing");
  command->add_flag("--force", options->force, "also what did not come up before, or is in use");
  command->add_flag("--sudo", options->sudo, "over ssh: as root, with sudo -n");
  command->add_flag("-q,--quiet", options->quiet, "no progress");
  command->require_subcommand(0, 1);

  CLI::App* sub = add(*command, "status", "What is in the slots; every byte of the one in use",
                      options, status);
  sub->add_flag("--json", options->json, "as JSON");
  add(*command, "history", "What has been flashed, and what became of it", options, history);
  sub = add(*command, "rollback", "Back to the other slot", options, roll_back);
  sub->add_flag("--force", options->force, "also if that one did not come up before");
  sub->add_flag("--failed", options->failed, "what is in use failed; it is remembered as bad");
  sub = add(*command, "recover", "Takes an interrupted flash back", options, recover);
  sub->add_flag("--boot", options->boot, "the service is not running yet");
  sub =
      add(*command, "setup", "Says which robot this is (etc/clamber/target.yaml)", options, setup);
  sub->add_flag("--force", options->force, "replaces what was said before");
  sub->add_option("--robot", options->robot, "folder of the robot")->capture_default_str();
  sub->add_option("--hal", options->hal, "the robot's bus map")->capture_default_str();
  sub->add_option("--restart", options->restart,
                  "command that restarts the service (at /: of the unit; else none: files only)");
  sub->add_option("--health-time", options->health.time, "s that a version must be well")
      ->capture_default_str();
  sub->add_option("--health-timeout", options->health.timeout, "s until then")
      ->capture_default_str();
  sub->add_option("--overruns", options->health.overruns, "late ticks allowed meanwhile")
      ->capture_default_str();
  command->footer(
      "Steps: signature, robot and machine, every file, disk, drives off, unpack, read back,\n"
      "preflight in the new slot, switch, restart, health, commit (docs/deploy.md). Killed or\n"
      "without power at any of them the robot runs the old version or the new one, whole.\n"
      "Exit codes: 0 flashed; 1 it did not work and the old version is in use; 2 refused, nothing\n"
      "was changed.\n\n"
      "Examples:\n"
      "  clamber flash coman-1.2.0.cfw                        on the robot's computer\n"
      "  clamber flash robot@coman coman-1.2.0.cfw --sudo     from the desk\n"
      "  clamber flash rollback\n"
      "  clamber flash status --json");
  command->callback([options, command] {
    if (!command->get_subcommands().empty()) return;
    if (options->words.empty()) throw InputError("flash: which bundle? (see clamber flash --help)");
    flash(*options);
  });
}

}  // namespace clamber
