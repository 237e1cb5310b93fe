#include "apps/sweep_grid.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>
#include <system_error>

#include "robot_model/loader.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {
namespace {

constexpr double kGrid = 1e4;              // 1 / 0.0001: values closer than that are one value
constexpr double kMostValue = 1e3;         // m, and more than any friction or share
constexpr std::size_t kMostValues = 1000;  // per axis
constexpr std::size_t kMostCases = 100000;

double rounded(double value, double grid) { return std::round(value * grid) / grid; }

std::string shortest(double value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value);
  return {text, end.ptr};
}

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == separator)
      parts.emplace_back();
    else
      parts.back() += c;
  }
  return parts;
}

std::optional<double> number(const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(std::abs(value) <= kMostValue))
    return {};
  return value;
}

/// One number, or the numbers of low:high:step. Empty: it is neither.
std::vector<double> values_of(const std::string& part) {
  std::vector<double> numbers;
  for (const std::string& text : split(part, ':')) {
    const std::optional<double> value = number(text);
    if (!value) return {};
    numbers.push_back(*value);
  }
  if (numbers.size() == 1) return numbers;
  if (numbers.size() != 3 || numbers[2] <= 0.0 || numbers[1] < numbers[0]) return {};
  const double steps = std::floor((numbers[1] - numbers[0]) / numbers[2] + 1e-6);
  if (steps >= static_cast<double>(kMostValues)) return {};
  std::vector<double> values;
  for (std::size_t k = 0; k <= static_cast<std::size_t>(steps); ++k)
    values.push_back(numbers[0] + static_cast<double>(k) * numbers[2]);
  return values;
}

std::vector<std::optional<double>> or_as_it_is(const std::vector<double>& values) {
  if (values.empty()) return {std::nullopt};
  return {values.begin(), values.end()};
}

std::string written(double value) { return shortest(rounded(value, 1e9)); }

}  // namespace

std::string SweepPoint::key() const {
  std::string text;
  text.append("h").append(shortest(height)).append("_f").append(shortest(friction));
  if (depth) text.append("_d").append(shortest(*depth));
  if (distance) text.append("_s").append(shortest(*distance));
  if (ballast != 0.0) text.append("_b").append(shortest(ballast));
  return text;
}

std::vector<SweepPoint> SweepGrid::points() const {
  std::vector<SweepPoint> points;
  for (const double ballast : ballasts)
    for (const std::optional<double>& depth : or_as_it_is(depths))
      for (const std::optional<double>& distance : or_as_it_is(distances))
        for (const double friction : frictions)
          for (const double height : heights) {
            if (points.size() == kMostCases)
              throw InputError("the sweep has more than " + std::to_string(kMostCases) + " cases");
            points.push_back({height, friction, depth, distance, ballast});
          }
  return points;
}

std::vector<double> parse_axis(const std::string& text, const std::string& option,
                               SweepRange range) {
  std::vector<double> values;
  for (const std::string& part : split(text, ',')) {
    const std::vector<double> more = values_of(part);
    if (more.empty())
      throw InputError(option + ": '" + part +
                       "': expected a number or low:high:step, separated by commas");
    for (const double exact : more) {
      const double value = rounded(exact, kGrid);
      if (value < 0.0 || (range == SweepRange::kPositive && value == 0.0))
        throw InputError(option + ": '" + part + "': expected numbers " +
                         (range == SweepRange::kPositive ? "> 0" : ">= 0"));
      values.push_back(value);
    }
  }
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  if (values.size() > kMostValues)
    throw InputError(option + ": more than " + std::to_string(kMostValues) + " values");
  return values;
}

Shard parse_shard(const std::string& text) {
  Shard shard;
  const std::vector<std::string> parts = split(text, '/');
  const auto read = [](const std::string& part, std::size_t& value) {
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
    return error == std::errc() && end == part.data() + part.size();
  };
  if (parts.size() != 2 || !read(parts[0], shard.index) || !read(parts[1], shard.count) ||
      shard.index >= shard.count)
    throw InputError("--shard: '" + text + "': expected i/n with 0 <= i < n");
  return shard;
}

std::string scenario_text(const std::string& base, const std::string& file,
                          const SweepPoint& point) {
  const Scenario scenario = parse_scenario(base, file);
  const ObstacleBox& box = scenario.obstacles.front();
  const Eigen::Vector2d inwards(std::cos(box.yaw), std::sin(box.yaw));
  const Eigen::Vector2d front = box.center.head<2>() - box.half_extents.x() * inwards;
  YAML::Node root = YAML::Load(base);
  root["name"] = scenario.name + "@" + point.key();
  root["friction"] = written(point.friction);
  YAML::Node obstacle = root["obstacles"][0];
  obstacle["size"][2] = written(point.height);
  if (point.depth) {
    const Eigen::Vector2d center = front + 0.5 * *point.depth * inwards;
    obstacle["size"][0] = written(*point.depth);
    for (int i = 0; i < 2; ++i) obstacle["position"][i] = written(center[i]);
  }
  if (point.distance) {
    const Eigen::Vector2d start = scenario.start_position.head<2>();
    const Eigen::Vector2d moved = start + (inwards.dot(front - start) - *point.distance) * inwards;
    for (int i = 0; i < 2; ++i) root["start"]["position"][i] = written(moved[i]);
  }
  std::ostringstream text;
  text << root << '\n';
  return text.str();
}

}  // namespace clamber
