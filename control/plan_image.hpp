// The plan image: a plan as one fixed-layout block of bytes that the controller checks and uses in
// place (a file read whole, or a flash sector).
// Any thread; allocates: never; blocks: never; throws: never.
//
// Layout, little-endian: PlanImageHeader | keyframe_count x ImageKeyframe | CRC-32C of all before
// it.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>

#include "control/failure_policy.hpp"
#include "robot_model/types.hpp"

namespace clamber {

static_assert(std::endian::native == std::endian::little, "images are used in place");

inline constexpr std::array<char, 8> kPlanImageMagic = {'C', 'L', 'M', 'B', 'P', 'L', 'A', 'N'};
inline constexpr std::uint32_t kPlanImageVersion = 3;
inline constexpr std::uint32_t kMaxKeyframes = 8192;

struct PlanImageHeader {
  std::array<char, 8> magic = kPlanImageMagic;
  std::uint32_t version = kPlanImageVersion;
  std::uint32_t joint_count = 0;
  std::uint32_t keyframe_count = 0;
  std::uint32_t reserved = 0;
  std::array<char, 64> robot_hash{};     ///< hex, zero-padded
  std::array<char, 64> scenario_hash{};  ///< hex, zero-padded
  std::array<char, 64> certificate{};    ///< SHA-256 of the plan's certificate, hex; zeros: none
  double friction = 0.0;
  double duration = 0.0;  ///< s, the last keyframe's time
};

struct ImageKeyframe {
  double time = 0.0;  ///< s; the first keyframe's is 0
  std::uint32_t phase = 0;
  std::uint32_t failure_policy = 0;      ///< FailurePolicy; one in all of a phase
  std::array<double, kMaxJoints> q{};    ///< rad, the model's joint order; zero beyond the joints
  std::array<double, kMaxJoints> tau{};  ///< N m, feed-forward
};

static_assert(std::is_trivially_copyable_v<PlanImageHeader> && sizeof(PlanImageHeader) == 232);
static_assert(std::is_trivially_copyable_v<ImageKeyframe> && sizeof(ImageKeyframe) == 528);

enum class PlanImageStatus : std::uint8_t {
  kOk,
  kTruncated,   ///< fewer bytes than a header, or other than the header announces
  kMisaligned,  ///< the block does not start on an 8-byte boundary
  kBadMagic,
  kBadVersion,
  kBadKeyframeCount,  ///< fewer than 2 or more than kMaxKeyframes
  kBadCrc,
  kBadJointCount,  ///< not the robot's
  kOtherRobot,     ///< made for a robot model with another hash
  kUncertified,    ///< no certificate was found valid before the image was made
  kNotFinite,
  kTimeNotIncreasing,  ///< or not starting at 0, or not ending at the duration
  kPositionLimit,      ///< a keyframe outside the joint limits
  kTorqueLimit,        ///< a feed-forward torque beyond the joint's torque limit
  kFailurePolicy,      ///< none that is known, or two in one phase
};

[[nodiscard]] const char* to_string(PlanImageStatus status) noexcept;

/// The header names a certificate: 64 lower-case hexadecimal digits. Whoever makes an image with
/// them vouches that this certificate was verified for the image's keyframes.
[[nodiscard]] bool names_certificate(const PlanImageHeader& header) noexcept;

/// What the controller demands of an image. Limits: one entry per joint.
struct PlanRequirements {
  std::string_view robot_hash;
  std::span<const double> lower;         ///< rad
  std::span<const double> upper;         ///< rad
  std::span<const double> torque_limit;  ///< N m
  double tolerance = 1e-6;               ///< rad or N m beyond a limit that rounding may explain
  /// Only for what is run without a plan on purpose, as the comparison with a direct playback.
  bool accept_uncertified = false;
};

/// A checked image, looked at where it lies.
class PlanImageView {
 public:
  PlanImageView() = default;
  PlanImageView(const PlanImageHeader* header, std::span<const ImageKeyframe> keyframes)
      : header_(header), keyframes_(keyframes) {}

  [[nodiscard]] const PlanImageHeader& header() const noexcept { return *header_; }
  [[nodiscard]] std::span<const ImageKeyframe> keyframes() const noexcept { return keyframes_; }

  /// From keyframe `segment` to the next: of the phase that leads there.
  [[nodiscard]] FailurePolicy failure_policy(std::size_t segment) const noexcept {
    return static_cast<FailurePolicy>(
        keyframes_[segment + 1 < keyframes_.size() ? segment + 1 : segment].failure_policy);
  }

  // The knots of the joint spline (control/spline.hpp).
  [[nodiscard]] std::size_t size() const noexcept { return keyframes_.size(); }
  [[nodiscard]] std::size_t dimensions() const noexcept { return header_->joint_count; }
  [[nodiscard]] double time(std::size_t i) const noexcept { return keyframes_[i].time; }
  [[nodiscard]] double value(std::size_t i, std::size_t joint) const noexcept {
    return keyframes_[i].q[joint];
  }

 private:
  const PlanImageHeader* header_ = nullptr;
  std::span<const ImageKeyframe> keyframes_;
};

/// The keyframe that an unacceptable image failed at, for the message to the operator.
struct PlanImageFault {
  std::uint32_t keyframe = 0;
  std::uint32_t joint = 0;
};

/// Checks `bytes` and, if all is well, sets `view` to look into them; they must outlive it.
[[nodiscard]] PlanImageStatus open_plan_image(std::span<const std::byte> bytes,
                                              const PlanRequirements& robot, PlanImageView& view,
                                              PlanImageFault* fault = nullptr) noexcept;

[[nodiscard]] constexpr std::size_t plan_image_size(std::size_t keyframes) noexcept {
  return sizeof(PlanImageHeader) + keyframes * sizeof(ImageKeyframe) + sizeof(std::uint32_t);
}

/// Writes header, keyframes and checksum. The header's keyframe_count and duration are taken from
/// the keyframes. False when `out` is not plan_image_size() long.
[[nodiscard]] bool write_plan_image(PlanImageHeader header,
                                    std::span<const ImageKeyframe> keyframes,
                                    std::span<std::byte> out) noexcept;

}  // namespace clamber
