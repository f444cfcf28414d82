// SPDX-License-Identifier: MIT
#include "dataset/synth/sky.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dataset/synth/hash.hpp"

namespace stemvo::synth {
namespace {

constexpr int kTable = 4096;
constexpr double kTwoPi = 2.0 * std::numbers::pi;

Rgb blend(const Rgb& from, const Rgb& to, float share) {
  return {from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1]),
          from[2] + share * (to[2] - from[2])};
}

float smooth_step(float begin, float end, float x) {
  const float t = std::clamp((x - begin) / (end - begin), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

}  // namespace

Sky::Sky(std::uint64_t seed) : ridge_rad_(kTable) {
  Draw draw(seed, 'S');
  std::vector<double> heights(kTable, 0.028);
  for (int wave = 2; wave < 220; wave = wave * 4 / 3 + 1) {  // whole waves: no seam
    const double phase = draw.in(0.0, kTwoPi);
    const double amplitude = 0.012 * std::pow(wave, -0.55) * draw.in(0.6, 1.4);
    for (int i = 0; i < kTable; ++i) {
      heights[static_cast<std::size_t>(i)] +=
          amplitude * std::sin(kTwoPi * wave * i / kTable + phase);
    }
  }
  std::transform(heights.begin(), heights.end(), ridge_rad_.begin(),
                 [](double h) { return static_cast<float>(h); });
}

Rgb Sky::colour(const Eigen::Vector3d& direction,
                double pixel_rad,
                const Textures& textures) const {
  const Eigen::Vector3d d = direction.normalized();
  const auto elevation = static_cast<float>(std::asin(std::clamp(-d.y(), -1.0, 1.0)));
  const auto width = static_cast<float>(pixel_rad);
  const double turn = std::atan2(d.x(), d.z()) / kTwoPi;  // -0.5 .. 0.5
  const double position = (turn - std::floor(turn)) * kTable;
  const auto index = static_cast<std::size_t>(position) % kTable;
  const auto t = static_cast<float>(position - std::floor(position));
  const float ridge =
      ridge_rad_[index] + t * (ridge_rad_[(index + 1) % kTable] - ridge_rad_[index]);

  const Rgb high = {0.30F, 0.46F, 0.78F};
  Rgb colour = blend(kHaze, high, smooth_step(-0.02F, 0.45F, elevation));
  // Clouds lie on a plane overhead and thin out towards the horizon.
  const float rise = std::max(elevation, 0.05F);
  const float cloud_u = static_cast<float>(d.x()) / rise * 90.0F;
  const float cloud_v = static_cast<float>(d.z()) / rise * 90.0F;
  const float spread = width / (rise * rise) * 90.0F;
  const float cloud =
      textures.leaf.sample(cloud_u, cloud_v, std::max(spread, 12.0F), std::max(spread, 12.0F));
  colour = blend(colour, {0.86F, 0.87F, 0.88F},
                 0.55F * smooth_step(0.05F, 0.2F, elevation) * smooth_step(-0.2F, 1.2F, cloud));
  // Woods on the hills: the tile is wrapped three times around the horizon.
  constexpr double kTexelsPerTurn = 3.0 * Ripmap::kSize;
  const float s = static_cast<float>(kTexelsPerTurn / kTwoPi);
  const float woods = textures.leaf.sample(static_cast<float>(turn * kTexelsPerTurn), elevation * s,
                                           width * s, width * s);
  const float shade = 1.0F + 0.2F * woods;
  const Rgb hill = blend({0.20F * shade, 0.26F * shade, 0.19F * shade}, kHaze, 0.25F);
  const float share = std::clamp((ridge - elevation) / width + 0.5F, 0.0F, 1.0F);
  colour = blend(colour, hill, share);
  // Fields from just below the horizon on.
  const Rgb field = {0.37F * shade, 0.39F * shade, 0.27F * shade};
  return blend(colour, field, 1.0F - smooth_step(-0.03F, -0.005F, elevation));
}

float haze_share(float distance_m) { return 1.0F - std::exp(-distance_m / 700.0F); }

float backdrop_share(float distance_m) { return smooth_step(110.0F, 165.0F, distance_m); }

}  // namespace stemvo::synth
