// A short, seeded slice of fuzzing with any compiler: mutated seeds must be parsed or refused.
// CLAMBER_FUZZ_SECONDS makes it a campaign: that long per parser instead of kRuns mutations.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <random>

#include "tests/fuzz/target.hpp"

namespace clamber::fuzz {
namespace {

constexpr std::size_t kRuns = 400;
constexpr std::size_t kLongest = 1 << 16;

class Mutator {
 public:
  Mutator(std::vector<std::string> seeds, std::uint64_t seed)
      : seeds_(std::move(seeds)), random_(seed) {}

  [[nodiscard]] std::string next() {
    std::string bytes = seeds_[below(seeds_.size())];
    for (std::size_t edits = 1 + below(4); edits > 0; --edits) {
      edit(bytes);
    }
    bytes.resize(std::min(bytes.size(), kLongest));
    return bytes;
  }

 private:
  /// 0 .. count - 1, the same on every platform; 0 when count is 0.
  std::size_t below(std::size_t count) { return count == 0 ? 0 : random_() % count; }

  void edit(std::string& bytes) {
    static const std::vector<std::string> kWords{
        "nan", "inf",      "-inf", "-1", "0",  "1e308", "1e-320", "99999999999999999999",
        "",    "<",        ">",    "/>", "\"", "'",     "[",      "]",
        "{",   "}",        ":",    ",",  "\n", "#",     "&#0;",   "*a",
        "&a",  "!!binary", "null"};
    const std::size_t at = below(bytes.size());
    const std::size_t length = std::min(below(64), bytes.size() - at);
    switch (below(8)) {
      case 0:
        if (!bytes.empty()) bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
        break;
      case 1:
        if (!bytes.empty()) bytes[at] = static_cast<char>(below(256));
        break;
      case 2:
        bytes.erase(at, length);
        break;
      case 3:
        bytes.insert(at, bytes.substr(below(bytes.size()), length));
        break;
      case 4:
        bytes.insert(at, kWords[below(kWords.size())]);
        break;
      case 5:
        replace_word(bytes, at, kWords[below(kWords.size())]);
        break;
      case 6:
        bytes.resize(at);
        break;
      default: {
        const std::string& other = seeds_[below(seeds_.size())];
        bytes = bytes.substr(0, at) + other.substr(below(other.size()));
      }
    }
  }

  /// Replaces the number or name round `at`.
  static void replace_word(std::string& bytes, std::size_t at, const std::string& word) {
    const auto part = [&](std::size_t i) {
      const auto c = static_cast<unsigned char>(bytes[i]);
      return std::isalnum(c) != 0 || c == '.' || c == '-' || c == '_';
    };
    std::size_t first = at;
    std::size_t last = at;
    while (first > 0 && part(first - 1)) --first;
    while (last < bytes.size() && part(last)) ++last;
    bytes.replace(first, last - first, word);
  }

  std::vector<std::string> seeds_;
  std::mt19937_64 random_;
};

class Slice : public testing::TestWithParam<Target> {};

TEST_P(Slice, TakesItsSeeds) {
  for (const std::string& seed : GetParam().seeds()) {
    EXPECT_TRUE(GetParam().run(seed));
  }
}

TEST_P(Slice, ParsesOrRefusesMutations) {
  using Clock = std::chrono::steady_clock;
  const char* seconds = std::getenv("CLAMBER_FUZZ_SECONDS");
  const auto end = Clock::now() + std::chrono::seconds(seconds == nullptr ? 0 : std::atoi(seconds));
  const char* seed = std::getenv("CLAMBER_FUZZ_SEED");
  Mutator mutator(GetParam().seeds(), seed == nullptr ? 1u : std::strtoull(seed, nullptr, 10));
  std::size_t runs = 0;
  for (; seconds == nullptr ? runs < kRuns : Clock::now() < end; ++runs) {
    const std::string bytes = mutator.next();
    try {
      (void)GetParam().run(bytes);
    } catch (const std::exception& error) {
      FAIL() << "mutation " << runs << ": " << error.what() << "\n" << bytes.substr(0, 4000);
    }
  }
  RecordProperty("runs", static_cast<int>(runs));
  std::printf("%s: %zu runs\n", GetParam().name, runs);
}

TEST_P(Slice, RefusesEmptyAndDeeplyNestedInput) {
  constexpr int kDepth = 100000;
  const auto repeated = [](const std::string& text) {
    std::string all;
    for (int i = 0; i < kDepth; ++i) all += text;
    return all;
  };
  for (const std::string& bytes :
       {std::string(), repeated("["), repeated("{\"a\":"), repeated("<a>"), repeated("- "),
        repeated("<a>") + repeated("</a>"), repeated("[") + repeated("]")}) {
    EXPECT_FALSE(GetParam().run(bytes)) << bytes.substr(0, 20);
  }
}

INSTANTIATE_TEST_SUITE_P(Parsers, Slice, testing::ValuesIn(targets()),
                         [](const auto& target) { return std::string(target.param.name); });

}  // namespace
}  // namespace clamber::fuzz
