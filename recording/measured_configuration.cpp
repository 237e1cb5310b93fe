#include "recording/measured_configuration.hpp"

#include <algorithm>

namespace clamber {

Configuration measured_configuration(const TelemetryFrame& frame) {
  Configuration x;
  const auto n = static_cast<Eigen::Index>(std::min<std::size_t>(frame.joint_count, kMaxJoints));
  x.q = Eigen::Map<const Eigen::VectorXd>(frame.q.data(), n);
  if ((frame.flags & kFrameHasTruth) != 0) {
    const auto& o = frame.base_orientation;
    const Eigen::Quaterniond rotation(o[0], o[1], o[2], o[3]);
    x.X_WB.R = rotation.norm() > 1e-6 ? rotation.normalized().toRotationMatrix()
                                      : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
    x.X_WB.p = Eigen::Map<const Eigen::Vector3d>(frame.base_position.data());
  }
  return x;
}

}  // namespace clamber
