// The file side of the operator's socket: made with its permissions, found, connected to.
// Start-up and client; allocates, blocks for a moment, throws InputError.
#pragma once

#include <optional>
#include <string>

#include "apps/realtime/runtime_settings.hpp"

namespace clamber {

/// A descriptor that is closed at the end of its scope.
class Descriptor {
 public:
  explicit Descriptor(int fd = -1) noexcept : fd_(fd) {}
  ~Descriptor();
  Descriptor(Descriptor&& other) noexcept : fd_(other.release()) {}
  Descriptor& operator=(Descriptor&& other) noexcept;
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  [[nodiscard]] int get() const noexcept { return fd_; }
  int release() noexcept {
    const int fd = fd_;
    fd_ = -1;
    return fd;
  }

 private:
  int fd_;
};

/// Listens at settings.socket, non-blocking; nobody without permission can connect at any time.
/// @throws InputError, see OperatorServer
[[nodiscard]] Descriptor listen_for_operator(const OperatorSettings& settings);
/// Removes the socket if it is still the one that `listener` serves.
void remove_operator_socket(const std::string& path, const Descriptor& listener) noexcept;

/// Says one line to the controller at `path` and waits `patience` seconds for its answer, without
/// the line's end.
/// @throws InputError when there is no controller, JobFailed when it does not answer
[[nodiscard]] std::string ask_controller(const std::string& path, const std::string& line,
                                         double patience);
/// The same; nullopt when no controller is there.
[[nodiscard]] std::optional<std::string> ask_if_there(const std::string& path,
                                                      const std::string& line, double patience);

}  // namespace clamber
