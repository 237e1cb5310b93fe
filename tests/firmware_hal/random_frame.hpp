// Seeded frames for property tests: valid ones, with the payloads that stuff worst among them.
#pragma once

#include <random>

#include "firmware_hal/can_frame.hpp"

namespace clamber::test {

inline CanFrame random_frame(std::mt19937_64& random, bool fd, bool extended) {
  static constexpr std::array<std::uint8_t, 16> kLengths{0, 1,  2,  3,  4,  5,  6,  7,
                                                         8, 12, 16, 20, 24, 32, 48, 64};
  CanFrame frame;
  frame.extended = extended;
  frame.fd = fd;
  frame.brs = fd && random() % 2 == 0;
  frame.esi = fd && random() % 4 == 0;
  frame.length = kLengths[random() % (fd ? 16 : 9)];
  frame.remote = !fd && random() % 16 == 0;
  const std::uint64_t kind = random() % 6;
  const auto word = [&]() -> std::uint32_t {
    switch (kind) {
      case 0:
        return 0x00000000u;
      case 1:
        return 0xFFFFFFFFu;
      case 2:
        return 0x78787878u << (random() % 8);  // runs of four: the worst after the first stuff bit
      case 3:
        return 0x0F0F0F0Fu << (random() % 8);
      case 4:
        return 0x1F07C1F0u;  // runs of five
      default:
        return static_cast<std::uint32_t>(random());
    }
  };
  frame.id = word() & (extended ? kMaxExtendedId : kMaxStandardId);
  const std::uint32_t pattern = word();
  for (std::size_t i = 0; i < frame.length && !frame.remote; ++i)
    frame.data[i] = static_cast<std::uint8_t>(kind == 5 ? word() : pattern >> (8 * (i % 4)));
  return frame;
}

}  // namespace clamber::test
