#include "planner_offline/recording/parse_number.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace clamber {
namespace {
constexpr std::string_view kBlanks = " \t\r\n\f\v";
}

std::string_view trimmed(std::string_view text) noexcept {
  const auto first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

std::string_view next_word(std::string_view& rest) noexcept {
  const auto first = rest.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) {
    rest = {};
    return {};
  }
  const auto last = std::min(rest.find_first_of(kBlanks, first), rest.size());
  const auto word = rest.substr(first, last - first);
  rest.remove_prefix(last);
  return word;
}

std::string_view next_line(std::string_view& rest) noexcept {
  const auto end = rest.find('\n');
  auto line = rest.substr(0, end);
  rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

std::optional<double> parse_number(std::string_view text) noexcept {
  auto word = trimmed(text);
  // from_chars takes no leading plus sign; spreadsheets write one.
  if (word.size() > 1 && word.front() == '+' && word[1] != '-') word.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error == std::errc::result_out_of_range && end == word.data() + word.size()) {
    // Denormals underflow in some exporters (1e-320); they mean zero. Overflow stays an error.
    const auto exponent = word.find_first_of("eE");
    if (exponent != std::string_view::npos && exponent + 1 < word.size() &&
        word[exponent + 1] == '-') {
      return 0.0;
    }
    return std::nullopt;
  }
  if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

std::vector<double> parse_numbers(std::string_view text, std::optional<std::size_t>& bad) {
  std::vector<double> values;
  for (auto word = next_word(text); !word.empty(); word = next_word(text)) {
    const auto value = parse_number(word);
    if (!value) {
      bad = values.size();
      return values;
    }
    values.push_back(*value);
  }
  return values;
}

}  // namespace clamber
