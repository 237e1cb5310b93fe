// Reads the messages of uncompressed MCAP files in the order they were written, up to the last
// complete chunk where a file was cut.
// One thread; allocates; blocks on the file; throws InputError.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace clamber {

struct McapMessage {
  std::string topic;
  std::string schema;      ///< its name
  std::uint64_t time = 0;  ///< ns
  std::string_view data;   ///< valid until the next call of next()
};

class McapReader {
 public:
  /// @throws InputError when it is no MCAP file
  explicit McapReader(std::filesystem::path file);

  /// The next message; false after the last one.
  /// @throws InputError for a chunk that is compressed or whose checksum is wrong
  bool next(McapMessage& message);

  /// After the last message: the file ends without its index, so it was cut.
  [[nodiscard]] bool cut() const { return cut_; }
  /// By the metadata record's name; of the records met so far.
  [[nodiscard]] const std::map<std::string, std::map<std::string, std::string>>& metadata() const {
    return metadata_;
  }

 private:
  struct Channel {
    std::string topic;
    std::string schema;
  };

  bool next_chunk();
  void open_chunk();
  void take_schema(std::string_view content);
  void take_channel(std::string_view content);
  bool take_message(std::string_view content, McapMessage& message) const;
  [[noreturn]] void fail(const std::string& what) const;

  std::filesystem::path file_;
  std::ifstream in_;
  std::uint64_t left_;      ///< bytes of the file that are not read
  std::string record_;      ///< content of the last record read
  std::string_view chunk_;  ///< records of the open chunk that are not taken yet, in record_
  std::map<std::uint16_t, std::string> schemas_;
  std::map<std::uint16_t, Channel> channels_;
  std::map<std::string, std::map<std::string, std::string>> metadata_;
  bool ended_ = false;
  bool cut_ = false;
};

}  // namespace clamber
