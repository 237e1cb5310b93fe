// The text of report.html, section by section.
// Off-line only: allocates; never blocks.
#pragma once

#include <string>

#include "report/pictures.hpp"
#include "report/report.hpp"

namespace clamber {

/// The whole page: inline styles and plots, pictures as data; nothing is fetched from anywhere.
[[nodiscard]] std::string report_html(const ReportInput& input, const ReportPictures& pictures);

}  // namespace clamber
