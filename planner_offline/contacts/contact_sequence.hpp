// The contact sequence of a demonstration: what the playback analysis finds and the planner
// follows. Start-up only: allocates, reads and writes contacts.yaml, throws InputError.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "robot_model/model.hpp"

namespace clamber {

/// One active contact: link against surface, with its reference position (paper III-C).
struct ContactReference {
  std::string link;     ///< ContactLink::name, e.g. "Lwrist"
  std::string surface;  ///< obstacle name or "floor"
  /// Contact position in the obstacle's edge frame, m: x from the front face inwards, y from the
  /// obstacle's centre line to the left, z from its top upwards. (Floor contacts: same frame.)
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double stability = 0.0;  ///< s of this contact: 0 = full support, > 0 otherwise (paper Eq. (8))
};

/// A state: a set of active contacts; a new one begins only when the set changes.
struct ContactState {
  double start = 0.0;                      ///< s on the recording's clock
  double end = 0.0;                        ///< s
  std::vector<ContactReference> obstacle;  ///< contacts with the obstacle: the paper's lists
  std::vector<ContactReference> floor;     ///< feet (or others) that stand on the floor meanwhile
  double stability = 0.0;                  ///< s of the state, 0 = absolute stability
  Configuration posture;  ///< robot posture when the state is best supported: the posture hint
};

struct ContactSequence {
  std::string recording;
  bool synthetic = false;
  std::string robot;
  double playback_obstacle_height = 0.0;  ///< m, height the playback's obstacle was adjusted to
  std::vector<std::string> joint_names;
  std::vector<ContactState> states;   ///< every state, in order
  std::vector<ContactState> reduced;  ///< only those with absolute stability, duplicates merged
  std::vector<std::string> notes;     ///< what was adjusted or ignored, in sentences
};

/// States with absolute stability only (paper III-C). Keeps s = 0: ContactState::stability is
/// exactly 0 within the tolerance of state_stability() (stability.hpp), so no second tolerance is
/// applied here. Consecutive states whose sets on the obstacle are equal become one, which spans
/// both and keeps floor contacts, references and posture of the better supported one: more contacts
/// on the floor, then smaller mean s of its contacts, then the earlier. States without obstacle
/// contact are dropped.
[[nodiscard]] std::vector<ContactState> reduce(const std::vector<ContactState>& states);

/// Numbers are written so that reading gives the same double. Replaces the file as a whole.
/// @throws InputError when the file cannot be written or a number is not finite
void save_contacts(const ContactSequence& sequence, const std::filesystem::path& file);
/// @throws InputError naming file, line and key.
[[nodiscard]] ContactSequence load_contacts(const std::filesystem::path& file);
/// The same, and refuses links and joints that are not `model`'s.
[[nodiscard]] ContactSequence load_contacts(const std::filesystem::path& file,
                                            const RobotModel& model);

}  // namespace clamber
