#include "planner_offline/settings_file.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "robot_model/yaml_reader.hpp"

namespace clamber {
namespace {

/// A map whose keys are known by being asked for: what remains unasked is an error.
class Section {
 public:
  explicit Section(std::optional<YamlNode> node) : node_(std::move(node)) {}

  [[nodiscard]] std::optional<YamlNode> find(const char* key) {
    known_.emplace_back(key);
    return node_ ? node_->find(key) : std::nullopt;
  }
  /// The map below `key` into `settings`, with the read_keys() of their type.
  template <typename Settings>
  void section(const char* key, Settings& settings) {
    Section below(find(key));
    read_keys(below, settings);
    below.refuse_unknown();
  }

  void positive(const char* key, double& value) {
    if (const auto node = find(key)) value = node->positive();
  }
  void non_negative(const char* key, double& value) {
    if (const auto node = find(key)) value = node->non_negative();
  }
  void positives(const char* key, std::vector<double>& values) {
    const auto node = find(key);
    if (!node) return;
    values.clear();
    for (const YamlNode& item : node->items()) values.push_back(item.positive());
  }
  /// A share, above 0 and at most 1.
  void share(const char* key, double& value) {
    const auto node = find(key);
    if (!node) return;
    value = node->positive();
    if (value > 1.0) node->fail("expected a share above 0 and at most 1");
  }
  template <typename Integer>
  void count(const char* key, Integer& value) {
    const auto node = find(key);
    if (!node) return;
    const double number = node->non_negative();
    if (number != std::floor(number) || number > 1e6)
      node->fail("expected a whole number from 0 to 1000000");
    value = static_cast<Integer>(number);
  }
  void flag(const char* key, bool& value) {
    if (const auto node = find(key)) value = node->flag();
  }

  void refuse_unknown() const {
    if (!node_) return;
    for (const auto& [key, node] : node_->entries())
      if (std::find(known_.begin(), known_.end(), key) == known_.end())
        node.fail("unknown key, expected one of: " + listed());
  }

 private:
  [[nodiscard]] std::string listed() const {
    std::string text;
    for (const std::string& key : known_) text += (text.empty() ? "" : ", ") + key;
    return text;
  }

  std::optional<YamlNode> node_;
  std::vector<std::string> known_;
};

void read_keys(Section& section, IkSettings& ik) {
  section.non_negative("limit_margin", ik.limit_margin);
  section.positive("joint_step", ik.joint_step);
  section.positive("base_step", ik.base_step);
  section.positive("base_turn", ik.base_turn);
}

void read_keys(Section& section, ClearanceSettings& clearance) {
  section.non_negative("obstacle", clearance.obstacle);
  section.non_negative("lying", clearance.lying);
  section.non_negative("landing", clearance.landing);
  section.non_negative("self", clearance.self);
  section.non_negative("start_position", clearance.elsewhere.position);
  section.non_negative("start_yaw", clearance.elsewhere.yaw);
  section.non_negative("obstacle_height", clearance.elsewhere.height);
  section.non_negative("spare", clearance.spare);
  section.positive("activation", clearance.activation);
}

/// The friction coefficient is not here: it is friction_share of the scenario's.
void read_keys(Section& section, ForceSettings& forces) {
  section.share("torque_share", forces.torque_share);
  section.non_negative("least_normal", forces.least_normal);
}

void read_keys(Section& section, ReferenceSettings& references) {
  section.positive("w1", references.w1);
  section.positive("w2", references.w2);
  section.positive("step", references.step);
  section.positive("ik_error", references.ik_error);
  section.count("most_iterations", references.most_iterations);
  section.positive("theta_max_deg", references.theta_max_deg);
  section.non_negative("surface_margin", references.surface_margin);
  section.non_negative("press", references.press);
  section.share("relief_share", references.relief_share);
  section.count("relief_iterations", references.relief_iterations);
  section.flag("posture_has_priority", references.posture_has_priority);
}

void read_keys(Section& section, SearchSettings& search) {
  section.count("most_candidates", search.most_candidates);
  section.count("most_attempts", search.most_attempts);
  section.count("most_candidates_in_all", search.most_candidates_in_all);
  section.count("wide_attempts", search.wide_attempts);
  section.positives("wide_clearances", search.wide_clearances);
  section.flag("as_stated", search.as_stated);
  section.count("steady_attempts", search.steady_attempts);
  section.count("most_steps", search.most_steps);
  section.non_negative("support_margin", search.support_margin);
  section.non_negative("tight_margin", search.tight_margin);
  section.non_negative("free_margin", search.free_margin);
  section.non_negative("steady_margin", search.steady_margin);
  section.non_negative("settled_margin", search.settled_margin);
  section.non_negative("wanted_margin", search.wanted_margin);
  section.positive("swing_height", search.swing_height);
  section.positive("swing_step", search.swing_step);
  section.positive("posture_step", search.posture_step);
  section.positive("relief_from", search.relief_from);
  section.positive("relief_full", search.relief_full);
  section.positive("com_step", search.com_step);
  section.count("touch_samples", search.touch_samples);
  section.count("most_touch_postures", search.most_touch_postures);
  section.count("most_way_nodes", search.most_way_nodes);
  section.count("order_attempts", search.order_attempts);
  section.count("most_seeds", search.most_seeds);
  section.count("seed", search.seed);
  section.positive("step_margin", search.step_margin);
  section.positive("step_length", search.step_length);
  section.positive("step_turn", search.step_turn);
}

void read_keys(Section& section, TimingSettings& timing) {
  section.positive("joint_speed", timing.joint_speed);
  section.positive("com_speed", timing.com_speed);
  section.positive("com_acceleration", timing.com_acceleration);
  section.positive("knot_spacing", timing.knot_spacing);
  section.positive("load_time", timing.load_time);
}

}  // namespace

PlannerSettings load_planner_settings(const std::filesystem::path& file) {
  PlannerSettings settings;
  Section root(YamlNode::load(file));
  root.share("friction_share", settings.friction_share);
  root.section("ik", settings.ik);
  root.section("clearance", settings.clearance);
  root.section("forces", settings.forces);
  root.section("references", settings.references);
  root.section("search", settings.search);
  root.section("timing", settings.timing);
  root.refuse_unknown();
  return settings;
}

}  // namespace clamber
