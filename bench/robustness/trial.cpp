#include "bench/robustness/trial.hpp"

#include <cmath>

#include "bench/robustness/climb_watch.hpp"

namespace clamber {
namespace {

using Json = nlohmann::ordered_json;

Json to_json(const Perturbation& p) {
  return {{"friction", p.friction},
          {"height_m", p.height},
          {"start_x_m", p.start_position.x()},
          {"start_y_m", p.start_position.y()},
          {"start_yaw_rad", p.start_yaw},
          {"springs", p.springs},
          {"delay_s", p.drives.delay},
          {"encoder_resolution_rad", p.drives.encoder_resolution},
          {"encoder_noise_rad", p.drives.encoder_noise},
          {"step_s", p.step},
          {"stepper", p.stepper == OdeStepper::kExact ? "exact" : "quick"}};
}

Json to_json(const std::vector<ClimbEvent>& events) {
  Json list = Json::array();
  for (const ClimbEvent& event : events)
    list.push_back({{"time", event.time}, {"phase", event.phase}, {"what", event.what}});
  return list;
}

}  // namespace

Perturbation perturbation_of(const TrialInputs& inputs, std::uint64_t seed) {
  Perturbation p = draw_perturbation(inputs.range, inputs.model, seed);
  for (const std::string& part : inputs.left_out) static_cast<void>(leave_out(p, part));
  return p;
}

Json run_trial(const TrialInputs& inputs, std::uint64_t seed) {
  const Perturbation perturbation = perturbation_of(inputs, seed);
  ClimbWatch watch(inputs.model, inputs.scenario, inputs.plan, perturbation);
  SimulatedRunOptions options;
  options.control = inputs.control;
  options.perturbation = perturbation;
  options.observe = [&](const OdeWorld& world, const TelemetryFrame& frame) {
    watch.observe(world, frame);
  };
  const SimulatedRun run = run_in_simulation(inputs.model, inputs.scenario, inputs.image, options);
  if (run.execution.stopped) return {};
  return {{"seed", seed},
          {"success", run.success()},
          {"perturbation", to_json(perturbation)},
          {"failure", run.failure(inputs.model)},
          {"events", to_json(watch.events())},
          {"peak_torque_nm", run.peak_torque},
          {"peak_joint", run.peak_joint},
          {"weight_on_obstacle", run.verdict.weight_on_obstacle},
          {"on_top", run.verdict.final_contacts},
          {"rest_speed", run.verdict.rest_speed},
          {"farthest_m", watch.farthest()},
          {"most_tilted_deg", watch.most_tilted() * 180.0 / M_PI}};
}

}  // namespace clamber
