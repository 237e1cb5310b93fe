// Decoded lines: what a person reads for one frame of every kind.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "firmware_hal/candump.hpp"
#include "firmware_hal/frame_text.hpp"
#include "tests/firmware_hal/coman_map.hpp"

namespace clamber {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

CanFrame frame(const std::string& text) {
  CandumpLine line;
  EXPECT_EQ(parse_candump("(0.000000) can0 " + text, line), nullptr) << text;
  return line.frame;
}

struct Case {
  const char* frame;
  FrameKind kind;
  const char* text;
};

TEST(FrameText, Mit) {
  const BusMap map = test::shipped_map("coman_mit.yaml");
  for (const Case& c :
       {Case{"029##1FFFFFFFFFFFFFFFC", FrameKind::kSwitching, "RHipSag <- ENABLE"},
        Case{"029##1FFFFFFFFFFFFFFFD", FrameKind::kSwitching, "RHipSag <- DISABLE"},
        Case{"02A##1FFFFFFFFFFFFFFFE", FrameKind::kSwitching, "RHipLat <- SET ZERO"},
        Case{"029##1BFFFFFF000000FFF", FrameKind::kData,
             "RHipSag <- q 2.0000 rad  dq 10.000 rad/s  kp 0.0  kd 0.00  tau 54.00 N m"},
        Case{"429##119BFFFFFF000282D", FrameKind::kData,
             "RHipSag -> q 2.0000 rad  dq 10.000 rad/s  tau -54.00 N m  45 C  on"},
        Case{"429##1D9BFFFFFF000282D", FrameKind::kTrouble, "ERROR 13"},
        Case{"429#19BFFFFFF000282D", FrameKind::kMalformed, "RHipSag ->: wrong frame format"},
        Case{"429##119BFFFFFF000", FrameKind::kMalformed, "RHipSag ->: wrong length"},
        Case{"029##0FFFFFFFFFFFFFFFC", FrameKind::kMalformed, "RHipSag <-: wrong frame format"},
        Case{"123##100", FrameKind::kForeign, "foreign id"},
        Case{"20000040#0000000000000000", FrameKind::kTrouble, "error frame: bus-off"},
        Case{"20000004#0020000000000000", FrameKind::kTrouble, "error passive"}}) {
    const FrameText text = describe_frame(map.buses[0], frame(c.frame));
    EXPECT_EQ(text.kind, c.kind) << c.frame << ' ' << text.text;
    EXPECT_THAT(text.text, HasSubstr(c.text)) << c.frame;
  }
}

TEST(FrameText, Cia402) {
  const BusMap map = test::shipped_map("coman_cia402.yaml");
  for (const Case& c :
       {Case{"000#0129", FrameKind::kSwitching, "RHipSag <- START"},
        Case{"000#8000", FrameKind::kSwitching, "all <- PRE-OPERATIONAL"},
        Case{"080#", FrameKind::kData, "SYNC"},
        Case{"701#05", FrameKind::kData, "host is operational"},
        Case{"72A#00", FrameKind::kSwitching, "RHipLat is booted"},
        Case{"229#0F00E803", FrameKind::kData, "RHipSag <- control 0x000F  tau 20.00 N m"},
        Case{"1A9#370200000000F401", FrameKind::kData,
             "RHipSag -> q 0.0000 rad  tau 10.00 N m  operation enabled"},
        Case{"1A9#0802000000000000", FrameKind::kTrouble, "fault"},
        Case{"0A9#3081110000000000", FrameKind::kTrouble, "RHipSag EMERGENCY 0x8130 register 0x11"},
        Case{"629#2B17100014000000", FrameKind::kSwitching, "RHipSag <- write 1017:00 = 0x14"},
        Case{"5A9#8017100000000206", FrameKind::kTrouble, "ABORT 1017:00 code 0x06020000"},
        Case{"229#0F00", FrameKind::kMalformed, "RHipSag <-: wrong length"},
        Case{"000#01", FrameKind::kMalformed, "wrong length"},
        Case{"1A9##1370200000000F401", FrameKind::kMalformed, "wrong frame format"},
        Case{"203#00", FrameKind::kForeign, "node 3"}}) {
    const FrameText text = describe_frame(map.buses[0], frame(c.frame));
    EXPECT_EQ(text.kind, c.kind) << c.frame << ' ' << text.text;
    EXPECT_THAT(text.text, HasSubstr(c.text)) << c.frame;
  }
  EXPECT_EQ(describe_canopen(frame("229#0F00E803")).text, "node 41 <- RPDO1 0F 00 E8 03");
  EXPECT_THAT(describe_canopen(frame("729#05")).text, StartsWith("node 41 is operational"));
}

TEST(FrameText, Labels) {
  EXPECT_EQ(frame_label(frame("029##1FF")), "fd+ 029 [1]");
  EXPECT_EQ(frame_label(frame("029##0FF")), "fd  029 [1]");
  EXPECT_EQ(frame_label(frame("029#FF")), "can 029 [1]");
  EXPECT_EQ(frame_label(frame("00000029#R")), "can 00000029 [R]");
}

}  // namespace
}  // namespace clamber
