#include "planner_offline/search/way_search.hpp"

#include <algorithm>

#include "planner_offline/certify/support_region.hpp"
#include "planner_offline/search/touch_sampler.hpp"

namespace clamber {
namespace {

constexpr double kArrived = 0.02;  // rad
constexpr int kStride = 25;        // steps from vertex to vertex

bool arrived(const JointVector& q, const JointVector& to) {
  return (q - to).cwiseAbs().maxCoeff() <= kArrived;
}

template <typename Tree>
int nearest(const Tree& tree, const JointVector& q) {
  const auto it = std::min_element(tree.begin(), tree.end(), [&q](const auto& a, const auto& b) {
    return (a.x.q - q).squaredNorm() < (b.x.q - q).squaredNorm();
  });
  return static_cast<int>(it - tree.begin());
}

/// From the root to the last vertex.
template <typename Tree>
std::vector<Configuration> branch(const Tree& tree) {
  std::vector<Configuration> way;
  for (int i = static_cast<int>(tree.size()) - 1; i >= 0;
       i = tree[static_cast<std::size_t>(i)].parent) {
    way.push_back(tree[static_cast<std::size_t>(i)].x);
  }
  std::reverse(way.begin(), way.end());
  return way;
}

/// The contacts as `x` holds them: soles where they are, spheres without slip.
ContactSet held_at(const RobotModel& model, const Configuration& x, ContactSet contacts) {
  RobotData data;
  forward_kinematics(model, x, data);
  for (Contact& contact : contacts) {
    const ContactLink& link = model.contacts[static_cast<std::size_t>(contact.link)];
    contact.slip.setZero();
    contact.anchor = data.X_WB[static_cast<std::size_t>(link.body)];
  }
  return contacts;
}

}  // namespace

WaySearch::WaySearch(const RobotModel& model, const Clearance& clearance,
                     const PlannerSettings& settings)
    : model_(model),
      settings_(settings),
      ik_(model, clearance, settings.ik),
      forces_(model, settings.forces) {}

/// One inverse-kinematics step towards `to`; false: it came no nearer.
bool WaySearch::step(Vertex& vertex, const JointVector& to, const WayRules& rules) {
  RobotData data;
  forward_kinematics(model_, vertex.x, data);
  Task posture = posture_task(model_, vertex.x.q, to, JointVector::Ones(model_.joint_count()));
  posture.e = shortened(posture.e, settings_.ik.joint_step);
  const SupportRegion region(contact_points(model_, data, vertex.contacts));
  IkConstraints constraints;
  constraints.contacts = &rules.contacts;
  constraints.landing = rules.landing;
  constraints.region = &region;
  constraints.region_margin = rules.region_margin;
  VelocityVector dv;
  if (ik_.step(vertex.x, data, holding(model_, data, vertex.contacts) / posture, constraints, dv) !=
      HqpStatus::optimal) {
    return false;
  }
  Configuration next;
  integrate(model_, vertex.x, dv, next);
  RobotData after;
  forward_kinematics(model_, next, after);
  track_slip(model_, data, after, vertex.contacts);
  constexpr double kNearer = 2e-3;  // rad
  const bool nearer = (next.q - to).norm() < (vertex.x.q - to).norm() - kNearer;
  vertex.x = next;
  return nearer;
}

/// Grows the tree from one of its vertices towards `to`.
WaySearch::Reached WaySearch::extend(Tree& tree, int from, const JointVector& to,
                                     const WayRules& rules, int steps) {
  Vertex vertex = tree[static_cast<std::size_t>(from)];
  vertex.parent = from;
  vertex.path.clear();
  bool more = true;
  for (int i = 0; i < steps && more && !arrived(vertex.x.q, to); ++i) {
    more = step(vertex, to, rules);
    vertex.path.push_back(vertex.x);
  }
  const bool there = arrived(vertex.x.q, to);
  if (vertex.path.size() < 2 && !there) {
    return Reached::kNo;
  }
  constexpr double kSlip = 3e-3;  // m
  const bool slips = std::any_of(vertex.contacts.begin(), vertex.contacts.end(),
                                 [](const Contact& c) { return c.slip.norm() > kSlip; });
  RobotData data;
  forward_kinematics(model_, vertex.x, data);
  if (slips || forces_.solve(data, vertex.contacts).status != Equilibrium::kFeasible) {
    return Reached::kNo;
  }
  tree.push_back(std::move(vertex));
  return there ? Reached::kFully : Reached::kPartly;
}

WaySearch::Reached WaySearch::connect(Tree& tree, const JointVector& to, const WayRules& rules) {
  Reached reached = extend(tree, nearest(tree, to), to, rules, kStride);
  while (reached == Reached::kPartly) {
    reached = extend(tree, static_cast<int>(tree.size()) - 1, to, rules, kStride);
  }
  return reached;
}

/// Goes along the way in strides as long as possible. Contacts roll along: what the second tree
/// found from its end is made here from the beginning.
std::vector<Configuration> WaySearch::follow(const Configuration& from,
                                             const std::vector<Configuration>& way,
                                             const WayRules& rules) {
  constexpr int kSteps = 200;
  Tree tree(1);
  tree[0].x = from;
  tree[0].contacts = held_at(model_, from, rules.contacts);
  std::vector<Configuration> path{from};
  for (std::size_t next = 0; next < way.size();) {
    std::size_t ahead = way.size() - next;
    Reached reached = Reached::kNo;
    while (reached != Reached::kFully && ahead > 0) {
      tree.resize(1);
      reached = extend(tree, 0, way[next + ahead - 1].q, rules, kSteps);
      ahead = reached == Reached::kFully ? ahead : ahead / 2;
    }
    if (reached != Reached::kFully) {
      return {};
    }
    path.insert(path.end(), tree.back().path.begin(), tree.back().path.end());
    tree.front() = tree.back();
    tree.front().parent = -1;
    next += ahead;
  }
  return path;
}

/// A posture around those between the two.
JointVector WaySearch::target(const Configuration& from, const Configuration& to) {
  constexpr double kSpread = 0.5;  // rad
  const double share = static_cast<double>(random_()) / 4294967296.0;
  JointVector q = from.q + share * (to.q - from.q);
  for (int j = 0; j < model_.joint_count(); ++j) {
    const Joint& joint = model_.joints[static_cast<std::size_t>(j)];
    q[j] = std::clamp(q[j] + kSpread * normal(random_), joint.lower + settings_.ik.limit_margin,
                      joint.upper - settings_.ik.limit_margin);
  }
  return q;
}

std::vector<Configuration> WaySearch::find(const Configuration& from, const Configuration& to,
                                           const WayRules& rules) {
  random_.seed(static_cast<std::mt19937::result_type>(settings_.search.seed));
  Tree trees[2] = {Tree(1), Tree(1)};
  trees[0][0].x = from;
  trees[1][0].x = to;
  for (Tree& tree : trees) {
    tree[0].contacts = held_at(model_, tree[0].x, rules.contacts);
  }
  JointVector towards = to.q;
  std::size_t growing = 0;
  for (std::size_t tries = 0; tries < settings_.search.most_way_nodes; ++tries) {
    Tree& one = trees[growing];
    Tree& other = trees[1 - growing];
    if (extend(one, nearest(one, towards), towards, rules, kStride) != Reached::kNo &&
        connect(other, one.back().x.q, rules) == Reached::kFully) {
      std::vector<Configuration> way = branch(trees[0]);
      const std::vector<Configuration> rest = branch(trees[1]);
      way.insert(way.end(), rest.rbegin(), rest.rend());
      const std::vector<Configuration> path = follow(from, way, rules);
      if (!path.empty()) {
        return path;
      }
    }
    growing = 1 - growing;
    towards = target(from, to);
  }
  return {};
}

}  // namespace clamber
