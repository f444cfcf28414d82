// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "dataset/synth/scene.hpp"
#include "stemvo/geometry/camera.hpp"

namespace stemvo::synth {

/// Eight samples per pixel: four rows of two, each row shifted by its own eighth of a pixel, so
/// that an edge at any angle is met at eight different distances from it.
inline constexpr int kSubRows = 4;
inline constexpr int kSubColumns = 2;
inline constexpr int kSamples = kSubRows * kSubColumns;
/// Where the samples of sub-row j begin, in half pixels.
inline constexpr std::array<double, kSubRows> kRowShift = {0.125, 0.625, 0.375, 0.875};

/// Sample position relative to the centre of its pixel, in pixels.
[[nodiscard]] constexpr double sample_x(int sub_row, int sub_column) {
  return 0.5 * (sub_column + kRowShift[static_cast<std::size_t>(sub_row)]) - 0.5;
}
[[nodiscard]] constexpr double sample_y(int sub_row) { return (sub_row + 0.5) / kSubRows - 0.5; }

/// c[0] * x + c[1] * y + c[2] over pixels.
struct Linear {
  std::array<double, 3> c = {0.0, 0.0, 0.0};
  [[nodiscard]] double at(double x, double y) const { return c[0] * x + c[1] * y + c[2]; }
};

/// A face as the camera sees it. 1/z and texture/z of a plane are linear over the picture, which
/// makes depth and texture exact at every pixel (no interpolation between corners).
struct ScreenFace {
  Linear inverse_z;
  Linear u_over_z;
  Linear v_over_z;
  std::array<Eigen::Vector2d, 5> outline;  ///< pixels, clipped at the near plane
  int num_points = 0;
  double top_px = 0.0;
  double bottom_px = 0.0;
  const Style* style = nullptr;
};

/// nullopt: behind the camera, outside the picture, or seen edge-on.
[[nodiscard]] std::optional<ScreenFace> project_face(const Face& face,
                                                     const Eigen::Matrix3d& camera_from_world,
                                                     const Camera& camera);

/// Some rows of the picture: for each sample the nearest face so far.
class SampleBand {
 public:
  static constexpr int kNothing = -1;

  SampleBand(int width_px, int max_rows);

  void clear(int first_row, int num_rows);
  void draw(const ScreenFace& face, int id);
  /// Faces at the kSamples samples of a pixel, sub-row by sub-row.
  [[nodiscard]] std::array<int, kSamples> ids_at(int column, int row) const;

 private:
  int width_px_;
  int first_row_ = 0;
  int num_rows_ = 0;
  std::vector<float> inverse_z_;
  std::vector<int> ids_;
};

}  // namespace stemvo::synth
