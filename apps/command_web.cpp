// clamber web: the robot in the browser, live or from a finished run.
#include <atomic>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>
#include <thread>
#include <utility>

#include <unistd.h>

#include "apps/commands.hpp"
#include "apps/live_options.hpp"
#include "apps/run_source.hpp"
#include "apps/run_support.hpp"
#include "recording/run_file.hpp"
#include "report/scene_json.hpp"
#include "robot_model/loader.hpp"
#include "telemetry/event_history.hpp"
#include "telemetry/frame_subscription.hpp"
#include "web/page.hpp"
#include "web/server.hpp"
#include "web/story.hpp"
#include "web/view_rows.hpp"

namespace clamber {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

struct Options {
  std::string file;
  int port = 8420;
  LiveOptions live;
};

/// Serves until a signal comes, while `work` is called over and over.
void serve(WebServer& server, const std::string& what, const std::function<void()>& work) {
  const StopGuard stop;
  const std::jthread thread([&] { server.serve(); });
  // Before the thread is waited for, whatever `work` throws.
  const std::unique_ptr<WebServer, void (*)(WebServer*)> end(&server,
                                                             [](WebServer* s) { s->stop(); });
  std::cout << what << std::flush;
  while (!stop.flag()->load()) work();
}

std::string address(const WebServer& server) {
  return "http://127.0.0.1:" + std::to_string(server.port()) + "/";
}

/// A run log as a recording in the temporary folder; a recording as it is.
class ServedRecording {
 public:
  explicit ServedRecording(const fs::path& file) : path_(fs::absolute(file)) {
    const RunSource source = open_run(file, {});
    if (!source.model) return;  // an MCAP file
    path_ = fs::temp_directory_path() / ("clamber_web_" + std::to_string(getpid()) + ".mcap");
    made_ = true;
    copy_run(source, *open_mcap(path_, source.run, &*source.model));
  }
  ~ServedRecording() {
    std::error_code error;
    if (made_) fs::remove(path_, error);
  }
  ServedRecording(const ServedRecording&) = delete;
  ServedRecording& operator=(const ServedRecording&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
  bool made_ = false;
};

void show_file(const Options& options) {
  const ServedRecording recording(options.file);
  WebServer server(options.port, {}, recording.path());
  serve(server, options.file + ": " + address(server) + "?file=recording.mcap\nCtrl-C ends it\n",
        [] { std::this_thread::sleep_for(100ms); });
}

/// From DDS to the browsers' feed.
class LiveView {
 public:
  explicit LiveView(const Options& options)
      : config_(telemetry_config(options.live)),
        model_(load_robot(options.live.robot)),
        robot_(options.live.robot.robot),
        rows_(model_.joints.size(), model_.contacts.size()),
        feed_(rows_.width()),
        subscription_(config_, handlers()),
        server_(options.port,
                {.scene = scene_json(model_, load_scenario(options.live.scenario)),
                 .layout = rows_.layout(),
                 .feed = &feed_,
                 .story = &story_,
                 .note = [this] { return note(); }},
                {}) {}

  void run() {
    serve(server_,
          address(server_) + " shows robot '" + config_.robot + "' of DDS domain " +
              std::to_string(config_.domain) + "\nCtrl-C ends it\n",
          [this] { receive(); });
  }

 private:
  FrameSubscription::Handlers handlers() {
    return {
        .description = [this](const TelemetryDescription& d) { describe(d); },
        .frame = [this](const TelemetryFrame& frame) { take(frame); },
        .event = [this](const TelemetryEvent& event,
                        std::int64_t start) { changed_ = history_.add(event, start) || changed_; },
        .robot_description = {}};
  }

  void receive() {
    subscription_.receive(100ms);
    publishers_ = subscription_.publishers();
    if (std::exchange(changed_, false)) story_.tell(story_json(names_, history_.events()));
  }

  void describe(const TelemetryDescription& description) {
    other_ = !is_of(description, model_);
    names_ = description;
    changed_ = true;
  }

  void take(const TelemetryFrame& frame) {
    if (other_) return;
    const std::span<const float> row = rows_.add(frame);
    if (!row.empty()) feed_.push(row);
  }

  /// Called by the server's threads.
  [[nodiscard]] std::string note() const {
    if (other_) return "the robot's joints are not those of " + robot_ + " (--robot)";
    if (publishers_ == 0)
      return "nobody publishes robot '" + config_.robot + "' on DDS domain " +
             std::to_string(config_.domain) + " now";
    return "";
  }

  TelemetryConfig config_;
  RobotModel model_;
  std::string robot_;
  ViewRows rows_;
  LiveFeed feed_;
  LiveStory story_;
  TelemetryDescription names_;
  EventHistory history_;
  bool changed_ = false;  ///< the story, since it was told
  FrameSubscription subscription_;
  std::atomic<bool> other_{false};
  std::atomic<int> publishers_{0};
  WebServer server_;
};

void run(const Options& options) {
  if (web_page().empty())
    throw InputError(
        "this program was built without the page: install nodejs and npm, then "
        "cmake -DCLAMBER_WEB=ON and build again");
  if (!options.file.empty()) return show_file(options);
  LiveView(options).run();
}

}  // namespace

void add_web_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "web", "Shows the robot, its contacts and torques in the browser, live or from a file");
  command->add_option("file", options->file,
                      "run log or recording (.mcap) to show in place of the live robot");
  command->add_option("--port", options->port, "of this machine's loopback; 0: any that is free")
      ->capture_default_str()
      ->check(CLI::Range(0, 65535));
  add_live_options(*command, options->live);
  command->footer(
      "Only browsers on this machine reach it, and they can look and nothing else. From another\n"
      "machine: ssh -L 8420:127.0.0.1:8420 ROBOT. Up to 16 browsers may watch.\n\n"
      "Examples:\n"
      "  clamber web &\n"
      "  clamber run out/climb/plan.json --realtime\n"
      "  clamber web run.mcap");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
