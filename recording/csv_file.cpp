#include <charconv>
#include <cmath>
#include <fstream>
#include <span>
#include <type_traits>

#include "recording/frame_fields.hpp"
#include "recording/run_file.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

constexpr std::size_t kBufferBytes = 1u << 20;
constexpr std::array<const char*, 4> kPositionParts = {"x", "y", "z", ""};
constexpr std::array<const char*, 4> kOrientationParts = {"w", "x", "y", "z"};

class CsvFile final : public RunFile {
 public:
  CsvFile(std::filesystem::path file, const RunDescription& run)
      : file_(std::move(file)),
        out_(file_, std::ios::binary),
        joints_(run.telemetry.joint_names.size()),
        contacts_(run.telemetry.contact_names.size()) {
    write_names(run.telemetry);
    write_buffer();
  }

  void add(const TelemetryFrame& frame) override {
    visit_fields(frame, [&](const FieldText& /*field*/, const auto& member) {
      using Member = std::decay_t<decltype(member)>;
      if constexpr (std::is_arithmetic_v<Member>) {
        number(member);
      } else {
        for (const double value : std::span(member).first(size_of(member))) number(value);
      }
    });
    end_line();
    if (buffer_.size() > kBufferBytes) write_buffer();
  }

  void close() override {
    write_buffer();
    out_.close();
    if (!out_) fail();
  }

 private:
  std::size_t size_of(const PerJoint& /*tag*/) const { return joints_; }
  std::size_t size_of(const PerContact& /*tag*/) const { return contacts_; }
  template <std::size_t N>
  std::size_t size_of(const std::array<double, N>& /*tag*/) const {
    return N;
  }

  static std::string part(const TelemetryDescription& names, const PerJoint& /*tag*/,
                          std::size_t i) {
    return names.joint_names[i];
  }
  static std::string part(const TelemetryDescription& names, const PerContact& /*tag*/,
                          std::size_t i) {
    return names.contact_names[i];
  }
  template <std::size_t N>
  static std::string part(const TelemetryDescription& /*names*/,
                          const std::array<double, N>& /*tag*/, std::size_t i) {
    return (N == 3 ? kPositionParts : kOrientationParts)[i];
  }

  void write_names(const TelemetryDescription& names) {
    const TelemetryFrame frame;
    visit_fields(frame, [&](const FieldText& field, const auto& member) {
      const std::string unit = *field.unit != '\0' ? " [" + std::string(field.unit) + "]" : "";
      if constexpr (std::is_arithmetic_v<std::decay_t<decltype(member)>>) {
        buffer_ += field.name + unit + ',';
      } else {
        for (std::size_t i = 0; i < size_of(member); ++i)
          buffer_ += field.name + ('.' + part(names, member, i)) + unit + ',';
      }
    });
    end_line();
  }

  template <typename Number>
  void number(Number value) {
    char text[32];
    const auto end = std::to_chars(text, text + sizeof text, value).ptr;
    buffer_.append(text, end);
    buffer_.push_back(',');
  }
  void end_line() { buffer_.back() = '\n'; }

  void write_buffer() {
    out_.write(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
    buffer_.clear();
    if (!out_) fail();
  }
  [[noreturn]] void fail() const { throw InputError(file_.string() + ": cannot write"); }

  std::filesystem::path file_;
  std::ofstream out_;
  std::size_t joints_;
  std::size_t contacts_;
  std::string buffer_;
};

}  // namespace

std::unique_ptr<RunFile> open_csv(const std::filesystem::path& file, const RunDescription& run) {
  return std::make_unique<CsvFile>(file, run);
}

}  // namespace clamber
