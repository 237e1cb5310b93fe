// The planner's settings file: the shipped one says what the code's defaults are.
#include "planner_offline/settings_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <tuple>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

class SettingsFile : public testing::Test {
 protected:
  ~SettingsFile() override { fs::remove(file_); }
  PlannerSettings load(const std::string& text) {
    std::ofstream(file_) << text;
    return load_planner_settings(file_);
  }
  std::string error(const std::string& text) {
    try {
      static_cast<void>(load(text));
    } catch (const InputError& e) {
      return e.what();
    }
    return "no error";
  }
  fs::path file_ = fs::path(testing::TempDir()) / "clamber_settings_file_test.yaml";
};

// Every member by its place: a new one does not compile before the reader and the shipped file know
// it, too.
auto members(const IkSettings& s) {
  const auto& [a, b, c, d] = s;
  return std::tuple(a, b, c, d);
}
auto members(const ClearanceSettings& s) {
  const auto& [a, b, c, d, elsewhere, spare, e] = s;
  return std::tuple(a, b, c, d, elsewhere.position, elsewhere.yaw, elsewhere.height, spare, e);
}
auto members(const ForceSettings& s) {
  const auto& [friction_is_the_scenarios, a, b] = s;
  return std::tuple(a, b);
}
auto members(const ReferenceSettings& s) {
  const auto& [a, b, c, d, e, f, g, h, i, j, k] = s;
  return std::tuple(a, b, c, d, e, f, g, h, i, j, k);
}
auto members(const SearchSettings& s) {
  const auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, t, u, v, w, x, y, z, wide,
               tight, in_all, stated] = s;
  return std::tuple(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, t, u, v, w, x, y, z, wide,
                    tight, in_all, stated);
}
auto members(const TimingSettings& s) {
  const auto& [a, b, c, d, e] = s;
  return std::tuple(a, b, c, d, e);
}

TEST_F(SettingsFile, TheShippedFileStatesTheDefaults) {
  const auto [friction_share, ik, clearance, forces, references, search, timing] =
      load_planner_settings(fs::path(CLAMBER_SOURCE_DIR) / "configs/planner/default.yaml");
  const PlannerSettings built_in;
  EXPECT_EQ(friction_share, built_in.friction_share);
  EXPECT_EQ(members(ik), members(built_in.ik));
  EXPECT_EQ(members(clearance), members(built_in.clearance));
  EXPECT_EQ(members(forces), members(built_in.forces));
  EXPECT_EQ(members(references), members(built_in.references));
  EXPECT_EQ(members(search), members(built_in.search));
  EXPECT_EQ(members(timing), members(built_in.timing));
}

TEST_F(SettingsFile, TakesWhatItIsGiven) {
  const PlannerSettings settings = load(
      "friction_share: 0.5\nreferences: {w1: 0.2, posture_has_priority: true}\n"
      "search: {most_candidates: 7, wide_clearances: [0.03, 0.02]}\n");
  EXPECT_EQ(settings.friction_share, 0.5);
  EXPECT_EQ(settings.references.w1, 0.2);
  EXPECT_EQ(settings.references.w2, ReferenceSettings().w2);
  EXPECT_TRUE(settings.references.posture_has_priority);
  EXPECT_EQ(settings.search.most_candidates, 7u);
  EXPECT_EQ(settings.search.wide_clearances, (std::vector{0.03, 0.02}));
}

TEST_F(SettingsFile, NamesLineAndKeyOfWhatIsWrong) {
  using testing::HasSubstr;
  EXPECT_THAT(error("swing: 1"), HasSubstr(":1: swing: unknown key, expected one of: friction"));
  EXPECT_THAT(error("ik:\n  joint_step: 0"), HasSubstr(":2: ik.joint_step"));
  EXPECT_THAT(error("timing: {speed: 1}"), HasSubstr("timing.speed: unknown key"));
  EXPECT_THAT(error("forces: {torque_share: 1.2}"), HasSubstr("expected a share"));
  EXPECT_THAT(error("search: {most_steps: 2.5}"), HasSubstr("expected a whole number"));
  EXPECT_THAT(error("references: {posture_has_priority: 3}"), HasSubstr("posture_has_priority"));
  EXPECT_THAT(error("clearance: 3"), HasSubstr("clearance: expected a map"));
}

}  // namespace
}  // namespace clamber
