// Bits of classic frames as can-utils' canbusload counts them, on a CAN interface.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "firmware_hal/bus_model/frame_bits.hpp"
#include "firmware_hal/candump.hpp"
#include "tests/firmware_hal/random_frame.hpp"
#include "tests/vcan/vcan.hpp"

namespace clamber {
namespace {

TEST(Canbusload, CountsTheSameBits) {
  const std::string interface = "can0";
  CLAMBER_NEEDS_VCAN(interface);
  const std::filesystem::path folder = testing::TempDir();
  const std::string log = (folder / "clamber_load.log").string();
  const std::string out = (folder / "clamber_load.txt").string();
  for (const bool extended : {false, true}) {
    std::mt19937_64 random(99);
    std::uint64_t frames = 0;
    std::uint64_t bits = 0;
    {
      std::ofstream file(log);
      for (int i = 0; i < 3000; ++i) {
        const CanFrame frame = test::random_frame(random, false, extended);
        if (frame.remote) continue;  // counted with a payload that they do not have
        ++frames;
        bits += exact_bits(frame).total();
        file << format_candump(1'000'000 + 300 * i, "vcan0", frame) << '\n';
      }
    }
    const std::string line = "canbusload -e " + interface + "@1000000 >'" + out +
                             "' & p=$!; sleep 2; canplayer -I '" + log + "' " + interface +
                             "=vcan0; sleep 4; kill $p";
    ASSERT_EQ(std::system(line.c_str()), 0);
    // "vcan0@1000000  <frames> <bits> <payload bits> <load>%" once a second.
    std::ifstream in(out);
    std::uint64_t counted_frames = 0;
    std::uint64_t counted_bits = 0;
    for (std::string row; std::getline(in, row);) {
      std::istringstream words(row);
      std::string name;
      std::uint64_t f = 0;
      std::uint64_t b = 0;
      if (words >> name >> f >> b) {
        counted_frames += f;
        counted_bits += b;
      }
    }
    EXPECT_EQ(counted_frames, frames);
    EXPECT_EQ(counted_bits, bits);
    std::printf("%s ids: %llu frames, %llu bits by canbusload, %llu by us\n",
                extended ? "29-bit" : "11-bit", static_cast<unsigned long long>(counted_frames),
                static_cast<unsigned long long>(counted_bits),
                static_cast<unsigned long long>(bits));
  }
}

}  // namespace
}  // namespace clamber
