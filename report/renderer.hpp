// Draws scenes to images without a window: EGL surfaceless and OpenGL 3.3 (Mesa's software
// rasteriser where there is no GPU). One thread per Renderer; allocates; blocks while drawing.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>

#include "report/image.hpp"
#include "report/scene.hpp"

namespace clamber {

/// The machine cannot draw: no EGL display, no context, or a shader the driver refuses.
class RenderError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class Renderer {
 public:
  /// `supersample`: drawn that many times larger in each direction and averaged, on top of
  /// multisampling; smooths highlights and textures too. @throws RenderError
  explicit Renderer(int supersample = 2);
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;
  ~Renderer();

  /// Antialiased picture of `scene`, sRGB. The first 64 spheres and capsules and the first 8
  /// wooden boxes cast ambient shade; all primitives cast the light's shadow. @throws RenderError
  [[nodiscard]] Image render(const Scene& scene, const Camera& camera, int width, int height);

  /// The driver's name and version, for the report's list of versions.
  [[nodiscard]] std::string driver() const;

 private:
  struct Gl;
  std::unique_ptr<Gl> gl_;
  int supersample_;
};

}  // namespace clamber
