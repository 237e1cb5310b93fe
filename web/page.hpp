// The page of `clamber web`, built from page/ and part of the program.
// Any thread; allocates; blocks: never.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "telemetry/frame.hpp"

namespace clamber {

/// The whole page; empty where the program was built without it (CLAMBER_WEB=OFF).
[[nodiscard]] std::string_view web_page();

/// A run for web_page_with_run().
struct PageRun {
  std::string name;   ///< shown beside the title
  std::string scene;  ///< JSON of scene_json()
  std::string story;  ///< JSON of story_json()
  std::size_t joints = 0;
  std::size_t contacts = 0;
  std::function<bool(TelemetryFrame&)> next;  ///< false after the last frame
};
/// The page with a run in it: one file that fetches nothing. Empty where web_page() is.
[[nodiscard]] std::string web_page_with_run(const PageRun& run);

}  // namespace clamber
