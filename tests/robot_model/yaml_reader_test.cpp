#include "robot_model/yaml_reader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(YamlReader, ReadsWhatIsThere) {
  const YamlNode root = YamlNode::parse("a: {x: 1.5, names: [p, q]}\non: true\n", "s.yaml");
  EXPECT_DOUBLE_EQ(root.at("a").at("x").positive(), 1.5);
  EXPECT_EQ(root.at("a").at("names").texts(), (std::vector<std::string>{"p", "q"}));
  EXPECT_TRUE(root.at("on").flag());
  EXPECT_FALSE(root.find("absent").has_value());
}

TEST(YamlReader, ComplaintsNameFileLineAndKey) {
  const YamlNode root =
      YamlNode::parse("a:\n  x: fast\n  y: -1\n  z: .nan\nlist: [1, 2]\n", "s.yaml");
  const YamlNode a = root.at("a");
  EXPECT_EQ(message_of([&] { (void)a.at("x").number(); }),
            "s.yaml:2: a.x: expected a finite number, got 'fast'");
  EXPECT_EQ(message_of([&] { (void)a.at("y").positive(); }),
            "s.yaml:3: a.y: expected a number > 0, got -1");
  EXPECT_EQ(message_of([&] { (void)a.at("z").number(); }),
            "s.yaml:4: a.z: expected a finite number, got '.nan'");
  EXPECT_EQ(message_of([&] {
              a.allow_only({"x", "y"});
            }),
            "s.yaml:4: a.z: unknown key, expected one of: x, y");
  EXPECT_EQ(message_of([&] { (void)a.at("w"); }), "s.yaml:2: a: missing key 'w'");
  EXPECT_EQ(message_of([&] { (void)root.at("list").items()[1].flag(); }),
            "s.yaml:5: list[1]: expected true or false");
}

TEST(YamlReader, RefusesRepeatedKeysAndBrokenText) {
  const YamlNode twice = YamlNode::parse("a: 1\nb: 2\na: 3\n", "s.yaml");
  EXPECT_EQ(message_of([&] { twice.allow_only({"a", "b"}); }), "s.yaml:3: a: key given twice");
  EXPECT_THAT(message_of([] { (void)YamlNode::parse("a: [1, 2\nb: 3\n", "s.yaml"); }),
              testing::StartsWith("s.yaml:2: not valid YAML"));
  EXPECT_THAT(message_of([] { (void)YamlNode::parse("", "s.yaml"); }),
              testing::HasSubstr("expected a map"));
}

}  // namespace
}  // namespace clamber
