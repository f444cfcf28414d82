// SPDX-License-Identifier: MIT
#pragma once

#include <array>

#include "dataset/synth/ripmap.hpp"
#include "dataset/synth/scene.hpp"

namespace stemvo::synth {

using Rgb = std::array<float, 3>;  // 1 is white

/// What one pixel sees of a face: the middle of its footprint and the footprint's size, in metres
/// of the face's texture coordinates.
struct Footprint {
  float u = 0.0F;
  float v = 0.0F;
  float width_u = 0.0F;
  float width_v = 0.0F;
};

/// Share of the footprint [x - width/2, x + width/2] inside [begin, end].
[[nodiscard]] float box_coverage(float x, float width, float begin, float end);
/// The same for bars [k * period, k * period + bar] of all integers k.
[[nodiscard]] float bars_coverage(float x, float width, float period, float bar);

/// Mean colour over the footprint, before light and haze.
[[nodiscard]] Rgb paint(const Style& style, const Footprint& at, const Textures& textures);

}  // namespace stemvo::synth
