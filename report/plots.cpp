#include "report/plots.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include "report/markup.hpp"
#include "report/peaks.hpp"
#include "report/svg_plot.hpp"

namespace clamber {

namespace {

constexpr double kWidth = 1000.0;
constexpr double kLeft = 58.0;
constexpr double kShownForce = 1.0;  // N

using Series = std::vector<double>;

Series column(const RunData& run, const std::function<double(const TelemetryFrame&)>& value) {
  Series out;
  out.reserve(run.frames.size());
  for (const TelemetryFrame& frame : run.frames) {
    out.push_back(value(frame));
  }
  return out;
}

Series times(const RunData& run) {
  return column(run, [](const TelemetryFrame& f) { return f.time; });
}

SvgAxes::Range time_range(const RunData& run) {
  if (run.frames.empty()) {
    return {0.0, 1.0};
  }
  const double first = run.frames.front().time;
  return {first, std::max(first + 0.1, run.frames.back().time)};
}

struct ShownJoint {
  std::size_t index;
  std::string name;
  std::string css;
};

// Left knee, right knee, left elbow, right elbow, as in the paper's figure.
std::vector<ShownJoint> figure_joints(const RobotModel& model) {
  struct Wanted {
    char side;
    const char* part;
    const char* css;
  };
  constexpr std::array<Wanted, 4> kWanted{
      {{'L', "Knee", "c0"}, {'R', "Knee", "c1"}, {'L', "Elb", "c2"}, {'R', "Elb", "c3"}}};
  std::vector<ShownJoint> shown;
  for (const Wanted& wanted : kWanted) {
    for (std::size_t j = 0; j < model.joints.size(); ++j) {
      const std::string& name = model.joints[j].name;
      if (name.starts_with(wanted.side) && name.find(wanted.part) != std::string::npos) {
        shown.push_back({j, name, wanted.css});
        break;
      }
    }
  }
  return shown;
}

double largest_shown(const RunData& run, const std::vector<ShownJoint>& joints) {
  double largest = 0.0;
  for (const TelemetryFrame& frame : run.frames) {
    for (const ShownJoint& joint : joints) {
      largest = std::max(largest, std::abs(frame.tau_meas[joint.index]));
    }
  }
  return largest;
}

double common_limit(const RobotModel& model, const std::vector<ShownJoint>& joints) {
  double limit = std::numeric_limits<double>::max();
  for (const ShownJoint& joint : joints) {
    limit = std::min(limit, model.joints[joint.index].torque_limit);
  }
  return joints.empty() ? 0.0 : limit;
}

std::string torque_panel(const RunData& run, const std::string& title, const SvgAxes::Frame& frame,
                         double top) {
  const auto joints = figure_joints(run.model);
  const SvgAxes axes(frame, time_range(run), {-top, top});
  std::string out = axes.axes(title, "time, s", "torque, N m");
  const Series t = times(run);
  for (const ShownJoint& joint : joints) {
    out += axes.curve(
        t, column(run, [&joint](const TelemetryFrame& f) { return f.tau_meas[joint.index]; }),
        joint.css);
  }
  const double limit = common_limit(run.model, joints);
  if (limit > 0.0) {
    out += axes.level(limit, "limit") + axes.level(-limit, "limit");
  }
  return out;
}

std::string torque_legend(const RobotModel& model, double y) {
  std::string out;
  double x = kLeft;
  const auto joints = figure_joints(model);
  for (const ShownJoint& joint : joints) {
    out += "<path class=\"curve " + joint.css + "\" style=\"stroke-width:3\" d=\"M" + fixed(x, 1) +
           "," + fixed(y - 4, 1) + "h22\"/>" + svg_text(x + 28, y, joint.name, "");
    x += 120.0;
  }
  out += "<path class=\"limit\" d=\"M" + fixed(x, 1) + "," + fixed(y - 4, 1) + "h22\"/>";
  return out + svg_text(x + 28, y, "limit " + fixed(common_limit(model, joints), 0) + " N m", "");
}

std::string force_row(const RunData& run, const SvgAxes& axes, double y, double height,
                      const std::function<double(const TelemetryFrame&)>& force, double weight,
                      const std::string& css) {
  // Mean force of every pixel column, then runs of equal shade as one bar.
  const auto columns = static_cast<std::size_t>(axes.frame().width);
  std::vector<double> sum(columns, 0.0);
  std::vector<int> count(columns, 0);
  for (const TelemetryFrame& frame : run.frames) {
    const double x = axes.px(frame.time) - axes.frame().left;
    const auto i = std::min(columns - 1, static_cast<std::size_t>(std::max(0.0, x)));
    sum[i] += force(frame);
    ++count[i];
  }
  std::vector<int> shade(columns, 0);
  for (std::size_t i = 0; i < columns; ++i) {
    if (count[i] == 0) {  // fewer frames than columns: the last one holds
      shade[i] = i > 0 ? shade[i - 1] : 0;
      continue;
    }
    const double mean = sum[i] / count[i];
    shade[i] = mean < kShownForce     ? 0
               : mean < 0.05 * weight ? 1
               : mean < 0.15 * weight ? 2
               : mean < 0.30 * weight ? 3
                                      : 4;
  }
  std::string out;
  for (std::size_t begin = 0; begin < columns;) {
    std::size_t end = begin;
    while (end < columns && shade[end] == shade[begin]) {
      ++end;
    }
    if (shade[begin] > 0) {
      out += svg_rect(axes.frame().left + static_cast<double>(begin), y,
                      static_cast<double>(end - begin), height,
                      css + " o" + std::to_string(shade[begin]));
    }
    begin = end;
  }
  return out;
}

double sum_of(const std::array<double, kMaxContacts>& forces, std::uint32_t count) {
  double sum = 0.0;
  for (std::size_t i = 0; i < std::min<std::size_t>(count, kMaxContacts); ++i) {
    sum += forces[i];
  }
  return sum;
}

std::string weight_panel(const RunData& run, const SvgAxes::Frame& frame, double weight) {
  const SvgAxes axes(frame, time_range(run), {0.0, 1.3});
  std::string out = axes.axes("Share of the robot's weight", "time, s", "share");
  const Series t = times(run);
  out += axes.curve(t,
                    column(run,
                           [weight](const TelemetryFrame& f) {
                             return sum_of(f.force_obstacle, f.contact_count) / weight;
                           }),
                    "hold-line");
  out += axes.curve(t,
                    column(run,
                           [weight](const TelemetryFrame& f) {
                             return sum_of(f.force_floor, f.contact_count) / weight;
                           }),
                    "floor-line");
  out += axes.curve(t,
                    column(run,
                           [weight](const TelemetryFrame& f) {
                             return (f.force_forbidden + f.force_other) / weight;
                           }),
                    "bad-line");
  return out;
}

std::string contact_legend(double y) {
  struct Entry {
    const char* css;
    const char* text;
    double width;
  };
  constexpr std::array<Entry, 3> kEntries{{{"hold", "on the obstacle", 150},
                                           {"floor", "on the floor", 130},
                                           {"bad", "forbidden or other links", 190}}};
  std::string out;
  double x = kLeft + 30;
  for (const Entry& entry : kEntries) {
    out += svg_rect(x, y - 10, 20, 11, entry.css) + svg_text(x + 26, y, entry.text, "");
    x += entry.width;
  }
  return out + svg_text(x, y, "shade: up to 5, 15, 30 % and more of the weight", "soft small");
}

}  // namespace

std::string plot_torques(const RunData* playback, const RunData& climb) {
  double top = std::max(32.0, largest_shown(climb, figure_joints(climb.model)));
  if (playback != nullptr) {
    top = std::max(top, largest_shown(*playback, figure_joints(playback->model)));
  }
  top = 1.08 * top;
  constexpr double kTop = 58.0;
  constexpr double kHeight = 300.0;
  std::string body = torque_legend(climb.model, 16.0);
  if (playback != nullptr) {
    constexpr double kPanel = 0.5 * (kWidth - 2 * kLeft) - 12.0;
    body +=
        torque_panel(*playback, "Playback of the recording", {kLeft, kTop, kPanel, kHeight}, top);
    body += torque_panel(climb, "Plan", {kWidth - kPanel - 10.0, kTop, kPanel, kHeight}, top);
  } else {
    body += torque_panel(climb, "Plan", {kLeft, kTop, kWidth - kLeft - 10.0, kHeight}, top);
  }
  return svg_document(kWidth, kTop + kHeight + 42.0, "Torque of knees and elbows over time", body);
}

std::string plot_peaks(const RunData* playback, const RunData& climb) {
  const auto peaks = torque_peaks(climb);
  const auto played = playback != nullptr ? torque_peaks(*playback) : std::vector<TorquePeak>{};
  double top = 32.0;
  for (const auto* list : {&peaks, &played}) {
    for (const TorquePeak& peak : *list) {
      top = std::max(top, peak.value);
    }
  }
  constexpr double kNames = 90.0;
  constexpr double kTop = 48.0;
  const double row = playback != nullptr ? 25.0 : 17.0;
  const double height = row * static_cast<double>(peaks.size());
  const SvgAxes axes({kNames, kTop, kWidth - kNames - 60.0, std::max(1.0, height)},
                     {0.0, 1.05 * top}, {0.0, 1.0});
  std::string body = axes.axes("", "largest |torque|, N m", "");
  body += svg_rect(kNames, 10, 20, 11, "b0") + svg_text(kNames + 26, 20, "plan", "");
  if (playback != nullptr) {
    body += svg_rect(kNames + 80, 10, 20, 11, "b1") + svg_text(kNames + 106, 20, "playback", "");
  }
  body += "<path class=\"limit\" d=\"M" + fixed(kNames + 190, 1) + ",16h22\"/>" +
          svg_text(kNames + 218, 20, "the joint's limit", "");
  const auto bar = [&](const TorquePeak& peak, double limit, double y, const char* css) {
    return svg_rect(kNames, y, axes.px(peak.value) - kNames, 9.0, css) +
           svg_text(axes.px(peak.value) + 5, y + 8.5, fixed(peak.value, 1),
                    limit > 0.0 && peak.value > limit ? "small over" : "small soft");
  };
  for (std::size_t j = 0; j < peaks.size(); ++j) {
    const double y = kTop + row * static_cast<double>(j) + 3.0;
    const double limit = climb.model.joints[j].torque_limit;
    body += svg_text(kNames - 8, y + row / 2 + 1, peaks[j].joint, "end small");
    body += bar(peaks[j], limit, y, "b0");
    if (j < played.size()) {
      body += bar(played[j], limit, y + 10.0, "b1");
    }
    body += "<path class=\"limit\" d=\"M" + fixed(axes.px(limit), 1) + "," + fixed(y - 3, 1) + "v" +
            fixed(row, 1) + "\"/>";
  }
  return svg_document(kWidth, kTop + height + 42.0, "Largest torque of every joint", body);
}

std::string plot_support_margin(const Plan& plan) {
  Series t;
  Series margin;
  double low = 0.0;
  double high = 0.05;
  for (const Keyframe& keyframe : plan.keyframes) {
    t.push_back(keyframe.time);
    margin.push_back(keyframe.support_margin);
    low = std::min(low, keyframe.support_margin);
    high = std::max(high, keyframe.support_margin);
  }
  const double end = t.empty() ? 1.0 : std::max(t.front() + 0.1, t.back());
  constexpr double kTop = 46.0;
  constexpr double kHeight = 190.0;
  const SvgAxes axes({kLeft, kTop, kWidth - kLeft - 10.0, kHeight},
                     {t.empty() ? 0.0 : t.front(), end}, {low < 0.0 ? 1.1 * low : 0.0, 1.1 * high});
  std::string body = axes.axes("", "time, s", "margin, m");
  double free_from = 0.0;  // where the last phase name ends: names that would overlap are left out
  for (const Phase& phase : plan.phases) {
    const double x = axes.px(phase.start);
    body += "<path class=\"zero\" stroke-dasharray=\"2 3\" d=\"M" + fixed(x, 1) + "," +
            fixed(kTop, 1) + "v" + fixed(kHeight, 1) + "\"/>";
    if (x + 3 >= free_from) {
      body += svg_text(x + 3, kTop - 6, phase.name, "small soft");
      free_from = x + 3 + 6.2 * static_cast<double>(phase.name.size()) + 6;
    }
  }
  body += axes.level(0.0, "limit") + axes.curve(t, margin, "hold-line");
  return svg_document(kWidth, kTop + kHeight + 42.0, "Support margin over time", body);
}

std::string plot_contacts(const RunData& run) {
  constexpr double kTop = 42.0;
  constexpr double kRow = 22.0;
  constexpr double kNames = 30.0;
  const std::size_t rows = std::min<std::size_t>(run.model.contacts.size(), kMaxContacts);
  const double height = kRow * static_cast<double>(rows + 1);
  const double weight = std::max(1.0, run.model.total_mass * kGravity);
  const double left = kLeft + kNames;
  const SvgAxes axes({left, kTop, kWidth - left - 10.0, height}, time_range(run), {0.0, 1.0});
  std::string body = contact_legend(16.0) + axes.axes("", "", "");
  for (std::size_t i = 0; i < rows; ++i) {
    const double y = kTop + kRow * static_cast<double>(i);
    body += svg_text(left - 8, y + 15, run.model.contacts[i].name, "end");
    body += force_row(
        run, axes, y + 2, 9, [i](const auto& f) { return f.force_obstacle[i]; }, weight, "hold");
    body += force_row(
        run, axes, y + 11, 9, [i](const auto& f) { return f.force_floor[i]; }, weight, "floor");
  }
  const double last = kTop + kRow * static_cast<double>(rows);
  body += svg_text(left - 8, last + 15, "others", "end");
  body += force_row(
      run, axes, last + 4, 14, [](const auto& f) { return f.force_forbidden + f.force_other; },
      weight, "bad");
  const double panel = kTop + height + 58.0;
  body += weight_panel(run, {left, panel, kWidth - left - 10.0, 150.0}, weight);
  return svg_document(kWidth, panel + 150.0 + 42.0, "Contacts over time", body);
}

}  // namespace clamber
