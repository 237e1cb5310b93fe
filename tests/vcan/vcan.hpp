// For tests that need CAN interfaces: they run under tests/vcan/vcan_run only, which sets
// CLAMBER_VCAN=required, fail there if an interface is missing, and are counted. Anywhere else they
// are skipped: what is called can0 there may be a robot.
#pragma once

#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>

namespace clamber::test {

/// can0, can1, ... as vcan_run and the shipped bus maps name them.
inline std::string vcan(int number) { return "can" + std::to_string(number); }

/// Binds an AF_CAN socket to the interface. @return what is wrong; empty: nothing
inline std::string why_no_vcan(const std::string& interface) {
  const int socket = ::socket(PF_CAN, SOCK_RAW, CAN_RAW);
  if (socket < 0) return std::string("no CAN sockets: ") + std::strerror(errno);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(interface.c_str()));
  const bool bound = address.can_ifindex != 0 &&
                     bind(socket, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  close(socket);
  return bound ? "" : "no interface " + interface;
}

inline bool vcan_required() {
  const char* variable = std::getenv("CLAMBER_VCAN");
  return variable != nullptr && std::string(variable) == "required";
}

/// One line per test in the file $CLAMBER_VCAN_LEDGER.
inline void note_in_ledger() {
  const char* file = std::getenv("CLAMBER_VCAN_LEDGER");
  const auto* info = testing::UnitTest::GetInstance()->current_test_info();
  if (file != nullptr)
    std::ofstream(file, std::ios::app) << info->test_suite_name() << '.' << info->name() << '\n';
}

}  // namespace clamber::test

/// First statement of a test.
#define CLAMBER_NEEDS_VCAN(interface)                                                \
  do {                                                                               \
    if (!::clamber::test::vcan_required())                                           \
      GTEST_SKIP() << "skipped: runs on the interfaces of tests/vcan/vcan_run only"; \
    const std::string why = ::clamber::test::why_no_vcan(interface);                 \
    if (!why.empty()) FAIL() << why;                                                 \
    ::clamber::test::note_in_ledger();                                               \
  } while (false)
