#include "robot_model/read_file.hpp"

#include <array>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

const char* kind_of(fs::file_type type) {
  switch (type) {
    case fs::file_type::directory:
      return "a directory";
    case fs::file_type::fifo:
      return "a FIFO";
    case fs::file_type::socket:
      return "a socket";
    case fs::file_type::character:
    case fs::file_type::block:
      return "a device";
    default:
      return "of an unknown kind";
  }
}

[[noreturn]] void refuse_size(const fs::path& file, std::uintmax_t most_bytes) {
  throw InputError(file.string() + ": too large, expected at most " +
                   std::to_string(most_bytes >> 20) + " MiB");
}

}  // namespace

std::ifstream open_file(const fs::path& file, std::uintmax_t most_bytes) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (status.type() == fs::file_type::none) {
    throw InputError(file.string() + ": " + error.message());
  }
  if (!fs::exists(status)) {
    throw InputError(file.string() + ": no such file");
  }
  if (!fs::is_regular_file(status)) {
    throw InputError(file.string() + ": is " + kind_of(status.type()) + ", expected a file");
  }
  if (fs::file_size(file, error) > most_bytes && !error) {
    refuse_size(file, most_bytes);
  }
  std::ifstream stream(file, std::ios::binary);
  if (!stream.is_open()) {
    throw InputError(file.string() + ": cannot be read");
  }
  return stream;
}

std::string read_file(const fs::path& file, std::uintmax_t most_bytes) {
  std::ifstream stream = open_file(file, most_bytes);
  std::string bytes;
  std::array<char, 65536> block{};
  // Counted again while reading: files of /proc have no size beforehand.
  while (stream.read(block.data(), block.size()) || stream.gcount() > 0) {
    bytes.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (bytes.size() > most_bytes) {
      refuse_size(file, most_bytes);
    }
  }
  if (stream.bad()) {
    throw InputError(file.string() + ": cannot be read");
  }
  return bytes;
}

}  // namespace clamber
