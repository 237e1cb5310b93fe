#include "report/report.hpp"

#include <algorithm>
#include <system_error>

#include "report/html_sections.hpp"
#include "report/image.hpp"
#include "report/pictures.hpp"
#include "report/plots.hpp"
#include "robot_model/loader.hpp"

namespace clamber {

namespace {

constexpr int kSheetColumns = 4;
constexpr int kSheetGap = 6;

void write_text(const std::filesystem::path& file, const std::string& text) {
  write_file(file, text.data(), text.size());
}

// Time labels are drawn into the sheet: on the README it stands alone.
void write_sheet(const std::vector<Picture>& pictures, const std::filesystem::path& file) {
  std::vector<Image> images;
  for (const Picture& picture : pictures) {
    images.push_back(picture.image);
    draw_time_label(images.back(), picture.time, 16, 16, 20, {40, 48, 60});
  }
  if (!images.empty()) {
    const auto png = encode_png(tile(images, kSheetColumns, kSheetGap, {255, 255, 255}));
    write_file(file, png.data(), png.size());
  }
}

}  // namespace

void write_report(const ReportInput& input, const std::filesystem::path& out_dir) {
  std::error_code error;
  std::filesystem::create_directories(out_dir, error);
  if (error) {
    throw InputError(out_dir.string() + ": cannot be made: " + error.message());
  }
  const RunData* playback = input.playback ? &*input.playback : nullptr;
  const ReportPictures pictures = draw_pictures(input.climb, playback);
  write_sheet(pictures.climb, out_dir / "climb.png");
  write_sheet(pictures.playback, out_dir / "playback.png");
  write_text(out_dir / "torque.svg", plot_torques(playback, input.climb));
  write_text(out_dir / "report.html", report_html(input, pictures));
}

}  // namespace clamber
