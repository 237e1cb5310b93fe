#include "report/summary.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "tests/report/made_robot.hpp"

namespace clamber {
namespace {

Summary made_summary() {
  Summary s;
  s.success = true;
  s.judge = {{"Lwrist", "Rwrist"}, {}, 0.987, {}, 0.0004};
  s.obstacle_height = 0.275;
  s.recording = "demo.mvnx";
  s.synthetic_recording = true;
  s.planning_stages = {{"import", 0.5}, {"references", 2.0}, {"search", 3.25}};
  s.real_time_factor = 7.5;
  s.plan_sha256 = "aa";
  s.log_sha256 = "bb";
  return s;
}

TEST(SummaryJson, HasTheAgreedKeys) {
  Summary s = made_summary();
  const RunData run = test::made_climb();
  measure_peaks(run, &run, s);
  s.playback_success = false;
  const auto json = nlohmann::json::parse(to_json(s).dump());
  for (const char* key : {"success", "judge", "obstacle_height_m", "recording", "peak_torque_nm",
                          "peak_torque_after_hands_nm", "playback_success", "planning_s",
                          "real_time_factor", "plan_sha256", "log_sha256"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
  for (const char* key : {"final_contacts", "floor_contacts", "weight_on_obstacle",
                          "forbidden_contacts", "rest_speed"}) {
    EXPECT_TRUE(json["judge"].contains(key)) << key;
  }
  EXPECT_EQ(json["success"], true);
  EXPECT_TRUE(json["judge"]["floor_contacts"].is_array());
  EXPECT_EQ(json["peak_torque_nm"]["plan"]["joint"], "LKneeSag");
  EXPECT_EQ(json["peak_torque_nm"]["playback"]["value"], 41.5);
  EXPECT_NEAR(json["peak_torque_after_hands_nm"].get<double>(), 8.0, 1e-3);
  EXPECT_EQ(json["playback_success"], false);
  EXPECT_EQ(json["planning_s"]["search"], 3.25);
  EXPECT_EQ(json["planning_s"]["total"], 5.75);
}

TEST(SummaryJson, SaysNullForWhatWasNotMeasured) {
  const auto json = to_json(made_summary());
  EXPECT_TRUE(json["peak_torque_nm"]["playback"].is_null());
  EXPECT_TRUE(json["peak_torque_after_hands_nm"].is_null());
  EXPECT_TRUE(json["playback_success"].is_null());
}

TEST(PrintSummary, ShowsVerdictAndFigures) {
  Summary s = made_summary();
  std::ostringstream good;
  print_summary(s, good);
  EXPECT_THAT(good.str(),
              testing::AllOf(testing::StartsWith("SUCCESS"), testing::HasSubstr("Lwrist Rwrist"),
                             testing::HasSubstr("98.7 %"), testing::HasSubstr("SYNTHETIC"),
                             testing::HasSubstr("5.75 s")));
  s.success = false;
  std::ostringstream bad;
  print_summary(s, bad);
  EXPECT_THAT(bad.str(), testing::StartsWith("FAILURE: the robot is not on top"));
}

}  // namespace
}  // namespace clamber
