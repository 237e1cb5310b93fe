#include "sim_backend/perturbation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>

namespace clamber {
namespace {

/// Uniform numbers whose values depend on no library's distributions.
class Stream {
 public:
  Stream(std::uint64_t seed, std::uint64_t part) : engine_(mix(mix(seed) + part)) {}
  /// In [low, high).
  double between(double low, double high) {
    return low + (high - low) * std::ldexp(static_cast<double>(engine_() >> 11), -53);
  }
  double around(double half_width) { return between(-half_width, half_width); }

 private:
  /// Neighbouring seeds to unlike states (the finaliser of a 64-bit hash).
  static std::uint64_t mix(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
  }
  std::mt19937_64 engine_;
};

// The exact stepper takes several times as long as the iterated one, a half step nearly twice as
// long as a whole one. Both only ask whether the outcome hangs on the simulator.
constexpr double kExactShare = 0.1;
constexpr double kHalfStepShare = 0.25;
constexpr double kDoubleStepShare = 0.35;
// The quick stepper starts from the forces of the step before: what changes in half a step takes
// fewer iterations.
constexpr int kFewestIterations = 30;

std::size_t part_index(std::string_view part) {
  return static_cast<std::size_t>(
      std::find(std::begin(kPerturbationParts), std::end(kPerturbationParts), part) -
      std::begin(kPerturbationParts));
}

double draw_step(double x) {
  if (x < kHalfStepShare) return 5e-4;
  return x < kHalfStepShare + kDoubleStepShare ? 2e-3 : 1e-3;
}

}  // namespace

Perturbation draw_perturbation(const PerturbationRange& range, const RobotModel& model,
                               std::uint64_t seed) {
  const auto stream = [seed](std::string_view part) { return Stream(seed, part_index(part)); };
  Perturbation p;
  p.seed = seed;
  Stream mass = stream("mass"), com = stream("com"), start = stream("start");
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    p.mass.push_back(1.0 + mass.around(range.mass));
    Eigen::Vector3d& shift = p.com.emplace_back();
    for (double& x : shift) x = com.around(range.com);
  }
  p.friction = stream("friction").between(range.low_friction, range.high_friction);
  p.height = stream("height").around(range.height);
  for (double& x : p.start_position) x = start.around(range.start_position);
  p.start_yaw = start.around(range.start_yaw);
  Stream friction = stream("joint_friction"), constant = stream("torque_constant");
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    p.joint_friction.push_back(friction.between(0.0, range.joint_friction));
    p.drives.torque_factor.push_back(1.0 + constant.around(range.torque_constant));
  }
  Stream encoder = stream("encoder");
  p.drives.encoder_resolution = encoder.between(0.0, range.encoder_resolution);
  p.drives.encoder_noise = encoder.between(0.0, range.encoder_noise);
  p.drives.seed = seed;
  p.drives.delay = stream("delay").between(0.0, range.delay);
  p.springs = stream("springs").between(0.0, 1.0) < 0.5;
  p.step = draw_step(stream("step").between(0.0, 1.0));
  p.stepper =
      stream("stepper").between(0.0, 1.0) < kExactShare ? OdeStepper::kExact : OdeStepper::kQuick;
  return p;
}

bool leave_out(Perturbation& p, std::string_view part) {
  const Perturbation nominal;
  switch (part_index(part)) {
    case 0:
      p.mass.clear();
      return true;
    case 1:
      p.com.clear();
      return true;
    case 2:
      p.friction = nominal.friction;
      return true;
    case 3:
      p.height = nominal.height;
      return true;
    case 4:
      p.start_position = nominal.start_position;
      p.start_yaw = nominal.start_yaw;
      return true;
    case 5:
      p.joint_friction.clear();
      return true;
    case 6:
      p.drives.torque_factor.clear();
      return true;
    case 7:
      p.drives.encoder_resolution = p.drives.encoder_noise = 0.0;
      return true;
    case 8:
      p.drives.delay = nominal.drives.delay;
      return true;
    case 9:
      p.springs = nominal.springs;
      return true;
    case 10:
      p.step = nominal.step;
      return true;
    case 11:
      p.stepper = nominal.stepper;
      return true;
    default:
      return false;
  }
}

RobotModel perturbed(RobotModel model, const Perturbation& p) {
  model.total_mass = 0.0;
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    Body& body = model.bodies[b];
    if (!p.mass.empty()) {
      body.mass *= p.mass[b];
      body.inertia *= p.mass[b];
    }
    if (!p.com.empty()) body.com += p.com[b];
    model.total_mass += body.mass;
  }
  for (std::size_t j = 0; j < p.joint_friction.size(); ++j)
    model.joints[j].friction = p.joint_friction[j];
  return model;
}

Scenario perturbed(Scenario scenario, const Perturbation& p) {
  if (p.friction > 0.0) scenario.friction = p.friction;
  ObstacleBox& box = scenario.obstacles.at(0);
  box.half_extents.z() += 0.5 * p.height;
  box.center.z() += 0.5 * p.height;
  return scenario;
}

Configuration perturbed(Configuration nominal, const Scenario& scenario, const Perturbation& p) {
  if (p.start_yaw == 0.0 && p.start_position.isZero(0.0)) return nominal;  // to the last bit
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(p.start_yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Vector3d& pivot = scenario.start_position;
  nominal.X_WB.p = pivot + turn * (nominal.X_WB.p - pivot);
  nominal.X_WB.p.head<2>() += p.start_position;
  nominal.X_WB.R = turn * nominal.X_WB.R;
  return nominal;
}

OdeOptions perturbed(OdeOptions options, const Perturbation& p) {
  options.iterations = std::clamp(static_cast<int>(std::lround(options.iterations * p.step / 1e-3)),
                                  kFewestIterations, options.iterations);
  options.step = p.step;
  options.stepper = p.stepper;
  options.springs = p.springs;
  if (p.seed != 0) options.seed = p.seed;
  options.seed = 1 + p.seed;
  return options;
}

std::string describe(const Perturbation& p) {
  std::array<char, 400> text{};
  std::snprintf(text.data(), text.size(),
                "friction %.2f, obstacle %+.1f mm, start %+.1f %+.1f mm %+.2f deg, %s, delay %.2f "
                "ms, encoder %.0f urad +- %.0f urad, step %.1f ms (%s)",
                p.friction, 1e3 * p.height, 1e3 * p.start_position.x(), 1e3 * p.start_position.y(),
                p.start_yaw * 180.0 / M_PI, p.springs ? "springs" : "rigid", 1e3 * p.drives.delay,
                1e6 * p.drives.encoder_resolution, 1e6 * p.drives.encoder_noise, 1e3 * p.step,
                p.stepper == OdeStepper::kExact ? "exact" : "quick");
  return text.data();
}

}  // namespace clamber
