#include "planner_offline/retarget/retarget.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "planner_offline/retarget/chain_solver.hpp"
#include "robot_model/kinematics.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

/// One chain with everything resolved to indices.
struct MappedChain {
  std::size_t from = 0;  ///< human segments
  std::size_t to = 0;
  ChainSolver solver;
  Eigen::Matrix3d R_from;  ///< robot bodies in the world at the neutral posture
  Eigen::Matrix3d R_to;
};

class Retargeter {
 public:
  Retargeter(const HumanMotion& motion, const RobotModel& model, const RetargetConfig& config)
      : motion_(motion), model_(model), config_(config) {
    if (motion.frames.empty()) throw InputError(motion.source + ": no frames to map");
    if (!(motion.hip_height > 0.0)) {
      throw InputError(motion.source + ": hip height of the standing person is not known");
    }
    base_segment_ = motion.segment(config.base_segment);
    hips_ = {motion.segment("RightUpperLeg"), motion.segment("LeftUpperLeg")};
    set_neutral();
    measure_legs();
    for (const auto& chain : config.chains) chains_.push_back(resolve(chain));
  }

  RobotMotion run() {
    RobotMotion out;
    out.recording = motion_.source;
    out.synthetic = motion_.synthetic;
    out.rate = motion_.rate;
    out.human_leg_length = motion_.hip_height;
    out.frames.resize(motion_.frames.size());
    for (auto& frame : out.frames) frame.q = neutral_;
    for (const auto& chain : chains_) map_chain(chain, out);
    clamp_to_limits(out);
    place_base(out);
    return out;
  }

 private:
  int joint(const std::string& name) const {
    if (const auto j = model_.find_joint(name)) return *j;
    throw InputError(config_.source + ": joint \"" + name + "\": robot " + model_.name +
                     " has no such joint");
  }

  void set_neutral() {
    neutral_ = JointVector::Zero(model_.joint_count());
    for (const auto& [name, angle] : config_.neutral) neutral_[joint(name)] = angle;
    Configuration x{Pose{}, neutral_};
    forward_kinematics(model_, x, neutral_data_);
  }

  /// Mid-point between the hips in the base frame and its height above the soles.
  void measure_legs() {
    Eigen::Vector3d hips = Eigen::Vector3d::Zero();
    double sole = 0.0;
    for (const auto& leg : config_.legs) {
      const auto contact = model_.find_contact(leg.sole);
      if (!contact) {
        throw InputError(config_.source + ": legs: robot " + model_.name +
                         " has no contact link \"" + leg.sole + "\"");
      }
      hips += neutral_data_.X_WB[static_cast<std::size_t>(joint(leg.hip)) + 1].p;
      sole += lowest_point(*contact, neutral_data_);
      soles_.push_back(*contact);
    }
    const double count = static_cast<double>(config_.legs.size());
    hip_center_ = hips / count;
    scale_ = (hip_center_.z() - sole / count) / motion_.hip_height;
    if (!(scale_ > 0.0)) {
      throw InputError(config_.source +
                       ": legs: the hips must be above the soles at the neutral posture");
    }
  }

  double lowest_point(int contact, const RobotData& data) const {
    const auto& link = model_.contacts[static_cast<std::size_t>(contact)];
    double lowest = std::numeric_limits<double>::infinity();
    for (const auto& p : link.points) {
      lowest =
          std::min(lowest, (data.X_WB[static_cast<std::size_t>(link.body)] * p).z() - link.radius);
    }
    return lowest;
  }

  MappedChain resolve(const RetargetChain& chain) const {
    std::vector<int> joints;
    for (const auto& name : chain.joints) {
      const int j = joint(name);
      if (!joints.empty() &&
          model_.bodies[static_cast<std::size_t>(j) + 1].parent != joints.back() + 1) {
        throw InputError(config_.source + ": chain " + chain.name + ": joint \"" + name +
                         "\" does not follow \"" +
                         model_.joints[static_cast<std::size_t>(joints.back())].name +
                         "\" in the robot's tree");
      }
      joints.push_back(j);
    }
    const auto before = static_cast<std::size_t>(
        model_.bodies[static_cast<std::size_t>(joints.front()) + 1].parent);
    const auto after = static_cast<std::size_t>(joints.back()) + 1;
    return {motion_.segment(chain.from), motion_.segment(chain.to),
            ChainSolver(model_, std::move(joints), chain.match,
                        neutral_data_.X_WB[after].R.transpose().col(2)),
            neutral_data_.X_WB[before].R, neutral_data_.X_WB[after].R};
  }

  void map_chain(const MappedChain& chain, RobotMotion& out) const {
    ChainSolver::Angles q;
    double residual = 0.0;
    for (std::size_t f = 0; f < motion_.frames.size(); ++f) {
      const auto& orientation = motion_.frames[f].orientation;
      const Eigen::Matrix3d R_human =
          (orientation[chain.from].conjugate() * orientation[chain.to]).toRotationMatrix();
      const Eigen::Matrix3d target = chain.R_from.transpose() * R_human * chain.R_to;
      q = f == 0 ? chain.solver.solve_anywhere(target, residual)
                 : chain.solver.solve(target, q, residual);
      for (int i = 0; i < chain.solver.size(); ++i) out.frames[f].q[chain.solver.joint(i)] = q[i];
    }
  }

  void clamp_to_limits(RobotMotion& out) const {
    for (int j = 0; j < model_.joint_count(); ++j) {
      const auto& limits = model_.joints[static_cast<std::size_t>(j)];
      double worst = 0.0;
      std::size_t clamped = 0;
      for (auto& frame : out.frames) {
        const double inside = std::clamp(frame.q[j], limits.lower, limits.upper);
        const double excess = std::abs(frame.q[j] - inside);
        if (excess > 0.0) ++clamped;
        worst = std::max(worst, excess);
        frame.q[j] = inside;
      }
      if (clamped > 0) {
        out.clamped.push_back(
            {limits.name, worst,
             static_cast<double>(clamped) / static_cast<double>(out.frames.size())});
      }
    }
  }

  Eigen::Vector3d human_hips(std::size_t frame) const {
    const auto& origin = motion_.frames[frame].origin;
    return 0.5 * (origin[hips_.first] + origin[hips_.second]);
  }

  void place_base(RobotMotion& out) const {
    // Turning the recording's world by -heading brings the climb to +x.
    const Eigen::Matrix3d R_turn =
        Eigen::AngleAxisd(-motion_.heading, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    const Eigen::Vector3d start = human_hips(0);
    for (std::size_t f = 0; f < out.frames.size(); ++f) {
      auto& X = out.frames[f].X_WB;
      X.R = R_turn * motion_.frames[f].orientation[base_segment_].toRotationMatrix();
      X.p = scale_ * (R_turn * (human_hips(f) - start)) - X.R * hip_center_;
    }
    const Eigen::Vector3d shift = start_on_floor(out.frames.front());
    for (auto& frame : out.frames) frame.X_WB.p += shift;
  }

  /// Shift that puts the soles of `x` around the origin and on the floor.
  Eigen::Vector3d start_on_floor(const Configuration& x) const {
    RobotData data;
    forward_kinematics(model_, x, data);
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    double lowest = std::numeric_limits<double>::infinity();
    for (const int sole : soles_) {
      const auto& link = model_.contacts[static_cast<std::size_t>(sole)];
      Eigen::Vector3d center = Eigen::Vector3d::Zero();
      for (const auto& p : link.points) {
        center += data.X_WB[static_cast<std::size_t>(link.body)] * p;
      }
      middle += center / static_cast<double>(link.points.size() * soles_.size());
      lowest = std::min(lowest, lowest_point(sole, data));
    }
    return {-middle.x(), -middle.y(), -lowest};
  }

  const HumanMotion& motion_;
  const RobotModel& model_;
  const RetargetConfig& config_;
  std::size_t base_segment_ = 0;
  std::pair<std::size_t, std::size_t> hips_;
  std::vector<MappedChain> chains_;
  JointVector neutral_;
  RobotData neutral_data_;
  std::vector<int> soles_;
  Eigen::Vector3d hip_center_ = Eigen::Vector3d::Zero();  ///< in the base frame, m
  double scale_ = 1.0;                                    ///< robot length per human length
};

}  // namespace

RobotMotion retarget(const HumanMotion& motion, const RobotModel& model,
                     const RetargetConfig& config) {
  const HumanMotion sampled = resample(motion, config.rate);
  return Retargeter(sampled, model, config).run();
}

}  // namespace clamber
