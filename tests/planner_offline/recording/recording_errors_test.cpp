// What the importers refuse, and that the message says where and what was expected.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>

#include "planner_offline/recording/acclaim.hpp"
#include "planner_offline/recording/import.hpp"
#include "planner_offline/recording/limb_frames.hpp"
#include "planner_offline/recording/mvnx.hpp"
#include "planner_offline/recording/npy.hpp"
#include "planner_offline/recording/position_csv.hpp"
#include "robot_model/loader.hpp"
#include "tests/planner_offline/recording/made_positions.hpp"
#include "tests/planner_offline/recording/recordings.hpp"

namespace clamber {
namespace {

using testing::HasSubstr;

std::string message_of(const std::function<void()>& job) {
  try {
    job();
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

std::string replaced(const std::string& text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  if (at == std::string::npos) return text;
  return std::string().append(text, 0, at).append(to).append(text, at + from.size());
}

std::string inserted(const std::string& text, std::size_t at, const std::string& what) {
  std::string result;
  result.append(text, 0, at).append(what).append(text, at);
  return result;
}

TEST(MvnxErrors, NameTheLineAndWhatWasExpected) {
  const std::string good = small_mvnx();
  const auto refusal = [](const std::string& text) {
    return message_of([&] { (void)parse_mvnx(text, "x.mvnx"); });
  };
  ASSERT_EQ(refusal(good), "accepted");
  EXPECT_THAT(refusal(""), HasSubstr("x.mvnx:1: not well-formed"));
  EXPECT_THAT(refusal(good.substr(0, good.size() / 2)), HasSubstr("damaged or was cut off"));
  EXPECT_THAT(refusal("<mvnxInfo frameCount=\"3\"/>"), HasSubstr("version 2"));
  EXPECT_THAT(refusal(replaced(good, "version=\"4\"", "version=\"2\"")),
              HasSubstr("x.mvnx:3: MVNX version \"2\" is not supported: expected 3 or 4"));
  EXPECT_THAT(refusal("<html/>"), HasSubstr("expected <mvnx>"));
  EXPECT_THAT(refusal(replaced(good, "frameRate=\"3\"", "frameRate=\"0\"")),
              HasSubstr("x.mvnx:5: frameRate"));
  EXPECT_THAT(refusal(replaced(good, "frameRate=\"3\"", "frameRate=\"nan\"")),
              HasSubstr("frameRate"));
  EXPECT_THAT(refusal(replaced(good, "label=\"L5\"", "label=\"Pelvis\"")), HasSubstr("twice"));
  EXPECT_THAT(refusal(replaced(good, "<connector1>Pelvis/", "<connector1>Tail/")),
              HasSubstr("expected Segment/point"));
  EXPECT_THAT(refusal(replaced(good, "type=\"tpose\"", "type=\"other\"")),
              HasSubstr("without the frames \"tpose\""));
  const auto first_normal = good.find("type=\"normal\"");
  const auto orientation = good.find("<orientation>", first_normal) + 13;
  const auto line = 1 + std::count(good.begin(), good.begin() + std::ptrdiff_t(orientation), '\n');
  const auto at_line = "x.mvnx:" + std::to_string(line) + ": <orientation> ";
  EXPECT_THAT(refusal(inserted(good, orientation, "nan ")),
              HasSubstr(at_line + "value 1 is not a finite number"));
  EXPECT_THAT(refusal(inserted(good, orientation, "1e999 ")), HasSubstr("not a finite number"));
  EXPECT_THAT(refusal(inserted(good, orientation, "1 ")),
              HasSubstr(at_line + "has 93 values: expected 92"));
  EXPECT_THAT(refusal(inserted(good, orientation, "7")), HasSubstr("unit quaternion"));
  EXPECT_THAT(refusal(replaced(good, "<position>", "<positions>")), HasSubstr("not well-formed"));
  EXPECT_THAT(refusal("<mvnx version=\"3\"><subject frameRate=\"60\"><segments>"
                      "<segment label=\"Pelvis\"/></segments></subject></mvnx>"),
              HasSubstr("no frame of type \"normal\""));
  EXPECT_THAT(refusal("<mvnx version=\"3\"><subject frameRate=\"60\"/></mvnx>"),
              HasSubstr("no <segments>"));
  EXPECT_THAT(refusal("<mvnx version=\"3\"/>"), HasSubstr("no <subject>"));
}

TEST(MvnxErrors, WarnsWhenAnglesAndOrientationsDisagree) {
  std::string text = small_mvnx();
  const auto at = text.find("<jointAngle>", text.find("type=\"normal\"")) + 12;
  text = inserted(text, at, "4");  // 40 deg of lean at jL5S1 instead of 0
  const auto motion = parse_mvnx(text, "x.mvnx");
  ASSERT_EQ(motion.warnings.size(), 1U);
  EXPECT_THAT(motion.warnings[0], HasSubstr("jL5S1"));
}

TEST(NpyErrors, NameTheByteAndWhatWasExpected) {
  const std::string good = make_npy(2, "<f4");
  const auto refusal = [](const std::string& bytes) {
    return message_of([&] { (void)parse_npy(bytes, "x.npy"); });
  };
  ASSERT_EQ(refusal(good), "accepted");
  ASSERT_EQ(refusal(make_npy(2, "<f8")), "accepted");
  EXPECT_THAT(refusal("\x93NUMPY"), HasSubstr("no NumPy header"));
  EXPECT_THAT(refusal(good.substr(0, 60)), HasSubstr("cut off"));
  EXPECT_THAT(refusal(good.substr(0, good.size() - 1)), HasSubstr("expected 2 frames of 636"));
  EXPECT_THAT(refusal(good + "x"), HasSubstr("expected 2 frames"));
  EXPECT_THAT(refusal(replaced(good, "<f4", ">f4")), HasSubstr("expected '<f4' or '<f8'"));
  EXPECT_THAT(refusal(replaced(good, "<f4", "<i4")), HasSubstr("expected '<f4' or '<f8'"));
  EXPECT_THAT(refusal(replaced(good, "False", "True ")), HasSubstr("C order"));
  EXPECT_THAT(refusal(replaced(good, "53, 3", "3, 53")), HasSubstr("expected (frames, 53, 3)"));
  EXPECT_THAT(refusal(replaced(good, "(2, ", "(-, ")), HasSubstr("whole numbers"));
  EXPECT_THAT(refusal(replaced(good, "'shape'", "'sheep'")), HasSubstr("header key 'sheep'"));
  EXPECT_THAT(refusal(replaced(good, "(2, 53", "(4000000000, 53")), HasSubstr("expected"));
  std::string nan = good;
  for (std::size_t i = nan.size() - 4; i < nan.size(); ++i) nan[i] = '\xFF';
  EXPECT_THAT(refusal(nan), HasSubstr("x.npy: byte " + std::to_string(good.size() - 4) +
                                      ": frame 1: expected a finite position"));
}

TEST(CsvErrors, NameTheLineAndWhatWasExpected) {
  const auto refusal = [](const std::string& text) {
    return message_of([&] { (void)parse_csv(text, "x.csv"); });
  };
  ASSERT_EQ(refusal("# c\nt,A_x,A_y,A_z\n0,1,2,3\n0.1,1,2,3\n"), "accepted");
  EXPECT_THAT(refusal(""), HasSubstr("no column \"t\""));
  EXPECT_THAT(refusal("A_x,A_y,A_z\n"), HasSubstr("x.csv:1: no column \"t\""));
  EXPECT_THAT(refusal("t,A_x,A_y\n0,1,2\n"), HasSubstr("joint \"A\" lacks"));
  EXPECT_THAT(refusal("t,A_x,A_y,A_z,A_x\n"), HasSubstr("\"A_x\" appears twice"));
  EXPECT_THAT(refusal("t\n0\n1\n"), HasSubstr("no joint columns"));
  EXPECT_THAT(refusal("t,A_x,A_y,A_z\n0,1,2\n"), HasSubstr("x.csv:2: 3 values: expected 4"));
  EXPECT_THAT(refusal("t,A_x,A_y,A_z\n0,1,nan,3\n"), HasSubstr("x.csv:2: value 3 \"nan\""));
  EXPECT_THAT(refusal("t,A_x,A_y,A_z\n0,1,2,3\n"), HasSubstr("fewer than two rows"));
  EXPECT_THAT(refusal("t,A_x,A_y,A_z\n0,1,2,3\n0,1,2,3\n"), HasSubstr("increase"));
  EXPECT_THAT(refusal("t,A_x,A_y,A_z\n0,1,2,3\n.1,1,2,3\n.5,1,2,3\n"), HasSubstr("evenly"));
}

TEST(AcclaimErrors, NameTheLineAndWhatWasExpected) {
  const auto asf = [](const std::string& text) {
    return message_of([&] { (void)parse_asf(text, "x.asf"); });
  };
  const std::string good = small_asf();
  ASSERT_EQ(asf(good), "accepted");
  EXPECT_THAT(asf(""), HasSubstr("no :bonedata"));
  EXPECT_THAT(asf("hello"), HasSubstr("x.asf:1: hello: expected a section"));
  EXPECT_THAT(asf(replaced(good, "length 0.45", "length 0")), HasSubstr("positive"));
  EXPECT_THAT(asf(replaced(good, "angle deg", "angle gon")), HasSubstr("deg or rad"));
  EXPECT_THAT(asf(replaced(good, "TX TY", "TX TX")), HasSubstr("TX TY TZ RX RY RZ once"));
  EXPECT_THAT(asf(replaced(good, "direction 0 1 0", "direction 0 nan 0")), HasSubstr("finite"));
  EXPECT_THAT(asf(replaced(good, "direction 0 1 0", "direction 0 0 0")), HasSubstr("direction"));
  EXPECT_THAT(asf(replaced(good, "root a", "root z")), HasSubstr("child \"z\""));
  EXPECT_THAT(asf(replaced(good, "a b", "q b")), HasSubstr("not attached to the root"));
  EXPECT_THAT(asf(good.substr(0, good.find("end"))), HasSubstr("cut off"));

  const auto skeleton = parse_asf(good, "x.asf");
  EXPECT_THAT(message_of([&] { (void)parse_amc("1\nroot 0 0 0 0 0 0\n", "x.amc", skeleton); }),
              HasSubstr("skeleton without bone \"upperback\""));
}

TEST(AcclaimErrors, MotionMustFitTheSkeleton) {
  const auto file = recordings_folder() / "cmu" / "01.asf";
  CLAMBER_NEEDS_RECORDING(file);
  std::ifstream asf(file), amc(recordings_folder() / "cmu" / "01_02.amc");
  const std::string bones((std::istreambuf_iterator<char>(asf)), {});
  std::string frames((std::istreambuf_iterator<char>(amc)), {});
  frames.resize(frames.find("root", frames.find("root", frames.find("root") + 1) + 1) - 4);
  const auto skeleton = parse_asf(bones, "01.asf");
  const auto refusal = [&](const std::string& text) {
    return message_of([&] { (void)parse_amc(text, "x.amc", skeleton); });
  };
  ASSERT_EQ(refusal(frames), "accepted");
  EXPECT_THAT(refusal(frames.substr(0, frames.rfind("lfoot"))), HasSubstr("cut off"));
  EXPECT_THAT(refusal(replaced(frames, "rtibia 29.8142", "rtibia")), HasSubstr("finite number"));
  EXPECT_THAT(refusal(replaced(frames, "rtibia 29.8142", "rtibia nan")), HasSubstr("x.amc:27"));
  EXPECT_THAT(refusal(replaced(frames, "rtibia 29.8142", "rtibia 1 2")), HasSubstr("more values"));
  EXPECT_THAT(refusal(replaced(frames, "rtibia 29.8142", "tail 1")), HasSubstr("\"tail\""));
  EXPECT_THAT(refusal(replaced(frames, "root", "#oot")), HasSubstr("without root"));
}

TEST(ImportErrors, UnknownAndMissingFiles) {
  const auto folder = std::filesystem::path(testing::TempDir());
  const auto refusal = [&](const std::string& name, const std::string& bytes) {
    std::ofstream(folder / name, std::ios::binary) << bytes;
    return message_of([&] { (void)import_recording(folder / name); });
  };
  EXPECT_THAT(message_of([&] { (void)import_recording(folder / "none.mvnx"); }),
              HasSubstr("none.mvnx"));
  EXPECT_THAT(refusal("clamber_empty.mvnx", ""), HasSubstr("expected MVNX, NumPy positions"));
  EXPECT_THAT(refusal("clamber_text.csv", "hello world\n"), HasSubstr("expected MVNX"));
  EXPECT_THAT(refusal("clamber_skeleton.asf", small_asf()), HasSubstr("this is a skeleton"));
  EXPECT_THAT(refusal("clamber_alone.amc", ":DEGREES\n1\nroot 0 0 0 0 0 0\n"),
              HasSubstr("no skeleton beside it"));
  EXPECT_THAT(refusal("clamber_few.csv", "t,Hips_x,Hips_y,Hips_z\n0,1,2,3\n1,1,2,3\n"),
              HasSubstr("no joint \"Spine\""));
  // The content decides, not the name.
  EXPECT_THAT(refusal("clamber_mvnx.npy", "<mvnx version=\"9\"/>"), HasSubstr("version \"9\""));
  const auto times = [&](double start, double end) {
    return message_of([&] {
      ImportOptions options;
      options.window.start = start;
      options.window.end = end;
      (void)import_recording(demonstration_file(), options);
    });
  };
  EXPECT_THAT(times(-1.0, 5.0), HasSubstr("start"));
  EXPECT_THAT(times(1.0, 99.0), HasSubstr("end"));
  EXPECT_THAT(times(5.0, 2.0), HasSubstr("leave no frames"));
  EXPECT_THAT(message_of([&] {
                ImportOptions options;
                options.window.floor = 5.0;
                (void)import_recording(demonstration_file(), options);
              }),
              HasSubstr("does not fit hips"));
}

TEST(LimbFrames, CoincidingJointsAreRefused) {
  auto motion = parse_npy(make_npy(2, "<f8"), "x.npy");
  motion.frames[1].point[*motion.find_point("LeftLeg")] =
      motion.frames[1].point[*motion.find_point("LeftUpLeg")];
  EXPECT_THAT(message_of([&] { add_segments(motion); }), HasSubstr("frame 1: joints"));
}

}  // namespace
}  // namespace clamber
