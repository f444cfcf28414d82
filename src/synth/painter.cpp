// SPDX-License-Identifier: MIT
#include <algorithm>
#include <limits>
#include <optional>
#include <span>

#include "synth/materials.hpp"
#include "synth/renderer.hpp"

namespace stemvo::synth {
namespace {

constexpr int kBandRows = 16;  // its samples stay in the processor's cache

/// Eight samples per pixel: four rows of two, each row shifted by its own eighth of a pixel, so
/// that an edge at any angle is met at eight different distances from it.
constexpr int kSubRows = 4;
constexpr int kSubColumns = 2;
constexpr int kSamples = kSubRows * kSubColumns;
/// Where the samples of sub-row j begin, in half pixels.
constexpr std::array<double, kSubRows> kRowShift = {0.125, 0.625, 0.375, 0.875};

/// Position of a sample relative to the centre of its pixel, in pixels.
Vec2 sample(int k) {
  const auto sub_row = static_cast<std::size_t>(k / kSubColumns);
  return {0.5 * (k % kSubColumns + kRowShift[sub_row]) - 0.5,
          (static_cast<double>(sub_row) + 0.5) / kSubRows - 0.5};
}

/// c[0] * x + c[1] * y + c[2] over pixels.
struct Linear {
  std::array<double, 3> c = {0.0, 0.0, 0.0};
  [[nodiscard]] double at(const Vec2& pixel) const {
    return c[0] * pixel.x() + c[1] * pixel.y() + c[2];
  }
};

/// A face as the camera sees it. 1/z and texture/z of a plane are linear over the image, which
/// makes depth and texture exact at every pixel (no interpolation between corners).
struct ScreenFace {
  Linear inverse_z;
  Linear u_over_z;
  Linear v_over_z;
  std::array<Vec2, 5> outline;  ///< pixels, clipped at the near plane
  std::size_t num_points = 0;
  double top_px = 0.0;
  double bottom_px = 0.0;
  const Style* style = nullptr;
};

constexpr double kNear_m = 0.15;

/// Writes the part of the polygon with z >= kNear_m (Sutherland and Hodgman) as pixels.
void clip_and_project(std::span<const Vec3> points, const Camera& camera, ScreenFace& out) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3& a = points[i];
    const Vec3& b = points[(i + 1) % points.size()];
    if (a.z() >= kNear_m) {
      out.outline[out.num_points++] = camera.project(a);
    }
    if ((a.z() >= kNear_m) != (b.z() >= kNear_m)) {
      out.outline[out.num_points++] =
          camera.project(a + (kNear_m - a.z()) / (b.z() - a.z()) * (b - a));
    }
  }
}

/// Sets the rows of the outline. False: it is empty or outside the image.
bool find_extent(const Camera& camera, ScreenFace& face) {
  double left = std::numeric_limits<double>::max();
  double right = std::numeric_limits<double>::lowest();
  face.top_px = left;
  face.bottom_px = right;
  for (const Vec2& point : std::span(face.outline).first(face.num_points)) {
    left = std::min(left, point.x());
    right = std::max(right, point.x());
    face.top_px = std::min(face.top_px, point.y());
    face.bottom_px = std::max(face.bottom_px, point.y());
  }
  return face.num_points >= 3 && right >= -0.5 && left <= camera.width_px - 0.5 &&
         face.bottom_px >= -0.5 && face.top_px <= camera.height_px - 0.5;
}

/// The function of camera coordinates g . P, divided by z, over pixels.
Linear over_pixels(const Vec3& g, const Camera& camera) {
  const double gx = g.x() / camera.fx_px;
  const double gy = g.y() / camera.fy_px;
  return {{gx, gy, g.z() - gx * camera.cx_px - gy * camera.cy_px}};
}

/// nullopt: behind the camera, outside the image, or seen edge-on.
std::optional<ScreenFace> project_face(const Face& face,
                                       const Eigen::Matrix3d& camera_from_world,
                                       const Camera& camera) {
  std::array<Vec3, 4> points;
  const auto count = static_cast<std::size_t>(face.num_points);
  for (std::size_t i = 0; i < count; ++i) {
    points[i] = camera_from_world * face.points[i].cast<double>();
  }
  ScreenFace out;
  clip_and_project(std::span(points).first(count), camera, out);
  if (!find_extent(camera, out)) {
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
  const Vec3 plane = normal / offset;  // plane . P = 1 on the face
  out.inverse_z = over_pixels(plane, camera);
  // A texture coordinate t on the plane has the gradient g with g.e1 = dt1, g.e2 = dt2, g.n = 0.
  const auto texture = [&](int axis) {
    const double t0 = static_cast<double>(face.texture[0][axis]);
    const double d1 = static_cast<double>(face.texture[1][axis]) - t0;
    const double d2 = static_cast<double>(face.texture[2][axis]) - t0;
    const Vec3 g = (d1 * e2.cross(normal) + d2 * normal.cross(e1)) / area2;
    return over_pixels(g + (t0 - g.dot(points[0])) * plane, camera);
  };
  out.u_over_z = texture(0);
  out.v_over_z = texture(1);
  out.style = &face.style;
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

/// Some rows of the image: for each sample the nearest face so far.
class SampleBand {
 public:
  static constexpr int kNothing = -1;

  SampleBand(int width_px, int first_row, int num_rows)
      : row_width_(width_px * kSubColumns),
        first_row_(first_row),
        num_sub_rows_(num_rows * kSubRows) {
    const auto count =
        static_cast<std::size_t>(row_width_) * static_cast<std::size_t>(num_sub_rows_);
    inverse_z_.assign(count, 0.0F);  // infinitely far
    ids_.assign(count, kNothing);
  }

  void draw(const ScreenFace& face, int id) {
    const double first_y = first_row_ + sample(0).y();
    const auto sub_row_from = [&](double y) {
      return first_from((y - first_y) * kSubRows, num_sub_rows_);
    };
    const auto step = static_cast<float>(face.inverse_z.c[0] / kSubColumns);
    for (int r = sub_row_from(face.top_px); r < sub_row_from(face.bottom_px); ++r) {
      const double y = first_y + static_cast<double>(r) / kSubRows;
      const auto [left, right] = crossings(face, y);
      const double shift = kRowShift[static_cast<std::size_t>(r % kSubRows)];
      const int begin = first_from(kSubColumns * (left + 0.5) - shift, row_width_);
      const int end = first_from(kSubColumns * (right + 0.5) - shift, row_width_);
      const auto base = static_cast<float>(face.inverse_z.at({shift / kSubColumns - 0.5, y}));
      float* z = inverse_z_.data() + static_cast<std::ptrdiff_t>(r) * row_width_;
      int* ids = ids_.data() + static_cast<std::ptrdiff_t>(r) * row_width_;
      for (int k = begin; k < end; ++k) {
        const float value = base + static_cast<float>(k) * step;
        const bool nearer = value > z[k];
        z[k] = nearer ? value : z[k];
        ids[k] = nearer ? id : ids[k];
      }
    }
  }

  /// Faces at the kSamples samples of a pixel, sub-row by sub-row.
  [[nodiscard]] std::array<int, kSamples> ids_at(int column, int row) const {
    std::array<int, kSamples> ids{};
    auto out = ids.begin();
    for (int j = 0; j < kSubRows; ++j) {
      const auto sub_row = static_cast<std::ptrdiff_t>((row - first_row_) * kSubRows + j);
      out =
          std::copy_n(ids_.begin() + sub_row * row_width_ + column * kSubColumns, kSubColumns, out);
    }
    return ids;
  }

 private:
  int row_width_;  ///< samples
  int first_row_;
  int num_sub_rows_;
  std::vector<float> inverse_z_;
  std::vector<int> ids_;
};

cv::Vec3f to_vector(const Rgb& colour) { return {colour[0], colour[1], colour[2]}; }

/// One frame while it is drawn.
class FramePainter {
 public:
  FramePainter(const Camera& camera, const Rigid3& world_from_camera, const Textures& textures)
      : frame{cv::Mat(camera.height_px, camera.width_px, CV_32FC3),
              cv::Mat(camera.height_px, camera.width_px, CV_32FC1)},
        camera_(camera),
        world_from_camera_(world_from_camera.rotation_matrix()),
        textures_(textures) {}

  void paint(const Scene& scene) {
    const Eigen::Matrix3d camera_from_world = world_from_camera_.transpose();
    for (const Face& face : scene.faces()) {
      if (const auto seen = project_face(face, camera_from_world, camera_)) {
        faces_.push_back(*seen);
      }
    }
    for (int row = 0; row < camera_.height_px; row += kBandRows) {
      paint_band(row, std::min(row + kBandRows, camera_.height_px));
    }
  }

  PaintedFrame frame;

 private:
  void paint_band(int first_row, int end_row) {
    SampleBand band(camera_.width_px, first_row, end_row - first_row);
    for (std::size_t i = 0; i < faces_.size(); ++i) {
      if (faces_[i].bottom_px >= first_row - 0.5 && faces_[i].top_px <= end_row - 0.5) {
        band.draw(faces_[i], static_cast<int>(i));
      }
    }
    for (int row = first_row; row < end_row; ++row) {
      for (int column = 0; column < camera_.width_px; ++column) {
        resolve(band.ids_at(column, row), column, row);
      }
    }
  }

  /// Each face seen by a pixel is painted once, at the middle of the samples it holds.
  void resolve(const std::array<int, kSamples>& ids, int column, int row) {
    cv::Vec3f& out = frame.light.at<cv::Vec3f>(row, column);
    float& depth = frame.depth_m.at<float>(row, column);
    out = cv::Vec3f(0.0F, 0.0F, 0.0F);
    int max_count = 0;
    for (auto first = ids.begin(); first != ids.end(); ++first) {
      if (std::find(ids.begin(), first, *first) != first) {
        continue;  // painted already
      }
      Vec2 sum(0.0, 0.0);
      int count = 0;
      for (int k = 0; k < kSamples; ++k) {
        if (ids[static_cast<std::size_t>(k)] == *first) {
          sum += sample(k);
          ++count;
        }
      }
      const Vec2 middle = Vec2(column, row) + sum / count;
      out += colour_of(*first, middle) * (static_cast<float>(count) / kSamples);
      if (count > max_count) {
        max_count = count;
        depth = depth_of(*first, Vec2(column, row), middle);
      }
    }
  }

  [[nodiscard]] cv::Vec3f colour_of(int id, const Vec2& pixel) const {
    const Vec2 ray = camera_.normalize(pixel);
    const Vec3 direction(ray.x(), ray.y(), 1.0);
    const auto backdrop = [&] {
      return to_vector(sky_colour(world_from_camera_ * direction, 1.0 / camera_.fx_px, textures_));
    };
    if (id == SampleBand::kNothing) {
      return backdrop();
    }
    const ScreenFace& face = faces_[static_cast<std::size_t>(id)];
    const double z = 1.0 / face.inverse_z.at(pixel);
    const Material* material = face.style->material;
    const Rgb albedo = material == nullptr
                           ? face.style->albedo
                           : material->paint(sample_of(face, pixel, z), material->a, material->b);
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
    Sample at{*face.style, textures_};
    const auto texture = [&](const Linear& over_z, float& value, float& width) {
      const double t = over_z.at(pixel) * z;
      const double dx = z * (over_z.c[0] - t * face.inverse_z.c[0]);
      const double dy = z * (over_z.c[1] - t * face.inverse_z.c[1]);
      value = static_cast<float>(t);
      width = static_cast<float>(std::sqrt(dx * dx + dy * dy));
    };
    texture(face.u_over_z, at.u, at.width_u);
    texture(face.v_over_z, at.v, at.width_v);
    return at;
  }

  /// At the pixel's centre on the plane of the face; if that point is far off the part of the face
  /// the pixel really sees (an outline seen at a grazing angle), at the middle of that part.
  [[nodiscard]] float depth_of(int id, const Vec2& pixel, const Vec2& middle) const {
    if (id == SampleBand::kNothing) {
      return std::numeric_limits<float>::infinity();
    }
    const Linear& inverse_z = faces_[static_cast<std::size_t>(id)].inverse_z;
    const double seen = inverse_z.at(middle);
    const double centre = inverse_z.at(pixel);
    const bool is_near = std::abs(centre - seen) <= 0.1 * seen;
    return static_cast<float>(1.0 / (is_near ? centre : seen));
  }

  const Camera& camera_;
  Eigen::Matrix3d world_from_camera_;
  const Textures& textures_;
  std::vector<ScreenFace> faces_;
};

}  // namespace

PaintedFrame paint_scene(const Scene& scene,
                         const Rigid3& world_from_camera,
                         const Camera& camera,
                         const Textures& textures) {
  FramePainter painter(camera, world_from_camera, textures);
  painter.paint(scene);
  return painter.frame;
}

}  // namespace stemvo::synth
