#include "apps/operator_server.hpp"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <nlohmann/json.hpp>
#include <string_view>
#include <thread>

#include "apps/operator_socket.hpp"

namespace clamber {
namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

constexpr auto kLinePatience = std::chrono::seconds(2);
// To arm may mean to switch on drives one after another.
constexpr auto kAnswerPatience = std::chrono::seconds(15);

struct Client {
  Descriptor fd;
  pid_t peer = 0;
  Clock::time_point end;
  std::array<char, kOperatorLine> line{};
  std::size_t used = 0;
  std::uint64_t request = 0;  ///< that the control thread has yet to answer; 0: none
};

pid_t peer_of(int fd) {
  ucred credentials{};
  socklen_t size = sizeof credentials;
  getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &credentials, &size);
  return credentials.pid;
}

OperatorCommand command_named(std::string_view word) {
  for (std::uint8_t i = 1; i < kOperatorCommandCount; ++i)
    if (word == to_string(static_cast<OperatorCommand>(i))) return static_cast<OperatorCommand>(i);
  return OperatorCommand::kNone;
}

}  // namespace

class OperatorServer::Impl {
 public:
  Impl(const OperatorSettings& settings, OperatorDesk& desk, std::vector<std::string> joints)
      : path_(settings.socket),
        desk_(desk),
        joints_(std::move(joints)),
        listener_(listen_for_operator(settings)),
        wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
        thread_([this] { serve(); }) {}

  ~Impl() {
    stop_ = true;
    const std::uint64_t one = 1;
    (void)!write(wake_.get(), &one, sizeof one);
    thread_.join();
    remove_operator_socket(path_, listener_);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  [[nodiscard]] OperatorCounters counters() const noexcept {
    return {.clients = accepted_, .commands = commands_, .bad = bad_, .dropped = dropped_};
  }

 private:
  void serve() {
    std::vector<pollfd> polled;
    while (!stop_) {
      polled.assign({{wake_.get(), POLLIN, 0}, {listener_.get(), POLLIN, 0}});
      for (const Client& client : clients_)
        polled.push_back({client.request == 0 ? client.fd.get() : -1, POLLIN, 0});
      poll(polled.data(), polled.size(), patience());
      for (std::size_t i = 2; i < polled.size(); ++i)
        if (polled[i].revents != 0) hear(clients_[i - 2]);
      pass_answers_on();
      forget_the_slow();
      if (polled[1].revents != 0) accept_all();
    }
  }

  /// ms until something is due. The control thread wakes nobody: its answers are looked for.
  [[nodiscard]] int patience() const {
    std::int64_t left = 60'000;
    const auto now = Clock::now();
    for (const Client& client : clients_) {
      if (client.request != 0) return 1;
      left = std::min(
          left,
          std::chrono::duration_cast<std::chrono::milliseconds>(client.end - now).count() + 1);
    }
    return static_cast<int>(std::max<std::int64_t>(left, 0));
  }

  void forget_the_slow() {
    const auto now = Clock::now();
    for (Client& client : clients_) {
      if (client.fd.get() < 0 || now <= client.end) continue;
      if (client.request != 0)
        say(client, "refused no answer from the control thread yet; the command waits for it");
      else
        drop(client);
    }
    std::erase_if(clients_, [](const Client& client) { return client.fd.get() < 0; });
  }

  void accept_all() {
    for (int served = 0; served < 64; ++served) {  // then the others have their turn
      Descriptor fd(accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
      if (fd.get() < 0) {
        // Out of descriptors the queue stays readable: better late than a busy loop.
        if (errno != EAGAIN && errno != EINTR && errno != ECONNABORTED)
          std::this_thread::sleep_for(std::chrono::milliseconds(10));
        return;
      }
      ++accepted_;
      if (clients_.size() == kOperatorClients) make_room();
      Client client;
      client.peer = peer_of(fd.get());
      client.fd = std::move(fd);
      client.end = Clock::now() + kLinePatience;
      hear(client);  // the line is often there already
      if (client.fd.get() >= 0) clients_.push_back(std::move(client));
    }
  }

  void make_room() {
    const auto places = [&](const Client& of) {
      return std::count_if(clients_.begin(), clients_.end(),
                           [&](const Client& other) { return other.peer == of.peer; });
    };
    // The first of equals is the oldest.
    const auto most =
        std::max_element(clients_.begin(), clients_.end(),
                         [&](const Client& a, const Client& b) { return places(a) < places(b); });
    drop(*most);
    clients_.erase(most);
  }

  void drop(Client& client) {
    client.fd = Descriptor();
    ++dropped_;
  }

  /// The client's last word from us.
  void say(Client& client, std::string answer) {
    answer += '\n';
    if (send(client.fd.get(), answer.data(), answer.size(), MSG_NOSIGNAL | MSG_DONTWAIT) !=
        static_cast<ssize_t>(answer.size()))
      ++dropped_;
    client.fd = Descriptor();
  }

  /// Reads what has come and answers a line.
  void hear(Client& client) {
    const ssize_t got = recv(client.fd.get(), client.line.data() + client.used,
                             client.line.size() - client.used, 0);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (got <= 0) return drop(client);
    client.used += static_cast<std::size_t>(got);
    const std::string_view text(client.line.data(), client.used);
    const std::size_t end = text.find('\n');
    if (end != std::string_view::npos) return obey(client, text.substr(0, end));
    if (client.used < client.line.size()) return;
    ++bad_;
    // What is left unread would take the answer away from the client.
    std::array<char, 4096> rest{};
    for (int j = 0; j < 16 && recv(client.fd.get(), rest.data(), rest.size(), 0) > 0; ++j) {
    }
    say(client,
        "bad a line of at most " + std::to_string(kOperatorLine - 1) + " characters expected");
  }

  void obey(Client& client, std::string_view line) {
    if (line == "status") return say(client, "status " + status());
    const OperatorCommand command = command_named(line);
    if (command == OperatorCommand::kNone) {
      ++bad_;
      return say(client, "bad unknown command");  // what came may be anything: not repeated
    }
    ++commands_;
    if (!desk_.requests.put({.id = last_id_ + 1, .command = command}))
      return say(client, "refused too many commands wait for the control thread");
    client.request = ++last_id_;
    client.end = Clock::now() + kAnswerPatience;
  }

  void pass_answers_on() {
    OperatorAnswer answer;
    while (desk_.answers.take(answer))
      for (Client& client : clients_)
        if (client.request == answer.id && client.fd.get() >= 0)
          say(client,
              answer.done ? "done" : std::string("refused ") + answer.reason + answer.detail);
  }

  [[nodiscard]] std::string status() const {
    const OperatorStatus s = desk_.status.read();
    const auto name = [&](std::uint32_t joint) {
      return joint < joints_.size() ? joints_[joint] : std::string();
    };
    const bool faulted = std::string_view(s.fault) != "none";
    const Json json{{"state", s.state},
                    {"fault", s.fault},
                    {"fault_joint", faulted ? name(s.fault_joint) : ""},
                    {"plan_time", s.plan_time},
                    {"time", s.time},
                    {"ticks", s.ticks},
                    {"worst_tracking_error", s.worst_error},
                    {"worst_joint", s.worst_error > 0.0 ? name(s.worst_joint) : ""},
                    {"overruns", s.overruns},
                    {"skipped_ticks", s.skipped},
                    {"worst_wakeup", s.worst_wakeup},
                    {"missing_replies", s.missing_replies}};
    return json.dump();
  }

  std::string path_;
  OperatorDesk& desk_;
  std::vector<std::string> joints_;
  Descriptor listener_;
  Descriptor wake_;
  std::vector<Client> clients_;
  std::uint64_t last_id_ = 0;
  std::atomic<std::uint64_t> accepted_{0}, commands_{0}, bad_{0}, dropped_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;  // last: it uses all of the above
};

OperatorServer::OperatorServer(const OperatorSettings& settings, OperatorDesk& desk,
                               std::vector<std::string> joints)
    : impl_(std::make_unique<Impl>(settings, desk, std::move(joints))) {}
OperatorServer::~OperatorServer() = default;
OperatorCounters OperatorServer::counters() const noexcept { return impl_->counters(); }

}  // namespace clamber
