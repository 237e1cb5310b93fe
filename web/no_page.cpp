// In place of embedded_page.cpp where the page is not built.
#include "web/page.hpp"

namespace clamber {

std::string_view web_page() { return {}; }

}  // namespace clamber
