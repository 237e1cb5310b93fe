#include "firmware_hal/socketcan/error_frame.hpp"

#include <linux/can/error.h>

namespace clamber {

ErrorReport read_error_frame(std::uint32_t classes,
                             const std::array<std::uint8_t, 8>& data) noexcept {
  ErrorReport report;
  report.not_acknowledged = (classes & CAN_ERR_ACK) != 0;
  if ((classes & CAN_ERR_CRTL) != 0) {
    const std::uint8_t controller = data[1];
    report.overflow = (controller & CAN_ERR_CRTL_RX_OVERFLOW) != 0;
    // A controller that is passive in one direction may be at warning in the other: the worse
    // counts.
    if ((controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0)
      report.state = PortState::kPassive;
    else if ((controller & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0)
      report.state = PortState::kWarning;
    else if ((controller & CAN_ERR_CRTL_ACTIVE) != 0)
      report.state = PortState::kActive;
  }
  if ((classes & CAN_ERR_RESTARTED) != 0) {
    report.restarted = true;
    if (!report.state) report.state = PortState::kActive;
  }
  if ((classes & CAN_ERR_BUSOFF) != 0) {
    report.state = PortState::kBusOff;
    report.restarted = false;
  }
  return report;
}

}  // namespace clamber
