// One set of axes as SVG text: scales, ticks, curves, bands. The plots of plots.hpp are made of it.
// Off-line only: allocates; never blocks.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace clamber {

/// A rectangle of an SVG drawing that shows [x_low, x_high] x [y_low, y_high].
class SvgAxes {
 public:
  struct Frame {
    double left = 0.0, top = 0.0, width = 1.0, height = 1.0;  ///< px
  };
  struct Range {
    double low = 0.0, high = 1.0;
  };

  SvgAxes(const Frame& frame, Range x, Range y) : frame_(frame), x_(x), y_(y) {}

  [[nodiscard]] double px(double x) const;
  [[nodiscard]] double py(double y) const;
  [[nodiscard]] const Frame& frame() const { return frame_; }

  /// Frame, grid, tick labels and axis titles.
  [[nodiscard]] std::string axes(std::string_view title, std::string_view x_title,
                                 std::string_view y_title) const;
  /// A horizontal line over the whole width. `css` names its classes.
  [[nodiscard]] std::string level(double y, std::string_view css) const;
  /// The curve through (x, y), at most four points a pixel column: first, lowest, highest and
  /// last, so that no peak is lost. x must not decrease; values outside the range are cut off.
  [[nodiscard]] std::string curve(const std::vector<double>& x, const std::vector<double>& y,
                                  std::string_view css) const;

 private:
  Frame frame_;
  Range x_;
  Range y_;
};

/// About `count` round numbers in the range: 1, 2 or 5 times a power of ten apart.
[[nodiscard]] std::vector<double> round_ticks(SvgAxes::Range range, int count);

[[nodiscard]] std::string svg_text(double x, double y, std::string_view text, std::string_view css);
[[nodiscard]] std::string svg_rect(double x, double y, double width, double height,
                                   std::string_view css);
/// Opening tag with the styles (light and dark), a title for screen readers, and the closing tag.
[[nodiscard]] std::string svg_document(double width, double height, std::string_view title,
                                       const std::string& body);

}  // namespace clamber
