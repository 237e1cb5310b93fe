// ROS 2's message bytes: little-endian XCDR version 1 with its encapsulation header (OMG DDS-RTPS
// 10.2, DDS-XTypes 7.4.1). Inside this room only.
// Any thread; allocates; blocks: never.
#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace clamber {

class CdrWriter {
 public:
  void start() { bytes_.assign(kHeader, sizeof kHeader); }

  template <typename Number>
  void number(Number value) {
    align(sizeof value);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void text(std::string_view text) {
    number(static_cast<std::uint32_t>(text.size() + 1));
    bytes_.append(text);
    bytes_.push_back('\0');
  }
  void fixed(std::span<const double> values) {
    for (const double value : values) number(value);
  }
  void sequence(std::span<const double> values) {
    number(static_cast<std::uint32_t>(values.size()));
    fixed(values);
  }
  template <typename Texts>
  void text_sequence(const Texts& texts) {
    number(static_cast<std::uint32_t>(texts.size()));
    for (const std::string& each : texts) text(each);
  }
  [[nodiscard]] std::string_view bytes() const { return bytes_; }

 private:
  static constexpr char kHeader[4] = {0, 1, 0, 0};

  void align(std::size_t size) {
    const std::size_t body = bytes_.size() - sizeof kHeader;
    bytes_.append((size - body % size) % size, '\0');
  }

  std::string bytes_;
};

/// Takes values off the front of a message. Beyond its end everything is zero and empty, and ok()
/// false: checked once, at the end.
class CdrReader {
 public:
  explicit CdrReader(std::string_view message) {
    constexpr std::size_t kHeader = 4;
    ok_ = message.size() >= kHeader && message[0] == 0 && message[1] == 1;
    if (ok_) body_ = message.substr(kHeader);
  }

  template <typename Number>
  Number number() {
    at_ += (sizeof(Number) - at_ % sizeof(Number)) % sizeof(Number);
    Number value{};
    if (at_ > body_.size() || body_.size() - at_ < sizeof value) {
      fail();
      return value;
    }
    std::memcpy(&value, body_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  std::string text() {
    const auto size = number<std::uint32_t>();
    if (size == 0 || body_.size() - at_ < size) {
      fail();
      return {};
    }
    const std::string text(body_.substr(at_, size - 1));
    at_ += size;
    return text;
  }
  void fixed(std::span<double> values) {
    for (double& value : values) value = number<double>();
  }
  /// @return how many there were; more than fit are an error
  std::uint32_t sequence(std::span<double> values) {
    const std::uint32_t size = count(values.size());
    fixed(values.first(size));
    return size;
  }
  /// Of a sequence; more than `most` are an error.
  std::uint32_t count(std::size_t most) {
    const auto size = number<std::uint32_t>();
    if (size <= most) return size;
    fail();
    return 0;
  }
  std::vector<std::string> text_sequence(std::size_t most) {
    std::vector<std::string> texts(count(most));
    for (std::string& each : texts) each = text();
    return texts;
  }
  [[nodiscard]] bool ok() const { return ok_; }

 private:
  void fail() {
    ok_ = false;
    at_ = body_.size();
  }

  std::string_view body_;
  std::size_t at_ = 0;
  bool ok_;
};

}  // namespace clamber
