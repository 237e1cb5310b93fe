// clamber record: a run, received over DDS, as an MCAP file.
#include <atomic>
#include <chrono>
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/job_failed.hpp"
#include "apps/live_options.hpp"
#include "apps/run_support.hpp"
#include "recording/run_recorder.hpp"
#include "report/scene_json.hpp"
#include "telemetry/event_history.hpp"
#include "telemetry/frame_subscription.hpp"

namespace clamber {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

constexpr Seconds kFlushPeriod{1.0};
// Of silence, with the publisher gone: the run is over.
constexpr Seconds kOver{1.0};

struct Options {
  std::string out;
  std::optional<double> duration;
  double timeout = 60.0;
  LiveOptions live;
};

std::uint64_t now_since_1970() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint64_t>(
      std::chrono::duration_cast<std::chrono::nanoseconds>(now).count());
}

/// Records one run: from the first frame that comes until it ends.
class Recording {
 public:
  explicit Recording(const Options& options)
      : options_(options),
        config_(telemetry_config(options.live)),
        model_(load_robot(options.live.robot)),
        scenario_(load_scenario(options.live.scenario)),
        subscription_(config_, handlers()) {}

  void run() {
    std::cout << "waiting for robot '" << config_.robot << "' on DDS domain " << config_.domain
              << '\n'
              << std::flush;
    const Clock::time_point start = Clock::now();
    Clock::time_point flushed = start;
    while (!stop_.flag()->load() && !over()) {
      subscription_.receive(100ms);
      const Clock::time_point now = Clock::now();
      if (frames_ == 0 && now - start > Seconds(options_.timeout))
        throw JobFailed("no telemetry of robot '" + config_.robot + "' on DDS domain " +
                        std::to_string(config_.domain) + " within " +
                        std::to_string(static_cast<int>(options_.timeout)) + " s");
      if (recorder_ && now - flushed > kFlushPeriod) {
        recorder_->flush();
        flushed = now;
      }
    }
    finish();
  }

 private:
  [[nodiscard]] bool over() const {
    if (frames_ == 0) return false;
    if (another_run_) return true;
    if (options_.duration && last_.time - first_time_ >= *options_.duration) return true;
    return subscription_.publishers() == 0 && Clock::now() - received_ > kOver;
  }

  FrameSubscription::Handlers handlers() {
    return {
        .description = [this](const TelemetryDescription& d) { description_ = d; },
        .frame = [this](const TelemetryFrame& frame) { take(frame); },
        .event = [this](const TelemetryEvent& event, std::int64_t start) { take(event, start); },
        .robot_description = [this](const std::string& urdf) { take(urdf); }};
  }

  void take(const TelemetryFrame& frame) {
    // Frames without names would be numbers of nobody knows what.
    if (!description_ || another_run_) return;
    if (!recorder_) begin(frame);
    if (frames_ > 0 && frame.sequence <= last_.sequence) {
      another_run_ = true;
      return;
    }
    if (frames_ > 0) lost_ += frame.sequence - last_.sequence - 1;
    recorder_->add(frame);
    ++frames_;
    last_ = frame;
    received_ = Clock::now();
  }

  void take(const TelemetryEvent& event, std::int64_t start) {
    // Of the next run, whose frames are yet to come.
    if (recorder_ && history_.start() != 0 && start != history_.start()) another_run_ = true;
    if (another_run_) return;
    if (history_.add(event, start) && recorder_) recorder_->add(event);
  }

  /// Comes when the run does, and again from a publisher that was started again.
  void take(const std::string& urdf) {
    if (recorder_ && urdf_.empty()) recorder_->add_urdf(urdf);
    urdf_ = urdf;
  }

  void begin(const TelemetryFrame& frame) {
    const bool known = is_of(*description_, model_);
    if (!known)
      std::cout << "warning: its joints are not those of " << options_.live.robot.robot
                << " (--robot): recorded without shapes and /tf\n"
                << std::flush;
    RunDescription run{.robot = config_.robot, .telemetry = *description_, .scene = {}};
    if (known) run.scene = scene_json(model_, scenario_);
    first_time_ = frame.time;
    const auto since_start = static_cast<std::uint64_t>(frame.time * 1e9);
    recorder_.emplace(options_.out, run, known ? &model_ : nullptr, now_since_1970() - since_start,
                      first_time_);
    // What a run that is under way has told so far.
    if (!urdf_.empty()) recorder_->add_urdf(urdf_);
    for (const TelemetryEvent& event : history_.events()) recorder_->add(event);
    std::cout << "recording to " << options_.out << "; Ctrl-C ends it\n" << std::flush;
  }

  void finish() {
    if (!recorder_) return;
    recorder_->close();
    std::cout << "written: " << options_.out << ", " << frames_ << " frames, "
              << last_.time - first_time_ << " s, " << lost_ << " lost on the way\n";
  }

  const Options& options_;
  TelemetryConfig config_;
  RobotModel model_;
  Scenario scenario_;
  StopGuard stop_;
  FrameSubscription subscription_;
  std::optional<TelemetryDescription> description_;
  std::string urdf_;
  EventHistory history_;
  std::optional<RunRecorder> recorder_;
  TelemetryFrame last_;
  double first_time_ = 0.0;
  std::uint64_t frames_ = 0;
  std::uint64_t lost_ = 0;
  bool another_run_ = false;
  Clock::time_point received_;
};

}  // namespace

void add_record_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "record", "Records a run, as it comes over DDS, for Foxglove, PlotJuggler and clamber web");
  command->add_option("-o,--out", options->out, "MCAP file")->required();
  command->add_option("--duration", options->duration, "s (else until the run ends)")
      ->check(CLI::PositiveNumber);
  command->add_option("--timeout", options->timeout, "s to wait for the first frame")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  add_live_options(*command, options->live);
  command->footer(
      "Start it before the run. Every second goes to the file at once: a recorder that is killed\n"
      "or a disk that fills up loses what is not there yet and nothing else.\n"
      "Exit code 1: no frame came within the timeout.\n\n"
      "Example:\n"
      "  clamber record -o run.mcap &\n"
      "  clamber run out/climb/plan.json --realtime");
  command->callback([options] {
    make_folder_of(options->out);
    Recording(*options).run();
  });
}

}  // namespace clamber
