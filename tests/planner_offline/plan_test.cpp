#include "planner_offline/plan.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <sstream>

#include "planner_offline/plan_image.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

Plan make_plan() {
  Plan plan;
  plan.robot = "coman";
  plan.robot_hash = std::string(64, 'a');
  plan.scenario = "box";
  plan.scenario_hash = std::string(64, 'b');
  plan.recording = "climb.mvnx";
  plan.synthetic_recording = true;
  plan.tool_version = "0.1.0";
  plan.friction = 0.8;
  plan.obstacle_height = 0.275;
  plan.ballast_mass = 2.3;
  plan.joint_names = {"WaistLat", "WaistSag"};
  plan.notes = {"a \"note\"", "another"};
  plan.certified_for = {{"obstacle height", "m", 0.01, 0.0187}};
  plan.phases = {{"State1", 0.0}, {"swing Lknee", 1.0, FailurePolicy::kLower}};
  for (int i = 0; i < 12; ++i) {
    Keyframe k;
    k.time = 0.15 * i;
    k.phase = i < 7 ? 0 : 1;
    k.x.X_WB.p = Eigen::Vector3d(0.1 * i, -0.05, 0.5 + 0.01 / (i + 3));
    k.x.X_WB.R =
        Eigen::AngleAxisd(0.1 * i, Eigen::Vector3d(1.0, 2.0, 3.0).normalized()).toRotationMatrix();
    k.x.q = Eigen::Vector2d(std::sin(0.3 * i), 1.0 / (i + 3.0));
    k.tau = Eigen::Vector2d(3.0 * i, -1.0 / (i + 7.0));
    k.contacts = {{.link = "Lfoot",
                   .surface = "floor",
                   .position = Eigen::Vector3d(0.1, 0.2, 0.0),
                   .force = Eigen::Vector3d(1.0, 2.0, 141.7 / (i + 1))}};
    k.support_margin = 0.02;
    k.torque_margin = 12.0;
    k.obstacle_clearance = std::numeric_limits<double>::infinity();
    k.self_clearance = 0.01;
    plan.keyframes.push_back(k);
  }
  return plan;
}

class PlanFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) /
              (std::string("clamber_plan_") +
               testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path write(const std::string& text) {
    std::ofstream(folder_ / "plan.json") << text;
    return folder_ / "plan.json";
  }
  /// The good plan's text with one replacement; the message that loading it gives.
  std::string error_after(const std::string& from, const std::string& to) {
    save_plan(make_plan(), folder_ / "good.json");
    std::string text = read_file(folder_ / "good.json");
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    try {
      static_cast<void>(load_plan(write(text)));
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  }

  fs::path folder_;
};

TEST_F(PlanFile, RoundTripKeepsEveryNumber) {
  const Plan plan = make_plan();
  save_plan(plan, folder_ / "plan.json");
  const Plan back = load_plan(folder_ / "plan.json");
  EXPECT_EQ(back.robot, plan.robot);
  EXPECT_EQ(back.robot_hash, plan.robot_hash);
  EXPECT_EQ(back.scenario, plan.scenario);
  EXPECT_EQ(back.scenario_hash, plan.scenario_hash);
  EXPECT_EQ(back.recording, plan.recording);
  EXPECT_EQ(back.synthetic_recording, plan.synthetic_recording);
  EXPECT_EQ(back.tool_version, plan.tool_version);
  EXPECT_EQ(back.friction, plan.friction);
  EXPECT_EQ(back.obstacle_height, plan.obstacle_height);
  EXPECT_EQ(back.ballast_mass, plan.ballast_mass);
  EXPECT_EQ(back.joint_names, plan.joint_names);
  EXPECT_EQ(back.notes, plan.notes);
  ASSERT_EQ(back.certified_for.size(), 1u);
  EXPECT_EQ(back.certified_for[0].what, "obstacle height");
  EXPECT_EQ(back.certified_for[0].unit, "m");
  EXPECT_EQ(back.certified_for[0].stated, 0.01);
  EXPECT_EQ(back.certified_for[0].holds, 0.0187);
  ASSERT_EQ(back.phases.size(), 2u);
  EXPECT_EQ(back.phases[1].name, "swing Lknee");
  EXPECT_EQ(back.phases[1].start, 1.0);
  EXPECT_EQ(back.phases[0].failure_policy, FailurePolicy::kHold);
  EXPECT_EQ(back.phases[1].failure_policy, FailurePolicy::kLower);
  ASSERT_EQ(back.keyframes.size(), plan.keyframes.size());
  for (std::size_t i = 0; i < plan.keyframes.size(); ++i) {
    const Keyframe& a = plan.keyframes[i];
    const Keyframe& b = back.keyframes[i];
    EXPECT_EQ(b.time, a.time);
    EXPECT_EQ(b.phase, a.phase);
    EXPECT_EQ(b.x.q, a.x.q);
    EXPECT_EQ(b.tau, a.tau);
    EXPECT_EQ(b.x.X_WB.p, a.x.X_WB.p);
    EXPECT_TRUE(b.x.X_WB.R.isApprox(a.x.X_WB.R, 1e-14));
    ASSERT_EQ(b.contacts.size(), 1u);
    EXPECT_EQ(b.contacts[0].link, "Lfoot");
    EXPECT_EQ(b.contacts[0].surface, "floor");
    EXPECT_EQ(b.contacts[0].position, a.contacts[0].position);
    EXPECT_EQ(b.contacts[0].force, a.contacts[0].force);
    EXPECT_EQ(b.support_margin, a.support_margin);
    EXPECT_EQ(b.torque_margin, a.torque_margin);
    EXPECT_EQ(b.obstacle_clearance, a.obstacle_clearance);
    EXPECT_EQ(b.self_clearance, a.self_clearance);
  }
}

TEST_F(PlanFile, SavingTwiceGivesTheSameBytes) {
  save_plan(make_plan(), folder_ / "a.json");
  save_plan(make_plan(), folder_ / "b.json");
  EXPECT_EQ(read_file(folder_ / "a.json"), read_file(folder_ / "b.json"));
}

TEST_F(PlanFile, NamesFileAndKeyOfWhatIsWrong) {
  using testing::HasSubstr;
  const std::string file = (folder_ / "plan.json").string() + ": ";
  const auto expect = [&](const std::string& from, const std::string& to, const std::string& says) {
    EXPECT_THAT(error_after(from, to), HasSubstr(file + says)) << from << " -> " << to;
  };
  expect("{", "[", "not a JSON file");
  expect("clamber plan", "other", "format: expected \"clamber plan\"");
  expect("\"version\": 3", "\"version\": 7", "version: expected version 3");
  expect("\"friction\": 0.8", "\"friction\": \"high\"", "friction: expected a number");
  expect("\"friction\"", "\"frictoin\"", "key 'friction' is missing");
  expect("\"synthetic_recording\": true", "\"synthetic_recording\": 1",
         "synthetic_recording: expected true or false");
  expect("\"State1\"", "3", "phases[0].name: expected a text");
  expect("\"failure_policy\": \"hold\"", "\"failure_policy\": \"float\"",
         "phases[0].failure_policy: expected hold, lower or limp");
  expect("\"failure_policy\": \"hold\"", "\"policy\": \"hold\"",
         "phases[0]: key 'failure_policy' is missing");
  expect("\"phase\":0", "\"phase\":2", "keyframes[0].phase: expected an index below 2");
  expect("\"phase\":0", "\"phase\":-1", "keyframes[0].phase: expected an index below 2");
  expect("\"time\":0.15", "\"time\":0.0", "keyframes[1].time: expected a time after");
  expect("\"tau\":[", "\"tau\":[1.0,", "keyframes[0].tau: expected 2 numbers");
  expect("\"q\":[", "\"q\":[null,", "keyframes[0].q: expected 2 numbers");
  expect("\"base_orientation\":[1.0", "\"base_orientation\":[0.5",
         "keyframes[0].base_orientation: expected a unit quaternion");
  expect("\"contacts\":[{", "\"contacts\":[7,{", "keyframes[0].contacts[0]: expected an object");
}

TEST_F(PlanFile, RefusesAMissingFileAndAnEmptyPlan) {
  EXPECT_THROW(static_cast<void>(load_plan(folder_ / "none.json")), InputError);
  EXPECT_THROW(static_cast<void>(load_plan(folder_)), InputError);
  Plan plan = make_plan();
  plan.keyframes.resize(1);
  save_plan(plan, folder_ / "short.json");
  EXPECT_THROW(static_cast<void>(load_plan(folder_ / "short.json")), InputError);
  EXPECT_THROW(save_plan(plan, folder_ / "no_such_folder" / "plan.json"), InputError);
  plan.keyframes[0].tau[1] = std::nan("");
  EXPECT_THROW(save_plan(plan, folder_ / "nan.json"), InputError);
}

struct Table {
  std::vector<std::string> columns;
  std::vector<std::vector<double>> rows;
};

Table read_table(const fs::path& file) {
  Table table;
  std::ifstream in(file);
  std::string line, cell;
  std::getline(in, line);
  for (std::istringstream cells(line); std::getline(cells, cell, ',');)
    table.columns.push_back(cell);
  while (std::getline(in, line)) {
    table.rows.emplace_back();
    for (std::istringstream cells(line); std::getline(cells, cell, ',');)
      table.rows.back().push_back(std::stod(cell));
  }
  return table;
}

TEST_F(PlanFile, ExportsAHundredRowsASecondThroughTheKeyframes) {
  const Plan plan = make_plan();
  export_trajectory(plan, folder_ / "trajectory.csv");
  const Table table = read_table(folder_ / "trajectory.csv");
  EXPECT_THAT(table.columns, testing::ElementsAre("time", "base_x", "base_y", "base_z", "base_qw",
                                                  "base_qx", "base_qy", "base_qz", "WaistLat",
                                                  "WaistSag", "tau_WaistLat", "tau_WaistSag"));
  ASSERT_EQ(table.rows.size(), 166u);  // 0 to 1.65 s
  for (std::size_t i = 0; i < plan.keyframes.size(); ++i) {
    const Keyframe& k = plan.keyframes[i];
    const std::vector<double>& row = table.rows[15 * i];
    ASSERT_EQ(row.size(), 12u);
    EXPECT_NEAR(row[0], k.time, 1e-9);
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(row[1 + static_cast<std::size_t>(axis)], k.x.X_WB.p[axis], 1e-9);
    const Eigen::Quaterniond q(row[4], row[5], row[6], row[7]);
    EXPECT_NEAR(q.angularDistance(Eigen::Quaterniond(k.x.X_WB.R)), 0.0, 1e-7);
    for (Eigen::Index j = 0; j < 2; ++j) {
      EXPECT_NEAR(row[8 + static_cast<std::size_t>(j)], k.x.q[j], 1e-9);
      EXPECT_NEAR(row[10 + static_cast<std::size_t>(j)], k.tau[j], 1e-9);
    }
  }
}

TEST_F(PlanFile, TheImageHoldsThePlan) {
  const Plan plan = make_plan();
  const std::vector<std::byte> image = plan_to_image(plan, std::string(64, '0'));
  save_plan_image(image, folder_ / "plan.image");
  EXPECT_EQ(read_plan_image(folder_ / "plan.image"), image);
  const std::vector<double> lower{-2.0, -2.0}, upper{2.0, 2.0}, torque{50.0, 50.0};
  PlanImageView view;
  ASSERT_EQ(
      open_plan_image(
          image,
          {.robot_hash = plan.robot_hash, .lower = lower, .upper = upper, .torque_limit = torque},
          view),
      PlanImageStatus::kOk);
  ASSERT_EQ(view.size(), plan.keyframes.size());
  EXPECT_EQ(view.header().friction, plan.friction);
  for (std::size_t i = 0; i < view.size(); ++i) {
    EXPECT_EQ(view.time(i), plan.keyframes[i].time);
    EXPECT_EQ(static_cast<int>(view.keyframes()[i].phase), plan.keyframes[i].phase);
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_EQ(view.value(i, j), plan.keyframes[i].x.q[static_cast<Eigen::Index>(j)]);
      EXPECT_EQ(view.keyframes()[i].tau[j], plan.keyframes[i].tau[static_cast<Eigen::Index>(j)]);
    }
  }
}

TEST_F(PlanFile, RefusesAPlanThatFitsNoImage) {
  const auto refuses = [](const std::function<void(Plan&)>& change) {
    Plan plan = make_plan();
    change(plan);
    EXPECT_THROW(static_cast<void>(plan_to_image(plan)), InputError);
  };
  refuses([](Plan& p) { p.keyframes.resize(1); });
  refuses([](Plan& p) { p.keyframes.resize(kMaxKeyframes + 1, p.keyframes[0]); });
  refuses([](Plan& p) { p.joint_names.clear(); });
  refuses([](Plan& p) { p.joint_names.emplace_back("extra"); });
  refuses([](Plan& p) { p.robot_hash.resize(65, 'x'); });
  refuses([](Plan& p) { p.keyframes[3].tau.resize(1); });
}

}  // namespace
}  // namespace clamber
