// What is thrown when the inputs are usable and no climb is possible with them.
// Start-up only: allocates.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

namespace clamber {

struct PlanningLog;  // planner.hpp

/// The message says which move and which constraint, or which contact the demonstration lacks.
/// Exit code 1, not 2.
class PlanningFailed : public std::runtime_error {
 public:
  explicit PlanningFailed(const std::string& what, std::shared_ptr<const PlanningLog> log = nullptr)
      : std::runtime_error(what), log_(std::move(log)) {}

  /// What was tried; nullptr when it failed before anything was.
  [[nodiscard]] const std::shared_ptr<const PlanningLog>& log() const noexcept { return log_; }

 private:
  std::shared_ptr<const PlanningLog> log_;
};

}  // namespace clamber
