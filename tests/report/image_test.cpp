#include "report/image.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include "report/markup.hpp"
#include "report/run_data.hpp"
#include "robot_model/loader.hpp"
#include "tests/report/made_robot.hpp"

namespace clamber {
namespace {

std::vector<std::uint8_t> bytes(const std::string& text) { return {text.begin(), text.end()}; }

TEST(Base64, GivesTheStandardsVectors) {  // RFC 4648 section 10
  EXPECT_EQ(base64(bytes("")), "");
  EXPECT_EQ(base64(bytes("f")), "Zg==");
  EXPECT_EQ(base64(bytes("fo")), "Zm8=");
  EXPECT_EQ(base64(bytes("foo")), "Zm9v");
  EXPECT_EQ(base64(bytes("foobar")), "Zm9vYmFy");
  EXPECT_EQ(base64({0xFF, 0xFE, 0xFD}), "//79");
}

TEST(Png, ReadsBackPixelByPixel) {
  Image image(7, 5, {10, 20, 30});
  image.pixel(6, 4)[0] = 200;
  const auto encoded = encode_png(image);
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  ASSERT_NE(png_image_begin_read_from_memory(&png, encoded.data(), encoded.size()), 0);
  png.format = PNG_FORMAT_RGBA;
  ASSERT_EQ(png.width, 7u);
  ASSERT_EQ(png.height, 5u);
  std::vector<std::uint8_t> read(PNG_IMAGE_SIZE(png));
  ASSERT_NE(png_image_finish_read(&png, nullptr, read.data(), 0, nullptr), 0);
  EXPECT_EQ(read, image.rgba);
}

TEST(Tile, PutsImagesRowByRow) {
  const std::vector<Image> images{Image(4, 3, {1, 1, 1}), Image(4, 3, {2, 2, 2}),
                                  Image(4, 3, {3, 3, 3})};
  const Image sheet = tile(images, 2, 1, {9, 9, 9});
  ASSERT_EQ(sheet.width, 9);
  ASSERT_EQ(sheet.height, 7);
  EXPECT_EQ(sheet.pixel(0, 0)[0], 1);
  EXPECT_EQ(sheet.pixel(4, 0)[0], 9);
  EXPECT_EQ(sheet.pixel(5, 2)[0], 2);
  EXPECT_EQ(sheet.pixel(3, 4)[0], 3);
  EXPECT_EQ(sheet.pixel(5, 4)[0], 9);
}

TEST(TimeLabel, StaysInsideThePictureAndDiffersByTime) {
  Image a(80, 40);
  Image b(80, 40);
  draw_time_label(a, 12.3, 5, 5, 20, {0, 0, 0});
  draw_time_label(b, 12.4, 5, 5, 20, {0, 0, 0});
  EXPECT_NE(a.rgba, b.rgba);
  EXPECT_NE(a.rgba, Image(80, 40).rgba);
  Image tiny(3, 3);
  draw_time_label(tiny, 99.9, -10, 2, 40, {0, 0, 0});  // must not write outside
}

TEST(Markup, EscapesAndFormats) {
  EXPECT_EQ(escape_markup("<a href=\"x\">&'\x01"), "&lt;a href=&quot;x&quot;&gt;&amp;&#39; ");
  EXPECT_EQ(fixed(-0.04, 1), "0.0");
  EXPECT_EQ(fixed(-12.345, 2), "-12.35");
  EXPECT_EQ(fixed(std::nan(""), 2), "-");
}

TEST(WriteFile, NamesTheFileItCannotWrite) {
  try {
    write_file("/nonexistent/dir/file", "x", 1);
    FAIL() << "nothing thrown";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("/nonexistent/dir/file"));
  }
}

TEST(PickMoments, SkipsPausesAndKeepsBothEnds) {
  const RunData run = test::made_climb();  // the robot moves from 0.5 s to 2 s and after 3 s
  const auto moments = pick_moments(run.frames, 8);
  ASSERT_EQ(moments.size(), 8u);
  EXPECT_EQ(moments.front(), 0u);
  EXPECT_EQ(moments.back(), 3999u);
  int moving = 0;
  for (std::size_t i = 1; i + 1 < moments.size(); ++i) {
    const double t = run.frames[moments[i]].time;
    EXPECT_GT(moments[i], moments[i - 1]);
    moving += (t > 0.5 && t < 2.2) || t > 3.0;
  }
  EXPECT_EQ(moving, 6);
  EXPECT_TRUE(pick_moments({}, 8).empty());
}

}  // namespace
}  // namespace clamber
