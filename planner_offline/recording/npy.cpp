#include "planner_offline/recording/npy.hpp"

#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "planner_offline/recording/parse_number.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

static_assert(std::endian::native == std::endian::little, "the arrays are little-endian");

constexpr std::string_view kMagic = "\x93NUMPY";
constexpr std::size_t kMaxHeader = 65536;

struct Header {
  std::string descr;
  bool fortran_order = false;
  std::vector<std::size_t> shape;
};

class NpyReader {
 public:
  NpyReader(std::string_view bytes, const std::string& source) : bytes_(bytes), source_(source) {}

  HumanMotion read(double rate) {
    const std::size_t data = read_header();
    const std::size_t width = header_.descr == "<f4" ? 4 : header_.descr == "<f8" ? 8 : 0;
    if (width == 0) fail(kMagic.size(), "type '" + header_.descr + "': expected '<f4' or '<f8'");
    if (header_.fortran_order) fail(kMagic.size(), "Fortran order: expected C order");
    const auto& labels = npy_joint_labels();
    const auto& shape = header_.shape;
    if (shape.size() != 3 || shape[0] == 0 || shape[1] != labels.size() || shape[2] != 3) {
      fail(kMagic.size(), "shape " + shape_text() + ": expected (frames, " +
                              std::to_string(labels.size()) + ", 3)");
    }
    const std::size_t frame_bytes = labels.size() * 3 * width;
    const std::size_t available = bytes_.size() - data;
    if (shape[0] != available / frame_bytes || available % frame_bytes != 0) {
      fail(data, std::to_string(available) + " bytes of data: expected " +
                     std::to_string(shape[0]) + " frames of " + std::to_string(frame_bytes) +
                     " bytes");
    }
    HumanMotion motion;
    motion.source = source_;
    motion.format = "positions (npy)";
    motion.rate = rate;
    motion.points = labels;
    motion.frames.resize(shape[0]);
    for (std::size_t f = 0; f < shape[0]; ++f) {
      motion.frames[f].point.resize(labels.size());
      for (std::size_t k = 0; k < labels.size() * 3; ++k) {
        const std::size_t at = data + f * frame_bytes + k * width;
        motion.frames[f].point[k / 3][static_cast<Eigen::Index>(k % 3)] = value(at, width, f);
      }
    }
    return motion;
  }

 private:
  [[noreturn]] void fail(std::size_t offset, const std::string& what) const {
    throw InputError(source_ + ": byte " + std::to_string(offset) + ": " + what);
  }

  std::string shape_text() const {
    std::string text = "(";
    for (const auto n : header_.shape) text += std::to_string(n) + ", ";
    return text + ")";
  }

  double value(std::size_t at, std::size_t width, std::size_t frame) const {
    double result = 0.0;
    if (width == 4) {
      float single = 0.0F;
      std::memcpy(&single, bytes_.data() + at, width);
      result = static_cast<double>(single);
    } else {
      std::memcpy(&result, bytes_.data() + at, width);
    }
    // A person within a kilometre of the origin; anything else is a damaged file.
    if (!(std::abs(result) < 1000.0)) {
      fail(at, "frame " + std::to_string(frame) + ": expected a finite position in metres");
    }
    return result;
  }

  /// @return offset of the array data
  std::size_t read_header() {
    if (!bytes_.starts_with(kMagic) || bytes_.size() < 12) {
      fail(0, "no NumPy header: the file is damaged or was cut off");
    }
    const auto byte = [this](std::size_t i) {
      return static_cast<std::size_t>(static_cast<unsigned char>(bytes_[i]));
    };
    const std::size_t major = byte(6);
    if (major < 1 || major > 3) {
      fail(6, "NumPy format version " + std::to_string(major) + ": expected 1, 2 or 3");
    }
    const std::size_t start = major == 1 ? 10 : 12;
    std::size_t length = byte(8) | byte(9) << 8U;
    if (major > 1) length |= byte(10) << 16U | byte(11) << 24U;
    if (length > kMaxHeader || start + length > bytes_.size()) {
      fail(8, "header of " + std::to_string(length) + " bytes: the file was cut off");
    }
    parse_dictionary(bytes_.substr(start, length), start);
    return start + length;
  }

  /// The header is a Python dictionary literal with exactly the keys descr, fortran_order, shape.
  void parse_dictionary(std::string_view text, std::size_t offset) {
    text_ = trimmed(text);
    offset_ = offset;
    expect('{');
    bool seen[3] = {false, false, false};
    while (peek() != '}') {
      const std::string key = quoted();
      expect(':');
      if (key == "descr") {
        header_.descr = quoted();
        seen[0] = true;
      } else if (key == "fortran_order") {
        header_.fortran_order = boolean();
        seen[1] = true;
      } else if (key == "shape") {
        header_.shape = tuple();
        seen[2] = true;
      } else {
        fail(offset_, "header key '" + key + "': expected descr, fortran_order, shape");
      }
      if (peek() == ',') expect(',');
    }
    if (!seen[0] || !seen[1] || !seen[2]) {
      fail(offset_, "header lacks one of descr, fortran_order, shape");
    }
  }

  char peek() {
    text_ = trimmed(text_);
    return text_.empty() ? '\0' : text_.front();
  }

  void expect(char c) {
    if (peek() != c) fail(offset_, std::string("header: expected '") + c + "'");
    text_.remove_prefix(1);
  }

  std::string quoted() {
    const char quote = peek();
    if (quote != '\'' && quote != '"') fail(offset_, "header: expected a quoted string");
    const auto end = text_.find(quote, 1);
    if (end == std::string_view::npos) fail(offset_, "header: string without end");
    std::string result(text_.substr(1, end - 1));
    text_.remove_prefix(end + 1);
    return result;
  }

  bool boolean() {
    for (const std::string_view word : {"True", "False"}) {
      if (peek() != '\0' && text_.starts_with(word)) {
        text_.remove_prefix(word.size());
        return word == "True";
      }
    }
    fail(offset_, "header: fortran_order: expected True or False");
  }

  std::vector<std::size_t> tuple() {
    std::vector<std::size_t> values;
    expect('(');
    while (peek() != ')') {
      std::uint32_t value = 0;
      const auto [end, error] = std::from_chars(text_.data(), text_.data() + text_.size(), value);
      if (error != std::errc()) fail(offset_, "header: shape: expected whole numbers");
      text_.remove_prefix(static_cast<std::size_t>(end - text_.data()));
      values.push_back(value);
      if (values.size() > 8) fail(offset_, "header: shape: expected three dimensions");
      if (peek() == ',') expect(',');
    }
    expect(')');
    return values;
  }

  std::string_view bytes_;
  const std::string& source_;
  std::string_view text_;
  std::size_t offset_ = 0;
  Header header_;
};

}  // namespace

const std::vector<std::string>& npy_joint_labels() {
  static const std::vector<std::string> labels = [] {
    std::vector<std::string> all{"Hips", "Spine", "Spine1", "Neck", "Head"};
    for (const std::string side : {"Left", "Right"}) {
      for (const char* joint : {"Shoulder", "Arm", "ForeArm", "Hand"}) all.push_back(side + joint);
      for (int i = 1; i <= 15; ++i) all.push_back(side + "Finger" + std::to_string(i));
    }
    for (const std::string side : {"Left", "Right"}) {
      for (const char* joint : {"UpLeg", "Leg", "Foot", "ToeBase"}) all.push_back(side + joint);
    }
    all.insert(all.end(), {"LeftFootMod", "RightFootMod"});
    return all;
  }();
  return labels;
}

HumanMotion parse_npy(std::string_view bytes, const std::string& source, double rate) {
  return NpyReader(bytes, source).read(rate);
}

}  // namespace clamber
