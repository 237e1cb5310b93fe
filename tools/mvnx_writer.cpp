#include "tools/mvnx_writer.hpp"

#include <Eigen/Geometry>
#include <charconv>
#include <cmath>
#include <numbers>
#include <string_view>
#include <system_error>

#include "planner_offline/recording/joint_angles.hpp"

namespace clamber::tools {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kHalfTurn = std::numbers::pi / 2.0;
// A twentieth of a millimetre, 0.001 deg and 0.005 deg: finer than any suit, and half the file.
constexpr int kPositionDigits = 4;
constexpr int kQuaternionDigits = 5;
constexpr int kAngleDigits = 2;
constexpr double kFootOnFloor = 0.005;  // m

void append(std::string& out, double value, int digits) {
  char text[48];
  const auto [end, error] =
      std::to_chars(text, text + sizeof text, value, std::chars_format::fixed, digits);
  std::string_view number(text, error == std::errc() ? static_cast<std::size_t>(end - text) : 0);
  if (number.starts_with('-') && number.find_first_of("123456789") == std::string_view::npos) {
    number.remove_prefix(1);
  }
  if (!out.empty() && out.back() != '>') out += ' ';
  out += number;
}

void append(std::string& out, const Vector3d& v, int digits) {
  for (int i = 0; i < 3; ++i) append(out, v[i], digits);
}

/// From the file's segment frame (parallel to the world in the T-pose) to the anatomical frame.
Matrix3d anatomical_in_tpose(int segment) {
  for (const int side : {0, 1}) {
    const auto s = static_cast<std::size_t>(side);
    if (segment < kUpperArm[s] || segment > kHand[s]) continue;
    const double sign = side == 0 ? -1.0 : 1.0;
    const Matrix3d raised = AngleAxisd(sign * kHalfTurn, Vector3d::UnitX()).toRotationMatrix();
    if (segment == kUpperArm[s]) return raised;
    // Palms face down in the T-pose: forearms turned by a quarter from the anatomical position.
    return raised * AngleAxisd(-sign * kHalfTurn, Vector3d::UnitZ()).toRotationMatrix();
  }
  return Matrix3d::Identity();
}

class Writer {
 public:
  Writer(const Skeleton& skeleton, int rate) : skeleton_(skeleton), rate_(rate) {
    for (std::size_t i = 0; i < kSegmentCount; ++i) {
      to_anatomical_[i] = anatomical_in_tpose(static_cast<int>(i));
    }
  }

  std::string write(const std::vector<Figure>& figures, const std::string& description) {
    header(description);
    segments();
    joints();
    out_ +=
        "    <footContactDefinition>\n"
        "      <contactDefinition label=\"LeftFoot_Heel\" index=\"0\"/>\n"
        "      <contactDefinition label=\"LeftFoot_Toe\" index=\"1\"/>\n"
        "      <contactDefinition label=\"RightFoot_Heel\" index=\"2\"/>\n"
        "      <contactDefinition label=\"RightFoot_Toe\" index=\"3\"/>\n"
        "    </footContactDefinition>\n"
        "    <frames segmentCount=\"23\" sensorCount=\"0\" jointCount=\"22\">\n";
    special_frames();
    for (std::size_t i = 0; i < figures.size(); ++i) frame(i, figures[i]);
    out_ += "    </frames>\n  </subject>\n</mvnx>\n";
    return std::move(out_);
  }

 private:
  void header(const std::string& description) {
    out_ =
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
        "<!-- SYNTHETIC: computed by Clamber's make_demonstration, not recorded from a person. "
        "-->\n"
        "<mvnx xmlns=\"http://www.xsens.com/mvn/mvnx\" version=\"4\">\n"
        "  <comment>SYNTHETIC, made by make_demonstration: " +
        description +
        "</comment>\n"
        "  <subject label=\"SYNTHETIC person\" torsoColor=\"#808080\" frameRate=\"" +
        std::to_string(rate_) +
        "\" segmentCount=\"23\" originalFilename=\"SYNTHETIC\" configuration=\"FullBody\" "
        "userScenario=\"multiLevel\">\n"
        "    <comment>SYNTHETIC</comment>\n";
  }

  void point(std::string_view label, std::size_t segment, const Vector3d& anatomical) {
    out_ += "          <point label=\"";
    out_ += label;
    out_ += "\"><pos_b>";
    append(out_, to_anatomical_[segment] * anatomical, 6);
    out_ += "</pos_b></point>\n";
  }

  void segments() {
    const auto& specs = segment_specs();
    out_ += "    <segments>\n";
    for (std::size_t i = 0; i < kSegmentCount; ++i) {
      out_ += "      <segment label=\"";
      out_ += specs[i].label;
      out_ += "\" id=\"" + std::to_string(i + 1) + "\">\n        <points>\n";
      point(i == 0 ? "pHipOrigin" : specs[i].joint, i, Vector3d::Zero());
      for (std::size_t child = 1; child < kSegmentCount; ++child) {
        if (specs[child].parent == static_cast<int>(i)) {
          point(specs[child].joint, i, skeleton_.offset[child]);
        }
      }
      if (!skeleton_.tip[i].isZero()) {
        point(std::string("p").append(specs[i].label).append("Tip"), i, skeleton_.tip[i]);
      }
      out_ += "        </points>\n      </segment>\n";
    }
    out_ += "    </segments>\n";
  }

  void joints() {
    const auto& specs = segment_specs();
    out_ += "    <joints>\n";
    for (std::size_t i = 1; i < kSegmentCount; ++i) {
      const std::string joint(specs[i].joint);
      const std::string parent(specs[static_cast<std::size_t>(specs[i].parent)].label);
      out_ += "      <joint label=\"" + joint + "\"><connector1>" + parent + "/" + joint +
              "</connector1><connector2>" + std::string(specs[i].label) + "/" + joint +
              "</connector2></joint>\n";
    }
    out_ += "    </joints>\n";
  }

  /// @param file_frames orientation of the file's segment frames
  void pose(const std::array<Matrix3d, kSegmentCount>& file_frames, const Figure& figure) {
    out_ += "<orientation>";
    for (const auto& R : file_frames) {
      Quaterniond q(R);
      // One sign per rotation: otherwise rounding in the conversion decides.
      if (q.w() < 0.0) q.coeffs() = -q.coeffs();
      append(out_, q.w(), kQuaternionDigits);
      append(out_, q.vec(), kQuaternionDigits);
    }
    out_ += "</orientation>\n<position>";
    for (const auto& p : figure.p) append(out_, p, kPositionDigits);
    out_ += "</position>\n";
  }

  void special_frames() {
    Figure tpose;
    tpose.R = to_anatomical_;
    tpose.p.fill(Vector3d::Zero());
    tpose.p[kPelvis].z() = skeleton_.hip_height;
    place_segments(skeleton_, tpose);
    std::array<Matrix3d, kSegmentCount> identity;
    identity.fill(Matrix3d::Identity());
    for (const auto* type : {"identity", "tpose", "tpose-isb"}) {
      out_ += "<frame time=\"0\" type=\"" + std::string(type) + "\">\n";
      pose(std::string_view(type) == "tpose-isb" ? to_anatomical_ : identity, tpose);
      out_ += "</frame>\n";
    }
  }

  void frame(std::size_t index, const Figure& figure) {
    const auto time = std::lround(1000.0 * static_cast<double>(index) / rate_);
    out_ += "<frame time=\"" + std::to_string(time) + "\" index=\"" + std::to_string(index) +
            "\" type=\"normal\">\n";
    std::array<Matrix3d, kSegmentCount> file_frames;
    for (std::size_t i = 0; i < kSegmentCount; ++i) {
      file_frames[i] = figure.R[i] * to_anatomical_[i].transpose();
    }
    pose(file_frames, figure);
    const auto& specs = segment_specs();
    out_ += "<jointAngle>";
    for (std::size_t i = 1; i < kSegmentCount; ++i) {
      const auto parent = static_cast<std::size_t>(specs[i].parent);
      append(
          out_,
          mvn_joint_angle(figure.R[parent], figure.R[i], specs[i].joint) * 180.0 / std::numbers::pi,
          kAngleDigits);
    }
    out_ += "</jointAngle>\n<footContacts>" + foot_contacts(figure) + "</footContacts>\n</frame>\n";
  }

  std::string foot_contacts(const Figure& figure) const {
    std::string flags;
    for (const std::size_t side : {1U, 0U}) {
      const auto foot = static_cast<std::size_t>(kFoot[side]);
      const Vector3d heel(-skeleton_.heel_reach, 0.0, -skeleton_.ankle_height);
      const Vector3d toe(skeleton_.offset[foot + 1].x(), 0.0, -skeleton_.ankle_height);
      for (const auto& p : {heel, toe}) {
        const double z = (figure.p[foot] + figure.R[foot] * p).z();
        flags += std::string(flags.empty() ? "" : " ") + (z < kFootOnFloor ? "1" : "0");
      }
    }
    return flags;
  }

  const Skeleton& skeleton_;
  int rate_;
  std::array<Matrix3d, kSegmentCount> to_anatomical_;
  std::string out_;
};

}  // namespace

std::string write_mvnx(const Skeleton& skeleton, const std::vector<Figure>& figures, int rate,
                       const std::string& description) {
  return Writer(skeleton, rate).write(figures, description);
}

}  // namespace clamber::tools
