// ODE's two steppers on a standing COMAN: processor time per step, drift and torque against the
// direct stepper. Prints a Markdown table.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <string>

#include "robot_model/loader.hpp"
#include "sim_backend/ode_world.hpp"

namespace clamber {
namespace {

constexpr int kSteps = 8000;
constexpr int kWindow = 2000;  // means and extremes over the last so many steps

struct Result {
  double milliseconds = 0.0;  ///< per step, processor time
  double separation = 0.0;    ///< m, greatest
  double force_range = 0.0;   ///< N, greatest minus least vertical contact force
  double rest_speed = 0.0;    ///< rad/s, greatest joint rate
  JointVector tau;            ///< N m, mean
};

double vertical_force(const OdeWorld& world) {
  double sum = 0.0;
  for (const ContactObservation& contact : world.contacts()) {
    sum += contact.surface == Surface::kRobot ? 0.0 : contact.force.z();
  }
  return sum;
}

Result stand(const RobotModel& model, const Scenario& scenario, const OdeOptions& options) {
  OdeWorld world(model, scenario, options);
  Result result;
  result.tau = JointVector::Zero(model.joint_count());
  double least = 1e9;
  double greatest = 0.0;
  std::clock_t stepping = 0;
  for (int k = 0; k < kSteps; ++k) {
    const JointVector tau = 1000.0 * (model.home - world.configuration().q) -
                            3.0 * world.velocity().tail(model.joint_count());
    const std::clock_t start = std::clock();
    world.step(tau);
    stepping += std::clock() - start;
    result.separation = std::max(result.separation, world.joint_separation());
    if (k >= kSteps - kWindow) {
      least = std::min(least, vertical_force(world));
      greatest = std::max(greatest, vertical_force(world));
      result.rest_speed = std::max(
          result.rest_speed, world.velocity().tail(model.joint_count()).cwiseAbs().maxCoeff());
      result.tau += world.drive_torque() / kWindow;
    }
  }
  result.milliseconds = 1e3 * static_cast<double>(stepping) / CLOCKS_PER_SEC / kSteps;
  result.force_range = greatest - least;
  return result;
}

void print(const std::string& name, const Result& result, const Result& reference) {
  std::printf("| %s | %.3f | %.1f | %.1e | %.3f | %.1f | %.4f |\n", name.c_str(),
              result.milliseconds, 1.0 / result.milliseconds, result.separation,
              (result.tau - reference.tau).cwiseAbs().maxCoeff(), result.force_range,
              result.rest_speed);
}

void run() {
  const std::string root = CLAMBER_SOURCE_DIR;
  const RobotModel model = load_robot(root + "/configs/robots/coman/robot.yaml");
  const Scenario scenario = load_scenario(root + "/configs/scenarios/box_0.275.yaml");
  OdeOptions options;
  options.stepper = OdeStepper::kExact;
  const Result reference = stand(model, scenario, options);
  std::printf(
      "| stepper | ms/step | x real time | joint separation m | torque error N m | force range N "
      "| joint rate rad/s |\n|---|---|---|---|---|---|---|\n");
  print("dWorldStep", reference, reference);
  options.stepper = OdeStepper::kQuick;
  for (const int iterations : {20, 30, 40, 50, 80}) {
    options.iterations = iterations;
    print("dWorldQuickStep, " + std::to_string(iterations) + " iterations",
          stand(model, scenario, options), reference);
  }
}

}  // namespace
}  // namespace clamber

int main() {
  clamber::run();
  return 0;
}
