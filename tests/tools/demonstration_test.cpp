// The committed default demonstration: reproducible, and plausible as a person's climb.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "planner_offline/recording/mvnx.hpp"
#include "robot_model/read_file.hpp"
#include "tools/climb_choreography.hpp"

namespace clamber {
namespace {

using tools::ClimbChoreography;

constexpr double kTable = 0.35;  // m

const std::filesystem::path kCommitted = std::filesystem::path(CLAMBER_SOURCE_DIR) / "configs" /
                                         "recordings" / "climb_table_synthetic.mvnx";

const HumanMotion& demonstration() {
  static const HumanMotion motion = parse_mvnx(read_file(kCommitted), "demonstration");
  return motion;
}

std::size_t frame_at(double time) {
  return static_cast<std::size_t>(std::lround(time * demonstration().rate));
}

Eigen::Vector3d place(std::size_t frame, const std::string& segment) {
  return demonstration().frames[frame].origin[demonstration().segment(segment)];
}

/// How far a joint strays from where it is at `from`, up to `to`, m.
double drift(const std::string& segment, double from, double to) {
  double most = 0.0;
  for (std::size_t f = frame_at(from); f <= frame_at(to); ++f) {
    most = std::max(most, (place(f, segment) - place(frame_at(from), segment)).norm());
  }
  return most;
}

/// Distance of a straight bone to the table (x >= 0, z <= its top), m.
double distance_to_table(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  double least = 1e9;
  for (int i = 0; i <= 50; ++i) {
    const Eigen::Vector3d p = a + (b - a) * (i / 50.0);
    least = std::min(least, std::hypot(std::max(-p.x(), 0.0), std::max(p.z() - kTable, 0.0)));
  }
  return least;
}

std::string quoted(const std::filesystem::path& file) {
  return std::string(1, '"').append(file.string()).append(1, '"');
}

int run(const std::string& arguments) {
  const std::string command = std::string(MAKE_DEMONSTRATION) + " " + arguments;
  return std::system(command.c_str());
}

TEST(Demonstration, ToolReproducesTheCommittedFile) {
  const auto file = std::filesystem::path(testing::TempDir()) / "clamber_demonstration.mvnx";
  ASSERT_EQ(run(quoted(file)), 0);
  const std::string made = read_file(file);
  EXPECT_TRUE(made == read_file(kCommitted));
  EXPECT_LT(made.size(), 3'000'000U);
}

TEST(Demonstration, OtherPeopleAndTables) {
  const auto file = std::filesystem::path(testing::TempDir()) / "clamber_other.mvnx";
  const std::string out = quoted(file) + " --rate 20 ";
  EXPECT_EQ(run(out + "--height 1.60 --table-height 0.30"), 0);
  EXPECT_EQ(run(out + "--height 1.90 --table-height 0.45"), 0);
  EXPECT_EQ(parse_mvnx(read_file(file), "other").rate, 20.0);
  EXPECT_NE(run(out + "--height 1.50 --table-height 0.9 2>/dev/null"), 0);  // out of reach
  EXPECT_NE(run("\"/nonexistent/x.mvnx\" 2>/dev/null"), 0);
}

TEST(Demonstration, SaysThatItIsSynthetic) {
  EXPECT_TRUE(demonstration().synthetic);
  const std::string head = read_file(kCommitted).substr(0, 400);
  EXPECT_NE(head.find("<!-- SYNTHETIC"), std::string::npos);
  EXPECT_NE(head.find("<comment>SYNTHETIC"), std::string::npos);
}

TEST(Demonstration, LastsAsLongAsAClimb) {
  EXPECT_GT(demonstration().duration(), 15.0);
  EXPECT_LT(demonstration().duration(), 25.0);
  EXPECT_EQ(demonstration().segments.size(), 23U);
  EXPECT_EQ(demonstration().joints.size(), 22U);
}

TEST(Demonstration, ContactsStayInPlace) {
  const double end = ClimbChoreography::kDuration;
  for (const std::string side : {"Left", "Right"}) {
    EXPECT_LT(drift(side + "Hand", ClimbChoreography::kWristContact, end), 0.001);
    EXPECT_LT(drift(side + "ForeArm", ClimbChoreography::kElbowContact, end), 0.001);
  }
  EXPECT_LT(drift("LeftFoot", 0.0, ClimbChoreography::kLeftLift), 0.001);
  EXPECT_LT(drift("LeftToe", 0.0, ClimbChoreography::kLeftLift), 0.001);
  EXPECT_LT(drift("RightFoot", 0.0, ClimbChoreography::kRightLift), 0.001);
  EXPECT_LT(drift("LeftLowerLeg", ClimbChoreography::kLeftKneeContact, end), 0.001);
  EXPECT_LT(drift("RightLowerLeg", ClimbChoreography::kRightKneeContact, end), 0.001);
}

/// First time at which a joint over the table comes within 6 cm of its top, s.
double first_touch(const std::string& segment) {
  for (std::size_t f = 0; f < demonstration().frames.size(); ++f) {
    const Eigen::Vector3d p = place(f, segment);
    if (p.x() > 0.0 && p.z() < kTable + 0.06) {
      return static_cast<double>(f) / demonstration().rate;
    }
  }
  return 1e9;
}

TEST(Demonstration, ContactsComeInThePapersOrder) {
  const double wrists = std::max(first_touch("LeftHand"), first_touch("RightHand"));
  const double elbows = std::min(first_touch("LeftForeArm"), first_touch("RightForeArm"));
  EXPECT_LT(wrists, elbows);
  EXPECT_LT(std::max(first_touch("LeftForeArm"), first_touch("RightForeArm")),
            first_touch("LeftLowerLeg"));
  EXPECT_LT(first_touch("LeftLowerLeg") + 1.0, first_touch("RightLowerLeg"));
  EXPECT_LT(first_touch("RightLowerLeg"), 20.0);
}

TEST(Demonstration, NothingGoesThroughTableOrFloor) {
  for (std::size_t f = 0; f < demonstration().frames.size(); ++f) {
    for (const std::string side : {"Left", "Right"}) {
      const auto at = [&](const char* segment) { return place(f, side + segment); };
      EXPECT_GT(distance_to_table(at("LowerLeg"), at("Foot")), 0.035) << side << " shank " << f;
      EXPECT_GT(distance_to_table(at("UpperLeg"), at("LowerLeg")), 0.045) << side << " thigh " << f;
      EXPECT_GT(distance_to_table(at("ForeArm"), at("Hand")), 0.034) << side << " forearm " << f;
      EXPECT_GT(distance_to_table(at("Foot"), at("Toe")), 0.03) << side << " foot " << f;
      const auto toe = demonstration().segment(side + "Toe");
      const Eigen::Vector3d tip = at("Toe") + demonstration().frames[f].orientation[toe] *
                                                  tools::Skeleton(1.75).tip[tools::kLeftToe];
      EXPECT_GT(tip.z(), -0.002) << side << " toes " << f;
    }
  }
}

/// Centre of mass with the usual segment masses (Winter): until the hands help, the person must not
/// fall over the toes.
TEST(Demonstration, LeansNoFurtherThanTheToesBeforeTheHandsTouch) {
  struct Link {
    const char* from;
    const char* to;
    double mass;   // share of the body
    double where;  // of the centre, from `from`
  };
  const std::array limbs{Link{"UpperArm", "ForeArm", 0.028, 0.436},
                         Link{"ForeArm", "Hand", 0.022, 0.682},
                         Link{"UpperLeg", "LowerLeg", 0.100, 0.433},
                         Link{"LowerLeg", "Foot", 0.0465, 0.433}, Link{"Foot", "Toe", 0.0145, 0.5}};
  for (std::size_t f = 0; f <= frame_at(ClimbChoreography::kWristContact); ++f) {
    const Eigen::Vector3d shoulders = 0.5 * (place(f, "LeftUpperArm") + place(f, "RightUpperArm"));
    double com = 0.497 * 0.5 * (place(f, "Pelvis") + shoulders).x() + 0.081 * place(f, "Head").x();
    for (const std::string side : {"Left", "Right"}) {
      for (const auto& limb : limbs) {
        com += limb.mass * ((1.0 - limb.where) * place(f, side + limb.from).x() +
                            limb.where * place(f, side + limb.to).x());
      }
    }
    const double toes = place(0, "LeftToe").x() + tools::Skeleton(1.75).tip[tools::kLeftToe].x();
    EXPECT_LT(com, toes + 0.03) << "at frame " << f;
  }
}

/// Angles of a healthy adult, deg, in MVN's triples.
TEST(Demonstration, JointsStayWithinHumanRange) {
  struct Range {
    const char* joint;
    int axis;
    double low, high;
  };
  const std::array ranges{Range{"Hip", 2, -20, 125},  Range{"Hip", 0, -30, 45},
                          Range{"Hip", 1, -45, 45},   Range{"Knee", 2, 0, 140},
                          Range{"Ankle", 2, -50, 35}, Range{"Shoulder", 2, -50, 180},
                          Range{"Elbow", 2, 0, 145},  Range{"Elbow", 1, 0, 170}};
  const auto& motion = demonstration();
  for (const auto& range : ranges) {
    for (const std::string side : {"jLeft", "jRight"}) {
      const auto joint = *motion.find_joint(side + range.joint);
      for (const auto& frame : motion.frames) {
        const double angle = frame.angle[joint][range.axis] * 180.0 / 3.14159265358979;
        EXPECT_GE(angle, range.low) << side << range.joint;
        EXPECT_LE(angle, range.high) << side << range.joint;
      }
    }
  }
}

TEST(Demonstration, MovesSmoothlyAndEndsAtRest) {
  const ClimbChoreography climb({});
  constexpr double dt = 0.005;
  for (double t = 2 * dt; t < ClimbChoreography::kDuration - dt; t += dt) {
    const auto a = climb.at(t - dt), b = climb.at(t), c = climb.at(t + dt);
    for (std::size_t i = 0; i < tools::kSegmentCount; ++i) {
      EXPECT_LT((c.p[i] - b.p[i]).norm() / dt, 1.0);
      EXPECT_LT((c.p[i] - 2.0 * b.p[i] + a.p[i]).norm() / (dt * dt), 3.0) << i << " at " << t;
    }
  }
  EXPECT_LT(drift("Pelvis", 21.0, 22.0), 1e-4);
}

}  // namespace
}  // namespace clamber
