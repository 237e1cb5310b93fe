// What lies between the frames and the browser: rows that keep peaks, and a feed that no reader
// slows.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "web/live_feed.hpp"
#include "web/page.hpp"
#include "web/story.hpp"
#include "web/view_rows.hpp"

namespace clamber {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

TelemetryFrame frame(std::uint64_t tick, double torque) {
  TelemetryFrame f;
  f.sequence = tick;
  f.time = static_cast<double>(tick) * 1e-3;
  f.joint_count = 2;
  f.contact_count = 1;
  f.q = {0.25, 0.5};
  f.tau_meas = {torque, -torque};
  f.force_floor = {7.0};
  f.fault = tick > 30 ? 3 : 0;
  return f;
}

// Places in a row of two joints and a contact: times, phase, mode, fault, its joint, base, these.
constexpr std::size_t kFault = 4;
constexpr std::size_t kLow = 6 + 7 + 2;
constexpr std::size_t kHigh = kLow + 2;
constexpr std::size_t kFloor = kHigh + 2 + 1;

TEST(ViewRows, KeepTheExtremesOfTheirTwentyTicks) {
  ViewRows rows(2, 1);
  std::vector<std::vector<float>> made;
  for (std::uint64_t tick = 0; tick < 60; ++tick) {
    const double torque = tick == 27 ? 40.0 : tick == 31 ? -50.0 : 1.0;
    const auto row = rows.add(frame(tick, torque));
    if (!row.empty()) made.emplace_back(row.begin(), row.end());
  }
  ASSERT_THAT(made, SizeIs(2));
  ASSERT_THAT(made[1], SizeIs(rows.width()));
  EXPECT_FLOAT_EQ(made[0][0], 0.019F);
  EXPECT_FLOAT_EQ(made[0][kLow], 1.0F);
  EXPECT_FLOAT_EQ(made[0][kHigh], 1.0F);
  EXPECT_FLOAT_EQ(made[1][kLow], -50.0F);
  EXPECT_FLOAT_EQ(made[1][kLow + 1], -40.0F);
  EXPECT_FLOAT_EQ(made[1][kHigh], 40.0F);
  EXPECT_FLOAT_EQ(made[1][kHigh + 1], 50.0F);
  EXPECT_FLOAT_EQ(made[1][kFloor], 7.0F);
  EXPECT_FLOAT_EQ(made[0][kFault], 0.0F);
  EXPECT_FLOAT_EQ(made[1][kFault], 3.0F);
  EXPECT_FLOAT_EQ(rows.rest()[0], 0.059F);
}

TEST(ViewRows, CodeAsOthersDo) {
  const std::vector<float> numbers = {1.0F};  // 00 00 80 3f
  EXPECT_EQ(base64_of(numbers), "AACAPw==");
}

TEST(LiveFeed, GivesEveryReaderWhatItHasNotSeen) {
  LiveFeed feed(2);
  std::uint64_t one = 0;
  std::uint64_t two = 0;
  feed.push(std::vector<float>{1, 2});
  EXPECT_THAT(feed.read(one, 10, 0ms), ElementsAre(1, 2));
  feed.push(std::vector<float>{3, 4});
  EXPECT_THAT(feed.read(one, 10, 0ms), ElementsAre(3, 4));
  EXPECT_THAT(feed.read(two, 10, 0ms), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(feed.read(two, 10, 0ms), IsEmpty());
}

TEST(LiveFeed, LosesTheOldestForWhoIsTooSlow) {
  LiveFeed feed(1);
  for (std::size_t i = 0; i < LiveFeed::kRows + 5; ++i)
    feed.push(std::vector<float>{static_cast<float>(i)});
  std::uint64_t position = 0;
  EXPECT_THAT(feed.read(position, 2, 0ms), ElementsAre(5, 6));
  EXPECT_EQ(position, 7U);
  position = 1'000'000;  // of a server that ran longer
  EXPECT_THAT(feed.read(position, 1, 0ms), ElementsAre(5));
}

TEST(LiveFeed, WakesWhoWaits) {
  LiveFeed feed(1);
  std::uint64_t position = 0;
  std::thread writer([&] { feed.push(std::vector<float>{9}); });
  EXPECT_THAT(feed.read(position, 1, 10s), ElementsAre(9));
  writer.join();
  std::thread stopper([&] { feed.stop(); });
  EXPECT_THAT(feed.read(position, 1, 10s), IsEmpty());
  stopper.join();
  EXPECT_TRUE(feed.stopped());
}

TEST(Story, NamesPhasesAndTellsEvents) {
  TelemetryDescription names;
  names.phases = {{"reach", 1}, {"swing \"L\xff\"", 2}};
  names.modes = {"idle"};
  TelemetryEvent event;
  event.time = 1.5;
  event.kind = EventKind::kFault;
  event.severity = Severity::kError;
  event.append("tracking error");
  EXPECT_EQ(
      story_json(names, {event}),
      "{\"phases\":[\"reach\",\"swing \\\"L\xEF\xBF\xBD\\\"\"],\"modes\":[\"idle\"],\"faults\":[],"
      "\"events\":[{\"time\":1.5,\"kind\":1,\"severity\":2,\"joint\":-1,"
      "\"text\":\"tracking error\"}]}");
}

TEST(LiveStory, IsToldOnceToEachWhenItChanges) {
  LiveStory story;
  std::uint64_t one = 0;
  EXPECT_EQ(story.news(one), "");
  story.tell("a");
  story.tell("b");
  EXPECT_EQ(story.news(one), "b");
  EXPECT_EQ(story.news(one), "");
  std::uint64_t two = 0;
  EXPECT_EQ(story.news(two), "b");
}

TEST(WebPage, TakesARunWithoutLettingItOutOfItsPlace) {
  int left = 30;
  const std::string page =
      web_page_with_run({.name = "a \"name\" </script>",
                         .scene = R"({"robot":"</script><b>"})",
                         .story = R"({"phases":["</script><i>"]})",
                         .joints = 2,
                         .contacts = 1,
                         .next = [&](TelemetryFrame& f) {
                           f = frame(static_cast<std::uint64_t>(30 - left), 1.0);
                           return left-- > 0;
                         }});
  if (web_page().empty()) {
    EXPECT_TRUE(page.empty());
    return;
  }
  EXPECT_THAT(page, HasSubstr(R"("name":"a \"name\" \u003c/script>")"));
  EXPECT_THAT(page, HasSubstr(R"(\u003c/script>\u003cb>)"));
  EXPECT_THAT(page, HasSubstr(R"("story":{"phases":["\u003c/script>\u003ci>)"));
  EXPECT_THAT(page, HasSubstr("</script>\n</body>"));
}

}  // namespace
}  // namespace clamber
