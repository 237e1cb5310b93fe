// The robot's tree: const after loading, shared by every room.
// Any thread (read only); the vectors are filled once at load time.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "robot_model/types.hpp"

namespace clamber {

/// A movable body: a URDF link with everything that is fixed to it merged in. Body 0 is the base;
/// body i + 1 is moved by joint i. A parent's index is smaller than its child's.
struct Body {
  std::string name;
  int parent = -1;       ///< body index, -1 for the base
  Pose X_PJ;             ///< joint frame at q = 0 in the parent body's frame
  Eigen::Vector3d axis;  ///< joint axis in the joint frame (unit); unused for the base
  double mass = 0.0;     ///< kg
  Eigen::Vector3d com = Eigen::Vector3d::Zero();      ///< in the body frame, m
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  ///< at the centre of mass, body axes, kg m^2
};

struct Joint {
  std::string name;
  double lower = 0.0;                   ///< rad
  double upper = 0.0;                   ///< rad
  double velocity_limit = 0.0;          ///< rad/s
  double torque_limit = 0.0;            ///< N m: what a plan may use (the robot file's figure)
  double drive_torque_limit = 0.0;      ///< N m: where the drive saturates (the URDF's effort)
  double reflected_inertia = 0.0;       ///< kg m^2, rotor behind the gear
  double damping = 0.0;                 ///< N m s/rad
  double friction = 0.0;                ///< N m, dry; of no file, see sim_backend/perturbation.hpp
  double spring_stiffness = 0.0;        ///< N m/rad between motor and link, 0: rigid
  double spring_damping = 0.0;          ///< N m s/rad, beside the spring
  double kp = 0.0, ki = 0.0, kd = 0.0;  ///< default position gains: N m/rad, N m/(rad s), N m s/rad
};

/// A named frame fixed to a body (every URDF link and fixed-joint child is one).
struct Frame {
  std::string name;
  int body = 0;
  Pose X_BF;
};

enum class Shape { kSphere, kCapsule, kBox };

/// A collision primitive fixed to a body. Capsule: axis along z of its own frame, from -length/2 to
/// +length/2, plus hemispherical caps of the radius.
struct Geom {
  std::string name;  ///< "<link>/<n>" or the collision element's own name
  std::string link;  ///< the URDF link it belongs to
  int body = 0;
  Shape shape = Shape::kSphere;
  Pose X_BG;
  double radius = 0.0;                                     ///< sphere, capsule (m)
  double length = 0.0;                                     ///< capsule axis (m)
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  ///< box (m)
};

/// A part of the robot that may carry weight: wrist, elbow, knee (one point: the geom's sphere) or
/// foot (the corners of the geom's sole).
struct ContactLink {
  std::string name;  ///< as in the paper: Lwrist, Rwrist, Lelb, Relb, Lknee, Rknee, Lfoot, Rfoot
  int body = 0;
  int geom = 0;
  std::string limb;       ///< contacts of one limb share this name (left_arm ...)
  bool is_patch = false;  ///< true: four sole corners and an orientation; false: a point
  std::vector<Eigen::Vector3d> points;  ///< body frame, m: sphere centre, or the sole's corners
  double radius = 0.0;   ///< sphere radius (0 for a patch): the surface lies radius below the point
  int support_body = 0;  ///< shoulder or upper thigh (paper IV-B): S in Eq. (10)
  Eigen::Vector3d support_point = Eigen::Vector3d::Zero();  ///< in support_body's frame, m
  double support_length =
      0.0;  ///< l in Eq. (8): length from contact to support mass, limb straight, m
};

class RobotModel {
 public:
  std::string name;
  std::string hash;  ///< SHA-256 of the files it was loaded from, hex
  std::vector<Body> bodies;
  std::vector<Joint> joints;
  std::vector<Frame> frames;
  std::vector<Geom> geoms;
  std::vector<ContactLink> contacts;
  std::vector<std::pair<int, int>> collision_pairs;  ///< geom indices checked for self-collision
  std::vector<std::pair<int, int>> planner_pairs;    ///< geom indices of Eq. (9)'s three groups
  std::vector<int> forbidden_geoms;                  ///< torso and pelvis: must not carry the robot
  JointVector home;                                  ///< a standing posture, rad
  double total_mass = 0.0;                           ///< kg, ballast included
  double ballast_mass = 0.0;                         ///< kg added by the robot file

  [[nodiscard]] int joint_count() const { return static_cast<int>(joints.size()); }
  [[nodiscard]] int velocity_count() const { return 6 + joint_count(); }
  /// Index by name, or nothing. Start-up only (linear search).
  [[nodiscard]] std::optional<int> find_joint(std::string_view joint) const;
  [[nodiscard]] std::optional<int> find_frame(std::string_view frame) const;
  [[nodiscard]] std::optional<int> find_contact(std::string_view contact) const;
  [[nodiscard]] std::optional<int> find_geom(std::string_view geom) const;
};

}  // namespace clamber
