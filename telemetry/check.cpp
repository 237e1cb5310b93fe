#include "telemetry/check.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <utility>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

using Statistic = Check::Statistic;
using Quantity = Check::Quantity;
using Comparison = Check::Comparison;

template <typename Meaning, std::size_t N>
using Words = std::array<std::pair<std::string_view, Meaning>, N>;

constexpr Words<Statistic, 5> kStatistics{{{"max", Statistic::kMax},
                                           {"min", Statistic::kMin},
                                           {"mean", Statistic::kMean},
                                           {"rms", Statistic::kRms},
                                           {"last", Statistic::kLast}}};
constexpr Words<Quantity, 12> kQuantities{{{"tau", Quantity::kTorque},
                                           {"tau_cmd", Quantity::kCommand},
                                           {"margin", Quantity::kMargin},
                                           {"temperature", Quantity::kTemperature},
                                           {"age", Quantity::kAge},
                                           {"error", Quantity::kError},
                                           {"dq", Quantity::kSpeed},
                                           {"lateness", Quantity::kLateness},
                                           {"tick_time", Quantity::kTickTime},
                                           {"lost", Quantity::kLost},
                                           {"drops", Quantity::kDrops},
                                           {"fault", Quantity::kFault}}};
// Longer ones first: the first that fits is taken.
constexpr Words<Comparison, 5> kComparisons{{{"<=", Comparison::kLessEqual},
                                             {">=", Comparison::kGreaterEqual},
                                             {"==", Comparison::kEqual},
                                             {"<", Comparison::kLess},
                                             {">", Comparison::kGreater}}};

bool is_of_joints(Quantity quantity) { return quantity < Quantity::kLateness; }

template <typename Table>
std::string list(const Table& table) {
  std::string words;
  for (const auto& entry : table) words += (words.empty() ? "" : ", ") + std::string(entry.first);
  return words;
}

}  // namespace

/// Reads a check from left to right.
class CheckParser {
 public:
  explicit CheckParser(std::string_view text) : text_(text) {}

  void parse(Check& check) {
    check.statistic_ = word(kStatistics, "a statistic (" + list(kStatistics) + ")");
    expect('(');
    check.magnitude_ = accept('|');
    const std::size_t start = skip_spaces();
    check.quantity_ = word(kQuantities, "a quantity (" + list(kQuantities) + ")");
    if (accept('[')) {
      if (!is_of_joints(check.quantity_)) fail(start, "a quantity of joints before '['");
      check.joint_ = name("the name of a joint");
      expect(']');
    }
    if (check.magnitude_) expect('|');
    expect(')');
    check.comparison_ = comparison();
    check.bound_ = number();
    if (skip_spaces() != text_.size()) fail(at_, "the end");
  }

 private:
  std::size_t skip_spaces() {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])) != 0) ++at_;
    return at_;
  }
  bool accept(char wanted) {
    if (skip_spaces() >= text_.size() || text_[at_] != wanted) return false;
    ++at_;
    return true;
  }
  void expect(char wanted) {
    if (!accept(wanted)) fail(at_, std::string("'") + wanted + "'");
  }
  std::string name(const std::string& what) {
    const std::size_t start = skip_spaces();
    const auto part_of_name = [](char c) {
      return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
    };
    while (at_ < text_.size() && part_of_name(text_[at_])) ++at_;
    if (at_ == start) fail(start, what);
    return std::string(text_.substr(start, at_ - start));
  }
  template <typename Meaning, std::size_t N>
  Meaning word(const Words<Meaning, N>& words, const std::string& what) {
    const std::size_t start = skip_spaces();
    const std::string found = name(what);
    for (const auto& [text, meaning] : words)
      if (found == text) return meaning;
    fail(start, what);
  }
  Comparison comparison() {
    skip_spaces();
    for (const auto& [text, meaning] : kComparisons)
      if (text_.substr(at_).starts_with(text)) {
        at_ += text.size();
        return meaning;
      }
    fail(at_, "a comparison (" + list(kComparisons) + ")");
  }
  double number() {
    skip_spaces();
    double value = 0.0;
    const char* begin = text_.data() + at_;
    const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), value);
    if (error != std::errc() || !std::isfinite(value)) fail(at_, "a number");
    at_ += static_cast<std::size_t>(end - begin);
    return value;
  }
  [[noreturn]] void fail(std::size_t where, const std::string& expected) {
    const std::string rest(text_.substr(std::min(where, text_.size())));
    throw InputError("--check '" + std::string(text_) + "': column " + std::to_string(where + 1) +
                     ": expected " + expected + ", found " +
                     (rest.empty() ? "the end" : "'" + rest + "'"));
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

Check::Check(std::string_view text) : text_(text) { CheckParser(text_).parse(*this); }

void Check::describe(const std::vector<std::string>& joint_names) {
  names_ = joint_names;
  if (joint_.empty() || std::find(names_.begin(), names_.end(), joint_) != names_.end()) return;
  std::string known;
  for (const std::string& name : names_) known += (known.empty() ? "" : " ") + name;
  throw InputError("--check '" + text_ + "': the robot has no joint '" + joint_ + "', only " +
                   known);
}

void Check::add(const CheckSample& sample) {
  sums_.resize(is_of_joints(quantity_) ? sample.frame.joint_count : 1);
  for (std::size_t j = 0; j < sums_.size(); ++j) {
    const double raw = quantity(sample, j);
    const double value = magnitude_ ? std::abs(raw) : raw;
    Sums& sums = sums_[j];
    sums.max = sums.count == 0 ? value : std::max(sums.max, value);
    sums.min = sums.count == 0 ? value : std::min(sums.min, value);
    sums.sum += value;
    sums.squares += value * value;
    sums.last = value;
    ++sums.count;
  }
}

double Check::quantity(const CheckSample& sample, std::size_t joint) const {
  const TelemetryFrame& frame = sample.frame;
  switch (quantity_) {
    case Quantity::kTorque:
      return frame.tau_meas[joint];
    case Quantity::kCommand:
      return frame.tau_cmd[joint];
    case Quantity::kMargin: {
      const double limit = frame.tau_limit[joint];
      return limit > 0.0 ? 1.0 - std::abs(frame.tau_meas[joint]) / limit : 1.0;
    }
    case Quantity::kTemperature:
      return frame.temperature[joint];
    case Quantity::kAge:
      return frame.age[joint];
    case Quantity::kError:
      return frame.q_ref[joint] - frame.q[joint];
    case Quantity::kSpeed:
      return frame.dq[joint];
    case Quantity::kLateness:
      return sample.lateness;
    case Quantity::kTickTime:
      return sample.tick_time;
    case Quantity::kLost:
      return sample.lost;
    case Quantity::kDrops:
      return sample.drops;
    case Quantity::kFault:
      return frame.fault;
  }
  return 0.0;
}

double Check::statistic(const Sums& sums) const {
  if (std::isnan(sums.sum)) return sums.sum;
  const auto count = static_cast<double>(sums.count);
  switch (statistic_) {
    case Statistic::kMax:
      return sums.max;
    case Statistic::kMin:
      return sums.min;
    case Statistic::kMean:
      return sums.sum / count;
    case Statistic::kRms:
      return std::sqrt(sums.squares / count);
    case Statistic::kLast:
      return sums.last;
  }
  return 0.0;
}

bool Check::holds(double value) const {
  switch (comparison_) {
    case Comparison::kLess:
      return value < bound_;
    case Comparison::kLessEqual:
      return value <= bound_;
    case Comparison::kGreater:
      return value > bound_;
    case Comparison::kGreaterEqual:
      return value >= bound_;
    case Comparison::kEqual:
      return value == bound_;
  }
  return false;
}

double Check::excess(double value) const {
  if (std::isnan(value)) return INFINITY;
  if (comparison_ == Comparison::kEqual) return std::abs(value - bound_);
  const bool upper = comparison_ == Comparison::kLess || comparison_ == Comparison::kLessEqual;
  return upper ? value - bound_ : bound_ - value;
}

CheckResult Check::result() const {
  CheckResult worst;
  for (std::size_t j = 0; j < sums_.size(); ++j) {
    const std::string name = j < names_.size() ? names_[j] : "joint " + std::to_string(j);
    if (!joint_.empty() && name != joint_) continue;
    const double value = statistic(sums_[j]);
    if (worst.samples > 0 && excess(value) <= excess(worst.value)) continue;
    worst = {.passed = holds(value),
             .value = value,
             .joint = is_of_joints(quantity_) ? name : "",
             .samples = sums_[j].count};
  }
  return worst;
}

}  // namespace clamber
