// The parsers of foreign bytes, each as one function that a fuzzer calls, with inputs to start
// from. One thread; allocates; writes scratch files where a parser reads files only.
#pragma once

#include <string>
#include <vector>

namespace clamber::fuzz {

struct Target {
  const char* name;
  /// Parses `bytes`; false when they are refused. Refusing them by InputError is the parser's
  /// right; any other exception leaves this function and is a finding, as is everything a sanitizer
  /// says.
  bool (*run)(const std::string& bytes);
  /// Good inputs, made from files of this project or by its own writers.
  std::vector<std::string> (*seeds)();
};

[[nodiscard]] const std::vector<Target>& targets();
/// @return nullptr: no such target
[[nodiscard]] const Target* find_target(const std::string& name);

}  // namespace clamber::fuzz
