// Makes the certificate of a plan: finds contact forces for every sample and measures everything.
// Start-up and tools only: allocates; one certify() per thread; deterministic.
#pragma once

#include "certificate/certificate.hpp"

namespace clamber {

/// The forces are the plan's own as far as they can be told: at every keyframe those whose joint
/// torques are nearest to the plan's feed-forward, inside the certified friction pyramids; between
/// keyframes their straight mix, corrected so that weight is balanced exactly. Whether the plan is
/// good is not asked here; verify() judges. Where no forces balance a keyframe, the residual says
/// so.
[[nodiscard]] Certificate certify(const PlannedMotion& motion, const RobotModel& model,
                                  const Scenario& scenario, const Acceptance& acceptance);

}  // namespace clamber
