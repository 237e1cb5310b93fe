// The playback analysis on the default demonstration and on a real climb.
#include "planner_offline/contacts/playback.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <set>

#include "planner_offline/contacts/contact_table.hpp"
#include "planner_offline/planning_failed.hpp"
#include "planner_offline/recording/import.hpp"
#include "planner_offline/retarget/retarget.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

const std::filesystem::path kSource = CLAMBER_SOURCE_DIR;

using Names = std::set<std::string>;

Names links_of(const std::vector<ContactReference>& contacts) {
  Names links;
  for (const ContactReference& contact : contacts) {
    links.insert(contact.link);
  }
  return links;
}

std::vector<Names> sets_of(const std::vector<ContactState>& states) {
  std::vector<Names> sets;
  for (const ContactState& state : states) {
    sets.push_back(links_of(state.obstacle));
  }
  return sets;
}

/// One demonstration, analysed once for all tests of it.
struct Analysis {
  RobotModel model = load_robot(kSource / "configs/robots/coman/robot.yaml");
  Scenario scenario = load_scenario(kSource / "configs/scenarios/box_0.275.yaml");
  RobotMotion motion;
  PlaybackConfig config;
  Playback playback;
  ContactSequence sequence;

  explicit Analysis(const std::filesystem::path& recording) {
    motion = retarget(import_recording(recording), model,
                      load_retarget_config(kSource / "configs/robots/coman/retarget.yaml"));
    playback = play(model, motion, scenario, config);
    sequence = contacts_of(model, motion, playback, config);
  }
};

const Analysis& demonstration() {
  static const Analysis analysis(kSource / "configs/recordings/climb_table_synthetic.mvnx");
  return analysis;
}

const Names kWrists{"Lwrist", "Rwrist"};
const Names kArms{"Lwrist", "Rwrist", "Lelb", "Relb"};
const Names kArmsKnee{"Lwrist", "Rwrist", "Lelb", "Relb", "Lknee"};
const Names kAll{"Lwrist", "Rwrist", "Lelb", "Relb", "Lknee", "Rknee"};

TEST(Playback, OfTheDemonstrationReducesToThePapersOrder) {
  const ContactSequence& sequence = demonstration().sequence;
  SCOPED_TRACE(contact_table(sequence.states));
  EXPECT_EQ(sets_of(sequence.reduced), (std::vector<Names>{kArms, kArmsKnee, kAll}));
  EXPECT_EQ(sets_of(sequence.states).front(), kWrists) << "the hands come first, reaching";
  EXPECT_GT(sequence.states.front().stability, 0.0);
  EXPECT_TRUE(sequence.synthetic);
}

TEST(Playback, FeetStandOnTheFloorUntilTheirKneeLeavesForTheObstacle) {
  const auto& reduced = demonstration().sequence.reduced;
  ASSERT_EQ(reduced.size(), 3u);
  EXPECT_EQ(links_of(reduced[0].floor), (Names{"Lfoot", "Rfoot"}));
  EXPECT_EQ(links_of(reduced[1].floor), Names{"Rfoot"});
  EXPECT_EQ(links_of(reduced[2].floor), Names{});
}

TEST(Playback, ReferencesLieOnTheTopFace) {
  const Analysis& analysis = demonstration();
  const Eigen::Vector3d half = analysis.playback.scenario.obstacles.front().half_extents;
  for (const ContactState& state : analysis.sequence.states) {
    for (const ContactReference& contact : state.obstacle) {
      EXPECT_NEAR(contact.position.z(), 0.0, 1e-9) << contact.link;
      EXPECT_GE(contact.position.x(), 0.0) << contact.link;
      EXPECT_LE(contact.position.x(), 2.0 * half.x()) << contact.link;
      EXPECT_LE(std::abs(contact.position.y()), half.y()) << contact.link;
      EXPECT_EQ(contact.position.y() > 0.0, contact.link.front() == 'L') << contact.link;
    }
  }
}

TEST(Playback, SamplesEvery50MillisecondsAndStaysOnThePath) {
  const Analysis& analysis = demonstration();
  const auto& samples = analysis.playback.samples;
  ASSERT_GT(samples.size(), 300u);
  for (std::size_t k = 1; k < samples.size(); ++k) {
    ASSERT_NEAR(samples[k].time - samples[k - 1].time, 0.05, 1e-9);
  }
  EXPECT_LT(analysis.playback.worst_base_error, 0.05);
  for (const ContactSample& sample : samples) {
    for (const int geom : analysis.model.forbidden_geoms) {
      const std::string& name = analysis.model.geoms[static_cast<std::size_t>(geom)].name;
      ASSERT_EQ(std::count(sample.others.begin(), sample.others.end(), name), 0)
          << name << " touches at " << sample.time;
    }
  }
}

TEST(Playback, GivesTheSameFileTwice) {
  const Analysis& analysis = demonstration();
  RobotMotion hands = analysis.motion;
  hands.frames.resize(static_cast<std::size_t>(6.0 * hands.rate));
  const std::filesystem::path folder = testing::TempDir();
  for (const char* file : {"first_contacts.yaml", "second_contacts.yaml"}) {
    save_contacts(extract_contacts(analysis.model, hands, analysis.scenario, analysis.config),
                  folder / file);
  }
  EXPECT_EQ(read_file(folder / "first_contacts.yaml"), read_file(folder / "second_contacts.yaml"));
}

TEST(Playback, SurvivesItsFile) {
  const Analysis& analysis = demonstration();
  const auto file = std::filesystem::path(testing::TempDir()) / "demonstration_contacts.yaml";
  save_contacts(analysis.sequence, file);
  const ContactSequence read = load_contacts(file, analysis.model);
  EXPECT_EQ(contact_table(read.states), contact_table(analysis.sequence.states));
  EXPECT_EQ(contact_table(read.reduced), contact_table(analysis.sequence.reduced));
}

TEST(Playback, RefusesWhatCannotTouch) {
  const Analysis& analysis = demonstration();
  RobotMotion standing = analysis.motion;
  standing.frames.assign(200, analysis.motion.frames.front());
  PlaybackConfig low;
  low.adjustment.highest = 0.15;  // knees hang higher
  EXPECT_THROW((void)play(analysis.model, standing, analysis.scenario, low), PlanningFailed);
  RobotMotion empty = analysis.motion;
  empty.frames.clear();
  EXPECT_THROW((void)play(analysis.model, empty, analysis.scenario, {}), InputError);
  Scenario bare = analysis.scenario;
  bare.obstacles.clear();
  EXPECT_THROW((void)play(analysis.model, analysis.motion, bare, {}), InputError);
}

std::filesystem::path recordings() {
  const char* folder = std::getenv("CLAMBER_RECORDINGS");
  return folder != nullptr ? std::filesystem::path(folder) : kSource / "../shared/recordings";
}

TEST(Playback, OfARealClimbFindsHandsThenTheRightKneeThenBoth) {
  const auto file = recordings() / "holosoma/seq_0.npy";
  if (!std::filesystem::exists(file)) {
    GTEST_SKIP() << "skipped: no recordings";
  }
  const Analysis analysis(file);
  SCOPED_TRACE(contact_table(analysis.sequence.states));
  const auto& reduced = analysis.sequence.reduced;
  EXPECT_EQ(sets_of(reduced),
            (std::vector<Names>{
                kWrists, {"Lwrist", "Rwrist", "Rknee"}, {"Lwrist", "Rwrist", "Lknee", "Rknee"}}));
  ASSERT_EQ(reduced.size(), 3u);
  EXPECT_EQ(links_of(reduced[0].floor), (Names{"Lfoot", "Rfoot"}));
  EXPECT_EQ(links_of(reduced[1].floor), Names{"Lfoot"});
  EXPECT_EQ(links_of(reduced[2].floor), Names{});
  EXPECT_FALSE(analysis.sequence.synthetic);
}

}  // namespace
}  // namespace clamber
