// SPDX-License-Identifier: MIT
#include "synth/materials.hpp"

#include <algorithm>
#include <numeric>

#include <opencv2/imgproc.hpp>

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

/// Mended rectangles: one in three stretches of 7.68 m has one, a little darker or lighter.
float patch_tone(const Sample& at) {
  constexpr float kStretch_m = 7.68F;
  const float stretch = std::floor(at.u / kStretch_m);
  Draw draw(at.style.seed, 'm', static_cast<int>(stretch) & 7);
  if (draw.chance(0.65)) {
    return 0.0F;
  }
  const float begin_u = draw.in_float(0.2, 3.0);
  const float begin_v = draw.in_float(-5.0, 1.0);
  const float length = draw.in_float(1.0, 4.5);
  const float breadth = draw.in_float(0.6, 1.8);
  const float tone = draw.in_float(-0.08, 0.04);
  const float u = at.u - kStretch_m * stretch;
  return tone * box_coverage(u, at.width_u, begin_u, begin_u + length) *
         box_coverage(at.v, at.width_v, begin_v, begin_v + breadth);
}

/// The stone or brick under a footprint, of rows that are shifted by half a stone.
struct Stone {
  const Sample& at;
  float length;
  float breadth;
  int row = static_cast<int>(std::floor(at.v / breadth));
  float u = at.u + (row % 2 == 0 ? 0.0F : 0.5F * length);
  int column = static_cast<int>(std::floor(u / length));
  /// Share of the footprint.
  float joints = std::max(bars_coverage(u, at.width_u, length, 0.012F), at.bars_v(breadth, 0.012F));
  float footprint_share = std::max(at.width_u / length, at.width_v / breadth);
};

/// 1 while a stone, brick or board is larger than the footprint.
float sharpness(float footprint_share) {
  return std::clamp(2.0F - 2.0F * footprint_share, 0.0F, 1.0F);
}

Rgb paving(const Sample& at, float length, float breadth) {
  const Stone stone{at, length, breadth};
  const int period = static_cast<int>(std::lround(static_cast<float>(kTexturePeriod_m) / length));
  const int column = (stone.column % period + period) % period;
  const auto own = static_cast<float>(unit(hash_of(at.style.seed, stone.row, column)) - 0.5);
  return scaled(at.style.albedo, 1.0F + 0.12F * sharpness(stone.footprint_share) * own +
                                     0.08F * at.grain(0.01F, 3.0F) + 0.07F * at.grain(0.06F, 1.0F) -
                                     0.3F * stone.joints);
}

Rgb foliage(const Sample& at, float texel_m, float contrast) {
  const auto shift = static_cast<float>(at.style.seed % 1024U) * 0.04F;
  const float coarse = at.leaf(4.0F * texel_m, shift);
  const float tone =
      std::max(0.08F, 1.0F + contrast * (0.8F * at.leaf(texel_m, shift) + 0.5F * coarse));
  Rgb colour = scaled(at.style.albedo, tone);
  colour[0] += 0.04F * std::max(0.0F, coarse) * at.style.albedo[1];  // sunlit: yellower
  return colour;
}

constexpr float kPlinth_m = 0.6F;
constexpr float kFloor_m = 2.9F;

/// All windows of one house have this in common.
struct WindowPlan {
  Draw draw;
  float length;
  int columns = std::max(1, static_cast<int>(length / draw.in_float(2.1, 3.4)));
  float spacing = length / static_cast<float>(columns);
  float width = std::min(draw.in_float(0.9, 1.5), 0.6F * spacing);
  float height = draw.in_float(1.15, 1.6);
  bool has_shutters = draw.chance(0.35);
  int door_column = static_cast<int>(draw.next() * columns);
};

/// Paints one window (or the door) of the cell whose lower left corner is the origin of `at`.
Rgb opening(const Rgb& wall, const WindowPlan& plan, const Sample& at, int column, int floor) {
  constexpr float kSill_m = 0.9F;
  constexpr float kFrame_m = 0.07F;
  Draw draw(at.style.seed, 'o', column, floor);
  const bool is_door = floor == 0 && column == plan.door_column;
  const float left = 0.5F * (plan.spacing - plan.width);
  const float right = left + plan.width;
  const float low = is_door ? -kPlinth_m : kSill_m;
  const float high = is_door ? 2.0F : kSill_m + plan.height;
  Rgb colour = wall;
  if (plan.has_shutters && !is_door) {
    const float blade = 0.45F * plan.width;
    const float slats = 0.75F + 0.25F * at.bars_v(0.12F, 0.06F);
    colour = blend(colour, {0.22F * slats, 0.26F * slats, 0.20F * slats},
                   at.area(left - blade, right + blade, low, high));
  }
  const float light = draw.in_float(0.6, 0.85);
  const Rgb white = {light, light, light};
  colour = blend(colour, white,
                 at.area(left - kFrame_m, right + kFrame_m, low - kFrame_m, high + kFrame_m));
  if (is_door) {
    const float tone = draw.in_float(0.1, 0.3);
    return blend(colour, {tone * 1.3F, tone, 0.7F * tone}, at.area(left, right, low, high));
  }
  // Glass is dark and a little brighter towards its top; a curtain or blind hides part of some.
  const float glass = draw.in_float(0.05, 0.22);
  const float curtain_m = std::max(0.0F, draw.in_float(-0.8, 0.7)) * plan.height;
  const float bright = glass * (1.0F + 0.5F * (at.v - low) / plan.height);
  const float middle = 0.5F * (left + right);
  colour = blend(colour, {0.9F * bright, bright, 1.1F * bright}, at.area(left, right, low, high));
  colour = blend(colour, {0.58F, 0.56F, 0.52F}, at.area(left, right, high - curtain_m, high));
  colour = blend(colour, white, at.area(middle - 0.03F, middle + 0.03F, low, high));
  return blend(colour, {0.5F, 0.48F, 0.46F},  // sill
               at.area(left - 0.12F, right + 0.12F, low - 0.16F, low - kFrame_m));
}

}  // namespace

namespace materials {

/// Deviations are calibrated to the real clip (docs/synthetic_drives.md).
Rgb asphalt(const Sample& at) {
  constexpr float kGrain = 0.18F;
  constexpr float kMottle = 0.03F;
  constexpr float kDashPeriod_m = 12.288F;  // a fifth of the texture's period
  const float grain = at.grain(0.01F);
  // Tyres polish two tracks 1.5 m apart in each lane.
  const float track = 0.025F * std::cos(4.19F * (at.v - 0.75F));
  const float tone =
      1.0F + kGrain * grain + kMottle * at.grain(0.06F, 7.0F) + track + patch_tone(at);
  // Worn white dashes in the middle of the road.
  const float dashes =
      box_coverage(at.v, at.width_v, -1.82F, -1.71F) * at.bars_u(kDashPeriod_m, 3.3F);
  return blend(scaled(at.style.albedo, tone), {0.62F, 0.62F, 0.60F},
               dashes * std::clamp(0.75F + 0.2F * grain, 0.0F, 1.0F));
}

Rgb parking(const Sample& at) { return paving(at, 0.24F, 0.16F); }
Rgb sidewalk(const Sample& at) { return paving(at, 0.48F, 0.32F); }
Rgb grass(const Sample& at) { return foliage(at, 0.015F, 0.42F); }
Rgb hedge(const Sample& at) { return foliage(at, 0.015F, 0.75F); }
Rgb near_hedge(const Sample& at) { return foliage(at, 0.006F, 0.6F); }
Rgb bark(const Sample& at) { return foliage(at, 0.01F, 0.3F); }
Rgb leaves(const Sample& at) { return foliage(at, 0.02F, 0.75F); }

Rgb kerb(const Sample& at) {
  return scaled(at.style.albedo, 1.0F + 0.12F * at.grain(0.01F, 5.0F) +
                                     0.08F * at.grain(0.06F, 2.0F) -
                                     0.4F * at.bars_u(0.96F, 0.015F));
}

Rgb roof(const Sample& at) {
  const auto shift = static_cast<float>(at.style.seed % 97U);
  return scaled(at.style.albedo,
                1.0F - 0.3F * at.bars_v(0.33F, 0.06F) - 0.18F * at.bars_u(0.25F, 0.05F) +
                    0.12F * at.grain(0.03F, shift) + 0.08F * at.grain(0.25F, shift));
}

Rgb fence(const Sample& at) {
  return scaled(at.style.albedo, 1.0F - 0.6F * at.bars_u(0.16F, 0.03F) + 0.15F * at.grain(0.02F));
}

/// For walls that are seen from a step away: grains of 3 mm, and stains.
Rgb brick(const Sample& at) {
  const Stone stone{at, 0.25F, 0.083F};
  const auto shift = static_cast<float>(at.style.seed % 61U);
  const float own =
      sharpness(stone.footprint_share) *
      (static_cast<float>(unit(hash_of(at.style.seed, stone.row, stone.column))) - 0.5F);
  const float stains = 0.06F * at.grain(0.03F, shift) + 0.10F * at.leaf(0.04F, shift);
  const float tone = 1.0F + 0.55F * own + 0.10F * at.grain(0.003F, shift) + stains;
  const float gray = 0.46F * (1.0F + 0.06F * at.grain(0.004F, shift) + stains);
  return blend(scaled(at.style.albedo, tone), {gray, 0.97F * gray, 0.92F * gray}, stone.joints);
}

/// Planks with streaks along them and gaps between them.
Rgb boards(const Sample& at) {
  constexpr float kWidth_m = 0.13F;
  const auto board = static_cast<int>(std::floor(at.u / kWidth_m));
  const float own = sharpness(at.width_u / kWidth_m) *
                    (static_cast<float>(unit(hash_of(at.style.seed, board))) - 0.5F);
  Sample along = at;  // ten times as long as wide
  along.v = 0.1F * at.v + 1.7F * static_cast<float>(board);
  along.width_v = 0.1F * at.width_v;
  const auto shift = static_cast<float>(at.style.seed % 53U);
  const float tone = 1.0F + 0.5F * own + 0.16F * along.grain(0.004F, shift) +
                     0.12F * along.leaf(0.01F, shift) + 0.06F * at.grain(0.02F, shift);
  return scaled(at.style.albedo,
                std::max(0.1F, tone) * (1.0F - 0.75F * at.bars_u(kWidth_m, 0.008F)));
}

Rgb plain_wall(const Sample& at) {
  const auto shift = static_cast<float>(at.style.seed % 61U);
  const float tone = 1.0F + 0.05F * at.grain(0.015F, shift) + 0.06F * at.grain(0.06F, shift);
  const float plinth = box_coverage(at.v, at.width_v, -10.0F, kPlinth_m);
  const float dirt = 0.12F * std::clamp(1.5F - 0.8F * at.v, 0.0F, 1.0F);
  return scaled(at.style.albedo, tone * (1.0F - dirt) * (1.0F - 0.35F * plinth));
}

Rgb facade(const Sample& at) {
  const WindowPlan plan{Draw(at.style.seed, 'w'), at.style.size[0]};
  const int floors =
      std::max(1, static_cast<int>(std::lround((at.style.size[1] - kPlinth_m) / kFloor_m)));
  const int column = std::clamp(static_cast<int>(at.u / plan.spacing), 0, plan.columns - 1);
  const int floor =
      std::clamp(static_cast<int>(std::floor((at.v - kPlinth_m) / kFloor_m)), 0, floors - 1);
  Sample cell = at;
  cell.u -= plan.spacing * static_cast<float>(column);
  cell.v -= kPlinth_m + kFloor_m * static_cast<float>(floor);
  return opening(plain_wall(at), plan, cell, column, floor);
}

}  // namespace materials

float box_coverage(float x, float width, float begin, float end) {
  const float w = std::max(width, 1e-6F);
  const float inside = std::min(x + 0.5F * w, end) - std::max(x - 0.5F * w, begin);
  return std::clamp(inside / w, 0.0F, 1.0F);
}

float bars_coverage(float x, float width, float period, float bar) {
  const float w = std::max(width, 1e-6F);
  const auto integral = [&](float t) {  // length of bar in [0, t)
    const float k = std::floor(t / period);
    return k * bar + std::min(t - k * period, bar);
  };
  // Counted from the cell of x, so that the difference of two long lengths loses nothing.
  const float local = x - period * std::floor(x / period);
  return std::clamp((integral(local + 0.5F * w) - integral(local - 0.5F * w)) / w, 0.0F, 1.0F);
}

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

std::vector<float> octave_noise(std::uint64_t seed, const std::vector<double>& amplitudes) {
  std::vector<float> values(kSize * kSize, 0.0F);
  for (std::size_t octave = 0; octave < amplitudes.size(); ++octave) {
    add_value_noise(hash_of(seed, octave), kSize >> octave, amplitudes[octave], values);
  }
  return values;
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
