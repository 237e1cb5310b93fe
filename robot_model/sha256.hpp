// SHA-256 digests of texts and files (FIPS 180-4), for hashes that tie plans to their inputs.
// Any thread; allocates: yes; blocks: sha256_file reads a file. Start-up and tools only.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace clamber {

/// Digest of the bytes of `text`: 64 lower-case hexadecimal digits.
[[nodiscard]] std::string sha256_hex(std::string_view text);

/// Digest of a file's bytes, same form.
/// @throws InputError when the file cannot be read
[[nodiscard]] std::string sha256_file(const std::filesystem::path& file);

}  // namespace clamber
