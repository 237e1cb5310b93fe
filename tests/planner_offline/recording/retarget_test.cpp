#include "planner_offline/retarget/retarget.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <random>

#include "planner_offline/recording/joint_angles.hpp"
#include "planner_offline/retarget/chain_solver.hpp"
#include "robot_model/kinematics.hpp"
#include "robot_model/loader.hpp"
#include "tests/planner_offline/recording/recordings.hpp"

namespace clamber {
namespace {

using testing::HasSubstr;
using tools::segment_specs;

const std::filesystem::path kComan =
    std::filesystem::path(CLAMBER_SOURCE_DIR) / "configs" / "robots" / "coman";

const RobotModel& coman() {
  static const RobotModel model = load_robot(kComan / "robot.yaml");
  return model;
}
const RetargetConfig& config() {
  static const RetargetConfig loaded = load_retarget_config(kComan / "retarget.yaml");
  return loaded;
}

using Rotations = std::array<Eigen::Matrix3d, tools::kSegmentCount>;

/// A standing person with the N-pose rotations replaced by `R`, for a few frames.
HumanMotion person(const std::vector<Rotations>& poses) {
  const tools::Skeleton skeleton(1.75);
  HumanMotion motion;
  motion.source = "test";
  motion.rate = 100.0;
  motion.hip_height = skeleton.hip_height;
  for (const auto& spec : segment_specs()) motion.segments.emplace_back(spec.label);
  for (const auto& R : poses) {
    tools::Figure figure;
    figure.R = R;
    figure.p.fill(Eigen::Vector3d::Zero());
    figure.p[tools::kPelvis].z() = skeleton.hip_height;
    tools::place_segments(skeleton, figure);
    HumanMotion::Frame frame;
    for (std::size_t i = 0; i < tools::kSegmentCount; ++i) {
      frame.orientation.emplace_back(figure.R[i]);
      frame.origin.push_back(figure.p[i]);
    }
    motion.frames.push_back(std::move(frame));
  }
  return motion;
}

/// The N-pose with `segment` and all that hangs on it turned about a world axis.
Rotations turned(std::string_view segment, double angle, const Eigen::Vector3d& axis) {
  const auto& specs = segment_specs();
  Rotations R;
  std::array<bool, tools::kSegmentCount> moved{};
  for (std::size_t i = 0; i < specs.size(); ++i) {
    moved[i] = specs[i].label == segment ||
               (specs[i].parent >= 0 && moved[static_cast<std::size_t>(specs[i].parent)]);
    R[i] =
        moved[i] ? Eigen::AngleAxisd(angle, axis).toRotationMatrix() : Eigen::Matrix3d::Identity();
  }
  return R;
}

struct Flexion {
  const char* segment;
  Eigen::Vector3d axis;
  const char* joint;
  double sign;
};

/// One human rotation moves one robot joint, by the same angle, with the sign of COMAN's table.
TEST(Retarget, PureRotationsMoveOneJoint) {
  const Eigen::Vector3d X = Eigen::Vector3d::UnitX(), Y = Eigen::Vector3d::UnitY(),
                        Z = Eigen::Vector3d::UnitZ();
  const std::vector<Flexion> cases{{"T8", Y, "WaistSag", 1},
                                   {"T8", Z, "WaistYaw", 1},
                                   {"RightUpperLeg", Y, "RHipSag", 1},
                                   {"LeftUpperLeg", Y, "LHipSag", 1},
                                   {"RightUpperLeg", X, "RHipLat", 1},
                                   {"LeftUpperLeg", X, "LHipLat", 1},
                                   {"RightUpperLeg", Z, "RHipYaw", 1},
                                   {"LeftUpperLeg", Z, "LHipYaw", 1},
                                   {"RightLowerLeg", Y, "RKneeSag", 1},
                                   {"LeftLowerLeg", Y, "LKneeSag", 1},
                                   {"RightFoot", Y, "RAnkSag", 1},
                                   {"LeftFoot", Y, "LAnkSag", 1},
                                   {"RightFoot", X, "RAnkLat", 1},
                                   {"LeftFoot", X, "LAnkLat", 1},
                                   {"RightUpperArm", Y, "RShSag", 1},
                                   {"LeftUpperArm", Y, "LShSag", 1},
                                   {"RightUpperArm", X, "RShLat", 1},
                                   {"LeftUpperArm", X, "LShLat", 1},
                                   {"RightUpperArm", Z, "RShYaw", 1},
                                   {"LeftUpperArm", Z, "LShYaw", 1},
                                   {"RightForeArm", Y, "RElbj", 1},
                                   {"LeftForeArm", Y, "LElbj", 1}};
  for (const auto& c : cases) {
    const auto& limits = coman().joints[static_cast<std::size_t>(*coman().find_joint(c.joint))];
    const double angle = limits.upper > 0.3 ? 0.25 : -0.25;
    const auto robot = retarget(person({turned(c.segment, angle, c.axis)}), coman(), config());
    EXPECT_TRUE(robot.clamped.empty());
    for (int j = 0; j < coman().joint_count(); ++j) {
      const bool expected = coman().joints[static_cast<std::size_t>(j)].name == c.joint;
      EXPECT_NEAR(robot.frames[0].q[j], expected ? c.sign * angle : 0.0, 1e-9)
          << c.segment << " moves " << coman().joints[static_cast<std::size_t>(j)].name;
    }
  }
}

/// The algebra of the mapping: COMAN's angles are the recording's, with known signs.
TEST(Retarget, AgreesWithTheRecordedAngleTriples) {
  std::mt19937 generator(3);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(generator()) / 4294967295.0;
  };
  for (int trial = 0; trial < 50; ++trial) {
    Rotations R = turned("Pelvis", 0.0, Eigen::Vector3d::UnitX());
    const auto random_turn = [&](double size) {
      return rotation_exp(
          Eigen::Vector3d(uniform(-size, size), uniform(-size, size), uniform(-size, size)));
    };
    R[tools::kPelvis] = random_turn(1.0);
    R[tools::kRightUpperLeg] = R[tools::kPelvis] * random_turn(0.4);
    R[tools::kLeftUpperLeg] = R[tools::kPelvis] * random_turn(0.4);
    R[tools::kRightLowerLeg] = R[tools::kRightUpperLeg] * random_turn(0.3);
    R[tools::kLeftUpperArm] = R[tools::kT8] * random_turn(0.3);
    R[tools::kLeftForeArm] = R[tools::kLeftUpperArm] *
                             Eigen::AngleAxisd(-1.0, Eigen::Vector3d::UnitY()) *
                             Eigen::AngleAxisd(uniform(-3.0, 3.0), Eigen::Vector3d::UnitZ());
    RetargetConfig unclamped = config();
    const auto robot = retarget(person({R}), coman(), unclamped);
    const auto q = [&](const char* joint) { return robot.frames[0].q[*coman().find_joint(joint)]; };
    const auto clamped = [&](const char* joint, double angle) {
      const auto& limits = coman().joints[static_cast<std::size_t>(*coman().find_joint(joint))];
      return std::clamp(angle, limits.lower, limits.upper);
    };
    const auto right = mvn_joint_angle(R[tools::kPelvis], R[tools::kRightUpperLeg], "jRightHip");
    EXPECT_NEAR(q("RHipSag"), clamped("RHipSag", -right.z()), 1e-8);
    EXPECT_NEAR(q("RHipLat"), clamped("RHipLat", -right.x()), 1e-8);
    EXPECT_NEAR(q("RHipYaw"), clamped("RHipYaw", right.y()), 1e-8);
    const auto left = mvn_joint_angle(R[tools::kPelvis], R[tools::kLeftUpperLeg], "jLeftHip");
    EXPECT_NEAR(q("LHipSag"), clamped("LHipSag", -left.z()), 1e-8);
    EXPECT_NEAR(q("LHipLat"), clamped("LHipLat", left.x()), 1e-8);
    EXPECT_NEAR(q("LHipYaw"), clamped("LHipYaw", -left.y()), 1e-8);
    const auto knee =
        mvn_joint_angle(R[tools::kRightUpperLeg], R[tools::kRightLowerLeg], "jRightKnee");
    EXPECT_NEAR(q("RKneeSag"), clamped("RKneeSag", knee.z()), 1e-6);
    // Whatever the pronation.
    EXPECT_NEAR(q("LElbj"), -1.0, 1e-6);
  }
}

/// The waist's first axis is tilted: its angles are solved, not copied.
TEST(Retarget, WaistReproducesTheSpinesRotation) {
  std::mt19937 generator(5);
  const auto uniform = [&] { return 2.0 * static_cast<double>(generator()) / 4294967295.0 - 1.0; };
  const int first = *coman().find_joint("WaistLat");
  const ChainSolver waist(coman(), {first, first + 1, first + 2});
  for (int trial = 0; trial < 200; ++trial) {
    ChainSolver::Angles q(3);
    q << 0.5 * uniform(), 0.26 + 0.6 * uniform(), 1.3 * uniform();
    const Eigen::Matrix3d target = waist.rotation(q);
    double residual = 1.0;
    const auto solved = waist.solve_anywhere(target, residual);
    EXPECT_LT(residual, 1e-9);
    EXPECT_LT((waist.rotation(solved) - target).norm(), 1e-9);
    EXPECT_LT((solved - q).norm(), 1e-7);
  }
}

TEST(Retarget, AnglesAreContinuousOverTime) {
  // The arm swings forward through the overhead position: -170 deg to -190 deg, never +170.
  std::vector<Rotations> poses;
  for (int i = 0; i <= 200; ++i) {
    poses.push_back(turned("RightUpperArm", -3.4 * i / 200.0, Eigen::Vector3d::UnitY()));
  }
  const auto robot = retarget(person(poses), coman(), config());
  const int sag = *coman().find_joint("RShSag");
  for (std::size_t f = 1; f < robot.frames.size(); ++f) {
    EXPECT_NEAR(robot.frames[f].q[sag] - robot.frames[f - 1].q[sag], -0.017, 1e-6);
  }
}

/// Far beyond the limit the same rotation would also be reachable from the other side (+108 deg);
/// the joint stays at the limit through which it left.
TEST(Retarget, StaysOnItsSideBeyondALimit) {
  std::vector<Rotations> poses;
  for (int i = 0; i <= 200; ++i) {
    poses.push_back(turned("RightUpperArm", -4.4 * i / 200.0, Eigen::Vector3d::UnitY()));
  }
  const auto robot = retarget(person(poses), coman(), config());
  const int sag = *coman().find_joint("RShSag");
  EXPECT_EQ(robot.frames.back().q[sag], coman().joints[static_cast<std::size_t>(sag)].lower);
}

TEST(Retarget, ReportsWhatWasClamped) {
  const auto straight = turned("RightLowerLeg", 0.0, Eigen::Vector3d::UnitY());
  const auto folded = turned("RightLowerLeg", 2.5, Eigen::Vector3d::UnitY());
  const auto less = turned("RightLowerLeg", 2.2, Eigen::Vector3d::UnitY());
  const auto robot = retarget(person({folded, straight, folded, less}), coman(), config());
  ASSERT_EQ(robot.clamped.size(), 1U);
  EXPECT_EQ(robot.clamped[0].joint, "RKneeSag");
  const int knee = *coman().find_joint("RKneeSag");
  const double upper = coman().joints[static_cast<std::size_t>(knee)].upper;
  EXPECT_NEAR(robot.clamped[0].worst, 2.5 - upper, 1e-6);
  EXPECT_DOUBLE_EQ(robot.clamped[0].share, 0.75);
  EXPECT_DOUBLE_EQ(robot.frames[0].q[knee], upper);
}

TEST(Retarget, BaseFollowsThePelvisAtTheRobotsScale) {
  const Rotations upright = turned("Pelvis", 0.0, Eigen::Vector3d::UnitX());
  auto motion = person({upright, upright});
  // The person faces along +y of its world and walks there, 0.3 m, 0.1 m up.
  for (auto& frame : motion.frames) {
    for (std::size_t i = 0; i < frame.orientation.size(); ++i) {
      const Eigen::AngleAxisd turn(1.57079632679489662, Eigen::Vector3d::UnitZ());
      frame.orientation[i] = turn * frame.orientation[i];
      frame.origin[i] = turn * frame.origin[i] + Eigen::Vector3d(5.0, 7.0, 3.0);
    }
  }
  for (auto& origin : motion.frames[1].origin) origin += Eigen::Vector3d(0.0, 0.3, 0.1);
  motion.heading = 1.57079632679489662;
  const auto robot = retarget(motion, coman(), config());
  EXPECT_LT((robot.frames[0].X_WB.R - Eigen::Matrix3d::Identity()).norm(), 1e-9);
  RobotData data;
  forward_kinematics(coman(), robot.frames[0], data);
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const auto* foot : {"Lfoot", "Rfoot"}) {
    const auto& link = coman().contacts[static_cast<std::size_t>(*coman().find_contact(foot))];
    for (const auto& p : link.points) {
      const Eigen::Vector3d p_W = data.X_WB[static_cast<std::size_t>(link.body)] * p;
      EXPECT_NEAR(p_W.z(), 0.0, 1e-9);
      middle += p_W / 8.0;
    }
  }
  EXPECT_LT(middle.head<2>().norm(), 1e-9);
  const double scale = 0.5168 / motion.hip_height;
  const Eigen::Vector3d moved = robot.frames[1].X_WB.p - robot.frames[0].X_WB.p;
  EXPECT_LT((moved - scale * Eigen::Vector3d(0.3, 0.0, 0.1)).norm(), 1e-4);
  EXPECT_EQ(robot.human_leg_length, motion.hip_height);
}

/// A robot whose zero posture is not the person's: at the N-pose it takes its neutral angles, and
/// human rotations count from there.
TEST(Retarget, NeutralPostureOfARobot) {
  RetargetConfig bent = config();
  bent.neutral = {{"RElbj", -1.0}, {"LHipSag", -0.3}, {"LKneeSag", 0.6}, {"LAnkSag", -0.3}};
  const auto robot = retarget(person({turned("Pelvis", 0.0, Eigen::Vector3d::UnitX()),
                                      turned("RightForeArm", -0.5, Eigen::Vector3d::UnitY())}),
                              coman(), bent);
  for (int j = 0; j < coman().joint_count(); ++j) {
    const auto& name = coman().joints[static_cast<std::size_t>(j)].name;
    const double neutral = bent.neutral.contains(name) ? bent.neutral.at(name) : 0.0;
    EXPECT_NEAR(robot.frames[0].q[j], neutral, 1e-8) << name;
    EXPECT_NEAR(robot.frames[1].q[j], neutral - (name == "RElbj" ? 0.5 : 0.0), 1e-8) << name;
  }
}

std::string message_of(const std::function<void()>& job) {
  try {
    job();
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Retarget, Refusals) {
  const auto good = person({turned("Pelvis", 0.0, Eigen::Vector3d::UnitX())});
  const auto refusal = [](const HumanMotion& motion, const RetargetConfig& with) {
    return message_of([&] { (void)retarget(motion, coman(), with); });
  };
  ASSERT_EQ(refusal(good, config()), "accepted");
  auto motion = good;
  motion.segments[tools::kLeftForeArm] = "Tail";
  EXPECT_THAT(refusal(motion, config()), HasSubstr("no segment \"LeftForeArm\""));
  motion = good;
  motion.hip_height = 0.0;
  EXPECT_THAT(refusal(motion, config()), HasSubstr("hip height"));
  motion = good;
  motion.frames.clear();
  EXPECT_THAT(refusal(motion, config()), HasSubstr("no frames"));
  auto changed = config();
  changed.chains[0].joints = {"WaistLat", "Tail"};
  EXPECT_THAT(refusal(good, changed), HasSubstr("joint \"Tail\""));
  changed = config();
  changed.chains[0].joints = {"WaistLat", "WaistYaw"};
  EXPECT_THAT(refusal(good, changed), HasSubstr("does not follow \"WaistLat\""));
  changed = config();
  changed.legs[0].sole = "Tail";
  EXPECT_THAT(refusal(good, changed), HasSubstr("contact link \"Tail\""));
}

TEST(RetargetConfigTest, RefusesUnknownKeysAndWords) {
  const auto file = std::filesystem::path(testing::TempDir()) / "clamber_retarget.yaml";
  const auto refusal = [&](const std::string& text) {
    std::ofstream(file) << text;
    return message_of([&] { (void)load_retarget_config(file); });
  };
  const std::string legs = "legs:\n  - {hip: A, sole: B}\n";
  ASSERT_EQ(refusal("chains:\n  a: {from: A, to: B, joints: [c]}\n" + legs), "accepted");
  EXPECT_THAT(refusal("chain: {}\n" + legs), HasSubstr("chain"));
  EXPECT_THAT(refusal(legs), HasSubstr("chains"));
  EXPECT_THAT(refusal("chains:\n  a: {from: A, to: B, joints: []}\n" + legs), HasSubstr("joint"));
  EXPECT_THAT(refusal("chains:\n  a: {from: A, to: B, joints: [c], match: x}\n" + legs),
              HasSubstr("long_axis"));
  EXPECT_THAT(refusal("rate: 0\nchains:\n  a: {from: A, to: B, joints: [c]}\n" + legs),
              HasSubstr("rate"));
  EXPECT_THAT(refusal("chains:\n  a: {from: A, to: B, joints: [c]}\nlegs: []\n"), HasSubstr("leg"));
}

}  // namespace
}  // namespace clamber
