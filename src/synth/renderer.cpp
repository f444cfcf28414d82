// SPDX-License-Identifier: MIT
#include "synth/renderer.hpp"

#include <algorithm>
#include <utility>

#include <opencv2/imgproc.hpp>

namespace stemvo::synth {
namespace {

constexpr float kCornerLoss = 0.12F;
constexpr float kReadNoise = 1.3F;     // gray levels
constexpr float kPhotonNoise = 0.06F;  // times the square root of the level

/// Roughly normal, deviation 1: the sum of four uniform numbers of 16 bits each.
float gaussian(std::uint64_t bits) {
  const auto part = [&](int shift) { return static_cast<float>((bits >> shift) & 0xffffU); };
  constexpr float kMean = 4.0F * 32767.5F;
  constexpr float kDeviation = 37837.2F;  // sqrt(4 * 65536^2 / 12)
  return (part(0) + part(16) + part(32) + part(48) - kMean) / kDeviation;
}

/// Lens and chip do to light: a point spread of 0.4 px, corners 12 % darker, noise of about 1.8
/// gray levels per channel, 8 bits. RGB.
cv::Mat expose(const cv::Mat& light, std::uint64_t seed) {
  cv::Mat blurred;
  const cv::Matx13f spread(0.08F, 0.84F, 0.08F);  // variance 0.16 px^2
  cv::sepFilter2D(light, blurred, CV_32F, spread, spread, {-1, -1}, 0.0, cv::BORDER_REPLICATE);
  cv::Mat rgb(light.size(), CV_8UC3);
  const float cx = 0.5F * static_cast<float>(light.cols - 1);
  const float cy = 0.5F * static_cast<float>(light.rows - 1);
  const float corner2 = std::max(cx * cx + cy * cy, 1.0F);
  for (int y = 0; y < light.rows; ++y) {
    const auto* from = blurred.ptr<cv::Vec3f>(y);
    auto* to = rgb.ptr<cv::Vec3b>(y);
    const float dy = static_cast<float>(y) - cy;
    for (int x = 0; x < light.cols; ++x) {
      const float dx = static_cast<float>(x) - cx;
      const float gain = 255.0F * (1.0F - kCornerLoss * (dx * dx + dy * dy) / corner2);
      const std::uint64_t pixel =
          seed ^ (static_cast<std::uint64_t>(y) << 32) ^ (static_cast<std::uint64_t>(x) << 2);
      for (int c = 0; c < 3; ++c) {
        const float level = std::max(0.0F, gain * from[x][c]);
        const float noise = (kReadNoise + kPhotonNoise * std::sqrt(level)) *
                            gaussian(mix(pixel + static_cast<std::uint64_t>(c)));
        to[x][c] = cv::saturate_cast<uchar>(level + noise);
      }
    }
  }
  return rgb;
}

}  // namespace

Renderer::Renderer(std::variant<Drive, Walk> path, const Camera& camera, std::uint64_t seed)
    : path_(std::move(path)), camera_(camera), seed_(seed), textures_(seed) {
  Draw draw(seed, 'L');
  const double azimuth = draw.in(0.0, 2.0 * kPi);
  const double height = draw.in(0.6, 0.8);  // rad
  to_sun_ = {std::cos(height) * std::sin(azimuth), -std::sin(height),
             std::cos(height) * std::cos(azimuth)};
}

const Trajectory& Renderer::world_from_camera() const {
  return std::visit([](const auto& path) -> const Trajectory& { return path.world_from_camera; },
                    path_);
}

Scene Renderer::scene_at(std::size_t index) const {
  const auto* walk = std::get_if<Walk>(&path_);
  const double ambient = walk != nullptr ? 0.7 : 0.36;  // walls light each other
  Scene scene(world_from_camera()[index].translation, to_sun_, ambient);
  if (walk != nullptr) {
    add_courtyard(walk->courtyard, scene);
  } else {
    const auto& drive = std::get<Drive>(path_);
    add_street(drive.road, drive.arcs_m[index], hash_of(seed_, 0), scene);
  }
  return scene;
}

RenderedFrame Renderer::render(std::size_t index) const {
  RenderedFrame frame =
      paint_scene(scene_at(index), world_from_camera()[index], camera_, textures_);
  frame.rgb = expose(frame.rgb, hash_of(seed_, 'n', index));
  return frame;
}

}  // namespace stemvo::synth
