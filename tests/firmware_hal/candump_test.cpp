// candump's log lines: the format's cases, a round trip, and lines that are none.
#include <gtest/gtest.h>

#include "firmware_hal/candump.hpp"
#include "tests/firmware_hal/random_frame.hpp"

namespace clamber {
namespace {

CandumpLine parsed(std::string_view text) {
  CandumpLine line;
  const char* error = parse_candump(text, line);
  EXPECT_EQ(error, nullptr) << text << ": " << (error == nullptr ? "" : error);
  return line;
}

TEST(Candump, ReadsEveryKindOfFrame) {
  const CandumpLine classic = parsed("(1436509052.249713) vcan0 044#2A366C2BBA");
  EXPECT_EQ(classic.time_us, 1436509052249713);
  EXPECT_EQ(classic.interface, "vcan0");
  EXPECT_EQ(classic.frame.id, 0x44u);
  EXPECT_EQ(classic.frame.length, 5);
  EXPECT_EQ(classic.frame.data[4], 0xBA);
  const CandumpLine fd = parsed("(0.000001) can0 123##1001122334455667788AABBCC R");
  EXPECT_TRUE(fd.frame.fd && fd.frame.brs && !fd.frame.esi);
  EXPECT_EQ(fd.frame.length, 12);
  EXPECT_EQ(parsed("(0.000001) can0 123#R5").frame.length, 5);
  EXPECT_TRUE(parsed("(0.000001) can0 123#R").frame.remote);
  EXPECT_TRUE(parsed("(0.000001) can0 00000123#").frame.extended);
  const CandumpLine error = parsed("(0.000001) can0 20000004#0004000000000000");
  EXPECT_TRUE(error.frame.error);
  EXPECT_EQ(error.frame.id, 4u);
  EXPECT_EQ(parsed("(0.000001) can0 123#1122334455667788_C\r").frame.length, 8);
}

TEST(Candump, WritesWhatItReads) {
  std::mt19937_64 random(4);
  for (int i = 0; i < 20000; ++i) {
    const CanFrame frame = test::random_frame(random, i % 2 == 0, i % 3 == 0);
    const std::string text = format_candump(1'700'000'000'123'456 + i, "can12", frame);
    const CandumpLine line = parsed(text);
    ASSERT_EQ(line.frame, frame) << text;
    ASSERT_EQ(line.time_us, 1'700'000'000'123'456 + i);
  }
}

TEST(Candump, SaysWhatIsWrong) {
  for (const char* text : {"",
                           "x",
                           "(",
                           "(1",
                           "(1.5) can0 123#",
                           "(1.000000)can0 123#",
                           "(1.000000) 123#",
                           "(1.000000) can0 12#",
                           "(1.000000) can0 1234#",
                           "(1.000000) can0 800#",
                           "(1.000000) can0 FFFFFFFF#",
                           "(1.000000) can0 123",
                           "(1.000000) can0 123#1",
                           "(1.000000) can0 123#1g",
                           "(1.000000) can0 123#112233445566778899",
                           "(1.000000) can0 123##",
                           "(1.000000) can0 123##1112233445566778899",
                           "(1.000000) can0 123#11 what",
                           "(1.000000) can0 123#11_2",
                           "(-1.000000) can0 123#",
                           "(99999999999999999999.000000) can0 123#",
                           "(1.000000)  123#11",
                           "(1.000000) averyveryverylongname 123#11",
                           "(1.000000) can0 20000004##1"}) {
    CandumpLine line;
    const char* error = parse_candump(text, line);
    EXPECT_NE(error, nullptr) << text;
  }
}

}  // namespace
}  // namespace clamber
