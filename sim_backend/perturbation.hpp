// How a world differs from its model and scenario: masses, obstacle, start pose, drives, sensors.
// Any thread; allocates; blocks: never.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "robot_model/model.hpp"
#include "sim_backend/ode_bus.hpp"
#include "sim_backend/ode_world.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

/// Half widths of uniform distributions around the nominal value, or a range from one to another.
struct PerturbationRange {
  double mass = 0.05;  ///< share of every body's mass and inertia
  double com = 0.005;  ///< m, every body's centre of mass, per axis
  double low_friction = 0.5, high_friction = 1.0;
  double height = 0.01;              ///< m, of the first obstacle
  double start_position = 0.02;      ///< m, per axis
  double start_yaw = 0.0349;         ///< rad
  double joint_friction = 1.0;       ///< N m, dry, of every joint, from 0
  double torque_constant = 0.05;     ///< share, every drive
  double encoder_resolution = 1e-4;  ///< rad, from 0
  double encoder_noise = 1e-4;       ///< rad, from 0
  double delay = 0.002;              ///< s, from 0
};

/// One draw. Vectors are empty or of the model's size; what is left at its default changes nothing.
struct Perturbation {
  std::uint64_t seed = 0;
  std::vector<double> mass;                  ///< factor per body
  std::vector<Eigen::Vector3d> com;          ///< m, added per body, in its axes
  double friction = 0.0;                     ///< of every surface; 0: the scenario's
  double height = 0.0;                       ///< m, added to the first obstacle
  Eigen::Vector2d start_position{0.0, 0.0};  ///< m, of the mid-point between the soles
  double start_yaw = 0.0;                    ///< rad, about that point
  std::vector<double> joint_friction;        ///< N m per joint
  bool springs = false;
  DriveErrors drives;
  double step = 1e-3;  ///< s
  OdeStepper stepper = OdeStepper::kQuick;
};

/// Parts of a perturbation that can be left out by name, to see what one of them does.
inline constexpr std::string_view kPerturbationParts[] = {
    "mass",    "com",   "friction", "height", "start",  "joint_friction", "torque_constant",
    "encoder", "delay", "springs",  "step",   "stepper"};

/// The draw that belongs to the seed; every part is drawn from its own stream, so that leaving one
/// out does not change the others.
[[nodiscard]] Perturbation draw_perturbation(const PerturbationRange& range,
                                             const RobotModel& model, std::uint64_t seed);

/// Sets one part back to what the model and the scenario say. False: no part has this name.
[[nodiscard]] bool leave_out(Perturbation& perturbation, std::string_view part);

/// What the simulation builds instead of the model, the scenario, the start and the options.
[[nodiscard]] RobotModel perturbed(RobotModel model, const Perturbation& perturbation);
[[nodiscard]] Scenario perturbed(Scenario scenario, const Perturbation& perturbation);
/// @param nominal start configuration for the scenario as it is planned for
[[nodiscard]] Configuration perturbed(Configuration nominal, const Scenario& scenario,
                                      const Perturbation& perturbation);
[[nodiscard]] OdeOptions perturbed(OdeOptions options, const Perturbation& perturbation);

/// "friction 0.62, height +4.1 mm, ...": without the parts that have a value per body or joint.
[[nodiscard]] std::string describe(const Perturbation& perturbation);

}  // namespace clamber
