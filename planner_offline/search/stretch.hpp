// A stretch of the climb: a motion on contacts that stay, or weight going over in one posture.
// Any thread; allocates; never blocks.
#pragma once

#include <string>
#include <vector>

#include "planner_offline/contacts/contact.hpp"

namespace clamber {

/// Where a stretch begins and ends: a posture and what carries it.
struct Node {
  Configuration x;
  ContactSet contacts;
};

/// A stretch of the climb during which nothing lands or lifts.
struct Stretch {
  enum class Kind {
    kMotion,  ///< the posture moves, `contacts` carry
    kLoad,    ///< the posture rests, weight goes over from `contacts` to `next_contacts`
  };
  std::string name;
  Kind kind = Kind::kMotion;
  std::vector<Configuration> path;
  ContactSet contacts;
  ContactSet next_contacts;  ///< kLoad only
  std::vector<int> landing;  ///< kMotion: links on their way to a surface, or just off one
};

/// The posture a share `t` (0..1) of the way from a to b, joints and base straight.
[[nodiscard]] Configuration between(const Configuration& a, const Configuration& b, double t);

/// The contacts that have to hold all through a stretch: while weight goes over, the smaller set.
[[nodiscard]] const ContactSet& carrying(const Stretch& stretch);

/// The stretches with every load ending as the motion after it holds its contacts: a foot that will
/// roll over its toes has its heel unloaded by then, and torques do not jump.
[[nodiscard]] std::vector<Stretch> joined(std::vector<Stretch> stretches);

/// The way back: last posture first. What stands still going there stands still going back.
[[nodiscard]] std::vector<Stretch> reversed(const std::vector<Stretch>& stretches);

/// The same stretches elsewhere: everything in the world moved by `X`, a turn about the vertical
/// and a level shift, `surface` kept.
[[nodiscard]] std::vector<Stretch> moved(std::vector<Stretch> stretches, const Pose& X);

}  // namespace clamber
