#include "report/renderer.hpp"

#include <EGL/egl.h>
#include <EGL/eglext.h>
#define GL_GLEXT_PROTOTYPES
#include <GL/glcorearb.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>

#include "report/mesh.hpp"
#include "report/shaders.hpp"

namespace clamber {

namespace {

constexpr int kShadowSize = 2048;
constexpr std::size_t kMaxRounds = 64;
constexpr std::size_t kMaxBoxes = 8;

Eigen::Matrix4f look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d back = (eye - target).normalized();
  const Eigen::Vector3d right = Eigen::Vector3d::UnitZ().cross(back).normalized();
  const Eigen::Vector3d up = back.cross(right);
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.block<1, 3>(0, 0) = right.transpose();
  m.block<1, 3>(1, 0) = up.transpose();
  m.block<1, 3>(2, 0) = back.transpose();
  m.block<3, 1>(0, 3) = -m.block<3, 3>(0, 0) * eye;
  return m.cast<float>();
}

Eigen::Matrix4f perspective(double field_of_view, double aspect, double near, double far) {
  const double f = 1.0 / std::tan(0.5 * field_of_view);
  Eigen::Matrix4d m = Eigen::Matrix4d::Zero();
  m(0, 0) = f / aspect;
  m(1, 1) = f;
  m(2, 2) = (far + near) / (near - far);
  m(2, 3) = 2.0 * far * near / (near - far);
  m(3, 2) = -1.0;
  return m.cast<float>();
}

Eigen::Matrix4f orthographic(double half, double depth) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m(0, 0) = m(1, 1) = 1.0 / half;
  m(2, 2) = -2.0 / depth;
  m(2, 3) = -1.0;
  return m.cast<float>();
}

GLuint compile(GLenum stage, const std::string& source) {
  const GLuint shader = glCreateShader(stage);
  const char* text = source.c_str();
  glShaderSource(shader, 1, &text, nullptr);
  glCompileShader(shader);
  GLint ok = 0;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
  if (ok == 0) {
    std::array<char, 1024> log{};
    glGetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), nullptr, log.data());
    throw RenderError(std::string("shader: ") + log.data());
  }
  return shader;
}

GLuint link_program(const std::string& vertex, const std::string& fragment) {
  const GLuint program = glCreateProgram();
  for (const GLuint shader :
       {compile(GL_VERTEX_SHADER, vertex), compile(GL_FRAGMENT_SHADER, fragment)}) {
    glAttachShader(program, shader);
    glDeleteShader(shader);  // lives on while attached
  }
  glLinkProgram(program);
  GLint ok = 0;
  glGetProgramiv(program, GL_LINK_STATUS, &ok);
  if (ok == 0) {
    throw RenderError("shader program does not link");
  }
  return program;
}

GLint uniform(GLuint program, const char* name) { return glGetUniformLocation(program, name); }

void set(GLuint program, const char* name, const Eigen::Matrix4f& m) {
  glUniformMatrix4fv(uniform(program, name), 1, GL_FALSE, m.data());
}

void set(GLuint program, const char* name, const Eigen::Vector3d& v) {
  glUniform3f(uniform(program, name), static_cast<float>(v.x()), static_cast<float>(v.y()),
              static_cast<float>(v.z()));
}

void set(GLuint program, const char* name, int value) {
  glUniform1i(uniform(program, name), value);
}

void append_floor(const Eigen::Vector3d& centre, std::vector<MeshVertex>& mesh) {
  constexpr std::array<std::array<double, 2>, 6> kCorners{
      {{-1, -1}, {1, -1}, {1, 1}, {-1, -1}, {1, 1}, {-1, 1}}};
  for (const auto& corner : kCorners) {
    mesh.push_back({{static_cast<float>(centre.x() + 8.0 * corner[0]),
                     static_cast<float>(centre.y() + 8.0 * corner[1]), 0.0f},
                    {0.0f, 0.0f, 1.0f},
                    {1.0f, 1.0f, 1.0f},
                    {},
                    {}});
  }
}

void set_occluders(GLuint program, const Scene& scene) {
  std::vector<Eigen::Vector4f> from;
  std::vector<Eigen::Vector4f> to;
  std::vector<Eigen::Vector4f> centre;
  std::vector<Eigen::Vector3f> half;
  for (const ScenePrimitive& p : scene.primitives) {
    if (p.material == Material::kWood && centre.size() < kMaxBoxes) {
      const double yaw = std::atan2(p.X_WP.R(1, 0), p.X_WP.R(0, 0));
      centre.push_back(
          Eigen::Vector4d(p.X_WP.p.x(), p.X_WP.p.y(), p.X_WP.p.z(), yaw).cast<float>());
      half.push_back(p.half_extents.cast<float>());
    } else if (p.shape != Shape::kBox && from.size() < kMaxRounds) {
      const double reach = p.shape == Shape::kCapsule ? 0.5 * p.length : 0.0;
      const Eigen::Vector3d a = p.X_WP * Eigen::Vector3d(0, 0, -reach);
      const Eigen::Vector3d b = p.X_WP * Eigen::Vector3d(0, 0, reach);
      from.push_back(Eigen::Vector4d(a.x(), a.y(), a.z(), p.radius).cast<float>());
      to.push_back(Eigen::Vector4d(b.x(), b.y(), b.z(), p.radius).cast<float>());
    }
  }
  set(program, "round_count", static_cast<int>(from.size()));
  set(program, "box_count", static_cast<int>(centre.size()));
  if (!from.empty()) {
    const auto n = static_cast<GLsizei>(from.size());
    glUniform4fv(uniform(program, "round_from"), n, from.front().data());
    glUniform4fv(uniform(program, "round_to"), n, to.front().data());
  }
  if (!centre.empty()) {
    const auto n = static_cast<GLsizei>(centre.size());
    glUniform4fv(uniform(program, "box_centre"), n, centre.front().data());
    glUniform3fv(uniform(program, "box_half"), n, half.front().data());
  }
}

// Stands over the viewer's shoulder: shadows fall away from us, highlights face us.
Eigen::Vector3d light_direction(const Camera& camera) {
  const Eigen::Vector3d back = camera.eye - camera.target;
  const double azimuth = std::atan2(back.y(), back.x()) + 0.55;
  return Eigen::Vector3d(0.62 * std::cos(azimuth), 0.62 * std::sin(azimuth), 1.0).normalized();
}

// Averages factor x factor pixels and turns the rows: OpenGL's first row is the lowest.
Image downsample(const std::vector<std::uint8_t>& big, int width, int height, int factor) {
  Image image(width, height);
  const std::size_t stride = 4 * static_cast<std::size_t>(width * factor);
  const auto count = static_cast<unsigned>(factor * factor);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      std::uint8_t* out = image.pixel(x, y);
      for (std::size_t c = 0; c < 3; ++c) {
        unsigned sum = 0;
        for (int j = 0; j < factor; ++j) {
          const auto row = static_cast<std::size_t>((height - 1 - y) * factor + j);
          for (int i = 0; i < factor; ++i) {
            sum += big[row * stride + 4 * static_cast<std::size_t>(x * factor + i) + c];
          }
        }
        out[c] = static_cast<std::uint8_t>((sum + count / 2) / count);
      }
    }
  }
  return image;
}

EGLDisplay surfaceless_display() {
  const auto get_display = reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(
      eglGetProcAddress("eglGetPlatformDisplayEXT"));
  if (get_display == nullptr) {
    throw RenderError("EGL has no eglGetPlatformDisplayEXT");
  }
  const EGLDisplay display =
      get_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
  if (display == EGL_NO_DISPLAY || eglInitialize(display, nullptr, nullptr) == EGL_FALSE) {
    throw RenderError("no EGL surfaceless display (Debian: libegl-mesa0 and libgl1-mesa-dri)");
  }
  return display;
}

}  // namespace

struct Renderer::Gl {
  /// Colour and depth to draw into.
  struct Target {
    GLuint framebuffer = 0;
    GLuint colour = 0;
    GLuint depth = 0;
  };

  /// Where the parts of a scene begin in the vertex buffer: floor from 0, then these.
  struct Parts {
    GLsizei solid = 0;   ///< what casts shadows
    GLsizei arrows = 0;  ///< drawn over everything
    GLsizei end = 0;
  };

  EGLDisplay display = EGL_NO_DISPLAY;
  EGLContext context = EGL_NO_CONTEXT;
  GLuint surface_program = 0;
  GLuint depth_program = 0;
  GLuint background_program = 0;
  GLuint vertex_array = 0;
  GLuint vertex_buffer = 0;
  GLuint shadow_framebuffer = 0;
  GLuint shadow_map = 0;
  Target multisampled;
  Target resolved;
  int width = 0;
  int height = 0;

  Gl();
  Gl(const Gl&) = delete;
  Gl& operator=(const Gl&) = delete;
  ~Gl();
  void make_current() const;
  void make_buffers();
  void resize(int new_width, int new_height);
  [[nodiscard]] Parts upload(const Scene& scene, const Camera& camera) const;
  void draw_shadow(const Eigen::Matrix4f& light, const Parts& parts) const;
  void draw_background() const;
  /// Depth alone first, so that the costly surface shader runs once a pixel.
  void draw_depth(const Eigen::Matrix4f& projection, const Parts& parts) const;
  void draw_surfaces(const Parts& parts) const;
  [[nodiscard]] std::vector<std::uint8_t> read_pixels() const;

 private:
  void make_context();
};

void Renderer::Gl::make_context() {
  if (eglBindAPI(EGL_OPENGL_API) == EGL_FALSE) {
    throw RenderError("EGL offers no desktop OpenGL");
  }
  constexpr std::array<EGLint, 7> kAttributes{EGL_CONTEXT_MAJOR_VERSION,
                                              3,
                                              EGL_CONTEXT_MINOR_VERSION,
                                              3,
                                              EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                              EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                              EGL_NONE};
  context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, kAttributes.data());
  if (context == EGL_NO_CONTEXT) {
    throw RenderError("EGL gives no OpenGL 3.3 context");
  }
  make_current();
}

Renderer::Gl::Gl() : display(surfaceless_display()) {
  make_context();
  using namespace shaders;
  const std::string head = std::string("#version 330 core\n") + kBackgroundCommon;
  surface_program = link_program(kSurfaceVertex, head + kSurfaceFragment);
  depth_program = link_program(kDepthVertex, kDepthFragment);
  background_program = link_program(kBackgroundVertex, head + kBackgroundFragment);
  make_buffers();
}

Renderer::Gl::~Gl() {
  // The context owns every object made in it.
  eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  if (context != EGL_NO_CONTEXT) {
    eglDestroyContext(display, context);
  }
}

void Renderer::Gl::make_current() const {
  if (eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context) == EGL_FALSE) {
    throw RenderError("the OpenGL context cannot be made current without a surface");
  }
}

void Renderer::Gl::make_buffers() {
  glGenVertexArrays(1, &vertex_array);
  glBindVertexArray(vertex_array);
  glGenBuffers(1, &vertex_buffer);
  glBindBuffer(GL_ARRAY_BUFFER, vertex_buffer);
  constexpr std::array<std::size_t, 5> kOffsets{
      offsetof(MeshVertex, position), offsetof(MeshVertex, normal), offsetof(MeshVertex, colour),
      offsetof(MeshVertex, local), offsetof(MeshVertex, extent)};
  for (GLuint i = 0; i < kOffsets.size(); ++i) {
    glEnableVertexAttribArray(i);
    glVertexAttribPointer(i, 3, GL_FLOAT, GL_FALSE, sizeof(MeshVertex),
                          reinterpret_cast<const void*>(kOffsets[i]));
  }

  glGenTextures(1, &shadow_map);
  glBindTexture(GL_TEXTURE_2D, shadow_map);
  glTexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT24, kShadowSize, kShadowSize, 0,
               GL_DEPTH_COMPONENT, GL_FLOAT, nullptr);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
  glGenFramebuffers(1, &shadow_framebuffer);
  glBindFramebuffer(GL_FRAMEBUFFER, shadow_framebuffer);
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, shadow_map, 0);
  glDrawBuffer(GL_NONE);
  glReadBuffer(GL_NONE);
}

void Renderer::Gl::resize(int new_width, int new_height) {
  if (new_width == width && new_height == height) {
    return;
  }
  GLint samples = 0;
  glGetIntegerv(GL_MAX_SAMPLES, &samples);
  samples = std::min(samples, 4);
  for (Target* target : {&multisampled, &resolved}) {
    glDeleteRenderbuffers(1, &target->colour);
    glDeleteRenderbuffers(1, &target->depth);
    glDeleteFramebuffers(1, &target->framebuffer);
    glGenFramebuffers(1, &target->framebuffer);
    glBindFramebuffer(GL_FRAMEBUFFER, target->framebuffer);
    const GLint count = target == &multisampled ? samples : 0;
    const auto attach = [&](GLuint& buffer, GLenum format, GLenum attachment) {
      glGenRenderbuffers(1, &buffer);
      glBindRenderbuffer(GL_RENDERBUFFER, buffer);
      glRenderbufferStorageMultisample(GL_RENDERBUFFER, count, format, new_width, new_height);
      glFramebufferRenderbuffer(GL_FRAMEBUFFER, attachment, GL_RENDERBUFFER, buffer);
    };
    attach(target->colour, GL_RGBA8, GL_COLOR_ATTACHMENT0);
    attach(target->depth, GL_DEPTH_COMPONENT24, GL_DEPTH_ATTACHMENT);
    if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
      throw RenderError("the driver refuses a framebuffer of this size");
    }
  }
  width = new_width;
  height = new_height;
}

Renderer::Gl::Parts Renderer::Gl::upload(const Scene& scene, const Camera& camera) const {
  std::vector<MeshVertex> mesh;
  Parts parts;
  append_floor(camera.target, mesh);
  parts.solid = static_cast<GLsizei>(mesh.size());
  for (const ScenePrimitive& primitive : scene.primitives) {
    append_primitive(primitive, mesh);
  }
  parts.arrows = static_cast<GLsizei>(mesh.size());
  for (const SceneArrow& arrow : scene.arrows) {
    append_arrow(arrow, mesh);
  }
  parts.end = static_cast<GLsizei>(mesh.size());
  glBindVertexArray(vertex_array);
  glBindBuffer(GL_ARRAY_BUFFER, vertex_buffer);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(mesh.size() * sizeof(MeshVertex)),
               mesh.data(), GL_STREAM_DRAW);
  return parts;
}

void Renderer::Gl::draw_shadow(const Eigen::Matrix4f& light, const Parts& parts) const {
  glBindFramebuffer(GL_FRAMEBUFFER, shadow_framebuffer);
  glViewport(0, 0, kShadowSize, kShadowSize);
  glDisable(GL_CULL_FACE);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LEQUAL);
  glClear(GL_DEPTH_BUFFER_BIT);
  glUseProgram(depth_program);
  set(depth_program, "projection", light);
  glDrawArrays(GL_TRIANGLES, parts.solid, parts.arrows - parts.solid);
}

void Renderer::Gl::draw_background() const {
  glBindFramebuffer(GL_FRAMEBUFFER, multisampled.framebuffer);
  glViewport(0, 0, width, height);
  glEnable(GL_MULTISAMPLE);
  glClear(GL_DEPTH_BUFFER_BIT);
  glDisable(GL_DEPTH_TEST);
  glUseProgram(background_program);
  glUniform1f(uniform(background_program, "picture_height"), static_cast<float>(height));
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

void Renderer::Gl::draw_depth(const Eigen::Matrix4f& projection, const Parts& parts) const {
  glEnable(GL_DEPTH_TEST);
  glEnable(GL_CULL_FACE);
  glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
  glUseProgram(depth_program);
  set(depth_program, "projection", projection);
  glDrawArrays(GL_TRIANGLES, 0, parts.arrows);
  glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
}

void Renderer::Gl::draw_surfaces(const Parts& parts) const {
  set(surface_program, "is_overlay", 0);
  set(surface_program, "is_floor", 1);
  glDrawArrays(GL_TRIANGLES, 0, parts.solid);
  set(surface_program, "is_floor", 0);
  glDrawArrays(GL_TRIANGLES, parts.solid, parts.arrows - parts.solid);
  if (parts.end > parts.arrows) {
    glClear(GL_DEPTH_BUFFER_BIT);  // arrows show through the limb they push
    set(surface_program, "is_overlay", 1);
    glDrawArrays(GL_TRIANGLES, parts.arrows, parts.end - parts.arrows);
  }
}

std::vector<std::uint8_t> Renderer::Gl::read_pixels() const {
  glBindFramebuffer(GL_READ_FRAMEBUFFER, multisampled.framebuffer);
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, resolved.framebuffer);
  glBlitFramebuffer(0, 0, width, height, 0, 0, width, height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, resolved.framebuffer);
  std::vector<std::uint8_t> pixels(4 * static_cast<std::size_t>(width) *
                                   static_cast<std::size_t>(height));
  glReadPixels(0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, pixels.data());
  return pixels;
}

Renderer::Renderer(int supersample) : gl_(std::make_unique<Gl>()), supersample_(supersample) {}
Renderer::~Renderer() = default;

Image Renderer::render(const Scene& scene, const Camera& camera, int width, int height) {
  if (width < 1 || height < 1) {
    throw RenderError("a picture needs a positive size");
  }
  gl_->make_current();
  gl_->resize(width * supersample_, height * supersample_);
  const Gl::Parts parts = gl_->upload(scene, camera);
  const Eigen::Vector3d to_light = light_direction(camera);
  const Eigen::Matrix4f light =
      orthographic(1.5, 6.0) * look_at(camera.target + 3.0 * to_light, camera.target);
  const double aspect = static_cast<double>(width) / height;
  const Eigen::Matrix4f projection =
      perspective(camera.field_of_view, aspect, 0.1, 20.0) * look_at(camera.eye, camera.target);

  gl_->draw_shadow(light, parts);
  gl_->draw_background();
  gl_->draw_depth(projection, parts);
  const GLuint program = gl_->surface_program;
  glUseProgram(program);
  glUniform1f(uniform(program, "picture_height"), static_cast<float>(gl_->height));
  set(program, "projection", projection);
  set(program, "light", light);
  set(program, "eye", camera.eye);
  set(program, "target", camera.target);
  set(program, "to_light", to_light);
  set(program, "shadow_map", 0);
  set_occluders(program, scene);
  gl_->draw_surfaces(parts);
  const std::vector<std::uint8_t> pixels = gl_->read_pixels();
  if (glGetError() != GL_NO_ERROR) {
    throw RenderError("OpenGL reports an error while drawing");
  }
  return downsample(pixels, width, height, supersample_);
}

std::string Renderer::driver() const {
  gl_->make_current();
  return std::string(reinterpret_cast<const char*>(glGetString(GL_RENDERER))) + ", OpenGL " +
         reinterpret_cast<const char*>(glGetString(GL_VERSION));
}

}  // namespace clamber
