#include "certificate/writer.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "planner_offline/ik/dense_qp.hpp"

namespace clamber {
namespace {

/// A corner of a sole that rests on its surface carries up to this height above it, m: what the
/// planner lets its keyframes leave (it calls a link landed within 1 mm), and less than soles and
/// joints give under load. Lower, and a sole that its plan stands on loses a corner here: the rest
/// cannot carry what the plan's torques are for.
constexpr double kCornerTouches = 1e-3;

/// Share of the certified friction that keyframes' forces may use: the rest is for the correction
/// between keyframes.
constexpr double kConeUsed = 0.9;

constexpr double kEvenShare = 1e-8;  // 1/N^2 in the program's objective

using Forces = std::vector<Eigen::Vector3d>;

class Writer {
 public:
  Writer(const PlannedMotion& motion, const RobotModel& model, const Scenario& scenario,
         const Acceptance& acceptance)
      : motion_(motion),
        model_(model),
        acceptance_(acceptance),
        measure_(model, scenario, motion, acceptance.uncertainty) {}

  std::vector<CertificateSample> run(double spacing) {
    times_ = sample_times(motion_, spacing);
    find_touching();
    find_knot_forces();
    std::vector<CertificateSample> samples(times_.size());
    std::vector<Forces> forces(times_.size());
    for (std::size_t i = 0; i < times_.size(); ++i) {
      measure_.place(times_[i]);
      forces[i] = forces_at(times_[i]);
    }
    for (std::size_t i = 0; i < times_.size(); ++i) {
      measure_.place(times_[i]);
      const TouchMask mask = touching_[times_[i].segment];
      const double rate = force_rate(times_[i], forces[i > 0 ? i - 1 : i], forces[i],
                                     forces[i + 1 < forces.size() ? i + 1 : i]);
      samples[i] = {times_[i].time, mask, measure_.measure(mask, forces[i], rate), forces[i]};
    }
    return samples;
  }

 private:
  void find_touching();
  void find_knot_forces();
  [[nodiscard]] Forces knot_forces(std::size_t knot, TouchMask mask);
  [[nodiscard]] Forces forces_at(const SampleTime& sample);
  void grasp(TouchMask mask, Eigen::MatrixXd& G, Eigen::MatrixXd& J) const;
  [[nodiscard]] Forces spread(TouchMask mask, const Forces& forces, TouchMask onto) const;
  void balance(TouchMask mask, Forces& forces) const;

  const PlannedMotion& motion_;
  const RobotModel& model_;
  const Acceptance& acceptance_;
  Measure measure_;
  DenseQp qp_;
  std::vector<SampleTime> times_;
  std::vector<TouchMask> touching_;       // per segment
  std::vector<TouchMask> knot_touching_;  // per keyframe: what touches before and after it
  std::vector<Forces> knot_forces_;
};

template <class Visit>
void for_each_bit(TouchMask mask, Visit&& visit) {
  for (std::size_t n = 0; mask != 0; mask &= mask - 1, ++n)
    visit(static_cast<std::size_t>(std::countr_zero(mask)), n);
}

/// A sphere touches while its link is in contact; a sole's corner if it stays down all the time.
void Writer::find_touching() {
  touching_.assign(motion_.segments.size(), ~TouchMask{0});
  for (const SampleTime& sample : times_) {
    measure_.place(sample);
    const TouchMask resting = measure_.resting();
    TouchMask touches = 0;
    for_each_bit(resting, [&](std::size_t i, std::size_t) {
      if (!measure_.candidates()[i].of_patch || measure_.height(i) <= kCornerTouches)
        touches |= TouchMask{1} << i;
    });
    touching_[sample.segment] &= touches;
  }
}

/// Force rows (net force, moment about the base origin) and joint torques per unit of force.
void Writer::grasp(TouchMask mask, Eigen::MatrixXd& G, Eigen::MatrixXd& J) const {
  const auto count = static_cast<Eigen::Index>(std::popcount(mask));
  G.resize(6, 3 * count);
  J.resize(model_.joint_count(), 3 * count);
  for_each_bit(mask, [&](std::size_t i, std::size_t n) {
    Jacobian3 block;
    point_jacobian(model_, measure_.data(), measure_.candidates()[i].body, measure_.touch_point(i),
                   block);
    G.middleCols<3>(3 * static_cast<Eigen::Index>(n)) = block.leftCols<6>().transpose();
    J.middleCols<3>(3 * static_cast<Eigen::Index>(n)) =
        block.rightCols(model_.joint_count()).transpose();
  });
}

Forces Writer::knot_forces(std::size_t knot, TouchMask mask) {
  const auto count = static_cast<Eigen::Index>(std::popcount(mask));
  const int n = model_.joint_count();
  Forces forces(static_cast<std::size_t>(count), Eigen::Vector3d::Zero());
  if (count == 0) return forces;
  VelocityVector g;
  gravity_torque(model_, measure_.data(), g);
  Eigen::MatrixXd G, J;
  grasp(mask, G, J);
  Eigen::VectorXd limit(n);
  for (int j = 0; j < n; ++j) limit[j] = model_.joints[static_cast<std::size_t>(j)].torque_limit;
  // min |(g - J f - tau) / limit|^2: the forces behind the plan's torques.
  const Eigen::MatrixXd weighted = limit.cwiseInverse().asDiagonal() * J;
  QpProblem qp;
  qp.H = weighted.transpose() * weighted;
  // Corners of one sole share a load in many ways: a pull towards small forces, too weak to matter
  // against the plan's torques.
  qp.H.diagonal().array() += kEvenShare;
  qp.g = -weighted.transpose() * (g.tail(n) - motion_.knots[knot].tau).cwiseQuotient(limit);
  qp.A_eq = G;
  qp.b_eq = g.head<6>();
  // Pyramids inside the cones: |f_x|, |f_y| <= mu / sqrt(2) f_z.
  qp.C = Eigen::MatrixXd::Zero(4 * count + 2 * n, 3 * count);
  qp.d = Eigen::VectorXd::Zero(4 * count + 2 * n);
  const double slope = kConeUsed * measure_.friction() / std::sqrt(2.0);
  for (Eigen::Index p = 0; p < count; ++p)
    for (Eigen::Index k = 0; k < 4; ++k) {
      qp.C(4 * p + k, 3 * p + k / 2) = k % 2 == 0 ? 1.0 : -1.0;
      qp.C(4 * p + k, 3 * p + 2) = slope;
    }
  const double share = 1.0 / (1.0 + acceptance_.uncertainty.mass_share);
  qp.C.middleRows(4 * count, n) = J;
  qp.d.segment(4 * count, n) = g.tail(n) - share * limit;
  qp.C.bottomRows(n) = -J;
  qp.d.tail(n) = -g.tail(n) - share * limit;
  // Without the torque limits if need be: then the certificate shows how far they are exceeded.
  bool solved = qp_.solve(qp) == QpStatus::optimal;
  if (!solved) {
    qp.C.conservativeResize(4 * count, Eigen::NoChange);
    qp.d.conservativeResize(4 * count);
    solved = qp_.solve(qp) == QpStatus::optimal;
  }
  if (solved)
    for (Eigen::Index p = 0; p < count; ++p)
      forces[static_cast<std::size_t>(p)] = qp_.x().segment<3>(3 * p);
  return forces;
}

void Writer::find_knot_forces() {
  const std::size_t knots = motion_.knots.size();
  knot_touching_.resize(knots);
  knot_forces_.resize(knots);
  for (std::size_t k = 0; k < knots; ++k) {
    // Force can only be where there is contact before and after: this makes it continuous.
    knot_touching_[k] = touching_[std::min(k, knots - 2)] & touching_[k > 0 ? k - 1 : 0];
    measure_.place({motion_.knots[k].time, std::min(k, knots - 2), 0.0, 0.0});
    knot_forces_[k] = knot_forces(k, knot_touching_[k]);
  }
}

Forces Writer::spread(TouchMask mask, const Forces& forces, TouchMask onto) const {
  Forces out(static_cast<std::size_t>(std::popcount(onto)), Eigen::Vector3d::Zero());
  std::array<const Eigen::Vector3d*, 64> at{};
  for_each_bit(mask, [&](std::size_t i, std::size_t n) { at[i] = &forces[n]; });
  for_each_bit(onto, [&](std::size_t i, std::size_t n) {
    if (at[i] != nullptr) out[n] = *at[i];
  });
  return out;
}

/// Takes what remains of the balance out with the least change, weighted by each point's load: an
/// idle point stays idle, and no cone is left for the rounding of others.
void Writer::balance(TouchMask mask, Forces& forces) const {
  if (mask == 0) return;
  Eigen::MatrixXd G, J;
  grasp(mask, G, J);
  VelocityVector g;
  gravity_torque(model_, measure_.data(), g);
  Eigen::VectorXd f(G.cols()), weight(G.cols());
  for (std::size_t p = 0; p < forces.size(); ++p) {
    f.segment<3>(3 * static_cast<Eigen::Index>(p)) = forces[p];
    weight.segment<3>(3 * static_cast<Eigen::Index>(p)).setConstant(std::max(forces[p].z(), 1e-6));
  }
  for (int pass = 0; pass < 2; ++pass) {  // the second one takes out the first one's rounding
    const Eigen::Matrix<double, 6, 1> rest = g.head<6>() - G * f;
    const Eigen::MatrixXd WG = weight.asDiagonal() * G.transpose();
    const Eigen::Matrix<double, 6, 6> A = G * WG;
    f += WG * A.ldlt().solve(rest);
  }
  if (!f.allFinite()) return;
  for (std::size_t p = 0; p < forces.size(); ++p)
    forces[p] = f.segment<3>(3 * static_cast<Eigen::Index>(p));
}

Forces Writer::forces_at(const SampleTime& sample) {
  const std::size_t k = sample.segment;
  const TouchMask mask = touching_[k];
  const Forces from = spread(knot_touching_[k], knot_forces_[k], mask);
  const Forces to = spread(knot_touching_[k + 1], knot_forces_[k + 1], mask);
  const MotionSegment& segment = motion_.segments[k];
  const double share =
      std::clamp((sample.time - segment.start) / (segment.end - segment.start), 0.0, 1.0);
  Forces forces(from.size());
  for (std::size_t p = 0; p < forces.size(); ++p)
    forces[p] = (1.0 - share) * from[p] + share * to[p];
  balance(mask, forces);
  return forces;
}

}  // namespace

Certificate certify(const PlannedMotion& motion, const RobotModel& model, const Scenario& scenario,
                    const Acceptance& acceptance) {
  Certificate certificate;
  CertificateHeader& header = certificate.header;
  header.tool_version = motion.tool_version;
  header.plan_sha256 = motion.sha256;
  header.image_sha256 = image_digest(motion, model);
  header.robot = model.name;
  header.robot_hash = model.hash;
  header.scenario = scenario.name;
  header.scenario_hash = scenario.hash;
  header.limits_sha256 = limits_digest(model);
  header.friction = scenario.friction;
  header.obstacle_height = scenario.obstacles.empty() ? 0.0 : scenario.obstacles.front().top();
  header.ballast_mass = model.ballast_mass;
  header.total_mass = model.total_mass;
  header.acceptance = acceptance;
  certificate.samples = Writer(motion, model, scenario, acceptance).run(header.spacing);
  return certificate;
}

}  // namespace clamber
