#include "planner_offline/recording/mvnx.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <pugixml.hpp>

#include "planner_offline/recording/joint_angles.hpp"
#include "planner_offline/recording/parse_number.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;
/// Files are written with 6 decimals at best and 4 in some exports.
constexpr double kQuaternionTolerance = 0.02;
constexpr std::size_t kMaxSegments = 200;
/// Recorded angles that differ more than this from the orientations deserve a warning.
constexpr double kAngleAgreement = 1.0 * kRadPerDeg;

struct JointLink {
  std::string label;
  std::size_t parent = 0;
  std::size_t child = 0;
};

class MvnxReader {
 public:
  MvnxReader(std::string_view bytes, const std::string& source) : bytes_(bytes) {
    motion_.source = source;
  }

  HumanMotion read() {
    const auto result = document_.load_buffer(bytes_.data(), bytes_.size());
    if (!result) {
      fail(result.offset, std::string("not well-formed XML (") + result.description() +
                              "): the file is damaged or was cut off");
    }
    read_header();
    read_segments();
    read_joints();
    read_frames();
    compare_angles();
    return std::move(motion_);
  }

 private:
  [[noreturn]] void fail(std::ptrdiff_t offset, const std::string& what) const {
    const auto end = std::clamp<std::ptrdiff_t>(offset, 0, std::ssize(bytes_));
    const auto line = 1 + std::count(bytes_.begin(), bytes_.begin() + end, '\n');
    throw InputError(motion_.source + ":" + std::to_string(line) + ": " + what);
  }
  [[noreturn]] void fail(const pugi::xml_node& node, const std::string& what) const {
    fail(node.offset_debug(), what);
  }

  void read_header() {
    const pugi::xml_node root = document_.document_element();
    const std::string name = root.name();
    if (name == "mvnxInfo" || root.child("mvnxInfo")) {
      fail(root, "MVNX version 2 (old Moven layout) is not supported: export as version 3 or 4");
    }
    if (name != "mvnx") fail(root, "root element <" + name + ">: expected <mvnx>");
    const std::string version = root.attribute("version").value();
    if (version != "3" && version != "4") {
      fail(root, "MVNX version \"" + version + "\" is not supported: expected 3 or 4");
    }
    version_ = version == "3" ? 3 : 4;
    motion_.format = "MVNX " + version;
    subject_ = root.child("subject");
    if (!subject_) fail(root, "no <subject>: expected one person's recording");
    const auto rate = parse_number(subject_.attribute("frameRate").value());
    if (!rate || *rate < 1.0 || *rate > 10000.0) {
      fail(subject_, std::string("frameRate \"") + subject_.attribute("frameRate").value() +
                         "\": expected 1 to 10000 Hz");
    }
    motion_.rate = *rate;
    for (const auto& parent : {root, subject_}) {
      if (std::string_view(parent.child("comment").child_value()).find("SYNTHETIC") !=
          std::string_view::npos) {
        motion_.synthetic = true;
      }
    }
  }

  void read_segments() {
    const auto list = subject_.child("segments");
    for (const auto& segment : list.children("segment")) {
      const std::string label = segment.attribute("label").value();
      if (label.empty()) fail(segment, "<segment> without label");
      if (motion_.find_segment(label)) fail(segment, "segment \"" + label + "\" appears twice");
      motion_.segments.push_back(label);
    }
    if (motion_.segments.empty()) fail(subject_, "no <segments>: expected labelled segments");
    if (motion_.segments.size() > kMaxSegments) {
      fail(list, std::to_string(motion_.segments.size()) + " segments: expected at most 200");
    }
  }

  std::size_t connected_segment(const pugi::xml_node& joint, const char* connector) const {
    const std::string text = joint.child(connector).child_value();
    const auto label = text.substr(0, text.find('/'));
    const auto index = motion_.find_segment(label);
    if (!index) {
      fail(joint, std::string(connector) + " \"" + text + "\": expected Segment/point");
    }
    return *index;
  }

  void read_joints() {
    for (const auto& joint : subject_.child("joints").children("joint")) {
      const std::string label = joint.attribute("label").value();
      if (label.empty()) fail(joint, "<joint> without label");
      joints_.push_back(
          {label, connected_segment(joint, "connector1"), connected_segment(joint, "connector2")});
    }
  }

  std::vector<double> numbers(const pugi::xml_node& frame, const char* tag,
                              std::size_t expected) const {
    const auto node = frame.child(tag);
    if (!node) fail(frame, std::string("frame without <") + tag + ">");
    std::optional<std::size_t> bad;
    auto values = parse_numbers(node.child_value(), bad);
    if (bad) {
      fail(node, std::string("<") + tag + "> value " + std::to_string(*bad + 1) +
                     " is not a finite number");
    }
    if (values.size() != expected) {
      fail(node, std::string("<") + tag + "> has " + std::to_string(values.size()) +
                     " values: expected " + std::to_string(expected));
    }
    return values;
  }

  std::vector<Eigen::Quaterniond> orientations(const pugi::xml_node& frame) const {
    const auto values = numbers(frame, "orientation", 4 * motion_.segments.size());
    std::vector<Eigen::Quaterniond> out;
    for (std::size_t i = 0; i < motion_.segments.size(); ++i) {
      Eigen::Quaterniond q(values[4 * i], values[4 * i + 1], values[4 * i + 2], values[4 * i + 3]);
      if (std::abs(q.norm() - 1.0) > kQuaternionTolerance) {
        fail(frame.child("orientation"),
             "orientation of " + motion_.segments[i] + " is not a unit quaternion");
      }
      out.push_back(q.normalized());
    }
    return out;
  }

  static std::vector<Eigen::Vector3d> triples(const std::vector<double>& values) {
    std::vector<Eigen::Vector3d> out;
    for (std::size_t i = 0; i + 2 < values.size(); i += 3) {
      out.emplace_back(values[i], values[i + 1], values[i + 2]);
    }
    return out;
  }

  /// Version 4 stores segment frames of the T-pose; its two special frames say how to get from
  /// them to the anatomical ones.
  std::vector<Eigen::Quaterniond> anatomical_corrections(const pugi::xml_node& frames) const {
    std::vector<Eigen::Quaterniond> corrections(motion_.segments.size(),
                                                Eigen::Quaterniond::Identity());
    if (version_ == 3) return corrections;
    const auto tpose = frames.find_child_by_attribute("frame", "type", "tpose");
    const auto isb = frames.find_child_by_attribute("frame", "type", "tpose-isb");
    if (!tpose || !isb) {
      fail(frames, "version 4 without the frames \"tpose\" and \"tpose-isb\"");
    }
    const auto q_tpose = orientations(tpose);
    const auto q_isb = orientations(isb);
    for (std::size_t i = 0; i < corrections.size(); ++i) {
      corrections[i] = q_tpose[i].conjugate() * q_isb[i];
    }
    return corrections;
  }

  void read_frames() {
    const auto frames = subject_.child("frames");
    const auto corrections = anatomical_corrections(frames);
    const auto first =
        frames.find_child_by_attribute("frame", "type", "normal").child("jointAngle");
    if (first && !joints_.empty()) {
      for (const auto& joint : joints_) motion_.joints.push_back(joint.label);
    }
    for (const auto& node : frames.children("frame")) {
      if (std::string_view(node.attribute("type").value()) != "normal") continue;
      HumanMotion::Frame frame;
      frame.orientation = orientations(node);
      for (std::size_t i = 0; i < corrections.size(); ++i) {
        frame.orientation[i] = (frame.orientation[i] * corrections[i]).normalized();
      }
      frame.origin = triples(numbers(node, "position", 3 * motion_.segments.size()));
      if (!motion_.joints.empty()) {
        frame.angle = triples(numbers(node, "jointAngle", 3 * motion_.joints.size()));
        for (auto& angle : frame.angle) angle *= kRadPerDeg;
      }
      motion_.frames.push_back(std::move(frame));
    }
    if (motion_.frames.empty()) fail(subject_, "no frame of type \"normal\"");
  }

  /// The orientations are what is mapped; the file's own angles serve as a check of the axes.
  void compare_angles() {
    double worst = 0.0;
    std::string joint;
    for (const auto& frame : motion_.frames) {
      for (std::size_t j = 0; j < motion_.joints.size(); ++j) {
        const Eigen::Vector3d computed = mvn_joint_angle(
            frame.orientation[joints_[j].parent].toRotationMatrix(),
            frame.orientation[joints_[j].child].toRotationMatrix(), joints_[j].label);
        // Near the singularity of the sequence x = +-90 deg, y and z are arbitrary.
        if (std::abs(std::cos(computed.x())) < 0.1) continue;
        for (int k = 0; k < 3; ++k) {
          const double error =
              std::abs(std::remainder(computed[k] - frame.angle[j][k], 2.0 * std::numbers::pi));
          if (error > worst) {
            worst = error;
            joint = joints_[j].label;
          }
        }
      }
    }
    if (worst > kAngleAgreement) {
      motion_.warnings.push_back("the file's jointAngle differs from its orientations by up to " +
                                 std::to_string(worst / kRadPerDeg) + " deg (" + joint +
                                 "); the orientations are used");
    }
  }

  std::string_view bytes_;
  pugi::xml_document document_;
  pugi::xml_node subject_;
  int version_ = 0;
  std::vector<JointLink> joints_;
  HumanMotion motion_;
};

}  // namespace

HumanMotion parse_mvnx(std::string_view bytes, const std::string& source) {
  return MvnxReader(bytes, source).read();
}

}  // namespace clamber
