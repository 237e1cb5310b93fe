#include "deploy/ustar.hpp"

#include <algorithm>
#include <cstdio>
#include <cstring>

namespace clamber {
namespace {

// POSIX.1-2017, pax, "ustar Interchange Format": offset and length of the fields in use.
struct Field {
  std::size_t at;
  std::size_t length;
};
constexpr Field kName{0, 100}, kMode{100, 8}, kUser{108, 8}, kGroup{116, 8}, kSize{124, 12},
    kTime{136, 12}, kChecksum{148, 8}, kType{156, 1}, kMagic{257, 8}, kMajor{329, 8},
    kMinor{337, 8};

void put_octal(UstarHeader& header, Field field, std::uint64_t value) {
  std::array<char, 32> text{};
  const int digits = static_cast<int>(field.length) - 1;
  std::snprintf(text.data(), text.size(), "%0*llo", digits, static_cast<unsigned long long>(value));
  std::memcpy(&header[field.at], text.data(), field.length);
}

const char* kind_of(char type) {
  switch (type) {
    case '1':
      return "a hard link";
    case '2':
      return "a symbolic link";
    case '3':
    case '4':
      return "a device";
    case '5':
      return "a folder";
    case '6':
      return "a FIFO";
    case '0':
    case '\0':
      return "a file";
    default:
      return "an entry of an unknown kind";
  }
}

}  // namespace

UstarHeader ustar_header(std::string_view path, std::uint64_t size, bool executable,
                         std::uint64_t time) {
  UstarHeader header{};
  std::memcpy(&header[kName.at], path.data(), std::min(path.size(), kName.length - 1));
  put_octal(header, kMode, executable ? 0755 : 0644);
  put_octal(header, kUser, 0);
  put_octal(header, kGroup, 0);
  put_octal(header, kSize, size);
  put_octal(header, kTime, time);
  header[kType.at] = '0';
  std::memcpy(&header[kMagic.at],
              "ustar\0"
              "00",
              kMagic.length);
  put_octal(header, kMajor, 0);
  put_octal(header, kMinor, 0);
  // The sum is taken with its own field full of blanks.
  std::fill_n(&header[kChecksum.at], kChecksum.length, ' ');
  unsigned sum = 0;
  for (const char c : header) sum += static_cast<unsigned char>(c);
  std::snprintf(&header[kChecksum.at], kChecksum.length - 1, "%06o", sum);
  return header;
}

std::uint64_t ustar_size(const UstarHeader& header) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i + 1 < kSize.length; ++i) {
    const char digit = header[kSize.at + i];
    if (digit < '0' || digit > '7') return ~std::uint64_t{0};
    value = 8 * value + static_cast<std::uint64_t>(digit - '0');
  }
  return value;
}

std::string describe_foreign(const UstarHeader& header) {
  if (std::all_of(header.begin(), header.end(), [](char c) { return c == '\0'; }))
    return "the archive's end";
  if (std::memcmp(&header[kMagic.at], "ustar", 5) != 0) return "no archive entry";
  std::string name(&header[kName.at], strnlen(&header[kName.at], kName.length));
  for (char& c : name)
    if (c < ' ' || c > '~') c = '?';
  return std::string(kind_of(header[kType.at])) + " '" + name + "'";
}

}  // namespace clamber
