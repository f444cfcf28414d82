// SPDX-License-Identifier: MIT
#include <algorithm>
#include <optional>
#include <span>

#include "synth/renderer.hpp"

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

/// Position of a sample relative to the centre of its pixel, in pixels.
Vec2 sample(int k) {
  const auto sub_row = static_cast<std::size_t>(k / kSubColumns);
  return {0.5 * (k % kSubColumns + kRowShift[sub_row]) - 0.5,
          (static_cast<double>(sub_row) + 0.5) / kSubRows - 0.5};
}

/// Shares of a pixel's light: how much of each sample's cell is in the middle square of side
/// `fill`.
std::array<float, kSamples> sample_weights(double fill) {
  std::array<float, kSamples> weights{};
  weights.fill(1.0F / kSamples);
  if (fill == 1.0) {
    return weights;
  }
  const Vec2 half(0.5, 0.5);
  const Vec2 half_cell(0.5 / kSubColumns, 0.5 / kSubRows);
  const Eigen::AlignedBox2d square(-fill * half, fill * half);
  float sum = 0.0F;
  for (int k = 0; k < kSamples; ++k) {
    const Eigen::AlignedBox2d cell(sample(k) - half_cell, sample(k) + half_cell);
    const Eigen::AlignedBox2d common = square.intersection(cell);
    const double area = common.isEmpty() ? 0.0 : common.volume();
    sum += weights[static_cast<std::size_t>(k)] = static_cast<float>(area);
  }
  for (float& weight : weights) {
    weight /= sum;
  }
  return weights;
}

/// A function that is linear over the image, at a pixel.
double at(const Vec3& linear, const Vec2& pixel) {
  return linear.x() * pixel.x() + linear.y() * pixel.y() + linear.z();
}

const Style kBackdrop;

/// A face as the camera sees it. 1/z and texture/z of a plane are linear over the image, which
/// makes depth and texture exact at every pixel (no interpolation between corners).
struct ScreenFace {
  const Style* style = &kBackdrop;
  Vec3 inverse_z = Vec3::Zero();
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
                                       const Vec3& camera_in_scene,
                                       const Eigen::Matrix3d& camera_from_scene,
                                       const Camera& camera) {
  std::array<Vec3, 4> points;
  for (std::size_t i = 0; i < face.num_points; ++i) {
    points[i] = camera_from_scene * (face.points[i].cast<double>() - camera_in_scene);
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

int first_from(double value, int end) {
  return static_cast<int>(std::ceil(std::clamp(value, 0.0, static_cast<double>(end))));
}

struct FramePainter {
  const Camera& camera;
  const Textures& textures;
  Eigen::Matrix3d world_from_camera;
  cv::Range rows;
  double fill;
  std::array<float, kSamples> weights = sample_weights(fill);  ///< of a pixel's; their sum is 1
  std::vector<ScreenFace> faces = std::vector<ScreenFace>(1);  ///< the first: the backdrop
  int band_begin = 0;                                          ///< first row of the present band
  int row_width = camera.width_px * kSubColumns;               ///< samples
  std::vector<float> inverse_z = {};                           ///< per sample of the band
  std::vector<int> ids = {};                                   ///< the same: the nearest face

  /// For each sample of the rows [first_row, end_row): the nearest face.
  void draw_band(int first_row, int end_row) {
    band_begin = first_row;
    const int num_sub_rows = (end_row - first_row) * kSubRows;
    const auto count = static_cast<std::size_t>(row_width * num_sub_rows);
    inverse_z.assign(count, 0.0F);  // infinitely far
    ids.assign(count, 0);
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
      const int sub_row = (row - band_begin) * kSubRows + k / kSubColumns;
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
      float weight = 0.0F;
      for (int k = 0; k < kSamples; ++k) {
        if (seen[static_cast<std::size_t>(k)] == *first) {
          sum += sample(k);
          ++count;
          weight += weights[static_cast<std::size_t>(k)];
        }
      }
      const ScreenFace& face = faces[static_cast<std::size_t>(*first)];
      const Vec2 middle = Vec2(column, row) + sum / count;
      light += colour_of(face, middle) * weight;
      if (count > max_count) {
        max_count = count;
        // At the pixel's centre on the plane of the face; if that point is far off the part of the
        // face the pixel really sees (an outline seen at a grazing angle), at the middle of that
        // part.
        const double mean = at(face.inverse_z, middle);
        const double centre = at(face.inverse_z, Vec2(column, row));
        const bool is_near = std::abs(centre - mean) <= 0.1 * mean;
        frame.depth_m.at<float>(row - rows.start, column) =
            static_cast<float>(1.0 / (is_near ? centre : mean));
        frame.moving.at<uchar>(row - rows.start, column) = face.style->moves ? 255 : 0;
      }
    }
    frame.rgb.at<cv::Vec3f>(row - rows.start, column) = light;
  }

  [[nodiscard]] cv::Vec3f colour_of(const ScreenFace& face, const Vec2& pixel) const {
    const Vec2 ray = camera.normalize(pixel);
    const Vec3 direction(ray.x(), ray.y(), 1.0);
    const double z = 1.0 / at(face.inverse_z, pixel);
    const Material material = face.style->material;
    const Rgb albedo =
        material == nullptr ? face.style->albedo : material(sample_of(face, pixel, z));
    const auto distance_m = static_cast<float>(z * direction.norm());
    const float haze = 1.0F - std::exp(-distance_m / 700.0F);
    const cv::Vec3f lit = albedo * (face.style->light * (1.0F - haze)) + kHaze * haze;
    // Things dissolve into the backdrop and are gone before the drawn part of a street ends:
    // nothing pops up.
    const float far = smooth_step(110.0F, 165.0F, distance_m);
    if (far == 0.0F) {
      return lit;
    }
    const Rgb backdrop = sky_colour(world_from_camera * direction, 1.0 / camera.fx_px, textures);
    return lit * (1.0F - far) + backdrop * far;
  }

  [[nodiscard]] Sample sample_of(const ScreenFace& face, const Vec2& pixel, double z) const {
    Sample sample{*face.style, textures};
    const auto texture = [&](const Vec3& over_z, float& value, float& width) {
      const double t = at(over_z, pixel) * z;
      const double dx = z * (over_z.x() - t * face.inverse_z.x());
      const double dy = z * (over_z.y() - t * face.inverse_z.y());
      value = static_cast<float>(t);
      width = static_cast<float>(fill * std::sqrt(dx * dx + dy * dy));
    };
    texture(face.texture_over_z[0], sample.u, sample.width_u);
    texture(face.texture_over_z[1], sample.v, sample.width_v);
    return sample;
  }
};

}  // namespace

RenderedFrame paint(const Scene& scene,
                    const Rigid3& world_from_camera,
                    const Camera& camera,
                    const Textures& textures,
                    cv::Range rows,
                    double fill) {
  FramePainter painter{camera, textures, world_from_camera.rotation_matrix(), rows, fill};
  const Vec3 in_scene = world_from_camera.translation - scene.origin;
  const Eigen::Matrix3d camera_from_scene = painter.world_from_camera.transpose();
  for (const Face& face : scene.faces) {
    if (const auto seen = project_face(face, in_scene, camera_from_scene, camera)) {
      painter.faces.push_back(*seen);
    }
  }
  const cv::Size size(camera.width_px, rows.size());
  RenderedFrame frame{cv::Mat(size, CV_32FC3), cv::Mat(size, CV_32FC1),
                      cv::Mat(size, CV_8UC1, cv::Scalar(0))};
  for (int begin = rows.start; begin < rows.end; begin += kBandRows) {
    const int end = std::min(begin + kBandRows, rows.end);
    painter.draw_band(begin, end);
    for (int row = begin; row < end; ++row) {
      for (int column = 0; column < camera.width_px; ++column) {
        painter.resolve(column, row, frame);
      }
    }
  }
  return frame;
}

}  // namespace stemvo::synth
