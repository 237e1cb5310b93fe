#include "planner_offline/references/reference_optimiser.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <set>

namespace clamber {

struct ReferenceOptimiser::Search {
  int state = 0;
  int surface = 0;
  Configuration x;
  RobotData data;
  ContactSet supports;
  ContactSet contacts;                       // supports and new ones
  std::map<int, Eigen::Vector3d> reference;  // X_i
  JointVector hint;
  std::set<int> completes_limb;  // links that the support phase has to bring under load
  int iteration = 0;
};

namespace {

bool is_ancestor(const RobotModel& model, int ancestor, int body) {
  while (body > ancestor) {
    body = model.bodies[static_cast<std::size_t>(body)].parent;
  }
  return body == ancestor;
}

}  // namespace

ReferenceOptimiser::ReferenceOptimiser(const RobotModel& model, const Scenario& scenario,
                                       const Clearance& clearance, const PlannerSettings& settings)
    : model_(model),
      scenario_(scenario),
      settings_(settings),
      clearance_(clearance),
      ik_(model, clearance, settings.ik),
      forces_(model, settings.forces),
      relief_(model, settings.forces) {}

Eigen::Vector3d ReferenceOptimiser::bounded(const Eigen::Vector3d& p, int surface) const {
  return inside_surface(scenario_, surface, p, settings_.references.surface_margin);
}

Eigen::Vector3d ReferenceOptimiser::support_projection(const RobotData& data, int link,
                                                       double height) const {
  const ContactLink& contact = model_.contacts[static_cast<std::size_t>(link)];
  Eigen::Vector3d s =
      data.X_WB[static_cast<std::size_t>(contact.support_body)] * contact.support_point;
  s.z() = height;
  return s;
}

double ReferenceOptimiser::theta(const RobotData& data, int link) const {
  const ContactLink& contact = model_.contacts[static_cast<std::size_t>(link)];
  const Eigen::Vector3d line =
      data.X_WB[static_cast<std::size_t>(contact.support_body)] * contact.support_point -
      touch_point(model_, data, link);
  return std::atan2(line.head<2>().norm(), line.z()) * 180.0 / std::numbers::pi;
}

/// A limb with two contacts is supported when either of them is.
bool ReferenceOptimiser::limb_is_supported(const Search& search, int link) const {
  const std::string& limb = model_.contacts[static_cast<std::size_t>(link)].limb;
  return std::any_of(search.contacts.begin(), search.contacts.end(), [&](const Contact& contact) {
    return model_.contacts[static_cast<std::size_t>(contact.link)].limb == limb &&
           theta(search.data, contact.link) <= settings_.references.theta_max_deg;
  });
}

/// Inverse kinematics with the contact references of the moment; returns IK_error, the largest
/// distance of a new contact from its reference.
double ReferenceOptimiser::solve_posture(Search& search, int iterations, bool collisions) {
  IkConstraints constraints;
  constraints.collisions = collisions;
  constraints.contacts = &search.contacts;
  constraints.landing.reserve(search.reference.size());
  for (const auto& [link, target] : search.reference) {
    constraints.landing.push_back(link);
  }
  for (int i = 0; i < iterations; ++i) {
    const SupportRegion region(contact_points(model_, search.data, search.supports));
    constraints.region = &region;
    constraints.region_margin = only_patches(model_, search.supports)
                                    ? settings_.search.free_margin
                                    : settings_.search.support_margin;
    const Task held = contact_tasks(model_, search.data, search.supports);
    Task reach = empty_task(model_);
    const int support_body =
        search.supports.empty()
            ? 0
            : model_.contacts[static_cast<std::size_t>(search.supports.front().link)].body;
    for (const auto& [link, target] : search.reference) {
      const Eigen::Vector3d touch = touch_point(model_, search.data, link);
      reach = reach + relative_point_task(model_, search.data, support_body,
                                          model_.contacts[static_cast<std::size_t>(link)].body,
                                          touch, shortened(target - touch, 0.02));
    }
    Task posture =
        posture_task(model_, search.x.q, search.hint, JointVector::Ones(model_.joint_count()));
    posture.e = shortened(posture.e, settings_.search.posture_step);
    const TaskStack stack = settings_.references.posture_has_priority
                                ? held / (reach + scaled(posture, 0.05))  // Eq. (6)
                                : (held / reach) / posture;               // Eq. (7)
    VelocityVector dv;
    if (ik_.step(search.x, search.data, stack, constraints, dv) != HqpStatus::optimal) {
      break;
    }
    Configuration next;
    integrate(model_, search.x, dv, next);
    search.x = next;
    forward_kinematics(model_, search.x, search.data);
    if (dv.cwiseAbs().maxCoeff() < 2e-4) {
      break;
    }
  }
  double error = 0.0;
  for (const auto& [link, target] : search.reference) {
    error = std::max(error, (target - touch_point(model_, search.data, link)).norm());
  }
  return error;
}

/// w2 = 0: the references come to where the robot can reach, within the bounds.
void ReferenceOptimiser::reach_phase(Search& search) {
  const ReferenceSettings& s = settings_.references;
  double error = solve_posture(search, 200);
  double best = error;
  int idle = 0;  // iterations without an improvement
  constexpr int kGivenUp = 15;
  while (error >= s.ik_error && search.iteration < s.most_iterations / 2 && idle < kGivenUp) {
    double cost = 0.0;
    for (auto& [link, reference] : search.reference) {
      const Eigen::Vector3d gap = reference - touch_point(model_, search.data, link);
      cost += s.w1 * gap.norm();
      reference = bounded(reference - s.step * s.w1 * gap, search.surface);
    }
    log_.push_back({search.state, 1, search.iteration++, cost, error});
    error = solve_posture(search, 6);
    idle = error < best - 1e-4 ? 0 : idle + 1;
    best = std::min(best, error);
  }
  log_.push_back({search.state, 1, search.iteration++, 0.0, error});
}

/// w1 = 0: the references move under their shoulders and thighs until each limb can support.
void ReferenceOptimiser::support_phase(Search& search) {
  const ReferenceSettings& s = settings_.references;
  double last_cost = std::numeric_limits<double>::infinity();
  for (int i = 0; i < s.most_iterations / 2; ++i) {
    double cost = 0.0;
    const Search before = search;
    bool moved = false;
    for (auto& [link, reference] : search.reference) {
      const Eigen::Vector3d gap = reference - support_projection(search.data, link, reference.z());
      cost += s.w2 * gap.norm();
      if (search.completes_limb.count(link) != 0 && !limb_is_supported(search, link)) {
        reference = bounded(reference - 0.5 * s.step * s.w2 * gap, search.surface);
        moved = true;
      }
    }
    const double error = moved ? solve_posture(search, 6) : 0.0;
    log_.push_back({search.state, 2, search.iteration++, cost, error});
    if (!moved) {
      return;
    }
    constexpr double kWorthwhile = 1e-5;
    if (error >= s.ik_error || cost > last_cost - kWorthwhile) {
      search.x = before.x;
      search.data = before.data;
      search.reference = before.reference;
      return;
    }
    last_cost = cost;
  }
}

/// Beyond the paper: where the supports alone need much torque, the posture is moved down the
/// gradient of the load, within what contacts, support and clearance leave free. The hint follows.
void ReferenceOptimiser::relieve_torque(Search& search) {
  double cost = relief_.measure(search.x, search.supports);
  const double acceptable = std::pow(settings_.references.relief_share, 4);
  double step = 0.06;  // rad of the joint that moves most
  for (int i = 0; i < settings_.references.relief_iterations && cost > acceptable; ++i) {
    const Search before = search;
    search.hint = search.x.q + relief_.direction(search.x, search.supports, cost, step);
    const double error = solve_posture(search, 3);
    const double now = relief_.measure(search.x, search.supports);
    log_.push_back({search.state, 3, search.iteration++, now, error});
    if (now < cost && error < settings_.references.ik_error) {
      cost = now;
      continue;
    }
    search.x = before.x;
    search.data = before.data;
    search.hint = before.hint;
    step *= 0.5;
    constexpr double kFinest = 2e-3;
    if (step < kFinest) {
      break;
    }
  }
  search.hint = search.x.q;
}

/// Puts the joints of the landing limbs where the recording has them: a limb that has to pass an
/// edge finds no way there step by step, and the way is the search's business (IV-D).
void ReferenceOptimiser::start_from_hint(Search& search) const {
  for (const auto& [link, reference] : search.reference) {
    for (int body = model_.contacts[static_cast<std::size_t>(link)].body; body > 0;
         body = model_.bodies[static_cast<std::size_t>(body)].parent) {
      const bool shared =
          std::any_of(search.supports.begin(), search.supports.end(), [&](const Contact& c) {
            return is_ancestor(model_, body,
                               model_.contacts[static_cast<std::size_t>(c.link)].body);
          });
      if (shared) {
        break;
      }
      search.x.q[body - 1] = search.hint[body - 1];
    }
  }
  forward_kinematics(model_, search.x, search.data);
}

TouchKeyframe ReferenceOptimiser::finish(Search& search) {
  TouchKeyframe keyframe;
  keyframe.ik_error = solve_posture(search, 80);
  keyframe.x = search.x;
  keyframe.contacts = search.contacts;
  for (const Contact& contact : search.contacts) {
    keyframe.theta_deg[contact.link] = theta(search.data, contact.link);
    keyframe.positions[contact.link] = touch_point(model_, search.data, contact.link);
  }
  keyframe.forces = forces_.solve(search.data, search.supports);
  const ClearanceReport clear = clearance_.report(search.data, search.contacts, {});
  constexpr double kTolerance = 2e-3;  // m: rows are met to first order only
  constexpr double kNominal = 0.05;    // m
  char text[200] = "";
  std::string binding;
  if (keyframe.ik_error >= settings_.references.ik_error) {
    binding = ik_.binding(search.x, search.data, {.contacts = &search.contacts, .landing = {}});
    keyframe.shortfall = keyframe.ik_error;
    std::snprintf(text, sizeof text, "contact out of reach by %.1f cm", 100.0 * keyframe.ik_error);
  } else if (clear.obstacle_excess < -kTolerance) {
    keyframe.shortfall = -clear.obstacle_excess;
    std::snprintf(text, sizeof text, "%s is %.1f cm too near to the obstacle or floor",
                  clear.worst_obstacle_pair.c_str(), -100.0 * clear.obstacle_excess);
  } else if (clear.self < 0.0) {
    keyframe.shortfall = -clear.self;
    std::snprintf(text, sizeof text, "links collide: %s", clear.worst_self_pair.c_str());
  } else if (keyframe.forces.status == Equilibrium::kBalance) {
    keyframe.shortfall = kNominal;
    const double inside = SupportRegion(contact_points(model_, search.data, search.supports))
                              .margin(search.data.com.head<2>());
    std::snprintf(text, sizeof text,
                  "no contact forces balance the robot: its centre of mass is %.1f cm outside of "
                  "its contacts",
                  -100.0 * inside);
  } else if (keyframe.forces.status == Equilibrium::kTorque) {
    keyframe.shortfall = kNominal;
    const Joint& joint = model_.joints[static_cast<std::size_t>(keyframe.forces.peak_joint)];
    std::snprintf(text, sizeof text, "%s needs %.1f N m of %.1f", joint.name.c_str(),
                  keyframe.forces.peak_torque, joint.torque_limit * settings_.forces.torque_share);
  }
  keyframe.problem = text + binding;
  return keyframe;
}

TouchKeyframe ReferenceOptimiser::optimise(int state, const Configuration& start,
                                           const ContactSet& supports,
                                           const std::map<int, Eigen::Vector3d>& wanted,
                                           const std::set<int>& completes_limb, int surface,
                                           const JointVector& hint) {
  const auto begin = std::chrono::steady_clock::now();
  TouchKeyframe keyframe;
  for (const bool from_hint : {true, false}) {
    Search search;
    search.state = state;
    search.surface = surface;
    search.x = start;
    search.supports = supports;
    search.hint = hint;
    search.completes_limb = completes_limb;
    search.contacts = supports;
    forward_kinematics(model_, search.x, search.data);
    for (const auto& [link, reference] : wanted) {
      search.reference[link] = bounded(reference, surface);
      search.contacts.push_back(make_contact(model_, scenario_, search.data, link, surface));
    }
    if (from_hint) {
      start_from_hint(search);
    }
    reach_phase(search);
    support_phase(search);
    (void)solve_posture(search, 60);
    relieve_torque(search);
    keyframe = finish(search);
    if (keyframe.problem.empty()) {
      break;
    }
  }
  seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return keyframe;
}

}  // namespace clamber
