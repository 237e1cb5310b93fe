#include "control/plan_image.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <limits>
#include <string>

#include "control/crc32c.hpp"
#include "tests/control/test_plan.hpp"

namespace clamber {
namespace {

constexpr std::uint32_t kJoints = 3;

struct Robot {
  std::vector<double> lower{-1.0, -1.0, -1.0}, upper{1.0, 1.0, 1.0}, torque{30.0, 30.0, 30.0};
  [[nodiscard]] PlanRequirements requirements() const {
    return {.robot_hash = test::kRobotHash, .lower = lower, .upper = upper, .torque_limit = torque};
  }
};

PlanImageStatus open(const std::vector<std::byte>& bytes, const Robot& robot = {}) {
  PlanImageView view;
  return open_plan_image(bytes, robot.requirements(), view);
}

/// The image with one keyframe changed and the checksum made right again.
std::vector<std::byte> with_keyframes(
    const std::function<void(std::vector<ImageKeyframe>&)>& change) {
  auto keyframes = test::smooth_keyframes(kJoints, 6);
  change(keyframes);
  return test::make_image(kJoints, keyframes);
}

std::vector<std::byte> with_header(const std::function<void(PlanImageHeader&)>& change) {
  auto image = test::make_image(kJoints, test::smooth_keyframes(kJoints, 6));
  PlanImageHeader header;
  std::memcpy(&header, image.data(), sizeof(header));
  change(header);
  std::memcpy(image.data(), &header, sizeof(header));
  const std::uint32_t crc = crc32c(std::span(image).first(image.size() - 4));
  std::memcpy(image.data() + image.size() - 4, &crc, 4);
  return image;
}

TEST(Crc32c, MatchesTheStandardsCheckValues) {
  const auto of = [](std::string_view text) {
    return crc32c(std::as_bytes(std::span(text.data(), text.size())));
  };
  EXPECT_EQ(of("123456789"), 0xE3069283u);
  EXPECT_EQ(of(std::string(32, '\0')), 0x8A9136AAu);  // RFC 3720 B.4
  EXPECT_EQ(of(std::string(32, '\xff')), 0x62A8AB43u);
}

TEST(PlanImage, RoundTripKeepsEveryBit) {
  const auto keyframes = test::smooth_keyframes(kJoints, 6);
  const auto image = test::make_image(kJoints, keyframes);
  PlanImageView view;
  ASSERT_EQ(open_plan_image(image, Robot().requirements(), view), PlanImageStatus::kOk);
  ASSERT_EQ(view.keyframes().size(), keyframes.size());
  EXPECT_EQ(std::memcmp(view.keyframes().data(), keyframes.data(),
                        keyframes.size() * sizeof(ImageKeyframe)),
            0);
  EXPECT_EQ(view.header().duration, keyframes.back().time);
  EXPECT_EQ(view.header().friction, 0.8);
}

TEST(PlanImage, RefusesEverySingleFlippedBit) {
  const auto image = test::make_image(kJoints, test::smooth_keyframes(kJoints, 2));
  for (std::size_t bit = 0; bit < image.size() * 8; ++bit) {
    auto broken = image;
    broken[bit / 8] ^= std::byte{1} << (bit % 8);
    ASSERT_NE(open(broken), PlanImageStatus::kOk) << "bit " << bit;
  }
}

TEST(PlanImage, RefusesEveryTruncation) {
  const auto image = test::make_image(kJoints, test::smooth_keyframes(kJoints, 2));
  for (std::size_t size = 0; size < image.size(); ++size)
    ASSERT_EQ(open({image.begin(), image.begin() + static_cast<std::ptrdiff_t>(size)}),
              PlanImageStatus::kTruncated);
}

TEST(PlanImage, NamesWhatIsWrong) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(open(with_header([](auto& h) { h.magic[0] = 'X'; })), PlanImageStatus::kBadMagic);
  EXPECT_EQ(open(with_header([](auto& h) { h.version = 2; })), PlanImageStatus::kBadVersion);
  EXPECT_EQ(open(with_header([](auto& h) { h.keyframe_count = 1; })),
            PlanImageStatus::kBadKeyframeCount);
  EXPECT_EQ(open(with_header([](auto& h) { h.keyframe_count = 0xFFFFFFFF; })),
            PlanImageStatus::kBadKeyframeCount);
  EXPECT_EQ(open(with_header([](auto& h) { h.keyframe_count = 7; })), PlanImageStatus::kTruncated);
  EXPECT_EQ(open(with_header([](auto& h) { h.joint_count = 4; })), PlanImageStatus::kBadJointCount);
  EXPECT_EQ(open(with_header([](auto& h) { h.robot_hash[0] = 'f'; })),
            PlanImageStatus::kOtherRobot);
  EXPECT_EQ(open(with_header([&](auto& h) { h.friction = nan; })), PlanImageStatus::kNotFinite);
  EXPECT_EQ(open(with_header([](auto& h) { h.duration = 1.0; })),
            PlanImageStatus::kTimeNotIncreasing);
  EXPECT_EQ(open(with_keyframes([](auto& k) { k[0].time = 0.01; })),
            PlanImageStatus::kTimeNotIncreasing);
  EXPECT_EQ(open(with_keyframes([](auto& k) { k[3].time = k[2].time; })),
            PlanImageStatus::kTimeNotIncreasing);
  EXPECT_EQ(open(with_keyframes([&](auto& k) { k[3].time = nan; })), PlanImageStatus::kNotFinite);
  EXPECT_EQ(open(with_keyframes([&](auto& k) { k[3].q[1] = nan; })), PlanImageStatus::kNotFinite);
  EXPECT_EQ(open(with_keyframes([&](auto& k) { k[3].tau[1] = nan; })), PlanImageStatus::kNotFinite);
  EXPECT_EQ(open(with_keyframes([](auto& k) { k[3].q[1] = 1.001; })),
            PlanImageStatus::kPositionLimit);
  EXPECT_EQ(open(with_keyframes([](auto& k) { k[3].tau[1] = -30.1; })),
            PlanImageStatus::kTorqueLimit);
}

TEST(PlanImage, CarriesOneKnownFailurePolicyAPhase) {
  const auto hold = static_cast<std::uint32_t>(FailurePolicy::kHold);
  const auto limp = static_cast<std::uint32_t>(FailurePolicy::kLimp);
  // Keyframes 2 and 3 are the second of three phases.
  const auto image = with_keyframes([&](auto& k) {
    for (const std::size_t i : {2u, 3u}) k[i].failure_policy = limp;
  });
  PlanImageView view;
  ASSERT_EQ(open_plan_image(image, Robot().requirements(), view), PlanImageStatus::kOk);
  // A phase begins with the motion that leads to its first keyframe.
  EXPECT_EQ(view.failure_policy(0), FailurePolicy::kHold);
  EXPECT_EQ(view.failure_policy(1), FailurePolicy::kLimp);
  EXPECT_EQ(view.failure_policy(2), FailurePolicy::kLimp);
  EXPECT_EQ(view.failure_policy(3), FailurePolicy::kHold);
  EXPECT_EQ(view.failure_policy(5), FailurePolicy::kHold);

  EXPECT_EQ(open(with_keyframes([](auto& k) { k[3].failure_policy = kFailurePolicies; })),
            PlanImageStatus::kFailurePolicy);
  EXPECT_EQ(open(with_keyframes([&](auto& k) {
              k[2].failure_policy = limp;
              k[3].failure_policy = hold;
            })),
            PlanImageStatus::kFailurePolicy);
}

TEST(PlanImage, RefusesAPlanWithoutCertificateUnlessToldOtherwise) {
  for (const auto& image : {with_header([](auto& h) { h.certificate.fill('\0'); }),
                            with_header([](auto& h) { h.certificate[63] = '\0'; }),
                            with_header([](auto& h) { h.certificate[0] = 'G'; })}) {
    EXPECT_EQ(open(image), PlanImageStatus::kUncertified);
    const Robot robot;
    PlanRequirements requirements = robot.requirements();
    requirements.accept_uncertified = true;
    PlanImageView view;
    EXPECT_EQ(open_plan_image(image, requirements, view), PlanImageStatus::kOk);
  }
}

TEST(PlanImage, TellsWhereTheFaultLies) {
  const auto image = with_keyframes([](auto& k) { k[4].q[2] = -1.2; });
  PlanImageView view;
  PlanImageFault fault;
  ASSERT_EQ(open_plan_image(image, Robot().requirements(), view, &fault),
            PlanImageStatus::kPositionLimit);
  EXPECT_EQ(fault.keyframe, 4u);
  EXPECT_EQ(fault.joint, 2u);
  EXPECT_TRUE(view.keyframes().empty());
}

TEST(PlanImage, RefusesAMisalignedBlock) {
  const auto image = test::make_image(kJoints, test::smooth_keyframes(kJoints, 2));
  std::vector<std::byte> shifted(image.size() + 1);
  std::copy(image.begin(), image.end(), shifted.begin() + 1);
  PlanImageView view;
  EXPECT_EQ(open_plan_image(std::span(shifted).subspan(1), Robot().requirements(), view),
            PlanImageStatus::kMisaligned);
}

}  // namespace
}  // namespace clamber
