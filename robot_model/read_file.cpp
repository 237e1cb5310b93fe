#include "robot_model/read_file.hpp"

#include <fstream>
#include <iterator>

#include "robot_model/loader.hpp"

namespace clamber {

std::string read_file(const std::filesystem::path& file) {
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status)) {
    throw InputError(file.string() + ": no such file");
  }
  // A directory opens as a stream on Linux and only fails on the first read.
  if (std::filesystem::is_directory(status)) {
    throw InputError(file.string() + ": is a directory, expected a file");
  }
  std::ifstream stream(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  if (!stream.is_open() || stream.bad()) {
    throw InputError(file.string() + ": cannot be read");
  }
  return bytes;
}

}  // namespace clamber
