#include "web/server.hpp"

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <random>
#include <thread>

#include "robot_model/loader.hpp"
#include "web/page.hpp"
#include "web/view_rows.hpp"

// After Eigen, whose names a macro of the C library's resolver, included here, would break.
#include <httplib.h>

namespace clamber {
namespace {

using namespace std::chrono_literals;

constexpr const char* kAddress = "127.0.0.1";
// A browser that watches holds a thread.
constexpr int kMostWatching = 16;
constexpr int kThreads = kMostWatching + 8;
constexpr std::size_t kRowsPerEvent = 250;
constexpr auto kSilence = 500ms;  // after which something is sent, to see whether anybody is there

/// Told apart by the page, which starts anew when the server did.
std::string new_session() { return std::to_string(std::random_device()()); }

std::string event(const std::string& name, const std::string& data) {
  return "event: " + name + "\ndata: " + data + "\n\n";
}

/// One connection to /live.
class Watcher {
 public:
  /// @param last the id of the last event that a browser which comes back has; else ""
  Watcher(const LiveSource& live, const std::string& session, const std::string& last,
          std::atomic<int>& watching)
      : live_(live), session_(session), watching_(watching) {
    if (!last.starts_with(session + '.')) return;
    const char* position = last.c_str() + session.size() + 1;
    position_ = std::strtoull(position, nullptr, 10);
  }
  ~Watcher() { --watching_; }
  Watcher(const Watcher&) = delete;
  Watcher& operator=(const Watcher&) = delete;

  /// Sends what there is, or after a while that there is nothing. False ends the connection.
  bool send(httplib::DataSink& sink) {
    if (!introduced_) {
      introduced_ = true;
      // Browsers come back a second after a break.
      return write(sink, "retry: 1000\n\n" + event("scene", "{\"session\":\"" + session_ +
                                                                "\",\"layout\":" + live_.layout +
                                                                ",\"scene\":" + live_.scene + "}"));
    }
    const std::string story = live_.story->news(told_);
    if (!story.empty() && !write(sink, event("story", story))) return false;
    const std::vector<float> rows = live_.feed->read(position_, kRowsPerEvent, kSilence);
    if (live_.feed->stopped()) return false;
    if (!rows.empty())
      return write(sink, "id: " + session_ + '.' + std::to_string(position_) + '\n' +
                             event("rows", base64_of(rows)));
    return write(sink, event("note", live_.note()));
  }

 private:
  static bool write(httplib::DataSink& sink, const std::string& text) {
    return sink.write(text.data(), text.size());
  }

  const LiveSource& live_;
  const std::string& session_;
  std::atomic<int>& watching_;
  std::uint64_t position_ = 0;
  std::uint64_t told_ = 0;  ///< version of the story
  bool introduced_ = false;
};

}  // namespace

class WebServer::Impl {
 public:
  Impl(int port, LiveSource live, std::filesystem::path recording)
      : live_(std::move(live)), recording_(std::move(recording)), session_(new_session()) {
    server_.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };
    server_.set_keep_alive_max_count(100);
    server_.set_read_timeout(5s);
    server_.set_write_timeout(5s);  // a browser that takes nothing for so long is let go
    server_.set_payload_max_length(0);
    // Not SO_REUSEPORT, which the library would set: two servers would share the port.
    server_.set_socket_options([](socket_t socket) {
      const int on = 1;
      setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    });
    server_.set_pre_routing_handler(
        [this](const httplib::Request& request, httplib::Response& response) {
          return refuse_strangers(request, response);
        });
    server_.Get("/", [](const httplib::Request&, httplib::Response& response) {
      const std::string_view page = web_page();
      // Piece by piece, because the library would compress a whole, which takes longer than to
      // send it over loopback.
      response.set_content_provider(
          page.size(), "text/html; charset=utf-8",
          [page](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
            return sink.write(page.data() + offset, length);
          });
    });
    server_.Get("/live", [this](const httplib::Request& request, httplib::Response& response) {
      watch(request.get_header_value("Last-Event-ID"), response);
    });
    server_.Get("/recording.mcap", [this](const httplib::Request&, httplib::Response& response) {
      send_recording(response);
    });
    port_ = port == 0 ? server_.bind_to_any_port(kAddress)
                      : (server_.bind_to_port(kAddress, port) ? port : -1);
    if (port_ < 0)
      throw InputError("--port " + std::to_string(port) +
                       ": cannot be listened to: in use by another program? (0: any free port)");
  }

  void serve() {
    serving_ = true;
    if (!stopping_) server_.listen_after_bind();
    serving_ = false;
  }
  void stop() {
    if (live_.feed != nullptr) live_.feed->stop();
    stopping_ = true;
    // The library forgets to stop when it is told before it listens, and must not be told twice.
    while (serving_ && !server_.is_running()) std::this_thread::sleep_for(1ms);
    if (serving_) server_.stop();
  }
  [[nodiscard]] int port() const { return port_; }

 private:
  using Routed = httplib::Server::HandlerResponse;

  Routed refuse_strangers(const httplib::Request& request, httplib::Response& response) const {
    response.set_header("Cache-Control", "no-store");
    response.set_header("X-Content-Type-Options", "nosniff");
    response.set_header("Cross-Origin-Resource-Policy", "same-origin");
    const std::string host = request.get_header_value("Host");
    const std::string port = ":" + std::to_string(port_);
    const bool known = host == kAddress + port || host == "localhost" + port;
    if (known && (request.method == "GET" || request.method == "HEAD")) return Routed::Unhandled;
    response.status = known ? 405 : 403;
    response.set_content(known ? "only GET\n" : "no such host here\n", "text/plain");
    return Routed::Handled;
  }

  void watch(const std::string& last, httplib::Response& response) {
    if (live_.feed == nullptr) {
      response.status = 404;
      return;
    }
    if (++watching_ > kMostWatching) {
      --watching_;
      response.status = 503;
      response.set_content("too many browsers watch already\n", "text/plain");
      return;
    }
    auto watcher = std::make_shared<Watcher>(live_, session_, last, watching_);
    response.set_chunked_content_provider(
        "text/event-stream",
        [watcher](std::size_t, httplib::DataSink& sink) { return watcher->send(sink); });
  }

  void send_recording(httplib::Response& response) const {
    auto file = std::make_shared<std::ifstream>(recording_, std::ios::binary);
    std::error_code error;
    const auto size = std::filesystem::file_size(recording_, error);
    if (recording_.empty() || !*file || error) {
      response.status = 404;
      return;
    }
    response.set_content_provider(
        size, "application/octet-stream",
        [file](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
          std::vector<char> part(std::min<std::size_t>(length, 1 << 20));
          file->seekg(static_cast<std::streamoff>(offset));
          if (!file->read(part.data(), static_cast<std::streamsize>(part.size()))) return false;
          return sink.write(part.data(), part.size());
        });
  }

  LiveSource live_;
  std::filesystem::path recording_;
  std::string session_;
  std::atomic<int> watching_{0};
  std::atomic<bool> serving_{false};
  std::atomic<bool> stopping_{false};
  httplib::Server server_;
  int port_ = -1;
};

WebServer::WebServer(int port, LiveSource live, std::filesystem::path recording)
    : impl_(std::make_unique<Impl>(port, std::move(live), std::move(recording))) {}
WebServer::~WebServer() = default;
int WebServer::port() const { return impl_->port(); }
void WebServer::serve() { impl_->serve(); }
void WebServer::stop() { impl_->stop(); }

}  // namespace clamber
