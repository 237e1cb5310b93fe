// Prints contact states as the paper's tables do (III-C).
// Any thread; allocates; never blocks.
#pragma once

#include <span>
#include <string>

#include "planner_offline/contacts/contact_sequence.hpp"

namespace clamber {

/// One column per state, rows of contact names, last row "s = 0" or "s > 0". Names of links that
/// stand on the floor are in brackets, below those on the obstacle:
///
///     State1    State2
///     Lwrist    Lwrist
///     Rwrist    Rwrist
///     (Lfoot)   Lelb
///     (Rfoot)   Relb
///     s > 0     s = 0
[[nodiscard]] std::string contact_table(std::span<const ContactState> states);

}  // namespace clamber
