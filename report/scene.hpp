// What a picture shows: coloured primitives, boxes, force arrows, and where the camera stands.
// Off-line only: allocates; never blocks.
#pragma once

#include <string>
#include <vector>

#include "report/image.hpp"
#include "robot_model/model.hpp"
#include "sim_backend/scenario.hpp"
#include "telemetry/frame.hpp"

namespace clamber {

/// How a surface is shaded.
enum class Material { kPlain, kWood };

/// A sphere, capsule or box in the world. Dimensions as in Geom.
struct ScenePrimitive {
  Shape shape = Shape::kSphere;
  Pose X_WP;
  double radius = 0.0;
  double length = 0.0;
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();
  Rgb colour;
  Material material = Material::kPlain;
};

/// A contact force: an arrow from the contact along the force, drawn through whatever hides it.
struct SceneArrow {
  Eigen::Vector3d from = Eigen::Vector3d::Zero();    ///< world, m
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();  ///< world, m (already scaled)
  Rgb colour;
};

/// All of one picture but the camera. The floor is z = 0.
struct Scene {
  std::vector<ScenePrimitive> primitives;
  std::vector<SceneArrow> arrows;
};

struct Camera {
  Eigen::Vector3d eye = Eigen::Vector3d::Zero();     ///< world, m
  Eigen::Vector3d target = Eigen::Vector3d::Zero();  ///< world, m
  double field_of_view = 0.5;                        ///< vertical, rad
};

/// kThreeQuarter: from the left, above and a little behind, so that the feet, the edge the knees
/// mount, and the hands on top all show.
/// kSide: from the left, level.
enum class View { kThreeQuarter, kSide };

/// The extent of the home posture along z, m.
[[nodiscard]] double standing_height(const RobotModel& model);

/// A camera that holds the standing robot and the box it climbs, whatever happens in between.
[[nodiscard]] Camera make_camera(const Scenario& scenario, const RobotModel& model, View view);

/// The colour a geom is drawn in: left limbs blue, right limbs orange (legs darker than arms),
/// trunk light grey, contact points dark. The limb comes from the contact links a body leads to.
[[nodiscard]] Rgb geom_colour(const RobotModel& model, int geom);

/// The robot at x on the scenario's floor with its boxes; no arrows.
[[nodiscard]] Scene make_scene(const RobotModel& model, const Configuration& x,
                               const Scenario& scenario);

/// Adds an arrow for every contact link that carries more than 2 N in `frame`: upwards, as the
/// frame holds normal forces and the climbed faces are level. Green: obstacle, violet: floor.
void add_contact_forces(const RobotModel& model, const TelemetryFrame& frame, Scene& scene);

inline constexpr Rgb kLeftArm{86, 156, 232};
inline constexpr Rgb kLeftLeg{28, 92, 186};
inline constexpr Rgb kRightArm{250, 166, 62};
inline constexpr Rgb kRightLeg{224, 96, 34};
inline constexpr Rgb kTrunk{206, 211, 218};
inline constexpr Rgb kPelvis{150, 158, 170};
inline constexpr Rgb kContactPoint{52, 56, 64};
inline constexpr Rgb kWood{196, 146, 92};
inline constexpr Rgb kForceObstacle{22, 150, 76};
inline constexpr Rgb kForceFloor{140, 60, 190};

}  // namespace clamber
