// SPDX-License-Identifier: MIT
#include "dataset/synth/rasterizer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

namespace stemvo::synth {
namespace {

constexpr double kNear_m = 0.15;

/// Writes the part of the polygon with z >= kNear_m (Sutherland and Hodgman) as pixels.
void clip_and_project(const std::array<Eigen::Vector3d, 4>& points,
                      int count,
                      const Camera& camera,
                      ScreenFace& out) {
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d& a = points[static_cast<std::size_t>(i)];
    const Eigen::Vector3d& b = points[static_cast<std::size_t>((i + 1) % count)];
    if (a.z() >= kNear_m) {
      out.outline[static_cast<std::size_t>(out.num_points++)] = camera.project(a);
    }
    if ((a.z() >= kNear_m) != (b.z() >= kNear_m)) {
      const Eigen::Vector3d cut = a + (kNear_m - a.z()) / (b.z() - a.z()) * (b - a);
      out.outline[static_cast<std::size_t>(out.num_points++)] = camera.project(cut);
    }
  }
}

bool is_outside(const ScreenFace& face, const Camera& camera) {
  double left = std::numeric_limits<double>::max();
  double right = std::numeric_limits<double>::lowest();
  for (int i = 0; i < face.num_points; ++i) {
    left = std::min(left, face.outline[static_cast<std::size_t>(i)].x());
    right = std::max(right, face.outline[static_cast<std::size_t>(i)].x());
  }
  return right < -0.5 || left > camera.width_px - 0.5 || face.bottom_px < -0.5 ||
         face.top_px > camera.height_px - 0.5;
}

/// The function of camera coordinates g . P, divided by z, over pixels.
Linear over_pixels(const Eigen::Vector3d& g, const Camera& camera) {
  const double gx = g.x() / camera.fx_px;
  const double gy = g.y() / camera.fy_px;
  return {{gx, gy, g.z() - gx * camera.cx_px - gy * camera.cy_px}};
}

}  // namespace

std::optional<ScreenFace> project_face(const Face& face,
                                       const Eigen::Matrix3d& camera_from_world,
                                       const Camera& camera) {
  std::array<Eigen::Vector3d, 4> points;
  bool any_in_front = false;
  for (int i = 0; i < face.num_points; ++i) {
    const auto k = static_cast<std::size_t>(i);
    points[k] = camera_from_world * face.points[k].cast<double>();
    any_in_front = any_in_front || points[k].z() > kNear_m;
  }
  if (!any_in_front) {
    return std::nullopt;
  }
  ScreenFace out;
  clip_and_project(points, face.num_points, camera, out);
  const auto end = out.outline.begin() + out.num_points;
  const auto by_y = [](const auto& a, const auto& b) { return a.y() < b.y(); };
  const auto [top, bottom] = std::minmax_element(out.outline.begin(), end, by_y);
  out.top_px = top->y();
  out.bottom_px = bottom->y();
  if (out.num_points < 3 || is_outside(out, camera)) {
    return std::nullopt;
  }
  const Eigen::Vector3d e1 = points[1] - points[0];
  const Eigen::Vector3d e2 = points[2] - points[0];
  const Eigen::Vector3d normal = e1.cross(e2);
  const double area2 = normal.squaredNorm();
  const double offset = normal.dot(points[0]);
  if (!(area2 > 1e-16) || !(std::abs(offset) > 1e-9 * std::sqrt(area2))) {
    return std::nullopt;
  }
  const Eigen::Vector3d plane = normal / offset;  // plane . P = 1 on the face
  out.inverse_z = over_pixels(plane, camera);
  // A texture coordinate t on the plane has the gradient g with g.e1 = dt1, g.e2 = dt2, g.n = 0.
  const auto texture = [&](int axis) {
    const double t0 = static_cast<double>(face.texture[0][axis]);
    const double d1 = static_cast<double>(face.texture[1][axis]) - t0;
    const double d2 = static_cast<double>(face.texture[2][axis]) - t0;
    const Eigen::Vector3d g = (d1 * e2.cross(normal) + d2 * normal.cross(e1)) / area2;
    return over_pixels(g + (t0 - g.dot(points[0])) * plane, camera);
  };
  out.u_over_z = texture(0);
  out.v_over_z = texture(1);
  out.style = &face.style;
  return out;
}

SampleBand::SampleBand(int width_px, int max_rows) : width_px_(width_px) {
  const auto count = static_cast<std::size_t>(width_px) * static_cast<std::size_t>(max_rows);
  inverse_z_.resize(count * kSamples);
  ids_.resize(count * kSamples);
}

void SampleBand::clear(int first_row, int num_rows) {
  first_row_ = first_row;
  num_rows_ = num_rows;
  std::fill(inverse_z_.begin(), inverse_z_.end(), 0.0F);  // infinitely far
  std::fill(ids_.begin(), ids_.end(), kNothing);
}

void SampleBand::draw(const ScreenFace& face, int id) {
  const double first_y = first_row_ + sample_y(0);
  const int num_sub_rows = num_rows_ * kSubRows;
  const auto sub_row_from = [&](double y) {  // first sub-row at or below y
    return static_cast<int>(
        std::ceil(std::clamp((y - first_y) * kSubRows, 0.0, static_cast<double>(num_sub_rows))));
  };
  const int row_width = width_px_ * kSubColumns;
  const auto step = static_cast<float>(face.inverse_z.c[0] / kSubColumns);
  for (int r = sub_row_from(face.top_px); r < sub_row_from(face.bottom_px); ++r) {
    const double y = first_y + static_cast<double>(r) / kSubRows;
    double left = std::numeric_limits<double>::max();
    double right = std::numeric_limits<double>::lowest();
    for (int i = 0; i < face.num_points; ++i) {
      // Ends are ordered, so that two faces find the same point on the edge they share.
      const Eigen::Vector2d* a = &face.outline[static_cast<std::size_t>(i)];
      const Eigen::Vector2d* b =
          &face.outline[static_cast<std::size_t>(i + 1 == face.num_points ? 0 : i + 1)];
      if (b->y() < a->y()) {
        std::swap(a, b);
      }
      if (a->y() <= y && y < b->y()) {
        const double x = a->x() + (y - a->y()) / (b->y() - a->y()) * (b->x() - a->x());
        left = std::min(left, x);
        right = std::max(right, x);
      }
    }
    const double shift = kRowShift[static_cast<std::size_t>(r % kSubRows)];
    const auto sample_from = [&](double x) {  // first sample at or right of x
      return static_cast<int>(std::ceil(
          std::clamp(kSubColumns * (x + 0.5) - shift, 0.0, static_cast<double>(row_width))));
    };
    const int begin = sample_from(left);
    const int end = sample_from(right);
    const auto base = static_cast<float>(face.inverse_z.at(shift / kSubColumns - 0.5, y));
    float* z = inverse_z_.data() + static_cast<std::ptrdiff_t>(r) * row_width;
    int* ids = ids_.data() + static_cast<std::ptrdiff_t>(r) * row_width;
    for (int k = begin; k < end; ++k) {
      const float value = base + static_cast<float>(k) * step;
      const bool nearer = value > z[k];
      z[k] = nearer ? value : z[k];
      ids[k] = nearer ? id : ids[k];
    }
  }
}

std::array<int, kSamples> SampleBand::ids_at(int column, int row) const {
  std::array<int, kSamples> ids{};
  const int row_width = width_px_ * kSubColumns;
  for (int j = 0; j < kSubRows; ++j) {
    const int* from = ids_.data() +
                      static_cast<std::ptrdiff_t>((row - first_row_) * kSubRows + j) * row_width +
                      column * kSubColumns;
    for (int i = 0; i < kSubColumns; ++i) {
      ids[static_cast<std::size_t>(j * kSubColumns + i)] = from[i];
    }
  }
  return ids;
}

}  // namespace stemvo::synth
