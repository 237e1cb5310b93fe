#include "report/svg_plot.hpp"

#include <algorithm>
#include <cmath>

#include "report/markup.hpp"

namespace clamber {

namespace {

// Colours follow the pictures: left blue, right orange; elbows lighter than knees. Spelled out
// twice and without CSS variables, which picture viewers other than browsers do not know.
constexpr std::string_view kStyle = R"(<style>
.cp{font:12px system-ui,sans-serif}
.cp .grid,.cp .frame,.cp .limit,.cp .zero,.cp .curve{fill:none}
.cp .title{font-weight:600;font-size:13px}.cp .over{font-weight:600}.cp .small{font-size:11px}
.cp .mid{text-anchor:middle}.cp .end{text-anchor:end}
.cp .limit{stroke-dasharray:6 4;stroke-width:1.4}
.cp .curve{stroke-width:1.3;stroke-linejoin:round}
.cp .o1{opacity:.3}.cp .o2{opacity:.5}.cp .o3{opacity:.75}
.cp text{fill:#1f2733}.cp .soft{fill:#5b6675}.cp .grid{stroke:#e3e7ec}.cp .frame{stroke:#5b6675}.cp .zero{stroke:#5b6675}
.cp .limit{stroke:#c81e1e}.cp .over{fill:#c81e1e}.cp .bad{fill:#c81e1e}.cp .bad-line{stroke:#c81e1e}
.cp .c0{stroke:#1c5cba}.cp .c1{stroke:#d9541e}.cp .c2{stroke:#1f9fb5}.cp .c3{stroke:#c9930a}
.cp .b0{fill:#1c5cba}.cp .b1{fill:#d9541e}.cp .hold{fill:#16964c}.cp .hold-line{stroke:#16964c}
.cp .floor{fill:#8c3cbe}.cp .floor-line{stroke:#8c3cbe}
@media (prefers-color-scheme:dark){
.cp text{fill:#e6eaf0}.cp .soft{fill:#9aa5b4}.cp .grid{stroke:#333b47}.cp .frame{stroke:#9aa5b4}.cp .zero{stroke:#9aa5b4}
.cp .limit{stroke:#ff6b6b}.cp .over{fill:#ff6b6b}.cp .bad{fill:#ff6b6b}.cp .bad-line{stroke:#ff6b6b}
.cp .c0{stroke:#6ea8ff}.cp .c1{stroke:#ff9a5c}.cp .c2{stroke:#5fd3e6}.cp .c3{stroke:#f2c94c}
.cp .b0{fill:#6ea8ff}.cp .b1{fill:#ff9a5c}.cp .hold{fill:#4cd080}.cp .hold-line{stroke:#4cd080}
.cp .floor{fill:#c792ea}.cp .floor-line{stroke:#c792ea}}
</style>)";

int tick_digits(double step) {
  return std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9)));
}

std::string number(double value) { return fixed(value, 1); }

struct Point {
  double x, y;
};

// A pixel column's first, lowest, highest and last point, in the order they came.
void append_column(const std::vector<Point>& column, std::vector<Point>& out) {
  const auto by_y = [](const Point& a, const Point& b) { return a.y < b.y; };
  const auto [low, high] = std::minmax_element(column.begin(), column.end(), by_y);
  std::vector<std::vector<Point>::const_iterator> keep{column.begin(), low, high, column.end() - 1};
  std::sort(keep.begin(), keep.end());
  keep.erase(std::unique(keep.begin(), keep.end()), keep.end());
  for (const auto it : keep) {
    out.push_back(*it);
  }
}

}  // namespace

std::vector<double> round_ticks(SvgAxes::Range range, int count) {
  const double span = range.high - range.low;
  if (!(span > 0.0) || count < 1) {
    return {range.low};
  }
  const double rough = span / count;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10.0 * power;
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= rough) {
      step = factor * power;
      break;
    }
  }
  std::vector<double> ticks;
  const auto first = static_cast<long>(std::ceil(range.low / step - 1e-9));
  const auto last = static_cast<long>(std::floor(range.high / step + 1e-9));
  for (long k = first; k <= last; ++k) {
    ticks.push_back(static_cast<double>(k) * step);
  }
  return ticks;
}

double SvgAxes::px(double x) const {
  return frame_.left + (x - x_.low) / (x_.high - x_.low) * frame_.width;
}

double SvgAxes::py(double y) const {
  return frame_.top + (y_.high - y) / (y_.high - y_.low) * frame_.height;
}

std::string SvgAxes::axes(std::string_view title, std::string_view x_title,
                          std::string_view y_title) const {
  const double right = frame_.left + frame_.width;
  const double bottom = frame_.top + frame_.height;
  std::string out;
  const auto ticks_x = round_ticks(x_, static_cast<int>(frame_.width / 70.0));
  const double step_x = ticks_x.size() > 1 ? ticks_x[1] - ticks_x[0] : 1.0;
  for (const double x : ticks_x) {
    out += "<path class=\"grid\" d=\"M" + number(px(x)) + "," + number(frame_.top) + "V" +
           number(bottom) + "\"/>";
    out += svg_text(px(x), bottom + 15, fixed(x, tick_digits(step_x)), "mid small soft");
  }
  if (!y_title.empty()) {
    const auto ticks_y = round_ticks(y_, static_cast<int>(frame_.height / 34.0));
    const double step_y = ticks_y.size() > 1 ? ticks_y[1] - ticks_y[0] : 1.0;
    for (const double y : ticks_y) {
      out += "<path class=\"grid\" d=\"M" + number(frame_.left) + "," + number(py(y)) + "H" +
             number(right) + "\"/>";
      out += svg_text(frame_.left - 6, py(y) + 4, fixed(y, tick_digits(step_y)), "end small soft");
    }
    out += "<text class=\"mid soft\" transform=\"translate(" + number(frame_.left - 40) + "," +
           number(frame_.top + 0.5 * frame_.height) + ") rotate(-90)\">" + escape_markup(y_title) +
           "</text>";
  }
  out += svg_rect(frame_.left, frame_.top, frame_.width, frame_.height, "frame");
  out += svg_text(frame_.left, frame_.top - 9, title, "title");
  out += svg_text(frame_.left + 0.5 * frame_.width, bottom + 33, x_title, "mid soft");
  return out;
}

std::string SvgAxes::level(double y, std::string_view css) const {
  return "<path class=\"" + std::string(css) + "\" d=\"M" + number(frame_.left) + "," +
         number(py(y)) + "H" + number(frame_.left + frame_.width) + "\"/>";
}

std::string SvgAxes::curve(const std::vector<double>& x, const std::vector<double>& y,
                           std::string_view css) const {
  std::vector<Point> points;
  std::vector<Point> column;
  double column_x = 0.0;
  for (std::size_t i = 0; i < std::min(x.size(), y.size()); ++i) {
    if (!std::isfinite(y[i]) || x[i] < x_.low || x[i] > x_.high) {
      continue;
    }
    const Point p{px(x[i]), py(std::clamp(y[i], y_.low, y_.high))};
    if (!column.empty() && std::floor(p.x) != column_x) {
      append_column(column, points);
      column.clear();
    }
    column_x = std::floor(p.x);
    column.push_back(p);
  }
  if (!column.empty()) {
    append_column(column, points);
  }
  std::string d;
  double drawn = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    // Level stretches need their ends only. Against the last point drawn, so that drift adds up.
    const auto level = [&](std::size_t k) { return std::abs(points[k].y - drawn) < 0.05; };
    if (i > 0 && i + 1 < points.size() && level(i) && level(i + 1)) {
      continue;
    }
    drawn = points[i].y;
    d += d.empty() ? 'M' : 'L';
    d += number(points[i].x);
    d += ',';
    d += number(points[i].y);
  }
  return d.empty() ? d : "<path class=\"curve " + std::string(css) + "\" d=\"" + d + "\"/>";
}

std::string svg_text(double x, double y, std::string_view text, std::string_view css) {
  return "<text class=\"" + std::string(css) + "\" x=\"" + number(x) + "\" y=\"" + number(y) +
         "\">" + escape_markup(text) + "</text>";
}

std::string svg_rect(double x, double y, double width, double height, std::string_view css) {
  return "<rect class=\"" + std::string(css) + "\" x=\"" + number(x) + "\" y=\"" + number(y) +
         "\" width=\"" + number(width) + "\" height=\"" + number(height) + "\"/>";
}

std::string svg_document(double width, double height, std::string_view title,
                         const std::string& body) {
  // The namespace is a name, not an address: nothing is fetched.
  return "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"cp\" role=\"img\" viewBox=\"0 0 " +
         number(width) + " " + number(height) + "\"><title>" + escape_markup(title) + "</title>" +
         std::string(kStyle) + body + "</svg>\n";
}

}  // namespace clamber
