// Opens and reads the files a user names: regular files of a sane size and nothing else.
// Any thread; allocates: yes; blocks: on the file. Start-up and tools only.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

namespace clamber {

// The most bytes a file may have, by kind: well above what real ones reach, well below memory.
inline constexpr std::uintmax_t kSettingsBytes = std::uintmax_t{4} << 20;  ///< YAML, URDF, JSON
inline constexpr std::uintmax_t kPlanBytes = std::uintmax_t{64} << 20;     ///< plans, certificates
inline constexpr std::uintmax_t kRecordingBytes = std::uintmax_t{512} << 20;  ///< and motions
inline constexpr std::uintmax_t kRunLogBytes = std::uintmax_t{4} << 30;       ///< half an hour

/// Opens `file` for binary reading. Symbolic links are followed. A FIFO or a device is refused
/// before it is opened: it might never deliver, or never end.
/// @throws InputError naming the file when it does not exist, is no regular file, has more than
///         `most_bytes` or cannot be opened
[[nodiscard]] std::ifstream open_file(const std::filesystem::path& file, std::uintmax_t most_bytes);

/// The bytes of `file`. @throws InputError as open_file(), and when it cannot be read
[[nodiscard]] std::string read_file(const std::filesystem::path& file,
                                    std::uintmax_t most_bytes = kSettingsBytes);

}  // namespace clamber
