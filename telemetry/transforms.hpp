// rt/tf and rt/tf_static from base pose and joint angles. Inside this room only.
// One thread; allocates; blocks: never.
#pragma once

#include <cstdint>
#include <vector>

#include "ros2_messages.h"
#include "telemetry/frame.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

/// Every joint is one transform from parent to child link, so no chain is ever multiplied out.
class Transforms {
 public:
  explicit Transforms(const TelemetryDescription& description);

  /// Nothing to say: no links are described.
  [[nodiscard]] bool empty() const noexcept { return base_.empty(); }
  /// Of the links that joints turn, and of the base in `world` where the frame knows it.
  /// @param nanoseconds stamp, since 1970
  [[nodiscard]] const tf2_msgs::msg::dds_::TFMessage_& moving(const TelemetryFrame& frame,
                                                              std::int64_t nanoseconds);
  /// Of the links that are fixed to another.
  [[nodiscard]] tf2_msgs::msg::dds_::TFMessage_ fixed(std::int64_t nanoseconds) const;

 private:
  std::string base_;
  std::vector<DescribedLink> turning_, fixed_;
  tf2_msgs::msg::dds_::TFMessage_ message_;
};

}  // namespace clamber
