// Numbers from text without locale surprises. Any thread; allocates: only for the error text.
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

namespace clamber {

/// A finite number that fills `text` completely (surrounding blanks allowed), or nothing.
[[nodiscard]] std::optional<double> parse_number(std::string_view text) noexcept;

/// Whitespace-separated finite numbers. On a bad one returns its zero-based position in `bad`
/// and stops there.
[[nodiscard]] std::vector<double> parse_numbers(std::string_view text,
                                                std::optional<std::size_t>& bad);

/// `text` without surrounding blanks, tabs and line ends.
[[nodiscard]] std::string_view trimmed(std::string_view text) noexcept;

/// Cuts the next whitespace-separated word off the front of `rest`; empty when there is none.
[[nodiscard]] std::string_view next_word(std::string_view& rest) noexcept;

/// Cuts the next line (without its line end) off the front of `rest`.
[[nodiscard]] std::string_view next_line(std::string_view& rest) noexcept;

}  // namespace clamber
