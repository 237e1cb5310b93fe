#include "tools/climb_choreography.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "tools/limb_ik.hpp"
#include "tools/track.hpp"

namespace clamber::tools {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kDeg = std::numbers::pi / 180.0;
constexpr double kReferenceHeight = 1.75;  // m, the height that the key poses below were made for
constexpr double kElbowRadius = 0.045;     // m, joint centre above the surface when it rests
constexpr double kWristRadius = 0.035;
constexpr double kKneeRadius = 0.050;
constexpr double kRestPronation = 80.0 * kDeg;
constexpr double kPlantedPronation = 155.0 * kDeg;
constexpr double kKneelingPlantarFlexion = 45.0 * kDeg;

double outward(std::size_t side) { return side == 0 ? -1.0 : 1.0; }

/// Fingers forward, palm down. The anatomical hand has its palm on +x and the fingers along -z.
Matrix3d flat_hand() {
  Matrix3d R;
  R.col(0) = -Vector3d::UnitZ();
  R.col(1) = -Vector3d::UnitY();
  R.col(2) = -Vector3d::UnitX();
  return R;
}

Matrix3d pelvis_rotation(const ClimbChoreography::Trunk& x) {
  return (AngleAxisd(x[4], Vector3d::UnitY()) * AngleAxisd(x[3], Vector3d::UnitZ()) *
          AngleAxisd(x[5], Vector3d::UnitX()))
      .toRotationMatrix();
}

// Table over body height for which the key poses below stay a plausible climb.
constexpr double kLowestTable = 0.12;
constexpr double kHighestTable = 0.25;
constexpr double kMostReach = 0.99;  // of a limb's length at a key pose after the standing one
constexpr double kReachElbowFlexion = 25.0 * kDeg;
// The swinging foot leaves the straight line backward and upward, so that the knee comes over the
// edge before the shank does.
constexpr double kSwingBack = 0.12;  // m for the reference height
constexpr double kSwingUp = 0.10;
constexpr double kFootTurnStart = 0.25;  // share of the swing before which the toes stay up

constexpr double kStepUp = 0.16;  // m above the straight line, for a foot that lands flat

Vector3d knee_hint(std::size_t side) { return {1.0, 0.1 * outward(side), 0.0}; }

/// Angles in degrees.
ClimbChoreography::Trunk trunk(double x, double y, double z, double yaw, double pitch, double bend,
                               double turn, double neck) {
  ClimbChoreography::Trunk t;
  t << x, y, z, yaw * kDeg, pitch * kDeg, 0.0, bend * kDeg, 0.0, turn * kDeg, neck * kDeg;
  return t;
}

ClimbChoreography::Schedule schedule_of(ClimbStyle style) {
  ClimbChoreography::Schedule schedule;
  if (style != ClimbStyle::kAllFours) {
    schedule.elbow = std::numeric_limits<double>::infinity();
  }
  if (style == ClimbStyle::kFeetFirst) {
    schedule.lift = {15.4, 2.5};
    schedule.land = {18.2, 5.5};
    schedule.arm_start = 6.5;
    schedule.wrist = 10.5;
  }
  return schedule;
}

/// Left and right exchanged, by reflection at the plane y = 0.
Figure mirrored(const Figure& figure) {
  const Vector3d flip(1.0, -1.0, 1.0);
  Figure out = figure;
  for (std::size_t i = 0; i < kSegmentCount; ++i) {
    out.R[i] = flip.asDiagonal() * figure.R[i] * flip.asDiagonal();
    out.p[i] = flip.asDiagonal() * figure.p[i];
  }
  constexpr std::size_t kArm = kLeftShoulder - kRightShoulder,
                        kLeg = kLeftUpperLeg - kRightUpperLeg;
  for (std::size_t i = 0; i < kArm; ++i) {
    std::swap(out.R[kRightShoulder + i], out.R[kLeftShoulder + i]);
    std::swap(out.p[kRightShoulder + i], out.p[kLeftShoulder + i]);
  }
  for (std::size_t i = 0; i < kLeg; ++i) {
    std::swap(out.R[kRightUpperLeg + i], out.R[kLeftUpperLeg + i]);
    std::swap(out.p[kRightUpperLeg + i], out.p[kLeftUpperLeg + i]);
  }
  return out;
}

}  // namespace

ClimbChoreography::ClimbChoreography(const ClimbParameters& parameters)
    : parameters_(parameters),
      schedule_(schedule_of(parameters.style)),
      skeleton_(parameters.body_height) {
  const double share = parameters.table_height / parameters.body_height;
  if (!(share >= kLowestTable && share <= kHighestTable)) {
    throw std::invalid_argument("the table must be 0.12 to 0.25 of the body height");
  }
  place_targets();
  plan_trunk();
  for (std::size_t side = 0; side < 2; ++side) {
    if (!lands_on_feet()) {
      Figure standing = trunk_figure(trunk_at(schedule_.lift[side]));
      leg_on_foot(side, targets_[side].ankle, standing);
      Figure kneeling = trunk_figure(trunk_at(schedule_.land[side]));
      leg_on_knee(side, kneeling);
      const auto hip = static_cast<std::size_t>(kUpperLeg[side]);
      swing_[side] = {standing.R[hip + 1].transpose() * standing.R[hip + 2],
                      kneeling.R[hip + 1].transpose() * kneeling.R[hip + 2],
                      targets_[side].knee - Vector3d(skeleton_.shank, 0.0, 0.0),
                      (targets_[side].knee - kneeling.p[hip]).normalized()};
    }
    Figure figure = trunk_figure(trunk_at(schedule_.wrist));
    arm_on_wrist(side, Vector3d(-0.3, 0.7 * outward(side), -0.6), figure);
    const auto upper = static_cast<std::size_t>(kUpperArm[side]);
    const Matrix3d elbow =
        figure.R[upper].transpose() * figure.R[upper + 1] *
        AngleAxisd(kPlantedPronation * outward(side), Vector3d::UnitZ()).toRotationMatrix();
    arm_contact_[side] = {sag_lat_yaw(figure.R[kT8].transpose() * figure.R[upper]),
                          -std::atan2(elbow(0, 2), elbow(2, 2)),
                          figure.R[upper + 1].transpose() * figure.R[upper + 2]};
    if (std::isfinite(schedule_.elbow)) {
      elbow_hint_end_[side] = landing_elbow_hint(side);
    }
  }
}

bool ClimbChoreography::lands_on_feet() const {
  return parameters_.style == ClimbStyle::kBearCrawl || parameters_.style == ClimbStyle::kFeetFirst;
}

/// Where the body touches floor and table. The numbers are joint centres for a 1.75 m person.
void ClimbChoreography::place_targets() {
  const double scale = skeleton_.height / kReferenceHeight;
  const double top = parameters_.table_height;
  for (std::size_t side = 0; side < 2; ++side) {
    auto& target = targets_[side];
    const double out = outward(side);
    const double drop = kElbowRadius - kWristRadius;
    const Vector3d wrist(0.600 * scale, out * 0.17 * scale, top + kWristRadius * scale);
    const double inward = 0.03 * scale;  // wrists closer together than elbows
    const double forward = std::sqrt(skeleton_.forearm * skeleton_.forearm - inward * inward -
                                     drop * drop * scale * scale);
    target.wrist = wrist;
    target.elbow = wrist + Vector3d(-forward, out * inward, drop * scale);
    target.knee = {0.03 * scale, out * 0.10 * scale, top + kKneeRadius * scale};
    target.ankle = {-0.04 * scale - skeleton_.toe_reach, out * 0.09 * scale,
                    skeleton_.ankle_height};
    target.ankle_on_top = {0.12 * scale, out * 0.11 * scale, top + skeleton_.ankle_height};
  }
}

void ClimbChoreography::add_key(double t0, double t1, const Trunk& wish) {
  moves_.push_back({t0, t1});
  keys_.emplace_back(t1, keys_.empty() ? wish : settle_key(wish, t1));
}

void ClimbChoreography::plan_trunk() {
  const double s = skeleton_.height / kReferenceHeight;
  keys_.clear();
  moves_.clear();
  add_key(0.0, 0.0,
          trunk(targets_[0].ankle.x() + 0.02 * s, 0.0, skeleton_.hip_height - 0.004 * s, 0, 0, 0, 0,
                0));
  if (lands_on_feet()) {
    plan_stepping_trunk();
  } else {
    plan_kneeling_trunk();
  }
}

/// Onto both feet: the pelvis stays high, over the foot that carries.
void ClimbChoreography::plan_stepping_trunk() {
  const double s = skeleton_.height / kReferenceHeight;
  const double up = parameters_.table_height - 0.35 * s;
  const Schedule& t = schedule_;
  const Trunk hands = trunk(-0.20 * s, 0.0, 0.84 * s + 0.5 * up, 0, 78, 42, 0, 15);
  if (parameters_.style == ClimbStyle::kFeetFirst) {
    const double ankle = targets_[0].ankle.x();
    add_key(1.0, 2.3, trunk(ankle + 0.04 * s, -0.09 * s, 0.90 * s, 0, 2, 0, 0, 0));
    add_key(t.lift[1], t.land[1], trunk(ankle + 0.08 * s, -0.07 * s, 0.89 * s, 0, 10, 5, 0, 5));
    add_key(t.arm_start, t.wrist, hands);
  } else {
    add_key(t.arm_start, t.wrist, hands);
    add_key(t.lift[1] - 1.6, t.lift[1],
            trunk(-0.18 * s, -0.03 * s, 0.86 * s + 0.5 * up, 0, 80, 40, 0, 25));
    add_key(t.lift[1], t.land[1],
            trunk(-0.06 * s, -0.02 * s, 0.86 * s + 0.5 * up, 0, 85, 35, 0, 25));
  }
  add_key(t.lift[0] - 1.6, t.lift[0],
          trunk(0.04 * s, 0.04 * s, 0.85 * s + 0.5 * up, 0, 88, 32, 0, 25));
  add_key(t.lift[0], t.land[0], trunk(0.10 * s, 0.01 * s, 0.95 * s + up, 0, 100, 25, 0, 25));
  add_key(19.0, 20.8, trunk(0.13 * s, 0.0, 0.96 * s + up, 0, 100, 25, 0, 25));
}

void ClimbChoreography::plan_kneeling_trunk() {
  const double s = skeleton_.height / kReferenceHeight;
  // Without elbows the shoulders stay an arm's length above the table.
  const double raised = parameters_.style == ClimbStyle::kHandsOnly ? 15.0 : 0.0;  // deg
  // Heights of the trunk over the table follow the table, those over the floor the legs.
  const double up = parameters_.table_height - 0.35 * s;
  const Schedule& t = schedule_;
  add_key(t.arm_start, t.wrist, trunk(-0.33 * s, 0.0, 0.84 * s, 0, 75, 45, 0, 15));
  add_key(t.elbow_start, kElbowContact,
          trunk(-0.05 * s, 0.0, 0.88 * s + 0.5 * up, 0, 97 - raised, 22, 0, 25));
  add_key(8.6, t.lift[1],
          trunk(0.03 * s, -0.02 * s, 0.895 * s + 0.5 * up, 0, 95 - raised, 23, 0, 25));
  add_key(t.lift[1], t.land[1],
          trunk(0.08 * s, -0.02 * s, 0.85 * s + 0.5 * up, -10, 95 - raised, 24, 8, 25));
  add_key(13.8, t.lift[0],
          trunk(0.09 * s, 0.03 * s, 0.85 * s + 0.5 * up, -10, 95 - raised, 24, 8, 25));
  add_key(t.lift[0], t.land[0],
          trunk(0.03 * s, 0.01 * s, 0.83 * s + up, 0, 90 - raised, 27, 0, 25));
  add_key(19.0, 20.8, trunk(-0.035 * s, 0.0, 0.825 * s + up, 0, 87 - raised, 31, 0, 25));
}

Figure ClimbChoreography::trunk_figure(const Trunk& x) const {
  Figure figure;
  figure.R.fill(Matrix3d::Identity());
  figure.p.fill(Vector3d::Zero());
  figure.p[kPelvis] = x.head<3>();
  figure.R[kPelvis] = pelvis_rotation(x);
  const Matrix3d vertebra =
      (AngleAxisd(x[6] / 4.0, Vector3d::UnitY()) * AngleAxisd(x[7] / 4.0, Vector3d::UnitX()) *
       AngleAxisd(x[8] / 4.0, Vector3d::UnitZ()))
          .toRotationMatrix();
  for (std::size_t i = kL5; i <= kT8; ++i) figure.R[i] = figure.R[i - 1] * vertebra;
  const Matrix3d neck = AngleAxisd(-x[9] / 2.0, Vector3d::UnitY()).toRotationMatrix();
  figure.R[kNeck] = figure.R[kT8] * neck;
  figure.R[kHead] = figure.R[kNeck] * neck;
  figure.R[kRightShoulder] = figure.R[kLeftShoulder] = figure.R[kT8];
  place_segments(skeleton_, figure);
  return figure;
}

/// Lengths that what is planted at `time` asks of the trunk: shoulder to elbow, hip to knee.
Eigen::VectorXd ClimbChoreography::contact_errors(const Trunk& trunk, double time) const {
  const Figure figure = trunk_figure(trunk);
  Eigen::VectorXd errors(4);
  int n = 0;
  for (std::size_t side = 0; side < 2; ++side) {
    if (time >= schedule_.elbow) {
      const auto& shoulder = figure.p[static_cast<std::size_t>(kUpperArm[side])];
      errors[n++] = (targets_[side].elbow - shoulder).norm() - skeleton_.upper_arm;
    }
    if (time >= schedule_.land[side] && !lands_on_feet()) {
      const auto& hip = figure.p[static_cast<std::size_t>(kUpperLeg[side])];
      errors[n++] = (targets_[side].knee - hip).norm() - skeleton_.thigh;
    }
  }
  return errors.head(n);
}

/// By how much hands and feet that rest at `time` are out of reach (negative: within).
Eigen::VectorXd ClimbChoreography::reach_errors(const Trunk& trunk, double time) const {
  const Figure figure = trunk_figure(trunk);
  Eigen::VectorXd errors(4);
  int n = 0;
  for (std::size_t side = 0; side < 2; ++side) {
    if (time >= schedule_.wrist && time < schedule_.elbow) {
      const auto& shoulder = figure.p[static_cast<std::size_t>(kUpperArm[side])];
      errors[n++] = (targets_[side].wrist - shoulder).norm() -
                    kMostReach * (skeleton_.upper_arm + skeleton_.forearm);
    }
    const bool on_top = lands_on_feet() && time >= schedule_.land[side];
    if (time <= schedule_.lift[side] || on_top) {
      const auto& hip = figure.p[static_cast<std::size_t>(kUpperLeg[side])];
      const Vector3d& ankle = on_top ? targets_[side].ankle_on_top : targets_[side].ankle;
      errors[n++] = (ankle - hip).norm() - kMostReach * (skeleton_.thigh + skeleton_.shank);
    }
  }
  return errors.head(n);
}

/// The trunk pose nearest to `wish` that meets the errors' equations: Newton steps, each the
/// least change measured from the wish, not from the last iterate.
template <typename Errors>
ClimbChoreography::Trunk ClimbChoreography::project(const Trunk& wish, const Errors& errors) {
  Trunk mobility;  // how readily each coordinate gives way; the neck does not take part
  mobility << 1, 0.5, 1, 0.3, 1, 0.3, 1, 0.1, 0.3, 0;
  Trunk x = wish;
  for (int iteration = 0; iteration < 20; ++iteration) {
    const Eigen::VectorXd error = errors(x);
    if (error.size() == 0 || error.cwiseAbs().maxCoeff() < 1e-11) break;
    Eigen::MatrixXd J(error.size(), x.size());
    constexpr double kStep = 1e-6;
    for (int i = 0; i < x.size(); ++i) {
      Trunk ahead = x, behind = x;
      ahead[i] += kStep;
      behind[i] -= kStep;
      J.col(i) = (errors(ahead) - errors(behind)) / (2.0 * kStep);
    }
    const Eigen::MatrixXd WJt = mobility.asDiagonal() * J.transpose();
    const Eigen::VectorXd goal = -error + J * (x - wish);
    x = wish + WJt * (J * WJt).ldlt().solve(goal);
  }
  return x;
}

ClimbChoreography::Trunk ClimbChoreography::settle(const Trunk& wish, double time) const {
  return project(wish, [&](const Trunk& x) { return contact_errors(x, time); });
}

/// settle() for a key pose: hands and feet that would be out of reach are brought within it, one
/// after the other. Between keys this is not done, because a bound that takes hold would jerk.
ClimbChoreography::Trunk ClimbChoreography::settle_key(const Trunk& wish, double time) const {
  std::vector<Eigen::Index> bound;
  for (;;) {
    const Trunk x = project(wish, [&](const Trunk& trial) {
      const Eigen::VectorXd contacts = contact_errors(trial, time);
      const Eigen::VectorXd reach = reach_errors(trial, time);
      Eigen::VectorXd all(contacts.size() + std::ssize(bound));
      all.head(contacts.size()) = contacts;
      for (std::size_t i = 0; i < bound.size(); ++i) {
        all[contacts.size() + static_cast<Eigen::Index>(i)] = reach[bound[i]];
      }
      return all;
    });
    const Eigen::VectorXd reach = reach_errors(x, time);
    Eigen::Index worst = 0;
    if (reach.size() == 0 || reach.maxCoeff(&worst) < 1e-9 ||
        std::find(bound.begin(), bound.end(), worst) != bound.end()) {
      return x;
    }
    bound.push_back(worst);
  }
}

ClimbChoreography::Trunk ClimbChoreography::trunk_at(double time) const {
  Track<Trunk> track(keys_.front().second);
  for (std::size_t i = 1; i < keys_.size(); ++i) {
    track.add(moves_[i][0], moves_[i][1], keys_[i].second);
  }
  return settle(track.at(time), time);
}

Vector3d ClimbChoreography::landing_elbow_hint(std::size_t side) const {
  const Figure figure = trunk_figure(trunk_at(schedule_.elbow));
  return (targets_[side].elbow - figure.p[static_cast<std::size_t>(kUpperArm[side])]).normalized();
}

void ClimbChoreography::arm_on_wrist(std::size_t side, const Vector3d& hint, Figure& figure) const {
  const auto upper = static_cast<std::size_t>(kUpperArm[side]);
  const Vector3d& shoulder = figure.p[upper];
  const Vector3d& wrist = targets_[side].wrist;
  const Vector3d elbow =
      middle_joint(shoulder, wrist, skeleton_.upper_arm, skeleton_.forearm, hint);
  const LimbPose limb = limb_from_points(shoulder, elbow, wrist, Hinge::kElbow);
  figure.R[upper] = limb.R_upper;
  figure.R[upper + 1] =
      limb.R_lower *
      AngleAxisd(-outward(side) * kPlantedPronation, Vector3d::UnitZ()).toRotationMatrix();
  figure.R[upper + 2] = flat_hand();
}

void ClimbChoreography::pose_arm(std::size_t side, double time, Figure& figure) const {
  const auto upper = static_cast<std::size_t>(kUpperArm[side]);
  if (time >= schedule_.elbow) {
    // Both ends of the forearm rest: the hint towards the planted elbow reproduces it exactly.
    arm_on_wrist(side, targets_[side].elbow - figure.p[upper], figure);
    return;
  }
  if (time >= schedule_.wrist) {
    if (!std::isfinite(schedule_.elbow)) {
      arm_on_wrist(side, Vector3d(-0.3, 0.7 * outward(side), -0.6), figure);
      return;
    }
    const double share =
        smooth_step((time - schedule_.elbow_start) / (schedule_.elbow - schedule_.elbow_start));
    const Vector3d start = Vector3d(-0.3, 0.7 * outward(side), -0.6).normalized();
    arm_on_wrist(side, start + share * (elbow_hint_end_[side] - start), figure);
    return;
  }
  const double s = (time - schedule_.arm_start) / (schedule_.wrist - schedule_.arm_start);
  const double share = smooth_step(s);
  const Vector3d rest(2.0 * kDeg, outward(side) * 4.0 * kDeg, 0.0);
  const Vector3d root = rest + share * (arm_contact_[side].shoulder - rest);
  const double rest_flexion = 8.0 * kDeg;
  const double flexion = rest_flexion + share * (arm_contact_[side].elbow - rest_flexion) +
                         smooth_bump(s) * kReachElbowFlexion;
  const double pronation = kRestPronation + share * (kPlantedPronation - kRestPronation);
  figure.R[upper] = figure.R[kT8] * from_sag_lat_yaw(root);
  figure.R[upper + 1] =
      figure.R[upper] * AngleAxisd(-flexion, Vector3d::UnitY()).toRotationMatrix() *
      AngleAxisd(-outward(side) * pronation, Vector3d::UnitZ()).toRotationMatrix();
  const Quaterniond hand =
      Quaterniond::Identity().slerp(share, Quaterniond(arm_contact_[side].R_hand));
  figure.R[upper + 2] = figure.R[upper + 1] * hand.toRotationMatrix();
}

void ClimbChoreography::leg_on_foot(std::size_t side, const Vector3d& ankle, Figure& figure) const {
  const auto upper = static_cast<std::size_t>(kUpperLeg[side]);
  const Vector3d& hip = figure.p[upper];
  const Vector3d knee = middle_joint(hip, ankle, skeleton_.thigh, skeleton_.shank, knee_hint(side));
  const LimbPose limb = limb_from_points(hip, knee, ankle, Hinge::kKnee);
  figure.R[upper] = limb.R_upper;
  figure.R[upper + 1] = limb.R_lower;
  figure.R[upper + 2] = figure.R[upper + 3] = Matrix3d::Identity();
}

void ClimbChoreography::leg_on_knee(std::size_t side, Figure& figure) const {
  const auto upper = static_cast<std::size_t>(kUpperLeg[side]);
  const Vector3d& knee = targets_[side].knee;
  const LimbPose limb =
      limb_from_points(figure.p[upper], knee, knee - Vector3d::UnitX(), Hinge::kKnee);
  figure.R[upper] = limb.R_upper;
  figure.R[upper + 1] = limb.R_lower;
  figure.R[upper + 2] =
      limb.R_lower * AngleAxisd(kKneelingPlantarFlexion, Vector3d::UnitY()).toRotationMatrix();
  figure.R[upper + 3] = figure.R[upper + 2];
}

void ClimbChoreography::leg_in_swing(std::size_t side, double s, Figure& figure) const {
  const auto upper = static_cast<std::size_t>(kUpperLeg[side]);
  const Swing& swing = swing_[side];
  const double share = smooth_step(s);
  const double scale = skeleton_.height / kReferenceHeight;
  const Vector3d& start = targets_[side].ankle;
  const Vector3d ankle = start + share * (swing.ankle_end - start) +
                         smooth_bump(s) * scale * Vector3d(-kSwingBack, 0.0, kSwingUp);
  const Vector3d hint = knee_hint(side) + share * (swing.hint_end - knee_hint(side));
  const Vector3d& hip = figure.p[upper];
  const Vector3d knee = middle_joint(hip, ankle, skeleton_.thigh, skeleton_.shank, hint);
  const LimbPose limb = limb_from_points(hip, knee, ankle, Hinge::kKnee);
  figure.R[upper] = limb.R_upper;
  figure.R[upper + 1] = limb.R_lower;
  const double turn = smooth_step((s - kFootTurnStart) / (1.0 - kFootTurnStart));
  const Quaterniond foot =
      Quaterniond(swing.R_foot_start).slerp(turn, Quaterniond(swing.R_foot_end));
  figure.R[upper + 2] = figure.R[upper + 3] = figure.R[upper + 1] * foot.toRotationMatrix();
}

/// A step up: the foot stays level.
void ClimbChoreography::step_in_swing(std::size_t side, double s, Figure& figure) const {
  const SideTargets& target = targets_[side];
  const double scale = skeleton_.height / kReferenceHeight;
  // Up before forward, so that the toes pass over the edge.
  Vector3d ankle = target.ankle;
  ankle.head<2>() +=
      smooth_step((s - 0.25) / 0.75) * (target.ankle_on_top - target.ankle).head<2>();
  ankle.z() += smooth_step(s / 0.75) * (target.ankle_on_top - target.ankle).z() +
               smooth_bump(s) * kStepUp * scale;
  leg_on_foot(side, ankle, figure);
}

void ClimbChoreography::pose_leg(std::size_t side, double time, Figure& figure) const {
  const double lift = schedule_.lift[side];
  const double land = schedule_.land[side];
  const double share = (time - lift) / (land - lift);
  if (time <= lift) {
    leg_on_foot(side, targets_[side].ankle, figure);
  } else if (lands_on_feet()) {
    step_in_swing(side, std::min(share, 1.0), figure);
  } else if (time < land) {
    leg_in_swing(side, share, figure);
  } else {
    leg_on_knee(side, figure);
  }
}

Figure ClimbChoreography::at(double time) const {
  Figure figure = trunk_figure(trunk_at(time));
  for (std::size_t side = 0; side < 2; ++side) {
    pose_arm(side, time, figure);
    pose_leg(side, time, figure);
  }
  place_segments(skeleton_, figure);
  return parameters_.right_first ? mirrored(figure) : figure;
}

}  // namespace clamber::tools
