#include "report/image.hpp"

#include <png.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string_view>

#include "report/markup.hpp"
#include "robot_model/loader.hpp"

namespace clamber {

Image::Image(int width_px, int height_px, Rgb fill)
    : width(width_px),
      height(height_px),
      rgba(4 * static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px)) {
  for (std::size_t i = 0; i < rgba.size(); i += 4) {
    rgba[i] = fill.r;
    rgba[i + 1] = fill.g;
    rgba[i + 2] = fill.b;
    rgba[i + 3] = 255;
  }
}

std::vector<std::uint8_t> encode_png(const Image& image) {
  // The simplified API takes a whole buffer and needs no setjmp.
  std::vector<std::uint8_t> rgb;
  rgb.reserve(image.rgba.size() / 4 * 3);
  for (std::size_t i = 0; i < image.rgba.size(); i += 4) {
    rgb.insert(rgb.end(), {image.rgba[i], image.rgba[i + 1], image.rgba[i + 2]});
  }
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
  std::vector<std::uint8_t> bytes(size);
  if (png_image_write_to_memory(&png, bytes.data(), &size, 0, rgb.data(), 0, nullptr) == 0) {
    throw std::runtime_error(std::string("PNG encoding failed: ") + png.message);
  }
  bytes.resize(size);
  return bytes;
}

void write_file(const std::filesystem::path& file, const void* data, std::size_t size) {
  std::ofstream out(file, std::ios::binary);
  out.write(static_cast<const char*>(data), static_cast<std::streamsize>(size));
  out.close();
  if (!out) {
    throw InputError(file.string() + ": cannot be written");
  }
}

std::string base64(const std::vector<std::uint8_t>& bytes) {
  constexpr std::string_view kAlphabet =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t left = bytes.size() - i;
    const std::uint32_t group = (std::uint32_t{bytes[i]} << 16) |
                                (left > 1 ? std::uint32_t{bytes[i + 1]} << 8 : 0u) |
                                (left > 2 ? std::uint32_t{bytes[i + 2]} : 0u);
    text += kAlphabet[(group >> 18) & 63];
    text += kAlphabet[(group >> 12) & 63];
    text += left > 1 ? kAlphabet[(group >> 6) & 63] : '=';
    text += left > 2 ? kAlphabet[group & 63] : '=';
  }
  return text;
}

Image tile(const std::vector<Image>& images, int columns, int gap, Rgb background) {
  if (images.empty() || columns < 1) {
    return {};
  }
  const int count = static_cast<int>(images.size());
  columns = std::min(columns, count);
  const int rows = (count + columns - 1) / columns;
  const int w = images.front().width;
  const int h = images.front().height;
  Image sheet(columns * w + (columns - 1) * gap, rows * h + (rows - 1) * gap, background);
  for (int i = 0; i < count; ++i) {
    const Image& image = images[static_cast<std::size_t>(i)];
    if (image.width != w || image.height != h) {
      throw std::invalid_argument("tile: images differ in size");
    }
    for (int row = 0; row < h; ++row) {
      std::memcpy(sheet.pixel((i % columns) * (w + gap), (i / columns) * (h + gap) + row),
                  image.pixel(0, row), 4 * static_cast<std::size_t>(w));
    }
  }
  return sheet;
}

namespace {

struct Stroke {
  double x0, y0, x1, y1;
};

// Segments a..g of a seven-segment digit in a 1 (wide) x 2 (high) cell, y down.
constexpr std::array<Stroke, 7> kSegments{{{0, 0, 1, 0},
                                           {1, 0, 1, 1},
                                           {1, 1, 1, 2},
                                           {0, 2, 1, 2},
                                           {0, 1, 0, 2},
                                           {0, 0, 0, 1},
                                           {0, 1, 1, 1}}};
constexpr std::array<unsigned, 10> kDigitSegments{0x3F, 0x06, 0x5B, 0x4F, 0x66,
                                                  0x6D, 0x7D, 0x07, 0x7F, 0x6F};

double distance_to(const Stroke& s, double x, double y) {
  const double dx = s.x1 - s.x0;
  const double dy = s.y1 - s.y0;
  const double length2 = dx * dx + dy * dy;
  const double t =
      length2 > 0.0 ? std::clamp(((x - s.x0) * dx + (y - s.y0) * dy) / length2, 0.0, 1.0) : 0.0;
  return std::hypot(x - s.x0 - t * dx, y - s.y0 - t * dy);
}

void draw_stroke(Image& image, const Stroke& s, double half_width, Rgb colour) {
  const int x_begin = std::max(0, static_cast<int>(std::min(s.x0, s.x1) - half_width - 1));
  const int x_end = std::min(image.width, static_cast<int>(std::max(s.x0, s.x1) + half_width + 2));
  const int y_begin = std::max(0, static_cast<int>(std::min(s.y0, s.y1) - half_width - 1));
  const int y_end = std::min(image.height, static_cast<int>(std::max(s.y0, s.y1) + half_width + 2));
  const std::array<std::uint8_t, 3> rgb{colour.r, colour.g, colour.b};
  for (int y = y_begin; y < y_end; ++y) {
    for (int x = x_begin; x < x_end; ++x) {
      const double cover =
          std::clamp(half_width + 0.5 - distance_to(s, x + 0.5, y + 0.5), 0.0, 1.0);
      std::uint8_t* p = image.pixel(x, y);
      for (std::size_t c = 0; c < 3; ++c) {
        p[c] = static_cast<std::uint8_t>(std::lround(p[c] + cover * (rgb[c] - p[c])));
      }
    }
  }
}

void draw_segments(Image& image, unsigned segments, double x, double y, double cell, double half,
                   Rgb colour) {
  for (std::size_t i = 0; i < kSegments.size(); ++i) {
    if ((segments >> i) & 1u) {
      const Stroke& s = kSegments[i];
      draw_stroke(image, {x + s.x0 * cell, y + s.y0 * cell, x + s.x1 * cell, y + s.y1 * cell}, half,
                  colour);
    }
  }
}

}  // namespace

void draw_time_label(Image& image, double seconds, double x, double y, double height, Rgb colour) {
  const double half = height * 0.055;
  const double cell = (height - 2 * half) / 2;
  const double advance = cell * 1.75;
  x += half;
  y += half;
  for (const char c : fixed(seconds, 1)) {
    if (c == '.') {
      draw_stroke(image, {x - 0.1 * cell, y + 2 * cell, x - 0.1 * cell, y + 2 * cell}, half * 1.3,
                  colour);
      x += 0.5 * cell;
    } else if (c == '-') {
      draw_segments(image, 0x40, x, y, cell, half, colour);
      x += advance;
    } else if (c >= '0' && c <= '9') {
      draw_segments(image, kDigitSegments[static_cast<std::size_t>(c - '0')], x, y, cell, half,
                    colour);
      x += advance;
    }
  }
  // The unit: a small "s", which is the digit 5 at the size of a lower-case letter.
  const double small = cell * 0.6;
  draw_segments(image, kDigitSegments[5], x + 0.3 * cell, y + 2 * cell - 2 * small, small, half,
                colour);
}

}  // namespace clamber
