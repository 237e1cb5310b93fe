#include "planner_offline/recording/acclaim.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "planner_offline/recording/parse_number.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kInch = 0.0254;  // m
constexpr std::size_t kMaxBones = 500;
/// Length of the mark that makes the root's own upward direction visible as a point, m.
constexpr double kSpineMark = 0.1;

/// Lines with a line number and without comments.
class LineReader {
 public:
  LineReader(std::string_view bytes, const std::string& source) : rest_(bytes), source_(source) {}

  /// The next line that is neither blank nor a comment; nothing at the end.
  std::optional<std::string_view> next() {
    while (!rest_.empty()) {
      ++line_;
      const auto line = trimmed(next_line(rest_));
      if (!line.empty() && !line.starts_with('#')) return line;
    }
    return std::nullopt;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(source_ + ":" + std::to_string(line_) + ": " + what);
  }

  double number(std::string_view& rest, const std::string& what) const {
    const auto value = parse_number(next_word(rest));
    if (!value || std::abs(*value) > 1e6) fail(what + ": expected a finite number");
    return *value;
  }

  Vector3d triple(std::string_view& rest, const std::string& what) const {
    Vector3d v;
    for (int i = 0; i < 3; ++i) v[i] = number(rest, what);
    return v;
  }

 private:
  std::string_view rest_;
  const std::string& source_;
  std::size_t line_ = 0;
};

Vector3d unit_axis(char axis) {
  return axis == 'x' ? Vector3d::UnitX() : axis == 'y' ? Vector3d::UnitY() : Vector3d::UnitZ();
}

/// Turns applied one after the other about fixed axes: "xyz" is Rz Ry Rx.
Matrix3d turns(const std::vector<char>& axes, const std::vector<double>& angles) {
  Matrix3d R = Matrix3d::Identity();
  for (std::size_t i = 0; i < axes.size(); ++i) {
    R = Eigen::AngleAxisd(angles[i], unit_axis(axes[i])).toRotationMatrix() * R;
  }
  return R;
}

class AsfReader {
 public:
  AsfReader(std::string_view bytes, const std::string& source) : lines_(bytes, source) {}

  AcclaimSkeleton read() {
    bool bones_seen = false;
    bool hierarchy_seen = false;
    line_ = lines_.next();
    while (line_) {
      auto rest = *line_;
      const auto section = next_word(rest);
      line_ = lines_.next();
      if (section == ":units") {
        units();
      } else if (section == ":root") {
        root();
      } else if (section == ":bonedata") {
        bonedata();
        bones_seen = true;
      } else if (section == ":hierarchy") {
        if (!bones_seen) lines_.fail(":hierarchy before :bonedata");
        hierarchy();
        hierarchy_seen = true;
      } else if (section.starts_with(':')) {
        while (inside()) line_ = lines_.next();  // version, name, documentation, skin
      } else {
        lines_.fail(std::string(section).append(": expected a section such as :units"));
      }
    }
    if (!bones_seen || !hierarchy_seen) {
      lines_.fail("no :bonedata or no :hierarchy: the file is damaged or was cut off");
    }
    scale();
    return std::move(skeleton_);
  }

 private:
  [[nodiscard]] bool inside() const { return line_ && !line_->starts_with(':'); }

  void units() {
    for (; inside(); line_ = lines_.next()) {
      auto rest = *line_;
      const auto key = next_word(rest);
      if (key == "length") {
        const double length = lines_.number(rest, "length");
        if (!(length > 1e-6)) lines_.fail("length: expected a positive number");
        // The format's unit is the inch divided by the scale.
        skeleton_.length_unit = kInch / length;
      } else if (key == "angle") {
        const auto unit = next_word(rest);
        if (unit != "deg" && unit != "rad") lines_.fail("angle: expected deg or rad");
        degrees_ = unit == "deg";
      }
    }
    skeleton_.angle_unit = degrees_ ? std::numbers::pi / 180.0 : 1.0;
  }

  /// Axes named by a word such as XYZ.
  std::vector<char> axis_order(std::string_view word) const {
    std::vector<char> axes;
    for (const char c : word) {
      const char axis = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
      if (axis < 'x' || axis > 'z') lines_.fail("expected an axis order such as XYZ");
      axes.push_back(axis);
    }
    if (axes.size() != 3) lines_.fail("expected an axis order such as XYZ");
    return axes;
  }

  Matrix3d oriented(const Vector3d& angles, const std::vector<char>& axes) const {
    const double unit = skeleton_.angle_unit;
    return turns(axes, {angles.x() * unit, angles.y() * unit, angles.z() * unit});
  }

  void root() {
    std::vector<char> axes{'x', 'y', 'z'};
    Vector3d orientation = Vector3d::Zero();
    for (; inside(); line_ = lines_.next()) {
      auto rest = *line_;
      const auto key = next_word(rest);
      if (key == "order") {
        for (auto word = next_word(rest); !word.empty(); word = next_word(rest)) {
          skeleton_.root_order.emplace_back(word);
        }
      } else if (key == "axis") {
        axes = axis_order(next_word(rest));
      } else if (key == "position") {
        skeleton_.root_position = lines_.triple(rest, "position");
      } else if (key == "orientation") {
        orientation = lines_.triple(rest, "orientation");
      }
    }
    skeleton_.root_axis = oriented(orientation, axes);
    std::vector<std::string> known{"RX", "RY", "RZ", "TX", "TY", "TZ"};
    auto order = skeleton_.root_order;
    std::sort(order.begin(), order.end());
    if (order != known) lines_.fail(":root order: expected each of TX TY TZ RX RY RZ once");
  }

  void bonedata() {
    while (inside()) {
      if (!line_->starts_with("begin")) lines_.fail("expected begin");
      line_ = lines_.next();
      bone();
    }
  }

  void bone() {
    AcclaimBone bone;
    Vector3d direction = Vector3d::Zero();
    double length = -1.0;
    for (; inside() && !line_->starts_with("end"); line_ = lines_.next()) {
      auto rest = *line_;
      const auto key = next_word(rest);
      if (key == "name") {
        bone.name = next_word(rest);
      } else if (key == "direction") {
        direction = lines_.triple(rest, "direction");
      } else if (key == "length") {
        length = lines_.number(rest, "length");
      } else if (key == "axis") {
        const Vector3d angles = lines_.triple(rest, "axis");
        bone.axis = oriented(angles, axis_order(next_word(rest)));
      } else if (key == "dof") {
        for (auto word = next_word(rest); !word.empty(); word = next_word(rest)) {
          if (word != "rx" && word != "ry" && word != "rz") lines_.fail("dof: expected rx ry rz");
          bone.dof.push_back(word[1]);
        }
      }
    }
    if (!inside()) lines_.fail("bone \"" + bone.name + "\" without end: the file was cut off");
    line_ = lines_.next();
    if (bone.name.empty() || index(bone.name) || bone.name == "root") {
      lines_.fail("bone name \"" + bone.name + "\": expected a new name");
    }
    if (!(length >= 0.0) || !(direction.norm() > 1e-6)) {
      lines_.fail("bone " + bone.name + ": expected a direction and a length");
    }
    if (bone.dof.size() > 3) lines_.fail("bone " + bone.name + ": more than three rotations");
    bone.offset = length * direction.normalized();
    skeleton_.bones.push_back(std::move(bone));
    if (skeleton_.bones.size() > kMaxBones) lines_.fail("more than 500 bones");
  }

  std::optional<std::size_t> index(std::string_view name) const {
    for (std::size_t i = 0; i < skeleton_.bones.size(); ++i) {
      if (skeleton_.bones[i].name == name) return i;
    }
    return std::nullopt;
  }

  void hierarchy() {
    std::vector<std::size_t> order;  // old indices, parents first
    std::vector<int> place(skeleton_.bones.size(), -1);
    for (; inside(); line_ = lines_.next()) {
      if (*line_ == "begin" || *line_ == "end") continue;
      auto rest = *line_;
      const auto parent_name = next_word(rest);
      int parent = -1;
      if (parent_name != "root") {
        const auto p = index(parent_name);
        if (!p || place[*p] < 0) {
          lines_.fail("bone \"" + std::string(parent_name) + "\" is not attached to the root");
        }
        parent = place[*p];
      }
      for (auto word = next_word(rest); !word.empty(); word = next_word(rest)) {
        const auto child = index(word);
        if (!child || place[*child] >= 0) {
          lines_.fail("child \"" + std::string(word) + "\": expected a bone with no parent yet");
        }
        skeleton_.bones[*child].parent = parent;
        place[*child] = static_cast<int>(order.size());
        order.push_back(*child);
      }
    }
    if (order.size() != skeleton_.bones.size()) lines_.fail("a bone is missing in :hierarchy");
    std::vector<AcclaimBone> sorted;
    sorted.reserve(order.size());
    for (const auto i : order) sorted.push_back(std::move(skeleton_.bones[i]));
    skeleton_.bones = std::move(sorted);
  }

  void scale() {
    skeleton_.root_position *= skeleton_.length_unit;
    for (auto& bone : skeleton_.bones) bone.offset *= skeleton_.length_unit;
  }

  LineReader lines_;
  std::optional<std::string_view> line_;
  bool degrees_ = true;
  AcclaimSkeleton skeleton_;
};

/// The end of `bone` is the joint `label`.
struct JointOfBone {
  std::string_view label;
  std::string_view bone;
};
constexpr std::array kJoints{
    JointOfBone{"Spine1", "upperback"},      JointOfBone{"Neck", "thorax"},
    JointOfBone{"LeftArm", "lclavicle"},     JointOfBone{"LeftForeArm", "lhumerus"},
    JointOfBone{"LeftHand", "lradius"},      JointOfBone{"RightArm", "rclavicle"},
    JointOfBone{"RightForeArm", "rhumerus"}, JointOfBone{"RightHand", "rradius"},
    JointOfBone{"LeftUpLeg", "lhipjoint"},   JointOfBone{"LeftLeg", "lfemur"},
    JointOfBone{"LeftFoot", "ltibia"},       JointOfBone{"LeftToeBase", "lfoot"},
    JointOfBone{"RightUpLeg", "rhipjoint"},  JointOfBone{"RightLeg", "rfemur"},
    JointOfBone{"RightFoot", "rtibia"},      JointOfBone{"RightToeBase", "rfoot"}};

class AmcReader {
 public:
  AmcReader(std::string_view bytes, const std::string& source, const AcclaimSkeleton& skeleton)
      : lines_(bytes, source), skeleton_(skeleton), angle_unit_(skeleton.angle_unit) {
    motion_.source = source;
    motion_.format = "ASF/AMC";
    motion_.points = {"Hips", "Spine"};
    for (const auto& joint : kJoints) {
      const auto bone = index(joint.bone);
      if (!bone) {
        throw InputError(source + ": skeleton without bone \"" + std::string(joint.bone) + "\"");
      }
      motion_.points.emplace_back(joint.label);
      joint_bones_.push_back(*bone);
    }
  }

  HumanMotion read(double rate) {
    motion_.rate = rate;
    auto line = lines_.next();
    for (; line && line->starts_with(':'); line = lines_.next()) {
      if (*line == ":DEGREES") angle_unit_ = std::numbers::pi / 180.0;
      if (*line == ":RADIANS") angle_unit_ = 1.0;
    }
    while (line) {
      const auto number = parse_number(*line);
      if (!number)
        lines_.fail("\"" + std::string(line->substr(0, 20)) + "\": expected a frame number");
      begin_frame();
      for (line = lines_.next(); line && !parse_number(*line); line = lines_.next()) {
        bone_values(*line);
      }
      end_frame();
    }
    if (motion_.frames.empty()) lines_.fail("no frames");
    return std::move(motion_);
  }

 private:
  std::optional<std::size_t> index(std::string_view name) const {
    for (std::size_t i = 0; i < skeleton_.bones.size(); ++i) {
      if (skeleton_.bones[i].name == name) return i;
    }
    return std::nullopt;
  }

  void begin_frame() {
    seen_.assign(skeleton_.bones.size(), false);
    root_seen_ = false;
    local_.assign(skeleton_.bones.size(), Matrix3d::Identity());
  }

  void bone_values(std::string_view line) {
    auto rest = line;
    const auto name = next_word(rest);
    if (name == "root") {
      root_values(rest);
      return;
    }
    const auto bone = index(name);
    if (!bone) lines_.fail("bone \"" + std::string(name) + "\" is not in the skeleton");
    if (seen_[*bone]) lines_.fail("bone \"" + std::string(name) + "\" appears twice in a frame");
    seen_[*bone] = true;
    const auto& spec = skeleton_.bones[*bone];
    std::vector<double> angles;
    for (std::size_t i = 0; i < spec.dof.size(); ++i) {
      angles.push_back(angle_unit_ * lines_.number(rest, spec.name));
    }
    end_of_line(rest, spec.name);
    local_[*bone] = spec.axis * turns(spec.dof, angles) * spec.axis.transpose();
  }

  void root_values(std::string_view rest) {
    root_seen_ = true;
    root_position_ = skeleton_.root_position;
    std::vector<char> axes;
    std::vector<double> angles;
    for (const auto& channel : skeleton_.root_order) {
      const double value = lines_.number(rest, "root");
      if (channel[0] == 'T') {
        root_position_[channel[1] - 'X'] += value * skeleton_.length_unit;
      } else {
        axes.push_back(static_cast<char>(channel[1] - 'X' + 'x'));
        angles.push_back(value * angle_unit_);
      }
    }
    end_of_line(rest, "root");
    root_rotation_ = skeleton_.root_axis * turns(axes, angles) * skeleton_.root_axis.transpose();
  }

  void end_of_line(std::string_view rest, const std::string& name) const {
    if (!trimmed(rest).empty()) lines_.fail(name + ": more values than the skeleton has rotations");
  }

  void end_frame() {
    if (!root_seen_) lines_.fail("frame without root: the file is damaged or was cut off");
    for (std::size_t i = 0; i < seen_.size(); ++i) {
      if (!seen_[i] && !skeleton_.bones[i].dof.empty()) {
        lines_.fail("frame without bone \"" + skeleton_.bones[i].name +
                    "\": the file is damaged or was cut off");
      }
    }
    std::vector<Matrix3d> R(local_.size());
    std::vector<Vector3d> end(local_.size());
    for (std::size_t i = 0; i < local_.size(); ++i) {
      const int parent = skeleton_.bones[i].parent;
      const auto p = static_cast<std::size_t>(std::max(parent, 0));
      R[i] = (parent < 0 ? root_rotation_ : R[p]) * local_[i];
      end[i] = (parent < 0 ? root_position_ : end[p]) + R[i] * skeleton_.bones[i].offset;
    }
    HumanMotion::Frame frame;
    frame.point.push_back(z_up(root_position_));
    frame.point.push_back(z_up(root_position_ + kSpineMark * root_rotation_.col(1)));
    for (const auto bone : joint_bones_) frame.point.push_back(z_up(end[bone]));
    motion_.frames.push_back(std::move(frame));
  }

  /// The file's z (the skeleton's front) becomes x, its x (left) y, its y (up) z.
  static Vector3d z_up(const Vector3d& p) { return {p.z(), p.x(), p.y()}; }

  LineReader lines_;
  const AcclaimSkeleton& skeleton_;
  double angle_unit_;
  std::vector<std::size_t> joint_bones_;
  std::vector<bool> seen_;
  bool root_seen_ = false;
  std::vector<Matrix3d> local_;
  Vector3d root_position_ = Vector3d::Zero();
  Matrix3d root_rotation_ = Matrix3d::Identity();
  HumanMotion motion_;
};

}  // namespace

AcclaimSkeleton parse_asf(std::string_view bytes, const std::string& source) {
  return AsfReader(bytes, source).read();
}

HumanMotion parse_amc(std::string_view bytes, const std::string& source,
                      const AcclaimSkeleton& skeleton, double rate) {
  return AmcReader(bytes, source, skeleton).read(rate);
}

}  // namespace clamber
