// A readable plan as the binary image the controller loads (control/plan_image.hpp).
// Start-up only: allocates, reads and writes files, throws InputError.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "control/plan_image.hpp"
#include "planner_offline/plan.hpp"

namespace clamber {

/// @throws InputError when the plan does not fit an image: keyframe or joint count, hash length,
///   a vector whose size is not the joint count.
/// `certificate_sha256`: of the certificate that was verified for this plan; empty: none, and the
/// controller refuses the image.
[[nodiscard]] std::vector<std::byte> plan_to_image(const Plan& plan,
                                                   const std::string& certificate_sha256 = {});

void save_plan_image(std::span<const std::byte> image, const std::filesystem::path& file);
/// Reads the bytes; open_plan_image() judges them. @throws InputError
[[nodiscard]] std::vector<std::byte> read_plan_image(const std::filesystem::path& file);

}  // namespace clamber
