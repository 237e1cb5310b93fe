#include "planner_offline/recording/position_csv.hpp"

#include <cmath>
#include <optional>

#include "planner_offline/recording/parse_number.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

/// Rows may deviate this much from even spacing, as a share of the spacing (rounding of t).
constexpr double kUneven = 0.1;

std::vector<std::string_view> split_commas(std::string_view line) {
  std::vector<std::string_view> cells;
  for (;;) {
    const auto comma = line.find(',');
    cells.push_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

class CsvReader {
 public:
  CsvReader(std::string_view bytes, const std::string& source) : rest_(bytes) {
    motion_.source = source;
    motion_.format = "positions (csv)";
  }

  HumanMotion read() {
    read_columns();
    while (!rest_.empty()) {
      const auto line = take_line();
      if (!trimmed(line).empty() && !is_comment(line)) read_row(line);
    }
    set_rate();
    return std::move(motion_);
  }

 private:
  struct Column {
    std::size_t point = 0;
    Eigen::Index axis = -1;  ///< -1: not a position
  };

  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(motion_.source + ":" + std::to_string(line_) + ": " + what);
  }

  std::string_view take_line() {
    ++line_;
    return next_line(rest_);
  }

  bool is_comment(std::string_view line) {
    if (!trimmed(line).starts_with('#')) return false;
    if (line.find("SYNTHETIC") != std::string_view::npos) motion_.synthetic = true;
    return true;
  }

  void read_columns() {
    std::string_view header;
    while (!rest_.empty() && header.empty()) {
      const auto line = take_line();
      if (!is_comment(line)) header = trimmed(line);
    }
    for (const auto name : split_commas(header)) add_column(name);
    if (!time_column_) fail("no column \"t\": expected the time in seconds");
    for (std::size_t p = 0; p < axes_seen_.size(); ++p) {
      if (axes_seen_[p] != 7U) {
        fail("joint \"" + motion_.points[p] + "\" lacks one of its columns _x, _y, _z");
      }
    }
    if (motion_.points.empty()) fail("no joint columns: expected <joint>_x, <joint>_y, <joint>_z");
  }

  void add_column(std::string_view name) {
    Column column;
    if (name == "t") {
      if (time_column_) fail("column \"t\" appears twice");
      time_column_ = columns_.size();
    } else if (name.size() > 2 && name[name.size() - 2] == '_' && name.back() >= 'x' &&
               name.back() <= 'z') {
      const auto label = name.substr(0, name.size() - 2);
      const auto known = motion_.find_point(label);
      if (!known) {
        motion_.points.emplace_back(label);
        axes_seen_.push_back(0);
      }
      column.point = known.value_or(motion_.points.size() - 1);
      column.axis = name.back() - 'x';
      const unsigned bit = 1U << static_cast<unsigned>(column.axis);
      if ((axes_seen_[column.point] & bit) != 0U) {
        fail("column \"" + std::string(name) + "\" appears twice");
      }
      axes_seen_[column.point] |= bit;
    }
    columns_.push_back(column);
  }

  void read_row(std::string_view line) {
    const auto cells = split_commas(line);
    if (cells.size() != columns_.size()) {
      fail(std::to_string(cells.size()) + " values: expected " + std::to_string(columns_.size()));
    }
    HumanMotion::Frame frame;
    frame.point.assign(motion_.points.size(), Eigen::Vector3d::Zero());
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const bool is_time = i == time_column_;
      if (!is_time && columns_[i].axis < 0) continue;
      const auto value = parse_number(cells[i]);
      if (!value || std::abs(*value) > 1e6) {
        fail("value " + std::to_string(i + 1) + " \"" + std::string(cells[i]) +
             "\": expected a finite number");
      }
      if (is_time) {
        times_.push_back(*value);
      } else {
        frame.point[columns_[i].point][columns_[i].axis] = *value;
      }
    }
    motion_.frames.push_back(std::move(frame));
  }

  void set_rate() {
    if (times_.size() < 2) fail("fewer than two rows");
    const double span = times_.back() - times_.front();
    const double step = span / static_cast<double>(times_.size() - 1);
    if (!(step > 1e-5) || step > 10.0) fail("column t: expected times in seconds that increase");
    for (std::size_t i = 0; i < times_.size(); ++i) {
      const double even = times_.front() + static_cast<double>(i) * step;
      // One further unit in the last printed digit of a file that rounds t to milliseconds.
      if (std::abs(times_[i] - even) > kUneven * step + 1e-3) {
        fail("column t: row " + std::to_string(i + 1) + " is not evenly spaced");
      }
    }
    motion_.rate = 1.0 / step;
    motion_.start_time = times_.front();
  }

  std::string_view rest_;
  std::size_t line_ = 0;
  std::vector<Column> columns_;
  std::optional<std::size_t> time_column_;
  std::vector<unsigned> axes_seen_;
  std::vector<double> times_;
  HumanMotion motion_;
};

}  // namespace

HumanMotion parse_csv(std::string_view bytes, const std::string& source) {
  return CsvReader(bytes, source).read();
}

}  // namespace clamber
