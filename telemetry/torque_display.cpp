#include "telemetry/torque_display.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>

namespace clamber {
namespace {

constexpr std::size_t kWorstShown = 3;
constexpr int kBarWidth = 30;
constexpr int kHeaderRows = 3;

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

std::string clocks_and_counts(const TorqueWatch& watch, std::uint32_t ring_drops) {
  return format("t %.3f s  plan %.3f s  phase %u  frames %llu  lost %llu  ring drops %u",
                watch.last().time, watch.last().plan_time, watch.last().phase,
                static_cast<unsigned long long>(watch.received()),
                static_cast<unsigned long long>(watch.lost()), ring_drops);
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
  return format("%-14.24s %7.2f /%6s  %s[%s]\x1b[0m %4.0f %%  peak %7.2f", joint.name.c_str(),
                joint.now, limit_text(joint).c_str(), colour(joint.load(joint.window)),
                bar(joint).c_str(), 100.0 * joint.load(joint.now), joint.peak);
}

}  // namespace

std::string plain_line(const TorqueWatch& watch, std::uint32_t ring_drops) {
  std::string line = clocks_and_counts(watch, ring_drops);
  const std::vector<JointTorque> joints = watch.worst_first();
  for (std::size_t i = 0; i < std::min(kWorstShown, joints.size()); ++i) {
    const JointTorque& joint = joints[i];
    line += format("  | %s %.2f/%s N m, %s, peak %.2f", joint.name.c_str(), joint.window,
                   limit_text(joint).c_str(), margin_text(joint, joint.window).c_str(), joint.peak);
  }
  return line;
}

std::string dashboard(const TorqueWatch& watch, std::uint32_t ring_drops, int rows) {
  constexpr const char* kHome = "\x1b[H";
  constexpr const char* kEndLine = "\x1b[K\n";
  constexpr const char* kClearBelow = "\x1b[J";
  std::string screen = kHome + clocks_and_counts(watch, ring_drops) + kEndLine + kEndLine;
  const std::vector<JointTorque> joints = watch.worst_first();
  const auto room = static_cast<std::size_t>(std::max(1, rows - kHeaderRows));
  for (std::size_t i = 0; i < std::min(room, joints.size()); ++i) {
    screen += row(joints[i]) + kEndLine;
  }
  return screen + kClearBelow;
}

}  // namespace clamber
