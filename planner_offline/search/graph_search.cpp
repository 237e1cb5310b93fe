#include "planner_offline/search/graph_search.hpp"

#include <algorithm>
#include <iterator>
#include <limits>

#include "planner_offline/planning_failed.hpp"

namespace clamber {
namespace {

const ContactLink& link_of(const RobotModel& model, int link) {
  return model.contacts[static_cast<std::size_t>(link)];
}

std::set<int> links_of(const ContactSet& contacts) {
  std::set<int> links;
  for (const Contact& contact : contacts) {
    links.insert(contact.link);
  }
  return links;
}

std::set<int> links_of(const std::vector<Touch>& touches) {
  std::set<int> links;
  for (const Touch& touch : touches) {
    links.insert(touch.link);
  }
  return links;
}

/// Adds `change` to one of the other side that is its mirror image, or as a change of its own.
void add_paired(const RobotModel& model, std::vector<ContactChange>& changes,
                const ContactChange& change) {
  for (ContactChange& other : changes) {
    const bool lift_pair = other.lifts.size() == 1 && change.lifts.size() == 1 &&
                           other.touches.empty() && change.touches.empty() &&
                           are_a_pair(model, other.lifts.front(), change.lifts.front());
    const bool touch_pair =
        other.touches.size() == 1 && change.touches.size() == 1 && other.lifts.empty() &&
        change.lifts.empty() &&
        are_a_pair(model, other.touches.front().link, change.touches.front().link);
    if (lift_pair || touch_pair) {
      other.lifts.insert(other.lifts.end(), change.lifts.begin(), change.lifts.end());
      other.touches.insert(other.touches.end(), change.touches.begin(), change.touches.end());
      return;
    }
  }
  changes.push_back(change);
}

}  // namespace

std::vector<ContactChange> changes_towards(const RobotModel& model, const ContactSet& now,
                                           const std::vector<Touch>& goal) {
  const std::set<int> held = links_of(now), wanted = links_of(goal);
  const auto in_limb = [&model](const std::set<int>& links, int of, auto&& counts) {
    return std::any_of(links.begin(), links.end(), [&](int link) {
      return link != of && link_of(model, link).limb == link_of(model, of).limb && counts(link);
    });
  };
  std::vector<ContactChange> lighten, make, exchange, take_off;
  for (const Touch& touch : goal) {
    if (held.count(touch.link) != 0) {
      continue;
    }
    ContactChange change{{}, {touch}};
    for (const int link : held) {
      if (link_of(model, link).limb == link_of(model, touch.link).limb && wanted.count(link) == 0) {
        change.lifts.push_back(link);
      }
    }
    // The limb's outermost contact is made first: the inner one lies down after it.
    const bool outer_missing = in_limb(wanted, touch.link, [&](int link) {
      return held.count(link) == 0 &&
             link_of(model, link).support_length > link_of(model, touch.link).support_length;
    });
    if (change.lifts.empty() && !outer_missing) {
      add_paired(model, make, change);
    } else if (!outer_missing) {
      exchange.push_back(change);
    }
  }
  for (const int link : held) {
    if (wanted.count(link) != 0 || in_limb(wanted, link, [](int) { return true; })) {
      continue;  // stays, or goes when its limb's new contact is made
    }
    const bool outer_held = in_limb(held, link, [&](int other) {
      return link_of(model, other).support_length > link_of(model, link).support_length;
    });
    const bool inner_held = in_limb(held, link, [&](int other) {
      return link_of(model, other).support_length < link_of(model, link).support_length;
    });
    if (outer_held) {
      add_paired(model, lighten, {{link}, {}});
    } else if (!inner_held) {
      add_paired(model, take_off, {{link}, {}});
    }
  }
  std::vector<ContactChange> changes = lighten;
  for (const auto* more : {&make, &exchange, &take_off}) {
    changes.insert(changes.end(), more->begin(), more->end());
  }
  return changes;
}

void GraphSearch::reject(const std::string& why, std::size_t left) {
  progress_("rejected: " + why);
  if (left < nearest_) {
    nearest_ = left;
    failure_ = why;
  }
}

bool GraphSearch::descend(const std::vector<Touch>& goal, const JointVector& attractor, Node& node,
                          std::vector<Stretch>& stretches) {
  const std::vector<ContactChange> changes = changes_towards(model_, node.contacts, goal);
  if (changes.empty()) {
    return true;
  }
  constexpr std::size_t kPostures = 3;
  if (++visits_[links_of(node.contacts)] > kPostures) {
    return false;
  }
  std::vector<int> different;
  const std::set<int> held = links_of(node.contacts), wanted = links_of(goal);
  std::set_symmetric_difference(held.begin(), held.end(), wanted.begin(), wanted.end(),
                                std::back_inserter(different));
  for (const ContactChange& change : changes) {
    for (std::size_t skip = 0; skip < kPostures; ++skip) {
      Node to = node;
      std::vector<Stretch> made;
      const Rejection rejection = transition_.make(change, attractor, to, made, skip);
      if (!rejection.why.empty()) {
        reject(rejection.why, different.size());
        break;
      }
      progress_(made.back().name);
      if (descend(goal, attractor, to, made)) {
        stretches.insert(stretches.end(), made.begin(), made.end());
        node = to;
        return true;
      }
    }
  }
  return false;
}

std::vector<Stretch> GraphSearch::find(const std::vector<Touch>& goal, const JointVector& attractor,
                                       Node& node) {
  visits_.clear();
  nearest_ = std::numeric_limits<std::size_t>::max();
  failure_.clear();
  std::vector<Stretch> stretches;
  if (!descend(goal, attractor, node, stretches)) {
    throw PlanningFailed(failure_);
  }
  return stretches;
}

}  // namespace clamber
