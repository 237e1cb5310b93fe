#include "report/summary.hpp"

#include <iomanip>
#include <ostream>

#include "report/markup.hpp"

namespace clamber {

namespace {

nlohmann::ordered_json peak_json(const std::optional<TorquePeak>& peak) {
  if (!peak) {
    return nullptr;
  }
  return {{"joint", peak->joint}, {"value", peak->value}};
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) {
    text += (text.empty() ? "" : " ") + name;
  }
  return text.empty() ? "none" : text;
}

std::string peak_text(const std::optional<TorquePeak>& peak) {
  return peak ? fixed(peak->value, 1) + " N m (" + peak->joint + " at " + fixed(peak->time, 2) +
                    " s)"
              : "not measured";
}

}  // namespace

double Summary::planning_total() const {
  double total = 0.0;
  for (const auto& [name, seconds] : planning_stages) {
    total += seconds;
  }
  return total;
}

void measure_peaks(const RunData& climb, const RunData* playback, Summary& summary) {
  summary.peak_plan = largest_peak(torque_peaks(climb));
  summary.peak_playback =
      playback != nullptr ? largest_peak(torque_peaks(*playback)) : std::nullopt;
  const std::optional<double> from = hands_carry_from(climb);
  summary.peak_after_hands = from ? largest_peak(torque_peaks(climb, *from)) : std::nullopt;
}

nlohmann::ordered_json to_json(const Summary& summary) {
  using nlohmann::ordered_json;
  ordered_json stages = ordered_json::object();
  for (const auto& [name, seconds] : summary.planning_stages) {
    stages[name] = seconds;
  }
  stages["total"] = summary.planning_total();

  ordered_json json;
  json["success"] = summary.success;
  json["judge"] = ordered_json{{"final_contacts", summary.judge.final_contacts},
                               {"floor_contacts", summary.judge.floor_contacts},
                               {"weight_on_obstacle", summary.judge.weight_on_obstacle},
                               {"forbidden_contacts", summary.judge.forbidden_contacts},
                               {"rest_speed", summary.judge.rest_speed}};
  json["obstacle_height_m"] = summary.obstacle_height;
  json["outcome"] = summary.outcome;
  json["recording"] = summary.recording;
  json["peak_torque_nm"] = ordered_json{{"plan", peak_json(summary.peak_plan)},
                                        {"playback", peak_json(summary.peak_playback)}};
  const auto& after = summary.peak_after_hands;
  json["peak_torque_after_hands_nm"] = after ? ordered_json(after->value) : ordered_json(nullptr);
  json["playback_success"] =
      summary.playback_success ? ordered_json(*summary.playback_success) : ordered_json(nullptr);
  json["planning_s"] = stages;
  json["real_time_factor"] = summary.real_time_factor;
  json["plan_sha256"] = summary.plan_sha256;
  json["log_sha256"] = summary.log_sha256;
  json["peak_torque_after_hands_joint"] =
      after ? ordered_json(after->joint) : ordered_json(nullptr);
  json["synthetic_recording"] = summary.synthetic_recording;
  json["feed_forward"] = summary.feed_forward;
  json["ballast_kg"] = summary.ballast;
  return json;
}

void print_summary(const Summary& summary, std::ostream& out) {
  const auto row = [&out](const char* name, const std::string& value) {
    out << "  " << std::left << std::setw(34) << name << value << '\n';
  };
  out << (summary.success ? "SUCCESS" : "FAILURE") << ": the robot "
      << (summary.success ? "is " : "is not ") << summary.outcome << " the "
      << fixed(summary.obstacle_height, 3) << " m obstacle\n";
  row("final contacts", joined(summary.judge.final_contacts));
  row("floor contacts", joined(summary.judge.floor_contacts));
  row("forbidden contacts", joined(summary.judge.forbidden_contacts));
  row("weight on obstacle", fixed(100.0 * summary.judge.weight_on_obstacle, 1) + " %");
  row("speed at rest", fixed(summary.judge.rest_speed, 4) + " m/s");
  row("recording", summary.recording + (summary.synthetic_recording ? " (SYNTHETIC)" : ""));
  row("feed-forward", summary.feed_forward ? "on" : "off (PID alone)");
  if (summary.ballast > 0.0) {
    row("ballast", fixed(summary.ballast, 2) + " kg");
  }
  row("peak torque, plan", peak_text(summary.peak_plan));
  row("  once hands carry", peak_text(summary.peak_after_hands));
  row("peak torque, playback", peak_text(summary.peak_playback));
  row("playback", !summary.playback_success   ? "not run"
                  : *summary.playback_success ? "reached the goal"
                                              : "did not reach the goal");
  for (const auto& [name, seconds] : summary.planning_stages) {
    row(("planning: " + name).c_str(), fixed(seconds, 2) + " s");
  }
  row("planning: total", fixed(summary.planning_total(), 2) + " s");
  row("real-time factor", fixed(summary.real_time_factor, 1));
  row("plan SHA-256", summary.plan_sha256);
  row("log SHA-256", summary.log_sha256);
}

}  // namespace clamber
