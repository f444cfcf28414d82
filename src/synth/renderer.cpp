// SPDX-License-Identifier: MIT
#include "synth/renderer.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <opencv2/core/utility.hpp>

#include "synth/sensor.hpp"

namespace stemvo::synth {
namespace {

std::vector<const Face*> pointers_to(const Scene& scene) {
  std::vector<const Face*> faces;
  for (const Face& face : scene.faces()) {
    faces.push_back(&face);
  }
  return faces;
}

/// The pose in the axes of a scene around `origin`.
Rigid3 seen_from(const Vec3& origin, const Rigid3& world_from_camera) {
  return {world_from_camera.rotation, world_from_camera.translation - origin};
}

/// How a frame is put together from moments: each group of rows is the mean over some of them.
struct Shutter {
  double row_frames;  ///< readout of a row
  double exposure_frames;
  int rows_at_once;
  int moments;  ///< odd, so that one is in the middle

  /// Frames after the middle of the exposure of the middle row.
  [[nodiscard]] double delay(double row, double height_px, int moment) const {
    return row_frames * (row + 0.5 - 0.5 * height_px) +
           exposure_frames * ((moment + 0.5) / moments - 0.5);
  }
};

/// Steps below 1 px within an exposure and below 0.1 px from rows to rows.
Shutter plan_shutter(const RenderOptions& options,
                     double rate_hz,
                     const Camera& camera,
                     double px_per_s) {
  constexpr int kMaxMoments = 31;
  constexpr int kMaxRows = 16;
  Shutter shutter{};
  shutter.row_frames = options.readout_s / camera.height_px * rate_hz;
  shutter.exposure_frames = options.exposure_s * rate_hz;
  const double blur_px = std::min(px_per_s * options.exposure_s, 1.0 * kMaxMoments);
  shutter.moments = std::min(1 + 2 * static_cast<int>(std::ceil(0.5 * blur_px)), kMaxMoments);
  const double row_px = px_per_s * options.readout_s / camera.height_px;
  shutter.rows_at_once = static_cast<int>(std::clamp(0.1 / (row_px + 1e-9), 1.0, 1.0 * kMaxRows));
  return shutter;
}

}  // namespace

Renderer::Renderer(CameraPath path,
                   const Camera& camera,
                   std::uint64_t seed,
                   const RenderOptions& options)
    : path_(std::move(path)),
      camera_(camera),
      seed_(seed),
      options_(options),
      noise_seed_(options.visit == 0 ? seed : hash_of(seed, 'N', options.visit)),
      textures_(seed),
      daylight_(daylight(seed, options.visit)) {
  if (const auto* drive = std::get_if<Drive>(&path_); drive != nullptr && options.traffic) {
    traffic_ = plan_traffic(*drive, hash_of(seed, 'T', options.visit));
  }
  gains_.assign(world_from_camera().size(), daylight_.gain);
  if (options.follows_light) {
    follow_light();
  }
}

const Trajectory& Renderer::world_from_camera() const {
  return std::visit([](const auto& path) -> const Trajectory& { return path.world_from_camera; },
                    path_);
}

double Renderer::rate_hz() const {
  return std::holds_alternative<Walk>(path_) ? options_.walk_rate_hz : kDriveRate_hz;
}

RenderedFrame Renderer::render(std::size_t index) const {
  RenderedFrame frame = light_of(index);
  const std::uint64_t noise = hash_of(noise_seed_, 'n', index);
  frame.rgb = options_.small_chip ? expose_chip(frame.rgb, gains_[index], noise)
                                  : expose(frame.rgb, gains_[index], noise);
  return frame;
}

Scene Renderer::still_scene(std::size_t index) const {
  const auto* walk = std::get_if<Walk>(&path_);
  const double ambient = walk != nullptr ? 0.7 : 0.36;  // walls light each other
  Scene scene(world_from_camera()[index].translation, daylight_.to_sun,
              ambient * daylight_.ambient_factor);
  if (walk != nullptr) {
    add_courtyard(walk->courtyard, scene);
  } else {
    const auto& drive = std::get<Drive>(path_);
    add_street(drive.road, drive.arcs_m[index], hash_of(seed_, 0), scene, traffic_.crossings);
  }
  return scene;
}

RenderedFrame Renderer::light_of(std::size_t index) const {
  Scene scene = still_scene(index);
  if (options_.exposure_s > 0.0 || options_.readout_s > 0.0) {
    return light_over_time(index, scene);
  }
  if (traffic_.add_at) {
    traffic_.add_at(static_cast<double>(index), scene);
  }
  const Rigid3& pose = world_from_camera()[index];
  return paint(pointers_to(scene), seen_from(pose.translation, pose), camera_, textures_,
               {0, camera_.height_px}, options_.small_chip ? chip::kFill : 1.0);
}

RenderedFrame Renderer::light_over_time(std::size_t index, const Scene& still) const {
  const auto frame_index = static_cast<double>(index);
  const Trajectory& poses = world_from_camera();
  const Vec3 origin = poses[index].translation;
  const Rigid3 step =
      pose_at(poses, frame_index - 0.5).inverse() * pose_at(poses, frame_index + 0.5);
  const double near_m = std::holds_alternative<Walk>(path_) ? 1.5 : 4.0;
  const double px_per_s =
      camera_.fx_px * rate_hz() * (step.angle_rad() + step.translation.norm() / near_m);
  const Shutter shutter = plan_shutter(options_, rate_hz(), camera_, px_per_s);
  RenderedFrame frame{cv::Mat(camera_.height_px, camera_.width_px, CV_32FC3, cv::Scalar::all(0)),
                      cv::Mat(camera_.height_px, camera_.width_px, CV_32FC1),
                      cv::Mat(camera_.height_px, camera_.width_px, CV_8UC1)};
  const std::vector<const Face*> still_faces = pointers_to(still);
  for (int row = 0; row < camera_.height_px; row += shutter.rows_at_once) {
    const cv::Range rows(row, std::min(row + shutter.rows_at_once, camera_.height_px));
    const double middle_row = 0.5 * (rows.start + rows.end - 1);
    for (int moment = 0; moment < shutter.moments; ++moment) {
      const double at = frame_index + shutter.delay(middle_row, camera_.height_px, moment);
      Scene moving = still.without_faces();
      std::vector<const Face*> faces = still_faces;
      if (traffic_.add_at) {
        traffic_.add_at(at, moving);
        std::ranges::copy(pointers_to(moving), std::back_inserter(faces));
      }
      const RenderedFrame part = paint(faces, seen_from(origin, pose_at(poses, at)), camera_,
                                       textures_, rows, options_.small_chip ? chip::kFill : 1.0);
      frame.rgb.rowRange(rows) += part.rgb / shutter.moments;
      if (moment == shutter.moments / 2) {
        part.depth_m.copyTo(frame.depth_m.rowRange(rows));
        part.moving.copyTo(frame.moving.rowRange(rows));
      }
    }
  }
  return frame;
}

/// Half a second after the light changes, two thirds of the change are made up for.
void Renderer::follow_light() {
  constexpr double kSettle_s = 0.5;
  constexpr double kTarget = 0.36;
  Camera coarse = camera_;
  const double scale = 32.0 / camera_.width_px;
  coarse.fx_px *= scale;
  coarse.fy_px *= scale;
  coarse.cx_px *= scale;
  coarse.cy_px *= scale;
  coarse.width_px = 32;
  coarse.height_px = std::max(1, static_cast<int>(camera_.height_px * scale));
  std::vector<double> means(gains_.size());
  cv::parallel_for_({0, static_cast<int>(means.size())}, [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) {
      const auto index = static_cast<std::size_t>(i);
      const Scene scene = still_scene(index);
      const Rigid3& pose = world_from_camera()[index];
      const cv::Scalar mean = cv::mean(paint(pointers_to(scene), seen_from(pose.translation, pose),
                                             coarse, textures_, {0, coarse.height_px})
                                           .rgb);
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
