// SPDX-License-Identifier: MIT
#include "dataset/synth/renderer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dataset/synth/hash.hpp"
#include "dataset/synth/rasterizer.hpp"
#include "dataset/synth/sensor.hpp"

namespace stemvo::synth {
namespace {

constexpr int kBandRows = 16;  // its samples stay in the processor's cache

cv::Vec3f to_vector(const Rgb& colour) { return {colour[0], colour[1], colour[2]}; }

/// One frame while it is drawn.
class FramePainter {
 public:
  FramePainter(const Camera& camera,
               const Rigid3& world_from_camera,
               const Scene& scene,
               const Textures& textures,
               const Sky& sky)
      : camera_(camera),
        world_from_camera_(world_from_camera.rotation_matrix()),
        textures_(textures),
        sky_(sky),
        light_(camera.height_px, camera.width_px, CV_32FC3),
        depth_m_(camera.height_px, camera.width_px, CV_32FC1) {
    const Eigen::Matrix3d camera_from_world = world_from_camera_.transpose();
    bands_.resize(static_cast<std::size_t>((camera.height_px + kBandRows - 1) / kBandRows));
    for (const Face& face : scene.faces()) {
      if (const auto seen = project_face(face, camera_from_world, camera)) {
        file_in_bands(static_cast<int>(faces_.size()), *seen);
        faces_.push_back(*seen);
      }
    }
  }

  void paint_all() {
    SampleBand band(camera_.width_px, kBandRows);
    for (std::size_t i = 0; i < bands_.size(); ++i) {
      const int first_row = static_cast<int>(i) * kBandRows;
      const int num_rows = std::min(kBandRows, camera_.height_px - first_row);
      band.clear(first_row, num_rows);
      for (const int id : bands_[i]) {
        band.draw(faces_[static_cast<std::size_t>(id)], id);
      }
      for (int row = first_row; row < first_row + num_rows; ++row) {
        for (int column = 0; column < camera_.width_px; ++column) {
          resolve(band, column, row);
        }
      }
    }
  }

  [[nodiscard]] const cv::Mat& light() const { return light_; }
  [[nodiscard]] const cv::Mat& depth_m() const { return depth_m_; }

 private:
  void file_in_bands(int id, const ScreenFace& face) {
    const auto band_of = [&](double y) {
      const double band = std::floor((y + 0.5) / kBandRows);
      return static_cast<std::size_t>(
          std::clamp(band, 0.0, static_cast<double>(bands_.size() - 1)));
    };
    for (std::size_t i = band_of(face.top_px); i <= band_of(face.bottom_px); ++i) {
      bands_[i].push_back(id);
    }
  }

  /// Each face seen by a pixel is painted once, at the middle of the samples it holds.
  void resolve(const SampleBand& band, int column, int row) {
    const auto ids = band.ids_at(column, row);
    cv::Vec3f& out = light_.at<cv::Vec3f>(row, column);
    float& depth_m = depth_m_.at<float>(row, column);
    if (std::all_of(ids.begin(), ids.end(), [&](int id) { return id == ids[0]; })) {
      out = colour_of(ids[0], column, row);
      depth_m = depth_of(ids[0], column, row, column, row);
      return;
    }
    out = cv::Vec3f(0.0F, 0.0F, 0.0F);
    unsigned done = 0;
    int most = 0;
    for (int i = 0; i < kSamples; ++i) {
      if ((done >> i & 1U) != 0U) {
        continue;
      }
      double x = 0.0;
      double y = 0.0;
      int count = 0;
      for (int k = i; k < kSamples; ++k) {
        if (ids[static_cast<std::size_t>(k)] == ids[static_cast<std::size_t>(i)]) {
          x += sample_x(k / kSubColumns, k % kSubColumns);
          y += sample_y(k / kSubColumns);
          ++count;
          done |= 1U << k;
        }
      }
      x = column + x / count;
      y = row + y / count;
      const int id = ids[static_cast<std::size_t>(i)];
      out += colour_of(id, x, y) * (static_cast<float>(count) / kSamples);
      if (count > most) {
        most = count;
        depth_m = depth_of(id, column, row, x, y);
      }
    }
  }

  [[nodiscard]] cv::Vec3f colour_of(int id, double x, double y) const {
    const Eigen::Vector2d ray = camera_.normalize({x, y});
    const Eigen::Vector3d direction(ray.x(), ray.y(), 1.0);
    const auto backdrop = [&] {
      return sky_.colour(world_from_camera_ * direction, 1.0 / camera_.fx_px, textures_);
    };
    if (id == SampleBand::kNothing) {
      return to_vector(backdrop());
    }
    const ScreenFace& face = faces_[static_cast<std::size_t>(id)];
    const double z = 1.0 / face.inverse_z.at(x, y);
    Footprint at;
    const auto texture = [&](const Linear& over_z, float& value, float& width) {
      const double t = over_z.at(x, y) * z;
      const double dx = z * (over_z.c[0] - t * face.inverse_z.c[0]);
      const double dy = z * (over_z.c[1] - t * face.inverse_z.c[1]);
      value = static_cast<float>(t);
      width = static_cast<float>(std::sqrt(dx * dx + dy * dy));
    };
    texture(face.u_over_z, at.u, at.width_u);
    texture(face.v_over_z, at.v, at.width_v);
    const Rgb albedo = paint(*face.style, at, textures_);
    const auto distance_m = static_cast<float>(z * direction.norm());
    const float light = face.style->light;
    const float haze = haze_share(distance_m);
    const cv::Vec3f lit = to_vector(albedo) * (light * (1.0F - haze)) + to_vector(kHaze) * haze;
    const float far = backdrop_share(distance_m);
    return far > 0.0F ? lit * (1.0F - far) + to_vector(backdrop()) * far : lit;
  }

  /// At the pixel's centre on the plane of the face; if that point is far off the part of the face
  /// the pixel really sees (an outline seen at a grazing angle), at the middle of that part.
  [[nodiscard]] float depth_of(int id, double x, double y, double seen_x, double seen_y) const {
    if (id == SampleBand::kNothing) {
      return std::numeric_limits<float>::infinity();
    }
    const Linear& inverse_z = faces_[static_cast<std::size_t>(id)].inverse_z;
    const double seen = inverse_z.at(seen_x, seen_y);
    const double centre = inverse_z.at(x, y);
    const bool is_near = std::abs(centre - seen) <= 0.1 * seen;
    return static_cast<float>(1.0 / (is_near ? centre : seen));
  }

  const Camera& camera_;
  Eigen::Matrix3d world_from_camera_;
  const Textures& textures_;
  const Sky& sky_;
  std::vector<ScreenFace> faces_;
  std::vector<std::vector<int>> bands_;
  cv::Mat light_;
  cv::Mat depth_m_;
};

}  // namespace

Renderer::Renderer(std::variant<Drive, Walk> path, const Camera& camera, std::uint64_t seed)
    : path_(std::move(path)), camera_(camera), seed_(seed), textures_(seed), sky_(seed) {
  Draw draw(seed, 'L');
  const double azimuth = draw.in(0.0, 6.283185307179586);
  const double height = draw.in(0.6, 0.8);  // rad
  to_sun_ = {std::cos(height) * std::sin(azimuth), -std::sin(height),
             std::cos(height) * std::cos(azimuth)};
}

const Trajectory& Renderer::world_from_camera() const {
  return std::visit([](const auto& path) -> const Trajectory& { return path.world_from_camera; },
                    path_);
}

Scene Renderer::scene_at(std::size_t index) const {
  const Eigen::Vector3d& position = world_from_camera()[index].translation;
  if (const auto* walk = std::get_if<Walk>(&path_)) {
    return build_courtyard(walk->courtyard, position, to_sun_);
  }
  const auto& drive = std::get<Drive>(path_);
  const FramePlace& place = drive.places[index];
  return build_scene(drive.roads[place.road], place.arc_m, position, to_sun_,
                     hash_of(seed_, place.road));
}

RenderedFrame Renderer::render(std::size_t index) const {
  const Scene scene = scene_at(index);
  FramePainter painter(camera_, world_from_camera()[index], scene, textures_, sky_);
  painter.paint_all();
  return {expose(painter.light(), hash_of(seed_, 'n', index)), painter.depth_m()};
}

}  // namespace stemvo::synth
