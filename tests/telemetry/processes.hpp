// Other processes and DDS domains for the tests of telemetry.
#pragma once

#include <fcntl.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

extern char** environ;

namespace clamber::test {

/// A DDS domain that no other test has while this process lives: an abstract socket of its name is
/// held until then. Its ports stay below Linux's ephemeral ones.
inline int next_domain() {
  static int domain = 0;
  while (++domain <= 96) {  // tests/deploy/story and tests/vcan/deploy have the next two
    const std::string name = "clamber-test-domain-" + std::to_string(domain);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    name.copy(address.sun_path + 1, name.size());
    const int held = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
    if (bind(held, reinterpret_cast<const sockaddr*>(&address), size) == 0) return domain;
    close(held);
  }
  throw std::runtime_error("no DDS domain is free for a test");
}

/// Another process with its standard output in a file.
class Child {
 public:
  explicit Child(std::vector<std::string> arguments)
      : output_(
            std::filesystem::temp_directory_path() /
            ("clamber_telemetry_" + std::to_string(getpid()) + "_" + std::to_string(++started_))) {
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output_.c_str(),
                                     O_WRONLY | O_CREAT | O_TRUNC, 0600);
    // Cyclone DDS and tshark have much to say there.
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    const int error = posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw std::runtime_error("cannot start " + arguments[0]);
  }
  ~Child() {
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      static_cast<void>(wait());
    }
    std::filesystem::remove(output_);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  [[nodiscard]] bool running() const {
    siginfo_t info{};
    waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT);
    return info.si_pid == 0;
  }
  void send(int signal) const { kill(pid_, signal); }
  /// Its exit code, or -1 when it did not exit by itself.
  int wait() {
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  [[nodiscard]] std::string output() const {
    std::ostringstream text;
    text << std::ifstream(output_).rdbuf();
    return text.str();
  }

 private:
  static inline int started_ = 0;
  std::filesystem::path output_;
  pid_t pid_ = -1;
};

/// Loopback without multicast, as Linux brings it up.
inline void configure_cyclone() {
  setenv("CYCLONEDDS_URI",
         "<CycloneDDS><Domain id=\"any\"><General><Interfaces><NetworkInterface name=\"lo\" "
         "multicast=\"false\"/></Interfaces><AllowMulticast>false</AllowMulticast></General>"
         "<Discovery><ParticipantIndex>auto</ParticipantIndex>"
         "<Peers><Peer address=\"127.0.0.1\"/></Peers></Discovery></Domain></CycloneDDS>",
         1);
}

}  // namespace clamber::test
