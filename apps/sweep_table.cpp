#include "apps/sweep_table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <system_error>
#include <tuple>

#include "apps/options.hpp"
#include "report/markup.hpp"
#include "report/svg_plot.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using Pointer = Json::json_pointer;

constexpr std::array<const char*, 5> kParameters = {"ballast", "depth_m", "distance_m", "friction",
                                                    "height_m"};

/// NaN where the record does not have it: the case ended before.
double number(const Json& json, const std::string& path) {
  const Pointer at(path);
  if (!json.contains(at) || !json.at(at).is_number())
    return std::numeric_limits<double>::quiet_NaN();
  return json.at(at).get<double>();
}

std::string word(const Json& json, const std::string& path) {
  const Pointer at(path);
  return json.contains(at) && json.at(at).is_string() ? json.at(at).get<std::string>() : "";
}

std::array<double, 5> parameters(const Json& record) {
  std::array<double, 5> values{};
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = record.at(kParameters[i]);
  return values;
}

bool succeeded(const SweepCase& c) { return c.record.at("success").get<bool>(); }

/// The simulated climb's where there was one, else the plan's.
double peak_torque(const SweepCase& c) {
  const double run = number(c.record, "/run/peak_torque_nm");
  return std::isnan(run) ? number(c.record, "/plan/peak_torque_nm") : run;
}
double support_margin(const SweepCase& c) {
  return 1e3 * number(c.record, "/certificate/worst/support_margin/with_gap");
}
/// Playback excluded: cases share it.
double planning_time(const SweepCase& c) {
  const double certificate = number(c.times, "/certificate_s");
  return number(c.times, "/planning_s") + (std::isnan(certificate) ? 0.0 : certificate);
}

Json parse_line(const fs::path& file) {
  Json json = Json::parse(read_file(file), nullptr, false);
  if (!json.is_object()) throw InputError(file.string() + ": not the record of a case");
  return json;
}

SweepCase load_case(const fs::path& file) {
  SweepCase found{.record = parse_line(file), .times = nullptr};
  try {
    static_cast<void>(parameters(found.record));
    static_cast<void>(succeeded(found));
    for (const char* key : {"key", "inputs", "version", "program", "reason"})
      static_cast<void>(found.record.at(key).get_ref<const std::string&>());
  } catch (const Json::exception& error) {
    throw InputError(file.string() + ": not the record of a case: " + error.what());
  }
  const fs::path times = file.parent_path().parent_path() / "times" / file.filename();
  std::error_code error;
  if (fs::exists(times, error)) found.times = parse_line(times);
  return found;
}

/// Adds a case to those seen, or refuses it.
void collect(SweepCase found, const fs::path& file, std::map<std::string, SweepCase>& cases) {
  if (!cases.empty())
    for (const char* key : {"version", "inputs"})
      if (found.record.at(key) != cases.begin()->second.record.at(key))
        throw InputError(file.string() + ": made from other inputs or by another version than " +
                         cases.begin()->first);
  const std::string key = found.record.at("key");
  const auto [at, added] = cases.emplace(key, found);
  if (!added && at->second.record != found.record)
    throw InputError(file.string() + ": another folder holds the same case with other results");
}

std::vector<SweepCase> sorted(const std::map<std::string, SweepCase>& cases) {
  std::vector<SweepCase> out;
  out.reserve(cases.size());
  for (const auto& [key, found] : cases) out.push_back(found);
  std::sort(out.begin(), out.end(), [](const SweepCase& a, const SweepCase& b) {
    return parameters(a.record) < parameters(b.record);
  });
  return out;
}

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c == '\n' ? ' ' : c;
  }
  return out + '"';
}

/// As JSON writes it: the shortest that reads back as the same number. Empty: not there.
std::string exact(const Json& json, const std::string& path) {
  return std::isfinite(number(json, path)) ? json.at(Pointer(path)).dump() : "";
}

bool varies(const std::vector<SweepCase>& cases, const char* parameter) {
  return std::any_of(cases.begin(), cases.end(), [&](const SweepCase& c) {
    return c.record.at(parameter) != cases.front().record.at(parameter);
  });
}

std::string cell_text(std::string text) {
  for (std::size_t at = 0; (at = text.find('|', at)) != std::string::npos; at += 2)
    text.insert(at, 1, '\\');
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

// The picture --------------------------------------------------------------------------------

struct Panel {
  const char* title;
  std::function<double(const SweepCase&)> value;
  int digits;
  bool low_is_good;
};

const std::array<Panel, 4>& panels() {
  static const std::array<Panel, 4> all = {
      Panel{"success", [](const SweepCase& c) { return succeeded(c) ? 1.0 : 0.0; }, 0, false},
      Panel{"peak torque (N m)", peak_torque, 1, true},
      Panel{"worst support margin (mm)", support_margin, 1, false},
      Panel{"planning time (s)", planning_time, 1, true}};
  return all;
}

constexpr double kCellWidth = 44.0, kCellHeight = 26.0, kLeft = 58.0, kTop = 64.0, kGap = 26.0,
                 kBelow = 44.0;  // px

struct Extent {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  [[nodiscard]] double share(double value) const {
    return high > low ? (value - low) / (high - low) : 0.5;
  }
};

Extent extent_of(const std::vector<SweepCase>& cases, const Panel& panel) {
  Extent extent;
  for (const SweepCase& c : cases) {
    const double value = panel.value(c);
    if (!std::isfinite(value)) continue;
    extent.low = std::min(extent.low, value);
    extent.high = std::max(extent.high, value);
  }
  // Else values that are all but equal would differ as much in colour as any.
  const double widen =
      0.5 * std::max(0.0, 0.2 * std::abs(extent.high) - (extent.high - extent.low));
  return {extent.low - widen, extent.high + widen};
}

std::string cell(double left, double top, const Panel& panel, const SweepCase& c,
                 const Extent& extent) {
  const double value = panel.value(c);
  const bool verdict = panel.digits == 0;
  std::string css = "soft", text = "-";
  double opacity = 0.08;
  if (verdict) {
    css = succeeded(c) ? "hold" : "bad";
    text = succeeded(c) ? "yes" : "no";
    opacity = 0.55;
  } else if (std::isfinite(value)) {
    css = "b0";
    text = fixed(value, panel.digits);
    const double share = extent.share(value);
    opacity = 0.12 + 0.55 * (panel.low_is_good ? share : 1.0 - share);
  }
  const std::string reason = c.record.at("reason");
  std::string out = "<g>";
  out +=
      "<title>" +
      escape_markup(c.record.at("key").get<std::string>() + (reason.empty() ? "" : ": " + reason)) +
      "</title>";
  out += "<g opacity=\"" + fixed(opacity, 2) + "\">" +
         svg_rect(left + 1, top + 1, kCellWidth - 2, kCellHeight - 2, css) + "</g>";
  out += svg_text(left + 0.5 * kCellWidth, top + 0.5 * kCellHeight + 4, text, "mid small");
  return out + "</g>";
}

using Group = std::array<double, 3>;  // ballast, depth, distance

std::string group_title(const Group& group) {
  return "depth " + fixed(group[1], 3) + " m, start " + fixed(group[2], 3) + " m, ballast " +
         fixed(group[0], 2);
}

/// Heights from left to right, frictions from bottom to top.
struct Axes {
  std::vector<double> heights, frictions;

  explicit Axes(const std::vector<SweepCase>& cases) {
    std::set<double> all_heights, all_frictions;
    for (const SweepCase& c : cases) {
      all_heights.insert(c.record.at("height_m").get<double>());
      all_frictions.insert(c.record.at("friction").get<double>());
    }
    heights.assign(all_heights.begin(), all_heights.end());
    frictions.assign(all_frictions.rbegin(), all_frictions.rend());
  }
  [[nodiscard]] double width() const { return kCellWidth * static_cast<double>(heights.size()); }
  [[nodiscard]] double height() const {
    return kCellHeight * static_cast<double>(frictions.size());
  }
};

std::string draw_panel(double left, double top, const Panel& panel, const Axes& axes,
                       const std::vector<const SweepCase*>& cases, const Extent& extent) {
  std::string out = svg_text(left, top - 9, panel.title, "title");
  for (std::size_t i = 0; i < axes.heights.size(); ++i)
    out += svg_text(left + kCellWidth * (static_cast<double>(i) + 0.5), top + axes.height() + 15,
                    fixed(axes.heights[i], 3), "mid small soft");
  for (std::size_t k = 0; k < axes.frictions.size(); ++k)
    out += svg_text(left - 6, top + kCellHeight * (static_cast<double>(k) + 0.5) + 4,
                    fixed(axes.frictions[k], 2), "end small soft");
  for (const SweepCase* c : cases) {
    const auto column = std::find(axes.heights.begin(), axes.heights.end(),
                                  c->record.at("height_m").get<double>()) -
                        axes.heights.begin();
    const auto row = std::find(axes.frictions.begin(), axes.frictions.end(),
                               c->record.at("friction").get<double>()) -
                     axes.frictions.begin();
    out += cell(left + kCellWidth * static_cast<double>(column),
                top + kCellHeight * static_cast<double>(row), panel, *c, extent);
  }
  out += svg_rect(left, top, axes.width(), axes.height(), "frame");
  return out + svg_text(left + 0.5 * axes.width(), top + axes.height() + 33,
                        "height (m); rows: friction", "mid soft");
}

}  // namespace

std::vector<SweepCase> load_cases(const std::vector<fs::path>& folders) {
  std::map<std::string, SweepCase> cases;
  for (const fs::path& folder : folders) {
    std::error_code error;
    std::set<fs::path> files;  // in an order that the file system does not choose
    for (const fs::directory_entry& entry : fs::directory_iterator(folder / "cases", error))
      if (entry.path().extension() == ".json") files.insert(entry.path());
    if (files.empty())
      throw InputError(folder.string() + ": holds no cases, expected the folder of a sweep");
    for (const fs::path& file : files) collect(load_case(file), file, cases);
  }
  return sorted(cases);
}

std::vector<SweepCase> load_cases(const fs::path& folder, const std::vector<SweepPoint>& points) {
  std::map<std::string, SweepCase> cases;
  for (const SweepPoint& point : points) {
    const fs::path file = folder / "cases" / (point.key() + ".json");
    collect(load_case(file), file, cases);
  }
  return sorted(cases);
}

std::string sweep_csv(const std::vector<SweepCase>& cases) {
  std::string out =
      "height_m,friction,depth_m,distance_m,ballast,ballast_kg,success,stage,keyframes,duration_s,"
      "plan_peak_torque_nm,plan_peak_joint,climb_peak_torque_nm,climb_peak_joint,"
      "support_margin_m,friction_slack_n,torque_slack_nm,weight_on_obstacle,reason\n";
  for (const SweepCase& c : cases) {
    const Json& r = c.record;
    const auto figure = [&](const std::string& path) { return exact(r, path) + ','; };
    const auto worst = [&](const std::string& name) {
      return figure("/certificate/worst/" + name + "/with_gap");
    };
    for (const char* name :
         {"/height_m", "/friction", "/depth_m", "/distance_m", "/ballast", "/ballast_kg"})
      out += figure(name);
    out += std::string(succeeded(c) ? "yes," : "no,") + word(r, "/stage") + ',';
    out += figure("/plan/keyframes") + figure("/plan/duration_s");
    out += figure("/plan/peak_torque_nm") + word(r, "/plan/peak_joint") + ',';
    out += figure("/run/peak_torque_nm") + word(r, "/run/peak_joint") + ',';
    out += worst("support_margin") + worst("friction_slack") + worst("torque_slack");
    out += figure("/run/weight_on_obstacle") + quoted(word(r, "/reason")) + '\n';
  }
  return out;
}

std::string sweep_markdown(const std::vector<SweepCase>& cases) {
  struct Column {
    const char* parameter;
    const char* title;
    int digits;
  };
  std::vector<Column> columns = {{"height_m", "height (m)", 3}, {"friction", "friction", 2}};
  for (const Column& column :
       {Column{"depth_m", "depth (m)", 3}, Column{"distance_m", "start (m)", 3},
        Column{"ballast", "ballast", 2}})
    if (varies(cases, column.parameter)) columns.push_back(column);
  std::string out = sweep_summary(cases) + "\n|", rule = "|";
  for (const Column& column : columns) {
    out += std::string(" ") + column.title + " |";
    rule += "---|";
  }
  out += " success | peak torque (N m) | joint | support margin (mm) | planning (s) | why not |\n";
  out += rule + "---|---|---|---|---|---|\n";
  for (const SweepCase& c : cases) {
    out += '|';
    for (const Column& column : columns)
      out += ' ' + fixed(c.record.at(column.parameter).get<double>(), column.digits) + " |";
    const std::string ran = word(c.record, "/run/peak_joint");
    const std::string stage = word(c.record, "/stage");
    out += std::string(succeeded(c) ? " yes" : " no") + " | " + fixed(peak_torque(c), 1) + " | " +
           (ran.empty() ? word(c.record, "/plan/peak_joint") : ran) + " | " +
           fixed(support_margin(c), 1) + " | " + fixed(planning_time(c), 1) + " | " +
           (stage.empty() ? "" : stage + ": ") + cell_text(word(c.record, "/reason")) + " |\n";
  }
  return out;
}

std::string sweep_picture(const std::vector<SweepCase>& cases) {
  std::map<Group, std::vector<const SweepCase*>> groups;
  for (const SweepCase& c : cases) {
    const std::array<double, 5> p = parameters(c.record);
    groups[{p[0], p[1], p[2]}].push_back(&c);
  }
  const Axes axes(cases);
  const double panel_width = std::max(axes.width(), 180.0) + kLeft + kGap;
  const double row_height = kTop + axes.height() + kBelow;
  std::string body;
  double top = 0.0;
  for (const auto& [group, members] : groups) {
    body += svg_text(kLeft, top + 22, group_title(group), "soft");
    double left = kLeft;
    for (const Panel& panel : panels()) {
      body += draw_panel(left, top + kTop, panel, axes, members, extent_of(cases, panel));
      left += panel_width;
    }
    top += row_height;
  }
  body += svg_text(kLeft, top + 8, "Darker is worse. Pale with a dash: the case ended before.",
                   "small soft");
  return svg_document(static_cast<double>(panels().size()) * panel_width, top + 20.0,
                      "Sweep over height and friction", body);
}

std::string sweep_summary(const std::vector<SweepCase>& cases) {
  std::size_t successes = 0, grid = 1;
  std::set<std::string> programs;
  for (const SweepCase& c : cases) {
    successes += succeeded(c) ? 1 : 0;
    programs.insert(c.record.at("program").get<std::string>());
  }
  for (const char* parameter : kParameters) {
    std::set<double> values;
    for (const SweepCase& c : cases) values.insert(c.record.at(parameter).get<double>());
    grid *= values.size();
  }
  std::string out = std::to_string(successes) + " of " + std::to_string(cases.size()) +
                    (cases.front().record.value("plan_only", false)
                         ? " cases have a certified plan"
                         : " cases climb, as the simulator's judge sees it");
  if (grid > cases.size())
    out += "; " + std::to_string(grid - cases.size()) + " cases of the full grid are missing";
  if (programs.size() > 1)
    out += "; made by " + std::to_string(programs.size()) + " builds of the program";
  return out + ".\n";
}

void write_sweep_tables(const std::vector<SweepCase>& cases, const fs::path& folder) {
  write_text((folder / "table.csv").string(), sweep_csv(cases));
  write_text((folder / "table.md").string(), sweep_markdown(cases));
  write_text((folder / "sweep.svg").string(), sweep_picture(cases));
}

}  // namespace clamber
