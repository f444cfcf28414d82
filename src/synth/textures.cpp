// SPDX-License-Identifier: MIT
#include <algorithm>
#include <numeric>

#include <opencv2/imgproc.hpp>

#include "synth/materials.hpp"

namespace stemvo::synth {
namespace {

constexpr std::size_t kSize = Ripmap::kSize;

void normalize(std::vector<float>& values) {
  const auto n = static_cast<double>(values.size());
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
  double square = 0.0;
  for (const float value : values) {
    square += (value - mean) * (value - mean);
  }
  const double scale = 1.0 / std::sqrt(std::max(square / n, 1e-12));
  for (float& value : values) {
    value = static_cast<float>((value - mean) * scale);
  }
}

/// Smooth noise on a lattice of `cells` x `cells` points around the torus.
void add_value_noise(std::uint64_t seed,
                     std::size_t cells,
                     double amplitude,
                     std::vector<float>& into) {
  std::vector<float> lattice(cells * cells);
  for (std::size_t i = 0; i < lattice.size(); ++i) {
    lattice[i] = static_cast<float>(amplitude * (2.0 * unit(hash_of(seed, cells, i)) - 1.0));
  }
  const std::size_t period = kSize / cells;
  const auto at = [&](std::size_t x, std::size_t y) {
    return lattice[(y % cells) * cells + x % cells];
  };
  const auto smooth = [&](std::size_t position) {
    return smooth_step(0.0F, static_cast<float>(period), static_cast<float>(position % period));
  };
  for (std::size_t y = 0; y < kSize; ++y) {
    const std::size_t cy = y / period;
    const float ty = smooth(y);
    for (std::size_t x = 0; x < kSize; ++x) {
      const std::size_t cx = x / period;
      const float tx = smooth(x);
      const float top = at(cx, cy) + tx * (at(cx + 1, cy) - at(cx, cy));
      const float bottom = at(cx, cy + 1) + tx * (at(cx + 1, cy + 1) - at(cx, cy + 1));
      into[y * kSize + x] += top + ty * (bottom - top);
    }
  }
}

/// Sum of value noise over octaves: `amplitudes[k]` at a wavelength of 2^k texels.
std::vector<float> octave_noise(std::uint64_t seed, const std::vector<double>& amplitudes) {
  std::vector<float> values(kSize * kSize, 0.0F);
  for (std::size_t octave = 0; octave < amplitudes.size(); ++octave) {
    add_value_noise(hash_of(seed, octave), kSize >> octave, amplitudes[octave], values);
  }
  return values;
}

std::vector<float> leaf_noise(std::uint64_t seed) {
  auto values = octave_noise(seed, {0.6, 1.0, 1.2, 1.1, 0.9, 0.7, 0.4});
  normalize(values);
  for (float& value : values) {  // gaps are darker than leaves are bright
    value = value < -0.6F ? -0.6F + 1.5F * (value + 0.6F) : value;
    value = std::clamp(value, -2.2F, 1.8F);
  }
  return values;
}

std::vector<float> hills(std::uint64_t seed) {
  constexpr int kTable = 4096;
  Draw draw(seed, 'S');
  std::vector<double> heights(kTable, 0.028);
  for (int wave = 2; wave < 220; wave = wave * 4 / 3 + 1) {  // whole waves: no seam
    const double phase = draw.in(0.0, 2.0 * kPi);
    const double amplitude = 0.012 * std::pow(wave, -0.55) * draw.in(0.6, 1.4);
    for (int i = 0; i < kTable; ++i) {
      heights[static_cast<std::size_t>(i)] +=
          amplitude * std::sin(2.0 * kPi * wave * i / kTable + phase);
    }
  }
  return {heights.begin(), heights.end()};
}

}  // namespace

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

Ripmap::Ripmap(std::vector<float> values) {
  normalize(values);
  levels_[0][0] = cv::Mat(values, true).reshape(1, kSize);
  for (std::size_t v = 0; v < kLevels; ++v) {
    if (v > 0) {
      cv::resize(levels_[v - 1][0], levels_[v][0], {}, 1.0, 0.5, cv::INTER_AREA);
    }
    for (std::size_t u = 1; u < kLevels; ++u) {
      cv::resize(levels_[v][u - 1], levels_[v][u], {}, 0.5, 1.0, cv::INTER_AREA);
    }
  }
}

float Ripmap::bilinear(int level_u, int level_v, float u, float v) const {
  const auto& texels =
      levels_[static_cast<std::size_t>(level_v)][static_cast<std::size_t>(level_u)];
  // The texel [k, k + 1) of level 0 has its centre at k + 0.5.
  const float x = u / static_cast<float>(1 << level_u) - 0.5F;
  const float y = v / static_cast<float>(1 << level_v) - 0.5F;
  const float floor_x = std::floor(x);
  const float floor_y = std::floor(y);
  const float tx = x - floor_x;
  const float ty = y - floor_y;
  const int x0 = static_cast<int>(floor_x) & (texels.cols - 1);
  const int x1 = (x0 + 1) & (texels.cols - 1);
  const int y0 = static_cast<int>(floor_y) & (texels.rows - 1);
  const auto* row0 = texels.ptr<float>(y0);
  const auto* row1 = texels.ptr<float>((y0 + 1) & (texels.rows - 1));
  const float top = row0[x0] + tx * (row0[x1] - row0[x0]);
  const float bottom = row1[x0] + tx * (row1[x1] - row1[x0]);
  return top + ty * (bottom - top);
}

float Ripmap::sample(float u, float v, float width_u, float width_v) const {
  const auto level = [](float width) {
    return std::min(std::log2(std::max(width, 1.0F)), static_cast<float>(kSizeLog2));
  };
  const float lu = level(width_u);
  const float lv = level(width_v);
  const int u0 = std::min(static_cast<int>(lu), kSizeLog2 - 1);
  const int v0 = std::min(static_cast<int>(lv), kSizeLog2 - 1);
  const float tu = lu - static_cast<float>(u0);
  const float tv = lv - static_cast<float>(v0);
  const auto across = [&](int level_v) {
    const float fine = bilinear(u0, level_v, u, v);
    return tu > 0.0F ? fine + tu * (bilinear(u0 + 1, level_v, u, v) - fine) : fine;
  };
  const float fine = across(v0);
  return tv > 0.0F ? fine + tv * (across(v0 + 1) - fine) : fine;
}

Textures::Textures(std::uint64_t seed)
    : grain(octave_noise(hash_of(seed, 'g'), {1.2, 1.3, 0.7, 0.35, 0.22, 0.18, 0.15, 0.12})),
      leaf(leaf_noise(hash_of(seed, 'l'))),
      ridge_rad(hills(seed)) {}

}  // namespace stemvo::synth
