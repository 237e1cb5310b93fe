#include "bench/robustness/tables.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "report/markup.hpp"
#include "report/svg_plot.hpp"

namespace clamber {
namespace {

using Json = nlohmann::ordered_json;

/// A number of a trial's perturbation, and the borders between its bins as they are shown.
struct Parameter {
  const char* name;
  const char* unit;
  std::vector<double> borders;
  int digits;
  std::function<double(const Json&)> value;
};

std::vector<Parameter> parameters() {
  const auto scaled = [](const char* key, double scale) {
    return [key, scale](const Json& p) { return scale * p.at(key).get<double>(); };
  };
  return {{"friction", "", {0.5, 0.6, 0.7, 0.8, 0.9, 1.0}, 1, scaled("friction", 1.0)},
          {"obstacle height", "mm", {-10, -5, 0, 5, 10}, 0, scaled("height_m", 1e3)},
          {"start forward", "mm", {-20, -10, 0, 10, 20}, 0, scaled("start_x_m", 1e3)},
          {"start to the left", "mm", {-20, -10, 0, 10, 20}, 0, scaled("start_y_m", 1e3)},
          {"start turned left", "deg", {-2, -1, 0, 1, 2}, 0, scaled("start_yaw_rad", 180.0 / M_PI)},
          {"delay", "ms", {0, 0.5, 1, 1.5, 2}, 1, scaled("delay_s", 1e3)},
          {"encoder step", "urad", {0, 50, 100}, 0, scaled("encoder_resolution_rad", 1e6)}};
}

void count(Breakdown::Bin& bin, const Json& trial) {
  ++bin.trials;
  bin.successes += trial.at("success").get<bool>() ? 1 : 0;
}

Breakdown by_number(const Parameter& parameter, const std::vector<Json>& trials) {
  Breakdown out{parameter.name + std::string(*parameter.unit != 0 ? ", " : "") + parameter.unit,
                {}};
  const std::vector<double>& borders = parameter.borders;
  for (std::size_t i = 0; i + 1 < borders.size(); ++i)
    out.bins.push_back(
        {fixed(borders[i], parameter.digits) + " to " + fixed(borders[i + 1], parameter.digits), 0,
         0});
  for (const Json& trial : trials) {
    const double x = parameter.value(trial.at("perturbation"));
    const auto above = std::upper_bound(borders.begin() + 1, borders.end() - 1, x);
    count(out.bins[static_cast<std::size_t>(above - borders.begin() - 1)], trial);
  }
  return out;
}

Breakdown by_label(const char* name, const std::vector<Json>& trials,
                   const std::function<std::string(const Json&)>& label) {
  std::map<std::string, Breakdown::Bin> bins;
  for (const Json& trial : trials) {
    const std::string key = label(trial.at("perturbation"));
    bins[key].label = key;
    count(bins[key], trial);
  }
  Breakdown out{name, {}};
  for (const auto& [key, bin] : bins) out.bins.push_back(bin);
  return out;
}

std::size_t successes(const std::vector<Json>& trials) {
  return static_cast<std::size_t>(std::count_if(
      trials.begin(), trials.end(), [](const Json& t) { return t.at("success").get<bool>(); }));
}

std::string percent(double share) { return fixed(100.0 * share, 1); }

std::string rate(std::size_t good, std::size_t all) {
  const Interval i = wilson(good, all);
  return percent(static_cast<double>(good) / static_cast<double>(std::max<std::size_t>(all, 1))) +
         " (" + percent(i.low) + " to " + percent(i.high) + ")";
}

/// A share of the sorted values lies below.
double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

std::vector<double> column(const std::vector<Json>& trials, const char* key, bool of_successes) {
  std::vector<double> out;
  for (const Json& t : trials)
    if (!of_successes || t.at("success").get<bool>()) out.push_back(t.at(key).get<double>());
  return out;
}

std::string story(const Json& trial) {
  std::string out;
  for (const Json& event : trial.at("events")) {
    if (!out.empty()) out += "; ";
    out += fixed(event.at("time").get<double>(), 1) + " s (" +
           event.at("phase").get<std::string>() + ") " + event.at("what").get<std::string>();
    if (out.size() > 260) break;
  }
  return out;
}

std::string conditions(const Json& p) {
  return "mu " + fixed(p.at("friction").get<double>(), 2) + ", height " +
         fixed(1e3 * p.at("height_m").get<double>(), 1) + ", start " +
         fixed(1e3 * p.at("start_x_m").get<double>(), 0) + " " +
         fixed(1e3 * p.at("start_y_m").get<double>(), 0) + " mm " +
         fixed(p.at("start_yaw_rad").get<double>() * 180.0 / M_PI, 1) + " deg, " +
         (p.at("springs").get<bool>() ? "springs" : "rigid") + ", " +
         fixed(1e3 * p.at("step_s").get<double>(), 1) + " ms " + p.at("stepper").get<std::string>();
}

std::string failures_table(const std::vector<Json>& trials) {
  std::string out =
      "| seed | conditions | what went wrong, in order | in the end |\n|---|---|---|---|\n";
  for (const Json& trial : trials) {
    if (trial.at("success").get<bool>()) continue;
    out += "| " + std::to_string(trial.at("seed").get<std::uint64_t>()) + " | " +
           conditions(trial.at("perturbation")) + " | " + story(trial) + " | " +
           trial.at("failure").get<std::string>() + " |\n";
  }
  return out;
}

}  // namespace

Interval wilson(std::size_t good, std::size_t all) {
  if (all == 0) return {};
  constexpr double z = 1.959964;
  const double n = static_cast<double>(all), p = static_cast<double>(good) / n;
  const double middle = p + z * z / (2.0 * n);
  const double half = z * std::sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n));
  const double scale = 1.0 + z * z / n;
  return {std::max(0.0, (middle - half) / scale), std::min(1.0, (middle + half) / scale)};
}

std::vector<Breakdown> break_down(const std::vector<Json>& trials) {
  std::vector<Breakdown> out;
  for (const Parameter& parameter : parameters()) out.push_back(by_number(parameter, trials));
  out.push_back(by_label("springs", trials, [](const Json& p) {
    return std::string(p.at("springs").get<bool>() ? "on" : "off");
  }));
  out.push_back(by_label("simulator's step, ms", trials, [](const Json& p) {
    return fixed(1e3 * p.at("step_s").get<double>(), 1);
  }));
  out.push_back(by_label("stepper", trials, [](const Json& p) {
    return std::string(p.at("stepper") == "exact" ? "dWorldStep" : "dWorldQuickStep");
  }));
  return out;
}

std::string robustness_markdown(const std::vector<Json>& trials, const std::string& command) {
  const std::size_t good = successes(trials);
  std::string out = "`" + command + "`\n\n";
  out += "**" + std::to_string(good) + " of " + std::to_string(trials.size()) +
         " climbs: " + rate(good, trials.size()) + " %**, in brackets Wilson's 95 % interval.\n\n";
  out += "| of the climbs that succeed | median | 99 of 100 below | most |\n|---|---|---|---|\n";
  const auto row = [&](const char* name, const char* key, double scale, int digits) {
    const std::vector<double> values = column(trials, key, true);
    out += std::string("| ") + name;
    for (const double share : {0.5, 0.99, 1.0})
      out += " | " + fixed(scale * quantile(values, share), digits);
    out += " |\n";
  };
  row("peak torque, N m", "peak_torque_nm", 1.0, 1);
  row("base from the plan, mm", "farthest_m", 1e3, 0);
  row("base from the plan, deg", "most_tilted_deg", 1.0, 1);
  out += "\n| parameter | range | climbs | % succeed |\n|---|---|---|---|\n";
  for (const Breakdown& parameter : break_down(trials))
    for (const Breakdown::Bin& bin : parameter.bins)
      out += "| " + parameter.parameter + " | " + bin.label + " | " + std::to_string(bin.trials) +
             " | " + rate(bin.successes, bin.trials) + " |\n";
  if (good < trials.size()) out += "\n" + failures_table(trials);
  return out;
}

Json robustness_json(const std::vector<Json>& trials) {
  const std::size_t good = successes(trials);
  const Interval interval = wilson(good, trials.size());
  Json by = Json::array();
  for (const Breakdown& parameter : break_down(trials))
    for (const Breakdown::Bin& bin : parameter.bins)
      by.push_back({{"parameter", parameter.parameter},
                    {"range", bin.label},
                    {"climbs", bin.trials},
                    {"successes", bin.successes}});
  Json failures = Json::array();
  for (const Json& trial : trials)
    if (!trial.at("success").get<bool>()) failures.push_back(trial);
  return {{"climbs", trials.size()},      {"successes", good}, {"wilson_low", interval.low},
          {"wilson_high", interval.high}, {"by", by},          {"failures", failures}};
}

std::string robustness_svg(const std::vector<Json>& trials) {
  constexpr double kLeft = 150, kRow = 20, kTop = 46, kWidth = 460;
  // From here to 100 %: the interesting end, wider when something fails there.
  double least = 0.9;
  const std::vector<Breakdown> all = break_down(trials);
  for (const Breakdown& parameter : all)
    for (const Breakdown::Bin& bin : parameter.bins)
      if (bin.trials > 0) least = std::min(least, wilson(bin.successes, bin.trials).low);
  least = std::floor(10.0 * least) / 10.0;
  const auto px = [&](double share) {
    return kLeft + 110 + kWidth * (share - least) / (1 - least);
  };
  std::string body;
  double y = kTop;
  for (const Breakdown& parameter : all) {
    body += svg_text(kLeft - 6, y + 14, parameter.parameter, "end title");
    for (const Breakdown::Bin& bin : parameter.bins) {
      const Interval i = wilson(bin.successes, bin.trials);
      const double share =
          bin.trials == 0 ? 0.0
                          : static_cast<double>(bin.successes) / static_cast<double>(bin.trials);
      body += svg_text(kLeft + 100, y + 14, bin.label, "end small soft");
      if (bin.trials > 0) {
        body += "<g opacity=\"0.35\">" +
                svg_rect(px(i.low), y + 5, px(i.high) - px(i.low), kRow - 10, "b0") + "</g>";
        body += svg_rect(px(share) - 2, y + 2, 4, kRow - 4, "b0");
      }
      body += svg_text(px(1.0) + 10, y + 14,
                       std::to_string(bin.successes) + " of " + std::to_string(bin.trials),
                       "small soft");
      y += kRow;
    }
    y += 8;
  }
  for (const double share : round_ticks({least, 1.0}, 5))
    body += svg_text(px(share), y + 12, percent(share) + " %", "mid small soft");
  body += svg_rect(px(least), kTop - 4, px(1.0) - px(least), y - kTop + 2, "frame");
  body += svg_text(kLeft + 110, 24, "Climbs that succeed, bars: 95 % interval", "title");
  return svg_document(kLeft + 110 + kWidth + 110, y + 30, "Success of perturbed climbs", body);
}

}  // namespace clamber
