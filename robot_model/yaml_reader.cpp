#include "robot_model/yaml_reader.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {

YamlNode::YamlNode(const YAML::Node& node, std::string file, std::string path)
    : node_(node), file_(std::move(file)), path_(std::move(path)) {}

YamlNode YamlNode::load(const std::filesystem::path& file) {
  return parse(read_file(file), file.string());
}

YamlNode YamlNode::parse(const std::string& text, const std::string& file) {
  try {
    YamlNode root(YAML::Load(text), file, "");
    if (!root.node_.IsMap()) {
      root.fail("expected a map of settings");
    }
    return root;
  } catch (const YAML::Exception& error) {
    throw InputError(file + ":" + std::to_string(error.mark.line + 1) +
                     ": not valid YAML: " + error.msg);
  }
}

std::string YamlNode::where() const {
  const int line = std::max(node_.Mark().line, 0) + 1;
  std::string place = file_ + ":" + std::to_string(line);
  if (!path_.empty()) {
    place += ": " + path_;
  }
  return place;
}

void YamlNode::fail(const std::string& message) const {
  throw InputError(where() + ": " + message);
}

void YamlNode::allow_only(std::initializer_list<std::string_view> keys) const {
  for (const auto& [key, value] : entries()) {
    if (std::find(keys.begin(), keys.end(), key) == keys.end()) {
      std::string expected;
      for (const std::string_view allowed : keys) {
        expected += (expected.empty() ? "" : ", ") + std::string(allowed);
      }
      value.fail("unknown key, expected one of: " + expected);
    }
  }
}

std::optional<YamlNode> YamlNode::find(const std::string& key) const {
  if (!node_.IsMap()) {
    fail("expected a map");
  }
  const YAML::Node child = node_[key];
  if (!child) {
    return std::nullopt;
  }
  return YamlNode(child, file_, path_.empty() ? key : path_ + "." + key);
}

YamlNode YamlNode::at(const std::string& key) const {
  std::optional<YamlNode> child = find(key);
  if (!child) {
    fail("missing key '" + key + "'");
  }
  return *child;
}

bool YamlNode::is_map() const { return node_.IsMap(); }

std::vector<YamlNode> YamlNode::items() const {
  if (!node_.IsSequence()) {
    fail("expected a list");
  }
  std::vector<YamlNode> result;
  for (std::size_t i = 0; i < node_.size(); ++i) {
    result.push_back(YamlNode(node_[i], file_, path_ + "[" + std::to_string(i) + "]"));
  }
  return result;
}

std::vector<std::pair<std::string, YamlNode>> YamlNode::entries() const {
  if (!node_.IsMap()) {
    fail("expected a map");
  }
  std::vector<std::pair<std::string, YamlNode>> result;
  std::set<std::string> seen;
  for (const auto& entry : node_) {
    const std::string key = YamlNode(entry.first, file_, path_).text();
    YamlNode value(entry.second, file_, path_.empty() ? key : path_ + "." + key);
    // yaml-cpp keeps both of two equal keys and answers with one of them: refuse instead.
    if (!seen.insert(key).second) {
      value.fail("key given twice");
    }
    result.emplace_back(key, std::move(value));
  }
  return result;
}

std::string YamlNode::text() const {
  if (!node_.IsScalar() || node_.Scalar().empty()) {
    fail("expected a text");
  }
  return node_.Scalar();
}

double YamlNode::number() const {
  double value = 0.0;
  if (!node_.IsScalar() || !YAML::convert<double>::decode(node_, value) || !std::isfinite(value)) {
    fail("expected a finite number" + (node_.IsScalar() ? ", got '" + node_.Scalar() + "'" : ""));
  }
  return value;
}

double YamlNode::positive() const {
  const double value = number();
  if (value <= 0.0) {
    fail("expected a number > 0, got " + node_.Scalar());
  }
  return value;
}

double YamlNode::non_negative() const {
  const double value = number();
  if (value < 0.0) {
    fail("expected a number >= 0, got " + node_.Scalar());
  }
  return value;
}

bool YamlNode::flag() const {
  bool value = false;
  if (!node_.IsScalar() || !YAML::convert<bool>::decode(node_, value)) {
    fail("expected true or false");
  }
  return value;
}

std::vector<std::string> YamlNode::texts() const {
  std::vector<std::string> result;
  for (const YamlNode& item : items()) {
    result.push_back(item.text());
  }
  return result;
}

}  // namespace clamber
