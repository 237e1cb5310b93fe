#include "apps/service_monitor.hpp"

#include <algorithm>
#include <iostream>

namespace clamber {
namespace {

constexpr auto kUnwatched = std::chrono::milliseconds(500);  // as if the watchdog's time were this
constexpr auto kOften = std::chrono::milliseconds(200);
constexpr auto kSwitching = std::chrono::seconds(15);  // for all drives to come on, or to go off
// A run's log is written at its end, from memory, and no loop goes round meanwhile.
constexpr const char* kStopping = "STOPPING=1\nWATCHDOG_USEC=60000000\nSTATUS=writing logs";

}  // namespace

bool ServiceMonitor::Counter::stands(std::uint64_t now, Clock::time_point at,
                                     Clock::duration limit) {
  if (now != value) {
    value = now;
    moved = at;
  }
  return at - moved > limit;
}

ServiceMonitor::ServiceMonitor(Sources sources, ServiceHealth health, std::filesystem::path file)
    : sources_(std::move(sources)),
      health_(std::move(health)),
      file_(std::move(file)),
      limit_(notifier_.watchdog().value_or(kUnwatched) / 2),
      thread_([this](const std::stop_token& stop) { watch(stop); }) {}

ServiceMonitor::~ServiceMonitor() {
  thread_.request_stop();
  thread_.join();
  if (!stopping_) notifier_.send(kStopping);
  std::error_code error;
  if (!file_.empty()) std::filesystem::remove(file_, error);
}

void ServiceMonitor::watch(const std::stop_token& stop) {
  // Four looks within the time in which a standstill must be seen, and often enough for those who
  // wait for the health file.
  const auto pause = std::min<Clock::duration>(limit_ / 4, kOften);
  for (; !stop.stop_requested(); std::this_thread::sleep_for(pause)) {
    if (sources_.pulse->over) {
      if (!stopping_) notifier_.send(kStopping);
      stopping_ = true;
      continue;
    }
    tell(find_problem(Clock::now()));
    write_down();
  }
}

std::string ServiceMonitor::find_problem(Clock::time_point now) {
  const RunPulse& pulse = *sources_.pulse;
  const std::uint64_t beats = pulse.beats;
  const bool loop_stands = loop_.stands(beats, now, pulse.switching ? kSwitching : limit_);
  const bool publisher_stands =
      sources_.publisher && publisher_.stands(sources_.publisher(), now, limit_);
  if (!pulse.torque || pulse.fault || pulse.stale_joints == 0) fresh_ = now;
  health_.beats = beats;
  health_.overruns = pulse.overruns;
  health_.torque = pulse.torque;
  note_joints();
  if (loop_stands) return "the control loop stands still";
  if (publisher_stands) return "telemetry's publisher stands still";
  if (now - fresh_ > limit_)
    return std::to_string(pulse.stale_joints.load()) + " joints have had no fresh state";
  return "";
}

void ServiceMonitor::note_joints() {
  if (!sources_.drives) return;
  health_.drives = sources_.drives();
  if (!health_.torque) return;
  const auto stale = static_cast<int>(sources_.pulse->stale_joints);
  health_.drives = {.heard = health_.joints - stale, .faulty = 0, .trouble = "no fresh state"};
}

void ServiceMonitor::tell(const std::string& problem) {
  if (problem != health_.problem) {
    std::cerr << "clamber: service: " << (problem.empty() ? "goes on" : problem) << '\n';
    notifier_.send("STATUS=" + problem);
  }
  health_.problem = problem;
  if (!problem.empty()) return;
  if (!health_.ready && health_.beats > 0) {
    notifier_.send("READY=1\nSTATUS=drives off until `clamber arm`");
    health_.ready = true;
  }
  if (!health_.ready) return;
  notifier_.send("WATCHDOG=1");
  ++health_.pings;
}

void ServiceMonitor::write_down() {
  if (file_.empty()) return;
  try {
    save_health(health_, file_);
  } catch (const std::exception& error) {
    std::cerr << "clamber: service: " << error.what() << '\n';
    file_.clear();
  }
}

}  // namespace clamber
