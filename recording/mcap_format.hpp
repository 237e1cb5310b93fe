// What the MCAP container's writer and reader share (mcap.dev/spec, version 0): opcodes, the magic
// bytes, and little-endian numbers in a byte buffer. Inside this room only.
// Any thread; allocates; blocks: never.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <string_view>

namespace clamber::mcap {

static_assert(std::endian::native == std::endian::little, "numbers are stored as they are");

inline constexpr std::string_view kMagic{"\x89MCAP0\r\n", 8};
inline constexpr std::size_t kRecordHead = 1 + 8;  ///< bytes: opcode and length

enum class Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

/// Bytes of records under construction.
class Bytes {
 public:
  template <typename Number>
  void number(Number value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void raw(std::string_view bytes) { bytes_.append(bytes); }
  /// Strings and byte arrays alike: length, then content.
  void text(std::string_view text) {
    number(static_cast<std::uint32_t>(text.size()));
    raw(text);
  }
  void text_map(const std::map<std::string, std::string>& map) {
    Bytes entries;
    for (const auto& [key, value] : map) {
      entries.text(key);
      entries.text(value);
    }
    text(entries.view());
  }
  void record(Opcode opcode, std::string_view content) {
    number(opcode);
    number(static_cast<std::uint64_t>(content.size()));
    raw(content);
  }
  void clear() { bytes_.clear(); }
  [[nodiscard]] std::string_view view() const { return bytes_; }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] bool empty() const { return bytes_.empty(); }

 private:
  std::string bytes_;
};

/// Takes numbers and strings off the front of a record. Beyond its end everything is zero and
/// empty, and ok() false: checked once, at the end.
class Fields {
 public:
  explicit Fields(std::string_view bytes) : rest_(bytes) {}

  template <typename Number>
  Number number() {
    Number value{};
    const std::string_view bytes = raw(sizeof value);
    if (bytes.size() == sizeof value) std::memcpy(&value, bytes.data(), sizeof value);
    return value;
  }
  std::string_view raw(std::uint64_t size) {
    if (size > rest_.size()) {
      ok_ = false;
      rest_ = {};
      return {};
    }
    const std::string_view bytes = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return bytes;
  }
  std::string_view text() { return raw(number<std::uint32_t>()); }
  std::map<std::string, std::string> text_map() {
    std::map<std::string, std::string> map;
    Fields entries(text());
    while (!entries.rest().empty() && entries.ok()) {
      const std::string key(entries.text());
      map[key] = entries.text();
    }
    ok_ = ok_ && entries.ok();
    return map;
  }
  [[nodiscard]] std::string_view rest() const { return rest_; }
  [[nodiscard]] bool ok() const { return ok_; }

 private:
  std::string_view rest_;
  bool ok_ = true;
};

}  // namespace clamber::mcap
