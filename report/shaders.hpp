// The renderer's GLSL sources (OpenGL 3.3). Included by renderer.cpp only.
#pragma once

namespace clamber::shaders {

inline constexpr const char* kDepthVertex = R"(#version 330 core
layout(location = 0) in vec3 position;
uniform mat4 projection;
invariant gl_Position;
void main() { gl_Position = projection * vec4(position, 1.0); }
)";

inline constexpr const char* kDepthFragment = R"(#version 330 core
void main() {}
)";

inline constexpr const char* kBackgroundVertex = R"(#version 330 core
void main() {
  vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  gl_Position = vec4(corner, 1.0, 1.0);
}
)";

// The horizon fades into this, so it is one function for sky and floor.
inline constexpr const char* kBackgroundCommon = R"(
uniform float picture_height;
vec3 background() {
  float t = gl_FragCoord.y / picture_height;
  return mix(vec3(0.87, 0.89, 0.915), vec3(0.965, 0.973, 0.983), smoothstep(0.3, 1.0, t));
}
)";

inline constexpr const char* kBackgroundFragment = R"(
out vec4 pixel;
void main() { pixel = vec4(background(), 1.0); }
)";

inline constexpr const char* kSurfaceVertex = R"(#version 330 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 colour;
layout(location = 3) in vec3 local;
layout(location = 4) in vec3 extent;
uniform mat4 projection;
uniform mat4 light;
invariant gl_Position;
out vec3 world;
out vec3 world_normal;
out vec3 tint;
out vec3 inside;
out vec4 in_light;
flat out vec3 half_extent;
void main() {
  world = position;
  world_normal = normal;
  tint = colour;
  inside = local;
  half_extent = extent;
  // A step along the normal keeps surfaces from shading themselves.
  in_light = light * vec4(position + 0.004 * normal, 1.0);
  gl_Position = projection * vec4(position, 1.0);
}
)";

inline constexpr const char* kSurfaceFragment = R"(
in vec3 world;
in vec3 world_normal;
in vec3 tint;
in vec3 inside;
in vec4 in_light;
flat in vec3 half_extent;
uniform vec3 eye;
uniform vec3 target;
uniform vec3 to_light;
uniform bool is_floor;
uniform bool is_overlay;
uniform sampler2DShadow shadow_map;
uniform int round_count;
uniform vec4 round_from[64];  // capsule axis ends, w: radius
uniform vec4 round_to[64];
uniform int box_count;
uniform vec4 box_centre[8];   // w: yaw
uniform vec3 box_half[8];
out vec4 pixel;

vec3 linear(vec3 srgb) { return pow(srgb, vec3(2.2)); }

float hash(vec2 p) { return fract(sin(dot(p, vec2(127.1, 311.7))) * 43758.5453); }
float noise(vec2 p) {
  vec2 i = floor(p), f = fract(p);
  f = f * f * (3.0 - 2.0 * f);
  return mix(mix(hash(i), hash(i + vec2(1, 0)), f.x),
             mix(hash(i + vec2(0, 1)), hash(i + vec2(1, 1)), f.x), f.y);
}

// Squares of 0.25 m, filtered over the pixel's footprint.
float checker(vec2 p) {
  vec2 q = p / 0.25;
  vec2 w = max(fwidth(q), 1e-4);
  vec2 i = 2.0 * (abs(fract((q - 0.5 * w) * 0.5) - 0.5) - abs(fract((q + 0.5 * w) * 0.5) - 0.5)) / w;
  return 0.5 - 0.5 * i.x * i.y;
}

// Boards along y on top and front, grain along the board, worn bright edges.
vec3 wood(vec3 base, vec3 n) {
  vec3 a = abs(n);
  vec2 p = a.x > 0.5 ? inside.yz : (a.y > 0.5 ? inside.xz : inside.yx);
  float board = floor(p.y / 0.0917 + 0.37);
  vec2 g = vec2(p.x * 2.2 + 13.7 * board, p.y * 26.0 + 5.1 * board);
  float wave = noise(g * vec2(1.0, 0.35)) * 2.6;
  float grain = 0.5 + 0.5 * sin(g.y * 2.4 + wave * 3.2);
  float fibre = noise(vec2(p.x * 18.0, p.y * 420.0));
  vec3 c = mix(base * 0.78, base * 1.1, 0.55 * grain + 0.3 * fibre + 0.15);
  c *= 0.9 + 0.2 * hash(vec2(board, 3.0));
  float seam = abs(fract(p.y / 0.0917 + 0.37) - 0.5);
  c *= mix(0.55, 1.0, smoothstep(0.0, 0.02, 0.5 - seam));
  vec3 to_edge = half_extent - abs(inside) + a * 10.0;
  float edge = min(to_edge.x, min(to_edge.y, to_edge.z));
  return mix(c, min(c * 1.35, vec3(1.0)), 1.0 - smoothstep(0.002, 0.006, edge));
}

// Share of the light that reaches the point: 5 x 5 comparisons, each filtered by the hardware.
float light_share() {
  vec3 p = in_light.xyz / in_light.w * 0.5 + 0.5;
  if (any(lessThan(p, vec3(0.0))) || any(greaterThan(p, vec3(1.0)))) return 1.0;
  float sum = 0.0;
  for (int y = -2; y <= 2; ++y)
    for (int x = -2; x <= 2; ++x)
      sum += texture(shadow_map, vec3(p.xy + vec2(x, y) * (2.8 / 2048.0), p.z - 0.0006));
  return sum / 25.0;
}

// Ambient light kept out by the round links near the point, in closed form: a sphere of radius r
// at distance d above the surface covers about cos * r^2 / d^2 of its sky.
float open_sky(vec3 n) {
  float open = 1.0;
  // Floor far from the robot has an open sky; a loop of no rounds is what saves the time.
  int rounds = is_floor && length(world.xy - target.xy) > 0.9 ? 0 : round_count;
  for (int i = 0; i < rounds; ++i) {
    vec3 axis = round_to[i].xyz - round_from[i].xyz;
    vec3 rel = world - round_from[i].xyz;
    float t = clamp(dot(rel, axis) / max(dot(axis, axis), 1e-9), 0.0, 1.0);
    vec3 d = rel - t * axis;
    float r = round_from[i].w;
    float l = max(length(d), r);
    float covered = max(0.0, dot(-d, n)) * r * r / (l * l * l);
    open *= 1.0 - 0.8 * min(covered, 1.0);
  }
  for (int i = 0; i < box_count; ++i) {
    vec3 d = world - box_centre[i].xyz;
    float c = cos(box_centre[i].w), s = sin(box_centre[i].w);
    vec3 local = vec3(c * d.x + s * d.y, -s * d.x + c * d.y, d.z);
    vec3 outside = max(abs(local) - box_half[i], 0.0);
    vec3 away = sign(local) * outside;
    float distance = length(away);
    if (distance > 1e-4) {
      vec3 facing = vec3(c * away.x - s * away.y, s * away.x + c * away.y, away.z) / distance;
      float toward = 0.5 + 0.5 * dot(-facing, n);
      open *= 1.0 - 0.45 * toward * exp(-distance / 0.09);
    }
  }
  return open;
}

void main() {
  vec3 n = normalize(world_normal);
  vec3 view = normalize(eye - world);
  vec3 base = linear(tint);
  if (is_floor) base = mix(linear(vec3(0.70, 0.73, 0.765)), linear(vec3(0.775, 0.80, 0.83)),
                           checker(world.xy));
  if (half_extent.x > 0.0) base = wood(base, n);

  float open = is_overlay ? 1.0 : open_sky(n);
  float lit = is_overlay ? 1.0 : light_share();
  float key = max(dot(n, to_light), 0.0) * lit;
  vec3 fill_from = normalize(vec3(-to_light.y, to_light.x, 0.35));
  vec3 ambient = mix(vec3(0.30, 0.29, 0.28), vec3(0.47, 0.50, 0.55), 0.5 + 0.5 * n.z) * open;
  vec3 colour = base * (ambient + vec3(0.92, 0.88, 0.82) * key +
                        0.16 * max(dot(n, fill_from), 0.0) * open);
  bool shiny = !is_floor && half_extent.x == 0.0;
  if (shiny) {
    vec3 middle = normalize(view + to_light);
    float edge = pow(1.0 - max(dot(n, view), 0.0), 4.0);
    colour += 0.22 * pow(max(dot(n, middle), 0.0), 48.0) * lit + 0.10 * edge * open;
  }
  colour = pow(clamp(colour, 0.0, 1.0), vec3(1.0 / 2.2));
  if (is_floor) {
    float far = length(world.xy - target.xy);
    colour = mix(colour, background(), smoothstep(0.9, 2.6, far));
  }
  pixel = vec4(colour, 1.0);
}
)";

}  // namespace clamber::shaders
