// Strict reading of YAML settings: every complaint carries file, line and key path.
// Any thread; allocates: yes; blocks: YamlNode::load reads a file. Start-up and tools only.
#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace clamber {

/// A node of a YAML document that knows where it stands. All members throw InputError
/// "<file>:<line>: <key path>: <what is wrong and what was expected>".
class YamlNode {
 public:
  /// The root of a file, which must be a map.
  [[nodiscard]] static YamlNode load(const std::filesystem::path& file);
  /// The same from text already read; `file` is used in messages only.
  [[nodiscard]] static YamlNode parse(const std::string& text, const std::string& file);

  /// Refuses every key of this map that is not listed.
  void allow_only(std::initializer_list<std::string_view> keys) const;

  [[nodiscard]] YamlNode at(const std::string& key) const;                   ///< required key
  [[nodiscard]] std::optional<YamlNode> find(const std::string& key) const;  ///< optional key
  [[nodiscard]] bool is_map() const;                  ///< for keys that take a scalar or a map
  [[nodiscard]] std::vector<YamlNode> items() const;  ///< of a list
  [[nodiscard]] std::vector<std::pair<std::string, YamlNode>> entries() const;  ///< of a map

  [[nodiscard]] std::string text() const;                ///< a non-empty scalar
  [[nodiscard]] double number() const;                   ///< a finite number
  [[nodiscard]] double positive() const;                 ///< a finite number > 0
  [[nodiscard]] double non_negative() const;             ///< a finite number >= 0
  [[nodiscard]] bool flag() const;                       ///< true or false
  [[nodiscard]] std::vector<std::string> texts() const;  ///< a list of non-empty scalars

  /// "<file>:<line>: <key path>": for messages about what this node caused elsewhere.
  [[nodiscard]] std::string where() const;
  [[noreturn]] void fail(const std::string& message) const;

 private:
  YamlNode(const YAML::Node& node, std::string file, std::string path);

  YAML::Node node_;
  std::string file_;
  std::string path_;
};

}  // namespace clamber
