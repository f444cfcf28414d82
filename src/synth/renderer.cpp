// SPDX-License-Identifier: MIT
#include "synth/renderer.hpp"

#include <algorithm>
#include <optional>
#include <span>
#include <utility>

#include <opencv2/imgproc.hpp>

namespace stemvo::synth {
namespace {

constexpr int kBandRows = 16;  // the samples of so many rows stay in the processor's cache

/// Eight samples per pixel: four rows of two, each row shifted by its own eighth of a pixel, so
/// that an edge at any angle is met at eight different distances from it.
constexpr int kSubRows = 4;
constexpr int kSubColumns = 2;
constexpr int kSamples = kSubRows * kSubColumns;
/// The samples of sub-row j begin here, in half pixels.
constexpr std::array<double, kSubRows> kRowShift = {0.125, 0.625, 0.375, 0.875};
constexpr int kNothing = -1;  ///< in place of a face's index: the backdrop

/// Position of a sample relative to the centre of its pixel, in pixels.
Vec2 sample(int k) {
  const auto sub_row = static_cast<std::size_t>(k / kSubColumns);
  return {0.5 * (k % kSubColumns + kRowShift[sub_row]) - 0.5,
          (static_cast<double>(sub_row) + 0.5) / kSubRows - 0.5};
}

/// A function that is linear over the image, at a pixel.
double at(const Vec3& linear, const Vec2& pixel) {
  return linear.x() * pixel.x() + linear.y() * pixel.y() + linear.z();
}

/// A face as the camera sees it. 1/z and texture/z of a plane are linear over the image, which
/// makes depth and texture exact at every pixel (no interpolation between corners).
struct ScreenFace {
  const Style* style = nullptr;
  Vec3 inverse_z;
  std::array<Vec3, 2> texture_over_z;
  std::array<Vec2, 5> outline;  ///< pixels, clipped at the near plane
  std::size_t num_points = 0;
  Eigen::AlignedBox2d bounds;  ///< around the outline
};

/// Sets the outline: the part of the polygon before the near plane (Sutherland and Hodgman). False:
/// it is outside the image.
bool project_outline(std::span<const Vec3> points, const Camera& camera, ScreenFace& face) {
  constexpr double kNear_m = 0.15;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3& a = points[i];
    const Vec3& b = points[(i + 1) % points.size()];
    if (a.z() >= kNear_m) {
      face.outline[face.num_points++] = camera.project(a);
    }
    if ((a.z() >= kNear_m) != (b.z() >= kNear_m)) {
      face.outline[face.num_points++] =
          camera.project(a + (kNear_m - a.z()) / (b.z() - a.z()) * (b - a));
    }
  }
  for (const Vec2& point : std::span(face.outline).first(face.num_points)) {
    face.bounds.extend(point);
  }
  const Vec2 half(0.5, 0.5);
  return face.bounds.intersects({-half, Vec2(camera.width_px, camera.height_px) - half});
}

/// nullopt: behind the camera, outside the image, or seen edge-on.
std::optional<ScreenFace> project_face(const Face& face,
                                       const Eigen::Matrix3d& camera_from_world,
                                       const Camera& camera) {
  std::array<Vec3, 4> points;
  for (std::size_t i = 0; i < face.num_points; ++i) {
    points[i] = camera_from_world * face.points[i].cast<double>();
  }
  ScreenFace out;
  out.style = &face.style;
  if (!project_outline(std::span(points).first(face.num_points), camera, out)) {
    return std::nullopt;
  }
  const Vec3 e1 = points[1] - points[0];
  const Vec3 e2 = points[2] - points[0];
  const Vec3 normal = e1.cross(e2);
  const double area2 = normal.squaredNorm();
  const double offset = normal.dot(points[0]);
  if (!(area2 > 1e-16) || !(std::abs(offset) > 1e-9 * std::sqrt(area2))) {
    return std::nullopt;
  }
  // The function of camera coordinates g . P, divided by z, over pixels.
  const auto over_pixels = [&](const Vec3& g) -> Vec3 {
    const double gx = g.x() / camera.fx_px;
    const double gy = g.y() / camera.fy_px;
    return {gx, gy, g.z() - gx * camera.cx_px - gy * camera.cy_px};
  };
  const Vec3 plane = normal / offset;  // plane . P = 1 on the face
  out.inverse_z = over_pixels(plane);
  for (int axis = 0; axis < 2; ++axis) {
    // A texture coordinate t on the plane has the gradient g with g.e1 = dt1, g.e2 = dt2, g.n = 0.
    const double t0 = static_cast<double>(face.texture[0][axis]);
    const double d1 = static_cast<double>(face.texture[1][axis]) - t0;
    const double d2 = static_cast<double>(face.texture[2][axis]) - t0;
    const Vec3 g = (d1 * e2.cross(normal) + d2 * normal.cross(e1)) / area2;
    out.texture_over_z[static_cast<std::size_t>(axis)] =
        over_pixels(g + (t0 - g.dot(points[0])) * plane);
  }
  return out;
}

/// Where the outline crosses the row y, from the left to the right.
std::pair<double, double> crossings(const ScreenFace& face, double y) {
  double left = std::numeric_limits<double>::max();
  double right = std::numeric_limits<double>::lowest();
  for (std::size_t i = 0; i < face.num_points; ++i) {
    // Ends are ordered, so that two faces find the same point on the edge they share.
    const Vec2* a = &face.outline[i];
    const Vec2* b = &face.outline[i + 1 == face.num_points ? 0 : i + 1];
    if (b->y() < a->y()) {
      std::swap(a, b);
    }
    if (a->y() <= y && y < b->y()) {
      const double x = a->x() + (y - a->y()) / (b->y() - a->y()) * (b->x() - a->x());
      left = std::min(left, x);
      right = std::max(right, x);
    }
  }
  return {left, right};
}

/// First whole number at or above `value`, within [0, end].
int first_from(double value, int end) {
  return static_cast<int>(std::ceil(std::clamp(value, 0.0, static_cast<double>(end))));
}

cv::Vec3f to_vector(const Rgb& colour) { return {colour[0], colour[1], colour[2]}; }

/// One frame while it is drawn, by bands of rows.
struct FramePainter {
  const Camera& camera;
  const Textures& textures;
  Eigen::Matrix3d world_from_camera;
  std::vector<ScreenFace> faces;
  int row_width = camera.width_px * kSubColumns;  ///< samples
  std::vector<float> inverse_z = {};              ///< per sample of the band
  std::vector<int> ids = {};                      ///< the same: the nearest face

  RenderedFrame paint() {
    RenderedFrame frame{cv::Mat(camera.height_px, camera.width_px, CV_32FC3),
                        cv::Mat(camera.height_px, camera.width_px, CV_32FC1)};
    for (int row = 0; row < camera.height_px; ++row) {
      if (row % kBandRows == 0) {
        draw_band(row, std::min(row + kBandRows, camera.height_px));
      }
      for (int column = 0; column < camera.width_px; ++column) {
        resolve(column, row, frame);
      }
    }
    return frame;
  }

  /// For each sample of the rows [first_row, end_row): the nearest face.
  void draw_band(int first_row, int end_row) {
    const int num_sub_rows = (end_row - first_row) * kSubRows;
    const auto count = static_cast<std::size_t>(row_width * num_sub_rows);
    inverse_z.assign(count, 0.0F);  // infinitely far
    ids.assign(count, kNothing);
    const double first_y = first_row + sample(0).y();
    const auto sub_row_from = [&](double y) {
      return first_from((y - first_y) * kSubRows, num_sub_rows);
    };
    for (std::size_t i = 0; i < faces.size(); ++i) {
      for (int r = sub_row_from(faces[i].bounds.min().y());
           r < sub_row_from(faces[i].bounds.max().y()); ++r) {
        draw_sub_row(static_cast<int>(i), r, first_y + static_cast<double>(r) / kSubRows);
      }
    }
  }

  void draw_sub_row(int id, int sub_row, double y) {
    const ScreenFace& face = faces[static_cast<std::size_t>(id)];
    const auto [left, right] = crossings(face, y);
    const double shift = kRowShift[static_cast<std::size_t>(sub_row % kSubRows)];
    const int begin = first_from(kSubColumns * (left + 0.5) - shift, row_width);
    const int end = first_from(kSubColumns * (right + 0.5) - shift, row_width);
    const auto base = static_cast<float>(at(face.inverse_z, {shift / kSubColumns - 0.5, y}));
    const auto step = static_cast<float>(face.inverse_z.x() / kSubColumns);
    float* z = inverse_z.data() + static_cast<std::ptrdiff_t>(sub_row) * row_width;
    int* nearest = ids.data() + static_cast<std::ptrdiff_t>(sub_row) * row_width;
    for (int k = begin; k < end; ++k) {
      const float value = base + static_cast<float>(k) * step;
      const bool is_nearer = value > z[k];
      z[k] = is_nearer ? value : z[k];
      nearest[k] = is_nearer ? id : nearest[k];
    }
  }

  /// Each face seen by a pixel is painted once, at the middle of the samples it holds.
  void resolve(int column, int row, RenderedFrame& frame) const {
    std::array<int, kSamples> seen{};
    for (int k = 0; k < kSamples; ++k) {
      const int sub_row = row % kBandRows * kSubRows + k / kSubColumns;
      seen[static_cast<std::size_t>(k)] = ids[static_cast<std::size_t>(
          sub_row * row_width + column * kSubColumns + k % kSubColumns)];
    }
    cv::Vec3f light(0.0F, 0.0F, 0.0F);
    int max_count = 0;
    for (auto first = seen.begin(); first != seen.end(); ++first) {
      if (std::find(seen.begin(), first, *first) != first) {
        continue;  // painted already
      }
      Vec2 sum(0.0, 0.0);
      int count = 0;
      for (int k = 0; k < kSamples; ++k) {
        if (seen[static_cast<std::size_t>(k)] == *first) {
          sum += sample(k);
          ++count;
        }
      }
      const Vec2 middle = Vec2(column, row) + sum / count;
      light += colour_of(*first, middle) * (static_cast<float>(count) / kSamples);
      if (count > max_count) {
        max_count = count;
        frame.depth_m.at<float>(row, column) = depth_of(*first, Vec2(column, row), middle);
      }
    }
    frame.rgb.at<cv::Vec3f>(row, column) = light;
  }

  [[nodiscard]] cv::Vec3f colour_of(int id, const Vec2& pixel) const {
    const Vec2 ray = camera.normalize(pixel);
    const Vec3 direction(ray.x(), ray.y(), 1.0);
    const auto backdrop = [&] {
      return to_vector(sky_colour(world_from_camera * direction, 1.0 / camera.fx_px, textures));
    };
    if (id == kNothing) {
      return backdrop();
    }
    const ScreenFace& face = faces[static_cast<std::size_t>(id)];
    const double z = 1.0 / at(face.inverse_z, pixel);
    const Material material = face.style->material;
    const Rgb albedo =
        material == nullptr ? face.style->albedo : material(sample_of(face, pixel, z));
    const auto distance_m = static_cast<float>(z * direction.norm());
    const float haze = 1.0F - std::exp(-distance_m / 700.0F);
    const cv::Vec3f lit =
        to_vector(albedo) * (face.style->light * (1.0F - haze)) + to_vector(kHaze) * haze;
    // Things dissolve into the backdrop and are gone before the drawn part of a street ends:
    // nothing pops up.
    const float far = smooth_step(110.0F, 165.0F, distance_m);
    return far > 0.0F ? lit * (1.0F - far) + backdrop() * far : lit;
  }

  [[nodiscard]] Sample sample_of(const ScreenFace& face, const Vec2& pixel, double z) const {
    Sample sample{*face.style, textures};
    const auto texture = [&](const Vec3& over_z, float& value, float& width) {
      const double t = at(over_z, pixel) * z;
      const double dx = z * (over_z.x() - t * face.inverse_z.x());
      const double dy = z * (over_z.y() - t * face.inverse_z.y());
      value = static_cast<float>(t);
      width = static_cast<float>(std::sqrt(dx * dx + dy * dy));
    };
    texture(face.texture_over_z[0], sample.u, sample.width_u);
    texture(face.texture_over_z[1], sample.v, sample.width_v);
    return sample;
  }

  /// At the pixel's centre on the plane of the face; if that point is far off the part of the face
  /// the pixel really sees (an outline seen at a grazing angle), at the middle of that part.
  [[nodiscard]] float depth_of(int id, const Vec2& pixel, const Vec2& middle) const {
    if (id == kNothing) {
      return std::numeric_limits<float>::infinity();
    }
    const Vec3& over_image = faces[static_cast<std::size_t>(id)].inverse_z;
    const double seen = at(over_image, middle);
    const double centre = at(over_image, pixel);
    const bool is_near = std::abs(centre - seen) <= 0.1 * seen;
    return static_cast<float>(1.0 / (is_near ? centre : seen));
  }
};

/// A perfect camera sees this: RGB as CV_32FC3, where 1 is white.
RenderedFrame paint_scene(const Scene& scene,
                          const Rigid3& world_from_camera,
                          const Camera& camera,
                          const Textures& textures) {
  FramePainter painter{camera, textures, world_from_camera.rotation_matrix(), {}};
  const Eigen::Matrix3d camera_from_world = painter.world_from_camera.transpose();
  for (const Face& face : scene.faces()) {
    if (const auto seen = project_face(face, camera_from_world, camera)) {
      painter.faces.push_back(*seen);
    }
  }
  return painter.paint();
}

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
cv::Mat expose(const cv::Mat& light, float exposure, std::uint64_t seed) {
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
      const float gain = exposure * 255.0F * (1.0F - kCornerLoss * (dx * dx + dy * dy) / corner2);
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

Renderer::Renderer(CameraPath path, const Camera& camera, std::uint64_t seed, int visit)
    : path_(std::move(path)),
      camera_(camera),
      seed_(seed),
      noise_seed_(visit == 0 ? seed : hash_of(seed, 'N', visit)),
      textures_(seed),
      daylight_(daylight(seed, visit)) {}

const Trajectory& Renderer::world_from_camera() const {
  return std::visit([](const auto& path) -> const Trajectory& { return path.world_from_camera; },
                    path_);
}

RenderedFrame Renderer::render(std::size_t index) const {
  const Rigid3& pose = world_from_camera()[index];
  const auto* walk = std::get_if<Walk>(&path_);
  const double ambient = walk != nullptr ? 0.7 : 0.36;  // walls light each other
  Scene scene(pose.translation, daylight_.to_sun, ambient * daylight_.ambient_factor);
  if (walk != nullptr) {
    add_courtyard(walk->courtyard, scene);
  } else {
    const auto& drive = std::get<Drive>(path_);
    add_street(drive.road, drive.arcs_m[index], hash_of(seed_, 0), scene);
  }
  RenderedFrame frame = paint_scene(scene, pose, camera_, textures_);
  frame.rgb = expose(frame.rgb, daylight_.gain, hash_of(noise_seed_, 'n', index));
  return frame;
}

}  // namespace stemvo::synth
