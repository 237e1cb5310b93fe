#include "report/html_sections.hpp"

#include <algorithm>

#include "report/markup.hpp"
#include "report/peaks.hpp"
#include "report/plots.hpp"

namespace clamber {

namespace {

constexpr const char* kStyle = R"(<style>
:root{color-scheme:light dark;--page:#fff;--ink:#1f2733;--soft:#5b6675;--line:#e0e4ea;--card:#f6f8fa;
--good:#12803f;--bad:#c81e1e;--warn:#8a5a00}
@media (prefers-color-scheme:dark){:root{--page:#12161c;--ink:#e6eaf0;--soft:#9aa5b4;--line:#2c3440;
--card:#1a2029;--good:#4cd080;--bad:#ff6b6b;--warn:#f2c94c}}
body{margin:0;background:var(--page);color:var(--ink);font:16px/1.55 system-ui,sans-serif}
main{max-width:1100px;margin:0 auto;padding:32px 20px 80px}
h1{font-size:30px;line-height:1.2;margin:0 0 6px}h2{font-size:21px;margin:52px 0 10px}
p{max-width:75ch}.soft{color:var(--soft)}.good{color:var(--good)}.bad{color:var(--bad)}
.tag{display:inline-block;border:1px solid var(--warn);color:var(--warn);border-radius:4px;
padding:0 8px;font-size:14px;font-weight:600}
.figures{display:grid;grid-template-columns:repeat(auto-fit,minmax(190px,1fr));gap:12px;margin:24px 0}
.figures div{background:var(--card);border-radius:8px;padding:12px 16px}
.figures div:first-child{grid-column:span 2}.figures b{display:block;font-size:20px;line-height:1.35}
.end{max-width:680px;margin-top:10px}
.scroll{overflow-x:auto}table{border-collapse:collapse;font-size:15px}
th,td{text-align:left;padding:5px 16px 5px 0;border-bottom:1px solid var(--line);vertical-align:top}
th{font-weight:600}td.num,th.num{text-align:right;font-variant-numeric:tabular-nums}
.states td,.states th{text-align:center;padding:3px 16px;border-left:1px solid var(--line)}
.states tr.s td{border-top:2px solid var(--soft);font-weight:600}
.strip{display:grid;grid-template-columns:repeat(4,1fr);gap:10px}
@media (max-width:800px){.strip{grid-template-columns:repeat(2,1fr)}}
figure{margin:0}img{width:100%;height:auto;border-radius:6px;display:block}
figcaption{font-size:14px;color:var(--soft);font-variant-numeric:tabular-nums;padding:3px 2px}
svg{width:100%;height:auto;margin-top:8px}code{font-size:14px;overflow-wrap:anywhere}
</style>)";

std::string heading(const std::string& text) { return "<h2>" + escape_markup(text) + "</h2>\n"; }

std::string paragraph(const std::string& text, const std::string& css = "") {
  return "<p" + (css.empty() ? "" : " class=\"" + css + "\"") + ">" + escape_markup(text) +
         "</p>\n";
}

std::string list_names(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) {
    text += (text.empty() ? "" : ", ") + name;
  }
  return text.empty() ? "none" : text;
}

std::string value_table(const NamedValues& values) {
  std::string out = "<div class=\"scroll\"><table>\n";
  for (const auto& [name, value] : values) {
    out += "<tr><th>" + escape_markup(name) + "</th><td>" + escape_markup(value) + "</td></tr>\n";
  }
  return out + "</table></div>\n";
}

std::string peak_text(const std::optional<TorquePeak>& peak) {
  return peak ? fixed(peak->value, 1) + " N m at " + peak->joint : "not measured";
}

std::string figure_box(const std::string& value, const std::string& meaning) {
  return "<div><b>" + escape_markup(value) + "</b><span class=\"soft\">" + escape_markup(meaning) +
         "</span></div>\n";
}

std::string verdict(const ReportInput& input) {
  const Summary& s = input.summary;
  std::string out = "<h1 class=\"" + std::string(s.success ? "good" : "bad") + "\">" +
                    escape_markup(input.plan.robot.empty() ? "The robot" : input.plan.robot) +
                    (s.success ? " is " : " is not ") + escape_markup(s.outcome) + " the " +
                    fixed(s.obstacle_height, 3) + " m obstacle</h1>\n";
  if (s.synthetic_recording || input.plan.synthetic_recording) {
    out +=
        "<span class=\"tag\">SYNTHETIC demonstration: made by a tool, not recorded from a "
        "person</span>\n";
  }
  out += "<div class=\"figures\">\n";
  out += figure_box(list_names(s.judge.final_contacts), "on top of the obstacle at the end");
  out += figure_box(list_names(s.judge.floor_contacts), "on the floor at the end");
  out += figure_box(fixed(100.0 * s.judge.weight_on_obstacle, 1) + " %",
                    "of the weight on the obstacle");
  out += figure_box(list_names(s.judge.forbidden_contacts), "forbidden links in contact");
  out += figure_box(fixed(1000.0 * s.judge.rest_speed, 1) + " mm/s", "fastest link at rest");
  out += figure_box(peak_text(s.peak_plan), "largest torque of the climb");
  out += figure_box(peak_text(s.peak_after_hands), "largest torque once the hands carry");
  out += figure_box(peak_text(s.peak_playback), "largest torque of the direct playback");
  out += "</div>\n";
  return out + paragraph(
                   "The judge reads the simulator's contact forces at the end of the run. It "
                   "knows nothing of the plan.",
                   "soft");
}

std::string planned(const ReportInput& input) {
  const Plan& plan = input.plan;
  const double duration = plan.keyframes.empty() ? 0.0 : plan.keyframes.back().time;
  NamedValues rows{
      {"Robot",
       plan.robot + ", " + std::to_string(input.climb.model.joints.size()) + " joints, " +
           fixed(input.climb.model.total_mass, 2) + " kg" +
           (plan.ballast_mass > 0.0 ? ", of which ballast " + fixed(plan.ballast_mass, 2) + " kg"
                                    : std::string())},
      {"Scenario", plan.scenario + ", obstacle " + fixed(plan.obstacle_height, 3) +
                       " m high, friction " + fixed(plan.friction, 2)},
      {"Recording",
       plan.recording + (plan.synthetic_recording ? " (SYNTHETIC demonstration)" : "")},
      {"Plan", std::to_string(plan.keyframes.size()) + " keyframes in " +
                   std::to_string(plan.phases.size()) + " phases, " + fixed(duration, 1) + " s"},
      {"Execution", std::string("joint PID at 1 kHz ") +
                        (input.summary.feed_forward ? "with planned feed-forward torques"
                                                    : "alone, without feed-forward") +
                        ", simulated " + fixed(input.summary.real_time_factor, 1) +
                        " times faster than real time"}};
  return heading("What was planned") + value_table(rows);
}

// Rows of links, a column a state; a link keeps its row as in the paper's tables.
std::string contact_table(const ContactTable& states) {
  if (states.empty()) {
    return paragraph("No state was found.", "soft");
  }
  std::vector<std::string> links;
  for (const ContactTableState& state : states) {
    for (const std::string& link : state.links) {
      if (std::find(links.begin(), links.end(), link) == links.end()) {
        links.push_back(link);
      }
    }
  }
  std::string out = "<div class=\"scroll\"><table class=\"states\">\n<tr>";
  for (const ContactTableState& state : states) {
    out += "<th>" + escape_markup(state.name) + "</th>";
  }
  out += "</tr>\n";
  for (const std::string& link : links) {
    out += "<tr>";
    for (const ContactTableState& state : states) {
      const bool active =
          std::find(state.links.begin(), state.links.end(), link) != state.links.end();
      out += "<td>" + (active ? escape_markup(link) : std::string()) + "</td>";
    }
    out += "</tr>\n";
  }
  out += "<tr class=\"s\">";
  for (const ContactTableState& state : states) {
    out += std::string("<td>s ") + (state.s > 0.0 ? "&gt; 0" : "= 0") + "</td>";
  }
  return out + "</tr>\n</table></div>\n";
}

std::string contact_tables(const ReportInput& input) {
  return heading("Contact sequence") +
         paragraph(
             "Found in the playback, every state in order. s = 0: the links in contact "
             "support the robot fully.") +
         contact_table(input.contacts) +
         paragraph(
             "Reduced to the states with absolute stability, "
             "which is what the planner follows:") +
         contact_table(input.reduced_contacts);
}

std::string notes(const ReportInput& input) {
  if (input.plan.notes.empty()) {
    return {};
  }
  std::string out = heading("Planner's notes") + "<ul>\n";
  for (const std::string& note : input.plan.notes) {
    out += "<li>" + escape_markup(note) + "</li>\n";
  }
  return out + "</ul>\n";
}

std::string list_of(const std::string& title, const std::vector<std::string>& items) {
  std::string out = "<p>" + title + "</p><ul>\n";
  for (const std::string& item : items) {
    out += "<li>" + escape_markup(item) + "</li>\n";
  }
  return items.empty() ? "" : out + "</ul>\n";
}

// Millimetres and milliradians read better than 0.00xxx.
std::string figure(double value, const std::string& unit) {
  const bool small = unit == "m" || unit == "rad";
  return fixed(small ? 1e3 * value : value, small ? 1 : 3);
}

std::string margins(const ReportInput& input) {
  const CertificateTable& certificate = input.certificate;
  if (certificate.samples == 0) {
    return {};
  }
  std::string out =
      heading("Certificate") +
      paragraph("The plan was checked at " + std::to_string(certificate.samples) +
                " moments, at most 10 ms apart, by a verifier that shares nothing with the "
                "planner but the robot model. It is " +
                (certificate.valid ? "valid." : "refused.")) +
      "<div class=\"scroll\"><table>\n<tr><th>Quantity</th><th>unit</th>"
      "<th class=\"num\">worst</th><th class=\"num\">between samples</th>"
      "<th class=\"num\">limit</th><th class=\"num\">at, s</th><th>phase</th></tr>\n";
  for (const CertifiedMargin& m : certificate.margins) {
    const std::string unit = m.unit == "m" ? "mm" : m.unit == "rad" ? "mrad" : m.unit;
    out += "<tr><td>" + escape_markup(m.name) + "</td><td>" + escape_markup(unit) +
           "</td><td class=\"num\">" + figure(m.worst, m.unit) + "</td><td class=\"num\">" +
           figure(m.with_gap, m.unit) + "</td><td class=\"num\">" + figure(m.limit, m.unit) +
           "</td><td class=\"num\">" + fixed(m.time, 2) + "</td><td>" + escape_markup(m.phase) +
           "</td></tr>\n";
  }
  return out + "</table></div>\n" + list_of("It holds for:", certificate.covered) +
         list_of("It says nothing about:", certificate.not_covered);
}

// The paper's figures (section V) belong to two stages only.
std::string paper_time(const std::string& stage) {
  if (stage.find("reference") != std::string::npos) {
    return "under 5 min";
  }
  return stage.find("search") != std::string::npos ? "15 min" : "";
}

std::string timing(const ReportInput& input) {
  std::string out = heading("Planning time") +
                    "<div class=\"scroll\"><table>\n<tr><th>Stage</th><th class=\"num\">here</th>"
                    "<th class=\"num\">paper, 2.5 GHz i7</th></tr>\n";
  for (const auto& [stage, seconds] : input.summary.planning_stages) {
    out += "<tr><td>" + escape_markup(stage) + "</td><td class=\"num\">" + fixed(seconds, 2) +
           " s</td><td class=\"num\">" + paper_time(stage) + "</td></tr>\n";
  }
  return out + "<tr><th>Total</th><td class=\"num\"><b>" +
         fixed(input.summary.planning_total(), 2) +
         " s</b></td><td class=\"num\">about 20 min</td></tr>\n</table></div>\n";
}

std::string strip(const std::vector<Picture>& pictures, const std::string& what,
                  const std::string& css = "strip") {
  std::string out = "<div class=\"" + css + "\">\n";
  for (const Picture& picture : pictures) {
    const std::string time = fixed(picture.time, 1) + " s";
    out += "<figure><img alt=\"" + escape_markup(what) + " at " + time +
           "\" src=\"data:image/png;base64," + base64(encode_png(picture.image)) +
           "\"><figcaption>" + time + "</figcaption></figure>\n";
  }
  return out + "</div>\n";
}

std::string viewer_link(const ReportInput& input) {
  if (input.viewer.empty()) return {};
  const std::string file = escape_markup(input.viewer);
  return "<p><a href=\"" + file +
         "\">The climb in three dimensions</a>, to play and to look at from all sides, with every "
         "joint's torque over time.</p>\n";
}

std::string climb_pictures(const ReportInput& input, const ReportPictures& pictures) {
  std::string out = heading("The climb");
  if (pictures.climb.empty()) {
    return out + viewer_link(input) + paragraph("There are no pictures: " + pictures.problem + ".");
  }
  out += paragraph(
      "Moments chosen by how much the robot moved (paper Fig. 6). Left limbs are blue, "
      "right limbs orange, contact points dark. Green arrows: forces from the obstacle; "
      "violet: from the floor. Floor squares are 0.25 m.");
  out += viewer_link(input);
  return out + strip(pictures.climb, input.climb.label) +
         strip(pictures.final_view, "End of the climb, from the left", "end");
}

std::string playback_pictures(const ReportInput& input, const ReportPictures& pictures) {
  std::string out = heading("Direct playback of the recording");
  if (!input.playback) {
    return out + paragraph("The playback was not run.");
  }
  const auto& success = input.summary.playback_success;
  out += paragraph(std::string("The mapped motion played by position control on the same robot and "
                               "box (paper Fig. 4). It ") +
                   (!success   ? "was not judged."
                    : *success ? "reached the goal."
                               : "did not reach the goal."));
  if (pictures.playback.empty()) {
    return out +
           paragraph("There are no pictures" +
                     (pictures.problem.empty() ? std::string() : ": " + pictures.problem) + ".");
  }
  return out + strip(pictures.playback, input.playback->label);
}

std::string peak_table(const RunData* playback, const RunData& climb) {
  const auto peaks = torque_peaks(climb);
  const auto played = playback != nullptr ? torque_peaks(*playback) : std::vector<TorquePeak>{};
  const auto from = hands_carry_from(climb);
  const auto after = from ? torque_peaks(climb, *from) : std::vector<TorquePeak>{};
  const auto cell = [](const std::vector<TorquePeak>& list, std::size_t j, double limit) {
    if (j >= list.size()) {
      return std::string("<td class=\"num\">-</td>");
    }
    const bool over = limit > 0.0 && list[j].value > limit;
    return "<td class=\"num" + std::string(over ? " bad" : "") + "\">" + fixed(list[j].value, 1) +
           "</td>";
  };
  std::string out =
      "<details><summary>All figures</summary><div class=\"scroll\"><table>\n"
      "<tr><th>Joint</th><th class=\"num\">plan, N m</th><th class=\"num\">once hands "
      "carry</th><th class=\"num\">playback</th><th class=\"num\">limit</th></tr>\n";
  for (std::size_t j = 0; j < peaks.size(); ++j) {
    const double limit = climb.model.joints[j].torque_limit;
    out += "<tr><td>" + escape_markup(peaks[j].joint) + "</td>" + cell(peaks, j, limit) +
           cell(after, j, limit) + cell(played, j, limit) + "<td class=\"num\">" + fixed(limit, 0) +
           "</td></tr>\n";
  }
  return out + "</table></div></details>\n";
}

std::string measurements(const ReportInput& input) {
  const RunData* playback = input.playback ? &*input.playback : nullptr;
  std::string out = heading("Torque of knees and elbows") +
                    paragraph(
                        "Measured at every tick (paper Fig. 7). Each pixel column keeps its "
                        "lowest and highest value, so no peak is lost.") +
                    plot_torques(playback, input.climb);
  out += heading("Largest torque of every joint") + plot_peaks(playback, input.climb) +
         peak_table(playback, input.climb);
  out += heading("Support margin") +
         paragraph("Distance of the planned centre of mass from the edge of the support region.") +
         plot_support_margin(input.plan);
  out += heading("Contacts of the climb") + plot_contacts(input.climb);
  if (playback != nullptr) {
    out += heading("Contacts of the playback") + plot_contacts(*playback);
  }
  return out;
}

std::string record(const ReportInput& input, const ReportPictures& pictures) {
  NamedValues environment = input.environment;
  if (!pictures.driver.empty()) {
    environment.emplace_back("Pictures drawn by", pictures.driver);
  }
  environment.emplace_back("Plan SHA-256", input.summary.plan_sha256);
  environment.emplace_back("Run log SHA-256", input.summary.log_sha256);
  return (input.counters.empty() ? "" : heading("Telemetry") + value_table(input.counters)) +
         heading("Versions") + value_table(environment);
}

}  // namespace

std::string report_html(const ReportInput& input, const ReportPictures& pictures) {
  std::string out =
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n"
      "<title>Clamber: report of a climb</title>\n";
  out += kStyle;
  out += "</head><body><main>\n";
  out += verdict(input) + climb_pictures(input, pictures) + planned(input) + contact_tables(input) +
         notes(input) + margins(input) + timing(input) + playback_pictures(input, pictures) +
         measurements(input) + record(input, pictures);
  return out + "</main></body></html>\n";
}

}  // namespace clamber
