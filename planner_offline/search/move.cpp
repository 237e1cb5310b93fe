#include "planner_offline/search/move.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include "planner_offline/planning_failed.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

constexpr double kInsideEdge = 0.12;  // m from the front edge for contacts of our own choosing
constexpr double kTogether = 0.6;  // s: links of a pair that touch within this time land together

int link_index(const RobotModel& model, const std::string& name) {
  const auto link = model.find_contact(name);
  if (!link) {
    throw InputError("contact sequence: robot '" + model.name + "' has no contact link '" + name +
                     "'");
  }
  return *link;
}

/// When a link first touches the obstacle in the full sequence, s.
double first_touch(const ContactSequence& sequence, const std::string& link) {
  for (const ContactState& state : sequence.states) {
    for (const ContactReference& contact : state.obstacle) {
      if (contact.link == link) {
        return state.start;
      }
    }
  }
  return std::numeric_limits<double>::infinity();
}

/// Posture hint: the robot's posture in the first full state that holds `link`, else the state's.
JointVector hint_for(const ContactSequence& sequence, const ContactState& state,
                     const std::string& link) {
  for (const ContactState& full : sequence.states) {
    for (const ContactReference& contact : full.obstacle) {
      if (contact.link == link && full.posture.q.size() == state.posture.q.size()) {
        return full.posture.q;
      }
    }
  }
  return state.posture.q;
}

struct Builder {
  const RobotModel& model;
  const Scenario& scenario;
  const ContactSequence& sequence;
  std::vector<std::string>& notes;
  std::set<int> standing;  // links on the floor
  std::set<int> resting;   // links on the obstacle
  std::vector<Move> moves;
  std::map<std::string, std::string> stands_for;  // a knee in its foot's place -> the foot

  [[nodiscard]] double touched(const std::string& link) const;
  [[nodiscard]] std::optional<ContactReference> kneeling(const ContactReference& foot) const;
  void add_state(std::size_t index);
  void add_move(std::size_t state, const std::vector<ContactReference>& landing);
  void refuse_unreached_goals() const;
  void add_missing_goals();
  void mark_completing_links();
  void insert_intermediate_supports();
};

void Builder::add_move(std::size_t state, const std::vector<ContactReference>& landing) {
  Move move;
  move.state = static_cast<int>(state);
  move.hint = hint_for(sequence, sequence.reduced[state], landing.front().link);
  for (const ContactReference& contact : landing) {
    const int link = link_index(model, contact.link);
    move.lands.push_back(link);
    move.references[link] = contact.position;
    resting.insert(link);
    // A leg cannot stand on the floor and kneel on the obstacle at once.
    for (const int other : std::set<int>(standing)) {
      if (model.contacts[static_cast<std::size_t>(other)].limb ==
          model.contacts[static_cast<std::size_t>(link)].limb) {
        move.lifts.push_back(other);
        standing.erase(other);
      }
    }
  }
  moves.push_back(move);
}

double Builder::touched(const std::string& link) const {
  const auto foot = stands_for.find(link);
  return first_touch(sequence, foot == stands_for.end() ? link : foot->second);
}

/// Where the demonstration steps up and the goal asks for the leg's knee, which the demonstration
/// never sets down: the knee goes where the foot went.
std::optional<ContactReference> Builder::kneeling(const ContactReference& foot) const {
  const auto& limb = model.contacts[static_cast<std::size_t>(link_index(model, foot.link))].limb;
  for (const std::string& name : all_fours_contacts(model, scenario)) {
    const ContactLink& wanted = model.contacts[static_cast<std::size_t>(link_index(model, name))];
    const bool shown = std::any_of(
        sequence.reduced.begin(), sequence.reduced.end(), [&](const ContactState& state) {
          return std::any_of(state.obstacle.begin(), state.obstacle.end(),
                             [&](const ContactReference& c) { return c.link == name; });
        });
    if (wanted.limb == limb && !wanted.is_patch && !shown) {
      ContactReference knee = foot;
      knee.link = name;
      return knee;
    }
  }
  return std::nullopt;
}

void Builder::add_state(std::size_t index) {
  std::vector<ContactReference> fresh;
  for (const ContactReference& contact : sequence.reduced[index].obstacle) {
    const int link = link_index(model, contact.link);
    if (model.contacts[static_cast<std::size_t>(link)].is_patch) {
      if (const auto knee = kneeling(contact)) {
        if (stands_for.emplace(knee->link, contact.link).second) {
          notes.push_back("state " + std::to_string(index + 1) + ": " + contact.link +
                          " on the obstacle: the goal asks for " + knee->link +
                          ", which goes in its place");
          fresh.push_back(*knee);
        }
        continue;
      }
      notes.push_back("state " + std::to_string(index + 1) + ": " + contact.link +
                      " on the obstacle is left out: this goal ends on knees and elbows");
      continue;
    }
    if (resting.count(link) == 0) {
      fresh.push_back(contact);
    }
  }
  std::stable_sort(fresh.begin(), fresh.end(), [this](const auto& a, const auto& b) {
    return touched(a.link) < touched(b.link);
  });
  while (!fresh.empty()) {
    std::vector<ContactReference> together{fresh.front()};
    fresh.erase(fresh.begin());
    const int first = link_index(model, together.front().link);
    const bool arm =
        standing.empty() || std::none_of(standing.begin(), standing.end(), [&](int foot) {
          return model.contacts[static_cast<std::size_t>(foot)].limb ==
                 model.contacts[static_cast<std::size_t>(first)].limb;
        });
    for (auto it = fresh.begin(); arm && it != fresh.end(); ++it) {
      const bool near_in_time = touched(it->link) - touched(together.front().link) <= kTogether;
      if (near_in_time && are_a_pair(model, first, link_index(model, it->link))) {
        together.push_back(*it);
        fresh.erase(it);
        break;
      }
    }
    add_move(index, together);
  }
}

/// A limb that the demonstration never puts on the obstacle is no contact that could be added.
void Builder::refuse_unreached_goals() const {
  std::set<std::string> touching;
  std::string made, missing;
  const auto list = [](std::string& names, const std::string& name) {
    names += (names.empty() ? "" : ", ") + name;
  };
  for (const int link : resting) {
    touching.insert(model.contacts[static_cast<std::size_t>(link)].limb);
    list(made, model.contacts[static_cast<std::size_t>(link)].name);
  }
  for (const std::string& name : all_fours_contacts(model, scenario)) {
    const auto& limb = model.contacts[static_cast<std::size_t>(link_index(model, name))].limb;
    if (touching.count(limb) == 0) {
      list(missing, name);
    }
  }
  if (!missing.empty()) {
    throw PlanningFailed("'" + sequence.recording + "' shows no climb: the goal asks for " +
                         missing + ", and in none of its " +
                         std::to_string(sequence.reduced.size()) +
                         " states with absolute stability does any part of those limbs rest on "
                         "the obstacle (only " +
                         (made.empty() ? "feet" : made) + ")");
  }
}

/// The scenario's goal may ask for contacts that the demonstration never made. A limb that already
/// rests on the obstacle gets them right after its first contact: they only add support.
void Builder::add_missing_goals() {
  for (const std::string& name : all_fours_contacts(model, scenario)) {
    const int link = link_index(model, name);
    if (resting.count(link) != 0) {
      continue;
    }
    const ContactLink& wanted = model.contacts[static_cast<std::size_t>(link)];
    std::size_t after = moves.size();
    Eigen::Vector3d reference = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < moves.size(); ++i) {
      for (const int landed : moves[i].lands) {
        const ContactLink& sibling = model.contacts[static_cast<std::size_t>(landed)];
        if (sibling.limb == wanted.limb) {
          after = i;
          // Behind its sibling by the distance between the two points of the limb, and where that
          // would hang over the front edge, both farther in.
          const double apart = std::abs(sibling.support_length - wanted.support_length);
          Eigen::Vector3d& outer = moves[i].references.at(landed);
          outer.x() = std::max(outer.x(), apart + kInsideEdge);
          reference = outer - Eigen::Vector3d(apart, 0.0, 0.0);
        }
      }
    }
    resting.insert(link);
    notes.push_back("the recording has no contact of " + name + ": added after its " + wanted.limb +
                    "'s first contact, because the goal asks for it");
    // Both sides of a pair go down in one move.
    if (after + 1 < moves.size() && moves[after + 1].lands.size() == 1 &&
        are_a_pair(model, moves[after + 1].lands.front(), link) && moves[after + 1].lifts.empty()) {
      moves[after + 1].lands.push_back(link);
      moves[after + 1].references[link] = reference;
      continue;
    }
    Move move;
    move.state = moves[after].state;
    move.hint = moves[after].hint;
    move.lands = {link};
    move.references[link] = reference;
    moves.insert(moves.begin() + static_cast<std::ptrdiff_t>(after) + 1, move);
  }
}

void Builder::mark_completing_links() {
  for (std::size_t i = 0; i < moves.size(); ++i) {
    for (const int link : moves[i].lands) {
      const auto& limb = model.contacts[static_cast<std::size_t>(link)].limb;
      bool more = false;
      for (std::size_t j = i + 1; j < moves.size() && moves[j].state == moves[i].state; ++j) {
        for (const int later : moves[j].lands) {
          more = more || model.contacts[static_cast<std::size_t>(later)].limb == limb;
        }
      }
      if (!more) {
        moves[i].completes_limb.insert(link);
      }
    }
  }
}

/// A limb that reaches out with nothing under it but the feet bends the robot farthest. It first
/// finds support near by, under its shoulder (the intermediate support of paper IV-D), and is then
/// set down where the recording has it, one limb at a time.
void Builder::insert_intermediate_supports() {
  std::set<std::string> supported;
  for (std::size_t i = 0; i < moves.size(); ++i) {
    const Move reach = moves[i];
    const bool free =
        reach.lifts.empty() && std::none_of(reach.lands.begin(), reach.lands.end(), [&](int link) {
          return supported.count(model.contacts[static_cast<std::size_t>(link)].limb);
        });
    for (const int link : reach.lands) {
      supported.insert(model.contacts[static_cast<std::size_t>(link)].limb);
    }
    if (!free) {
      continue;
    }
    moves[i].completes_limb = {reach.lands.begin(), reach.lands.end()};
    for (const int link : reach.lands) {
      Move again;
      again.state = reach.state;
      again.lands = again.lifts = {link};
      again.surface = reach.surface;
      again.references[link] = reach.references.at(link);
      again.hint = reach.hint;
      again.optional = true;
      moves.insert(moves.begin() + static_cast<std::ptrdiff_t>(++i), again);
    }
  }
}

}  // namespace

Eigen::Vector3d from_edge_frame(const ObstacleBox& box, const Eigen::Vector3d& p) {
  const Eigen::AngleAxisd turn(box.yaw, Eigen::Vector3d::UnitZ());
  return box.center +
         turn * Eigen::Vector3d(p.x() - box.half_extents.x(), p.y(), p.z() + box.half_extents.z());
}

Eigen::Vector3d to_edge_frame(const ObstacleBox& box, const Eigen::Vector3d& p_W) {
  const Eigen::AngleAxisd turn(box.yaw, Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d local = turn.inverse() * (p_W - box.center);
  return {local.x() + box.half_extents.x(), local.y(), local.z() - box.half_extents.z()};
}

std::vector<Move> plan_moves(const RobotModel& model, const Scenario& scenario,
                             const ContactSequence& sequence, std::vector<std::string>& notes) {
  if (sequence.reduced.empty()) {
    throw PlanningFailed("'" + sequence.recording + "' shows no climb: none of its " +
                         std::to_string(sequence.states.size()) +
                         " contact states has absolute stability");
  }
  Builder builder{model, scenario, sequence, notes, {}, {}, {}, {}};
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    if (model.contacts[i].is_patch) {
      builder.standing.insert(static_cast<int>(i));
    }
  }
  for (std::size_t i = 0; i < sequence.reduced.size(); ++i) {
    builder.add_state(i);
  }
  builder.refuse_unreached_goals();
  builder.add_missing_goals();
  builder.mark_completing_links();
  builder.insert_intermediate_supports();
  return builder.moves;
}

}  // namespace clamber
