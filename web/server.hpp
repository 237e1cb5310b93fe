// Serves the page and what it shows to browsers on this machine. Nothing can be commanded or
// written through it. Construct, serve() and stop() as said below; allocates; blocks; throws
// InputError.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "web/live_feed.hpp"
#include "web/story.hpp"

namespace clamber {

/// What the page gets at /live: server-sent events "scene" (once a connection), "rows" (base64 of
/// 32-bit floats, little-endian), "story" (whenever it changes) and "note".
struct LiveSource {
  std::string scene;   ///< JSON of scene_json()
  std::string layout;  ///< JSON of ViewRows::layout()
  LiveFeed* feed = nullptr;
  const LiveStory* story = nullptr;   ///< set where the feed is
  std::function<std::string()> note;  ///< what is wrong with the data, or ""
};

class WebServer {
 public:
  /// Listens on 127.0.0.1 and nowhere else. Requests that name another host are refused, so that no
  /// page from elsewhere reads the robot's data by a name of its own for this address.
  /// @param port 0: any that is free
  /// @param recording served as /recording.mcap; empty: none. @throws InputError for a port in use
  WebServer(int port, LiveSource live, std::filesystem::path recording);
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  [[nodiscard]] int port() const;
  /// Returns after stop().
  void serve();
  /// From another thread, once.
  void stop();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clamber
