#include "recording/run_reader.hpp"

#include "recording/messages.hpp"
#include "robot_model/loader.hpp"

namespace clamber {

RunReader::RunReader(const std::filesystem::path& file) : file_(file), reader_(file) {
  const std::string description = description_schema().name;
  for (McapMessage message; reader_.next(message);) {
    if (message.schema != description) continue;
    if (!decode_description(message.data, run_))
      throw InputError(file.string() + ": a description that cannot be read");
    const auto metadata = reader_.metadata().find("clamber");
    if (metadata != reader_.metadata().end()) {
      const auto scene = metadata->second.find("scene");
      if (scene != metadata->second.end()) run_.scene = scene->second;
    }
    return;
  }
  throw InputError(file.string() + ": holds no run of Clamber (no message of type " + description +
                   (reader_.cut() ? "; the file is cut" : "") + ")");
}

void RunReader::take(const McapMessage& message) {
  static const std::string event = event_schema().name;
  const auto require = [&](bool good, const char* what) {
    if (!good) throw InputError(file_.string() + ": " + what + " that cannot be read");
  };
  if (message.schema == event)
    require(decode_event(message.data, notes_.events.emplace_back()), "an event");
  else if (message.topic == kUrdfTopic)
    require(decode_string(message.data, notes_.urdf), "a robot description");
}

bool RunReader::next(TelemetryFrame& frame) {
  static const std::string tick = tick_schema().name;
  for (McapMessage message; reader_.next(message);) {
    take(message);
    if (message.schema != tick) continue;
    if (!decode_tick(message.data, frame) ||
        frame.joint_count != run_.telemetry.joint_names.size() ||
        frame.contact_count != run_.telemetry.contact_names.size())
      throw InputError(file_.string() + ": a tick at " + std::to_string(message.time) +
                       " ns that cannot be read: written by another version of Clamber?");
    return true;
  }
  return false;
}

}  // namespace clamber
