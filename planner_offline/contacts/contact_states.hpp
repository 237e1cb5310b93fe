// From contacts at every sample to contact states (paper III-C): de-bounced, a state per change.
// Any thread; allocates; never blocks.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "planner_offline/contacts/contact_sequence.hpp"

namespace clamber {

/// What touched what at one sample of the playback.
struct ContactSample {
  double time = 0.0;                       ///< s on the recording's clock
  std::vector<ContactReference> obstacle;  ///< contact links on the obstacle's top face
  std::vector<ContactReference> floor;     ///< contact links on the floor
  double stability = 0.0;                  ///< s of the contacts together, see state_stability()
  Configuration posture;
  std::vector<std::string> others;  ///< anything else that touched, geom names, e.g. "l_forearm"
};

struct StateConfig {
  /// A contact that comes or goes for less than this is a flicker, s: a break shorter than this is
  /// closed, then a touch shorter than this is dropped, then a state shorter than this (two links
  /// landing one after the other) is counted to the state that follows it.
  double debounce = 0.2;
  /// A contact that has moved by more than this begins a new state with the same links, m. (The
  /// paper's duplicated states: "the position distance between contact states [is] not ignored".)
  double moved = 0.05;
};

/// The contact states of a playback, in order; samples without obstacle contact make none. A state
/// takes s, posture and reference positions from its best supported sample (smallest s of the
/// sample, then smallest mean s of its contacts, then the earliest).
/// @param samples in the order of time, evenly spaced
/// @param links every contact link's name, in the order in which states list them
[[nodiscard]] std::vector<ContactState> build_states(std::span<const ContactSample> samples,
                                                     std::span<const std::string> links,
                                                     const StateConfig& config);

}  // namespace clamber
