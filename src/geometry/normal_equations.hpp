// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "geometry/bundle.hpp"

namespace stemvo {

/// Where a pose sees a point, and how far from its observation.
struct Reprojection {
  Reprojection(const Bundle& bundle,
               const Bundle::Observation& observation,
               const Eigen::Matrix3d& rotation);

  Eigen::Vector3d x;  ///< the point in the camera
  double inverse_z = 0.0;
  double u = 0.0;  ///< its ray
  double v = 0.0;
  double r_sq = 0.0;
  double stretch = 1.0;   ///< of the ray, by the radial distortion
  Eigen::Vector2d error;  ///< px
  double weight = 1.0;    ///< of the robust loss
};

/// The normal equations of a bundle, J^T W J x = -J^T W e, in blocks whose rows stand in the lanes
/// of vectors. The points' part is damped and eliminated (Schur complement).
struct NormalEquations {
  static constexpr int kCamera = 5;  ///< unknowns of the camera

  using Lanes2 = double __attribute__((vector_size(16)));
  using Lanes4 = double __attribute__((vector_size(32), aligned(16)));
  /// Six rows, of a pose; or five, of the camera.
  struct Column {
    [[nodiscard]] double operator[](int row) const { return row < 4 ? lo[row] : hi[row - 4]; }

    Lanes4 lo{};
    Lanes2 hi{};
  };
  template <std::size_t kColumns>
  using Block = std::array<Column, kColumns>;

  template <std::size_t kSize>
  struct Unknowns {
    Column gradient;
    Column diagonal;  ///< before the elimination
    Block<kSize> with_camera;
  };
  using Pose = Unknowns<6>;
  struct Point {
    Lanes4 inverse[3] = {};  ///< of its own 3x3 block
    Lanes4 gradient{};       ///< before the elimination
    Block<3> with_camera;
  };

  NormalEquations(const Bundle& bundle, int fixed, bool with_camera)
      : num_fixed_poses(fixed),
        has_camera(with_camera),
        poses(bundle.camera_from_world.size() - static_cast<std::size_t>(fixed)),
        H_pp(poses.size() * (poses.size() + 1) / 2),
        points(bundle.points.size()),
        H_pl(bundle.observations.size()) {}

  /// Around the bundle; `at` is where it sees each observation. The last digits are those of this
  /// process's instruction set.
  void add_up(const Bundle& bundle, const std::vector<Reprojection>& at, double damping);

  /// The place of the block of the free poses i <= j.
  [[nodiscard]] std::size_t index_of(int i, int j) const {
    return static_cast<std::size_t>(j * (j + 1) / 2 + i);
  }
  [[nodiscard]] int num_free_poses() const { return static_cast<int>(poses.size()); }

  int num_fixed_poses;
  bool has_camera;
  Unknowns<kCamera> camera;
  std::vector<Pose> poses;     ///< the free ones
  std::vector<Block<6>> H_pp;  ///< pose by pose, without the points (see index_of)
  std::vector<Point> points;
  std::vector<Block<3>> H_pl;  ///< pose by landmark, one per observation
};

}  // namespace stemvo
