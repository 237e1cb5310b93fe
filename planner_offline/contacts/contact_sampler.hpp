// Finds the robot's contacts with an obstacle and the floor in one posture, by FCL (paper III-C).
// One thread per sampler; allocates; never blocks.
#pragma once

#include <memory>

#include "planner_offline/contacts/contact_states.hpp"
#include "planner_offline/contacts/stability.hpp"
#include "robot_model/kinematics.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

/// The obstacle's edge frame in the world: origin on the upper front edge at its middle, x inwards,
/// y to the left, z up. ContactReference::position is in this frame.
[[nodiscard]] Pose edge_frame(const ObstacleBox& box);

struct SamplerConfig {
  /// A link this near to a surface is in contact, m (a human's soft tissue and the playback's
  /// compliance leave gaps of this size).
  double threshold = 0.012;
  /// A link on the obstacle stays there until it is this far above the top face, m: a forearm that
  /// rests on its elbow lets its wrist hover about the threshold for seconds, as the drives give
  /// way, which is one contact and not many. Touch begins at the threshold all the same, so that a
  /// limb that only passes near makes none.
  double release = 0.018;
  StabilityConfig stability;
};

class ContactSampler {
 public:
  ContactSampler(const RobotModel& model, const ObstacleBox& box, const SamplerConfig& config);
  ~ContactSampler();
  ContactSampler(const ContactSampler&) = delete;
  ContactSampler& operator=(const ContactSampler&) = delete;

  /// FCL's distance of a geom to the obstacle, m; 0 when they touch or overlap (FCL 0.7 has no
  /// dependable depth for a capsule in a box: it answers -1).
  /// @param geom index into RobotModel::geoms
  /// @param data after forward_kinematics()
  [[nodiscard]] double distance(int geom, const RobotData& data) const;

  /// All of the robot's links against the obstacle, its contact links against the floor (z = 0)
  /// too. A contact link near the obstacle is a contact if it is the top face that it meets: the
  /// direction from the nearest point of the obstacle is less than 45 degrees off the vertical.
  /// The knee of a leg that stands upright on its foot on the floor is none.
  /// A limb that is on the obstacle stands there: its foot, about to leave the floor, widens the
  /// hull of support but is not listed under `floor`. Whatever else touches the obstacle (front
  /// face, shank, forearm, torso) goes to `others`.
  /// @param before the sample before this one: what it shows on the obstacle lasts until `release`
  [[nodiscard]] ContactSample sample(double time, const Configuration& x,
                                     const ContactSample* before = nullptr) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clamber
