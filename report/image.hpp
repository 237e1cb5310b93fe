// RGBA images: memory, PNG, tiling, time labels.
// Off-line only (report thread): allocates; file functions block.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace clamber {

struct Rgb {
  std::uint8_t r = 0, g = 0, b = 0;
};

/// 8-bit sRGB with alpha, rows from top to bottom, 4 bytes a pixel.
struct Image {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgba;

  Image() = default;
  Image(int width_px, int height_px, Rgb fill = {255, 255, 255});
  [[nodiscard]] std::uint8_t* pixel(int x, int y) { return rgba.data() + offset(x, y); }
  [[nodiscard]] const std::uint8_t* pixel(int x, int y) const { return rgba.data() + offset(x, y); }

 private:
  [[nodiscard]] std::size_t offset(int x, int y) const {
    return 4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                static_cast<std::size_t>(x));
  }
};

/// PNG bytes of the image (RGB: alpha is dropped). @throws std::runtime_error when libpng refuses.
[[nodiscard]] std::vector<std::uint8_t> encode_png(const Image& image);

/// Writes bytes to a file. @throws InputError naming the file when it cannot be written.
void write_file(const std::filesystem::path& file, const void* data, std::size_t size);

/// Base64 (RFC 4648, padded).
[[nodiscard]] std::string base64(const std::vector<std::uint8_t>& bytes);

/// Equal-sized images side by side, row by row, `gap` pixels of `background` between them.
[[nodiscard]] Image tile(const std::vector<Image>& images, int columns, int gap, Rgb background);

/// Draws "12.3 s" in seven-segment digits of `height` pixels, top left corner at (x, y).
void draw_time_label(Image& image, double seconds, double x, double y, double height, Rgb colour);

}  // namespace clamber
