// Writes MCAP files: uncompressed, chunked, indexed, with checksums (mcap.dev/spec, version 0).
// One thread; allocates; blocks on the file; throws InputError.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>

namespace clamber {

/// How the messages of a channel are to be read.
struct McapSchema {
  std::string name;      ///< e.g. "sensor_msgs/msg/JointState"
  std::string encoding;  ///< e.g. "ros2msg"
  std::string text;
};

/// A file that ends after any complete chunk opens up to there: what a killed process leaves. When
/// the disk is full the file is cut back to its last complete chunk.
class McapWriter {
 public:
  /// @param library what wrote the file, for its header
  /// @throws InputError when the file cannot be written
  McapWriter(std::filesystem::path file, const std::string& profile, const std::string& library);
  ~McapWriter();  ///< leaves the file as a killed process would, unless close() was called
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;

  /// Facts about the file as a whole. @throws InputError
  void add_metadata(const std::string& name, const std::map<std::string, std::string>& entries);
  /// @return the channel's number, for write(). Channels of schemas with the same name share it.
  std::uint16_t add_channel(const std::string& topic, const McapSchema& schema,
                            const std::string& message_encoding);
  /// Adds a message to the open chunk, which ends by itself after a second (of the messages' own
  /// time) or a megabyte.
  /// @param time ns, of the recording; viewers order by it
  /// @param published ns, when it was sent: for what a recorder that came late is told of the past
  /// @throws InputError
  void write(std::uint16_t channel, std::uint64_t time, std::uint64_t published,
             std::string_view message);
  void write(std::uint16_t channel, std::uint64_t time, std::string_view message) {
    write(channel, time, time, message);
  }
  /// Writes the open chunk out. @throws InputError
  void flush();
  /// Writes index and statistics; nothing can be added any more. @throws InputError
  void close();

  [[nodiscard]] std::uint64_t messages() const;
  [[nodiscard]] std::uint64_t bytes() const;  ///< of the file so far

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clamber
