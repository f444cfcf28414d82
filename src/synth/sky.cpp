// SPDX-License-Identifier: MIT
#include <algorithm>

#include "synth/materials.hpp"

namespace stemvo::synth {

float smooth_step(float begin, float end, float x) {
  const float t = std::clamp((x - begin) / (end - begin), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

Rgb sky_colour(const Vec3& direction, double pixel_rad, const Textures& textures) {
  constexpr double kTwoPi = 2.0 * kPi;
  const std::vector<float>& ridges = textures.ridge_rad;
  const Vec3 d = direction.normalized();
  const auto elevation = static_cast<float>(std::asin(std::clamp(-d.y(), -1.0, 1.0)));
  const auto width = static_cast<float>(pixel_rad);
  const double turn = std::atan2(d.x(), d.z()) / kTwoPi;  // -0.5 .. 0.5
  const double position = (turn - std::floor(turn)) * static_cast<double>(ridges.size());
  const auto index = static_cast<std::size_t>(position) % ridges.size();
  const auto t = static_cast<float>(position - std::floor(position));
  const float ridge = ridges[index] + t * (ridges[(index + 1) % ridges.size()] - ridges[index]);

  Rgb colour = blend(kHaze, {0.30F, 0.46F, 0.78F}, smooth_step(-0.02F, 0.45F, elevation));
  // Clouds lie on a plane overhead and thin out towards the horizon.
  const float rise = std::max(elevation, 0.05F);
  const float spread = std::max(width / (rise * rise) * 90.0F, 12.0F);
  const float cloud =
      textures.leaf.sample(static_cast<float>(d.x()) / rise * 90.0F,
                           static_cast<float>(d.z()) / rise * 90.0F, spread, spread);
  colour = blend(colour, {0.86F, 0.87F, 0.88F},
                 0.55F * smooth_step(0.05F, 0.2F, elevation) * smooth_step(-0.2F, 1.2F, cloud));
  // Woods on the hills: the tile is wrapped three times around the horizon.
  constexpr double kTexelsPerTurn = 3.0 * Ripmap::kSize;
  const float s = static_cast<float>(kTexelsPerTurn / kTwoPi);
  const float woods = textures.leaf.sample(static_cast<float>(turn * kTexelsPerTurn), elevation * s,
                                           width * s, width * s);
  const float shade = 1.0F + 0.2F * woods;
  const Rgb hill = blend({0.20F * shade, 0.26F * shade, 0.19F * shade}, kHaze, 0.25F);
  colour = blend(colour, hill, std::clamp((ridge - elevation) / width + 0.5F, 0.0F, 1.0F));
  // Fields from just below the horizon on.
  const Rgb field = {0.37F * shade, 0.39F * shade, 0.27F * shade};
  return blend(colour, field, 1.0F - smooth_step(-0.03F, -0.005F, elevation));
}

}  // namespace stemvo::synth
