#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <pugixml.hpp>
#include <regex>

#include "report/html_sections.hpp"
#include "robot_model/loader.hpp"
#include "tests/report/made_robot.hpp"

namespace clamber {
namespace {

using testing::HasSubstr;
using testing::Not;

ReportInput made_input() {
  ReportInput input;
  input.climb = test::made_climb();
  input.playback = test::made_climb();
  input.playback->label = "playback";
  input.plan.robot = "made";
  input.plan.scenario = "box_0.275";
  input.plan.recording = "demo <table>.mvnx";
  input.plan.synthetic_recording = true;
  input.plan.notes = {"elbow contacts are missing & were added"};
  input.plan.keyframes.resize(3);
  input.plan.phases = {{"State1", 0.0}};
  input.contacts = {{"State1", {"Lwrist", "Rwrist"}, 0.2}, {"State2", {"Lwrist", "Lelb"}, 0.0}};
  input.reduced_contacts = {{"State1", {"Lwrist", "Lelb"}, 0.0}};
  input.summary.success = true;
  input.summary.obstacle_height = 0.275;
  input.summary.judge.final_contacts = {"Lwrist", "Rwrist"};
  input.summary.planning_stages = {{"references", 4.5}, {"search", 9.25}};
  input.counters = {{"frames published", "4000"}};
  input.environment = {{"clamber", "0.1.0"}};
  return input;
}

ReportPictures no_pictures() {
  ReportPictures pictures;
  pictures.problem = "no EGL surfaceless display";
  return pictures;
}

// Drops every inline picture (std::regex would recurse over its megabytes).
std::string without_pictures(const std::string& html) {
  const std::string opening = "src=\"data:image/png;base64,";
  std::string out;
  std::size_t from = 0;
  for (std::size_t at = html.find(opening); at != std::string::npos;
       at = html.find(opening, from)) {
    out += html.substr(from, at - from);
    from = html.find('"', at + opening.size()) + 1;
  }
  return out + html.substr(from);
}

// Nothing but the SVG namespace's name may look like an address, and all sources must be inline.
void expect_self_contained(std::string html) {
  html = without_pictures(html);
  html = std::regex_replace(html, std::regex("xmlns=\"[^\"]*\""), "");
  EXPECT_THAT(html, Not(HasSubstr("http")));
  EXPECT_THAT(html, Not(HasSubstr("href")));
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("@import")));
  EXPECT_THAT(html, Not(HasSubstr("url(")));
  EXPECT_THAT(html, Not(HasSubstr("src=")));
}

TEST(ReportHtml, SaysWhatHappened) {
  const std::string html = report_html(made_input(), no_pictures());
  for (const char* text :
       {"is on top of the 0.275 m obstacle", "SYNTHETIC demonstration", "Lwrist, Rwrist",
        "s &gt; 0", "s = 0", "under 5 min", "15 min", "13.75 s",
        "elbow contacts are missing &amp; were added", "frames published",
        "no EGL surfaceless display", "demo &lt;table&gt;.mvnx"}) {
    EXPECT_THAT(html, HasSubstr(text));
  }
  expect_self_contained(html);
}

TEST(ReportHtml, TellsFailureAndRealRecording) {
  ReportInput input = made_input();
  input.summary.success = false;
  input.plan.synthetic_recording = false;
  input.playback.reset();
  const std::string html = report_html(input, no_pictures());
  EXPECT_THAT(html, HasSubstr("is not on top of the 0.275 m obstacle"));
  EXPECT_THAT(html, HasSubstr("The playback was not run"));
  EXPECT_THAT(html, Not(HasSubstr("SYNTHETIC")));
}

TEST(ReportHtml, ContactTableKeepsALinkInItsRow) {
  const std::string html = report_html(made_input(), no_pictures());
  EXPECT_THAT(html, HasSubstr("<tr><td>Lwrist</td><td>Lwrist</td></tr>"));
  EXPECT_THAT(html, HasSubstr("<tr><td>Rwrist</td><td></td></tr>"));
  EXPECT_THAT(html, HasSubstr("<tr><td></td><td>Lelb</td></tr>"));
}

class WriteReport : public testing::Test {
 protected:
  void SetUp() override {
    dir_ = std::filesystem::temp_directory_path() /
           ("clamber_report_test_" + std::to_string(::getpid()));
  }
  void TearDown() override { std::filesystem::remove_all(dir_); }
  [[nodiscard]] std::string read(const char* name) const {
    std::ifstream in(dir_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  std::filesystem::path dir_;
};

TEST_F(WriteReport, WritesPageAndPictures) {
  write_report(made_input(), dir_ / "");
  const std::string html = read("report.html");
  EXPECT_THAT(html, HasSubstr("<!doctype html>"));
  expect_self_contained(html);
  pugi::xml_document svg;
  EXPECT_TRUE(svg.load_string(read("torque.svg").c_str()));
  if (html.find("There are no pictures") != std::string::npos) {
    EXPECT_FALSE(std::filesystem::exists(dir_ / "climb.png"));
    GTEST_SKIP() << "skipped: no EGL on this machine, so no pictures to check";
  }
  EXPECT_THAT(read("climb.png"), testing::StartsWith("\x89PNG"));
  EXPECT_THAT(read("playback.png"), testing::StartsWith("\x89PNG"));
  EXPECT_THAT(html, HasSubstr("data:image/png;base64,iVBOR"));
}

TEST_F(WriteReport, WithoutTruthSaysWhyThereAreNoPictures) {
  ReportInput input = made_input();
  for (TelemetryFrame& frame : input.climb.frames) {
    frame.flags = 0;
  }
  write_report(input, dir_);
  EXPECT_THAT(read("report.html"), HasSubstr("do not say where the robot&#39;s base is"));
  EXPECT_FALSE(std::filesystem::exists(dir_ / "climb.png"));
}

TEST_F(WriteReport, NamesAFolderItCannotMake) {
  EXPECT_THROW(write_report(made_input(), "/dev/null/out"), InputError);
}

}  // namespace
}  // namespace clamber
