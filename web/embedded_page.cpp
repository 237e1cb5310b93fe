// The built page among the program's constants: the assembler reads it, not the compiler, which
// would take a minute over it.
#include "web/page.hpp"

asm(R"(
  .pushsection .rodata
  .global clamber_web_page_begin
  .global clamber_web_page_end
clamber_web_page_begin:
  .incbin ")" CLAMBER_PAGE_FILE R"("
clamber_web_page_end:
  .popsection
)");

extern "C" const char clamber_web_page_begin[];
extern "C" const char clamber_web_page_end[];

namespace clamber {

std::string_view web_page() {
  return {clamber_web_page_begin,
          static_cast<std::size_t>(clamber_web_page_end - clamber_web_page_begin)};
}

}  // namespace clamber
