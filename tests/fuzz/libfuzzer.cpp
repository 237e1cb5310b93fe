// One libFuzzer program for one parser: CLAMBER_FUZZ_TARGET names it. `<program> --seeds <folder>`
// writes the inputs to start from.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/fuzz/target.hpp"

namespace {

const clamber::fuzz::Target& target() {
  static const clamber::fuzz::Target& found = *clamber::fuzz::find_target(CLAMBER_FUZZ_TARGET);
  return found;
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  if (*argc == 3 && std::string((*argv)[1]) == "--seeds") {
    const std::filesystem::path folder = (*argv)[2];
    std::filesystem::create_directories(folder);
    int number = 0;
    for (const std::string& seed : target().seeds()) {
      std::ofstream(folder / ("seed" + std::to_string(number++)), std::ios::binary) << seed;
    }
    std::exit(0);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  (void)target().run(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
