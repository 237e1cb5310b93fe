#include "control/plan_image.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "control/crc32c.hpp"

namespace clamber {
namespace {

std::string_view text(const std::array<char, 64>& field) noexcept {
  return {field.data(),
          static_cast<std::size_t>(std::find(field.begin(), field.end(), '\0') - field.begin())};
}

/// The block as a whole: sizes, magic, version, checksum.
PlanImageStatus check_block(std::span<const std::byte> bytes, PlanImageHeader& header) noexcept {
  if (bytes.size() < sizeof(PlanImageHeader)) return PlanImageStatus::kTruncated;
  std::memcpy(&header, bytes.data(), sizeof(header));
  if (header.magic != kPlanImageMagic) return PlanImageStatus::kBadMagic;
  if (header.version != kPlanImageVersion) return PlanImageStatus::kBadVersion;
  if (header.keyframe_count < 2 || header.keyframe_count > kMaxKeyframes)
    return PlanImageStatus::kBadKeyframeCount;
  if (bytes.size() != plan_image_size(header.keyframe_count)) return PlanImageStatus::kTruncated;
  std::uint32_t crc = 0;
  const auto body = bytes.first(bytes.size() - sizeof(crc));
  std::memcpy(&crc, bytes.data() + body.size(), sizeof(crc));
  if (crc != crc32c(body)) return PlanImageStatus::kBadCrc;
  if (reinterpret_cast<std::uintptr_t>(bytes.data()) % alignof(ImageKeyframe) != 0)
    return PlanImageStatus::kMisaligned;
  return PlanImageStatus::kOk;
}

PlanImageStatus check_joint(const ImageKeyframe& k, std::size_t j,
                            const PlanRequirements& robot) noexcept {
  if (!std::isfinite(k.q[j]) || !std::isfinite(k.tau[j])) return PlanImageStatus::kNotFinite;
  if (k.q[j] < robot.lower[j] - robot.tolerance || k.q[j] > robot.upper[j] + robot.tolerance)
    return PlanImageStatus::kPositionLimit;
  if (std::abs(k.tau[j]) > robot.torque_limit[j] + robot.tolerance)
    return PlanImageStatus::kTorqueLimit;
  return PlanImageStatus::kOk;
}

bool policy_fits(std::span<const ImageKeyframe> keyframes, std::size_t i) noexcept {
  const ImageKeyframe& k = keyframes[i];
  return k.failure_policy < kFailurePolicies &&
         (i == 0 || k.phase != keyframes[i - 1].phase ||
          k.failure_policy == keyframes[i - 1].failure_policy);
}

PlanImageStatus check_keyframes(const PlanImageHeader& header,
                                std::span<const ImageKeyframe> keyframes,
                                const PlanRequirements& robot, PlanImageFault& fault) noexcept {
  for (fault.keyframe = 0; fault.keyframe < keyframes.size(); ++fault.keyframe) {
    const ImageKeyframe& k = keyframes[fault.keyframe];
    if (!std::isfinite(k.time)) return PlanImageStatus::kNotFinite;
    const bool advances =
        fault.keyframe == 0 ? k.time == 0.0 : k.time > keyframes[fault.keyframe - 1].time;
    if (!advances) return PlanImageStatus::kTimeNotIncreasing;
    if (!policy_fits(keyframes, fault.keyframe)) return PlanImageStatus::kFailurePolicy;
    for (fault.joint = 0; fault.joint < header.joint_count; ++fault.joint) {
      const PlanImageStatus status = check_joint(k, fault.joint, robot);
      if (status != PlanImageStatus::kOk) return status;
    }
  }
  if (header.duration != keyframes.back().time) return PlanImageStatus::kTimeNotIncreasing;
  return PlanImageStatus::kOk;
}

}  // namespace

bool names_certificate(const PlanImageHeader& header) noexcept {
  return std::all_of(header.certificate.begin(), header.certificate.end(),
                     [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); });
}

const char* to_string(PlanImageStatus status) noexcept {
  switch (status) {
    case PlanImageStatus::kOk:
      return "ok";
    case PlanImageStatus::kTruncated:
      return "length differs from what the header announces";
    case PlanImageStatus::kMisaligned:
      return "not on an 8-byte boundary";
    case PlanImageStatus::kBadMagic:
      return "not a plan image";
    case PlanImageStatus::kBadVersion:
      return "unknown image version";
    case PlanImageStatus::kBadKeyframeCount:
      return "needs 2 to 8192 keyframes";
    case PlanImageStatus::kBadCrc:
      return "checksum does not match";
    case PlanImageStatus::kBadJointCount:
      return "joint count differs from the robot's";
    case PlanImageStatus::kOtherRobot:
      return "made for another robot model";
    case PlanImageStatus::kUncertified:
      return "carries no certificate";
    case PlanImageStatus::kNotFinite:
      return "a number is not finite";
    case PlanImageStatus::kTimeNotIncreasing:
      return "keyframe times must start at 0 and increase";
    case PlanImageStatus::kPositionLimit:
      return "a keyframe lies outside the joint limits";
    case PlanImageStatus::kTorqueLimit:
      return "a feed-forward torque exceeds the joint's limit";
    case PlanImageStatus::kFailurePolicy:
      return "no known policy for a lost host, or two in one phase";
  }
  return "unknown";
}

PlanImageStatus open_plan_image(std::span<const std::byte> bytes, const PlanRequirements& robot,
                                PlanImageView& view, PlanImageFault* fault) noexcept {
  view = PlanImageView();
  PlanImageHeader header;
  PlanImageStatus status = check_block(bytes, header);
  if (status != PlanImageStatus::kOk) return status;
  if (header.joint_count != robot.lower.size() || header.joint_count > kMaxJoints ||
      robot.upper.size() != robot.lower.size() || robot.torque_limit.size() != robot.lower.size())
    return PlanImageStatus::kBadJointCount;
  if (text(header.robot_hash) != robot.robot_hash) return PlanImageStatus::kOtherRobot;
  if (!robot.accept_uncertified && !names_certificate(header)) return PlanImageStatus::kUncertified;
  if (!std::isfinite(header.friction) || !std::isfinite(header.duration))
    return PlanImageStatus::kNotFinite;
  const std::span<const ImageKeyframe> keyframes(
      reinterpret_cast<const ImageKeyframe*>(bytes.data() + sizeof(PlanImageHeader)),
      header.keyframe_count);
  PlanImageFault where;
  status = check_keyframes(header, keyframes, robot, where);
  if (status == PlanImageStatus::kOk)
    view = PlanImageView(reinterpret_cast<const PlanImageHeader*>(bytes.data()), keyframes);
  else if (fault != nullptr)
    *fault = where;
  return status;
}

bool write_plan_image(PlanImageHeader header, std::span<const ImageKeyframe> keyframes,
                      std::span<std::byte> out) noexcept {
  if (out.size() != plan_image_size(keyframes.size()) || keyframes.empty()) return false;
  header.keyframe_count = static_cast<std::uint32_t>(keyframes.size());
  header.duration = keyframes.back().time;
  std::memcpy(out.data(), &header, sizeof(header));
  std::memcpy(out.data() + sizeof(header), keyframes.data(), keyframes.size_bytes());
  const std::size_t body = out.size() - sizeof(std::uint32_t);
  const std::uint32_t crc = crc32c(out.first(body));
  std::memcpy(out.data() + body, &crc, sizeof(crc));
  return true;
}

}  // namespace clamber
