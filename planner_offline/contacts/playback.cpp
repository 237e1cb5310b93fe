#include "planner_offline/contacts/playback.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <set>
#include <utility>

#include "planner_offline/planning_failed.hpp"
#include "robot_model/loader.hpp"
#include "sim_backend/ode_world.hpp"

namespace clamber {
namespace {

Scenario adjusted_scenario(const Scenario& scenario, double height) {
  if (scenario.obstacles.empty()) {
    throw InputError("scenario '" + scenario.name + "': has no obstacle to play the motion at");
  }
  Scenario placed = scenario;
  ObstacleBox box = scenario.obstacles.front();
  box.half_extents.z() = 0.5 * height;
  box.center = {box.half_extents.x(), 0.0, box.half_extents.z()};
  box.yaw = 0.0;
  placed.obstacles = {box};
  return placed;
}

/// The recording at any time, between two frames.
class Reference {
 public:
  Reference(const RobotMotion& motion, const Adjustment& adjustment)
      : motion_(motion), adjustment_(adjustment) {}

  [[nodiscard]] Configuration at(double time) const {
    const double place =
        std::clamp(time * motion_.rate, 0.0, static_cast<double>(motion_.frames.size() - 1));
    const auto k = static_cast<std::size_t>(place);
    const Configuration& a = motion_.frames[k];
    const Configuration& b = motion_.frames[std::min(k + 1, motion_.frames.size() - 1)];
    const double t = place - static_cast<double>(k);
    Configuration x;
    x.q = a.q + t * (b.q - a.q);
    x.X_WB.p = a.X_WB.p + t * (b.X_WB.p - a.X_WB.p);
    x.X_WB.R = Eigen::Quaterniond(a.X_WB.R).slerp(t, Eigen::Quaterniond(b.X_WB.R)).matrix();
    return adjustment_.apply(x);
  }

 private:
  const RobotMotion& motion_;
  const Adjustment& adjustment_;
};

/// Joint position control with the model's own gains.
class PositionControl {
 public:
  PositionControl(const RobotModel& model, double step)
      : model_(model), step_(step), integral_(JointVector::Zero(model.joint_count())) {}

  [[nodiscard]] JointVector torque(const JointVector& q_ref, const JointVector& q,
                                   const VelocityVector& v) {
    JointVector tau(model_.joint_count());
    for (int j = 0; j < model_.joint_count(); ++j) {
      const Joint& joint = model_.joints[static_cast<std::size_t>(j)];
      const double error = q_ref[j] - q[j];
      integral_[j] += joint.ki * error * step_;
      tau[j] = joint.kp * error + integral_[j] - joint.kd * v[6 + j];
    }
    return tau;
  }

 private:
  const RobotModel& model_;
  double step_;
  JointVector integral_;
};

std::vector<std::string> contact_names(const RobotModel& model) {
  std::vector<std::string> names;
  for (const ContactLink& link : model.contacts) {
    names.push_back(link.name);
  }
  return names;
}

std::string text(const char* format, double value) {
  std::array<char, 64> buffer{};
  std::snprintf(buffer.data(), buffer.size(), format, value);
  return buffer.data();
}

std::string joined(const std::set<std::string>& words) {
  std::string line;
  for (const std::string& word : words) {
    line += (line.empty() ? "" : ", ") + word;
  }
  return line;
}

std::vector<std::string> adjustment_notes(const Playback& playback, const RobotMotion& motion) {
  const Adjustment& a = playback.adjustment;
  std::vector<std::string> notes;
  notes.push_back("Obstacle height for the playback: " + text("%.3f m", a.obstacle_height) +
                  ", front face " + text("%.2f m", a.front) +
                  " before the place where the motion starts (found by a search over both).");
  notes.push_back("Played from " + text("%.2f s", a.start) + " to " + text("%.2f s", a.end) +
                  " of a recording of " +
                  text("%.2f s.", static_cast<double>(motion.frames.size()) / motion.rate));
  if (std::abs(a.floor) > 0.02) {
    notes.push_back("The climb starts on a step: the robot's path was lowered by " +
                    text("%.3f m.", a.floor));
  }
  notes.push_back("The base was guided along the scaled pelvis path: force up to " +
                  text("%.0f N", playback.peak_guide_force) + ", base off its path by up to " +
                  text("%.0f mm.", 1e3 * playback.worst_base_error));
  return notes;
}

std::set<std::string> obstacle_links(const ContactState& state) {
  std::set<std::string> links;
  for (const ContactReference& contact : state.obstacle) {
    links.insert(contact.link);
  }
  return links;
}

/// Contact sets that the reduction drops for good.
void add_reduction_notes(const ContactSequence& sequence, std::vector<std::string>& notes) {
  std::set<std::set<std::string>> kept;
  for (const ContactState& state : sequence.reduced) {
    kept.insert(obstacle_links(state));
  }
  for (const ContactState& state : sequence.states) {
    if (kept.insert(obstacle_links(state)).second) {
      notes.push_back("Never absolutely stable, so not in the reduced sequence: " +
                      joined(obstacle_links(state)) + text(" (first at %.2f s).", state.start));
    }
  }
}

/// Links that touched without being contacts, and contact links that never touched.
void add_touch_notes(const RobotModel& model, const Playback& playback,
                     const std::vector<ContactState>& states, std::vector<std::string>& notes) {
  std::set<std::string> others;
  for (const ContactSample& sample : playback.samples) {
    others.insert(sample.others.begin(), sample.others.end());
  }
  if (!others.empty()) {
    notes.push_back("Also touched the obstacle (no contact of the sequence): " + joined(others) +
                    ".");
  }
  std::set<std::string> missing;
  for (const ContactLink& link : model.contacts) {
    const bool found = std::any_of(states.begin(), states.end(), [&](const ContactState& state) {
      return std::any_of(state.obstacle.begin(), state.obstacle.end(),
                         [&](const ContactReference& c) { return c.link == link.name; });
    });
    if (!found && !link.is_patch) {
      missing.insert(link.name);
    }
  }
  if (!missing.empty()) {
    notes.push_back("Never on the obstacle in this demonstration: " + joined(missing) + ".");
  }
}

}  // namespace

Playback play(const RobotModel& model, const RobotMotion& motion, const Scenario& scenario,
              const PlaybackConfig& config) {
  Playback playback;
  playback.adjustment = find_adjustment(model, motion, config.adjustment);
  const Adjustment& adjustment = playback.adjustment;
  playback.scenario = adjusted_scenario(scenario, adjustment.obstacle_height);

  OdeOptions options;
  options.step = config.step;
  options.iterations = config.iterations;
  OdeWorld world(model, playback.scenario, options);
  const Reference reference(motion, adjustment);
  const ContactSampler sampler(model, playback.scenario.obstacles.front(), config.sampler);
  PositionControl control(model, config.step);
  world.reset(reference.at(adjustment.start));

  const auto per_sample = std::lround(config.sample_period / config.step);
  const auto steps = std::lround((adjustment.end - adjustment.start) / config.step);
  for (long k = 0; k <= steps; ++k) {
    const double time = adjustment.start + static_cast<double>(k) * config.step;
    const Configuration wanted = reference.at(time);
    if (k % per_sample == 0) {
      // Without the guide's give, see the header.
      const ContactSample* before = playback.samples.empty() ? nullptr : &playback.samples.back();
      ContactSample sample = sampler.sample(time, {wanted.X_WB, world.configuration().q}, before);
      playback.samples.push_back(std::move(sample));
    }
    world.set_base_guide(wanted.X_WB);
    world.step(control.torque(wanted.q, world.configuration().q, world.velocity()));
    playback.peak_guide_force = std::max(playback.peak_guide_force, world.guide_force().norm());
    playback.worst_base_error =
        std::max(playback.worst_base_error, (world.configuration().X_WB.p - wanted.X_WB.p).norm());
  }
  return playback;
}

ContactSequence contacts_of(const RobotModel& model, const RobotMotion& motion,
                            const Playback& playback, const PlaybackConfig& config) {
  ContactSequence sequence;
  sequence.recording = motion.recording;
  sequence.synthetic = motion.synthetic;
  sequence.robot = model.name;
  sequence.playback_obstacle_height = playback.adjustment.obstacle_height;
  for (const Joint& joint : model.joints) {
    sequence.joint_names.push_back(joint.name);
  }
  sequence.states = build_states(playback.samples, contact_names(model), config.states);
  if (sequence.states.empty()) {
    throw PlanningFailed(motion.recording + ": no link stays on the obstacle in the playback");
  }
  sequence.reduced = reduce(sequence.states);
  sequence.notes = adjustment_notes(playback, motion);
  add_touch_notes(model, playback, sequence.states, sequence.notes);
  add_reduction_notes(sequence, sequence.notes);
  return sequence;
}

ContactSequence extract_contacts(const RobotModel& model, const RobotMotion& motion,
                                 const Scenario& scenario, const PlaybackConfig& config) {
  return contacts_of(model, motion, play(model, motion, scenario, config), config);
}

}  // namespace clamber
