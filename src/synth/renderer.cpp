// SPDX-License-Identifier: MIT
#include "synth/renderer.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <opencv2/core/utility.hpp>

#include "synth/sensor.hpp"

namespace stemvo::synth {

Renderer::Renderer(CameraPath path,
                   const Camera& camera,
                   std::uint64_t seed,
                   const RenderOptions& options)
    : path_(std::move(path)),
      camera_(camera),
      seed_(seed),
      options_(options),
      textures_(seed),
      ambient_(std::holds_alternative<Walk>(path_) ? 0.7 : 0.36) {  // walls light each other
  if (const auto* drive = std::get_if<Drive>(&path_); drive != nullptr && options.traffic) {
    traffic_ = plan_traffic(*drive, hash_of(seed, 'T', options.visit));
  }
  Draw draw = options.visit == 0 ? Draw(seed, 'L') : Draw(seed, 'L', options.visit);
  const double azimuth = draw.in(0.0, 2.0 * kPi);
  const double height = draw.in(0.6, 0.8);  // rad
  to_sun_ = {std::cos(height) * std::sin(azimuth), -std::sin(height),
             std::cos(height) * std::cos(azimuth)};
  gains_.assign(world_from_camera().size(), 1.0F);
  if (options.visit != 0) {
    ambient_ *= draw.in(0.8, 1.25);
    gains_.assign(gains_.size(), draw.in_float(0.75, 1.25));
  }
  if (options.follows_light) {
    follow_light();
  }
}

Scene Renderer::still_scene(std::size_t index) const {
  Scene scene{world_from_camera()[index].translation, to_sun_, ambient_};
  if (const auto* walk = std::get_if<Walk>(&path_)) {
    add_courtyard(walk->courtyard, scene);
  } else {
    const auto& drive = std::get<Drive>(path_);
    add_street(drive.road, drive.arcs_m[index], hash_of(seed_, 0), scene, traffic_.crossings);
  }
  return scene;
}

RenderedFrame Renderer::render(std::size_t index) const {
  constexpr double kMaxBlur_px = 30.0;
  const auto frame_index = static_cast<double>(index);
  const Trajectory& poses = world_from_camera();
  const Rigid3 step =
      pose_at(poses, frame_index - 0.5).inverse() * pose_at(poses, frame_index + 0.5);
  const double near_m = std::holds_alternative<Walk>(path_) ? 1.5 : 4.0;
  const double px_per_s =
      camera_.fx_px * rate_hz() * (step.angle_rad() + step.translation.norm() / near_m);
  // Steps below 1 px within an exposure and below 0.1 px from rows to rows. The number of moments
  // is odd, so that one is in the middle.
  const double blur_px = std::min(px_per_s * options_.exposure_s, kMaxBlur_px);
  const int moments = 1 + 2 * static_cast<int>(std::ceil(0.5 * blur_px));
  const double row_px = px_per_s * options_.readout_s / camera_.height_px;
  const double max_rows = options_.readout_s > 0.0 ? 16.0 : camera_.height_px;
  const int rows_at_once = static_cast<int>(std::clamp(0.1 / (row_px + 1e-9), 1.0, max_rows));
  const double row_frames = options_.readout_s / camera_.height_px * rate_hz();
  const double exposure_frames = options_.exposure_s * rate_hz();
  Scene scene = still_scene(index);
  const std::size_t num_still = scene.faces.size();
  RenderedFrame frame{cv::Mat(camera_.height_px, camera_.width_px, CV_32FC3, cv::Scalar::all(0)),
                      cv::Mat(camera_.height_px, camera_.width_px, CV_32FC1),
                      cv::Mat(camera_.height_px, camera_.width_px, CV_8UC1)};
  for (int row = 0; row < camera_.height_px; row += rows_at_once) {
    const cv::Range rows(row, std::min(row + rows_at_once, camera_.height_px));
    const double middle_row = 0.5 * (rows.start + rows.end - 1);
    for (int moment = 0; moment < moments; ++moment) {
      const double delay = row_frames * (middle_row + 0.5 - 0.5 * camera_.height_px) +
                           exposure_frames * ((moment + 0.5) / moments - 0.5);
      const double at = frame_index + delay;
      if (traffic_.add_at) {
        scene.faces.resize(num_still);
        traffic_.add_at(at, scene);
      }
      const RenderedFrame part = paint(scene, pose_at(poses, at), camera_, textures_, rows,
                                       options_.small_chip ? chip::kFill : 1.0);
      frame.rgb.rowRange(rows) += part.rgb / moments;
      if (moment == moments / 2) {
        part.depth_m.copyTo(frame.depth_m.rowRange(rows));
        part.moving.copyTo(frame.moving.rowRange(rows));
      }
    }
  }
  const std::uint64_t noise =
      hash_of(options_.visit == 0 ? seed_ : hash_of(seed_, 'N', options_.visit), 'n', index);
  frame.rgb = options_.small_chip ? expose_chip(frame.rgb, gains_[index], noise)
                                  : expose(frame.rgb, gains_[index], noise);
  return frame;
}

/// Half a second after the light changes, two thirds of the change are made up for.
void Renderer::follow_light() {
  constexpr double kSettle_s = 0.5;
  constexpr double kTarget = 0.36;
  constexpr int kWidth_px = 32;
  const double scale = static_cast<double>(kWidth_px) / camera_.width_px;
  const int height_px = std::max(1, static_cast<int>(camera_.height_px * scale));
  const Camera coarse{camera_.fx_px * scale,
                      camera_.fy_px * scale,
                      camera_.cx_px * scale,
                      camera_.cy_px * scale,
                      kWidth_px,
                      height_px};
  std::vector<double> means(gains_.size());
  cv::parallel_for_({0, static_cast<int>(means.size())}, [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) {
      const auto index = static_cast<std::size_t>(i);
      const Rigid3 pose = pose_at(world_from_camera(), i);
      const RenderedFrame frame =
          paint(still_scene(index), pose, coarse, textures_, {0, height_px});
      const cv::Scalar mean = cv::mean(frame.rgb);
      means[index] = (mean[0] + mean[1] + mean[2]) / 3.0;
    }
  });
  const double share = 1.0 - std::exp(-1.0 / (kSettle_s * rate_hz()));
  double gain = kTarget / means.front();
  for (std::size_t i = 0; i < gains_.size(); ++i) {
    gains_[i] = static_cast<float>(gain);
    gain *= std::pow(kTarget / (means[i] * gain), share);
  }
}

}  // namespace stemvo::synth
