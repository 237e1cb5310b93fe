#include "web/story.hpp"

#include <nlohmann/json.hpp>

namespace clamber {

std::string story_json(const TelemetryDescription& names,
                       const std::deque<TelemetryEvent>& events) {
  using Json = nlohmann::ordered_json;
  Json json = {{"phases", Json::array()},
               {"modes", names.modes},
               {"faults", names.faults},
               {"events", Json::array()}};
  for (const DescribedPhase& phase : names.phases) json["phases"].push_back(phase.name);
  for (const TelemetryEvent& event : events)
    json["events"].push_back({{"time", event.time},
                              {"kind", static_cast<std::uint32_t>(event.kind)},
                              {"severity", static_cast<std::uint32_t>(event.severity)},
                              {"joint", event.joint},
                              {"text", event.view()}});
  // Names come over the network, and need not be UTF-8.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace clamber
