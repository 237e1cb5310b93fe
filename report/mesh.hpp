// Triangles of a scene's primitives, ready for a vertex buffer.
// Off-line only: allocates; never blocks.
#pragma once

#include <vector>

#include "report/scene.hpp"

namespace clamber {

/// Interleaved as the renderer's shaders expect it.
struct MeshVertex {
  float position[3];  ///< world, m
  float normal[3];    ///< world, unit
  float colour[3];    ///< sRGB, 0..1
  float local[3];     ///< in the primitive's frame, m: where the wood's grain runs
  float extent[3];    ///< half extents of a wooden box, m; zero: plain material
};

/// Appends three vertices a triangle.
void append_primitive(const ScenePrimitive& primitive, std::vector<MeshVertex>& mesh);
void append_arrow(const SceneArrow& arrow, std::vector<MeshVertex>& mesh);

}  // namespace clamber
