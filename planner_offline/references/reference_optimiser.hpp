// Reference optimisation: contact positions a robot can reach and be supported by (paper IV-C).
// Any thread (one ReferenceOptimiser each); allocates; never blocks.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "planner_offline/certify/torque_relief.hpp"
#include "planner_offline/contacts/contact_sequence.hpp"
#include "planner_offline/settings.hpp"

namespace clamber {

/// One iteration of Eq. (11), for the log.
struct CostSample {
  int state = 0;
  int phase = 1;  ///< 1: reach (w1), 2: support (w2), 3: torque relief (cost: its measure)
  int iteration = 0;
  double cost = 0.0;      ///< L(X), Eq. (10), summed over the links
  double ik_error = 0.0;  ///< m
};

/// New contacts made on the robot: the posture in which they touch and do not carry yet.
struct TouchKeyframe {
  Configuration x;
  ContactSet contacts;  ///< everything that carries: obstacle and floor
  std::map<int, Eigen::Vector3d>
      positions;                    ///< link -> optimised reference on its surface, world, m
  std::map<int, double> theta_deg;  ///< link -> angle of Fig. 5 at the end
  ForceSolution forces;    ///< with the supports alone: what it takes before the new contacts carry
  double ik_error = 0.0;   ///< m
  std::string problem;     ///< empty: realisable
  double shortfall = 0.0;  ///< m by which it is not (a nominal length for balance and torque)
};

class ReferenceOptimiser {
 public:
  ReferenceOptimiser(const RobotModel& model, const Scenario& scenario, const Clearance& clearance,
                     const PlannerSettings& settings);

  /// The posture stands on `supports` alone, with the support margin, while the new contacts touch.
  /// @param start     where the search starts from (the previous keyframe)
  /// @param supports  contacts that stay as they are: the common support links
  /// @param wanted    new contacts: link -> X_i^o, initial reference in the world
  /// @param completes_limb  those of `wanted` that must support their limb in this state (the
  ///                        others get a second contact of the same limb, e.g. wrist, then elbow)
  /// @param hint      posture hint from the recording
  [[nodiscard]] TouchKeyframe optimise(int state, const Configuration& start,
                                       const ContactSet& supports,
                                       const std::map<int, Eigen::Vector3d>& wanted,
                                       const std::set<int>& completes_limb, int surface,
                                       const JointVector& hint);

  [[nodiscard]] const std::vector<CostSample>& log() const { return log_; }
  /// Wall time spent in optimise() so far, s.
  [[nodiscard]] double seconds() const { return seconds_; }

 private:
  struct Search;
  [[nodiscard]] double solve_posture(Search& search, int iterations, bool collisions = true);
  void reach_phase(Search& search);
  void support_phase(Search& search);
  void relieve_torque(Search& search);
  void start_from_hint(Search& search) const;
  [[nodiscard]] TouchKeyframe finish(Search& search);
  [[nodiscard]] Eigen::Vector3d bounded(const Eigen::Vector3d& p, int surface) const;
  [[nodiscard]] double theta(const RobotData& data, int link) const;
  [[nodiscard]] Eigen::Vector3d support_projection(const RobotData& data, int link,
                                                   double height) const;
  [[nodiscard]] bool limb_is_supported(const Search& search, int link) const;

  const RobotModel& model_;
  const Scenario& scenario_;
  PlannerSettings settings_;
  const Clearance& clearance_;
  PostureIk ik_;
  ContactForces forces_;
  TorqueRelief relief_;
  std::vector<CostSample> log_;
  double seconds_ = 0.0;
};

}  // namespace clamber
