#include "planner_offline/contacts/contact.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

const ContactLink& link_of(const RobotModel& model, int link) {
  return model.contacts[static_cast<std::size_t>(link)];
}

/// The two patch points farthest along the anchor's forward axis: the edge a foot rolls over.
std::vector<Eigen::Vector3d> front_points(const ContactLink& link) {
  std::vector<Eigen::Vector3d> points = link.points;
  std::stable_sort(points.begin(), points.end(),
                   [](const auto& a, const auto& b) { return a.x() > b.x(); });
  points.resize(std::min<std::size_t>(points.size(), 2));
  return points;
}

}  // namespace

double surface_height(const Scenario& scenario, int surface) {
  return surface == kFloor ? 0.0 : scenario.obstacles[static_cast<std::size_t>(surface)].top();
}

Eigen::Vector3d inside_surface(const Scenario& scenario, int surface, const Eigen::Vector3d& p,
                               double margin) {
  if (surface == kFloor) {
    return {p.x(), p.y(), 0.0};
  }
  const ObstacleBox& box = scenario.obstacles[static_cast<std::size_t>(surface)];
  const Eigen::AngleAxisd turn(box.yaw, Eigen::Vector3d::UnitZ());
  Eigen::Vector3d local = turn.inverse() * (p - box.center);
  for (int axis = 0; axis < 2; ++axis) {
    const double most = std::max(0.0, box.half_extents[axis] - margin);
    local[axis] = std::clamp(local[axis], -most, most);
  }
  local.z() = box.half_extents.z();
  return box.center + turn * local;
}

Contact make_contact(const RobotModel& model, const Scenario& scenario, const RobotData& data,
                     int link, int surface) {
  const ContactLink& contact_link = link_of(model, link);
  Contact contact;
  contact.link = link;
  contact.surface = surface;
  contact.mode = contact_link.is_patch ? ContactMode::kPatch : ContactMode::kPoint;
  contact.height = surface_height(scenario, surface);
  contact.anchor = data.X_WB[static_cast<std::size_t>(contact_link.body)];
  return contact;
}

Eigen::Vector3d touch_point(const RobotModel& model, const RobotData& data, int link) {
  const ContactLink& contact_link = link_of(model, link);
  const Pose& X_WB = data.X_WB[static_cast<std::size_t>(contact_link.body)];
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : contact_link.points) {
    centre += X_WB * point;
  }
  centre /= static_cast<double>(contact_link.points.size());
  centre.z() -= contact_link.radius;
  return centre;
}

std::vector<Eigen::Vector3d> contact_points(const RobotModel& model, const RobotData& data,
                                            const Contact& contact) {
  const ContactLink& link = link_of(model, contact.link);
  if (contact.mode == ContactMode::kPoint) {
    return {touch_point(model, data, contact.link)};
  }
  const Pose& X_WB = data.X_WB[static_cast<std::size_t>(link.body)];
  std::vector<Eigen::Vector3d> points =
      contact.mode == ContactMode::kToe ? front_points(link) : link.points;
  for (Eigen::Vector3d& point : points) {
    point = X_WB * point;
  }
  return points;
}

std::vector<Eigen::Vector3d> contact_points(const RobotModel& model, const RobotData& data,
                                            const ContactSet& contacts) {
  std::vector<Eigen::Vector3d> points;
  for (const Contact& contact : contacts) {
    const auto own = contact_points(model, data, contact);
    points.insert(points.end(), own.begin(), own.end());
  }
  return points;
}

Task contact_task(const RobotModel& model, const RobotData& data, const Contact& contact) {
  const ContactLink& link = link_of(model, contact.link);
  if (contact.mode == ContactMode::kPatch) {
    return pose_task(model, data, link.body, contact.anchor);
  }
  if (contact.mode == ContactMode::kPoint) {
    const Eigen::Vector3d bottom = touch_point(model, data, contact.link);
    return point_task(model, data, link.body, bottom,
                      {-contact.slip.x(), -contact.slip.y(), contact.height - bottom.z()});
  }
  Task task = empty_task(model);
  const Pose& X_WB = data.X_WB[static_cast<std::size_t>(link.body)];
  for (const Eigen::Vector3d& point : front_points(link)) {
    const Eigen::Vector3d now = X_WB * point;
    task = task + point_task(model, data, link.body, now, contact.anchor * point - now);
  }
  return task;
}

Task contact_tasks(const RobotModel& model, const RobotData& data, const ContactSet& contacts) {
  Task held = empty_task(model);
  for (const Contact& contact : contacts) {
    held = held + contact_task(model, data, contact);
  }
  return held;
}

void track_slip(const RobotModel& model, const RobotData& before, const RobotData& after,
                ContactSet& contacts) {
  for (Contact& contact : contacts) {
    if (contact.mode != ContactMode::kPoint) {
      continue;
    }
    const ContactLink& link = link_of(model, contact.link);
    const auto body = static_cast<std::size_t>(link.body);
    const Eigen::Vector3d turn = rotation_log(after.X_WB[body].R * before.X_WB[body].R.transpose());
    const Eigen::Vector3d moved =
        touch_point(model, after, contact.link) - touch_point(model, before, contact.link);
    const Eigen::Vector3d rolled = turn.cross(Eigen::Vector3d(0.0, 0.0, link.radius));
    contact.slip += (moved - rolled).head<2>();
  }
}

bool only_patches(const RobotModel& model, const ContactSet& contacts) {
  return std::all_of(contacts.begin(), contacts.end(),
                     [&](const Contact& c) { return link_of(model, c.link).is_patch; });
}

bool are_a_pair(const RobotModel& model, int a, int b) {
  const ContactLink& la = link_of(model, a);
  const ContactLink& lb = link_of(model, b);
  return la.limb != lb.limb && la.is_patch == lb.is_patch &&
         std::abs(la.support_length - lb.support_length) < 1e-3;
}

bool holds_limb(const RobotModel& model, const ContactSet& contacts, int link) {
  return std::any_of(contacts.begin(), contacts.end(), [&](const Contact& c) {
    return c.link != link && link_of(model, c.link).limb == link_of(model, link).limb;
  });
}

void press_outer_contacts(const RobotModel& model, const Scenario& scenario, double depth,
                          ContactSet& contacts) {
  for (Contact& contact : contacts) {
    const ContactLink& link = link_of(model, contact.link);
    const bool outer = std::any_of(contacts.begin(), contacts.end(), [&](const Contact& other) {
      const ContactLink& inner = link_of(model, other.link);
      return inner.limb == link.limb && inner.support_length < link.support_length;
    });
    contact.height = surface_height(scenario, contact.surface) - (outer ? depth : 0.0);
  }
}

ContactSet without(const ContactSet& contacts, const std::vector<int>& links) {
  ContactSet rest;
  for (const Contact& contact : contacts) {
    if (std::find(links.begin(), links.end(), contact.link) == links.end()) {
      rest.push_back(contact);
    }
  }
  return rest;
}

}  // namespace clamber
