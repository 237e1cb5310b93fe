#include "report/pictures.hpp"

#include "report/renderer.hpp"

namespace clamber {

namespace {

constexpr int kMoments = 8;
constexpr int kWidth = 480;
constexpr int kHeight = 360;

Image draw(Renderer& renderer, const RunData& run, const TelemetryFrame& frame, View view,
           int scale) {
  Scene scene = make_scene(run.model, measured_configuration(frame), run.scenario);
  add_contact_forces(run.model, frame, scene);
  return renderer.render(scene, make_camera(run.scenario, run.model, view), scale * kWidth,
                         scale * kHeight);
}

std::vector<Picture> sequence(Renderer& renderer, const RunData& run) {
  std::vector<Picture> pictures;
  for (const std::size_t i : pick_moments(run.frames, kMoments)) {
    const TelemetryFrame& frame = run.frames[i];
    pictures.push_back({frame.time, draw(renderer, run, frame, View::kThreeQuarter, 1)});
  }
  return pictures;
}

bool shows_base(const RunData& run) {
  return !run.frames.empty() && (run.frames.front().flags & kFrameHasTruth) != 0;
}

}  // namespace

ReportPictures draw_pictures(const RunData& climb, const RunData* playback) {
  ReportPictures pictures;
  if (!shows_base(climb)) {
    pictures.problem = "the climb's frames do not say where the robot's base is";
    return pictures;
  }
  try {
    Renderer renderer;
    pictures.driver = renderer.driver();
    pictures.climb = sequence(renderer, climb);
    pictures.final_view.push_back(
        {climb.frames.back().time, draw(renderer, climb, climb.frames.back(), View::kSide, 2)});
    if (playback != nullptr && shows_base(*playback)) {
      pictures.playback = sequence(renderer, *playback);
    }
  } catch (const RenderError& error) {
    pictures.problem = error.what();
  }
  return pictures;
}

}  // namespace clamber
