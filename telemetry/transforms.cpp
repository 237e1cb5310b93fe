#include "telemetry/transforms.hpp"

#include <Eigen/Geometry>

#include "telemetry/wire.hpp"

namespace clamber {
namespace {

using geometry_msgs::msg::dds_::TransformStamped_;

Eigen::Quaterniond quaternion(const std::array<double, 4>& wxyz) {
  return {wxyz[0], wxyz[1], wxyz[2], wxyz[3]};
}

TransformStamped_ transform(const std::string& parent, const std::string& child,
                            std::int64_t nanoseconds, const std::array<double, 3>& position,
                            const Eigen::Quaterniond& orientation) {
  TransformStamped_ wire;
  wire.header().stamp(to_stamp(nanoseconds));
  wire.header().frame_id(parent);
  wire.child_frame_id(child);
  wire.transform().translation().x(position[0]);
  wire.transform().translation().y(position[1]);
  wire.transform().translation().z(position[2]);
  wire.transform().rotation().x(orientation.x());
  wire.transform().rotation().y(orientation.y());
  wire.transform().rotation().z(orientation.z());
  wire.transform().rotation().w(orientation.w());
  return wire;
}

}  // namespace

Transforms::Transforms(const TelemetryDescription& description) : base_(description.base) {
  for (const DescribedLink& link : description.links)
    (link.joint >= 0 ? turning_ : fixed_).push_back(link);
}

const tf2_msgs::msg::dds_::TFMessage_& Transforms::moving(const TelemetryFrame& frame,
                                                          std::int64_t nanoseconds) {
  message_.transforms().clear();
  if ((frame.flags & kFrameHasTruth) != 0)
    message_.transforms().push_back(transform("world", base_, nanoseconds, frame.base_position,
                                              quaternion(frame.base_orientation)));
  for (const DescribedLink& link : turning_) {
    const Eigen::Vector3d axis(link.axis[0], link.axis[1], link.axis[2]);
    const double angle = frame.q[static_cast<std::size_t>(link.joint)];
    const Eigen::Quaterniond turned =
        quaternion(link.orientation) * Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis));
    message_.transforms().push_back(
        transform(link.parent, link.name, nanoseconds, link.position, turned));
  }
  return message_;
}

tf2_msgs::msg::dds_::TFMessage_ Transforms::fixed(std::int64_t nanoseconds) const {
  tf2_msgs::msg::dds_::TFMessage_ message;
  for (const DescribedLink& link : fixed_)
    message.transforms().push_back(transform(link.parent, link.name, nanoseconds, link.position,
                                             quaternion(link.orientation)));
  return message;
}

}  // namespace clamber
