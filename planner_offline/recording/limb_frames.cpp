#include "planner_offline/recording/limb_frames.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kDeg = std::numbers::pi / 180.0;
constexpr double kPlaneUnknown = 10.0 * kDeg;  // flexion below which the bending plane is noise
constexpr double kPlaneKnown = 25.0 * kDeg;    // and above which it is trusted
constexpr double kMinLength = 1e-3;            // m, shorter bones have no direction
constexpr double kFootStill = 0.05;            // m/s
constexpr double kFlatShare = 0.2;  // share of still frames in which the slope is smaller

enum class Hinge { kElbow, kKnee };

struct Side {
  std::size_t shoulder, elbow, wrist, hip, knee, ankle, toe;
};

/// Axes with y along `y` and z as near to `z` as that allows.
Matrix3d frame_from_y_z(const Vector3d& y, const Vector3d& z) {
  Matrix3d R;
  R.col(1) = y.normalized();
  R.col(0) = R.col(1).cross(z).normalized();
  R.col(2) = R.col(0).cross(R.col(1));
  return R;
}

Matrix3d frame_from_z_y(const Vector3d& z, const Vector3d& y) {
  Matrix3d R;
  R.col(2) = z.normalized();
  R.col(0) = y.cross(R.col(2)).normalized();
  R.col(1) = R.col(2).cross(R.col(0));
  return R;
}

double smooth(double s) {
  s = std::clamp(s, 0.0, 1.0);
  return s * s * (3.0 - 2.0 * s);
}

class SegmentBuilder {
 public:
  explicit SegmentBuilder(HumanMotion& motion) : motion_(motion) {
    hips_ = point("Hips");
    spine_ = point("Spine");
    chest_ = point("Spine1");
    neck_ = point("Neck");
    for (const std::string side : {"Right", "Left"}) {
      sides_.push_back({point(side + "Arm"), point(side + "ForeArm"), point(side + "Hand"),
                        point(side + "UpLeg"), point(side + "Leg"), point(side + "Foot"),
                        point(side + "ToeBase")});
    }
  }

  void build() {
    motion_.segments = {"Pelvis", "T8"};
    for (const std::string side : {"Right", "Left"}) {
      for (const char* segment :
           {"UpperArm", "ForeArm", "Hand", "UpperLeg", "LowerLeg", "Foot", "Toe"}) {
        motion_.segments.push_back(side + segment);
      }
    }
    for (std::size_t s = 0; s < 2; ++s) flat_slope_[s] = flat_foot_slope(sides_[s]);
    for (frame_ = 0; frame_ < motion_.frames.size(); ++frame_) build_frame();
  }

 private:
  std::size_t point(const std::string& label) const {
    if (const auto i = motion_.find_point(label)) return *i;
    throw InputError(motion_.source + ": no joint \"" + label + "\" among the recorded positions");
  }

  const Vector3d& at(std::size_t point) const { return motion_.frames[frame_].point[point]; }

  Vector3d bone(std::size_t from, std::size_t to) const {
    const Vector3d d = at(to) - at(from);
    if (d.norm() < kMinLength) {
      throw InputError(motion_.source + ": frame " + std::to_string(frame_) + ": joints " +
                       motion_.points[from] + " and " + motion_.points[to] + " coincide");
    }
    return d;
  }

  void build_frame() {
    auto& out = motion_.frames[frame_];
    out.orientation.clear();
    out.origin.clear();
    const Matrix3d pelvis = trunk_frame(sides_[0].hip, sides_[1].hip, hips_, spine_);
    const Matrix3d chest = trunk_frame(sides_[0].shoulder, sides_[1].shoulder, chest_, neck_);
    add(pelvis, 0.5 * (at(sides_[0].hip) + at(sides_[1].hip)));
    add(chest, at(chest_));
    for (std::size_t s = 0; s < 2; ++s) {
      const Side& side = sides_[s];
      const auto arm =
          limb(chest, side.shoulder, side.elbow, side.wrist, Hinge::kElbow, arm_axis_[s]);
      add(arm[0], at(side.shoulder));
      add(arm[1], at(side.elbow));
      add(arm[1], at(side.wrist));
      const auto leg = limb(pelvis, side.hip, side.knee, side.ankle, Hinge::kKnee, leg_axis_[s]);
      const Matrix3d foot = foot_frame(side, leg[1], flat_slope_[s]);
      add(leg[0], at(side.hip));
      add(leg[1], at(side.knee));
      add(foot, at(side.ankle));
      add(foot, at(side.toe));
    }
  }

  void add(const Matrix3d& R, const Vector3d& origin) {
    motion_.frames[frame_].orientation.emplace_back(R);
    motion_.frames[frame_].origin.push_back(origin);
  }

  Matrix3d trunk_frame(std::size_t right, std::size_t left, std::size_t low,
                       std::size_t high) const {
    const Vector3d y = bone(right, left).normalized();
    const Vector3d z = bone(low, high).normalized();
    if (y.cross(z).norm() < 1e-3) {
      throw InputError(motion_.source + ": frame " + std::to_string(frame_) + ": " +
                       motion_.points[high] + " lies on the line " + motion_.points[right] +
                       " to " + motion_.points[left]);
    }
    return frame_from_y_z(y, z);
  }

  /// @param axis hinge axis of the frame before, replaced by this frame's
  std::array<Matrix3d, 2> limb(const Matrix3d& parent, std::size_t root, std::size_t middle,
                               std::size_t end, Hinge hinge, Vector3d& axis) const {
    const Vector3d z_upper = bone(middle, root).normalized();
    const Vector3d z_lower = bone(end, middle).normalized();
    // Knees turn the lower segment by a positive angle about y, elbows by a negative one.
    const Vector3d normal = hinge == Hinge::kKnee ? z_upper.cross(z_lower) : z_lower.cross(z_upper);
    const double flexion = std::atan2(normal.norm(), z_upper.dot(z_lower));
    const double trust = smooth((flexion - kPlaneUnknown) / (kPlaneKnown - kPlaneUnknown));

    const Vector3d carried = frame_ == 0 ? carried_from_parent(parent, z_upper) : axis;
    Vector3d y = carried - carried.dot(z_upper) * z_upper;
    y = y.norm() < 1e-6 ? z_upper.unitOrthogonal() : y.normalized();
    if (trust > 0.0) {
      const Vector3d mixed = (1.0 - trust) * y + trust * normal.normalized();
      y = mixed.norm() < 1e-3 ? Vector3d(normal) : mixed;
    }
    const Matrix3d upper = frame_from_z_y(z_upper, y);
    axis = upper.col(1);
    Vector3d y_lower = axis - axis.dot(z_lower) * z_lower;
    if (y_lower.norm() < 1e-6) y_lower = z_lower.unitOrthogonal();
    return {upper, frame_from_z_y(z_lower, y_lower)};
  }

  /// The parent's y axis taken along by the shortest rotation from its z axis to the bone.
  static Vector3d carried_from_parent(const Matrix3d& parent, const Vector3d& z) {
    return Eigen::Quaterniond::FromTwoVectors(Vector3d(parent.col(2)), z) * Vector3d(parent.col(1));
  }

  /// Downward slope of ankle to toe joint when the foot stands flat, rad. Standing still means
  /// flat more often than toes up, so a low quantile of the still frames is taken.
  double flat_foot_slope(const Side& side) {
    std::vector<double> still;
    std::vector<double> all;
    for (frame_ = 0; frame_ < motion_.frames.size(); ++frame_) {
      const Vector3d d = bone(side.ankle, side.toe).normalized();
      const double slope = std::asin(std::clamp(-d.z(), -1.0, 1.0));
      all.push_back(slope);
      if (frame_ == 0) continue;
      const auto& before = motion_.frames[frame_ - 1].point;
      const double step = std::max((at(side.ankle) - before[side.ankle]).norm(),
                                   (at(side.toe) - before[side.toe]).norm());
      if (step * motion_.rate < kFootStill) still.push_back(slope);
    }
    auto& slopes = still.empty() ? all : still;
    if (slopes.empty()) return 0.0;
    const auto rank =
        static_cast<std::ptrdiff_t>(kFlatShare * static_cast<double>(slopes.size() - 1));
    std::nth_element(slopes.begin(), slopes.begin() + rank, slopes.end());
    return slopes[static_cast<std::size_t>(rank)];
  }

  Matrix3d foot_frame(const Side& side, const Matrix3d& shank, double slope) const {
    const Vector3d x = bone(side.ankle, side.toe).normalized();
    Vector3d y = shank.col(1) - shank.col(1).dot(x) * x;
    if (y.norm() < 1e-6) y = x.unitOrthogonal();
    y.normalize();
    Matrix3d sloped;
    sloped << x, y, x.cross(y);
    return sloped * Eigen::AngleAxisd(-slope, Vector3d::UnitY()).toRotationMatrix();
  }

  HumanMotion& motion_;
  std::size_t frame_ = 0;
  std::size_t hips_ = 0, spine_ = 0, chest_ = 0, neck_ = 0;
  std::vector<Side> sides_;
  std::array<double, 2> flat_slope_{};
  std::array<Vector3d, 2> arm_axis_{Vector3d::UnitY(), Vector3d::UnitY()};
  std::array<Vector3d, 2> leg_axis_{Vector3d::UnitY(), Vector3d::UnitY()};
};

}  // namespace

void add_segments(HumanMotion& motion) { SegmentBuilder(motion).build(); }

}  // namespace clamber
