#include "planner_offline/plan_image.hpp"

#include <algorithm>
#include <fstream>

#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

std::array<char, 64> hash_field(const std::string& hash, const char* what) {
  std::array<char, 64> field{};
  if (hash.size() > field.size())
    throw InputError(std::string("plan: ") + what + " has " + std::to_string(hash.size()) +
                     " characters, at most 64 fit an image");
  std::copy(hash.begin(), hash.end(), field.begin());
  return field;
}

ImageKeyframe to_image(const Plan& plan, std::size_t index) {
  const std::size_t joints = plan.joint_names.size();
  const Keyframe& keyframe = plan.keyframes[index];
  const auto size = static_cast<Eigen::Index>(joints);
  if (keyframe.x.q.size() != size || keyframe.tau.size() != size || keyframe.phase < 0 ||
      keyframe.phase >= std::ssize(plan.phases))
    throw InputError("plan: keyframes[" + std::to_string(index) + "]: expected " +
                     std::to_string(joints) + " values in q and tau and one of the phases");
  ImageKeyframe out;
  out.time = keyframe.time;
  out.phase = static_cast<std::uint32_t>(keyframe.phase);
  out.failure_policy = static_cast<std::uint32_t>(
      plan.phases[static_cast<std::size_t>(keyframe.phase)].failure_policy);
  std::copy_n(keyframe.x.q.data(), joints, out.q.begin());
  std::copy_n(keyframe.tau.data(), joints, out.tau.begin());
  return out;
}

}  // namespace

std::vector<std::byte> plan_to_image(const Plan& plan, const std::string& certificate_sha256) {
  const std::size_t joints = plan.joint_names.size();
  if (joints == 0 || joints > kMaxJoints)
    throw InputError("plan: joint_names: expected 1 to " + std::to_string(kMaxJoints) +
                     " joints, found " + std::to_string(joints));
  if (plan.keyframes.size() < 2 || plan.keyframes.size() > kMaxKeyframes)
    throw InputError("plan: keyframes: expected 2 to " + std::to_string(kMaxKeyframes) +
                     ", found " + std::to_string(plan.keyframes.size()));
  std::vector<ImageKeyframe> keyframes;
  keyframes.reserve(plan.keyframes.size());
  for (std::size_t k = 0; k < plan.keyframes.size(); ++k) keyframes.push_back(to_image(plan, k));
  PlanImageHeader header;
  header.joint_count = static_cast<std::uint32_t>(joints);
  header.robot_hash = hash_field(plan.robot_hash, "robot_hash");
  header.scenario_hash = hash_field(plan.scenario_hash, "scenario_hash");
  header.certificate = hash_field(certificate_sha256, "the certificate's digest");
  header.friction = plan.friction;
  std::vector<std::byte> image(plan_image_size(keyframes.size()));
  if (!write_plan_image(header, keyframes, image)) throw InputError("plan: no keyframes");
  return image;
}

void save_plan_image(std::span<const std::byte> image, const std::filesystem::path& file) {
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(image.data()),
            static_cast<std::streamsize>(image.size()));
  out.close();
  if (!out) throw InputError(file.string() + ": cannot write the plan image");
}

std::vector<std::byte> read_plan_image(const std::filesystem::path& file) {
  const std::string bytes = read_file(file, kPlanBytes);
  std::vector<std::byte> image(bytes.size());
  std::transform(bytes.begin(), bytes.end(), image.begin(),
                 [](char c) { return static_cast<std::byte>(c); });
  return image;
}

}  // namespace clamber
