#include "report/renderer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <functional>
#include <memory>

#include "report/run_data.hpp"
#include "tests/report/made_robot.hpp"

namespace clamber {
namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 240;

struct Hsv {
  double hue, saturation, value;  // degree, 0..1, 0..1
};

Hsv hsv(const std::uint8_t* p) {
  const double r = p[0] / 255.0, g = p[1] / 255.0, b = p[2] / 255.0;
  const double high = std::max({r, g, b}), low = std::min({r, g, b}), span = high - low;
  double hue = 0.0;
  if (span > 0.0) {
    hue = high == r   ? 60.0 * (g - b) / span
          : high == g ? 120.0 + 60.0 * (b - r) / span
                      : 240.0 + 60.0 * (r - g) / span;
  }
  return {hue < 0.0 ? hue + 360.0 : hue, high > 0.0 ? span / high : 0.0, high};
}

struct Blob {
  int pixels = 0;
  double x = 0.0, y = 0.0;  // centre
};

Blob find(const Image& image, const std::function<bool(const Hsv&)>& is_in) {
  Blob blob;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (is_in(hsv(image.pixel(x, y)))) {
        ++blob.pixels;
        blob.x += x;
        blob.y += y;
      }
    }
  }
  if (blob.pixels > 0) {
    blob.x /= blob.pixels;
    blob.y /= blob.pixels;
  }
  return blob;
}

bool blue(const Hsv& c) { return c.hue > 200 && c.hue < 225 && c.saturation > 0.5; }
bool orange_red(const Hsv& c) { return c.hue > 8 && c.hue < 40 && c.saturation > 0.75; }
bool wood(const Hsv& c) {
  return c.hue > 20 && c.hue < 40 && c.saturation > 0.25 && c.saturation < 0.65;
}
bool dark(const Hsv& c) { return c.value < 0.28; }
bool light(const Hsv& c) { return c.value > 0.75 && c.saturation < 0.15; }
bool green(const Hsv& c) { return c.hue > 125 && c.hue < 165 && c.saturation > 0.5; }

class Render : public testing::Test {
 protected:
  // A test machine without a display driver shows nothing about our pictures.
  static Renderer* renderer() {
    static const std::unique_ptr<Renderer> instance = []() -> std::unique_ptr<Renderer> {
      try {
        return std::make_unique<Renderer>(1);
      } catch (const RenderError&) {
        return nullptr;
      }
    }();
    return instance.get();
  }
  void SetUp() override {
    if (renderer() == nullptr) {
      GTEST_SKIP() << "skipped: no EGL on this machine";
    }
  }
  static Image draw(const RunData& run, const TelemetryFrame& frame, bool forces, View view) {
    Scene scene = make_scene(run.model, measured_configuration(frame), run.scenario);
    if (forces) {
      add_contact_forces(run.model, frame, scene);
    }
    return renderer()->render(scene, make_camera(run.scenario, run.model, view), kWidth, kHeight);
  }
};

TEST_F(Render, ShowsEveryColourGroup) {
  const RunData run = test::made_climb();
  const Image image = draw(run, run.frames[1500], false, View::kThreeQuarter);
  ASSERT_EQ(image.rgba.size(), 4u * kWidth * kHeight);
  EXPECT_GT(find(image, blue).pixels, 600);
  EXPECT_GT(find(image, orange_red).pixels, 100);
  EXPECT_GT(find(image, wood).pixels, 5000);
  EXPECT_GT(find(image, dark).pixels, 100);
  EXPECT_GT(find(image, light).pixels, 15000);
  EXPECT_EQ(find(image, green).pixels, 0);
}

TEST_F(Render, RobotMovesWithItsBaseAndTheBoxStays) {
  const RunData run = test::made_climb();
  TelemetryFrame moved = run.frames[0];
  moved.base_position[2] += 0.1;
  const Image before = draw(run, run.frames[0], false, View::kSide);
  const Image after = draw(run, moved, false, View::kSide);
  // The camera stands on the left, so that forward is to the left of the picture.
  EXPECT_LT(find(after, blue).y, find(before, blue).y - 10.0);
  EXPECT_NEAR(find(after, wood).y, find(before, wood).y, 3.0);
  moved = run.frames[0];
  moved.base_position[0] += 0.1;
  EXPECT_LT(find(draw(run, moved, false, View::kSide), blue).x, find(before, blue).x - 10.0);
}

TEST_F(Render, WholeRobotAndBoxAreInThePicture) {
  const RunData run = test::made_climb();
  for (const View view : {View::kThreeQuarter, View::kSide}) {
    const Image image = draw(run, run.frames[0], false, view);
    for (int x = 0; x < kWidth; ++x) {
      for (const int y : {0, kHeight - 1}) {
        const Hsv c = hsv(image.pixel(x, y));
        EXPECT_FALSE(blue(c) || dark(c) || orange_red(c)) << x << ' ' << y;
      }
    }
  }
}

TEST_F(Render, ForcesAreArrows) {
  const RunData run = test::made_climb();
  EXPECT_GT(find(draw(run, run.frames.back(), true, View::kThreeQuarter), green).pixels, 50);
}

TEST_F(Render, SameSceneGivesTheSamePictureAtAnySizeAskedBefore) {
  const RunData run = test::made_climb();
  const Image first = draw(run, run.frames[0], true, View::kThreeQuarter);
  Scene empty;
  (void)renderer()->render(empty, Camera{{2, 2, 1}, {0, 0, 0}, 0.5}, 64, 48);
  EXPECT_EQ(draw(run, run.frames[0], true, View::kThreeQuarter).rgba, first.rgba);
}

TEST(GeomColour, FollowsTheLimbs) {
  const RobotModel model = test::made_robot();
  const auto colour_of = [&model](const char* contact, int step) {
    return geom_colour(
        model, model.contacts[static_cast<std::size_t>(*model.find_contact(contact))].geom - step);
  };
  EXPECT_EQ(colour_of("Lwrist", 0).r, kContactPoint.r);
  const Rgb left = colour_of("Lelb", 1);  // forearm
  const Rgb right = colour_of("Relb", 1);
  EXPECT_GT(left.b, left.r);
  EXPECT_GT(right.r, right.b);
  EXPECT_EQ(geom_colour(model, 0).r, kPelvis.r);
  EXPECT_EQ(geom_colour(model, 1).r, kTrunk.r);
}

}  // namespace
}  // namespace clamber
