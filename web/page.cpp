#include "web/page.hpp"

#include <vector>

#include "web/view_rows.hpp"

namespace clamber {
namespace {

/// JSON inside a script element must not end it.
std::string inside_script(const std::string& json) {
  std::string out;
  out.reserve(json.size());
  for (const char c : json) {
    if (c == '<')
      out += "\\u003c";
    else
      out += c;
  }
  return out;
}

std::string json_text(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (static_cast<unsigned char>(c) >= 0x20) out += c;
  }
  return out + '"';
}

}  // namespace

std::string web_page_with_run(const PageRun& run) {
  const std::string_view page = web_page();
  const std::size_t place = page.find("</body>");
  if (place == std::string_view::npos) return {};
  ViewRows rows(run.joints, run.contacts);
  std::vector<float> numbers;
  const auto take = [&](std::span<const float> row) {
    numbers.insert(numbers.end(), row.begin(), row.end());
  };
  for (TelemetryFrame frame; run.next(frame);) take(rows.add(frame));
  take(rows.rest());

  std::string out(page.substr(0, place));
  out += "<script id=\"run\" type=\"application/json\">{\"name\":" +
         inside_script(json_text(run.name)) + ",\"scene\":" + inside_script(run.scene) +
         ",\"story\":" + inside_script(run.story) + ",\"layout\":" + rows.layout() +
         ",\"rows\":\"" + base64_of(numbers) + "\"}</script>\n";
  return out += page.substr(place);
}

}  // namespace clamber
