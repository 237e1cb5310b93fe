#include "apps/executed_plan.hpp"

#include <filesystem>

#include "apps/config_files.hpp"
#include "apps/options.hpp"
#include "planner_offline/plan.hpp"
#include "robot_model/model.hpp"
#include "robot_model/read_file.hpp"
#include "robot_model/yaml_reader.hpp"

namespace clamber {

std::string read_urdf(const RobotOptions& robot) {
  const std::filesystem::path file = find_robot(robot.robot);
  return read_file(file.parent_path() / YamlNode::load(file).at("urdf").text());
}

std::vector<DescribedPhase> describe_phases(const Plan& plan, const RobotModel& model) {
  std::vector<DescribedPhase> phases;
  const std::uint32_t all = (1u << model.contacts.size()) - 1u;
  for (const Phase& phase : plan.phases) phases.push_back({phase.name, all});
  for (const Keyframe& keyframe : plan.keyframes) {
    std::uint32_t carrying = 0;
    for (const PlannedContact& contact : keyframe.contacts)
      if (const auto index = model.find_contact(contact.link)) carrying |= 1u << *index;
    phases[static_cast<std::size_t>(keyframe.phase)].contacts &= carrying;
  }
  return phases;
}

}  // namespace clamber
