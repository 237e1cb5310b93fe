#include "apps/motion_file.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <sstream>
#include <string_view>
#include <vector>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

constexpr std::string_view kFirstLine = "# clamber motion 1";
constexpr std::array<const char*, 7> kBaseColumns = {"base_x",  "base_y",  "base_z", "base_qw",
                                                     "base_qx", "base_qy", "base_qz"};

/// The shortest text that reads back to the same double.
void append_number(std::string& out, double x) {
  std::array<char, 32> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), x);
  out.append(digits.data(), end.ptr);
}

std::vector<std::string> split(const std::string& line, char separator) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, separator);) cells.push_back(cell);
  return cells;
}

class Reader {
 public:
  Reader(const std::string& text, std::string file, const RobotModel& model)
      : in_(text), file_(std::move(file)), model_(model) {}

  RobotMotion read() {
    if (!next_line() || line_ != kFirstLine)
      fail("expected '" + std::string(kFirstLine) + "' as the first line");
    while (next_line() && line_.starts_with('#')) read_remark();
    check_remarks();
    read_columns();
    while (next_line())
      if (!line_.empty()) read_frame();
    if (motion_.frames.empty()) fail("expected frames, found none");
    return motion_;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(file_ + ":" + std::to_string(number_) + ": " + what);
  }
  bool next_line() {
    ++number_;
    if (!std::getline(in_, line_)) return false;
    if (line_.ends_with('\r')) line_.pop_back();
    return true;
  }
  [[nodiscard]] double number(const std::string& cell) const {
    double value = 0.0;
    const char* end = cell.data() + cell.size();
    const auto [stop, error] = std::from_chars(cell.data(), end, value);
    if (error != std::errc() || stop != end || !std::isfinite(value))
      fail("expected a finite number, found '" + cell + "'");
    return value;
  }

  /// "# key: value"
  void read_remark() {
    const std::size_t colon = line_.find(": ");
    if (colon == std::string::npos) return;
    const std::string key = line_.substr(2, colon - 2);
    const std::string value = line_.substr(colon + 2);
    if (key == "recording") {
      motion_.recording = value;
    } else if (key == "synthetic") {
      if (value != "true" && value != "false") fail("synthetic: expected true or false");
      motion_.synthetic = value == "true";
    } else if (key == "rate_hz") {
      motion_.rate = number(value);
    } else if (key == "human_leg_length_m") {
      motion_.human_leg_length = number(value);
    } else if (key == "clamped") {
      const std::vector<std::string> words = split(value, ' ');
      if (words.size() != 3) fail("clamped: expected joint, worst excess in rad, share of frames");
      motion_.clamped.push_back({words[0], number(words[1]), number(words[2])});
    }
  }
  void check_remarks() const {
    if (motion_.recording.empty()) fail("expected '# recording: <name>' before the table");
    if (motion_.rate <= 0.0) fail("expected '# rate_hz: <number above 0>' before the table");
  }
  void read_columns() {
    const std::vector<std::string> names = split(line_, ',');
    columns_ = names.size();
    std::map<std::string, std::size_t> place;
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (!place.emplace(names[i], i).second) fail("column '" + names[i] + "' is there twice");
    }
    const auto take = [&](const std::string& name) {
      const auto found = place.find(name);
      if (found == place.end()) fail("column '" + name + "' is missing");
      const std::size_t column = found->second;
      place.erase(found);
      return column;
    };
    for (std::size_t i = 0; i < kBaseColumns.size(); ++i) base_[i] = take(kBaseColumns[i]);
    for (const Joint& joint : model_.joints) joints_.push_back(take(joint.name));
    if (!place.empty())
      fail("robot " + model_.name + " has no joint '" + place.begin()->first + "'");
  }
  void read_frame() {
    const std::vector<std::string> cells = split(line_, ',');
    if (cells.size() != columns_)
      fail("expected " + std::to_string(columns_) + " columns, found " +
           std::to_string(cells.size()));
    std::array<double, 7> base{};
    for (std::size_t i = 0; i < base.size(); ++i) base[i] = number(cells[base_[i]]);
    const Eigen::Quaterniond orientation(base[3], base[4], base[5], base[6]);
    if (std::abs(orientation.norm() - 1.0) > 1e-6) fail("base_q: expected a unit quaternion");
    Configuration x;
    x.X_WB.p = {base[0], base[1], base[2]};
    x.X_WB.R = orientation.normalized().toRotationMatrix();
    x.q.resize(model_.joint_count());
    for (std::size_t j = 0; j < joints_.size(); ++j)
      x.q[static_cast<Eigen::Index>(j)] = number(cells[joints_[j]]);
    motion_.frames.push_back(x);
  }

  std::istringstream in_;
  std::string file_;
  const RobotModel& model_;
  std::string line_;
  int number_ = 0;
  std::size_t columns_ = 0;
  std::array<std::size_t, 7> base_{};
  std::vector<std::size_t> joints_;
  RobotMotion motion_;
};

void append_remark(std::string& out, const char* key, double value) {
  out += std::string("# ") + key + ": ";
  append_number(out, value);
  out += '\n';
}

}  // namespace

std::string format_motion(const RobotMotion& motion, const RobotModel& model) {
  std::string out = std::string(kFirstLine) + "\n# robot: " + model.name +
                    "\n# recording: " + motion.recording +
                    "\n# synthetic: " + (motion.synthetic ? "true" : "false") + '\n';
  append_remark(out, "rate_hz", motion.rate);
  append_remark(out, "human_leg_length_m", motion.human_leg_length);
  for (const RobotMotion::ClampReport& clamp : motion.clamped) {
    out += "# clamped: " + clamp.joint + ' ';
    append_number(out, clamp.worst);
    out += ' ';
    append_number(out, clamp.share);
    out += '\n';
  }
  for (const char* name : kBaseColumns) out += std::string(name) + ',';
  for (const Joint& joint : model.joints) out += joint.name + ',';
  out.back() = '\n';
  for (const Configuration& x : motion.frames) {
    Eigen::Quaterniond orientation(x.X_WB.R);
    if (orientation.w() < 0.0) orientation.coeffs() = -orientation.coeffs();
    for (const double value : {x.X_WB.p.x(), x.X_WB.p.y(), x.X_WB.p.z(), orientation.w(),
                               orientation.x(), orientation.y(), orientation.z()}) {
      append_number(out, value);
      out += ',';
    }
    for (const double angle : x.q) {
      append_number(out, angle);
      out += ',';
    }
    out.back() = '\n';
  }
  return out;
}

RobotMotion parse_motion(const std::string& text, const std::string& file,
                         const RobotModel& model) {
  return Reader(text, file, model).read();
}

bool is_motion(const std::string& text) { return text.starts_with(kFirstLine); }

}  // namespace clamber
