// Reads a whole file into memory.
// Any thread; allocates: yes; blocks: on the file. Start-up and tools only.
#pragma once

#include <filesystem>
#include <string>

namespace clamber {

/// The bytes of `file`.
/// @throws InputError naming the file when it does not exist, is no regular file or cannot be read
[[nodiscard]] std::string read_file(const std::filesystem::path& file);

}  // namespace clamber
