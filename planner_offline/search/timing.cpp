#include "planner_offline/search/timing.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

Configuration between(const Configuration& a, const Configuration& b, double t) {
  Configuration x;
  x.q = a.q + t * (b.q - a.q);
  x.X_WB.p = a.X_WB.p + t * (b.X_WB.p - a.X_WB.p);
  x.X_WB.R = a.X_WB.R * rotation_exp(t * rotation_log(a.X_WB.R.transpose() * b.X_WB.R));
  return x;
}

/// Binomial smoothing: takes out the chatter of constraints that come and go from step to step.
std::vector<Configuration> smoothed(std::vector<Configuration> path) {
  constexpr int kPasses = 4;
  for (int pass = 0; pass < kPasses; ++pass) {
    std::vector<Configuration> next = path;
    for (std::size_t i = 1; i + 1 < path.size(); ++i) {
      next[i] = between(path[i], between(path[i - 1], path[i + 1], 0.5), 0.5);
    }
    path.swap(next);
  }
  return path;
}

/// Time each step of the path takes at the settings' speeds, summed up from its start.
std::vector<double> cumulated_time(const RobotModel& model, const std::vector<Configuration>& path,
                                   const TimingSettings& settings) {
  std::vector<double> time{0.0};
  RobotData data;
  forward_kinematics(model, path.front(), data);
  Eigen::Vector3d com = data.com;
  for (std::size_t i = 1; i < path.size(); ++i) {
    forward_kinematics(model, path[i], data);
    const double joints = (path[i].q - path[i - 1].q).cwiseAbs().maxCoeff() / settings.joint_speed;
    const double body = (data.com - com).norm() / settings.com_speed;
    com = data.com;
    time.push_back(time.back() + std::max(joints, body));
  }
  return time;
}

/// Minimum-jerk course from 0 to 1.
double minimum_jerk(double u) { return u * u * u * (10.0 + u * (-15.0 + 6.0 * u)); }

constexpr double kPeakRate = 1.875;  // of minimum_jerk()

}  // namespace

std::vector<TimedPosture> time_stretch(const RobotModel& model, const Stretch& stretch,
                                       const TimingSettings& settings) {
  const bool rests = stretch.kind == Stretch::Kind::kLoad || stretch.path.size() < 2;
  const std::vector<Configuration> path = rests ? stretch.path : smoothed(stretch.path);
  const std::vector<double> along = cumulated_time(model, path, settings);
  constexpr double kShortest = 0.4;  // s
  const double duration =
      rests ? settings.load_time : std::max(kShortest, kPeakRate * along.back());
  const int knots = std::max(2, static_cast<int>(std::ceil(duration / settings.knot_spacing)));
  std::vector<TimedPosture> timed;
  std::size_t i = 1;
  for (int k = 0; k <= knots; ++k) {
    const double u = static_cast<double>(k) / knots;
    TimedPosture posture{u * duration, u, path.front()};
    if (!rests) {
      const double at = minimum_jerk(u) * along.back();
      while (i + 1 < path.size() && along[i] < at) {
        ++i;
      }
      const double step = along[i] - along[i - 1];
      const double t = step > 0.0 ? std::clamp((at - along[i - 1]) / step, 0.0, 1.0) : 1.0;
      posture.x = between(path[i - 1], path[i], t);
    }
    timed.push_back(posture);
  }
  return timed;
}

}  // namespace clamber
