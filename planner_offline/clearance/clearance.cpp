#include "planner_offline/clearance/clearance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace clamber {
namespace {

constexpr double kIgnored = -1.0;  // m, margin of a pair that is meant to touch
/// A link about to land may touch an obstacle that is elsewhere this far below its top, m.
constexpr double kLandingEdge = 0.010;

/// A capsule's ends and a box's corners too: one witness alone would leave rotation unconstrained
/// where an edge runs parallel to the surface.
void add_witnesses(const Solid& solid, std::vector<Solid>& parts) {
  if (solid.shape == Shape::kCapsule) {
    for (const double end : {-0.5, 0.5}) {
      Solid sphere;
      sphere.radius = solid.radius;
      sphere.X_WG.p = solid.X_WG.p + end * solid.length * solid.X_WG.R.col(2);
      parts.push_back(sphere);
    }
  } else if (solid.shape == Shape::kBox) {
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d sign((corner & 1) ? 1 : -1, (corner & 2) ? 1 : -1,
                                 (corner & 4) ? 1 : -1);
      Solid point;
      point.X_WG.p = solid.X_WG * sign.cwiseProduct(solid.half_extents);
      parts.push_back(point);
    }
  }
}

}  // namespace

ClearanceSettings where_it_is(ClearanceSettings settings) {
  settings.elsewhere = {};
  return settings;
}

void append(Inequalities& rows, const Eigen::RowVectorXd& C, double d) {
  const Eigen::Index n = rows.d.size();
  rows.C.conservativeResize(n + 1, C.cols());
  rows.C.row(n) = C;
  rows.d.conservativeResize(n + 1);
  rows.d[n] = d;
}

Clearance::Clearance(const RobotModel& model, const Scenario& scenario,
                     const ClearanceSettings& settings)
    : model_(model),
      settings_(settings),
      start_(scenario.start_position),
      contact_of_geom_(model.geoms.size(), -1) {
  for (const ObstacleBox& box : scenario.obstacles) {
    obstacles_.push_back(solid_of(box));
    heights_.push_back(box.top());
  }
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    contact_of_geom_[static_cast<std::size_t>(model.contacts[i].geom)] = static_cast<int>(i);
  }
}

double Clearance::margin_near_contact(int body) const {
  const auto links = std::count_if(model_.contacts.begin(), model_.contacts.end(),
                                   [body](const ContactLink& link) { return link.body == body; });
  return links >= 2 ? settings_.lying : settings_.landing;
}

/// Turned about the start, a point moves along an axis by its lever across that axis, and by a
/// little of the lever along it.
Solid Clearance::grown(const Solid& obstacle, const Solid& link, double up) const noexcept {
  const ObstacleElsewhere& elsewhere = settings_.elsewhere;
  const Eigen::Matrix3d axes = obstacle.X_WG.R;
  const Eigen::Vector3d lever =
      (axes.transpose() * (link.X_WG.p - start_)).cwiseAbs() + extent_of(link, axes);
  const auto out = [&](double across, double along) {
    return elsewhere.position + elsewhere.yaw * (across + 0.5 * elsewhere.yaw * along);
  };
  Solid box = obstacle;
  box.half_extents +=
      Eigen::Vector3d(out(lever.y(), lever.x()), out(lever.x(), lever.y()), 0.5 * up);
  box.X_WG.p.z() += 0.5 * up;
  return box;
}

Clearance::Role Clearance::role_of(int geom, const ContactSet& contacts,
                                   const std::vector<int>& landing) const noexcept {
  const int body = model_.geoms[static_cast<std::size_t>(geom)].body;
  const auto is_of_body = [&](int link) {
    return model_.contacts[static_cast<std::size_t>(link)].body == body;
  };
  if (std::any_of(contacts.begin(), contacts.end(), [&](const Contact& contact) {
        return contact.surface != kFloor && is_of_body(contact.link);
      })) {
    return Role::kRests;
  }
  return std::any_of(landing.begin(), landing.end(), is_of_body) ? Role::kLands : Role::kFree;
}

double Clearance::environment_margin(const RobotData& data, int geom, int surface,
                                     const ContactSet& contacts,
                                     const std::vector<int>& landing) const {
  const int body = model_.geoms[static_cast<std::size_t>(geom)].body;
  const int own_link = contact_of_geom_[static_cast<std::size_t>(geom)];
  double margin = settings_.obstacle;
  int on_body = 0;  // contacts that this geom's body makes with the surface
  for (const Contact& contact : contacts) {
    if (contact.surface != surface) {
      continue;
    }
    if (contact.link == own_link) {
      // A foot on its toe edge may lift its heel, not push it through the floor.
      constexpr double kOnEdge = -1e-3;
      return contact.mode == ContactMode::kToe ? kOnEdge : kIgnored;
    }
    if (model_.contacts[static_cast<std::size_t>(contact.link)].body == body) {
      margin = margin_near_contact(body);
      ++on_body;
    }
  }
  if (on_body >= 2) {
    return kIgnored;  // a forearm that lies on elbow and wrist is where these two put it
  }
  for (const int link : landing) {
    const bool own = link == own_link;
    if (surface == kFloor ||
        (!own && model_.contacts[static_cast<std::size_t>(link)].body != body)) {
      continue;
    }
    // The nearer the landing link is to the surface, the less clearance is left to ask for.
    const double above =
        touch_point(model_, data, link).z() - heights_[static_cast<std::size_t>(surface)];
    const double least = own ? 0.0 : margin_near_contact(body);
    margin = std::min(margin, std::clamp(0.6 * above, least, settings_.obstacle));
  }
  return margin;
}

void Clearance::find_near(const RobotData& data, const ContactSet& contacts,
                          const std::vector<int>& landing, double within,
                          std::vector<Near>& found) const {
  found.clear();
  std::vector<Solid> solids(model_.geoms.size());
  for (std::size_t g = 0; g < solids.size(); ++g) {
    solids[g] = place(model_.geoms[g], data.X_WB[static_cast<std::size_t>(model_.geoms[g].body)]);
  }
  std::vector<Solid> parts;
  const auto consider = [&](const Distance& d, double margin, int geom) {
    if (d.value < within) {
      found.push_back({d, margin, model_.geoms[static_cast<std::size_t>(geom)].body, -1, geom, -1});
    }
  };
  /// `obstacle`: the floor if null.
  const auto look = [&](int geom, const Solid* obstacle, const auto& margin_of) {
    const Solid& solid = solids[static_cast<std::size_t>(geom)];
    if (obstacle != nullptr && distance_at_least(solid, *obstacle) > within) {
      return;
    }
    const auto to_surface = [&](const Solid& s) {
      return obstacle == nullptr ? distance_to_floor(s, 0.0) : signed_distance(s, *obstacle);
    };
    const Distance whole = to_surface(solid);
    if (whole.value > within) {
      return;
    }
    const double margin = margin_of();
    if (margin == kIgnored) {
      return;
    }
    consider(whole, margin, geom);
    if (parts.empty()) {
      add_witnesses(solid, parts);
    }
    for (const Solid& part : parts) {
      const Distance d = to_surface(part);
      // Often the end or corner is the nearest point itself: one row for it is enough.
      constexpr double kSamePoint = 1e-9;
      if (!d.on_a.isApprox(whole.on_a, kSamePoint)) {
        consider(d, margin, geom);
      }
    }
  };
  for (std::size_t g = 0; g < solids.size(); ++g) {
    const int geom = static_cast<int>(g);
    parts.clear();
    const Role role = settings_.elsewhere.any() ? role_of(geom, contacts, landing) : Role::kRests;
    for (int surface = kFloor; surface < static_cast<int>(obstacles_.size()); ++surface) {
      const auto margin = [&] {
        return environment_margin(data, geom, surface, contacts, landing);
      };
      const auto spare = [&] { return settings_.spare; };
      if (surface == kFloor) {
        look(geom, nullptr, margin);
        continue;
      }
      const Solid& obstacle = obstacles_[static_cast<std::size_t>(surface)];
      if (role != Role::kFree) {
        look(geom, &obstacle, margin);
      }
      if (role != Role::kRests) {
        const Solid box = grown(obstacle, solids[g],
                                role == Role::kFree ? settings_.elsewhere.height : -kLandingEdge);
        look(geom, &box, spare);
      }
    }
  }
  for (const auto* pairs : {&model_.collision_pairs, &model_.planner_pairs}) {
    for (const auto& [a, b] : *pairs) {
      const Solid& solid_a = solids[static_cast<std::size_t>(a)];
      const Solid& solid_b = solids[static_cast<std::size_t>(b)];
      if (distance_at_least(solid_a, solid_b) > within) {
        continue;
      }
      const Distance d = signed_distance(solid_a, solid_b);
      if (d.value < within) {
        found.push_back({d, settings_.self, model_.geoms[static_cast<std::size_t>(a)].body,
                         model_.geoms[static_cast<std::size_t>(b)].body, a, b});
      }
    }
  }
}

void Clearance::constrain(const RobotData& data, const ContactSet& contacts,
                          const std::vector<int>& landing, bool may_recover,
                          Inequalities& rows) const {
  std::vector<Near> found;
  find_near(data, contacts, landing, settings_.activation, found);
  const auto first = rows.d.size();
  const auto count = static_cast<Eigen::Index>(found.size());
  rows.C.conservativeResize(first + count, model_.velocity_count());
  rows.d.conservativeResize(first + count);
  Jacobian3 J;
  for (Eigen::Index i = 0; i < count; ++i) {
    const Near& near = found[static_cast<std::size_t>(i)];
    point_jacobian(model_, data, near.body_a, near.distance.on_a, J);
    Eigen::RowVectorXd row = near.distance.normal.transpose() * J;
    if (near.body_b >= 0) {
      point_jacobian(model_, data, near.body_b, near.distance.on_b, J);
      row -= near.distance.normal.transpose() * J;
    }
    const double gap = near.distance.value - near.margin;
    // A velocity damper: half of the remaining gap may be used in one step.
    constexpr double kMayClose = 0.5, kRecover = 0.3, kMostRecovered = 0.004;
    rows.C.row(first + i) = row;
    rows.d[first + i] = gap >= 0.0    ? -kMayClose * gap
                        : may_recover ? std::min(-kRecover * gap, kMostRecovered)
                                      : 0.0;
  }
}

ClearanceReport Clearance::report(const RobotData& data, const ContactSet& contacts,
                                  const std::vector<int>& landing) const {
  std::vector<Near> found;
  find_near(data, contacts, landing, 0.5, found);
  ClearanceReport report{0.5, 0.5, 0.5, 0.5, "", ""};
  for (const Near& near : found) {
    const std::string& a = model_.geoms[static_cast<std::size_t>(near.geom_a)].name;
    if (near.body_b >= 0) {
      if (near.distance.value < report.self) {
        report.self = near.distance.value;
        report.self_excess = near.distance.value - near.margin;
        report.worst_self_pair =
            a + " - " + model_.geoms[static_cast<std::size_t>(near.geom_b)].name;
      }
      continue;
    }
    const int own_link = contact_of_geom_[static_cast<std::size_t>(near.geom_a)];
    if (std::find(landing.begin(), landing.end(), own_link) != landing.end()) {
      continue;  // on its way to touch
    }
    report.obstacle = std::min(report.obstacle, near.distance.value);
    if (near.distance.value - near.margin < report.obstacle_excess) {
      report.obstacle_excess = near.distance.value - near.margin;
      report.worst_obstacle_pair = a;
    }
  }
  return report;
}

}  // namespace clamber
