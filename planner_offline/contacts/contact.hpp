// A contact the planner holds: which link rests how on which surface.
// Any thread; allocates; never blocks.
#pragma once

#include <vector>

#include "planner_offline/ik/task.hpp"
#include "robot_model/kinematics.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

enum class ContactMode {
  kPoint,  ///< a sphere: rolls without slipping
  kPatch,  ///< a sole: six coordinates held
  kToe,    ///< a sole relaxed to its front edge: may roll over it (paper IV-D: a contact that does
           ///< not appear in the next state is relaxed)
};

inline constexpr int kFloor = -1;

struct Contact {
  int link = 0;          ///< index into RobotModel::contacts
  int surface = kFloor;  ///< kFloor or index into Scenario::obstacles
  ContactMode mode = ContactMode::kPoint;
  double height = 0.0;  ///< where the contact is sought: the surface, less what it is pressed in, m
  Pose anchor;          ///< patch and toe: the body's pose when it was placed
  /// Point: how far the sphere has slid instead of rolled (track_slip()); the task takes it back,
  /// m.
  Eigen::Vector2d slip = Eigen::Vector2d::Zero();
};

using ContactSet = std::vector<Contact>;

/// The contact that `link` would make now on `surface`.
[[nodiscard]] Contact make_contact(const RobotModel& model, const Scenario& scenario,
                                   const RobotData& data, int link, int surface);

/// Where the contact touches, in the world: one point, the sole's corners, or its front corners.
[[nodiscard]] std::vector<Eigen::Vector3d> contact_points(const RobotModel& model,
                                                          const RobotData& data,
                                                          const Contact& contact);

/// The points of all contacts.
[[nodiscard]] std::vector<Eigen::Vector3d> contact_points(const RobotModel& model,
                                                          const RobotData& data,
                                                          const ContactSet& contacts);

/// Rows that keep the contact: a point rolls (the material point at the bottom does not move), its
/// height and a patch's pose are corrected.
[[nodiscard]] Task contact_task(const RobotModel& model, const RobotData& data,
                                const Contact& contact);

/// The rows of all contacts.
[[nodiscard]] Task contact_tasks(const RobotModel& model, const RobotData& data,
                                 const ContactSet& contacts);

/// Adds to every point's `slip` what it slid from one posture to the next: steps are finite, and
/// rows that hold velocities let a little through each time.
void track_slip(const RobotModel& model, const RobotData& before, const RobotData& after,
                ContactSet& contacts);

/// Lowest point of a contact link's sphere, or the sole's centre: what touches the surface.
[[nodiscard]] Eigen::Vector3d touch_point(const RobotModel& model, const RobotData& data, int link);

/// True when only patches (feet) carry.
[[nodiscard]] bool only_patches(const RobotModel& model, const ContactSet& contacts);

/// Presses the outer contact of every limb that rests on two (wrist and elbow) `depth` below its
/// surface: the joints' compliance then loads it, whatever millimetre the inner one gives.
void press_outer_contacts(const RobotModel& model, const Scenario& scenario, double depth,
                          ContactSet& contacts);

/// The same part on the other side: equal geometry class, other limb.
[[nodiscard]] bool are_a_pair(const RobotModel& model, int a, int b);

/// Whether another contact of the same limb is held.
[[nodiscard]] bool holds_limb(const RobotModel& model, const ContactSet& contacts, int link);
[[nodiscard]] ContactSet without(const ContactSet& contacts, const std::vector<int>& links);

/// The point of the surface nearest to p that is `margin` (m) inside of its edges.
[[nodiscard]] Eigen::Vector3d inside_surface(const Scenario& scenario, int surface,
                                             const Eigen::Vector3d& p, double margin);

/// Surface height: 0 for the floor, the top of the obstacle otherwise.
[[nodiscard]] double surface_height(const Scenario& scenario, int surface);

}  // namespace clamber
