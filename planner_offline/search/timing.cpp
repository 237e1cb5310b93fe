#include "planner_offline/search/timing.hpp"

#include <algorithm>
#include <cmath>

#include "planner_offline/certify/support_region.hpp"

namespace clamber {
namespace {

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

/// Puts a posture back onto its contacts by the least change: smoothing and the way between two
/// postures leave them by tenths of a millimetre.
void hold_contacts(const RobotModel& model, const ContactSet& contacts, Configuration& x) {
  constexpr int kPasses = 2;
  for (int pass = 0; pass < kPasses; ++pass) {
    RobotData data;
    forward_kinematics(model, x, data);
    const Task held = contact_tasks(model, data, contacts);
    const VelocityVector dv = held.J.completeOrthogonalDecomposition().solve(held.e);
    Configuration next;
    integrate(model, x, dv, next);
    x = next;
  }
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

/// The path's posture at minimum-jerk times over `duration`.
std::vector<TimedPosture> sampled(const RobotModel& model, const ContactSet& contacts,
                                  const std::vector<Configuration>& path,
                                  const std::vector<double>& along, double duration, int knots) {
  std::vector<TimedPosture> timed;
  std::size_t i = 1;
  for (int k = 0; k <= knots; ++k) {
    const double u = static_cast<double>(k) / knots;
    TimedPosture posture{u * duration, u, path.front()};
    if (path.size() > 1) {
      const double at = minimum_jerk(u) * along.back();
      while (i + 1 < path.size() && along[i] < at) {
        ++i;
      }
      const double step = along[i] - along[i - 1];
      const double t = step > 0.0 ? std::clamp((at - along[i - 1]) / step, 0.0, 1.0) : 1.0;
      posture.x = between(path[i - 1], path[i], t);
      if (k > 0 && k < knots) {  // the ends are where the stretches before and after take over
        hold_contacts(model, contacts, posture.x);
      }
    }
    timed.push_back(posture);
  }
  return timed;
}

/// Largest acceleration of the centre of mass from knot to knot, at rest before and after, m/s^2.
double com_acceleration(const RobotModel& model, const std::vector<TimedPosture>& timed) {
  std::vector<Eigen::Vector3d> com;
  com.reserve(timed.size() + 2);
  RobotData data;
  for (const TimedPosture& posture : timed) {
    forward_kinematics(model, posture.x, data);
    com.push_back(data.com);
  }
  com.insert(com.begin(), com.front());
  com.push_back(com.back());
  const double h = timed[1].time - timed[0].time;
  double largest = 0.0;
  for (std::size_t i = 1; i + 1 < com.size(); ++i) {
    largest = std::max(largest, (com[i - 1] - 2.0 * com[i] + com[i + 1]).norm() / (h * h));
  }
  return largest;
}

/// Second derivatives at the knots of the cubic splines through the rows, at rest at both ends.
Eigen::MatrixXd spline_accelerations(const Eigen::MatrixXd& rows, double h) {
  const Eigen::Index n = rows.rows();
  Eigen::VectorXd diagonal = Eigen::VectorXd::Constant(n, 4.0);
  diagonal[0] = diagonal[n - 1] = 2.0;
  Eigen::MatrixXd a(n, rows.cols());
  a.row(0) = rows.row(1) - rows.row(0);
  a.row(n - 1) = rows.row(n - 2) - rows.row(n - 1);
  for (Eigen::Index i = 1; i + 1 < n; ++i) {
    a.row(i) = rows.row(i - 1) - 2.0 * rows.row(i) + rows.row(i + 1);
  }
  a *= 6.0 / (h * h);
  for (Eigen::Index i = 1; i < n; ++i) {  // tridiagonal with ones beside the diagonal
    diagonal[i] -= 1.0 / diagonal[i - 1];
    a.row(i) -= a.row(i - 1) / diagonal[i - 1];
  }
  a.row(n - 1) /= diagonal[n - 1];
  for (Eigen::Index i = n - 2; i >= 0; --i) {
    a.row(i) = (a.row(i) - a.row(i + 1)) / diagonal[i];
  }
  return a;
}

/// Whether the zero-moment point of the bodies' masses keeps a share of the support margin that the
/// centre of mass has: a limb that swings tips a robot on one sole more than its weight says.
bool tips(const RobotModel& model, const ContactSet& contacts,
          const std::vector<TimedPosture>& timed) {
  if (contacts.empty()) {
    return false;  // nothing to tip over
  }
  constexpr double kKept = 0.4;
  const auto bodies = static_cast<Eigen::Index>(model.bodies.size());
  Eigen::MatrixXd places(static_cast<Eigen::Index>(timed.size()), 3 * bodies);
  std::vector<SupportRegion> regions;
  std::vector<double> ground, margin;
  RobotData data;
  for (std::size_t k = 0; k < timed.size(); ++k) {
    forward_kinematics(model, timed[k].x, data);
    for (Eigen::Index b = 0; b < bodies; ++b) {
      const auto body = static_cast<std::size_t>(b);
      places.block<1, 3>(static_cast<Eigen::Index>(k), 3 * b) =
          (data.X_WB[body] * model.bodies[body].com).transpose();
    }
    const std::vector<Eigen::Vector3d> points = contact_points(model, data, contacts);
    regions.emplace_back(points);
    margin.push_back(regions.back().margin(data.com.head<2>()));
    ground.push_back(
        std::min_element(points.begin(), points.end(), [](const auto& a, const auto& b) {
          return a.z() < b.z();
        })->z());
  }
  const Eigen::MatrixXd a = spline_accelerations(places, timed[1].time - timed[0].time);
  for (std::size_t k = 0; k < timed.size(); ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    Eigen::Vector2d moment = Eigen::Vector2d::Zero();
    double weight = 0.0;
    for (Eigen::Index b = 0; b < bodies; ++b) {
      const Eigen::Vector3d p = places.block<1, 3>(row, 3 * b), acc = a.block<1, 3>(row, 3 * b);
      const double mass = model.bodies[static_cast<std::size_t>(b)].mass;
      moment += mass * ((kGravity + acc.z()) * p.head<2>() - (p.z() - ground[k]) * acc.head<2>());
      weight += mass * (kGravity + acc.z());
    }
    if (regions[k].margin(moment / weight) < kKept * margin[k]) {
      return true;
    }
  }
  return false;
}

}  // namespace

std::vector<TimedPosture> time_stretch(const RobotModel& model, const Stretch& stretch,
                                       const TimingSettings& settings) {
  const auto knots_for = [&settings](double duration) {
    return std::max(2, static_cast<int>(std::ceil(duration / settings.knot_spacing)));
  };
  if (stretch.kind == Stretch::Kind::kLoad || stretch.path.size() < 2) {
    return sampled(model, stretch.contacts, {stretch.path.front()}, {0.0}, settings.load_time,
                   knots_for(settings.load_time));
  }
  const std::vector<Configuration> path = smoothed(stretch.path);
  const std::vector<double> along = cumulated_time(model, path, settings);
  constexpr double kShortest = 0.4;  // s
  double duration = std::max(kShortest, kPeakRate * along.back());
  std::vector<TimedPosture> timed =
      sampled(model, stretch.contacts, path, along, duration, knots_for(duration));
  // Corners of the path are what accelerates; slower, the same corners accelerate less.
  const auto slow_down = [&](double by) {
    duration *= by;
    timed = sampled(model, stretch.contacts, path, along, duration, knots_for(duration));
  };
  constexpr int kTries = 3;
  for (int i = 0; i < kTries; ++i) {
    const double excess = com_acceleration(model, timed) / settings.com_acceleration;
    if (excess <= 1.0) {
      break;
    }
    slow_down(std::min(1.5, std::sqrt(excess) + 0.02));
  }
  constexpr int kSlower = 6;
  for (int i = 0; i < kSlower && tips(model, stretch.contacts, timed); ++i) {
    slow_down(1.2);
  }
  return timed;
}

}  // namespace clamber
