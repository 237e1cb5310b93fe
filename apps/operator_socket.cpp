#include "apps/operator_socket.hpp"

#include <grp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "apps/job_failed.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kBacklog = 64;

std::string because(int error) { return std::string(": ") + std::strerror(error); }

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw InputError("operator socket " + path + ": " + what);
}

sockaddr_un address_of(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path)
    fail(path,
         "a path of 1 to " + std::to_string(sizeof address.sun_path - 1) + " characters expected");
  std::memcpy(&address.sun_path[0], path.c_str(), path.size() + 1);
  return address;
}

/// 0 or the error.
int connect_to(int fd, const std::string& path) {
  const sockaddr_un address = address_of(path);
  return connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 ? 0 : errno;
}

Descriptor make_socket() {
  Descriptor fd(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (fd.get() < 0) throw InputError("operator: no UNIX socket" + because(errno));
  return fd;
}

/// What lies at the path may be replaced only if it is a socket that nobody serves.
void require_free(const std::string& path) {
  struct stat found {};
  if (lstat(path.c_str(), &found) != 0) {
    if (errno == ENOENT) return;
    fail(path, std::string("cannot be looked at") + because(errno));
  }
  if (S_ISLNK(found.st_mode)) fail(path, "is a symbolic link; remove it or name another path");
  if (!S_ISSOCK(found.st_mode)) fail(path, "exists and is no socket; name another path");
  const Descriptor probe = make_socket();
  const int error = connect_to(probe.get(), path);
  if (error == ECONNREFUSED) return;  // its process is dead
  fail(path, error == 0 || error == EAGAIN ? "another controller serves it"
                                           : "cannot be connected to" + because(error));
}

gid_t group_of(const OperatorSettings& settings) {
  if (settings.group.empty()) return getegid();
  std::array<char, 4096> text{};
  group entry{};
  group* found = nullptr;
  getgrnam_r(settings.group.c_str(), &entry, text.data(), text.size(), &found);
  if (found == nullptr) fail(settings.socket, "there is no group '" + settings.group + "'");
  return found->gr_gid;
}

}  // namespace

Descriptor::~Descriptor() {
  if (fd_ >= 0) close(fd_);
}

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
  if (this != &other) {
    if (fd_ >= 0) close(fd_);
    fd_ = other.release();
  }
  return *this;
}

Descriptor listen_for_operator(const OperatorSettings& settings) {
  const std::string& path = settings.socket;
  // A name of its own first: at its path the socket has had its permissions from the beginning.
  const std::string hidden = path + '.' + std::to_string(getpid());
  const sockaddr_un address = address_of(hidden);
  const std::string folder = std::filesystem::path(path).parent_path().string();
  std::error_code error;
  if (!folder.empty() && !std::filesystem::is_directory(folder, error))
    fail(path, "there is no folder " + folder + "; make it, writable for this user only");
  require_free(path);
  const gid_t group = group_of(settings);
  Descriptor listener = make_socket();
  unlink(hidden.c_str());
  if (bind(listener.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    fail(path, std::string("cannot be made") + because(errno));
  int failed = 0;
  const char* step = "";
  if (chmod(hidden.c_str(), 0600) != 0) failed = errno, step = "chmod";
  if (failed == 0 && !settings.group.empty() &&
      chown(hidden.c_str(), static_cast<uid_t>(-1), group) != 0)
    failed = errno, step = "cannot be given to its group";
  if (failed == 0 && chmod(hidden.c_str(), settings.mode) != 0) failed = errno, step = "chmod";
  if (failed == 0 && listen(listener.get(), kBacklog) != 0) failed = errno, step = "listen";
  if (failed == 0 && std::rename(hidden.c_str(), path.c_str()) != 0)
    failed = errno, step = "cannot be moved to its path";
  if (failed == 0) return listener;
  unlink(hidden.c_str());
  fail(path, step + because(failed));
}

void remove_operator_socket(const std::string& path, const Descriptor& listener) noexcept {
  // The file's inode is not the descriptor's: whether it is ours shows in that nobody answers once
  // we listen no more.
  shutdown(listener.get(), SHUT_RDWR);
  const Descriptor probe(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (probe.get() < 0 || path.size() >= sizeof address.sun_path) return;
  std::memcpy(&address.sun_path[0], path.c_str(), path.size() + 1);
  if (connect(probe.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 &&
      errno == ECONNREFUSED)
    unlink(path.c_str());
}

namespace {

/// Waits for the event; false: not before `end`.
bool wait_for(int fd, short event, Clock::time_point end) {
  pollfd polled{fd, event, 0};
  const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now());
  return left.count() > 0 && poll(&polled, 1, static_cast<int>(left.count())) > 0;
}

Descriptor connect_to_controller(const std::string& path, Clock::time_point end) {
  for (;;) {
    Descriptor fd = make_socket();
    const int error = connect_to(fd.get(), path);
    if (error == 0) return fd;
    // Its queue of clients is full: a moment later there is room.
    if (error == EAGAIN && Clock::now() < end) {
      usleep(2000);
      continue;
    }
    if (error == ENOENT || error == ECONNREFUSED)
      fail(path, "no controller (`clamber run ... --operator " + path + "` makes it)");
    if (error == EACCES) fail(path, "permission denied: it serves its owner and its group only");
    if (error == EAGAIN) throw JobFailed("operator socket " + path + ": no place to be had");
    fail(path, std::string("cannot be connected to") + because(error));
  }
}

/// The answer; empty: the server closed without having read the line, to serve others.
std::string try_to_ask(const std::string& path, const std::string& line, Clock::time_point end) {
  const Descriptor fd = connect_to_controller(path, end);
  const std::string text = line + '\n';
  if (send(fd.get(), text.data(), text.size(), MSG_NOSIGNAL) < 0) return {};
  std::string answer;
  std::array<char, 1024> block{};
  while (wait_for(fd.get(), POLLIN, end)) {
    const ssize_t got = recv(fd.get(), block.data(), block.size(), 0);
    if (got <= 0) return {};
    answer.append(block.data(), static_cast<std::size_t>(got));
    if (answer.back() != '\n') continue;
    answer.pop_back();
    return answer;
  }
  throw JobFailed("operator socket " + path +
                  ": no answer in time; whether the command was taken is not known");
}

}  // namespace

std::string ask_controller(const std::string& path, const std::string& line, double patience) {
  const auto end =
      Clock::now() + std::chrono::microseconds(static_cast<std::int64_t>(1e6 * patience));
  while (Clock::now() < end)
    if (const std::string answer = try_to_ask(path, line, end); !answer.empty()) return answer;
  throw JobFailed("operator socket " + path + ": the controller closes without an answer");
}

std::optional<std::string> ask_if_there(const std::string& path, const std::string& line,
                                        double patience) {
  const Descriptor probe = make_socket();
  const int error = connect_to(probe.get(), path);
  if (error == ENOENT || error == ECONNREFUSED) return std::nullopt;
  return ask_controller(path, line, patience);
}

}  // namespace clamber
