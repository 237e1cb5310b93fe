#include "apps/playback_plan.hpp"

#include "control/plan_image.hpp"
#include "planner_offline/planner.hpp"
#include "robot_model/loader.hpp"

namespace clamber {

Plan playback_plan(const RobotModel& model, const RobotMotion& motion, const Scenario& scenario) {
  if (motion.frames.size() < 2 || motion.rate <= 0.0)
    throw InputError(motion.recording + ": expected at least 2 frames to play");
  Plan plan = plan_header(model, scenario, motion.recording, motion.synthetic);
  plan.phases.push_back({.name = "playback", .start = 0.0});

  const std::size_t last = motion.frames.size() - 1;
  const std::size_t stride = last / kMaxKeyframes + 1;
  for (std::size_t i = 0; i <= last; i += stride) {
    Keyframe keyframe;
    keyframe.time = static_cast<double>(i) / motion.rate;
    keyframe.x = motion.frames[i];
    keyframe.tau = JointVector::Zero(model.joint_count());
    plan.keyframes.push_back(keyframe);
  }
  return plan;
}

Configuration playback_start(const RobotMotion& motion, const Scenario& scenario) {
  const Pose start{
      Eigen::AngleAxisd(scenario.start_yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix(),
      scenario.start_position};
  // In frame 0 of a mapped motion the soles' mid-point is at x = y = 0 (retarget.hpp).
  Configuration x = motion.frames.front();
  x.X_WB = start * x.X_WB;
  return x;
}

}  // namespace clamber
