#include "apps/child_process.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstring>

#include "apps/job_failed.hpp"
#include "apps/operator_socket.hpp"

namespace clamber {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kKept = 64 * 1024;

class FileActions {
 public:
  FileActions() { posix_spawn_file_actions_init(&actions_); }
  ~FileActions() { posix_spawn_file_actions_destroy(&actions_); }
  FileActions(const FileActions&) = delete;
  FileActions& operator=(const FileActions&) = delete;
  posix_spawn_file_actions_t* get() { return &actions_; }

 private:
  posix_spawn_file_actions_t actions_{};
};

pid_t start(const std::vector<std::string>& command, const ChildOptions& options, int output) {
  FileActions files;
  const char* input = options.input.empty() ? "/dev/null" : options.input.c_str();
  posix_spawn_file_actions_addopen(files.get(), STDIN_FILENO, input, O_RDONLY, 0);
  if (options.capture)
    for (const int stream : {STDOUT_FILENO, STDERR_FILENO})
      posix_spawn_file_actions_adddup2(files.get(), output, stream);
  std::vector<char*> arguments;
  arguments.reserve(command.size() + 1);
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  pid_t child = 0;
  if (const int error =
          posix_spawnp(&child, arguments[0], files.get(), nullptr, arguments.data(), environ))
    throw JobFailed(command[0] + ": cannot be run: " + std::strerror(error));
  return child;
}

/// Takes what is there now; false: nothing more will come.
bool take(int fd, std::string& output) {
  std::array<char, 4096> block{};
  const ssize_t got = read(fd, block.data(), block.size());
  if (got <= 0) return false;
  output.append(block.data(), static_cast<std::size_t>(got));
  if (output.size() > 2 * kKept) output.erase(0, output.size() - kKept);
  return true;
}

int code_of(int status) { return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status); }

}  // namespace

std::string ChildResult::last_words() const {
  const std::size_t end = output.find_last_not_of(" \n");
  if (end == std::string::npos) return "ended with status " + std::to_string(status) + ", silently";
  const std::size_t start = output.find_last_of('\n', end);
  std::string line = output.substr(start == std::string::npos ? 0 : start + 1, end);
  line.resize(line.find_last_not_of(" \n") + 1);
  constexpr const char* kOurs = "clamber: error: ";
  return line.starts_with(kOurs) ? line.substr(std::strlen(kOurs)) : line;
}

ChildResult run_child(const std::vector<std::string>& command, const ChildOptions& options) {
  std::array<int, 2> ends{-1, -1};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) throw JobFailed("no pipe to be had");
  const Descriptor from(ends[0]);
  Descriptor to(ends[1]);
  const pid_t child = start(command, options, to.get());
  to = Descriptor();
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                      std::chrono::duration<double>(options.patience));
  ChildResult result;
  bool open = options.capture;
  for (int status = 0;;) {
    pollfd polled{open ? from.get() : -1, POLLIN, 0};
    if (poll(&polled, 1, 50) > 0) open = take(from.get(), result.output);
    if (waitpid(child, &status, WNOHANG) == child) {
      while (open && poll(&polled, 1, 0) > 0) open = take(from.get(), result.output);
      result.status = code_of(status);
      return result;
    }
    const bool late = options.patience > 0.0 && Clock::now() > end;
    if (!late && !(options.interrupted && options.interrupted())) continue;
    kill(child, SIGKILL);
    waitpid(child, &status, 0);
    throw JobFailed(command[0] + (late ? ": did not end in time" : ": interrupted"));
  }
}

}  // namespace clamber
