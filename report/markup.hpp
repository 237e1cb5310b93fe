// Text for HTML and SVG: escaping and locale-free numbers.
// Any thread; allocates; never blocks.
#pragma once

#include <string>
#include <string_view>

namespace clamber {

/// `text` with & < > " ' replaced, fit for element content and quoted attributes.
[[nodiscard]] std::string escape_markup(std::string_view text);

/// Fixed-point decimal with `digits` places; "-" for NaN and infinities; never "-0.0".
[[nodiscard]] std::string fixed(double value, int digits);

}  // namespace clamber
