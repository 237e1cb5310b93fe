// Serves the operator's UNIX socket: one line in, one line out, for as long as it lives.
// Construct and destroy on the main thread; serves from a thread of its own at ordinary priority,
// which touches the control thread through the desk only. Allocates, blocks, throws InputError.
//
// A client has two seconds for its line, kOperatorLine bytes at most. When all places are taken,
// the client who holds most of them loses his oldest: a flood cannot shut the operator out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "apps/operator_desk.hpp"
#include "apps/realtime/runtime_settings.hpp"

namespace clamber {

inline constexpr std::size_t kOperatorLine = 64;     ///< bytes, with its end
inline constexpr std::size_t kOperatorClients = 16;  ///< at the same time

struct OperatorCounters {
  std::uint64_t clients = 0;   ///< accepted
  std::uint64_t commands = 0;  ///< passed on to the controller
  std::uint64_t bad = 0;       ///< lines that are no command
  std::uint64_t dropped = 0;   ///< clients too slow, too talkative, gone, or in the way of others
};

class OperatorServer {
 public:
  /// @param joints names in the model's order, for the status
  /// @throws InputError: the path is too long, in no folder, not a socket, a link, or another
  ///   controller serves it; the group is not known or not the user's. The socket that a dead
  ///   process left is replaced
  OperatorServer(const OperatorSettings& settings, OperatorDesk& desk,
                 std::vector<std::string> joints);
  ~OperatorServer();  ///< answers nobody any more; the socket is gone
  OperatorServer(const OperatorServer&) = delete;
  OperatorServer& operator=(const OperatorServer&) = delete;

  /// Any thread.
  [[nodiscard]] OperatorCounters counters() const noexcept;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clamber
