#include "telemetry/torque_display.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>

namespace clamber {
namespace {

constexpr std::size_t kWorstShown = 3;
constexpr int kBarWidth = 30;
constexpr int kHeaderRows = 4;  // the last one holds the cursor
constexpr std::size_t kEventsShown = 4;
constexpr int kRowsForEvents = 16;

#define CLAMBER_PRINTF __attribute__((format(printf, 1, 2)))
std::string format(const char* text, ...) CLAMBER_PRINTF;

std::string format(const char* text, ...) {
  char buffer[256];
  va_list arguments;
  va_start(arguments, text);
  std::vsnprintf(buffer, sizeof buffer, text, arguments);
  va_end(arguments);
  return buffer;
}

unsigned long long number(std::uint64_t value) { return value; }

std::string name_of(const std::vector<std::string>& names, std::uint32_t index) {
  return index < names.size() ? names[index] : std::to_string(index);
}

std::string clocks_and_counts(const MonitorView& view) {
  const TorqueWatch& watch = view.torques;
  return format("t %.3f s  plan %.3f s  frames %llu  lost %llu  ring drops %llu", watch.last().time,
                watch.last().plan_time, number(watch.received()), number(watch.lost()),
                number(view.ring_drops));
}

std::string loop_text(const LoopFigures& loop) {
  std::string text = "loop ";
  text += loop.paced ? format(
                           "wake-up p99 %.0f max %.0f us, tick p99 %.0f max %.0f us, late %llu "
                           "(%llu grid points lost)",
                           loop.wakeup_p99, loop.wakeup_max, loop.tick_p99, loop.tick_max,
                           number(loop.overruns), number(loop.skipped))
                     : std::string("as fast as possible");
  text += format("; bus %s, %llu replies missing; gaps %llu, refused %llu, event drops %llu",
                 loop.bus_down ? "down" : "up", number(loop.missing_replies), number(loop.gaps),
                 number(loop.refused), number(loop.event_drops));
  if (loop.restarts > 0)
    text += format(", publisher restarted %llu times (%llu hung)", number(loop.restarts),
                   number(loop.hangs));
  return text;
}

std::string limit_text(const JointTorque& joint) {
  return joint.limit ? format("%.1f", *joint.limit) : "?";
}

std::string margin_text(const JointTorque& joint, double torque) {
  if (!joint.limit) return "limit unknown";
  return format("margin %.1f %%", 100.0 * (1.0 - joint.load(torque)));
}

const char* colour(double load) {
  if (load >= 0.9) return "\x1b[31m";
  if (load >= 0.7) return "\x1b[33m";
  return "\x1b[32m";
}

/// '#' up to the load, '|' where the peak is held.
std::string bar(const JointTorque& joint) {
  const auto cells = [](double load) {
    return std::clamp(static_cast<int>(std::lround(load * kBarWidth)), 0, kBarWidth);
  };
  std::string text(kBarWidth, '.');
  std::fill_n(text.begin(), cells(joint.load(joint.now)), '#');
  const int peak = cells(joint.load(joint.peak));
  if (peak > 0) text[static_cast<std::size_t>(peak - 1)] = '|';
  return text;
}

std::string row(const JointTorque& joint) {
  return format("%-14.24s %7.2f /%6s  %s[%s]\x1b[0m %4.0f %%  peak %7.2f  at limit %6.3f s",
                joint.name.c_str(), joint.now, limit_text(joint).c_str(),
                colour(joint.load(joint.window)), bar(joint).c_str(), 100.0 * joint.load(joint.now),
                joint.peak, joint.saturated);
}

}  // namespace

std::string state_text(const TorqueWatch& watch) {
  const TelemetryFrame& frame = watch.last();
  const TelemetryDescription& names = watch.description();
  std::string text = "mode " + name_of(names.modes, frame.mode) + format("  phase %u", frame.phase);
  if (frame.phase < names.phases.size()) text += " '" + names.phases[frame.phase].name + "'";
  text += "  fault " + (frame.fault == 0 ? "none" : name_of(names.faults, frame.fault));
  if (frame.fault_joint < kMaxJoints)
    text += " at " + name_of(names.joint_names, frame.fault_joint);
  return text;
}

std::string event_text(const TelemetryEvent& event, const TelemetryDescription& description) {
  constexpr std::array kKinds{"mode", "fault", "phase", "plan", "telemetry"};
  constexpr std::array kSeverities{"info", "warning", "error"};
  const auto kind = static_cast<std::size_t>(event.kind);
  const auto severity = static_cast<std::size_t>(event.severity);
  std::string text = format("%9.3f s  %-7s  %s: ", event.time,
                            severity < kSeverities.size() ? kSeverities[severity] : "?",
                            kind < kKinds.size() ? kKinds[kind] : "?");
  text += event.view();
  if (event.joint >= 0)
    text += " at " + name_of(description.joint_names, static_cast<std::uint32_t>(event.joint));
  return text;
}

std::string plain_line(const MonitorView& view) {
  std::string line = clocks_and_counts(view) + "  " + state_text(view.torques);
  const std::vector<JointTorque> joints = view.torques.worst_first();
  for (std::size_t i = 0; i < std::min(kWorstShown, joints.size()); ++i) {
    const JointTorque& joint = joints[i];
    line += format("  | %s %.2f/%s N m, %s, peak %.2f", joint.name.c_str(), joint.window,
                   limit_text(joint).c_str(), margin_text(joint, joint.window).c_str(), joint.peak);
    if (joint.saturated > 0.0) line += format(", %.3f s at limit", joint.saturated);
  }
  if (view.loop) line += "  | " + loop_text(*view.loop);
  return line;
}

std::string dashboard(const MonitorView& view, int rows) {
  constexpr const char* kHome = "\x1b[H";
  constexpr const char* kEndLine = "\x1b[K\n";
  constexpr const char* kClearBelow = "\x1b[J";
  std::string screen = kHome + clocks_and_counts(view) + kEndLine;
  screen += state_text(view.torques) + kEndLine;
  screen += (view.loop ? loop_text(*view.loop) : "loop ?") + kEndLine;
  const std::size_t events =
      rows >= kRowsForEvents ? std::min(kEventsShown, view.events.size()) : 0;
  for (std::size_t i = view.events.size() - events; i < view.events.size(); ++i)
    screen += event_text(view.events[i], view.torques.description()) + kEndLine;
  const std::vector<JointTorque> joints = view.torques.worst_first();
  const int taken = kHeaderRows + static_cast<int>(events);
  const auto room = static_cast<std::size_t>(std::max(1, rows - taken));
  for (std::size_t i = 0; i < std::min(room, joints.size()); ++i) {
    screen += row(joints[i]) + kEndLine;
  }
  return screen + kClearBelow;
}

}  // namespace clamber
