// The header of a regular file in a POSIX ustar archive, in the one form that bundles have.
// Any thread; allocates: never; blocks: never.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace clamber {

inline constexpr std::size_t kUstarBlock = 512;
using UstarHeader = std::array<char, kUstarBlock>;

/// Owner and group 0, without names. `path`: at most 99 bytes; size and time below 8^11.
[[nodiscard]] UstarHeader ustar_header(std::string_view path, std::uint64_t size, bool executable,
                                       std::uint64_t time);

/// The size that a header states; nothing else of it is looked at. ~0: it states none.
[[nodiscard]] std::uint64_t ustar_size(const UstarHeader& header);

/// What another header is, for the message that refuses it.
[[nodiscard]] std::string describe_foreign(const UstarHeader& header);

/// Zeros between a file of this size and the next header.
[[nodiscard]] constexpr std::size_t ustar_padding(std::uint64_t size) {
  return static_cast<std::size_t>((kUstarBlock - size % kUstarBlock) % kUstarBlock);
}

}  // namespace clamber
