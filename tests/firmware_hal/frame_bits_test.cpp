// Frame lengths against a count over the written-out bit string, and against published figures.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "firmware_hal/bus_model/frame_bits.hpp"
#include "tests/firmware_hal/random_frame.hpp"

namespace clamber {
namespace {

/// Most significant bit first, as '0' and '1'.
std::string binary(std::uint64_t value, int bits) {
  std::string text;
  for (int i = bits - 1; i >= 0; --i) text += (value >> i & 1) != 0 ? '1' : '0';
  return text;
}

/// The remainder of the polynomial division, written as on paper.
std::string crc15(const std::string& bits) {
  const std::string divisor = "1100010110011001";  // x^15 + ... = 0x4599 with its leading one
  std::string rest = bits + std::string(15, '0');
  for (std::size_t i = 0; i + 15 < rest.size(); ++i)
    if (rest[i] == '1')
      for (std::size_t k = 0; k < divisor.size(); ++k)
        rest[i + k] = rest[i + k] == divisor[k] ? '0' : '1';
  return rest.substr(rest.size() - 15);
}

/// Writes the stuff bits into the string; `last` says whether one may follow the last bit.
std::string stuff(const std::string& bits, bool last) {
  std::string out;
  for (std::size_t i = 0; i < bits.size(); ++i) {
    out += bits[i];
    const std::size_t n = out.size();
    const bool five = n >= 5 && out.substr(n - 5) == std::string(5, out[n - 1]);
    if (five && (last || i + 1 < bits.size())) out += out[n - 1] == '0' ? '1' : '0';
  }
  return out;
}

std::string body(const CanFrame& f) {
  std::string text = "0";
  text +=
      f.extended ? binary(f.id >> 18, 11) + "11" + binary(f.id & 0x3FFFF, 18) : binary(f.id, 11);
  text += f.remote ? '1' : '0';
  if (!f.extended) text += '0';
  if (f.fd) {
    text += std::string("10") + (f.brs ? '1' : '0') + (f.esi ? '1' : '0');
  } else {
    text += f.extended ? "00" : "0";
  }
  text += binary(static_cast<std::uint64_t>(dlc_of(f.length, f.fd)), 4);
  for (const std::uint8_t byte : f.payload()) text += binary(byte, 8);
  return text;
}

std::size_t counted_bits(const CanFrame& f) {
  const std::size_t tail = 1 + 1 + 1 + 7 + 3;
  if (!f.fd) return stuff(body(f) + crc15(body(f)), true).size() + tail;
  return stuff(body(f), false).size() + (f.length <= 16 ? 27u : 32u) + tail;
}

TEST(FrameBits, EqualTheWrittenOutBits) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 40000; ++i) {
    const CanFrame f = test::random_frame(random, i % 2 == 0, i % 3 == 0);
    ASSERT_EQ(exact_bits(f).total(), counted_bits(f)) << f.id << ' ' << int{f.length};
  }
}

TEST(FrameBits, NeverExceedTheWorstCase) {
  std::mt19937_64 random(2);
  for (int i = 0; i < 100000; ++i) {
    const CanFrame f = test::random_frame(random, i % 2 == 0, i % 3 == 0);
    const FrameBits worst = worst_bits(f.length, {f.fd, f.brs}, f.extended);
    ASSERT_LE(exact_bits(f).total(), worst.total());
    for (const BitTiming timing :
         {BitTiming{1000, 200}, BitTiming{1000, 125}, BitTiming{2000, 500}})
      ASSERT_LE(duration_ns(exact_bits(f), timing), duration_ns(worst, timing));
  }
}

/// How near real frames come: with every id and payload of 0 and 1 bytes tried.
TEST(FrameBits, TheWorstCaseIsNotFarFromARealFrame) {
  for (const bool fd : {false, true}) {
    std::uint32_t longest = 0;
    for (std::uint32_t id = 0; id <= kMaxStandardId; ++id) {
      for (std::uint32_t byte = 0; byte < 256; ++byte) {
        const std::uint8_t bytes[] = {static_cast<std::uint8_t>(byte)};
        longest = std::max(longest, exact_bits(make_frame(id, bytes, {fd, fd})).total());
      }
    }
    const std::uint32_t worst = worst_bits(1, {fd, fd}).total();
    EXPECT_LE(longest, worst);
    // FD: the bits FDF, res and BRS are fixed and break runs that the bound allows.
    EXPECT_GE(longest + (fd ? 4 : 3), worst) << (fd ? "FD" : "classic");
  }
}

/// 47 + 8n + floor((34 + 8n - 1) / 4) for 11-bit ids, 67 and 54 for 29-bit ids (Davis 2007, eq. 1).
TEST(FrameBits, WorstClassicFramesAreThePublishedOnes) {
  for (std::uint32_t n = 0; n <= 8; ++n) {
    EXPECT_EQ(worst_bits(n, {}).total(), 47 + 8 * n + (34 + 8 * n - 1) / 4);
    EXPECT_EQ(worst_bits(n, {}, true).total(), 67 + 8 * n + (54 + 8 * n - 1) / 4);
  }
  EXPECT_EQ(worst_bits(8, {}).total(), 135u);
  EXPECT_EQ(worst_bits(0, {}).total(), 55u);
  EXPECT_EQ(worst_bits(8, {}, true).total(), 160u);
}

/// 8 bytes at 1/2, 1/5, 1/8 Mbit/s; published: 91, 56.8, 48.2 us with one data bit more.
TEST(FrameBits, WorstFdFramesAreThePublishedOnesWithinABit) {
  const auto us = [](std::size_t n, std::uint32_t data_ns) {
    return 1e-3 * static_cast<double>(duration_ns(worst_bits(n, {true, true}), {1000, data_ns}));
  };
  EXPECT_NEAR(us(8, 500), 91.0, 0.5);
  EXPECT_NEAR(us(8, 200), 56.8, 0.201);
  EXPECT_NEAR(us(8, 125), 48.2, 0.201);
  EXPECT_NEAR(us(16, 200), 72.8, 0.201);
  EXPECT_NEAR(us(32, 200), 105.8, 0.201);
  EXPECT_NEAR(us(64, 200), 169.8, 0.201);
}

/// id 0, no data: SOF to DLC are 19 zeros, the checksum is 0 as well: 34 zeros, a stuff bit after
/// the first 5 and, since the stuff bit is a one, after every further 5: 6 bits.
TEST(FrameBits, ByHand) {
  EXPECT_EQ(exact_bits(make_frame(0, {})).total(), 34u + 6 + 10 + 3);
  // id 0x555 in FD: only the run IDE..., none of five; DLC 0: ESI DLC = 00000 after BRS 1: at the
  // end of the stuffed part, where the fixed stuff bit stands in.
  EXPECT_EQ(exact_bits(make_frame(0x555, {}, {true, true})).nominal, 17u + 13);
  EXPECT_EQ(exact_bits(make_frame(0x555, {}, {true, true})).data, 5u + 27);
  EXPECT_EQ(exact_bits(make_frame(0x555, {}, {true, false})).data, 0u);
}

TEST(FrameBits, NoBitsForWhatIsNoFrame) {
  CanFrame f;
  f.length = 9;
  EXPECT_EQ(exact_bits(f).total(), 0u);
  f = {};
  f.id = kMaxStandardId + 1;
  EXPECT_EQ(exact_bits(f).total(), 0u);
  f = {};
  f.fd = f.remote = true;
  EXPECT_EQ(exact_bits(f).total(), 0u);
}

TEST(Arbitration, LowerIdThenDataThenStandardWins) {
  const auto key = [](std::uint32_t id, bool extended, bool remote) {
    CanFrame f;
    f.id = id;
    f.extended = extended;
    f.remote = remote;
    return arbitration_key(f);
  };
  EXPECT_LT(key(0x10, false, false), key(0x11, false, false));
  EXPECT_LT(key(0x10, false, false), key(0x10, false, true));
  EXPECT_LT(key(0x10, false, true), key(0x10u << 18, true, false));  // SRR equal, IDE decides
  EXPECT_LT(key(0x10u << 18, true, false), key(0x11, false, false));
  EXPECT_LT(key(0x10u << 18 | 5, true, false), key(0x10u << 18 | 5, true, true));
}

}  // namespace
}  // namespace clamber
