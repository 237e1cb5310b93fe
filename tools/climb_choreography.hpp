// The made-up climb: a person gets onto a table with wrists, elbows, left knee, right knee, or in
// another way.
// Tools only; allocates; never blocks.
#pragma once

#include <Eigen/Core>
#include <array>
#include <utility>
#include <vector>

#include "tools/human_figure.hpp"

namespace clamber::tools {

enum class ClimbStyle {
  kAllFours,   ///< wrists, elbows, one knee, the other: the paper's
  kHandsOnly,  ///< the same without elbows
  kBearCrawl,  ///< wrists, one foot, the other: no knees
  kFeetFirst,  ///< one foot, wrists, the other foot
};

struct ClimbParameters {
  double body_height = 1.75;   ///< m
  double table_height = 0.35;  ///< m
  ClimbStyle style = ClimbStyle::kAllFours;
  bool right_first = false;  ///< the right leg goes up before the left: all of it mirrored
};

/// Poses over time. World: x = 0 is the table's front edge, the table lies at x > 0, z up from the
/// floor. Key poses are given as trunk pose and places of hands, elbows, knees and feet; the limbs
/// follow by inverse kinematics, and between the keys everything moves C2-continuously.
class ClimbChoreography {
 public:
  /// Times of first contact, s.
  static constexpr double kWristContact = 4.5;
  static constexpr double kElbowContact = 7.8;
  static constexpr double kLeftLift = 10.2;
  static constexpr double kLeftKneeContact = 13.0;
  static constexpr double kRightLift = 15.4;
  static constexpr double kRightKneeContact = 18.2;
  static constexpr double kDuration = 22.0;
  /// When what moves. Legs: index 0 the second one to go up (the right), 1 the first.
  struct Schedule {
    double arm_start = 1.0;  ///< s, arms and trunk leave the standing pose
    double wrist = kWristContact;
    double elbow_start = 5.2;      ///< s, the elbows begin to come down
    double elbow = kElbowContact;  ///< infinite: never
    std::array<double, 2> lift{kRightLift, kLeftLift};
    std::array<double, 2> land{kRightKneeContact, kLeftKneeContact};
  };

  /// @throws std::invalid_argument when the person cannot reach a key pose
  explicit ClimbChoreography(const ClimbParameters& parameters);

  [[nodiscard]] Figure at(double time) const;
  [[nodiscard]] const Skeleton& skeleton() const { return skeleton_; }

  /// Trunk: pelvis position (3), pelvis yaw, pitch, roll; spine bend forward, lean right, turn
  /// left; neck bent back. m and rad.
  using Trunk = Eigen::Matrix<double, 10, 1>;

 private:
  struct SideTargets {
    Eigen::Vector3d wrist, elbow, knee, ankle;  ///< where they touch (joint centres), m
    Eigen::Vector3d ankle_on_top;
  };
  /// The arm at the wrist's first contact, relative to the chest.
  struct ArmContact {
    Eigen::Vector3d shoulder;  ///< sag, lat, yaw, rad
    double elbow = 0.0;        ///< flexion, rad
    Eigen::Matrix3d R_hand;    ///< hand in the forearm
  };
  /// A leg on its way from the foot to the knee.
  struct Swing {
    Eigen::Matrix3d R_foot_start;  ///< foot in the shank
    Eigen::Matrix3d R_foot_end;
    Eigen::Vector3d ankle_end;  ///< m
    Eigen::Vector3d hint_end;   ///< from the hip towards the planted knee
  };

  void place_targets();
  void plan_trunk();
  void plan_kneeling_trunk();
  void plan_stepping_trunk();
  void add_key(double t0, double t1, const Trunk& wish);
  [[nodiscard]] bool lands_on_feet() const;
  [[nodiscard]] Trunk settle(const Trunk& wish, double time) const;
  [[nodiscard]] Figure trunk_figure(const Trunk& trunk) const;
  [[nodiscard]] Trunk settle_key(const Trunk& wish, double time) const;
  template <typename Errors>
  [[nodiscard]] static Trunk project(const Trunk& wish, const Errors& errors);
  [[nodiscard]] Eigen::VectorXd contact_errors(const Trunk& trunk, double time) const;
  [[nodiscard]] Eigen::VectorXd reach_errors(const Trunk& trunk, double time) const;
  void pose_arm(std::size_t side, double time, Figure& figure) const;
  void pose_leg(std::size_t side, double time, Figure& figure) const;
  void arm_on_wrist(std::size_t side, const Eigen::Vector3d& hint, Figure& figure) const;
  void leg_on_foot(std::size_t side, const Eigen::Vector3d& ankle, Figure& figure) const;
  void step_in_swing(std::size_t side, double share, Figure& figure) const;
  void leg_on_knee(std::size_t side, Figure& figure) const;
  void leg_in_swing(std::size_t side, double share, Figure& figure) const;
  [[nodiscard]] Trunk trunk_at(double time) const;
  [[nodiscard]] Eigen::Vector3d landing_elbow_hint(std::size_t side) const;

  ClimbParameters parameters_;
  Schedule schedule_;
  Skeleton skeleton_;
  std::array<SideTargets, 2> targets_;
  std::vector<std::pair<double, Trunk>> keys_;
  std::vector<std::array<double, 2>> moves_;
  std::array<ArmContact, 2> arm_contact_;
  std::array<Swing, 2> swing_;
  std::array<Eigen::Vector3d, 2> elbow_hint_end_;
};

}  // namespace clamber::tools
