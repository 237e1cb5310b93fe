// Clearance of a posture to floor, obstacles and itself, and the collision constraints of Eq. (9).
// Any thread; allocates; never blocks.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "planner_offline/clearance/signed_distance.hpp"
#include "planner_offline/contacts/contact.hpp"

namespace clamber {

/// How far the obstacle may be from where the plan has it, seen from the robot.
struct ObstacleElsewhere {
  double position = 0.0;  ///< m, in any direction of the plane, and
  double yaw = 0.0;       ///< rad about the start, either way, and
  double height = 0.0;    ///< m, higher

  [[nodiscard]] bool any() const noexcept { return position > 0.0 || yaw > 0.0 || height > 0.0; }
};

struct ClearanceSettings {
  double obstacle = 0.012;  ///< m, links not in contact to obstacle and floor (10-15 mm in a swing)
  double lying = 0.002;     ///< m, of a body that lies down on two contact links (a forearm)
  double landing = 0.004;  ///< m, of another body whose contact link rests or lands on that surface
  double self = 0.008;     ///< m, between the robot's own links
  ObstacleElsewhere elsewhere;
  double spare = 0.006;      ///< m, instead of `obstacle`, to the obstacle grown by `elsewhere`
  double activation = 0.10;  ///< m, nearer pairs become rows of the inverse kinematics
};

/// The same for the obstacle where the plan has it.
[[nodiscard]] ClearanceSettings where_it_is(ClearanceSettings settings);

/// C dv >= d, the form the hierarchical QP takes.
struct Inequalities {
  Eigen::MatrixXd C;
  Eigen::VectorXd d;
};
void append(Inequalities& rows, const Eigen::RowVectorXd& C, double d);

struct ClearanceReport {
  double obstacle = 0.0;         ///< m, smallest over links that are not meant to touch
  double obstacle_excess = 0.0;  ///< m, smallest distance less the margin asked for
  double self = 0.0;             ///< m
  double self_excess = 0.0;      ///< m, the same of the robot's own links
  std::string worst_obstacle_pair;
  std::string worst_self_pair;
};

class Clearance {
 public:
  Clearance(const RobotModel& model, const Scenario& scenario, const ClearanceSettings& settings);

  /// One row per near pair: the gap may close no further than its margin. `landing`: contact links
  /// on their way to a surface, whose limbs get the smaller margin as they come near it.
  /// `may_recover`: where a margin is violated, ask for (bounded) separation.
  void constrain(const RobotData& data, const ContactSet& contacts, const std::vector<int>& landing,
                 bool may_recover, Inequalities& rows) const;

  [[nodiscard]] ClearanceReport report(const RobotData& data, const ContactSet& contacts,
                                       const std::vector<int>& landing) const;

 private:
  struct Near {
    Distance distance;
    double margin;
    int body_a, body_b;  // body_b < 0: the world
    int geom_a, geom_b;
  };
  void find_near(const RobotData& data, const ContactSet& contacts, const std::vector<int>& landing,
                 double within, std::vector<Near>& found) const;
  /// What a link does with the obstacles. One that lands may meet one that is elsewhere from above.
  enum class Role : unsigned char { kFree, kLands, kRests };
  [[nodiscard]] Role role_of(int geom, const ContactSet& contacts,
                             const std::vector<int>& landing) const noexcept;
  /// The obstacle higher by `up`, and each side farther out by how far any point of the link may be
  /// displaced towards it. What stays clear of that hits it nowhere in between.
  [[nodiscard]] Solid grown(const Solid& obstacle, const Solid& link, double up) const noexcept;
  [[nodiscard]] double environment_margin(const RobotData& data, int geom, int surface,
                                          const ContactSet& contacts,
                                          const std::vector<int>& landing) const;

  /// Margin of a body's links to a surface that a contact link of the same body rests or lands on.
  [[nodiscard]] double margin_near_contact(int body) const;

  const RobotModel& model_;
  ClearanceSettings settings_;
  Eigen::Vector3d start_;  ///< mid-point between the soles
  std::vector<Solid> obstacles_;
  std::vector<double> heights_;
  std::vector<int> contact_of_geom_;  // contact link whose geom it is, or -1
};

}  // namespace clamber
